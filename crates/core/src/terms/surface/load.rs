//! Tractions and pressures on a surface.
//!
//! A traction t keeps its direction and refers to the original area: f_v = Σ N_v t A. The same holds for a dead
//! pressure, f_v = −Σ N_v p n₀ A. Any other pressure p follows the surface,
//!
//! f_v = −Σ N_v p n a,
//!
//! where n a is the area vector of a facet with the carried corners x_k, a function of the displacement increments Δd_w
//! of the nodes that carry them. The tangent of this force is
//!
//! ∂f_v/∂Δd_w = −Σ N_v Σ_k N_w(x_k) (p ∂(n a)/∂x_k + n a ⊗ ∂p/∂x_k),
//!
//! which is not symmetric in general.

use crate::assembly::{System, Wanted};
use crate::model::{Action, Load, Model, Pressure, VectorFormula};
use crate::region::area_derivative;
use crate::step::{At, Nodal, StepContext};
use crate::surface::{Carried, Surface, SurfaceFields};

use super::super::failure::{BeginError, LoadNotFinite};

/// A load on a surface in a step.
pub(super) struct SurfaceLoad<const D: usize> {
    /// Number of the load in the model.
    number: usize,
    /// Index of the surface.
    surface: usize,
    /// Values at the end of the step or, if the load factor follows from equilibrium, at the beginning of the stage.
    values: Values<D>,
    /// Further values per unit load factor, if the load factor follows from equilibrium.
    per_factor: Option<Values<D>>,
    /// True if the load is a pressure that grows with depth and therefore can hold a floating body.
    pub(super) is_hydrostatic: bool,
    resultant: [f64; D],
}

/// The values of a load at the samples.
enum Values<const D: usize> {
    /// Forces, [force].
    Dead(Vec<[f64; D]>),
    /// Pressures, [stress].
    Pressure(Vec<f64>),
    /// Level of the free surface, [length], and weight per volume of the liquid, [force/volume].
    Hydrostatic([f64; 2]),
}

/// A force on a sample, and the pressure from which it follows.
struct OnSample<const D: usize> {
    force: [f64; D],
    pressure: f64,
    /// Derivatives of the pressure with the heights of the corners along the last axis, [stress/length].
    slopes: [f64; D],
}

impl<const D: usize> OnSample<D> {
    /// The sum of this force and `factor` times another.
    fn plus(&self, factor: f64, other: &Self) -> Self {
        OnSample {
            force: std::array::from_fn(|d| self.force[d] + factor * other.force[d]),
            pressure: self.pressure + factor * other.pressure,
            slopes: std::array::from_fn(|k| self.slopes[k] + factor * other.slopes[k]),
        }
    }
}

impl<const D: usize> Values<D> {
    /// The values at a load factor, at the start of a step.
    fn new(model: &Model<D>, load: &Load<D>, carried: &Carried<D>, factor: f64) -> Result<Self, BeginError> {
        match &load.action {
            Action::Pressure { pressure: Pressure::Hydrostatic { level, unit_weight }, .. } => {
                Ok(Values::Hydrostatic([*level, factor * unit_weight]))
            }
            Action::Pressure { pressure: Pressure::Given(formula) | Pressure::Dead(formula), .. } => {
                let surface = carried.surface();
                let values = mean_values(load, carried, formula, factor)?;
                let values: Vec<f64> = values.into_iter().map(|[value]| value).collect();
                if !follows(&load.action) {
                    let force = |(sample, pressure): (usize, &f64)| {
                        let depth = model.mean_depth(&surface.facet(sample));
                        surface.original_area(sample).map(|a| -pressure * depth * a)
                    };
                    return Ok(Values::Dead(values.iter().enumerate().map(force).collect()));
                }
                Ok(Values::Pressure(values))
            }
            Action::Traction { traction: formula, .. } => {
                let surface = carried.surface();
                let values = mean_values(load, carried, formula, factor)?;
                let force = |(sample, t): (usize, &[f64; D])| {
                    let area = model.original_area(surface, sample);
                    t.map(|t| t * area)
                };
                Ok(Values::Dead(values.iter().enumerate().map(force).collect()))
            }
            Action::Gravity(_) | Action::BodyForce(_) | Action::MassForce(_) | Action::PointForce { .. } => {
                Ok(Values::Dead(vec![[0.0; D]; carried.len()]))
            }
        }
    }

