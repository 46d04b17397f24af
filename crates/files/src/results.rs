//! The results directory of a run: VTU series, tables and summary. With several ranks, the first rank writes the
//! tables, the lists of files and the summary, and each rank writes its pieces of the meshes.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use mpm_core::basis::DomainKind;
use mpm_core::dofs::Field;
use mpm_core::model::Model;
use mpm_core::solver::{Reached, Step};

use super::checkpoint::Checkpoint;
use super::directory::{
    SERIES, file_name, foreign_file, list_name, remove_earlier_results, remove_later_results,
    series_without_list, step_of_file,
};
use super::fields::PointField;
use super::findings::Findings;
use super::frames::Frames;
use super::history::{Beside, QUALITY, columns_of_convergence, columns_of_history};
use super::lock::Lock;
use super::rows;
use super::series::Series;
use super::summary::Account;
use super::table::{Kept, Table, check_columns};
use super::vtu::Precision;
use super::writer::Writer;

mod observer;

/// Files that a run writes in addition to the tables, and how often.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// Number of requested load steps from one set of VTU files to the next, unless a stage states another. The initial
    /// state and the last step, also of each stage, are written as well. 0 writes none.
    pub every: usize,
    /// Fields of the points in the VTU files.
    pub fields: Vec<PointField>,
    /// Precision of the numbers in the VTU files.
    pub precision: Precision,
    /// Number of load steps from one checkpoint to the next; the last step has one as well. `None` writes one only if a
    /// run ends early.
    pub checkpoints: Option<usize>,
    /// Names of forces that terms report in addition to the loads of the model, see
    /// [`StepReport::forces`](mpm_core::solver::StepReport::forces); each has columns in `history.csv`. No
    /// name may be that of a load or tool.
    pub forces: Vec<String>,
    /// The fields of the unknowns beside the displacement, in their order. Each has a residual in `convergence.csv`, and
    /// its unknowns and reactions on the nodes of the grid files.
    pub nodal: Vec<Field>,
    /// Names of the conditions that terms impose on these fields; the reactions of each have columns in `history.csv`.
    pub conditions: Vec<String>,
    /// Names of energies that terms report, see
    /// [`Summary::further_energies`](mpm_core::solver::Summary::further_energies); each has a column in `history.csv`.
    pub energies: Vec<String>,
}

impl Default for Request {
    fn default() -> Self {
        let fields = PointField::by_default();
        Request {
            every: 1,
            fields,
            precision: Precision::default(),
            checkpoints: None,
            forces: Vec::new(),
            nodal: Vec::new(),
            conditions: Vec::new(),
            energies: Vec::new(),
        }
    }
}

impl Request {
    /// What the tables state beside what a model defines.
    fn beside(&self) -> Beside {
        Beside {
            forces: self.forces.clone(),
            fields: self.nodal.clone(),
            conditions: self.conditions.clone(),
            energies: self.energies.clone(),
        }
    }
}

/// The checkpoint at which a run begins again.
#[derive(Clone, Copy)]
pub struct Restart<'a> {
    /// The checkpoint.
    pub checkpoint: &'a Checkpoint,
    /// Its step, as numbered in this run.
    pub step: Step,
}

/// Writes all results of a run to its directory.
pub struct Results {
    directory: PathBuf,
    every: usize,
    checkpoints: Option<usize>,
    beside: Beside,
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
    /// What a checkpoint stores besides the points; `None` before this run has a converged step or enters a new
    /// stage, and after a stage that could not begin.
    accepted: Option<Reached>,
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
    /// The message about a results directory that cannot be created or written to; `choose` says how to choose another.
    pub fn refusal(directory: &Path, error: &io::Error, choose: &str) -> String {
        let name = directory.display();
        match directory.ancestors().find(|path| path.is_file()) {
            Some(file) => format!(
                "the results directory `{name}` cannot be created: `{}` is a file; choose another directory with \
                 {choose}, or move the file away",
                file.display()
            ),
            None => format!("the results directory `{name}` cannot be written: {error}"),
        }
    }

