//! Evaluation of an iterate: eqs. (19)-(23), (27), (28), and the residual of eq. (40).

use crate::assembly::Wanted;
use crate::step::StepContext;
use crate::terms::EvaluateError;
use crate::timing::Phase;

use super::load_step::LoadStep;
use super::residual::Measured;
use super::round_off::EvaluatedAt;

impl<const D: usize, const N: usize> LoadStep<'_, D, N> {
    /// What the next evaluation computes: only the forces if quadratic convergence predicts that the iterate meets the
    /// tolerance, otherwise the stiffness as well. With kept tangents, no prediction is possible.
    pub(super) fn wanted(&self) -> Wanted {
        let newton = &self.context.model.newton;
        let is_last = !self.search.needs_stiffness
            && !self.effort.may_keep_stiffness(newton)
            && !self.is_damped()
            && self.course.forecast(&self.forcing, self.progress.last_iterations) <= newton.tolerance
            && self.has_reached_constraints();
        if is_last { Wanted::Force } else { Wanted::Stiffness }
    }

    /// Evaluates all terms at Δd (trial stresses and strains, f_int, f_ext and, if wanted, K), moves the forces on tied
    /// components to the components to which these are tied, and forms the out-of-balance force of eq. (28).
    ///
    /// # Errors
    /// [`EvaluateError`] if a point cannot follow Δd, or a law fails.
    pub(super) fn evaluate(&mut self, wanted: Wanted) -> Result<(), EvaluateError> {
        if wanted == Wanted::Stiffness {
            self.course.shortened = self.search.has_shortened(); // adapts the damping
        }
        let LoadStep { context, points, system, unknowns, course, summary, .. } = self;
        summary.evaluations += 1;
        let evaluate = || system.sum.evaluate(context, points, unknowns.at(), wanted);
        summary.timings.measure(Phase::Assembly, evaluate)?;
        if wanted == Wanted::Stiffness && system.sum.outgrows(context, &system.dofs) {
            self.is_laid_out_anew = true;
            return self.evaluate(wanted);
        }
        system.sum.system_mut().complete();
        system.sum.system_mut().condense(&system.dofs);
        course.out_of_balance = unknowns.balance(system.sum.system()); // (28)
        Ok(())
    }

    /// The residual of eq. (40), the largest over the connected parts and the global equations. `None` if only forces
    /// were evaluated and they do not meet the tolerance.
    pub(super) fn residual(&self, wanted: Wanted) -> Option<Measured> {
        let StepContext { model, links, .. } = self.context;
        let (system, unknowns, parts) = (self.system.sum.system(), &self.unknowns, &self.system.parts);
        let tolerance = model.newton.tolerance;
        let forces = unknowns.forces(&self.course.out_of_balance, system);
        if wanted == Wanted::Force {
            let of_globals = system.border.relative_residual();
            let of_parts = forces.balanced(parts, tolerance, system, &unknowns.delta_d)?;
            let measured = of_parts.and(Measured::beyond_round_off(of_globals), tolerance);
            return (of_globals <= tolerance).then_some(measured);
        }
        let at = EvaluatedAt { model, points: self.points, links, system, delta_d: &unknowns.delta_d };
        let measured = forces.measure(parts, tolerance, &at); // (40)
        let of_globals = system.border.relative_residuals();
        Some(of_globals.fold(measured, |measured, of_global| {
            measured.and(Measured::of_global(of_global, tolerance), tolerance)
        }))
    }
}
