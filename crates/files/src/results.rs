//! The results directory of a run: VTU series, tables and summary. With several ranks, the first rank writes the
//! tables, the lists of files and the summary, and each rank writes its pieces of the meshes.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use mpm_core::basis::{Connectivity, DomainKind};
use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::ranks::Ranks;
use mpm_core::solver::{
    Diagnosis, FailedAttempt, GridFields, Observer, Reached, SolveError, Step, StepReport, Summary,
};
use mpm_core::terms::{Contact, Surfaces};

use super::checkpoint::{self, Checkpoint};
use super::directory::{
    SERIES, file_name, foreign_file, list_name, remove_earlier_results, remove_later_results,
    series_without_list, step_of_file,
};
use super::failed;
use super::fields::PointField;
use super::findings::{Extremes, Findings};
use super::frames::{Frame, Frames, List};
use super::history::{
    CONVERGENCE, QUALITY, columns_of_history, row_of_attempt, row_of_convergence, row_of_history,
    row_of_quality,
};
use super::lock::Lock;
use super::rows;
use super::series::Series;
use super::summary::{Account, Outcome, Whole};
use super::table::{Kept, Table};
use super::vtu::Precision;
use super::writer::Writer;

/// Files that a run writes in addition to the tables, and how often.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// Number of requested load steps from one set of VTU files to the next; the last step is written as well. 0 writes
    /// none.
    pub every: usize,
    /// Fields of the points in the VTU files.
    pub fields: Vec<PointField>,
    /// Precision of the numbers in the VTU files.
    pub precision: Precision,
    /// Number of load steps from one checkpoint to the next; `None` writes one only if a run ends early.
    pub checkpoints: Option<usize>,
}

impl Default for Request {
    fn default() -> Self {
        let fields = PointField::by_default();
        Request { every: 1, fields, precision: Precision::default(), checkpoints: None }
    }
}

/// Writes all results of a run to its directory.
pub struct Results {
    directory: PathBuf,
    every: usize,
    checkpoints: Option<usize>,
    /// The tables; only the first rank has them.
    tables: Option<Tables>,
    frames: Frames,
    writer: Writer,
    /// The last step whose points were written.
    written: Option<usize>,
    /// The step that is being written.
    shown: Option<usize>,
    /// The first failure to write a table that could not be reported at once.
    failure: Option<io::Error>,
    account: Account,
    findings: Findings,
    all_have_domains: bool,
    last: Step,
    /// What a checkpoint stores besides the points, once this run has a step in equilibrium; `None` as well if the next
    /// stage could not begin.
    accepted: Option<Reached>,
    /// True if a stage has begun since the last step: the points no longer show the state at the end of that step.
    has_left: bool,
    /// The last step with a checkpoint.
    checkpointed: usize,
    /// Number of points of all ranks, once the run has ended.
    points: usize,
    /// Ends the run when set; `None` if something else watches for a request to stop.
    stop: Option<Arc<AtomicBool>>,
    /// Held by the first rank until the end of the run.
    _lock: Option<Lock>,
}

/// The tables of a run.
struct Tables {
    history: Table,
    quality: Table,
    convergence: Table,
}

impl Results {
    /// Prepares a directory for a run: creates it, removes the results of an earlier run and opens the tables.
    /// VTU files and checkpoints are written as `asked` states.
    ///
    /// # Errors
    /// If the directory cannot be created or written to; `ResourceBusy` if another run writes there; `AlreadyExists` if
    /// a file with the name of a result file was not written by a run.
    pub fn create<const D: usize>(
        directory: &Path,
        asked: &Request,
        model: &Model<D>,
        account: Account,
    ) -> io::Result<Results> {
        std::fs::create_dir_all(directory)?;
        let lock = Lock::take(directory)?;
        if let Some(name) = foreign_file(directory)? {
            return Err(foreign(&name, "; choose another directory with `--out`, or move the file away"));
        }
        remove_earlier_results(directory)?;
        let tables = Tables {
            history: Table::create(directory.join("history.csv"), &columns_of_history(model))?,
            quality: Table::create(directory.join("quality.csv"), &QUALITY)?,
            convergence: Table::create(directory.join("convergence.csv"), &CONVERGENCE)?,
        };
        Ok(Results {
            tables: Some(tables),
            _lock: Some(lock),
            ..Results::of_rank(directory, asked, model, account, None)
        })
    }

