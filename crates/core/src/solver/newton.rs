//! Newton iterations to equilibrium within one load step: eqs. (26), (28), (30) and (40).

use crate::assembly::{System, Wanted};
use crate::basis::{Connectivity, Method};
use crate::equilibrium::{
    Energy, GridFields, StepReport, moment_error, named_reactions, reaction_moments, reactions_of,
};
use crate::linear::LinearError;
use crate::model::{Control, Model, Predictor, Tangent};
use crate::points::Points;
use crate::step::{Step, StepContext};
use crate::stress::Mechanics;
use crate::terms::{PointFailure, Sum};
use crate::timing::Phase;

use super::attempt::{Attempt, FailedAttempt, Iterate, OnTheWay, Slump};
use super::control::{Condition, NoPath, Path, on_free};
use super::course::Course;
use super::damping::{self, AT_REST, Damping, MORE_ITERATIONS, MOST_FACTORISATIONS, MOST_TRIALS, STRIDE};
use super::equations::{Place, Solved};
use super::error::{SolveError, locate_failure};
use super::forcing::Forcing;
use super::motion::Motion;
use super::observer::Observer;
use super::residual::{self, Measured, RoundOff, norm};
use super::step_system::StepSystem;
use super::stepper::Stepper;
use super::unknowns::Unknowns;
use super::update;

/// A step on which a point turns inside out is halved up to so many times.
const MOST_HALVINGS: usize = 5;
/// Most evaluations of a line search.
const MOST_SEARCHES: usize = 3;
/// No line search before so many iterations …
const FIRST_SEARCH: usize = 3;
/// … where an attempt has failed before, otherwise before this part of those that are allowed: iterations that go well are
/// left alone.
const LATE: f64 = 0.75;

