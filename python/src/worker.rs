//! The analysis on its own thread: an observer that pauses after every step and answers requests.

use std::cell::RefCell;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};

use mpm::deck::advice;
use mpm::deck::changes::changes_during_run;
use mpm::deck::load::LoadedDeck;
use mpm::deck::ready::Analysis;
use mpm::model::Model;
use mpm::output::record::Record;
use mpm::output::results::Results;
use mpm::output::status::{Progress, StatusFile};
use mpm::output::summary::Wording;
use mpm::points::Points;
use mpm::solver::{
    Cause, Change, FailedAttempt, Observer, Reached, Solvable, SolveError, Step, StepReport, Summary,
    change_model, run_with_changes,
};
use serde_json::{Map, Value, json};

use crate::link::{Array, Changed, Ended, Event, Failure, Link, Request};
use crate::tools::{pairs_document, tools_document};

/// Writers of the files and the status of a run.
pub struct Files {
    pub results: Results,
    pub progress: Progress,
    pub status: StatusFile,
}

impl Files {
    /// Writes the status. It serves only to watch the run, which continues if the status cannot be written.
    fn write_status(&mut self) {
        let _ = self.status.update(&self.progress);
    }
}

/// A run on its thread.
pub struct Worker {
    pub link: Link,
    pub record: Record,
    pub files: Option<Files>,
    /// True if the interpreter wants to be told of every iteration.
    pub reports_iterations: bool,
}

/// A decision of the interpreter while the analysis is paused.
enum Decision {
    Go,
    Stop,
    Change(Box<Changed>, std::sync::mpsc::Sender<Result<(), String>>),
}

/// The observer of a run.
struct Follower<'a> {
    worker: &'a mut Worker,
    /// A decision that is not yet carried out: anything but [`Decision::Go`].
    decided: Option<Decision>,
}

/// Access to the points, for any number of axes.
trait State {
    fn array(&self, name: &str) -> Option<Array>;
}

impl<const D: usize> State for (&Model<D>, &Points<D>) {
    fn array(&self, name: &str) -> Option<Array> {
        Array::read(self.0, self.1, name)
    }
}

impl Worker {
    /// Reports an event. If the interpreter has dropped the run, nobody listens, and the next pause ends the run.
    fn send(&self, event: Event) {
        let _ = self.link.events.send(event);
    }

    /// Answers requests until a decision is made. If the interpreter has dropped the run, the run stops.
    fn pause(&self, state: &dyn State) -> Decision {
        loop {
            match self.link.requests.recv() {
                Ok(Request::Go) => return Decision::Go,
                Ok(Request::Stop) | Err(_) => return Decision::Stop,
                Ok(Request::Change(changed, reply)) => return Decision::Change(changed, reply),
                Ok(Request::Array(name, reply)) => drop(reply.send(state.array(&name))),
                Ok(Request::Table(name, reply)) => {
                    drop(reply.send(name.rows(&self.record).clone()));
                }
            }
        }
    }

    /// Updates the files and the summary for another deck.
    fn change(&mut self, deck: &LoadedDeck) {
        self.record.restate(|account| deck.restate(account));
        if let Some(files) = &mut self.files {
            files.results.restate(|account| deck.restate(account));
            files.results.change(&deck.deck.request());
        }
    }

    /// Runs an analysis to its end, and hands over the result.
    pub fn run(mut self, mut analysis: Analysis, loaded: LoadedDeck) {
        let reached = analysis.beginning();
        let failure = match &mut analysis {
            Analysis::Plane(parts) => self.run_in(&mut parts.0, &mut parts.1, reached, loaded, |a| match a {
                Analysis::Plane(parts) => Some(parts.0),
                Analysis::Solid(_) => None,
            }),
            Analysis::Solid(parts) => self.run_in(&mut parts.0, &mut parts.1, reached, loaded, |a| match a {
                Analysis::Solid(parts) => Some(parts.0),
                Analysis::Plane(_) => None,
            }),
        };
        self.files = None; // releases the directory
        let Worker { link, record, .. } = self;
        let _ = link.events.send(Event::Ended(Box::new(Ended { analysis, record, failure })));
    }

