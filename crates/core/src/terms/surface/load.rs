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
use crate::model::{Action, Load, Model, Pressure};
use crate::region::area_derivative;
use crate::step::{At, Nodal, StepContext};
use crate::surface::{Carried, Surface, SurfaceFields, centre};

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
    /// Derivative of the pressure along the last axis, [stress/length].
    slope: f64,
}

impl<const D: usize> OnSample<D> {
    /// The sum of this force and `factor` times another.
    fn plus(&self, factor: f64, other: &Self) -> Self {
        OnSample {
            force: std::array::from_fn(|d| self.force[d] + factor * other.force[d]),
            pressure: self.pressure + factor * other.pressure,
            slope: self.slope + factor * other.slope,
        }
    }
}

impl<const D: usize> Values<D> {
    /// The values at a load factor, at the start of a step.
    fn new(model: &Model<D>, load: &Load<D>, carried: &Carried<D>, factor: f64) -> Result<Self, BeginError> {
        let places: Vec<[f64; D]> = (0..carried.len()).map(|sample| centre(&carried.facet(sample))).collect();
        match &load.action {
            Action::Pressure { pressure: Pressure::Hydrostatic { level, unit_weight }, .. } => {
                Ok(Values::Hydrostatic([*level, factor * unit_weight]))
            }
            Action::Pressure { pressure: Pressure::Given(formula) | Pressure::Dead(formula), surface } => {
                let surface = &model.surfaces[*surface];
                let mut values = Vec::with_capacity(places.len());
                for (x, original) in places.iter().zip(&surface.samples) {
                    let [value] = formula.evaluate(x, original, factor);
                    check(
                        &load.name,
                        surface,
                        x,
                        &[value],
                        || formula.not_finite(x, original, factor),
                        factor,
                    )?;
                    values.push(value);
                }
                if !follows(&load.action) {
                    let force = |(sample, pressure): (usize, &f64)| {
                        let depth = model.mean_depth(&surface.facet(sample));
                        surface.original_area(sample).map(|a| -pressure * depth * a)
                    };
                    return Ok(Values::Dead(values.iter().enumerate().map(force).collect()));
                }
                Ok(Values::Pressure(values))
            }
            Action::Traction { traction: formula, surface } => {
                let surface = &model.surfaces[*surface];
                let mut values = Vec::with_capacity(places.len());
                for (sample, (x, original)) in places.iter().zip(&surface.samples).enumerate() {
                    let value = formula.evaluate(x, original, factor);
                    check(
                        &load.name,
                        surface,
                        x,
                        &value,
                        || formula.not_finite(x, original, factor),
                        factor,
                    )?;
                    let area = model.original_area(surface, sample);
                    values.push(value.map(|t| t * area));
                }
                Ok(Values::Dead(values))
            }
            Action::Gravity(_) | Action::BodyForce(_) | Action::MassForce(_) | Action::PointForce { .. } => {
                Ok(Values::Dead(vec![[0.0; D]; places.len()]))
            }
        }
    }

    /// The force on a sample at its trial position.
    fn on_sample(&self, model: &Model<D>, carried: &Carried<D>, sample: usize) -> OnSample<D> {
        let corners = &carried.facet(sample);
        let height = centre(corners)[D - 1];
        let (pressure, slope) = match self {
            Values::Dead(forces) => return OnSample { force: forces[sample], pressure: 0.0, slope: 0.0 },
            Values::Pressure(values) => (values[sample], 0.0),
            Values::Hydrostatic([level, weight]) if height < *level => (weight * (level - height), -weight),
            Values::Hydrostatic(_) => (0.0, 0.0),
        };
        let depth = model.mean_depth(corners);
        let force = carried.area(sample).map(|a| -pressure * depth * a);
        OnSample { force, pressure, slope }
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
            self.values = at(load.curve.factor(step.step.end))?;
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
            derivative[i][D - 1] += on.slope / D as f64 * depth * area[i];
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
