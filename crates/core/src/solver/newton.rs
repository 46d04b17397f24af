//! Newton iterations to equilibrium within one load step: eqs. (26), (28), (30) and (40).

use crate::linear::{LinearError, Solved};
use crate::ranks::Ranks;
use crate::step::{At, Nodal, StepContext, displacement};
use crate::terms::Augmentation;
use crate::timing::Phase;

use super::attempt::{Ended, NoIncrement};
use super::control::{Condition, Field, NoPath};
use super::damping::{self, MORE_ITERATIONS};
use super::equations::RightHandSide;
use super::error::SolveError;
use super::load_step::LoadStep;
use super::located::locate_failure;
use super::residual::RoundOff;
use super::step_system::StepSystem;
use super::unknowns::Unknowns;

/// Largest number of increments with support in an attempt: a body that still slides after these does not come to rest.
const MOST_SUPPORTED: usize = 8;
/// Largest number of multiplier updates along an increment.
const MOST_UPDATES: usize = 4;

impl<const D: usize, const N: usize> LoadStep<'_, D, N> {
    /// Iterates with Newton's method until the residual of eq. (40) meets the tolerance and multipliers are final, or
    /// until damped iterations need a fresh grid. Writes only the trial state.
    ///
    /// # Errors
    /// [`SolveError`] if there is no equilibrium.
    pub(super) fn iterate(&mut self) -> Result<Ended, SolveError> {
        self.prepare_equations()?;
        let mut iteration = 0;
        loop {
            let wanted = self.wanted();
            let measured = self.evaluate(wanted).map(|()| self.residual(wanted)); // (19)-(23), (27), (28), (40)
            // Records the residual, unless the iterate must be evaluated again, in most cases after a shorter δd.
            let Some(residual) = self.settle(iteration, wanted, measured)? else { continue };
            let is_balanced = self.is_balanced(); // (40)
            if is_balanced && self.augment(iteration)? == Augmentation::Updated {
                continue;
            }
            if is_balanced || self.has_strayed(residual) {
                return self.conclude(is_balanced);
            }
            let is_last = iteration - self.course.solves_before == self.most_iterations();
            if is_last || !residual.is_finite() || self.course.is_hopeless() {
                return Err(self.without_equilibrium());
            }
            self.increment()?; // (26), (30)
            iteration += 1;
        }
    }

    /// Lets the terms update their multipliers in equilibrium; the iterations then continue, and the count of allowed
    /// linear solves starts again.
    fn augment(&mut self, iteration: usize) -> Result<Augmentation, SolveError> {
        let LoadStep { context, points, system, unknowns, course, .. } = self;
        let StepContext { model, step, .. } = *context;
        let outcome = system
            .sum
            .augment(context, points, unknowns.at())
            .map_err(|failure| locate_failure(failure, model, points, step, iteration, &course.residuals))?;
        if outcome == Augmentation::Updated {
            course.augmented(iteration);
        }
        Ok(outcome)
    }

    /// Prepares the equations for the layout of the system.
    fn prepare_equations(&mut self) -> Result<(), SolveError> {
        (self.is_laid_out_anew, self.course.has_factor) = (false, false);
        let LoadStep { context, system, equations, summary, .. } = self;
        let equation_context = context.equations(&system.dofs);
        let prepared = summary
            .timings
            .measure(Phase::Analyse, || equations.prepare(equation_context, system.sum.system()));
        prepared.map_err(|error| SolveError::linear(error, context, system))
    }

    fn most_iterations(&self) -> usize {
        let most = self.effort.most_iterations(&self.context.model.newton);
        if self.is_damped() { MORE_ITERATIONS * most } else { most }
    }

    pub(super) fn is_damped(&self) -> bool {
        self.progress.pace.is_damped()
    }

    /// True if the iterate is in equilibrium: it has the prescribed motion, the load factor meets its condition, and
    /// the residual meets the tolerance or comes as close to it as round-off permits. False in iteration 0, so that
    /// every step makes at least one iteration.
    fn is_balanced(&self) -> bool {
        self.has_reached_constraints() && self.course.is_equilibrium(self.context.model.newton.tolerance)
    }

    pub(super) fn has_reached_constraints(&self) -> bool {
        let shortened = self.course.shortened;
        self.ranks().all(self.system.dofs.is_reached(&self.unknowns.delta_d))
            && self.system.condition.as_ref().is_none_or(|condition| condition.is_met() && !shortened)
    }

    /// True if a node has moved farther than a stride, which is infinite unless damped iterations may continue on a
    /// fresh grid.
    fn has_strayed(&self, residual: f64) -> bool {
        residual.is_finite() && self.farthest() > self.stride
    }

    /// True if no node has moved farther than damped iterations may move it on one grid.
    fn is_at_rest(&self) -> bool {
        self.farthest() <= self.stride
    }

    /// Largest component of a nodal displacement of the step, [length].
    fn farthest(&self) -> f64 {
        self.ranks().largest(damping::farthest(&displacement::<D, N>(&self.unknowns.delta_d)))
    }

    /// The ranks of the analysis.
    pub(super) fn ranks(&self) -> &Ranks {
        self.context.links.halo().ranks()
    }

    /// Adds an increment δd to Δd, either from Newton's method or from a damped iteration.
    fn increment(&mut self) -> Result<(), SolveError> {
        if self.is_laid_out_anew {
            self.prepare_equations()?;
        }
        self.is_predicted = self.unknowns.predicted.is_some();
        (self.course.is_augmented, self.course.is_augmented_along) = (false, false);
        let solved = if self.is_damped() { self.damped_step() } else { self.supported_step() };
        let step = self.context.step;
        let solved = solved.map_err(|obstacle| match obstacle {
            NoIncrement::Linear(error) => SolveError::linear(error, &self.context, &self.system),
            NoIncrement::Path(reason) => SolveError::NoPath { step: step.index, reason },
        })?;
        if let Some(solved) = solved {
            self.summary.count(solved, self.system.nature(self.context.model));
            self.course.solved.push(solved);
        }
        Ok(())
    }

    /// An increment of Newton's method. If the equations are singular and contact points slide, these points are
    /// supported during the solve, because their friction may be all that holds a body.
    fn supported_step(&mut self) -> Result<Option<Solved>, NoIncrement> {
        let may_support = self.course.supported < MOST_SUPPORTED;
        match self.newton_step() {
            Err(NoIncrement::Linear(error @ (LinearError::Singular { .. } | LinearError::Undetermined)))
                if may_support && self.system.sum.support() =>
            {
                self.course.supported += 1;
                (self.course.singular, self.course.has_factor) = (Some(error), false);
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
        let LoadStep { context, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { summary, forcing, .. } = self;
        let begin = || unknowns.begin_iteration(sum.system_mut(), dofs, &course.out_of_balance);
        summary.timings.measure(Phase::Solve, begin);
        let residual = course.residuals.last().copied().unwrap_or(1.0);
        forcing.next(unknowns.halo.norm(&unknowns.rhs), residual, context.model.newton.tolerance)
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
            && !self.progress.pace.is_careful()
            && self.course.falls_fast()
    }

    /// Solves for δd, with the factor of an earlier iteration where it may serve again.
    fn solve(&mut self, eta: f64) -> Result<Solved, NoIncrement> {
        let LoadStep { context, system: StepSystem { dofs, sum, .. }, unknowns, course, .. } = self;
        let LoadStep { equations, summary, effort, .. } = self;
        let (context, newton) = (context.equations(dofs), &context.model.newton);
        let (system, timings) = (sum.system_mut(), &mut summary.timings);
        // A preconditioner from an earlier iteration does not affect the solution.
        let may_reuse_factor = (effort.may_keep_stiffness(newton) || equations.is_iterative())
            && course.falls_fast()
            && !unknowns.prescribes
            && course.has_factor;
        let Unknowns { rhs, iterative, .. } = &mut *unknowns;
        let rhs = RightHandSide { forces: rhs, globals: None };
        let (solved, globals) = if may_reuse_factor {
            equations.solve_with_last_factor(context, system, rhs, iterative, eta, timings)?
        } else {
            equations.solve(context, system, rhs, iterative, eta, timings)?
        };
        course.has_factor = true;
        (unknowns.iterative_globals, unknowns.iterative_factor) = (globals, 0.0);
        Ok(solved)
    }

    /// If the load factor is an unknown, adds the response to its change, which the condition on the path determines;
    /// returns the number of iterations of the linear solver.
    fn solve_for_factor(&mut self, eta: f64) -> Result<usize, NoIncrement> {
        let LoadStep { context, system: StepSystem { dofs, sum, condition, .. }, unknowns, course, .. } =
            self;
        let LoadStep { equations, summary, .. } = self;
        let (context, system, timings) = (context.equations(dofs), sum.system_mut(), &mut summary.timings);
        let (Some(mut unit), Some(condition)) = (system.per_factor().cloned(), condition) else {
            return Ok(0);
        };
        let mut of_load = vec![[0.0; N]; unknowns.rhs.len()];
        dofs.on_unknowns(&mut unit);
        // The load factor changes the global equations, too.
        let of_globals = system.border.per_factor.clone();
        let rhs = RightHandSide { forces: &unit, globals: Some(&of_globals) };
        let (solved, globals) =
            equations.solve_with_last_factor(context, system, rhs, &mut of_load, eta, timings)?;
        let change = condition
            .change(
                Field { nodes: &unknowns.delta_d, globals: &unknowns.globals },
                Field { nodes: &unknowns.iterative, globals: &unknowns.iterative_globals },
                Field { nodes: &of_load, globals: &globals },
            )
            .map_err(|reason| match reason {
                // The loads had an influence at the start of the step; in a smaller step they retain it.
                NoPath::NoInfluence if !course.solved.is_empty() => NoPath::NoIntersection,
                reason => reason,
            })
            .map_err(NoIncrement::Path)?;
        unknowns.add_response(change, &of_load, &globals);
        Ok(solved.iterations)
    }

    /// Adds δd to Δd, eq. (30), and updates the reactions.
    fn advance(&mut self) -> Result<(), NoIncrement> {
        let LoadStep { system: StepSystem { dofs, sum, .. }, unknowns, course, summary, .. } = self;
        let advance = || unknowns.advance(sum.system_mut(), dofs, &course.out_of_balance);
        summary.timings.measure(Phase::Solve, advance)?;
        Ok(())
    }

    /// Updates multipliers along the iterative increment δd until the updates no longer change δd, so that δd and the
    /// multipliers together solve the linearised equations.
    fn augment_along(&mut self, eta: f64) -> Result<(), NoIncrement> {
        let LoadStep { context, system: StepSystem { dofs, sum, .. }, unknowns, .. } = self;
        let LoadStep { equations, summary, course, .. } = self;
        let equation_context = context.equations(dofs);
        for update in 0..MOST_UPDATES {
            let Unknowns { iterative, iterative_globals: globals, .. } = &mut *unknowns;
            let increment = At { delta_d: iterative, globals, factor: 0.0 };
            let Some(mut added) = sum.augment_along(increment, update) else { break };
            (course.is_augmented_along, course.was_augmented_along) = (true, true);
            dofs.condense(&mut added.force);
            dofs.on_unknowns(&mut added.force);
            let rhs = RightHandSide { forces: &added.force, globals: Some(&added.globals) };
            let (system, timings) = (sum.system_mut(), &mut summary.timings);
            let mut more = vec![[0.0; N]; iterative.len()];
            let (_, of_globals) =
                equations.solve_with_last_factor(equation_context, system, rhs, &mut more, eta, timings)?;
            unknowns.add_to_increment(1.0, &more, &of_globals);
        }
        Ok(())
    }

    /// Ends the iterations: checks the path and the stability, and frees the matrices.
    fn conclude(&mut self, is_balanced: bool) -> Result<Ended, SolveError> {
        let StepContext { step, .. } = self.context;
        let reverses = |condition: &Condition<D, N>| !condition.goes_on(&self.unknowns.delta_d);
        if self.system.condition.as_ref().is_some_and(reverses) {
            return Err(SolveError::NoPath { step: step.index, reason: NoPath::Reversed });
        }
        let mut is_final = is_balanced;
        if self.is_laid_out_anew && is_balanced && self.is_damped() {
            self.prepare_equations()?;
        }
        if is_balanced
            && self.is_damped()
            && let Err(error) = self.check_stability()
        {
            if self.stride.is_infinite() {
                return Err(SolveError::linear(error, &self.context, &self.system));
            }
            // An unstable equilibrium: a fresh grid may lead away from it.
            is_final = false;
        }
        self.system.sum.free_matrices();
        let ended = if is_final { Ended::Balanced } else { Ended::Strayed { is_at_rest: self.is_at_rest() } };
        Ok(ended)
    }

    fn without_equilibrium(&self) -> SolveError {
        let StepContext { model, links, step, .. } = self.context;
        if let Some(error) = self.course.singular.clone() {
            return SolveError::linear(error, &self.context, &self.system);
        }
        let is_path_missed = self.system.condition.as_ref().is_some_and(|condition| !condition.is_met());
        if is_path_missed && self.course.is_equilibrium(model.newton.tolerance) {
            return SolveError::NoPath { step: step.index, reason: NoPath::NoIntersection };
        }
        let residuals = self.course.residuals.clone();
        let out_of_balance = displacement(&self.course.out_of_balance);
        if self.course.round_off == RoundOff::Forbids {
            return SolveError::round_off(model, links, step, residuals, &out_of_balance);
        }
        SolveError::not_converged(model, links, step, residuals, &out_of_balance)
    }
}