    fn run_in<const D: usize>(
        &mut self,
        model: &mut Model<D>,
        points: &mut Points<D>,
        reached: Reached,
        loaded: LoadedDeck,
        model_of: fn(Analysis) -> Option<Model<D>>,
    ) -> Option<Failure>
    where
        Model<D>: Solvable<D>,
        Results: Observer<D>,
    {
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let follower = RefCell::new(Follower { worker: self, decided: None });
            let mut deck = loaded;
            let change: Change<'_, D> = &mut |model, points, reached| {
                follower.borrow_mut().carry_out(model, points, reached, &mut deck, model_of)
            };
            run_with_changes(model, points, reached, &mut Shared(&follower), change)
        }));
        match outcome {
            Ok(outcome) => outcome.err().map(|error| Failure {
                code: error.code(),
                message: error.to_string(),
                help: advice::on_error(&error).map(str::to_owned),
                residuals: error.residuals().to_vec(),
                is_interruption: matches!(error, SolveError::Interrupted { .. }),
            }),
            Err(_) => Some(Failure {
                code: None,
                message: "the program has a fault: it has panicked; see standard error, and report the fault"
                    .to_owned(),
                help: None,
                residuals: Vec::new(),
                is_interruption: false,
            }),
        }
    }
}

impl Follower<'_> {
    /// Pauses between two steps.
    fn pause(&mut self, state: &dyn State, report: Option<Value>) {
        self.worker.send(Event::Paused(report.map(Box::new)));
        self.wait(state);
    }

    fn wait(&mut self, state: &dyn State) {
        self.decided = match self.worker.pause(state) {
            Decision::Go => None,
            other => Some(other),
        };
    }

    /// Carries out a change that was decided; returns whether the run goes on.
    fn carry_out<const D: usize>(
        &mut self,
        model: &mut Model<D>,
        points: &mut Points<D>,
        reached: &mut Reached,
        deck: &mut LoadedDeck,
        model_of: fn(Analysis) -> Option<Model<D>>,
    ) -> Result<bool, SolveError> {
        let Some(Decision::Change(changed, reply)) = self.decided.take() else { return Ok(false) };
        let outcome = exchange(model, points, reached, deck, *changed, model_of).map(|next| *deck = next);
        if outcome.is_ok() {
            self.worker.change(deck);
        }
        drop(reply.send(outcome));
        self.wait(&(&*model, &*points));
        Ok(!matches!(self.decided, Some(Decision::Stop)))
    }
}

/// Puts the model of another deck in place of the current one.
///
/// # Errors
/// A reason, if the other deck changes something on which earlier steps depend, such as the grid or the bodies.
fn exchange<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: &mut Reached,
    deck: &LoadedDeck,
    changed: Changed,
    model_of: fn(Analysis) -> Option<Model<D>>,
) -> Result<LoadedDeck, String> {
    let fixed = changes_during_run(&deck.deck, &changed.loaded.deck);
    if !fixed.is_empty() {
        return Err(format!(
            "values on which earlier steps depend cannot change during a run: {}",
            fixed.join("; ")
        ));
    }
    let next = model_of(changed.analysis).ok_or("the number of axes cannot change during a run")?;
    let [before, now] = [&deck.deck, &changed.loaded.deck].map(|deck| &deck.materials);
    change_model(model, next, points, reached, &|name| before.get(name) != now.get(name))?;
    Ok(changed.loaded)
}

/// The follower as an observer; it is borrowed for each event, because the change of decks between steps uses it, too.
struct Shared<'a, 'b>(&'a RefCell<Follower<'b>>);

