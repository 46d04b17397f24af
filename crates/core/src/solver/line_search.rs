//! The decision on an evaluated iterate: either its residual is recorded, or the iterate is evaluated again. δd is
//! halved if a point cannot follow it, and shortened by a line search if it overshoots.

use crate::assembly::Wanted;
use crate::step::StepContext;
use crate::terms::EvaluateError;

use super::attempt::Effort;
use super::course::Search;
use super::damping::MOST_TRIALS;
use super::error::SolveError;
use super::load_step::LoadStep;
use super::located::locate_failure;
use super::residual::Measured;
use super::unknowns::Bracket;

/// Largest number of halvings of δd when a point cannot follow it.
const MOST_HALVINGS: usize = 5;
/// Largest number of evaluations of a line search.
const MOST_SEARCHES: usize = 3;
/// Largest number of evaluations of a line search if the equations have kinks.
const MOST_SEARCHES_WITH_KINKS: usize = 6;
/// If the equations have kinks, a line search may follow an increment that does not reduce the residual to this
/// fraction.
const FAST: f64 = 0.1;
/// If the equations have kinks, from this iteration after the last multiplier update onwards, an increment is halved
/// until the residual no longer increases: friction has no potential whose slope would end a cycle between two states.
const FIRST_BACKTRACK: usize = 8;
/// Largest number of halvings of an increment that increases the residual.
const MOST_BACKTRACKS: usize = 5;
/// First iteration with a line search after a failed attempt.
const FIRST_SEARCH: usize = 3;
/// Without a failed attempt, damping or kinks, the line search begins after this fraction of the iterations allowed:
/// late enough not to disturb iterations that converge by themselves.
const LATE: f64 = 0.75;

impl<const D: usize, const N: usize> LoadStep<'_, D, N> {
    /// Records the residual of the iterate; `None` if the iterate must be evaluated again, with its stiffness or closer
    /// to the previous iterate.
    ///
    /// # Errors
    /// [`SolveError`] if the iterate cannot be evaluated.
    pub(super) fn settle(
        &mut self,
        iteration: usize,
        wanted: Wanted,
        measured: Result<Option<Measured>, EvaluateError>,
    ) -> Result<Option<f64>, SolveError> {
        let is_final = measured.as_ref().is_err_and(EvaluateError::is_final);
        let found = match measured {
            Ok(Some(found)) => Ok(found),
            Err(failure) if is_final || wanted == Wanted::Stiffness => Err(failure),
            _ => {
                self.search.needs_stiffness = true;
                return Ok(None);
            }
        };
        if !is_final && (self.shortens(iteration, found.as_ref().ok()) || self.withdraws(&found)) {
            // The residual was forecast for the whole increment only.
            self.search.needs_stiffness = true;
            return Ok(None);
        }
        self.is_predicted = false;
        self.search = Search::default();
        let StepContext { model, step, .. } = self.context;
        let Measured { residual, round_off, by_field } = found
            .map_err(|f| locate_failure(f, model, self.points, step, iteration, &self.course.residuals))?;
        self.course.residuals.push(residual);
        self.course.round_off = round_off;
        self.observer.iteration(step, iteration, residual, &by_field);
        self.course.by_field = by_field;
        if iteration == 0 {
            // Δd = 0: the stresses are those at the start of the step.
            self.course.f_int_start = self.system.sum.system().internal_force().to_vec();
        }
        Ok(Some(residual))
    }

    /// Shortens δd and returns true if a point could not follow it (`found` is then `None`), if the potential rises
    /// again at the end of δd, or if the residual has grown in a cycle.
    fn shortens(&mut self, iteration: usize, found: Option<&Measured>) -> bool {
        let has_kinks = self.system.sum.has_kinks();
        let [most_halvings, most_searches] = match (self.is_damped(), has_kinks) {
            (true, _) => [MOST_TRIALS; 2],
            (false, false) => [MOST_HALVINGS, MOST_SEARCHES],
            (false, true) => [MOST_HALVINGS, MOST_SEARCHES_WITH_KINKS],
        };
        let may_shorten = iteration > 0 && !self.unknowns.prescribes && !self.course.is_augmented;
        let Some(&Measured { residual, .. }) = found else {
            let halves = may_shorten && self.search.halvings < most_halvings;
            if halves {
                self.search.halvings += 1;
                self.shorten(0.5);
            }
            return halves;
        };
        // A residual that may be mere round-off says nothing about the length of an increment.
        if residual <= self.context.model.newton.tolerance {
            return false;
        }
        if self.search.searches < most_searches
            && !self.course.is_augmented
            && self.may_search(iteration, residual)
        {
            if !has_kinks {
                self.search.bracket = Bracket::default(); // Smooth potentials need no more than a secant.
            }
            let border = &self.system.sum.system().border;
            let bracket = &mut self.search.bracket;
            let shorter = self.unknowns.secant_fraction(&self.course.out_of_balance, border, bracket);
            if let Some(shorter) = shorter {
                self.search.searches += 1;
                self.shorten(shorter);
                return true;
            }
        }
        let backtracks =
            self.search.backtracks < MOST_BACKTRACKS && may_shorten && self.cycles(iteration, residual);
        if backtracks {
            self.search.backtracks += 1;
            self.shorten(0.5);
        }
        backtracks
    }

    /// Returns to Δd = 0, where the iterations began, if a predicted iterate is no better.
    fn withdraws(&mut self, found: &Result<Measured, EvaluateError>) -> bool {
        let is_better = |found: &Measured| found.residual < self.course.residuals[0];
        let withdraws = self.is_predicted && !found.as_ref().is_ok_and(is_better);
        if withdraws {
            self.unknowns.start_again();
            self.is_predicted = false;
            self.search = Search::default();
        }
        withdraws
    }

    /// Shortens the last iterative increment: only the fraction `part` of what was applied is kept.
    fn shorten(&mut self, part: f64) {
        if std::mem::take(&mut self.course.is_augmented_along) {
            self.system.sum.withdraw_augmentation();
        }
        self.unknowns.shorten(part);
    }

    /// True if the equations have kinks and, in a late iteration, an increment has led to a larger residual.
    fn cycles(&self, iteration: usize, residual: f64) -> bool {
        let before = self.course.residuals.last().copied().unwrap_or(f64::INFINITY);
        self.system.sum.has_kinks()
            && iteration - self.course.solves_before >= FIRST_BACKTRACK
            && residual > before.max(self.context.model.newton.tolerance)
    }

    /// True if a line search may shorten the last increment, given the residual to which it has led. Across kinks, any
    /// increment may overshoot.
    fn may_search(&self, iteration: usize, residual: f64) -> bool {
        let newton = &self.context.model.newton;
        let (damped, has_kinks) = (self.is_damped(), self.system.sum.has_kinks());
        let first = if damped || has_kinks {
            1
        } else if self.progress.pace.is_careful() || self.effort == Effort::Thorough {
            FIRST_SEARCH
        } else {
            ((LATE * newton.max_iterations as f64) as usize).max(FIRST_SEARCH)
        };
        let before = self.course.residuals.last().copied().unwrap_or(f64::INFINITY);
        iteration - self.course.solves_before >= first
            && !self.unknowns.prescribes
            // Only the first increment changes the quantity that determines the load factor.
            && (self.system.sum.system().per_factor().is_none() || has_kinks && iteration > 1)
            && (damped || residual > if has_kinks { FAST * before } else { before })
            && residual > newton.tolerance
    }
}
