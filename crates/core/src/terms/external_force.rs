//! External forces on the grid: weight, body forces and point forces, eqs. (24), (25), (29).

use crate::assembly::{System, Wanted, add};
use crate::basis::Connectivity;
use crate::model::{Action, Control, Load, Model};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};

use super::failure::{LoadNotFinite, PointFailure};
use super::term::Term;

/// The external force at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalForce<const D: usize> {
    /// On each active node, eq. (29), [force].
    pub nodal: Vec<[f64; D]>,
    /// Resultant of each load over the material points, as the deck states it, [force]. It includes the part that does
    /// not reach the nodes if basis functions do not add up to 1.
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

/// The external force if all loads have the same factor, regardless of their curves.
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
                continue; // most points, if forces act on few
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

/// The external forces of all loads. They are dead loads: their direction does not follow the displacement.
#[derive(Debug, Default)]
pub struct ExternalForces<const D: usize> {
    /// At the end of the step, [force].
    end: Nodal<D>,
    /// In the state that the step starts from, on the nodes of this step, [force].
    start: Nodal<D>,
    resultants: Vec<[f64; D]>,
    /// The force at load factor 1 if the factor follows from equilibrium, and its resultants.
    unit: Option<(Nodal<D>, Vec<[f64; D]>)>,
}

impl<const D: usize> ExternalForces<D> {
    /// Sets the force for a load factor that follows from equilibrium.
    fn set_factor(&mut self, factor: f64) {
        let Some((unit, resultants)) = &self.unit else { return };
        for (force, unit) in self.end.iter_mut().flatten().zip(unit.iter().flatten()) {
            *force = factor * unit;
        }
        self.resultants = resultants.iter().map(|force| force.map(|f| factor * f)).collect();
    }
}

impl<const D: usize, const N: usize> Term<D, N> for ExternalForces<D> {
    fn name(&self) -> &'static str {
        "external forces"
    }

    fn is_symmetric(&self, _: &StepContext<D>) -> bool {
        true
    }

    fn begin(&mut self, context: &StepContext<D>, points: &Points<D>) -> Result<(), Box<LoadNotFinite>> {
        let StepContext { model, links, step, factor } = *context;
        if model.stepping.control != Control::Load {
            let ExternalForce { nodal: unit, resultants } =
                external_force_of_factor(model, points, links, 1.0)?;
            self.end = vec![[0.0; D]; unit.len()];
            self.unit = Some((unit, resultants));
            self.set_factor(factor);
            self.start = self.end.clone();
            return Ok(());
        }
        let load = |time| external_force(model, points, links, time); // (24), (25), (29)
        let ExternalForce { nodal, resultants } = load(step.end)?;
        // Nothing is loaded yet at time 0, whatever the values of the curves.
        self.start = if step.start > 0.0 { load(step.start)?.nodal } else { vec![[0.0; D]; nodal.len()] };
        (self.end, self.resultants, self.unit) = (nodal, resultants, None);
        Ok(())
    }

    fn evaluate(
        &mut self,
        _: &StepContext<D>,
        _: &mut Points<D>,
        at: At<N>,
        _: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), PointFailure> {
        self.set_factor(at.factor);
        add(&mut sum.external, &self.end);
        if let Some((unit, _)) = &self.unit {
            sum.add_per_factor(unit);
        }
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<N>) {
        add(force, &self.start);
    }

    fn add_resultants(&self, sum: &mut [[f64; D]]) {
        add(sum, &self.resultants);
    }
}
