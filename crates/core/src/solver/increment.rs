//! The increment of an iteration, eqs. (26) and (30): by Newton's method or, as a last resort, damped.

use crate::linear::{LinearError, Solved};
use crate::step::{At, Nodal, displacement};
use crate::timing::Phase;

use super::attempt::{Attempt, NoIncrement};
use super::damping::{AT_REST, Damping, MAX_FACTORISATIONS, farthest};
use super::equations::RightHandSide;
use super::error::SolveError;
use super::load_step::smallest_cell;
use super::newton::LoadStep;
use super::step_system::StepSystem;
use super::stepping::control::{Field, NoPath, Responses};
use super::unknowns::Unknowns;

/// Largest number of increments with support in an attempt: a body that still slides after these does not come to rest.
const MAX_SUPPORTED: usize = 8;
/// Largest number of multiplier updates along an increment.
const MAX_UPDATES: usize = 4;

impl<const D: usize, const N: usize> LoadStep<'_, '_, D, N> {
    /// Adds an increment δd to Δd, either from Newton's method or from a damped iteration.
    pub(super) fn increment(&mut self) -> Result<(), SolveError> {
        if !self.equations.is_prepared() {
            self.prepare_equations()?;
        }
        self.search.is_predicted = self.unknowns.predicted.is_some();
        (self.course.is_augmented, self.course.is_augmented_along) = (false, false);
        let solved = if self.attempt.is_damped() { self.damped_step() } else { self.supported_step() };
        let context = &self.attempt.context;
        let solved = solved.map_err(|obstacle| match obstacle {
            NoIncrement::Linear(error) => SolveError::linear(error, context, &self.system),
            NoIncrement::Path(reason) => SolveError::NoPath { step: context.step.index, reason },
        })?;
        if let Some(solved) = solved {
            self.summary.count(solved, self.system.nature(context.model));
            self.course.solved.push(solved);
        }
        Ok(())
    }

    /// An increment of Newton's method. If the equations are singular and contact points slide, these points are
    /// supported during the solve, because their friction may be all that holds a body.
    fn supported_step(&mut self) -> Result<Option<Solved>, NoIncrement> {
        let may_support = self.course.supported < MAX_SUPPORTED;
        match self.newton_step() {
            Err(NoIncrement::Linear(error @ (LinearError::Singular { .. } | LinearError::Undetermined)))
                if may_support && self.system.sum.support() =>
            {
                self.course.supported += 1;
                self.course.singular = Some(error);
                self.equations.forget_factor();
                self.newton_step()
            }
            outcome => outcome,
        }
    }

    /// Solves eq. (26), K δd = f_ext − f_int on the free degrees of freedom, adds δd to Δd by eq. (30), and updates the
    /// reactions. The first δd contains the whole prescribed increment. With a predictor, the first δd is the predicted
    /// one and nothing is solved.
    ///
    /// The error of an inexact solution stays in the out-of-balance force of the free degrees of freedom. It never
    /// enters the reactions.
    fn newton_step(&mut self) -> Result<Option<Solved>, NoIncrement> {
        let eta = self.form_right_hand_side();
        if let Some(predicted) = self.unknowns.predicted.take() {
            self.add_predicted(predicted);
            self.advance()?;
            return Ok(None);
        }
        let may_augment = self.may_augment_along();
        let mut solved = self.solve(eta)?; // (26)
        solved.iterations += self.solve_for_factor(eta)?;
        if may_augment {
            self.augment_along(eta)?;
        }
        self.advance()?; // (30)
        Ok(Some(solved))
    }

    /// Forms the right-hand side of eq. (26), f_ext − f_int less K times the prescribed part of δd; δd becomes the
    /// remainder of the prescribed motion. Returns the relative tolerance of an iterative solution.
    fn form_right_hand_side(&mut self) -> f64 {
        let LoadStep { attempt, system: StepSystem { dofs, sum, .. }, unknowns, course, summary, .. } = self;
        let begin = || unknowns.begin_iteration(sum.system_mut(), dofs, &course.out_of_balance);
        summary.timings.measure(Phase::Solve, begin);
        let residual = course.residuals.last().copied().unwrap_or(1.0);
        course.forcing.next(unknowns.reduction.norm(&unknowns.rhs), residual, attempt.tolerance())
    }

