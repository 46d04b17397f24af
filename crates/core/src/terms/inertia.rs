//! Inertia of the material points, as one term beside the others.
//!
//! In a step of duration Δt the displacement increments u of the nodes change the velocity of the grid from v_n to
//! v_{n+1}; with the midpoint rule v_{n+1} = 2u/Δt − v_n, and the equations of motion in the mean over the step are
//!
//! (2/Δt²) M u − (2/Δt) M v_n + f̄ − f_ext(t_{n+½}) = 0
//!
//! with the consistent mass M = Σ m_p S_p S_pᵀ + J. The velocity at the start follows from that of the points with the
//! same mass, M v_n = Σ m_p S_p v_p, and the points follow the change of the grid, v_p += Σ S_vp (v_{n+1} − v_n)
//! (FLIP, Brackbill & Ruppel 1986, doi 10.1016/0021-9991(86)90211-1). Their kinetic energy then grows by exactly the work
//! on the grid, less ½ Δvᵀ J Δv; Love & Sulsky (2006), doi 10.1016/j.cma.2005.06.027, show what a lumped mass loses.
//!
//! The ghost mass J steadies the nodes of cells that hold hardly any material,
//!
//! J = Σ_faces ∫ γ ρ h³ ⟦∂N/∂n⟧ᵀ ⟦∂N/∂n⟧ dA
//!
//! on the faces on which the ghost stabilisation acts. It resists no linear field, so it changes neither momentum nor
//! angular momentum of linear motions.

mod mass;
mod motion;
mod moving;
mod projection;

use std::cell::OnceCell;

use crate::assembly::{System, Wanted};
use crate::dofs::DofMap;
use crate::model::{Dynamics, Model};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};

use super::failure::{BeginError, EvaluateError};
use super::ghost::Ghost;
use super::layout::Layout;
use super::ledger::{Ledger, NamedEnergy};
use super::report::TermReport;
use super::term::{Character, Coupled, Term};

use mass::Mass;
use motion::kinetic;
use moving::EndOfStep;
use moving::Moving;

/// Name under which the resultant of inertia is reported.
const INERTIA: &str = "inertia";

/// Inertia in steps of stages with dynamics. Where a static stage follows, it ends the motion.
pub struct Inertia<const D: usize, const N: usize = D> {
    /// What moves; `None` in a static step.
    moving: Option<Moving<D, N>>,
}

impl<const D: usize, const N: usize> Default for Inertia<D, N> {
    fn default() -> Self {
        Inertia { moving: None }
    }
}

impl<const D: usize, const N: usize> Moving<D, N> {
    fn new(step: &StepContext<D>, points: &Points<D>, dynamics: Dynamics) -> Self {
        let ghost = Ghost::of_mass(dynamics.ghost_mass, step.model, points, step.links);
        let duration = step.step.duration();
        Moving {
            dynamics,
            duration,
            force: dynamics.scheme.force(duration),
            dofs: DofMap::unconstrained(step.links.n_active()),
            ghost,
            mass: None,
            start: Default::default(),
            constant: Nodal::new(),
            stiffness: Vec::new(),
            resultant: [0.0; D],
            end: OnceCell::new(),
            last: vec![[0.0; N]; step.links.n_active()],
            damped: 0.0,
        }
    }

