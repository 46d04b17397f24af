//! Evaluation of an iterate: eqs. (19)-(25), (27)-(29) and the residual of eq. (40). δd is halved if a point cannot follow it, and
//! shortened by a line search if it overshoots.

use crate::assembly::Wanted;
use crate::step::StepContext;
use crate::terms::EvaluateError;
use crate::timing::Phase;

use super::attempt::Effort;
use super::damping::MOST_TRIALS;
use super::error::{SolveError, locate_failure};
use super::load_step::LoadStep;
use super::residual::{Measured, RoundOff};
use super::round_off::EvaluatedAt;
use super::unknowns::Bracket;

/// Largest number of halvings of δd when a point cannot follow it.
const MOST_HALVINGS: usize = 5;
/// Largest number of evaluations of a line search.
const MOST_SEARCHES: usize = 3;
/// The same where bodies touch tools: forces have kinks.
const MOST_SEARCHES_OF_CONTACT: usize = 6;
/// Fraction of the residual to which an increment must reduce it where bodies touch tools, lest a line search follows.
const FAST: f64 = 0.1;
/// First iteration since the last update of multipliers from which on an increment where bodies touch tools is halved until it
/// does not increase the residual: friction has no potential whose slope would end a cycle between two states.
const FIRST_BACKTRACK: usize = 8;
/// Largest number of such halvings.
const MOST_BACKTRACKS: usize = 5;
/// First iteration with a line search after a failed attempt.
const FIRST_SEARCH: usize = 3;
/// First iteration with a line search otherwise, as a fraction of those allowed, so that iterations that converge are
/// left alone.
const LATE: f64 = 0.75;