    /// Makes the predicted increment the first δd.
    fn add_predicted(&mut self, mut predicted: Nodal<N>) {
        let dofs = &self.system.dofs;
        dofs.on_unknowns(&mut predicted);
        dofs.add_unknowns(&predicted, &mut self.unknowns.iterative);
    }

    /// True if multipliers may be updated along the increment: near the solution, the states of all contact points may
    /// be final. This is done only once, because contact points that hinder each other would change their states again
    /// and again. After a failed attempt, updates wait for equilibrium.
    fn may_augment_along(&mut self) -> bool {
        self.system.condition.is_none()
            && !self.equations.is_iterative()
            && !self.unknowns.prescribes
            && !self.course.was_augmented_along
            && !self.attempt.pace.is_careful()
            && self.course.falls_fast()
    }

    /// Solves for δd, with the factor of an earlier iteration where it may serve again.
    fn solve(&mut self, eta: f64) -> Result<Solved, NoIncrement> {
        let LoadStep { attempt, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { equations, summary, .. } = self;
        let context = attempt.context.equations(dofs);
        let (system, timings) = (sum.system_mut(), &mut summary.timings);
        // A preconditioner from an earlier iteration does not affect the solution.
        let may_reuse_factor = (attempt.may_keep_stiffness() || equations.is_iterative())
            && course.falls_fast()
            && !unknowns.prescribes
            && equations.has_factor();
        let Unknowns { rhs, iterative, .. } = &mut *unknowns;
        let rhs = RightHandSide { forces: rhs, globals: None };
        let (solved, globals) = if may_reuse_factor {
            equations.solve_with_last_factor(context, system, rhs, iterative, eta, timings)?
        } else {
            equations.solve(context, system, rhs, iterative, eta, timings)?
        };
        (unknowns.iterative_globals, unknowns.iterative_factor) = (globals, 0.0);
        Ok(solved)
    }

    /// If the load factor is an unknown, adds the response to its change, which the condition on the path determines;
    /// returns the number of iterations of the linear solver.
    fn solve_for_factor(&mut self, eta: f64) -> Result<usize, NoIncrement> {
        let LoadStep { attempt, system: StepSystem { dofs, sum, condition, .. }, unknowns, course, .. } =
            self;
        let LoadStep { equations, summary, .. } = self;
        let (context, system) = (attempt.context.equations(dofs), sum.system_mut());
        let (Some(mut unit), Some(condition)) = (system.per_factor().cloned(), condition) else {
            return Ok(0);
        };
        let mut by_load = vec![[0.0; N]; unknowns.rhs.len()];
        dofs.on_unknowns(&mut unit);
        // The load factor changes the global equations, too.
        let for_globals = system.border.per_factor.clone();
        let rhs = RightHandSide { forces: &unit, globals: Some(&for_globals) };
        let timings = &mut summary.timings;
        let (solved, globals) =
            equations.solve_with_last_factor(context, system, rhs, &mut by_load, eta, timings)?;
        let change = condition
            .change(Responses {
                so_far: Field { nodes: &unknowns.delta_d, globals: &unknowns.globals },
                to_residual: Field { nodes: &unknowns.iterative, globals: &unknowns.iterative_globals },
                to_load: Field { nodes: &by_load, globals: &globals },
            })
            .map_err(|reason| match reason {
                // The loads had an influence at the start of the step; in a smaller step they retain it.
                NoPath::NoInfluence if !course.solved.is_empty() => NoPath::NoIntersection,
                reason => reason,
            })
            .map_err(NoIncrement::Path)?;
        unknowns.add_response(change, &by_load, &globals);
        Ok(solved.iterations)
    }

    /// Updates multipliers along the iterative increment δd until the updates no longer change δd, so that δd and the
    /// multipliers together solve the linearised equations.
    fn augment_along(&mut self, eta: f64) -> Result<(), NoIncrement> {
        let LoadStep { attempt, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { equations, summary, .. } = self;
        let context = attempt.context.equations(dofs);
        for update in 0..MAX_UPDATES {
            let Unknowns { iterative, iterative_globals: globals, .. } = &mut *unknowns;
            let increment = At { delta_d: iterative, globals, factor: 0.0 };
            let Some(mut added) = sum.augment_along(increment, update) else { break };
            (course.is_augmented_along, course.was_augmented_along) = (true, true);
            dofs.condense(&mut added.force);
            dofs.on_unknowns(&mut added.force);
            let rhs = RightHandSide { forces: &added.force, globals: Some(&added.globals) };
            let (system, timings) = (sum.system_mut(), &mut summary.timings);
            let mut more = vec![[0.0; N]; iterative.len()];
            let (_, for_globals) =
                equations.solve_with_last_factor(context, system, rhs, &mut more, eta, timings)?;
            unknowns.add_to_increment(1.0, &more, &for_globals);
        }
        Ok(())
    }

    /// Adds δd to Δd, eq. (30), and updates the reactions.
    fn advance(&mut self) -> Result<(), LinearError> {
        let LoadStep { system: StepSystem { dofs, sum, .. }, unknowns, course, summary, .. } = self;
        let advance = || unknowns.advance(sum.system_mut(), dofs, &course.out_of_balance);
        summary.timings.measure(Phase::Solve, advance)
    }

    /// A Newton step with the stiffness damped until it is positive definite.
    fn damped_step(&mut self) -> Result<Option<Solved>, NoIncrement> {
        let LoadStep { attempt, system: StepSystem { dofs, sum, .. }, unknowns, course, damping, .. } = self;
        let LoadStep { equations, summary, .. } = self;
        let Attempt { context, stride, .. } = *attempt;
        let (equation_context, tolerance) = (context.equations(dofs), attempt.tolerance());
        let (system, timings) = (sum.system_mut(), &mut summary.timings);
        if let Some(damping) = damping {
            damping.adapt(course.shortened);
        }
        let damping = damping.get_or_insert_with(|| Damping::new(system));
        unknowns.begin_iteration(system, dofs, &course.out_of_balance);
        damping.add_to(system);
        let prescribed = unknowns.iterative.clone();
        let mut tries = 0;
        let (solved, globals) = loop {
            tries += 1;
            let Unknowns { rhs, iterative, .. } = &mut *unknowns;
            iterative.clone_from(&prescribed);
            let rhs = RightHandSide { forces: rhs, globals: None };
            let solved = equations.solve(equation_context, system, rhs, iterative, tolerance, timings);
            match solved {
                Ok((solved, globals)) if solved.factorisation.is_definite() => break (solved, globals),
                outcome if tries == MAX_FACTORISATIONS => break outcome?,
                _ => damping.increase(system),
            }
        };
        unknowns.iterative_globals = globals;
        let far = attempt.reduction().largest(farthest(&displacement::<D, N>(&unknowns.iterative)));
        if far > stride {
            let part = stride / far;
            unknowns.iterative.iter_mut().flatten().for_each(|u| *u *= part);
            unknowns.iterative_globals.iter_mut().for_each(|w| *w *= part);
        }
        self.advance()?;
        Ok(Some(solved))
    }

    /// Checks that the undamped stiffness of an equilibrium found by damped iterations resists every motion, so that
    /// the points stay there without damping.
    pub(super) fn check_stability(&mut self) -> Result<(), LinearError> {
        let LoadStep { attempt, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { equations, summary, .. } = self;
        let context = attempt.context;
        let system = sum.system_mut();
        unknowns.begin_iteration(system, dofs, &course.out_of_balance);
        let Unknowns { rhs, iterative, .. } = unknowns;
        let rhs = RightHandSide { forces: rhs, globals: None };
        let (equation_context, tolerance) = (context.equations(dofs), attempt.tolerance());
        let (solved, _) =
            equations.solve(equation_context, system, rhs, iterative, tolerance, &mut summary.timings)?;
        let at_rest = AT_REST * smallest_cell(context.model, context.links);
        let far = attempt.reduction().largest(farthest(&displacement::<D, N>(iterative)));
        if solved.factorisation.is_definite() && far <= at_rest {
            return Ok(());
        }
        Err(LinearError::Singular { unknown: None })
    }
}