    /// Forms the mass on the pairs of the system, and the motion of the grid at the start of the step.
    fn prepare(&mut self, step: &StepContext<D>, points: &Points<D>, sum: &System<N>) {
        let mass = Mass::new(step.links, points, &self.ghost, sum);
        if self.constant.is_empty() {
            let keeps = self.dynamics.scheme.keeps_acceleration();
            let prescribed = projection::rate(&self.dofs, self.duration);
            let project = |values: Option<&[f64]>, prescribed: Nodal<N>| match values {
                None => vec![[0.0; N]; self.last.len()],
                Some(values) => {
                    let momentum = motion::momentum(step, points, values);
                    projection::project(&mass, sum, &self.dofs, momentum, prescribed)
                }
            };
            let none = vec![[0.0; N]; self.last.len()];
            self.start = [
                project(points.velocity(), prescribed),
                project(points.acceleration().filter(|_| keeps), none),
            ];
            let [velocity, acceleration] = &self.start;
            let mut sought = vec![[0.0; N]; self.last.len()];
            for ((sought, v), a) in sought.iter_mut().zip(velocity).zip(acceleration) {
                *sought =
                    std::array::from_fn(|c| self.force.velocity * v[c] + self.force.acceleration * a[c]);
            }
            self.constant = vec![[0.0; N]; self.last.len()];
            mass.multiply(sum, &sought, &mut self.constant);
        }
        self.mass = Some(mass);
    }

    /// The motion at the end of the step with these displacement increments, those of the last evaluation.
    fn end(&self, step: &StepContext<D>, points: &Points<D>, delta_d: &[[f64; N]]) -> &EndOfStep {
        self.end.get_or_init(|| EndOfStep::new(self, step, points, delta_d))
    }

    /// Adds the force of Rayleigh damping at the mean velocity u/Δt, and its stiffness.
    fn damp(&mut self, weight: f64, at: At<N>, wanted: Wanted, sum: &mut System<N>) {
        let [by_mass, by_stiffness] = self.dynamics.rayleigh;
        self.damped = 0.0;
        let Some(mass) = &self.mass else { return };
        if by_mass == 0.0 && by_stiffness == 0.0 {
            return;
        }
        let mut force = vec![[0.0; N]; at.delta_d.len()];
        if by_mass != 0.0 {
            let rate = by_mass / self.duration;
            mass.multiply(sum, at.delta_d, &mut force);
            force.iter_mut().flatten().for_each(|f| *f *= rate);
            if wanted == Wanted::Stiffness {
                mass.add::<D, N>(rate, sum);
            }
        }
        if by_stiffness != 0.0 && !self.stiffness.is_empty() {
            let rate = by_stiffness / (weight * self.duration);
            mass::multiply_blocks(sum, &self.stiffness, rate, at.delta_d, &mut force);
            if wanted == Wanted::Stiffness {
                for (block, own) in sum.blocks.iter_mut().zip(&self.stiffness) {
                    for (entry, own) in block.as_flattened_mut().iter_mut().zip(own.as_flattened()) {
                        *entry += rate * own;
                    }
                }
            }
        }
        let pairs = force.as_flattened().iter().zip(at.delta_d.as_flattened());
        self.damped = pairs.map(|(f, u)| f * u).sum();
        for (sum, own) in sum.internal.as_flattened_mut().iter_mut().zip(force.as_flattened()) {
            *sum += own;
        }
    }
}