    /// The force on a sample at its trial position.
    fn on_sample(&self, model: &Model<D>, carried: &Carried<D>, sample: usize) -> OnSample<D> {
        let corners = &carried.facet(sample);
        let (pressure, slopes) = match self {
            Values::Dead(forces) => {
                return OnSample { force: forces[sample], pressure: 0.0, slopes: [0.0; D] };
            }
            Values::Pressure(values) => (values[sample], [0.0; D]),
            Values::Hydrostatic([level, weight]) => {
                let (depth, wet) = mean_depth_of_water(&corners.map(|corner| level - corner[D - 1]));
                (weight * depth, wet.map(|share| -weight * share))
            }
        };
        let depth = model.mean_depth(corners);
        let force = carried.area(sample).map(|a| -pressure * depth * a);
        OnSample { force, pressure, slopes }
    }
}

/// The mean of a formula over the facet of each sample, from its values at the centres of pieces of at most a quarter
/// of a cell.
fn mean_values<const D: usize, const N: usize>(
    load: &Load<D>,
    carried: &Carried<D>,
    formula: &VectorFormula<D, N>,
    factor: f64,
) -> Result<Vec<[f64; N]>, BeginError> {
    let surface = carried.surface();
    let mut values = Vec::with_capacity(carried.len());
    for sample in 0..carried.len() {
        let [now, original] = [carried.facet(sample), surface.facet(sample)];
        let mut mean = [0.0; N];
        for (number, place) in surface.pieces(sample).iter().enumerate() {
            let [x, original] = [&now, &original].map(|corners| place.on(corners));
            let value = formula.evaluate(&x, &original, factor);
            check(&load.name, surface, &x, &value, || formula.not_finite(&x, &original, factor), factor)?;
            // The mean of equal values is exact.
            (0..N).for_each(|d| mean[d] += (value[d] - mean[d]) / (number + 1) as f64);
        }
        values.push(mean);
    }
    Ok(values)
}

/// The mean depth of water over a facet, [length], and its derivatives with the depths of the corners, [-], which are
/// negative above the level.
fn mean_depth_of_water<const D: usize>(depths: &[f64; D]) -> (f64, [f64; D]) {
    let share = 1.0 / D as f64;
    let mean = depths.iter().sum::<f64>() * share;
    // The triangle (in the plane, the segment) around the only corner on one side of the level.
    let around = |k: usize| {
        let own = depths[k];
        if own == 0.0 {
            return (0.0, [0.0; D]);
        }
        let others = || (0..D).filter(move |other| *other != k);
        let depth = share * own * others().map(|other| own / (own - depths[other])).product::<f64>();
        let per_own = 1.0 / own + others().map(|other| 1.0 / own - 1.0 / (own - depths[other])).sum::<f64>();
        let per = |j: usize| if j == k { per_own } else { 1.0 / (own - depths[j]) };
        (depth, std::array::from_fn(|j| depth * per(j)))
    };
    let only = |is_wet: bool| (0..D).find(|&k| (depths[k] > 0.0) == is_wet).map_or((0.0, [0.0; D]), around);
    match depths.iter().filter(|depth| **depth > 0.0).count() {
        0 => (0.0, [0.0; D]),
        wet if wet == D => (mean, [share; D]),
        1 => only(true),
        _ => {
            let (depth, dry) = only(false);
            (mean - depth, dry.map(|dry| share - dry))
        }
    }
}

impl<const D: usize> SurfaceLoad<D> {
    /// A load of the model on a surface.
    pub(super) fn new(model: &Model<D>, number: usize, surface: usize) -> Self {
        let is_hydrostatic = matches!(
            model.loads[number].action,
            Action::Pressure { pressure: Pressure::Hydrostatic { .. }, .. }
        );
        let values = Values::Dead(Vec::new());
        SurfaceLoad { number, surface, values, per_factor: None, is_hydrostatic, resultant: [0.0; D] }
    }

