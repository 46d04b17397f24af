//! External forces: weight, body forces and point forces, eqs. (24), (25), (29), and the load curves they follow.

use crate::basis::Connectivity;
use crate::formula::{Formula, MOST_INTERMEDIATE};
use crate::model::Model;
use crate::points::{Points, coordinates};

/// Load factor over time, linear between given times.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadCurve(Vec<[f64; 2]>);

impl LoadCurve {
    /// From 0 at time 0 to 1 at the end.
    pub fn ramp(end_time: f64) -> Self {
        LoadCurve(vec![[0.0, 0.0], [end_time, 1.0]])
    }

    /// From [time, factor] pairs with increasing times.
    pub fn table(pairs: Vec<[f64; 2]>) -> Self {
        LoadCurve(pairs)
    }

    /// The times at which it has a kink, ascending, [time].
    pub fn knots(&self) -> impl Iterator<Item = f64> + '_ {
        let slope = |a: &[f64; 2], b: &[f64; 2]| (b[1] - a[1]) / (b[0] - a[0]);
        self.0.windows(3).filter(move |w| slope(&w[0], &w[1]) != slope(&w[1], &w[2])).map(|w| w[1][0])
    }

    /// The factor at a time; constant before the first and after the last pair.
    pub fn factor(&self, time: f64) -> f64 {
        let after = self.0.partition_point(|pair| pair[0] <= time);
        match (after.checked_sub(1).and_then(|k| self.0.get(k)), self.0.get(after)) {
            (Some([t0, f0]), Some([t1, f1])) => f0 + (f1 - f0) * (time - t0) / (t1 - t0),
            (Some(last), None) => last[1],
            (None, Some(first)) => first[1],
            (None, None) => 0.0,
        }
    }
}

/// What a load does.
#[derive(Debug, Clone)]
pub enum Action<const D: usize> {
    /// Constant mass of each point times this acceleration, [length/time²].
    Gravity([f64; D]),
    /// Force per volume at the start of the step, [force/volume], eq. (24).
    BodyForce(VectorFormula<D>),
    /// Force per constant mass of each point, [length/time²].
    MassForce(VectorFormula<D>),
    /// The same force on each of these points (permanent numbers), [force], eq. (25).
    PointForce {
        /// Permanent numbers of the points.
        points: Vec<u32>,
        /// Force on each of them at load factor 1.
        force: [f64; D],
    },
}

/// A vector by formulas, with intermediate values, of position, original position and load factor.
///
/// The variables of all formulas are, in this order: position x (`D` values), original position X (`D` values), the
/// load factor, and the intermediate values that come before.
#[derive(Debug, Clone)]
pub struct VectorFormula<const D: usize> {
    intermediate: Vec<Formula>,
    components: [Formula; D],
    /// For each formula whether it depends on the load factor, directly or through an intermediate value.
    scaled: [bool; D],
}

impl<const D: usize> VectorFormula<D> {
    /// From formulas of the variables listed above; at most [`MOST_INTERMEDIATE`] intermediate values are kept.
    pub fn new(mut intermediate: Vec<Formula>, components: [Formula; D]) -> Self {
        intermediate.truncate(MOST_INTERMEDIATE);
        let fixed = 2 * D + 1;
        let mut explicit = vec![false; intermediate.len()];
        let depends = |formula: &Formula, explicit: &[bool]| {
            formula.depends_on(2 * D)
                || (0..explicit.len()).any(|k| explicit[k] && formula.depends_on(fixed + k))
        };
        for k in 0..intermediate.len() {
            explicit[k] = depends(&intermediate[k], &explicit);
        }
        let scaled = std::array::from_fn(|d| !depends(&components[d], &explicit));
        VectorFormula { intermediate, components, scaled }
    }

    /// The vector at a load factor; components that do not depend on it are multiplied by it.
    pub fn evaluate(&self, x: &[f64; D], original: &[f64; D], factor: f64) -> [f64; D] {
        let values = self.values(x, original, factor);
        std::array::from_fn(|d| {
            let value = self.components[d].evaluate(&values);
            if self.scaled[d] { value * factor } else { value }
        })
    }

    /// The variables with the intermediate values.
    fn values(&self, x: &[f64; D], original: &[f64; D], factor: f64) -> [f64; 7 + MOST_INTERMEDIATE] {
        let mut values = [0.0; 7 + MOST_INTERMEDIATE];
        values[..D].copy_from_slice(x);
        values[D..2 * D].copy_from_slice(original);
        values[2 * D] = factor;
        for (known, formula) in (2 * D + 1..).zip(&self.intermediate) {
            values[known] = formula.evaluate(&values[..known]);
        }
        values
    }

    /// The first formula without a finite value, and that value: an intermediate one, if any, before the components.
    fn not_finite(&self, x: &[f64; D], original: &[f64; D], factor: f64) -> Option<(&str, f64)> {
        let values = self.values(x, original, factor);
        let of_intermediate = self.intermediate.iter().zip(&values[2 * D + 1..]).map(|(f, v)| (f, *v));
        let of_components = self.components.iter().zip(self.evaluate(x, original, factor));
        let mut all = of_intermediate.chain(of_components);
        all.find(|(_, value)| !value.is_finite()).map(|(formula, value)| (formula.text(), value))
    }
}