impl<const D: usize> Stepper<D> {
    /// Newton iterations until the out-of-balance force of eq. (40) meets the tolerance. Writes the trial state only.
    ///
    /// Damped iterations that have moved the points by more than [`STRIDE`] end there, where a slump may begin or go on.
    pub(super) fn solve_step<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        step: Step,
        slump: Slump,
        observer: &mut dyn Observer<D>,
    ) -> Result<Attempt<D>, Box<FailedAttempt<D>>> {
        // What fails before the iterations has nothing to do with the size of the step.
        let at_once = |error: SolveError| {
            Box::new(FailedAttempt {
                step,
                error,
                may_succeed_if_smaller: false,
                residuals: Vec::new(),
                linear_iterations: 0,
                load_factor: None,
                indefinite: false,
                iterate: None,
            })
        };
        let timings = &mut self.reached.summary.timings;
        // The grid is undeformed: S_vp, ∇S_vp and the pattern of K are fixed for the step (section 5.1).
        let methods: Vec<Method> = model.bodies.iter().map(|b| b.method).collect();
        let old = std::mem::take(&mut self.links);
        let links = timings
            .measure(Phase::Basis, || old.renew(model.grid.as_ref(), points, &methods))
            .map_err(|failure| at_once(SolveError::unsupported(model, points, failure, step)))?;
        let path = &self.reached.summary.path;
        let context = StepContext { model, links: &links, step, factor: path.factor };
        let terms = &mut self.terms;
        let set_up = timings.measure(Phase::SetUp, || StepSystem::new::<M>(&context, points, path, terms));
        let mut system = set_up.map_err(at_once)?;
        let carried = &self.reached.summary.carried;
        let parts = system.parts.clone().of_bodies(points, &links, model.bodies.len(), carried);
        let mut unknowns = Unknowns::new(model, parts, path.factor, links.n_active());
        let damped = self.reached.summary.pace.is_damped();
        if model.newton.predictor == Predictor::LastStep && model.stepping.control == Control::Load && !damped
        {
            unknowns.predicted = path.motion.go_on(&links, step);
        }
        let mut course = Course::new();
        let stride =
            if damped && slump.may_go_on() { STRIDE * smallest_cell(model, &links) } else { f64::INFINITY };
        let solved =
            self.iterate::<M>(&context, points, &mut system, &mut unknowns, &mut course, stride, observer);
        let load_factor = match model.stepping.control {
            Control::Load => model.common_curve().map(|curve| curve.factor(step.end)),
            Control::Displacement { .. } | Control::ArcLength { .. } => Some(unknowns.factor),
        };
        let linear_iterations = course.solved.iter().map(|s| s.iterations).sum();
        let Ended { balanced, replaced_domains } = match solved {
            Ok(ended) => ended,
            Err(error) => {
                self.terms = system.sum.into_terms();
                return Err(Box::new(FailedAttempt {
                    step,
                    may_succeed_if_smaller: error.is_retryable(),
                    error,
                    residuals: course.residuals,
                    linear_iterations,
                    load_factor,
                    indefinite: course.solved.iter().any(|s| !s.factorisation.is_definite()),
                    iterate: Some(Iterate {
                        links,
                        delta_d: unknowns.delta_d,
                        out_of_balance: course.out_of_balance,
                    }),
                }));
            }
        };
        let StepSystem { dofs, sum, condition, .. } = system;
        let f_ext = sum.system().external_force();
        // Where bodies slump, the loads have grown before.
        let f_ext_start = if slump.has_begun() { f_ext.clone() } else { sum.external_force_at_start() };
        let reaction_field = reactions_of(f_ext, sum.system().internal_force(), &dofs);
        let reaction_start = reactions_of(&f_ext_start, &course.f_int_start, &dofs);
        let energy = Energy::new(
            &unknowns.delta_d,
            [(&f_ext_start, &reaction_start), (f_ext, &reaction_field)],
            &course.f_int_start,
            sum.ledger(&context, points, unknowns.at()),
        );
        let energy = if slump.has_begun() { energy.of_slump() } else { energy };
        if !balanced {
            self.terms = sum.into_terms();
            self.links = links;
            let at_end = damping::work(&course.out_of_balance, &unknowns.delta_d);
            let is_at_rest = damping::farthest(&unknowns.delta_d) <= stride;
            let energy = Energy { damping_work: energy.damping_work + at_end, ..energy };
            return Ok(Attempt::OnTheWay(OnTheWay { energy, replaced_domains, is_at_rest }));
        }
        let motion = || match model.newton.predictor {
            Predictor::None => Motion::default(),
            Predictor::LastStep => Motion::new(&links, step, &unknowns.delta_d),
        };
        let path = match condition {
            None => Path { motion: motion(), ..Path::default() },
            Some(condition) => condition.advance(&links, step, &unknowns.delta_d, unknowns.factor),
        };
        let forces = unknowns.forces(&course.out_of_balance, f_ext);
        let report = StepReport {
            step,
            body_residuals: residual::of_bodies(&forces, model, points, &links),
            carried: forces.carried(&unknowns.parts, &self.reached.summary.carried, model.bodies.len()),
            reactions: named_reactions(model, &reaction_field, &dofs),
            moments: reaction_moments(model, points, &links, &unknowns.delta_d, (&reaction_field, &dofs)),
            loads: sum.resultants(model.loads.len()),
            energy,
            moment_error: moment_error(model, &links, &unknowns.delta_d, (f_ext, &reaction_field)),
            load_factor,
            unknowns: dofs.n_free(),
            stabilised_faces: sum.stabilised_faces(),
            grid: GridFields {
                links,
                parts: unknowns.parts.count(),
                delta_d: unknowns.delta_d,
                reaction: reaction_field,
            },
            rounding_limited: course.round_off != RoundOff::NoMatter,
            damped,
            replaced_domains,
            residuals: course.residuals,
            factorisations: course.solved.iter().map(|s: &Solved| s.factorisation).collect(),
            linear_iterations,
        };
        self.terms = sum.into_terms();
        Ok(Attempt::Equilibrium(Box::new(report), path))
    }

    /// The iterations, and the motion of the points once they have reached equilibrium, or before it if damped ones move them
    /// farther than a stride.
    #[expect(clippy::too_many_arguments, reason = "what a step is made of")]
    fn iterate<M: Mechanics<D>>(
        &mut self,
        context: &StepContext<D>,
        points: &mut Points<D>,
        set_up: &mut StepSystem<D>,
        unknowns: &mut Unknowns<D>,
        course: &mut Course<D>,
        stride: f64,
        observer: &mut dyn Observer<D>,
    ) -> Result<Ended, SolveError> {
        let StepContext { model, links, step, .. } = *context;
        let damped = self.reached.summary.pace.is_damped();
        let tolerance = model.newton.tolerance;
        let max_iterations = model.newton.max_iterations * if damped { MORE_ITERATIONS } else { 1 };
        let mut damping: Option<Damping<D>> = None;
        let StepSystem { dofs, sum, condition, .. } = set_up;
        let place = Place { model, links, dofs };
        let timings = &mut self.reached.summary.timings;
        timings
            .measure(Phase::Analyse, || self.equations.prepare(place, sum.system()))
            .map_err(|e| SolveError::linear(e, place, step))?;
        let mut forcing = Forcing::default();
        let mut predicted = false;
        for iteration in 0..=max_iterations {
            // An old tangent makes no forecast.
            let is_last = model.newton.tangent == Tangent::Fresh
                && !damped
                && course.forecast(&forcing, self.reached.summary.last_iterations) <= tolerance
                && unknowns.follows(dofs)
                && condition.as_ref().is_none_or(|condition| condition.is_met());
            let balanced = is_last.then(|| self.evaluate_force(context, points, sum, unknowns, course));
            let mut evaluated = match balanced.flatten() {
                Some(residual) => Ok(Measured { residual, round_off: RoundOff::NoMatter }),
                None => self.evaluate(context, points, sum, unknowns, course, iteration),
            };
            if predicted && !evaluated.as_ref().is_ok_and(|found| found.residual < course.residuals[0]) {
                unknowns.start_again();
                evaluated = self.evaluate(context, points, sum, unknowns, course, iteration);
            }
            let Measured { residual, round_off } = evaluated
                .map_err(|f| locate_failure(f, model, points, step, iteration, &course.residuals))?;
            course.residuals.push(residual);
            course.round_off = round_off;
            observer.iteration(step, iteration, residual);
            if iteration == 0 {
                course.f_int_start = sum.system().internal_force().to_vec();
            }
            let is_met =
                unknowns.follows(dofs) && condition.as_ref().is_none_or(|condition| condition.is_met());
            let balanced = is_met && course.is_equilibrium(tolerance);
            if balanced || residual.is_finite() && damping::farthest(&unknowns.delta_d) > stride {
                if condition.as_ref().is_some_and(|condition| !condition.goes_on(&unknowns.delta_d)) {
                    return Err(SolveError::NoPath { step: step.index, reason: NoPath::Reversed });
                }
                let mut stands = balanced;
                if balanced
                    && damped
                    && let Err(error) = self.see_that_it_is_stable(unknowns, sum.system_mut(), place, course)
                {
                    if stride.is_infinite() {
                        return Err(SolveError::linear(error, place, step));
                    }
                    // A fresh grid may lead away from it.
                    stands = false;
                }
                let replaces = self.reached.summary.pace.is_last_resort();
                let timings = &mut self.reached.summary.timings;
                sum.conclude();
                let replaced_domains = timings.measure(Phase::Update, || {
                    update::move_points::<D, M>(model, points, links, &unknowns.delta_d, step, replaces)
                })?;
                return Ok(Ended { balanced: stands, replaced_domains });
            }
            if course.is_hopeless() || iteration == max_iterations || !residual.is_finite() {
                break;
            }
            predicted = unknowns.predicted.is_some();
            if let Some(damping) = &mut damping {
                damping.adapt(course.shortened);
            } else if damped {
                damping = Some(Damping::new(sum.system()));
            }
            let used = match &mut damping {
                Some(damping) => {
                    self.damped_step(unknowns, sum.system_mut(), place, course, (damping, stride))
                }
                None => self.newton_step(
                    unknowns,
                    sum.system_mut(),
                    place,
                    condition.as_mut(),
                    course,
                    &mut forcing,
                ),
            };
            let used = used.map_err(|e| match e {
                Obstacle::Linear(error) => SolveError::linear(error, place, step),
                Obstacle::Path(reason) => SolveError::NoPath { step: step.index, reason },
            })?;
            if let Some(used) = used {
                self.reached.summary.count(used);
                course.solved.push(used);
            }
        }
        let residuals = course.residuals.clone();
        if course.round_off == RoundOff::Forbids {
            return Err(SolveError::round_off(model, links, step, residuals, &course.out_of_balance));
        }
        Err(SolveError::not_converged(model, links, step, residuals, &course.out_of_balance))
    }

    /// The residual of eq. (40) where it meets the tolerance: the last evaluation of a step, of which no tangent is wanted.
    fn evaluate_force(
        &mut self,
        context: &StepContext<D>,
        points: &mut Points<D>,
        sum: &mut Sum<D>,
        unknowns: &Unknowns<D>,
        course: &mut Course<D>,
    ) -> Option<f64> {
        let summary = &mut self.reached.summary;
        summary.evaluations += 1;
        let evaluate = || sum.evaluate(context, points, unknowns.at(), Wanted::Force);
        summary.timings.measure(Phase::Assembly, evaluate).ok()?;
        let f_ext = sum.system().external_force();
        course.out_of_balance = unknowns.balance(f_ext, sum.system().internal_force());
        let forces = unknowns.forces(&course.out_of_balance, f_ext);
        forces.balanced(&unknowns.parts, context.model.newton.tolerance)
    }

    /// The residual of eq. (40). A point that turns inside out halves the last iterative displacement; one that climbs the
    /// potential on its far side is shortened by a line search.
    fn evaluate(
        &mut self,
        context: &StepContext<D>,
        points: &mut Points<D>,
        sum: &mut Sum<D>,
        unknowns: &mut Unknowns<D>,
        course: &mut Course<D>,
        iteration: usize,
    ) -> Result<Measured, PointFailure> {
        let StepContext { model, links, .. } = *context;
        let tolerance = model.newton.tolerance;
        let summary = &mut self.reached.summary;
        let damped = summary.pace.is_damped();
        let [most_halvings, most_searches] =
            if damped { [MOST_TRIALS; 2] } else { [MOST_HALVINGS, MOST_SEARCHES] };
        let (mut halvings, mut searches) = (0, 0);
        loop {
            course.shortened = halvings + searches > 0;
            summary.evaluations += 1;
            let evaluate = || sum.evaluate(context, points, unknowns.at(), Wanted::Stiffness);
            match summary.timings.measure(Phase::Assembly, evaluate) {
                Err(_) if iteration > 0 && !unknowns.prescribes && halvings < most_halvings => {
                    halvings += 1;
                    unknowns.shorten(0.5);
                    continue;
                }
                outcome => outcome?,
            }
            let system = sum.system();
            course.out_of_balance = unknowns.balance(system.external_force(), system.internal_force());
            let at = residual::Iterate { model, points, links, system, delta_d: &unknowns.delta_d };
            let forces = unknowns.forces(&course.out_of_balance, system.external_force());
            let measured = forces.measure(&unknowns.parts, tolerance, &at);
            let residual = measured.residual;
            let before = course.residuals.last().copied().unwrap_or(f64::INFINITY);
            let first = if damped {
                1
            } else if summary.pace.is_careful() {
                FIRST_SEARCH
            } else {
                ((LATE * model.newton.max_iterations as f64) as usize).max(FIRST_SEARCH)
            };
            let may_search = iteration >= first
                && !unknowns.prescribes
                && searches < most_searches
                && system.per_factor().is_none();
            if may_search && (damped || residual > before) && residual > tolerance {
                let slope = unknowns.slope(&course.out_of_balance);
                if let Some(shorter) = unknowns.flatter(slope) {
                    searches += 1;
                    unknowns.shorten(shorter);
                    continue;
                }
            }
            return Ok(measured);
        }
    }

    /// Eq. (26): K δd = f_ext − f_int on the free degrees of freedom, with the whole prescribed increment in the
    /// first iteration; eq. (30) for the sum, and the linearised change of the reactions.
    ///
    /// Where δd is not exact, what it leaves of the equations of the free degrees of freedom stays in their
    /// out-of-balance force: only prescribed ones have a reaction, and that is the one which K and this δd give.
    fn newton_step(
        &mut self,
        unknowns: &mut Unknowns<D>,
        system: &mut System<D>,
        place: Place<D>,
        condition: Option<&mut Condition<D>>,
        course: &Course<D>,
        forcing: &mut Forcing,
    ) -> Result<Option<Solved>, Obstacle> {
        let Place { dofs, .. } = place;
        let out_of_balance = &course.out_of_balance;
        let residual = course.residuals.last().copied().unwrap_or(1.0);
        let timings = &mut self.reached.summary.timings;
        let tolerance = timings.measure(Phase::Solve, || {
            unknowns.right_hand_side(system, dofs, out_of_balance);
            let rhs = norm(unknowns.rhs.iter().flatten().copied());
            forcing.next(rhs, residual, place.model.newton.tolerance)
        });
        if let Some(predicted) = unknowns.predicted.take() {
            dofs.for_each(|node, axis, free| {
                if free.is_some() {
                    unknowns.iterative[node][axis] = predicted[node][axis];
                }
            });
            timings.measure(Phase::Solve, || unknowns.advance(system, dofs, out_of_balance))?;
            return Ok(None);
        }
        // A preconditioner may be that of an earlier iteration, without harm to the solution.
        let keeps = (place.model.newton.tangent == Tangent::Kept || self.equations.is_iterative())
            && course.falls_fast()
            && !(unknowns.prescribes || course.solved.is_empty());
        let Unknowns { rhs, iterative, .. } = &mut *unknowns;
        let equations = &mut self.equations;
        let kept = keeps.then(|| equations.solve_again(place, system, rhs, iterative, tolerance, timings));
        // Where what was kept does not do, everything is set up afresh.
        let mut solved = match kept {
            Some(Ok(solved)) => solved,
            _ => equations.solve(place, system, rhs, iterative, tolerance, timings)?,
        };
        unknowns.iterative_factor = 0.0;
        if let (Some(unit), Some(condition)) = (system.per_factor().cloned(), condition) {
            let mut of_load = vec![[0.0; D]; unit.len()];
            let mut rhs = of_load.clone();
            on_free(dofs, &unit, &mut rhs);
            solved.iterations +=
                self.equations.solve_again(place, system, &rhs, &mut of_load, tolerance, timings)?.iterations;
            let change =
                condition.change(&unknowns.delta_d, &unknowns.iterative, &of_load).map_err(Obstacle::Path)?;
            for (delta, of_load) in unknowns.iterative.iter_mut().flatten().zip(of_load.iter().flatten()) {
                *delta += change * of_load;
            }
            unknowns.iterative_factor = change;
        }
        timings.measure(Phase::Solve, || unknowns.advance(system, dofs, out_of_balance))?;
        Ok(Some(solved))
    }

    /// Sees to it that the stiffness of an equilibrium that damped iterations have found resists every motion: without
    /// damping, it is not to be left.
    fn see_that_it_is_stable(
        &mut self,
        unknowns: &mut Unknowns<D>,
        system: &mut System<D>,
        place: Place<D>,
        course: &Course<D>,
    ) -> Result<(), LinearError> {
        unknowns.right_hand_side(system, place.dofs, &course.out_of_balance);
        let Unknowns { rhs, iterative, .. } = unknowns;
        let timings = &mut self.reached.summary.timings;
        let tolerance = place.model.newton.tolerance;
        let solved = self.equations.solve(place, system, rhs, iterative, tolerance, timings)?;
        let farthest = damping::farthest(iterative);
        if solved.factorisation.is_definite() && farthest <= AT_REST * smallest_cell(place.model, place.links)
        {
            return Ok(());
        }
        Err(LinearError::Singular { unknown: None })
    }

    /// As [`Stepper::newton_step`], with a stiffness that is damped until it is positive definite.
    fn damped_step(
        &mut self,
        unknowns: &mut Unknowns<D>,
        system: &mut System<D>,
        place: Place<D>,
        course: &Course<D>,
        (damping, stride): (&mut Damping<D>, f64),
    ) -> Result<Option<Solved>, Obstacle> {
        unknowns.right_hand_side(system, place.dofs, &course.out_of_balance);
        damping.add_to(system);
        let timings = &mut self.reached.summary.timings;
        let tolerance = place.model.newton.tolerance;
        let mut tries = 0;
        let solved = loop {
            tries += 1;
            let Unknowns { rhs, iterative, .. } = &mut *unknowns;
            let solved = self.equations.solve(place, system, rhs, iterative, tolerance, timings);
            match solved {
                Ok(solved) if solved.factorisation.is_definite() => break solved,
                outcome if tries == MOST_FACTORISATIONS => break outcome?,
                _ => damping.increase(system),
            }
        };
        let far = damping::farthest(&unknowns.iterative);
        if far > stride {
            unknowns.iterative.iter_mut().flatten().for_each(|u| *u *= stride / far);
        }
        let advance = || unknowns.advance(system, place.dofs, &course.out_of_balance);
        timings.measure(Phase::Solve, advance)?;
        Ok(Some(solved))
    }
}

/// How iterations have ended.
struct Ended {
    /// Whether in equilibrium, which is stable if damped iterations have found it.
    balanced: bool,
    /// Permanent numbers of the points whose torn domains were replaced.
    replaced_domains: Vec<u32>,
}

/// Size of the smallest active cell, [length].
fn smallest_cell<const D: usize>(model: &Model<D>, links: &Connectivity<D>) -> f64 {
    let sizes = links.active_cells().iter().map(|&cell| model.grid.size(cell as usize));
    sizes.fold(f64::INFINITY, f64::min)
}

/// What keeps an iteration from its displacement.
enum Obstacle {
    Linear(LinearError),
    Path(NoPath),
}

impl From<LinearError> for Obstacle {
    fn from(error: LinearError) -> Self {
        Obstacle::Linear(error)
    }
}