    pub(super) fn surface(&self) -> usize {
        self.surface
    }

    /// True if the force depends on the displacements.
    pub(super) fn follows(&self, model: &Model<D>) -> bool {
        follows(&model.loads[self.number].action)
    }

    /// Begins a step, and adds the force at its start to `start`; the load exerts no force unless the body `is_there`.
    pub(super) fn begin(
        &mut self,
        step: &StepContext<D>,
        carried: &[Carried<D>],
        is_there: bool,
        start: &mut Nodal<D>,
    ) -> Result<(), BeginError> {
        (self.values, self.per_factor) = (Values::Dead(Vec::new()), None);
        self.resultant = [0.0; D];
        if !is_there {
            return Ok(());
        }
        let (model, carried) = (step.model, &carried[self.surface]);
        let load = &model.loads[self.number];
        let at = |factor: f64| Values::new(model, load, carried, factor);
        let mut add = |values: &Values<D>, share: f64| {
            for sample in carried.own_samples() {
                let on = values.on_sample(model, carried, sample);
                carried.spread(sample, &on.force.map(|f| share * f), start);
            }
        };
        if !model.stepping.control.has_unknown_factor() {
            self.values = at(load.curve.factor(step.load_time()))?;
            // Without initial stress, no load acts at time 0, whatever the values of the curves.
            if step.step.start > 0.0 || model.initial_imbalance.is_some() {
                add(&at(load.curve.factor(step.step.start))?, 1.0);
            }
        } else {
            let (stands, reaches) = load.factors_of_stage(&model.stepping);
            self.values = at(stands)?;
            let per_factor = at(reaches - stands)?;
            add(&self.values, 1.0);
            add(&per_factor, step.factor);
            self.per_factor = Some(per_factor);
        }
        Ok(())
    }

    /// True if the force keeps its direction.
    fn is_dead(&self) -> bool {
        matches!(self.values, Values::Dead(_))
    }

    /// Calls `couple` with the nodes that carry each sample and its facet, if the force follows the surface.
    pub(super) fn couples(&self, carried: &[Carried<D>], couple: &mut dyn FnMut(&[u32])) {
        if self.is_dead() {
            return;
        }
        carried[self.surface].each_neighbourhood(couple);
    }

    /// Adds the force and its stiffness.
    pub(super) fn evaluate<const N: usize>(
        &mut self,
        model: &Model<D>,
        carried: &Carried<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
        fields: &mut SurfaceFields<D>,
    ) {
        let mut per_factor = vec![[0.0; D]; if self.per_factor.is_some() { at.delta_d.len() } else { 0 }];
        self.resultant = [0.0; D];
        for sample in carried.own_samples() {
            let mut on = self.values.on_sample(model, carried, sample);
            if let Some(values) = &self.per_factor {
                let unit = values.on_sample(model, carried, sample);
                carried.spread(sample, &unit.force, &mut per_factor);
                on = on.plus(at.factor, &unit);
            }
            carried.spread(sample, &on.force, sum.external_force_mut());
            fields.pressure[sample] += on.pressure;
            for d in 0..D {
                self.resultant[d] += on.force[d];
                fields.load[sample][d] += on.force[d];
            }
            if wanted == Wanted::Stiffness && !self.is_dead() {
                add_stiffness(model, carried, sample, &on, sum);
            }
        }
        if self.per_factor.is_some() {
            sum.add_per_factor(&per_factor);
        }
    }

    /// Adds the resultant to the entry of this load in `sum`.
    pub(super) fn add_resultant(&self, sum: &mut [[f64; D]]) {
        (0..D).for_each(|d| sum[self.number][d] += self.resultant[d]);
    }
}

/// True if a load follows the surface.
fn follows<const D: usize>(action: &Action<D>) -> bool {
    matches!(action, Action::Pressure { pressure: Pressure::Given(_) | Pressure::Hydrostatic { .. }, .. })
}

