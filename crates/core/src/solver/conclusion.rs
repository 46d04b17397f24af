//! The conclusion of an attempt at a load step: its report if it reached equilibrium, otherwise its progress; and the
//! commit of a converged step.

use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::equilibrium::{
    AppliedForces, Energy, GridFields, NodalField, ReactionMoment, StepReport, moment_error, named_reactions,
    reaction_moments, reactions_of,
};
use crate::model::{Control, Predictor};
use crate::points::Points;
use crate::quality::{Code, Location, Measures, Warning};
use crate::ranks::Reduction;
use crate::step::{Nodal, Step, StepContext, displacement};
use crate::terms::{Driven, Ledger, NamedEnergy, TermReport, Terms, save};
use crate::timing::{Phase, Timings};

use super::attempt::{Attempt, Ended, FailedAttempt, InProgress, Iterate, Outcome};
use super::collective::agree;
use super::course::Course;
use super::damping;
use super::error::SolveError;
use super::located::with_energy;
use super::observer::Observer;
use super::progress::Reached;
use super::residual::{RoundOff, body_residual};
use super::step_system::StepSystem;
use super::stepper::Stepper;
use super::stepping::control::{Motion, Path};
use super::stepping::limit::Loading;
use super::stepping::pace::SHORT;
use super::stepping::splitting;
use super::stepping::strength::Movement;
use super::summary::Summary;
use super::unknowns::Unknowns;

/// Excess up to which the next step may be twice as long: the error grows at least with the square of the duration.
const MAY_DOUBLE: f64 = 0.2;

/// The iterate at which an attempt has ended, in equilibrium or not.
pub(super) struct LastIterate<'a, const D: usize, const N: usize> {
    pub(super) attempt: Attempt<'a, D>,
    pub(super) system: StepSystem<D, N>,
    pub(super) unknowns: Unknowns<N>,
    pub(super) course: Course<N>,
}