/// A named external force.
#[derive(Debug, Clone)]
pub struct Load<const D: usize> {
    /// Name.
    pub name: String,
    /// What it does.
    pub action: Action<D>,
    /// Whether it acts on each body.
    pub acts_on: Vec<bool>,
    /// Load factor over time.
    pub curve: LoadCurve,
}

/// A body force has no finite value at a point.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "load `{load}` is not finite at point {point} of body `{body}` at {}: the formula `{formula}` gives {value} at \
     load factor {factor}",
    coordinates(.position)
)]
pub struct LoadNotFinite {
    /// Name of the load.
    pub load: String,
    /// Name of the body.
    pub body: String,
    /// Permanent number of the point.
    pub point: u32,
    /// Where the point is, [length].
    pub position: Vec<f64>,
    /// The load factor.
    pub factor: f64,
    /// Text of the first formula without a finite value, which may be an intermediate one.
    pub formula: String,
    /// Its value.
    pub value: f64,
}

/// The external force at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalForce<const D: usize> {
    /// On each active node, eq. (29), [force].
    pub nodal: Vec<[f64; D]>,
    /// Resultant of each load over the material points, as the deck states it: what the nodes get from it, and what basis
    /// functions lose that do not add up to 1, [force].
    pub resultants: Vec<[f64; D]>,
}

/// The external force of eq. (29) at a time.
///
/// Weight uses the constant mass of the points: b V_p^n of eq. (24) with b per volume at the start of the step.
///
/// # Errors
/// [`LoadNotFinite`] when a formula is not finite at a point.
pub fn external_force<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    time: f64,
) -> Result<ExternalForce<D>, LoadNotFinite> {
    forces_on_points(model, points, |load| load.curve.factor(time))
        .map(|(forces, resultants)| on_nodes(links, (&forces, resultants)))
}

/// The external force where all loads have the same factor, whatever their curves say.
///
/// # Errors
/// As [`external_force`].
pub fn external_force_of_factor<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    factor: f64,
) -> Result<ExternalForce<D>, LoadNotFinite> {
    forces_on_points(model, points, |_| factor)
        .map(|(forces, resultants)| on_nodes(links, (&forces, resultants)))
}

/// Eq. (29) for the forces on the points, [force], that have these resultants.
fn on_nodes<const D: usize>(
    links: &Connectivity<D>,
    (at_points, resultants): (&[[f64; D]], Vec<[f64; D]>),
) -> ExternalForce<D> {
    let mut force = vec![[0.0; D]; links.n_active()];
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            if at_points[p] == [0.0; D] {
                continue; // most points, where forces act on some
            }
            links.for_each_value(p, |local, value| {
                let node = &mut force[nodes[local] as usize];
                for d in 0..D {
                    node[d] += value * at_points[p][d];
                }
            });
        }
    }
    ExternalForce { nodal: force, resultants }
}

/// Forces on the points, or resultants of the loads.
type Forces<const D: usize> = Vec<[f64; D]>;

/// Sum of all loads on each point, and the resultant of each load over all points, [force].
fn forces_on_points<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    factor_of: impl Fn(&Load<D>) -> f64,
) -> Result<(Forces<D>, Forces<D>), LoadNotFinite> {
    let mut forces = vec![[0.0; D]; points.len()];
    let mut resultants = vec![[0.0; D]; model.loads.len()];
    for (load, resultant) in model.loads.iter().zip(&mut resultants) {
        let mut add = |p: usize, force: [f64; D]| {
            for d in 0..D {
                forces[p][d] += force[d];
                resultant[d] += force[d];
            }
        };
        let factor = factor_of(load);
        let acts_on = |p: usize| load.acts_on[points.body[p] as usize];
        match &load.action {
            Action::Gravity(acceleration) => {
                for p in (0..points.len()).filter(|&p| acts_on(p)) {
                    add(p, acceleration.map(|a| factor * points.mass[p] * a));
                }
            }
            Action::BodyForce(formula) | Action::MassForce(formula) => {
                let is_per_mass = matches!(load.action, Action::MassForce(_));
                for p in (0..points.len()).filter(|&p| acts_on(p)) {
                    let (x, original) = (&points.converged.position[p], &points.original_position[p]);
                    let density = formula.evaluate(x, original, factor);
                    if density.iter().any(|b| !b.is_finite()) {
                        let fault = formula.not_finite(x, original, factor);
                        let (text, value) = fault.unwrap_or(("", f64::NAN));
                        return Err(LoadNotFinite {
                            load: load.name.clone(),
                            body: model.bodies[points.body[p] as usize].name.clone(),
                            point: points.id[p],
                            position: x.to_vec(),
                            factor,
                            formula: text.to_owned(),
                            value,
                        });
                    }
                    let amount = if is_per_mass { points.mass[p] } else { model.volume(points, p) };
                    add(p, density.map(|b| b * amount));
                }
            }
            Action::PointForce { points: chosen, force } => {
                let place = points.by_id();
                for &id in chosen {
                    add(place[id as usize], force.map(|f| factor * f));
                }
            }
        }
    }
    Ok((forces, resultants))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_curves_interpolate_and_stay_constant_outside() {
        let curve = LoadCurve::table(vec![[0.0, 0.0], [0.5, 2.0], [1.0, -1.0]]);
        for (time, factor) in
            [(-1.0, 0.0), (0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (0.75, 0.5), (1.0, -1.0), (9.0, -1.0)]
        {
            assert_eq!(curve.factor(time), factor);
        }
        assert_eq!(LoadCurve::ramp(2.0).factor(1.5), 0.75);
    }
}