    /// The results of a rank other than the first, for a run that begins at the start or, with `from`, at a checkpoint,
    /// whose step is numbered as in this run. Touches no file.
    pub fn of_rank<const D: usize>(
        directory: &Path,
        asked: &Request,
        model: &Model<D>,
        account: Account,
        from: Option<(&Checkpoint, Step)>,
    ) -> Results {
        let reached = from.map_or(Step { index: 0, start: 0.0, end: 0.0 }, |(_, reached)| reached);
        Results {
            directory: directory.to_owned(),
            every: asked.every,
            checkpoints: asked.checkpoints,
            tables: None,
            frames: Frames::new(&asked.fields, asked.precision),
            writer: Writer::new(
                directory,
                SERIES.map(|name| Series::new(directory.join(format!("{name}.pvd")))),
            ),
            written: None,
            shown: None,
            failure: None,
            account,
            findings: from.map(|(checkpoint, _)| checkpoint.head.findings.clone()).unwrap_or_default(),
            all_have_domains: all_have_domains(model),
            last: reached,
            accepted: None,
            has_left: false,
            checkpointed: reached.index,
            points: 0,
            stop: None,
            _lock: None,
        }
    }

    /// Prepares a directory for a run that resumes from a checkpoint in it: results after the step of the checkpoint
    /// are removed. `reached` is that step, with its number in this run.
    ///
    /// # Errors
    /// If the directory cannot be written to, does not contain the results up to the checkpoint, or has a file with the
    /// name of a result file that no run wrote; in the last two cases nothing in it is changed.
    pub fn resume<const D: usize>(
        (directory, lock): (&Path, Lock),
        asked: &Request,
        model: &Model<D>,
        account: Account,
        checkpoint: &Checkpoint,
        reached: Step,
    ) -> io::Result<Results> {
        let (last, every) = (checkpoint.step().index, asked.every);
        let [history, quality, convergence] = tables_in(directory, model, Some(&checkpoint.head.reached))?;
        if let Some(name) = foreign_file(directory)? {
            return Err(foreign(&name, ", or is damaged"));
        }
        if let Some(series) = series_without_list(directory)? {
            let what =
                format!("`{series}.pvd`, which states the times of the files of the series, is missing");
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        let [history, quality, convergence] = [history.reopen()?, quality.reopen()?, convergence.reopen()?];
        // A stopped run writes its last step, whether or not it is due. A run without VTU files removes none.
        let is_due = every == 0 || is_due(every, model, reached);
        let is_kept =
            |name: &str| step_of_file(name).is_some_and(|step| step < last || step == last && is_due);
        let mut series = Vec::new();
        for name in SERIES {
            series.push(Series::reopen(directory.join(format!("{name}.pvd")), reached.end, is_kept)?);
        }
        remove_later_results(directory, last, is_kept)?;
        let series: [Series; SERIES.len()] =
            series.try_into().map_err(|_| io::Error::other("a series is missing"))?;
        Ok(Results {
            written: series[0].last().and_then(|(_, name)| step_of_file(name)),
            writer: Writer::new(directory, series),
            tables: Some(Tables { history, quality, convergence }),
            _lock: Some(lock),
            ..Results::of_rank(directory, asked, model, account, Some((checkpoint, reached)))
        })
    }

    /// Checks that the tables of a run are in its directory, with the rows of all steps up to `reached` if it is given.
    ///
    /// # Errors
    /// Those of [`Results::resume`] about tables.
    pub fn check_tables<const D: usize>(
        directory: &Path,
        model: &Model<D>,
        reached: Option<&Reached>,
    ) -> io::Result<()> {
        tables_in(directory, model, reached).map(drop)
    }

    /// Writes a checkpoint of the last step in equilibrium, if there is none yet. Later failed attempts are not part of
    /// it: a resumed run repeats them. All ranks must call this together.
    fn write_checkpoint<const D: usize>(&mut self, points: &Points<D>) -> io::Result<()> {
        // Earlier results must be complete first, because a resumed run does not write them again.
        let settled = self.settle();
        if points.ranks.any(settled.is_err()) {
            return settled;
        }
        if let Some(deck) = &self.account.deck
            && let Some(reached) = &self.accepted
            && self.last.index > self.checkpointed
        {
            let identity = (deck, self.account.files_hash.as_str());
            checkpoint::write(&self.directory, identity, reached, &self.findings, points)?;
            self.checkpointed = self.last.index;
        }
        Ok(())
    }

    /// The same results, for a run in which nothing else watches `stop`: the run ends when `stop` is set.
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Results {
        Results { stop: Some(stop), ..self }
    }

    /// Changes facts about the run, such as its deck.
    pub fn restate(&mut self, change: impl FnOnce(&mut Account)) {
        change(&mut self.account);
    }

    /// The directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Findings of the run so far; the extreme values of the fields are set once it has ended.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    /// The last file that shows the points, or their domains if all points have one; `None` if none was written.
    pub fn last_picture(&self) -> Option<Picture> {
        let step = self.written?;
        let series = SERIES[usize::from(self.all_have_domains)];
        let of_ranks = self.directory.join(list_name(series, step));
        let whole = self.directory.join(file_name(series, step));
        Some(Picture {
            series: self.directory.join(format!("{series}.pvd")),
            file: if of_ranks.exists() { of_ranks } else { whole },
        })
    }

    /// Number of points of all ranks, once the run has ended.
    pub fn points(&self) -> usize {
        self.points
    }

    /// True if the deck requests VTU files.
    pub fn asks_for_pictures(&self) -> bool {
        self.every > 0
    }

    /// Begins to write the frames of a step; if there are several ranks, they finish writing together.
    fn show(&mut self, step: Step, frames: io::Result<Vec<Frame>>, ranks: &Ranks) -> io::Result<()> {
        if ranks.is_alone() {
            self.settle()?;
            self.writer.begin(frames?)?;
            self.shown = Some(step.index);
            return if self.writer.is_at_work() { Ok(()) } else { self.settle() };
        }
        let written = frames.and_then(|frames| {
            let lists: Vec<List> = frames.iter().filter_map(|frame| frame.list(ranks)).collect();
            self.writer.begin(frames)?;
            self.shown = Some(step.index);
            self.settle()?;
            Ok(lists)
        });
        // A list must not name a missing piece.
        let is_missing = ranks.any(written.is_err());
        match written {
            Ok(lists) if !is_missing && ranks.is_root() => self.writer.list(&lists),
            Ok(_) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// True if VTU files are wanted and those of the last step in equilibrium are missing. All ranks must call this
    /// together.
    fn lacks_last(&self, ranks: &Ranks) -> bool {
        let is_missing = self.writer.reached().is_none_or(|time| time < self.last.end);
        // The first rank keeps the lists.
        self.every > 0 && self.last.index > 0 && ranks.any(ranks.is_root() && is_missing)
    }

    /// Adds rows to the tables, on the rank that has them.
    fn tabulate(&mut self, rows: impl FnOnce(&mut Tables) -> io::Result<()>) -> io::Result<()> {
        self.tables.as_mut().map_or(Ok(()), rows)
    }

    /// Waits for the frames being written.
    fn settle(&mut self) -> io::Result<()> {
        let shown = self.shown.take();
        self.writer.settle()?;
        self.written = shown.or(self.written);
        Ok(())
    }
}

/// The rows up to `reached` of `history.csv`, `quality.csv` and `convergence.csv` in a directory.
fn tables_in<const D: usize>(
    directory: &Path,
    model: &Model<D>,
    reached: Option<&Reached>,
) -> io::Result<[Kept; 3]> {
    let (last, steps) = reached.map_or((0, 0), |reached| (reached.step.index, reached.summary.steps));
    let table = |name: &str, columns: &[String]| Table::keep(directory.join(name), columns, last);
    let history = table("history.csv", &columns_of_history(model))?;
    let quality = table("quality.csv", &QUALITY.map(String::from))?;
    let convergence = table("convergence.csv", &CONVERGENCE.map(String::from))?;
    rows::check([&history, &quality, &convergence], steps)?;
    Ok([history, quality, convergence])
}

/// The error for a file that a run would replace although no run has written it.
fn foreign(name: &str, end: &str) -> io::Error {
    let what = format!("`{name}` in it was not written by a run{end}");
    io::Error::new(io::ErrorKind::AlreadyExists, what)
}

/// True if VTU files of a step are due: after every `every` requested steps, or as many as its stage states instead,
/// and at the end of each stage and of the analysis.
fn is_due<const D: usize>(every: usize, model: &Model<D>, step: Step) -> bool {
    let every = model.stages.get(model.present.stage).and_then(|stage| stage.every).unwrap_or(every);
    let requested = model.stepping.requested(step.end);
    let is_due = |number: usize| number.is_multiple_of(every) || number == model.stepping.count;
    every > 0 && requested.is_some_and(is_due)
}

/// Fields in the grid files.
fn on_nodes<'a, const D: usize>(
    delta_d: &'a [[f64; D]],
    reaction: &'a [[f64; D]],
) -> [(&'static str, &'a [[f64; D]]); 2] {
    [("displacement_increment", delta_d), ("reaction", reaction)]
}

/// A time series, and its last file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// The series file, for ParaView.
    pub series: PathBuf,
    /// The mesh at the last step that was written.
    pub file: PathBuf,
}

fn all_have_domains<const D: usize>(model: &Model<D>) -> bool {
    model.bodies.iter().all(|b| b.method.domain() != DomainKind::None)
}

/// The functions of the observer, for any number of axes.
impl Results {
    fn started_in<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        let ranks = &points.ranks;
        let size = (ranks.count_all(points.len()), ranks.count());
        let begun = if ranks.is_root() {
            self.account.write_start(&self.directory.join("run.json"), model, size)
        } else {
            Ok(())
        };
        if ranks.any(begun.is_err()) || self.every == 0 || self.last.index > 0 {
            return begun;
        }
        let mut frames = self.frames.of_points(model, points, self.last);
        // The connectivity of the undeformed points is needed only to show the active cells.
        let methods = model.methods();
        let mut copy = points.clone();
        if let Ok(links) = Connectivity::new(model.grid.as_ref(), &mut copy, &methods) {
            let zero = vec![[0.0; D]; links.n_active()];
            let frame = self.frames.of_grid(model, &links, &on_nodes(&zero, &zero), self.last);
            frames = frames.and_then(|frames| joined(frames, frame.map(Some)));
        }
        drop(copy);
        let surfaces = Surfaces::at_start(model, points);
        if ranks.is_root() {
            let frame = self.frames.of_surfaces(&surfaces, self.last);
            frames = frames.and_then(|frames| joined(frames, frame));
            let of_tools = self.frames.of_tools(model, &Contact::at_start(model), self.last);
            frames = frames.and_then(|frames| joined(frames, of_tools));
        }
        self.show(self.last, frames, ranks)
    }

