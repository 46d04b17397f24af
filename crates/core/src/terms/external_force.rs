//! External forces on the grid: weight, body forces and point forces, eqs. (24), (25), (29).

use crate::assembly::{System, Wanted, add};
use crate::basis::Connectivity;
use crate::model::{Action, Load, Model, VectorFormula};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};

use super::failure::{BeginError, EvaluateError, LoadNotFinite};
use super::on_points::on_nodes;
use super::released::released_forces;
use super::report::TermReport;
use super::term::{Character, Term};

/// Name under which the force that a stage releases is reported.
const RELEASED: &str = "released";

/// The external force at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalForce<const D: usize> {
    /// Force on each active node, eq. (29), [force].
    pub nodal: Vec<[f64; D]>,
    /// Resultant of each load over the material points, as the deck states it, [force]. It includes any part that does
    /// not reach the nodes because basis functions do not add up to 1.
    pub resultants: Vec<[f64; D]>,
}

/// The external force of eq. (29) at a time.
///
/// Weight follows from the constant mass m_p of the points: b V_p^n of eq. (24), with b = (m_p/V_p^n) g.
///
/// # Errors
/// [`LoadNotFinite`] when a formula is not finite at a point.
#[inline(never)]
pub fn external_force<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    time: f64,
) -> Result<ExternalForce<D>, LoadNotFinite> {
    external_force_of_factors(model, points, links, |load| load.curve.factor(time))
}

/// The external force for given factors of the loads.
///
/// # Errors
/// As [`external_force`].
pub fn external_force_of_factors<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    factor: impl Fn(&Load<D>) -> f64,
) -> Result<ExternalForce<D>, LoadNotFinite> {
    forces_on_points(model, points, factor)
        .map(|(forces, resultants)| ExternalForce { nodal: on_nodes(links, &forces), resultants })
}

/// Forces on the points, or resultants of the loads.
pub(crate) type Forces<const D: usize> = Vec<[f64; D]>;

/// The error for a load without a finite value at a point.
fn without_value<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    p: usize,
    load: &Load<D>,
    formula: &VectorFormula<D>,
    factor: f64,
) -> LoadNotFinite {
    let (x, original) = (&points.converged.position[p], &points.original_position[p]);
    let (text, value) = formula.not_finite(x, original, factor).unwrap_or(("", f64::NAN));
    LoadNotFinite {
        load: load.name.clone(),
        place: format!("point {} of body `{}`", points.id[p], model.bodies[points.body[p] as usize].name),
        point: Some(points.id[p]),
        position: x.to_vec(),
        factor,
        formula: text.to_owned(),
        value,
    }
}

/// Sum of all loads on each point, and the resultant of each load over all points, [force].
///
/// # Errors
/// [`LoadNotFinite`] when a formula is not finite at a point.
pub(crate) fn forces_on_points<const D: usize>(
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
                let density_at = |p: usize| {
                    formula.evaluate(&points.converged.position[p], &points.original_position[p], factor)
                };
                let is_finite = |density: [f64; D]| density.iter().all(|b| b.is_finite());
                for p in (0..points.len()).filter(|&p| acts_on(p)) {
                    let density = density_at(p);
                    if !is_finite(density) {
                        // The error names the point with the lowest number, regardless of the order in which the points
                        // are stored.
                        let others = (p..points.len()).filter(|&q| acts_on(q) && !is_finite(density_at(q)));
                        let lowest = others.min_by_key(|&q| points.id[q]).unwrap_or(p);
                        return Err(without_value(model, points, lowest, load, formula, factor));
                    }
                    let amount = if is_per_mass { points.mass[p] } else { model.volume(points, p) };
                    add(p, density.map(|b| b * amount));
                }
            }
            Action::PointForce { points: chosen, force } => {
                for place in points.places_of(chosen).into_iter().flatten() {
                    add(place, force.map(|f| factor * f));
                }
            }
            // The surface term applies these loads.
            Action::Traction { .. } | Action::Pressure { .. } => {}
        }
    }
    Ok((forces, resultants))
}

/// The external forces of all loads on material points. They are dead loads: their direction does not follow the
/// displacement.
#[derive(Debug, Default)]
pub struct ExternalForces<const D: usize> {
    /// At the end of the step, [force].
    end: Nodal<D>,
    /// In the state from which the step starts, on the nodes of this step, [force].
    start: Nodal<D>,
    resultants: Vec<[f64; D]>,
    /// The forces whose load factor follows from equilibrium.
    unknown: Option<Unknown<D>>,
    /// The forces that the stage releases and that still act at the end of the step, [force]; none if it releases
    /// nothing.
    released: Option<Nodal<D>>,
}

/// Forces `fixed` + λ `unit` on the active nodes, with the load factor λ, and their resultants, [force].
#[derive(Debug)]
struct Unknown<const D: usize> {
    /// The force at load factor 0: the loads in the state in which the stage begins, and the forces that are not yet
    /// released at the end of the step. `None` if it is zero.
    fixed: Option<ExternalForce<D>>,
    unit: ExternalForce<D>,
}