impl<const D: usize, const N: usize> LastIterate<'_, D, N> {
    /// The outcome of an attempt whose iterations have ended in this way, and in which these domains were replaced,
    /// without the links, which the caller holds.
    ///
    /// # Errors
    /// [`SolveError::Law`] if a law has no finite energy.
    pub(super) fn outcome(
        &mut self,
        points: &Points<D>,
        reached: &Reached,
        ended: Ended,
        replaced_domains: Vec<u32>,
    ) -> Result<Outcome<D>, SolveError> {
        Ok(match ended {
            Ended::Balanced => {
                let (report, path) = self.report(points, reached)?;
                Outcome::Equilibrium(Box::new(StepReport { replaced_domains, ..report }), path)
            }
            Ended::Strayed { is_at_rest } => {
                let energy = self.energy_on_the_way(points)?;
                Outcome::InProgress(InProgress { energy, replaced_domains, is_at_rest })
            }
        })
    }

    /// The report of a converged step, without the links, and the path after the step.
    ///
    /// # Errors
    /// [`SolveError::Law`] if a law has no finite energy.
    fn report(&mut self, points: &Points<D>, reached: &Reached) -> Result<(StepReport<D>, Path), SolveError> {
        let StepContext { model, links, step, .. } = self.attempt.context;
        let load_factor = self.load_factor();
        let (energy, reaction) = self.energy(points)?;
        let undone = reached.summary.undone_work + energy.undone_work;
        let energy = Energy { plastic_work: energy.plastic_work - undone, ..energy };
        let nature = self.system.nature(model);
        let LastIterate { attempt, system, unknowns, course } = self;
        let StepSystem { dofs, sum, condition, parts, fields } = system;
        let f_ext = sum.system().external_force();
        let delta_d = displacement(&unknowns.delta_d).into_owned();
        let path = match (condition, model.newton.predictor) {
            (Some(condition), _) => condition.advance(links, step, &unknowns.delta_d, unknowns.factor),
            (None, Predictor::LastStep) => {
                Path { motion: Motion::new(links, step, &unknowns.delta_d), ..Path::default() }
            }
            (None, Predictor::None) => Path::default(),
        };
        let forces = unknowns.forces(&course.out_of_balance, sum.system());
        let excess = sum.excess(&attempt.context, points, unknowns.at());
        let reduction = links.reduction();
        let (mut reactions, further_reactions) = named_reactions(model, reduction, &reaction, dofs);
        let mut moments = reaction_moments(model, points, links, dofs, &delta_d, &reaction);
        let TermReport {
            mut loads,
            forces: mut named,
            reactions: surface_reactions,
            stabilised_faces,
            driven: mut driven_by_terms,
            records,
        } = sum.report(model);
        driven_by_terms.add(driven_at_nodes(dofs, reduction, &delta_d, displacement(&reaction).as_ref()));
        reduction.sum(loads.as_flattened_mut());
        named.iter_mut().for_each(|named| reduction.sum(&mut named.force));
        for surface in surface_reactions {
            reactions[surface.condition] = surface.force;
            if let Some(moments) = &mut moments {
                moments[surface.condition] =
                    ReactionMoment { about: Some(surface.about), moment: surface.moment };
            }
        }
        let report = StepReport {
            step,
            body_residuals: body_residual::body_residuals(&forces, model, points, links),
            carried: forces.carried(parts, &reached.progress.carried, model.bodies.len()),
            reactions,
            further_reactions,
            moments,
            driven: driven_by_terms,
            records,
            loads,
            forces: named,
            energy,
            // The moment of inertia forces is no error.
            moment_error: match attempt.context.dynamics() {
                None => {
                    let applied = AppliedForces { load: f_ext, reaction: &reaction };
                    moment_error(model, links, &delta_d, applied)
                }
                Some(_) => None,
            },
            load_factor,
            excess,
            strength_factor: model.stepping.strength_factor(step.end),
            unknowns: reduction.count_all(dofs.n_free_at(|node| reduction.counts(node))),
            stabilised_faces: reduction.count_all(stabilised_faces),
            grid: GridFields {
                links: Connectivity::default(),
                parts: parts.count(),
                delta_d,
                further: (fields.further())
                    .map(|(field, components)| {
                        NodalField::new(field, components, &unknowns.delta_d, &reaction)
                    })
                    .collect(),
                reaction: displacement(&reaction).into_owned(),
            },
            rounding_limited: course.round_off != RoundOff::NoMatter,
            damped: attempt.is_damped(),
            viscosity: attempt.context.viscosity,
            replaced_domains: Vec::new(),
            most_solves: (course.most_solves)
                .max(course.residuals.len().saturating_sub(1 + course.augmentations + course.solves_before)),
            residuals: std::mem::take(&mut course.residuals),
            field_residuals: std::mem::take(&mut course.by_field),
            is_unstable: (course.solved.last())
                .is_some_and(|last| last.factorisation.shows_instability(nature)),
            factorisations: course.solved.iter().map(|s| s.factorisation).collect(),
            linear_iterations: course.linear_iterations(),
            augmentations: course.augmentations,
        };
        Ok((report, path))
    }

    /// The energy when damped iterations stop because they need a fresh grid.
    ///
    /// # Errors
    /// [`SolveError::Law`] if a law has no finite energy.
    fn energy_on_the_way(&self, points: &Points<D>) -> Result<Energy, SolveError> {
        let (energy, _) = self.energy(points)?;
        let reduction = self.attempt.context.links.reduction();
        let at_end = damping::work(reduction, &self.course.out_of_balance, &self.unknowns.delta_d);
        Ok(Energy { damping_work: energy.damping_work + at_end, ..energy })
    }

    /// The failed attempt with the grid fields at which its iterations ended, but without the links, which the caller
    /// holds.
    pub(super) fn failed(&mut self, error: SolveError) -> Box<FailedAttempt<D>> {
        let StepContext { model, step, .. } = self.attempt.context;
        let nature = self.system.nature(model);
        let course = &mut self.course;
        Box::new(FailedAttempt {
            step,
            may_succeed_if_smaller: error.is_retryable(),
            is_repeated: false,
            error,
            residuals: std::mem::take(&mut course.residuals),
            augmentations: course.augmentations,
            linear_iterations: course.linear_iterations(),
            load_factor: self.load_factor(),
            indefinite: (self.course.solved.iter())
                .any(|solved| solved.factorisation.shows_instability(nature)),
            iterate: Some(Iterate {
                links: Connectivity::default(),
                delta_d: displacement(&self.unknowns.delta_d).into_owned(),
                out_of_balance: displacement(&self.course.out_of_balance).into_owned(),
            }),
        })
    }

    /// The terms, for the next step.
    pub(super) fn into_terms(self) -> Terms<D, N> {
        self.system.sum.into_terms()
    }

    /// Load factor at the end of the step, [-]; `None` unless all loads and prescribed motions share one factor.
    fn load_factor(&self) -> Option<f64> {
        let StepContext { model, step, .. } = self.attempt.context;
        if !model.stages.is_empty() {
            return None;
        }
        match model.stepping.control {
            Control::Load | Control::StrengthReduction { .. } => {
                model.common_curve().map(|curve| curve.factor(step.end))
            }
            Control::Displacement { .. } | Control::ArcLength { .. } => Some(self.unknowns.factor),
        }
    }

    /// Work and energy, and the reactions on the active nodes, [force].
    ///
    /// # Errors
    /// [`SolveError::Law`] if a law has no finite energy.
    fn energy(&self, points: &Points<D>) -> Result<(Energy, Nodal<N>), SolveError> {
        let LastIterate { attempt, system: StepSystem { dofs, sum, .. }, unknowns, course } = self;
        let Attempt { ref context, slump, .. } = *attempt;
        let f_ext = sum.system().external_force();
        // While bodies slump, the loads have already grown to their values at the end of the step.
        let f_ext_start = if slump.has_begun() { f_ext.clone() } else { sum.external_force_at_start(dofs) };
        let reaction = reactions_of(f_ext, sum.system().internal_force(), dofs);
        let reaction_start = reactions_of(&f_ext_start, &course.f_int_start, dofs);
        let reduction = context.links.reduction();
        let ledger = sum.ledger(context, points, unknowns.at());
        let law_energy = ledger.energy(Ledger::ELASTIC) + ledger.energy(Ledger::PLASTIC);
        agree(reduction, with_energy(law_energy, context.model, points, &points.trial, context.step))?;
        let at_end = AppliedForces { load: f_ext, reaction: &reaction };
        let delta_d = displacement::<D, N>(&unknowns.delta_d);
        let energy = match context.dynamics() {
            None => {
                let at_start = AppliedForces { load: &f_ext_start, reaction: &reaction_start };
                Energy::new(reduction, &delta_d, at_start, at_end, &course.f_int_start, &ledger)
            }
            // The equations of motion hold in the mean over the step, so its forces act over the whole step.
            Some(_) => Energy::in_mean(reduction, &delta_d, at_end, &ledger),
        };
        Ok((if slump.has_begun() { energy.in_slump() } else { energy }, reaction))
    }
}