    fn converged_in<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        summary: &Summary,
    ) -> io::Result<()> {
        let ranks = &points.ranks;
        self.last = report.step;
        self.accepted = Some(Reached { step: report.step, summary: summary.clone() });
        self.has_left = false;
        self.findings.accept(model, report, summary);
        let row = row_of_history(model, points, report, summary);
        let mut settled = self.failure.take().map_or(Ok(()), Err);
        let is_due = is_due(self.every, model, report.step);
        if settled.is_ok() && (is_due || !self.writer.is_at_work()) {
            settled = self.settle(); // before the next frames take memory
        }
        if ranks.any(settled.is_err()) {
            return settled;
        }
        if is_due {
            let mut frames = self.frames.of_points(model, points, report.step);
            let GridFields { links, delta_d, reaction, .. } = &report.grid;
            let of_grid = self.frames.of_grid(model, links, &on_nodes(delta_d, reaction), report.step);
            frames = frames.and_then(|frames| joined(frames, of_grid.map(Some)));
            if ranks.is_root() {
                let of_surfaces = self.frames.of_surfaces(&report.surfaces, report.step);
                frames = frames.and_then(|frames| joined(frames, of_surfaces));
                let of_tools = self.frames.of_tools(model, &report.tools, report.step);
                frames = frames.and_then(|frames| joined(frames, of_tools));
            }
            let shown = self.show(report.step, frames, ranks);
            if ranks.any(shown.is_err()) {
                return shown;
            }
        }
        let of_quality = row_of_quality(report, summary, &self.findings);
        let told = self.tabulate(|tables| {
            tables.history.push(&row)?;
            tables.quality.push(&of_quality)
        });
        if ranks.any(told.is_err()) {
            return told;
        }
        if self.checkpoints.is_some_and(|every| report.step.index.is_multiple_of(every)) {
            self.write_checkpoint(points)?;
        }
        Ok(())
    }

    fn failed_in<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        attempt: &FailedAttempt<D>,
        ended: Option<(&FailedAttempt<D>, &Diagnosis)>,
    ) -> io::Result<()> {
        let failure = self.failure.take().map_or(Ok(()), Err);
        let told = failure.and_then(|()| {
            self.tabulate(|tables| {
                let width = tables.history.width();
                tables.history.push(&row_of_attempt(width, attempt))
            })
        });
        if points.ranks.any(told.is_err()) {
            return told;
        }
        match ended {
            Some((cause, _)) if self.every > 0 => failed::write(&self.directory, model, points, cause),
            _ => Ok(()),
        }
    }

    /// Writes the last step of a stage even if it is not due, as that of a stage that has ended early.
    fn stage_ended_in<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        let ranks = &points.ranks;
        let settled = self.settle();
        if ranks.any(settled.is_err()) || !self.lacks_last(ranks) {
            return settled;
        }
        let frames = self.frames.of_points(model, points, self.last);
        self.show(self.last, frames, ranks)
    }

    fn finished_in<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        summary: &Summary,
        error: Option<&SolveError>,
    ) -> io::Result<()> {
        let ranks = &points.ranks;
        let lost = self.settle();
        let is_lost = ranks.any(lost.is_err());
        let rows = self.failure.take().map_or(Ok(()), Err);
        let tables = self.tables.iter().flat_map(|of| [&of.history, &of.quality, &of.convergence]);
        let tables = tables.map(Table::check).find(Result::is_err).unwrap_or(Ok(()));
        // The last step in equilibrium is written even if it is not due, unless `every` is 0.
        let mesh = if !self.has_left && self.lacks_last(ranks) {
            let frames = self.frames.of_points(model, points, self.last);
            self.show(self.last, frames, ranks).and_then(|()| self.settle())
        } else {
            Ok(())
        };
        // A run that ended early can be resumed from its last step, unless the files of that step are missing.
        let has_lost_files = ranks.any(matches!(error, Some(SolveError::Output(_))));
        let checkpoint = match error {
            _ if has_lost_files || is_lost || error.is_none() && self.checkpoints.is_none() => Ok(()),
            _ => self.write_checkpoint(points),
        };
        self.findings.extremes = Extremes::new(model, points);
        let whole = Whole::new(model, points);
        self.points = whole.points;
        // Each part is written even if another could not be written.
        let written = lost.and(rows).and(mesh).and(checkpoint).and(tables);
        let lost = ranks.first(written.as_ref().err().map(ToString::to_string));
        if !ranks.is_root() {
            return written;
        }
        // The summary comes last: if it reports a completed run, nothing is missing.
        let own = written.as_ref().err().map(SolveError::output);
        let lost = own.or_else(|| lost.map(|what| SolveError::Output(io::Error::other(what))));
        let outcome = Outcome::of(error.or(lost.as_ref()));
        let path = self.directory.join("summary.json");
        let told = self.account.write(&path, model, &whole, summary, &self.findings, &outcome);
        written.and(told)
    }
}