    /// Prepares a directory for a run: creates it, removes the results of an earlier run and opens the tables.
    /// VTU files and checkpoints are written as `asked` states.
    ///
    /// # Errors
    /// If the directory cannot be created or written to; `ResourceBusy` if another run writes there; `AlreadyExists` if
    /// a file with the name of a result file was not written by a run; `InvalidInput` if two columns of a table would
    /// have the same name. In the last two cases nothing in the directory is changed.
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
        let history = columns_of_history(model, &asked.beside());
        check_columns(&history)?;
        remove_earlier_results(directory)?;
        let tables = Tables {
            history: Table::create(directory.join("history.csv"), &history)?,
            quality: Table::create(directory.join("quality.csv"), &QUALITY)?,
            convergence: Table::create(
                directory.join("convergence.csv"),
                &columns_of_convergence(&asked.nodal),
            )?,
        };
        Ok(Results {
            tables: Some(tables),
            _lock: Some(lock),
            ..Results::without_files(directory, asked, model, account, None)
        })
    }

    /// The results of a rank other than the first, for a run that begins at the start or, with `from`, at a checkpoint.
    /// Touches no file.
    pub fn without_files<const D: usize>(
        directory: &Path,
        asked: &Request,
        model: &Model<D>,
        account: Account,
        from: Option<Restart>,
    ) -> Results {
        let reached = from.map_or(Step { index: 0, start: 0.0, end: 0.0 }, |restart| restart.step);
        Results {
            directory: directory.to_owned(),
            every: asked.every,
            checkpoints: asked.checkpoints,
            beside: asked.beside(),
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
            findings: from.map(|restart| restart.checkpoint.head.findings.clone()).unwrap_or_default(),
            all_have_domains: all_have_domains(model),
            last: reached,
            accepted: None,
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
    /// name of a result file that no run wrote; in the last two cases nothing in the directory is changed.
    pub fn resume<const D: usize>(
        directory: &Path,
        lock: Lock,
        asked: &Request,
        model: &Model<D>,
        account: Account,
        checkpoint: &Checkpoint,
        reached: Step,
    ) -> io::Result<Results> {
        let (last, every) = (checkpoint.step().index, asked.every);
        let [history, quality, convergence] =
            tables_in(directory, asked, model, Some(&checkpoint.head.reached))?;
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
            ..Results::without_files(
                directory,
                asked,
                model,
                account,
                Some(Restart { checkpoint, step: reached }),
            )
        })
    }

    /// Checks that the tables of a run are in its directory, with the rows of all steps up to `reached` if it is given.
    /// `asked` states the forces and the further fields that have columns.
    ///
    /// # Errors
    /// The errors of [`Results::resume`] that concern tables.
    pub fn check_tables<const D: usize>(
        directory: &Path,
        model: &Model<D>,
        asked: &Request,
        reached: Option<&Reached>,
    ) -> io::Result<()> {
        tables_in(directory, asked, model, reached).map(drop)
    }

    /// The same results, for a run in which nothing else watches `stop`: the run ends when `stop` is set.
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Results {
        Results { stop: Some(stop), ..self }
    }

    /// Changes the account of the run, for example its deck.
    pub fn restate(&mut self, change: impl FnOnce(&mut Account)) {
        change(&mut self.account);
    }

    /// Makes the steps that follow write VTU files and checkpoints as `asked` states. The columns of the tables stay.
    pub fn change(&mut self, asked: &Request) {
        let Request { every, fields, precision, checkpoints, .. } = asked;
        (self.every, self.checkpoints) = (*every, *checkpoints);
        self.frames.change(fields, *precision);
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
        let pieces = self.directory.join(list_name(series, step));
        let whole = self.directory.join(file_name(series, step));
        Some(Picture {
            series: self.directory.join(format!("{series}.pvd")),
            file: if pieces.exists() { pieces } else { whole },
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
}

/// The rows up to `reached` of `history.csv`, `quality.csv` and `convergence.csv` in a directory.
fn tables_in<const D: usize>(
    directory: &Path,
    asked: &Request,
    model: &Model<D>,
    reached: Option<&Reached>,
) -> io::Result<[Kept; 3]> {
    let (last, steps) =
        reached.map_or((0, 0), |reached| (reached.progress.step.index, reached.summary.steps));
    let table = |name: &str, columns: &[String]| Table::keep(directory.join(name), columns, last);
    let history = table("history.csv", &columns_of_history(model, &asked.beside()))?;
    let quality = table("quality.csv", &QUALITY.map(String::from))?;
    let convergence = table("convergence.csv", &columns_of_convergence(&asked.nodal))?;
    rows::check([&history, &quality, &convergence], steps)?;
    Ok([history, quality, convergence])
}

/// The error for a file that a run would replace although no run has written it.
fn foreign(name: &str, end: &str) -> io::Error {
    let what = format!("the file `{name}` was not written by a run{end}");
    io::Error::new(io::ErrorKind::AlreadyExists, what)
}

/// True if VTU files of a step are due: after every `every` requested steps, or at the interval that the stage states
/// instead, and at the end of each stage and of the analysis; never if `every` is 0.
fn is_due<const D: usize>(every: usize, model: &Model<D>, step: Step) -> bool {
    let stage_every = model.stages.get(model.present.stage).and_then(|stage| stage.every);
    let every = if every == 0 { 0 } else { stage_every.unwrap_or(every) };
    let requested = model.stepping.requested(step.end);
    let is_due = |number: usize| number.is_multiple_of(every) || number == model.stepping.count;
    every > 0 && requested.is_some_and(is_due)
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