impl<const D: usize> ExternalForces<D> {
    /// Sets the force for a load factor that follows from equilibrium.
    fn set_factor(&mut self, factor: f64) {
        let Some(Unknown { fixed, unit }) = &self.unknown else { return };
        for (force, unit) in self.end.iter_mut().flatten().zip(unit.nodal.iter().flatten()) {
            *force = factor * unit;
        }
        self.resultants = unit.resultants.iter().map(|force| force.map(|f| factor * f)).collect();
        if let Some(fixed) = fixed {
            add(&mut self.end, &fixed.nodal);
            add(&mut self.resultants, &fixed.resultants);
        }
    }

    /// Sets up the forces whose common factor follows from equilibrium: those of the loads that change in the stage.
    /// `released_before` are the forces that the stage releases and that still act at the start of the step, [force].
    fn begin_unknown(
        &mut self,
        context: &StepContext<D>,
        points: &Points<D>,
        released_before: Option<Nodal<D>>,
    ) -> Result<(), Box<LoadNotFinite>> {
        let StepContext { model, links, factor, .. } = *context;
        let force =
            |factor: &dyn Fn(&Load<D>) -> f64| external_force_of_factors(model, points, links, factor);
        let stands = |load: &Load<D>| load.factors_of_stage(&model.stepping).0;
        let unit = force(&|load| {
            let (stands, reaches) = load.factors_of_stage(&model.stepping);
            reaches - stands
        })?;
        let mut fixed = None;
        if model.loads.iter().any(|load| stands(load) != 0.0) {
            fixed = Some(force(&stands)?);
        }
        if let Some(forces) = &self.released {
            let none = || ExternalForce {
                nodal: vec![[0.0; D]; forces.len()],
                resultants: vec![[0.0; D]; unit.resultants.len()],
            };
            add(&mut fixed.get_or_insert_with(none).nodal, forces);
        }
        self.end = vec![[0.0; D]; unit.nodal.len()];
        self.unknown = Some(Unknown { fixed, unit });
        self.set_factor(factor);
        self.start = self.end.clone();
        if let (Some(before), Some(now)) = (released_before, &self.released) {
            for (start, (before, now)) in self.start.iter_mut().zip(before.iter().zip(now)) {
                (0..D).for_each(|d| start[d] += before[d] - now[d]);
            }
        }
        Ok(())
    }
}

impl<const D: usize, const N: usize> Term<D, N> for ExternalForces<D> {
    fn name(&self) -> &'static str {
        "external forces"
    }

    fn character(&self, model: &Model<D>) -> Character {
        // Whether bodies can carry loads other than weight is a result that the run must show.
        let may_slump = model.loads.iter().all(|load| matches!(load.action, Action::Gravity(_)));
        Character { may_slump, ..Character::SMOOTH }
    }

    fn begin(&mut self, context: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        let StepContext { model, links, step, .. } = *context;
        let released = released_forces(model, points, links);
        let acting = |time: f64| {
            let share = model.share_not_released(time);
            let at_node = |force: &[f64; D]| force.map(|f| share * f);
            released.as_ref().map(|forces| forces.iter().map(at_node).collect::<Nodal<D>>())
        };
        self.released = acting(context.load_time());
        if model.stepping.control.has_unknown_factor() {
            return Ok(self.begin_unknown(context, points, acting(step.start))?);
        }
        let load = |time| external_force(model, points, links, time); // (24), (25), (29)
        let ExternalForce { nodal, resultants } = load(context.load_time())?;
        // Without initial stress, no load acts yet at time 0, whatever the values of the curves.
        let is_loaded = step.start > 0.0 || model.initial_imbalance.is_some();
        self.start = if is_loaded { load(step.start)?.nodal } else { vec![[0.0; D]; nodal.len()] };
        (self.end, self.resultants, self.unknown) = (nodal, resultants, None);
        for (forces, released) in
            [(&mut self.start, acting(step.start)), (&mut self.end, acting(context.load_time()))]
        {
            if let Some(released) = released {
                add(forces, &released);
            }
        }
        Ok(())
    }

    fn evaluate(
        &mut self,
        _: &StepContext<D>,
        _: &mut Points<D>,
        at: At<N>,
        _: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        self.set_factor(at.factor);
        add(&mut sum.external, &self.end);
        if let Some(released) = &self.released {
            sum.count_as_holding(released);
        }
        if let Some(Unknown { unit, .. }) = &self.unknown {
            sum.add_per_factor(&unit.nodal);
        }
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<N>) {
        add(force, &self.start);
    }

    fn report(&self, _: &Model<D>, report: &mut TermReport<D>) {
        add(&mut report.loads, &self.resultants);
        let sum = |forces: &Nodal<D>| {
            forces.iter().fold([0.0; D], |sum, force| std::array::from_fn(|d| sum[d] + force[d]))
        };
        let released = self.released.iter().map(sum);
        released.for_each(|force| report.add_force(RELEASED, force));
    }
}