/// Implements [`Observer`] for each number of axes. A generic implementation would be compiled again in every crate
/// that runs analyses. Generic code that passes [`Results`] on requires `Results: Observer<D>`.
macro_rules! observe {
    ($($D:literal)*) => {$(
        impl Observer<$D> for Results {
            fn started(&mut self, model: &Model<$D>, points: &Points<$D>) -> io::Result<()> {
                self.started_in(model, points)
            }

            fn iteration(&mut self, step: Step, iteration: usize, residual: f64) {
                if let Some(tables) = &mut self.tables
                    && residual.is_finite()
                    && self.failure.is_none()
                {
                    self.failure = tables.convergence.push(&row_of_convergence(step, iteration, residual)).err();
                }
            }

            fn converged(
                &mut self,
                model: &Model<$D>,
                points: &Points<$D>,
                report: &StepReport<$D>,
                summary: &Summary,
            ) -> io::Result<()> {
                self.converged_in(model, points, report, summary)
            }

            fn failed(
                &mut self,
                model: &Model<$D>,
                points: &Points<$D>,
                attempt: &FailedAttempt<$D>,
                ended: Option<(&FailedAttempt<$D>, &Diagnosis)>,
            ) -> io::Result<()> {
                self.failed_in(model, points, attempt, ended)
            }

            fn stage_ended(&mut self, model: &Model<$D>, points: &Points<$D>) -> io::Result<()> {
                self.stage_ended_in(model, points)
            }

            fn stage_began(&mut self, reached: Option<&Reached>) {
                self.accepted = reached.cloned();
                self.has_left = true;
            }

            fn interrupted(&self) -> bool {
                self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::SeqCst))
            }

            fn finished(
                &mut self,
                model: &Model<$D>,
                points: &Points<$D>,
                summary: &Summary,
                error: Option<&SolveError>,
            ) -> io::Result<()> {
                self.finished_in(model, points, summary, error)
            }
        }
    )*};
}

observe!(2 3);

/// Frames with one or several more added.
fn joined<I: IntoIterator<Item = Frame>>(
    mut frames: Vec<Frame>,
    more: io::Result<I>,
) -> io::Result<Vec<Frame>> {
    frames.extend(more?);
    Ok(frames)
}