impl<const D: usize> Observer<D> for Shared<'_, '_>
where
    Results: Observer<D>,
{
    fn started(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        let mut follower = self.0.borrow_mut();
        if let Some(files) = &mut follower.worker.files {
            files.results.started(model, points)?;
            files.write_status();
        }
        follower.pause(&(model, points), None);
        Ok(())
    }

    fn iteration(&mut self, step: Step, iteration: usize, residual: f64, by_field: &[f64]) {
        let worker = &mut *self.0.borrow_mut().worker;
        Observer::<D>::iteration(&mut worker.record, step, iteration, residual, by_field);
        if let Some(files) = &mut worker.files {
            Observer::<D>::iteration(&mut files.results, step, iteration, residual, by_field);
            files.progress.iteration(step, iteration, residual);
            files.write_status();
        }
        if worker.reports_iterations {
            worker.send(Event::Iteration { step: step.index, iteration, residual });
        }
    }

    fn converged(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        reached: &Reached,
    ) -> io::Result<()> {
        let mut follower = self.0.borrow_mut();
        let worker = &mut *follower.worker;
        worker.record.converged(model, points, report, reached)?;
        if let Some(files) = &mut worker.files {
            files.results.converged(model, points, report, reached)?;
            files.progress.converged(report, reached);
            files.write_status();
        }
        let document = step_document(model, report, &reached.summary, worker.record.wording());
        follower.pause(&(model, points), Some(document));
        Ok(())
    }

    fn failed(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        attempt: &FailedAttempt<D>,
        ended: Option<Cause<D>>,
    ) -> io::Result<()> {
        let worker = &mut *self.0.borrow_mut().worker;
        worker.record.failed(model, points, attempt, ended)?;
        match &mut worker.files {
            Some(files) => files.results.failed(model, points, attempt, ended),
            None => Ok(()),
        }
    }

    fn stage_ended(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        match &mut self.0.borrow_mut().worker.files {
            Some(files) => files.results.stage_ended(model, points),
            None => Ok(()),
        }
    }

    fn stage_began(&mut self, reached: Option<&Reached>) {
        if let Some(files) = &mut self.0.borrow_mut().worker.files {
            if let Some(reached) = reached {
                files.progress.stage_began(reached);
                files.write_status();
            }
            Observer::<D>::stage_began(&mut files.results, reached);
        }
    }

    fn interrupted(&self) -> bool {
        self.0.borrow().decided.is_some()
    }

    fn finished(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        reached: &Reached,
        error: Option<&SolveError>,
    ) -> io::Result<()> {
        let worker = &mut *self.0.borrow_mut().worker;
        let recorded = worker.record.finished(model, points, reached, error);
        let Some(files) = &mut worker.files else { return recorded };
        let written = files.results.finished(model, points, reached, error);
        let lost = written.as_ref().err().map(SolveError::output);
        files.progress.finished(error.or(lost.as_ref()));
        files.write_status();
        written.and(recorded)
    }
}

/// A converged step as a document.
fn step_document<const D: usize>(
    model: &Model<D>,
    report: &StepReport<D>,
    summary: &Summary,
    wording: &dyn Wording,
) -> Value {
    let named = |names: &mut dyn Iterator<Item = &String>, forces: &[[f64; D]]| {
        let entries = names.zip(forces).map(|(name, force)| (name.clone(), json!(force.to_vec())));
        Value::Object(entries.collect::<Map<_, _>>())
    };
    let stage = model.stages.get(model.present.stage).map(|stage| &stage.name);
    let before = summary.warnings.iter().filter(|warning| warning.step == report.step.index);
    let warnings: Vec<Value> = before
        .map(|warning| {
            let help = wording.on_warning(warning);
            json!({"code": warning.code, "message": warning.message, "help": help})
        })
        .collect();
    json!({
        "index": report.step.index,
        "start": report.step.start,
        "time": report.step.end,
        "stage": stage,
        "iterations": report.solves(),
        "residuals": report.residuals,
        "rounding_limited": report.rounding_limited,
        "damped": report.damped,
        "load_factor": report.load_factor,
        "strength_factor": report.strength_factor,
        "reactions": named(&mut model.boundary_conditions.iter().map(|c| &c.name), &report.reactions),
        "loads": named(&mut model.loads.iter().map(|load| &load.name), &report.loads),
        "tools": tools_document(model, report.list()),
        "contacts": pairs_document(model, report.list()),
        "unknowns": report.unknowns,
        "external_work": summary.external_work,
        "strain_energy": summary.strain_energy,
        "plastic_work": summary.plastic_work,
        "end_time": model.end_time(),
        "warnings": warnings,
    })
}
