//! Newton iterations to equilibrium within one load step: eqs. (19)-(23), (26)-(28), (30) and (40).

use crate::assembly::Wanted;
use crate::points::Points;
use crate::step::{StepContext, displacement};
use crate::terms::{Augmentation, EvaluateError};
use crate::timing::Phase;

use super::attempt::{Attempt, Ended};
use super::conclusion::LastIterate;
use super::course::Course;
use super::damping::{self, Damping};
use super::equations::Equations;
use super::error::SolveError;
use super::line_search::{Decision, Search, Situation};
use super::located::locate_failure;
use super::observer::Observer;
use super::residual::round_off::EvaluatedAt;
use super::residual::{Measured, RoundOff};
use super::step_system::StepSystem;
use super::stepping::control::{Condition, NoPath};
use super::summary::Summary;
use super::unknowns::Unknowns;

/// Number of iterations without an update of multipliers after which terms may simplify their conditions.
const HOLDS_AFTER: usize = 25;
/// Ratio of the largest number of iterations to the number that may be added to it while the residual falls fast.
const FURTHER: usize = 4;

/// The iterations of an attempt at a load step.
pub(super) struct LoadStep<'s, 'a, const D: usize, const N: usize> {
    /// The step, and how its iterations are conducted.
    pub(super) attempt: Attempt<'a, D>,
    /// The points, in whose trial state the iterations write.
    pub(super) points: &'s mut Points<D>,
    pub(super) system: StepSystem<D, N>,
    pub(super) unknowns: Unknowns<N>,
    pub(super) course: Course<N>,
    /// What has been tried at the current iterate.
    pub(super) search: Search,
    /// The damping, once a damped iteration has been made.
    pub(super) damping: Option<Damping<N>>,
    pub(super) equations: &'s mut Equations<D, N>,
    /// Where evaluations, solutions and their times are counted.
    pub(super) summary: &'s mut Summary,
    pub(super) observer: &'s mut dyn Observer<D>,
}