/// What the conditions at nodes that prescribe a motion do in a step with these displacements and reactions, on all
/// ranks.
fn driven_at_nodes<const D: usize, const N: usize>(
    dofs: &DofMap<N>,
    reduction: &Reduction,
    delta_d: &[[f64; D]],
    reaction: &[[f64; D]],
) -> Driven {
    let mut driven = Driven::default();
    for node in (0..dofs.n_nodes()).filter(|node| reduction.counts(*node)) {
        let moved =
            |component| dofs.prescribed(node, component).map_or(0.0, |(increment, _)| increment.abs());
        let displacement = (0..D).map(moved).fold(0.0, f64::max);
        if displacement > 0.0 {
            let work = (0..D).map(|d| reaction[node][d] * delta_d[node][d]).sum();
            driven.add(Driven { work, displacement });
        }
    }
    Driven { work: reduction.total(driven.work), displacement: reduction.largest(driven.displacement) }
}

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// Makes the trial state of a converged step the converged state.
    pub(super) fn accept(
        &mut self,
        report: StepReport<D>,
        path: Path,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        self.judge(&report);
        self.commit(&report);
        self.push_out_of_tools(&report);
        self.split_long_domains(report.step.end);
        let (model, points) = (self.model, &*self.points);
        self.cause = None;
        self.lost_points = None;
        let Reached { progress, summary } = &mut self.reached;
        progress.terms = save(&self.terms);
        progress.step = report.step;
        progress.path = path;
        progress.pace.limit_viscosity(report.viscous_share());
        let may_grow = report.excess < MAY_DOUBLE;
        progress.pace.succeeded_with(&model.stepping, report.most_solves, may_grow);
        progress.carried.clone_from(&report.carried);
        progress.last_iterations = report.solves();
        summary.accept(&report);
        if model.stepping.until_limit {
            let factor = progress.path.factor;
            let search = progress.limit_of(model.present.stage);
            search.follow(Loading::measured(model, &report, factor), Loading::round_off(model, points));
        }
        if model.stepping.until_rest {
            let kinetic = |energy: &&NamedEnergy| energy.name == Ledger::KINETIC;
            let kinetic =
                report.energy.further.iter().find(kinetic).map_or(0.0, |energy| energy.amount.value());
            progress.rest_of(model.present.stage).follow(kinetic);
        }
        let balance = summary.balance();
        let raised = summary.quality.judge_balances(model, points, &balance, report.step.index);
        summary.warnings.extend(raised);
        if let Some(size) = progress.pace.crawling() {
            let cause = summary.cut.as_deref();
            summary.warnings.extend(summary.quality.crawls(report.step.index, [size, SHORT], cause));
        }
        let mut timings = Timings::default();
        let reached = &self.reached;
        let observed = timings.measure(Phase::Output, || observer.converged(model, points, &report, reached));
        self.reached.summary.timings.add(&timings);
        self.report = Some(report);
        agree(&points.reduction(), observed.map_err(SolveError::Output))
    }

    /// Commits the terms, then the points.
    fn commit(&mut self, report: &StepReport<D>) {
        let Stepper { model, points, reached, terms, .. } = self;
        let links = &report.grid.links;
        let factor = reached.progress.path.factor;
        let context = StepContext {
            model,
            links,
            step: report.step,
            factor,
            viscosity: report.viscosity,
            experiment: None,
        };
        terms.iter_mut().for_each(|term| term.commit(&context, points));
        points.commit();
    }

    /// Moves the corners of replaced domains out of obstacles.
    fn push_out_of_tools(&mut self, report: &StepReport<D>) {
        let Stepper { model, points, terms, .. } = self;
        splitting::push_out_of_tools(model, points, terms, report.step.end, &report.replaced_domains);
    }

    /// Splits the points whose domains have become too long in the step that has ended at this time. The next step then
    /// begins as it would in a run resumed from this state.
    fn split_long_domains(&mut self, time: f64) {
        let Stepper { model, points, reached, terms, .. } = self;
        splitting::split_long(model, points, terms, time, &mut reached.progress.splits);
    }

    /// True if bodies begin to slide in a step that is in equilibrium but not committed, and a smaller step can narrow
    /// down the strength factor at which they begin to slide; the smaller step is then attempted next.
    pub(super) fn hides_a_slide(&mut self, step: Step) -> bool {
        let (model, points) = (self.model, &*self.points);
        if model.stepping.strength_factor(step.end).is_none() {
            return false;
        }
        let movement = Movement::measured(model, points, step);
        let progress = &mut self.reached.progress;
        progress.strength_of(model.present.stage).begins_to_slide(movement)
            && progress.pace.halve(&model.stepping, step.start, step.end)
    }

    /// True if a step in equilibrium is too long for a term and a smaller one can take its place.
    pub(super) fn is_too_long(&mut self, step: Step, excess: f64) -> bool {
        excess > 1.0 && self.reached.progress.pace.halve(&self.model.stepping, step.start, step.end)
    }

    /// Reports that a smaller step replaces a converged step in which bodies begin to slide, or which is too long.
    pub(super) fn bisect(
        &mut self,
        report: StepReport<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        self.links = report.grid.links;
        let step = report.step;
        let (model, points) = (self.model, &*self.points);
        let timings = &mut self.reached.summary.timings;
        let observed = timings.measure(Phase::Output, || observer.bisected(model, points, step));
        agree(&points.reduction(), observed.map_err(SolveError::Output))
    }

    /// Measures a converged step before it is committed.
    fn judge(&mut self, report: &StepReport<D>) {
        let (model, points) = (self.model, &*self.points);
        let Summary { timings, quality, warnings, .. } = &mut self.reached.summary;
        let raised = timings.measure(Phase::Update, || {
            let moved = model.grid_at(report.step.end).ok().flatten();
            let next_grid = moved.as_ref().map_or(model.grid.as_ref(), |grid| grid as _);
            let measures = Measures::new(model, points, &report.grid.links, next_grid);
            let mut raised = quality.accept(model, report.step.index, &measures, &report.residuals);
            raised.extend(quality.watch(model, points, report));
            raised
        });
        warnings.extend(raised);
        if let Some(factor) = report.strength_factor {
            let movement = Movement::measured(model, points, report.step);
            let from = model.stepping.strength_factor(model.stepping.start_time).unwrap_or(factor);
            // Damped iterations never act while the strength is reduced, so damped steps precede the reduction.
            let Reached { progress, summary } = &mut self.reached;
            let slumped = summary.damped;
            let bracket = progress.strength_of(model.present.stage);
            let begun = bracket.begins(slumped, report.step.index);
            let slides = bracket.stood(factor, from, movement, report.step.index);
            summary.warnings.extend(begun.into_iter().chain(slides));
        }
        let Summary { quality, warnings, .. } = &mut self.reached.summary;
        if let Some(error) = self.equations.unreported_fallback()
            && quality.is_first(Code::Factorised)
        {
            let step = report.step.index;
            warnings.push(Warning {
                code: Code::Factorised,
                step,
                location: Location::default(),
                value: None,
                threshold: None,
                message: format!(
                    "the iterative solver cannot solve the linear equations, so the stiffness matrix is factorised instead: \
                     {error}"
                ),
                detail: None,
            });
        }
    }
}