/// Adds −∂f_v/∂Δd_w, for a pressure on a sample, to the stiffness.
fn add_stiffness<const D: usize, const N: usize>(
    model: &Model<D>,
    carried: &Carried<D>,
    sample: usize,
    on: &OnSample<D>,
    sum: &mut System<N>,
) {
    let (corners, area) = (&carried.facet(sample), carried.area(sample));
    let (depth, share) = (model.mean_depth(corners), carried.share(sample));
    for (k, column) in carried.supports(sample).into_iter().enumerate() {
        let mut derivative =
            area_derivative(corners, k).map(|row| row.map(|x| on.pressure * depth * share * x));
        for i in 0..D {
            if model.revolved {
                // The depth of the model is the mean of 2πr over the corners.
                derivative[i][0] += on.pressure * std::f64::consts::TAU / D as f64 * area[i];
            }
            derivative[i][D - 1] += on.slopes[k] * depth * area[i];
        }
        carried.for_each_value(sample, |v, row_value| {
            for (&w, column_value) in column.nodes().iter().zip(column.value()) {
                if let Some(place) = sum.place(v, w as usize) {
                    let block = derivative.map(|row| row.map(|x| row_value * column_value * x));
                    sum.add_displacement_block(place, &block);
                }
            }
        });
    }
}

/// Rejects values that are not finite.
fn check<'a, const D: usize>(
    load: &str,
    surface: &Surface<D>,
    x: &[f64; D],
    values: &[f64],
    fault: impl Fn() -> Option<(&'a str, f64)>,
    factor: f64,
) -> Result<(), BeginError> {
    if values.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    let (text, value) = fault().unwrap_or(("", f64::NAN));
    Err(BeginError::from(LoadNotFinite {
        load: load.to_owned(),
        place: format!("surface `{}`", surface.name),
        point: None,
        position: x.to_vec(),
        factor,
        formula: text.to_owned(),
        value,
    }))
}

#[cfg(test)]
mod tests {
    use super::mean_depth_of_water;

    /// The mean over many places of a facet, as a slow second way.
    fn sampled<const D: usize>(depths: [f64; D]) -> f64 {
        let n = 400;
        let (mut depth, mut count) = (0.0, 0.0);
        for i in 0..n {
            for j in 0..if D == 3 { n - i } else { 1 } {
                let s = [(i as f64 + 1.0 / D as f64) / n as f64, (j as f64 + 1.0 / D as f64) / n as f64];
                let weights: [f64; D] =
                    std::array::from_fn(
                        |k| if k == 0 { 1.0 - s[..D - 1].iter().sum::<f64>() } else { s[k - 1] },
                    );
                depth += weights.iter().zip(&depths).map(|(a, b)| a * b).sum::<f64>().max(0.0);
                count += 1.0;
            }
        }
        depth / count
    }

    fn check<const D: usize>(depths: [f64; D]) {
        let (mean, derivatives) = mean_depth_of_water(&depths);
        assert!((mean - sampled(depths)).abs() < 2e-3, "{depths:?}: {mean}");
        for k in 0..D {
            let at = |by: f64| {
                let mut moved = depths;
                moved[k] += by;
                mean_depth_of_water(&moved).0
            };
            let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
            assert!((difference - derivatives[k]).abs() < 1e-6, "{depths:?}: {difference} {derivatives:?}");
        }
    }

    #[test]
    fn water_on_a_part_of_a_facet() {
        for depths in [[1.0, 2.0], [1.0, -3.0], [-0.5, 0.25], [-1.0, -2.0]] {
            check(depths);
        }
        for depths in
            [[1.0, 2.0, 3.0], [1.0, -3.0, -1.0], [-0.5, 0.25, 1.0], [2.0, -1.0, 0.5], [-1.0, -2.0, -3.0]]
        {
            check(depths);
        }
        assert_eq!(mean_depth_of_water(&[1.0, -1.0]).0, 0.25);
        assert_eq!(mean_depth_of_water(&[0.0, 1.0]).0, 0.5);
    }
}