impl<const D: usize, const N: usize> LoadStep<'_, D, N> {
    /// Evaluates the iterate, and records its residual, eq. (40).
    pub(super) fn evaluate_iterate(&mut self, iteration: usize) -> Result<f64, SolveError> {
        let mut measured = match self.try_forces_only() {
            Ok(Some(residual)) => Ok(Measured { residual, round_off: RoundOff::NoMatter }),
            Ok(None) => self.evaluate(iteration),
            Err(failure) => Err(failure),
        };
        // Better than Δd = 0, where the iterations have begun.
        let is_better = |found: &Measured| found.residual < self.course.residuals[0];
        let may_be_evaluated = !measured.as_ref().is_err_and(EvaluateError::is_final);
        if self.is_predicted && may_be_evaluated && !measured.as_ref().is_ok_and(is_better) {
            self.unknowns.start_again();
            measured = self.evaluate(iteration);
        }
        self.is_predicted = false;
        let StepContext { model, step, .. } = self.context;
        let Measured { residual, round_off } = measured
            .map_err(|f| locate_failure(f, model, self.points, step, iteration, &self.course.residuals))?;
        self.course.residuals.push(residual);
        self.course.round_off = round_off;
        self.observer.iteration(step, iteration, residual);
        if iteration == 0 {
            // Δd = 0: the stresses are those of the start of the step.
            self.course.f_int_start = self.system.sum.system().internal_force().to_vec();
        }
        Ok(residual)
    }

    /// Evaluates the forces without K if quadratic convergence predicts that this iterate meets the tolerance. `None` if no such
    /// prediction is made, or if it is wrong. Kept tangents allow no prediction.
    ///
    /// # Errors
    /// [`EvaluateError::Law`].
    fn try_forces_only(&mut self) -> Result<Option<f64>, EvaluateError> {
        let tolerance = self.context.model.newton.tolerance;
        let is_last = !self.effort.may_keep_stiffness(&self.context.model.newton)
            && !self.is_damped()
            && self.course.forecast(&self.forcing, self.summary.last_iterations) <= tolerance
            && self.has_reached_constraints();
        if !is_last {
            return Ok(None);
        }
        match self.evaluate_terms(Wanted::Force) {
            Ok(()) => {}
            Err(failure) if failure.is_final() => return Err(failure),
            Err(_) => return Ok(None),
        }
        let (system, unknowns) = (self.system.sum.system(), &self.unknowns);
        let forces = unknowns.forces(&self.course.out_of_balance, system);
        let of_globals = system.border.relative_residual();
        let residual = forces
            .balanced(&self.system.parts, system.internal_force(), tolerance)
            .filter(|_| of_globals <= tolerance);
        Ok(residual.map(|residual| residual.max(of_globals)))
    }

    /// Evaluates forces, K and the residual of eq. (40). δd is halved if a point cannot follow it; a line search shortens it if
    /// the potential rises again at its end.
    fn evaluate(&mut self, iteration: usize) -> Result<Measured, EvaluateError> {
        let [most_halvings, most_searches] = match (self.is_damped(), self.context.model.tools.is_empty()) {
            (true, _) => [MOST_TRIALS; 2],
            (false, true) => [MOST_HALVINGS, MOST_SEARCHES],
            (false, false) => [MOST_HALVINGS, MOST_SEARCHES_OF_CONTACT],
        };
        let (mut halvings, mut searches, mut backtracks, mut bracket) = (0, 0, 0, Bracket::default());
        loop {
            if self.context.model.tools.is_empty() {
                bracket = Bracket::default(); // Smooth potentials need no more than a secant.
            }
            self.course.shortened = halvings + searches + backtracks > 0; // adapts the damping
            let may_shorten = iteration > 0 && !self.unknowns.prescribes && !self.course.is_augmented;
            match self.evaluate_terms(Wanted::Stiffness) {
                Err(failure) if !failure.is_final() && may_shorten && halvings < most_halvings => {
                    halvings += 1;
                    self.shorten(0.5);
                    continue;
                }
                outcome => outcome?,
            }
            let found = self.residual_by_parts();
            // Round-off alone tells nothing about the length of an increment.
            if found.residual <= self.context.model.newton.tolerance {
                return Ok(found);
            }
            if searches < most_searches
                && !self.course.is_augmented
                && self.may_search(iteration, found.residual)
                && let Some(shorter) = self.unknowns.secant_fraction(
                    &self.course.out_of_balance,
                    &self.system.sum.system().border,
                    &mut bracket,
                )
            {
                searches += 1;
                self.shorten(shorter);
                continue;
            }
            if backtracks < MOST_BACKTRACKS && may_shorten && self.cycles(iteration, found.residual) {
                backtracks += 1;
                self.shorten(0.5);
                continue;
            }
            return Ok(found);
        }
    }

    /// Reduces the last iterative increment to this fraction of what was taken of it.
    fn shorten(&mut self, part: f64) {
        if std::mem::take(&mut self.course.is_augmented_along) {
            self.system.sum.withdraw_augmentation();
        }
        self.unknowns.shorten(part);
    }

    /// Evaluates all terms at Δd (trial stresses and strains, f_int, f_ext and, if wanted, K), moves forces on ties, and forms
    /// the out-of-balance force of eq. (28).
    fn evaluate_terms(&mut self, wanted: Wanted) -> Result<(), EvaluateError> {
        let LoadStep { context, points, system, unknowns, course, summary, .. } = self;
        summary.evaluations += 1;
        let evaluate = || system.sum.evaluate(context, points, unknowns.at(), wanted);
        summary.timings.measure(Phase::Assembly, evaluate)?;
        if wanted == Wanted::Stiffness && system.sum.outgrows(context, &system.dofs) {
            self.is_laid_out_anew = true;
            return self.evaluate_terms(wanted);
        }
        system.sum.system_mut().complete();
        system.sum.system_mut().condense(&system.dofs);
        course.out_of_balance = unknowns.balance(system.sum.system());
        Ok(())
    }

    /// The residual of eq. (40), by connected parts.
    fn residual_by_parts(&self) -> Measured {
        let StepContext { model, links, .. } = self.context;
        let (system, unknowns) = (self.system.sum.system(), &self.unknowns);
        let at = EvaluatedAt { model, points: self.points, links, system, delta_d: &unknowns.delta_d };
        let forces = unknowns.forces(&self.course.out_of_balance, system);
        let tolerance = model.newton.tolerance;
        let measured = forces.measure(&self.system.parts, tolerance, &at);
        let of_globals = system.border.relative_residuals();
        of_globals.fold(measured, |measured, of_global| {
            measured.and(Measured::of_global(of_global, tolerance), tolerance)
        })
    }

    /// True if bodies touch tools and an increment of late iterations has led to a larger residual.
    fn cycles(&self, iteration: usize, residual: f64) -> bool {
        let before = self.course.residuals.last().copied().unwrap_or(f64::INFINITY);
        !self.context.model.tools.is_empty()
            && iteration - self.course.solves_before >= FIRST_BACKTRACK
            && residual > before.max(self.context.model.newton.tolerance)
    }

    /// True if a line search may shorten the last increment, given the residual it has led to. Where bodies touch tools, any
    /// increment may overshoot.
    fn may_search(&self, iteration: usize, residual: f64) -> bool {
        let newton = &self.context.model.newton;
        let (damped, touches_tools) = (self.is_damped(), !self.context.model.tools.is_empty());
        let first = if damped || touches_tools {
            1
        } else if self.summary.pace.is_careful() || self.effort == Effort::Thorough {
            FIRST_SEARCH
        } else {
            ((LATE * newton.max_iterations as f64) as usize).max(FIRST_SEARCH)
        };
        let before = self.course.residuals.last().copied().unwrap_or(f64::INFINITY);
        iteration - self.course.solves_before >= first
            && !self.unknowns.prescribes
            // Only the first increment changes the quantity that determines the load factor.
            && (self.system.sum.system().per_factor().is_none() || touches_tools && iteration > 1)
            && (damped || residual > if touches_tools { FAST * before } else { before })
            && residual > newton.tolerance
    }
}