impl<const D: usize, const N: usize> Term<D, N> for Inertia<D, N> {
    fn name(&self) -> &'static str {
        "inertia"
    }

    fn character(&self, model: &Model<D>) -> Character {
        match model.stepping.dynamics {
            None => Character { may_slump: true, ..Character::SMOOTH },
            Some(_) => Character { may_hold: true, has_potential: false, ..Character::SMOOTH },
        }
    }

    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        // The forces of a state, which no time passes, know no inertia.
        let dynamics = step.dynamics().filter(|_| step.step.duration() > 0.0);
        self.moving = dynamics.map(|dynamics| Moving::new(step, points, dynamics));
        Ok(())
    }

    fn follow_constraints(&mut self, dofs: &DofMap<N>) {
        if let Some(moving) = &mut self.moving {
            moving.dofs = dofs.clone();
        }
    }

    fn couples(&self, couple: &mut dyn FnMut(Coupled)) {
        if let Some(Moving { ghost, .. }) = &self.moving {
            (0..ghost.n_faces()).for_each(|face| couple(Coupled::Nodes(ghost.nodes_of(face))));
        }
    }

    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        let Some(moving) = &mut self.moving else { return Ok(()) };
        if moving.dynamics.rayleigh[1] != 0.0 && moving.stiffness.is_empty() && wanted == Wanted::Stiffness {
            // The points are the first term.
            moving.stiffness.clone_from(&sum.blocks);
        }
        if moving.mass.is_none() {
            moving.prepare(step, points, sum);
        }
        moving.last.copy_from_slice(at.delta_d);
        moving.end = OnceCell::new();
        let Moving { mass: Some(mass), force, constant, resultant, .. } = moving else { return Ok(()) };
        *resultant = [0.0; D];
        let mut moved = vec![[0.0; N]; at.delta_d.len()];
        mass.multiply(sum, at.delta_d, &mut moved);
        for (node, (moved, constant)) in moved.iter().zip(&*constant).enumerate() {
            let mut scale = [0.0; N];
            for d in 0..D {
                let grows = force.displacement * moved[d];
                sum.internal[node][d] += grows - constant[d];
                resultant[d] -= grows - constant[d];
                // In free flight, nothing else has a size.
                scale[d] = grows.abs().max(constant[d].abs());
            }
            sum.add_scale(node, &scale);
        }
        if wanted == Wanted::Stiffness {
            mass.add::<D, N>(force.displacement, sum);
        }
        moving.damp(step.weight(), at, wanted, sum);
        Ok(())
    }

    fn ledger(&self, step: &StepContext<D>, points: &Points<D>, at: At<N>) -> Ledger {
        let Some(moving) = &self.moving else {
            let lost = points.velocity().map_or(0.0, |velocity| kinetic(points, velocity));
            if lost == 0.0 {
                return Ledger::default();
            }
            return [
                NamedEnergy::stored(Ledger::KINETIC, [lost, 0.0]),
                NamedEnergy::dissipated(Ledger::STOPPED, lost),
            ]
            .into();
        };
        let end = moving.end(step, points, at.delta_d);
        let mut ledger = Ledger::from([
            NamedEnergy::stored(Ledger::KINETIC, [end.kinetic_before, end.kinetic]),
            NamedEnergy::dissipated(Ledger::GHOST, end.ghost_loss),
        ]);
        if moving.dynamics.pic > 0.0 {
            ledger.add(NamedEnergy::dissipated(Ledger::PIC, end.pic_loss));
        }
        if moving.dynamics.rayleigh != [0.0; 2] {
            ledger.add(NamedEnergy::dissipated(Ledger::RAYLEIGH, moving.damped));
        }
        if moving.dynamics.scheme.weight() != 0.5 || moving.dynamics.scheme.keeps_acceleration() {
            ledger.add(NamedEnergy::dissipated(Ledger::ALGORITHMIC, end.algorithmic_loss));
        }
        ledger
    }

    fn report(&self, _: &Model<D>, report: &mut TermReport<D>) {
        if let Some(moving) = &self.moving {
            report.add_force(INERTIA, moving.resultant);
        }
    }

    fn excess(&self, step: &StepContext<D>, points: &Points<D>, at: At<N>) -> f64 {
        self.moving.as_ref().map_or(0.0, |moving| motion::excess(moving, step, points, at.delta_d))
    }

    fn commit(&mut self, step: &StepContext<D>, points: &mut Points<D>) {
        match &self.moving {
            Some(moving) => {
                let end = moving.end(step, points, &moving.last);
                points.set_motion(&end.velocity, &end.acceleration);
            }
            None if points.velocity().is_some_and(|velocity| velocity.iter().any(|v| *v != 0.0)) => {
                let rest = vec![0.0; 3 * points.len()];
                points.set_motion(&rest, &rest);
            }
            None => {}
        }
    }

    fn layout(&mut self) -> Option<&mut dyn Layout> {
        Some(self)
    }
}

impl<const D: usize, const N: usize> Layout for Inertia<D, N> {
    fn forget_layout(&mut self) {
        if let Some(moving) = &mut self.moving {
            moving.mass = None;
            moving.stiffness.clear();
        }
    }
}