impl<'a, const D: usize, const N: usize> LoadStep<'_, 'a, D, N> {
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
            let Some(residual) = self.accept_or_shorten(iteration, wanted, measured)? else { continue };
            let is_balanced = self.is_balanced(); // (40)
            if is_balanced && self.augment(iteration)? == Augmentation::Updated {
                continue;
            }
            if is_balanced || self.exceeds_stride(residual) {
                return self.conclude(is_balanced);
            }
            let since_update = iteration - self.course.solves_before;
            let is_last = self.is_last(since_update);
            let may_hold = is_last || since_update == HOLDS_AFTER && !self.course.falls_fast();
            if may_hold && self.attempt.pace.is_small() && self.hold(iteration) {
                continue;
            }
            if is_last || !residual.is_finite() || self.course.is_hopeless() {
                return Err(self.without_equilibrium());
            }
            self.increment()?; // (26), (30)
            iteration += 1;
        }
    }

    /// True after the last iteration that is allowed; while the residual falls fast, a few more are.
    fn is_last(&self, since_update: usize) -> bool {
        let most = self.attempt.most_iterations();
        since_update >= most && !(self.course.falls_fast() && since_update < most + most / FURTHER)
    }

    /// The iterate at which the iterations have ended.
    pub(super) fn into_last_iterate(self) -> LastIterate<'a, D, N> {
        let LoadStep { attempt, system, unknowns, course, .. } = self;
        LastIterate { attempt, system, unknowns, course }
    }

    /// Prepares the equations for the layout of the system.
    pub(super) fn prepare_equations(&mut self) -> Result<(), SolveError> {
        let LoadStep { attempt: Attempt { context, .. }, system, equations, summary, .. } = self;
        let equation_context = context.equations(&system.dofs);
        let prepared = summary
            .timings
            .measure(Phase::Analyse, || equations.prepare(equation_context, system.sum.system()));
        prepared.map_err(|error| SolveError::linear(error, context, system))
    }

    /// What the next evaluation computes: only the forces if quadratic convergence predicts that the iterate meets the
    /// tolerance, otherwise the stiffness as well. With kept tangents, no prediction is possible.
    fn wanted(&self) -> Wanted {
        let LoadStep { attempt, course, .. } = self;
        let is_last = !self.search.needs_stiffness
            && !attempt.may_keep_stiffness()
            && !attempt.is_damped()
            && course.forecast(attempt.last_iterations) <= attempt.tolerance()
            && self.has_reached_constraints();
        if is_last { Wanted::Force } else { Wanted::Stiffness }
    }

    /// Evaluates all terms at Δd (trial stresses and strains, f_int, f_ext and, if wanted, K), moves the forces on tied
    /// components to the components to which these are tied, and forms the out-of-balance force of eq. (28).
    ///
    /// # Errors
    /// [`EvaluateError`] if a point cannot follow Δd, or a law fails.
    fn evaluate(&mut self, wanted: Wanted) -> Result<(), EvaluateError> {
        let LoadStep { attempt: Attempt { context, .. }, points, system, unknowns, course, .. } = self;
        let LoadStep { search, equations, summary, .. } = self;
        if wanted == Wanted::Stiffness {
            course.shortened = search.has_shortened(); // adapts the damping
        }
        loop {
            summary.evaluations += 1;
            let evaluate = || system.sum.evaluate(context, points, unknowns.at(), wanted);
            summary.timings.measure(Phase::Assembly, evaluate)?;
            if wanted == Wanted::Force || !system.sum.outgrows(context, &system.dofs) {
                break;
            }
            equations.outgrow();
        }
        system.complete();
        course.out_of_balance = unknowns.balance(system.sum.system()); // (28)
        Ok(())
    }

    /// The residual of eq. (40), the largest over the connected parts and the global equations. `None` if only forces
    /// were evaluated and they do not meet the tolerance.
    fn residual(&self, wanted: Wanted) -> Option<Measured> {
        let StepContext { model, links, .. } = self.attempt.context;
        let (system, unknowns, parts) = (self.system.sum.system(), &self.unknowns, &self.system.parts);
        let tolerance = model.newton.tolerance;
        let forces = unknowns.forces(&self.course.out_of_balance, system);
        if wanted == Wanted::Force {
            let for_globals = system.border.relative_residual();
            let in_parts = forces.balanced(parts, tolerance, system, &unknowns.delta_d)?;
            let measured = in_parts.and(Measured::beyond_round_off(for_globals), tolerance);
            return (for_globals <= tolerance).then_some(measured);
        }
        let at = EvaluatedAt { model, points: self.points, links, system, delta_d: &unknowns.delta_d };
        let measured = forces.measure(parts, tolerance, &at); // (40)
        let for_globals = system.border.relative_residuals();
        Some(for_globals.fold(measured, |measured, (residual, is_round_off)| {
            measured.and(Measured::global(residual, is_round_off, tolerance), tolerance)
        }))
    }

    /// Records the residual of the iterate; `None` if the iterate must be evaluated again, with its stiffness or closer
    /// to the previous iterate.
    ///
    /// # Errors
    /// [`SolveError`] if the iterate cannot be evaluated.
    fn accept_or_shorten(
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
        let residual = found.as_ref().ok().map(|found| found.residual);
        match if is_final { Decision::Accept } else { self.decide(iteration, residual) } {
            Decision::Accept => {}
            Decision::Shorten(part) => {
                self.shorten(part);
                return Ok(None);
            }
            Decision::Withdraw => {
                self.unknowns.start_again();
                self.search = Search::withdrawn();
                return Ok(None);
            }
        }
        self.search = Search::default();
        let StepContext { model, step, .. } = self.attempt.context;
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

    /// The decision of the line search on the iterate; `residual` is `None` if a point could not follow δd.
    fn decide(&mut self, iteration: usize, residual: Option<f64>) -> Decision {
        let LoadStep { attempt, system: StepSystem { sum, .. }, unknowns, course, search, .. } = self;
        let situation = Situation {
            is_damped: attempt.is_damped(),
            begins_early: attempt.searches_early(),
            searches_often: attempt.searches_often(),
            has_kinks: sum.has_kinks(attempt.context.model),
            is_viscous: attempt.context.viscosity > 0.0,
            has_unknown_factor: sum.system().per_factor().is_some(),
            prescribes: unknowns.prescribes,
            is_augmented: course.is_augmented,
            iteration,
            since_update: iteration - course.solves_before,
            residuals: &course.residuals,
            tolerance: attempt.tolerance(),
            max_iterations: attempt.context.model.newton.max_iterations,
        };
        let border = &sum.system().border;
        search.decide(&situation, residual, |bracket| {
            unknowns.secant_fraction(&course.out_of_balance, border, bracket)
        })
    }

    /// Shortens the last iterative increment: only the fraction `part` of what was applied is kept.
    fn shorten(&mut self, part: f64) {
        if std::mem::take(&mut self.course.is_augmented_along) {
            self.system.sum.withdraw_augmentation();
        }
        self.unknowns.shorten(part);
    }

    /// Lets the terms update their multipliers in equilibrium; the iterations then continue, and the count of allowed
    /// linear solves starts again.
    fn augment(&mut self, iteration: usize) -> Result<Augmentation, SolveError> {
        let LoadStep { attempt: Attempt { context, .. }, points, system, unknowns, course, .. } = self;
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

    /// Lets the terms replace conditions that keep the iterations from converging; these then continue as after an
    /// update of multipliers. False if no term does.
    fn hold(&mut self, iteration: usize) -> bool {
        let holds = self.system.sum.hold(&self.attempt.context);
        if holds {
            self.course.augmented(iteration);
        }
        holds
    }

    /// True if the iterate is in equilibrium: it has the prescribed motion, the load factor meets its condition, and
    /// the residual meets the tolerance or comes as close to it as round-off permits. False in iteration 0, so that
    /// every step makes at least one iteration.
    fn is_balanced(&self) -> bool {
        self.has_reached_constraints() && self.course.is_equilibrium(self.attempt.tolerance())
    }

    fn has_reached_constraints(&self) -> bool {
        let shortened = self.course.shortened;
        self.attempt.reduction().all(self.system.dofs.is_reached(&self.unknowns.delta_d))
            && self.system.condition.as_ref().is_none_or(|condition| condition.is_met() && !shortened)
    }

    /// True if a node has moved farther than a stride, which is infinite unless damped iterations may continue on a
    /// fresh grid.
    fn exceeds_stride(&self, residual: f64) -> bool {
        residual.is_finite() && self.farthest() > self.attempt.stride
    }

    /// Largest component of a nodal displacement of the step, [length].
    fn farthest(&self) -> f64 {
        self.attempt.reduction().largest(damping::farthest(&displacement::<D, N>(&self.unknowns.delta_d)))
    }

    /// Ends the iterations: checks the path and the stability, and frees the matrices.
    fn conclude(&mut self, is_balanced: bool) -> Result<Ended, SolveError> {
        let step = self.attempt.context.step;
        let reverses = |condition: &Condition<D, N>| !condition.goes_on(&self.unknowns.delta_d);
        if self.system.condition.as_ref().is_some_and(reverses) {
            return Err(SolveError::NoPath { step: step.index, reason: NoPath::Reversed });
        }
        let mut is_final = is_balanced;
        if is_balanced && self.attempt.is_damped() {
            if !self.equations.is_prepared() {
                self.prepare_equations()?;
            }
            if let Err(error) = self.check_stability() {
                if self.attempt.stride.is_infinite() {
                    return Err(SolveError::linear(error, &self.attempt.context, &self.system));
                }
                // An unstable equilibrium: a fresh grid may lead away from it.
                is_final = false;
            }
        }
        self.system.sum.free_matrices();
        if is_final {
            return Ok(Ended::Balanced);
        }
        Ok(Ended::Strayed { is_at_rest: self.farthest() <= self.attempt.stride })
    }

    fn without_equilibrium(&self) -> SolveError {
        let context @ StepContext { model, links, step, .. } = self.attempt.context;
        if let Some(error) = self.course.singular.clone() {
            return SolveError::linear(error, &context, &self.system);
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
