//! A run that the interpreter advances step by step: the Python side of the link.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

use mpm::deck::ready::{Analysis, Prepared};
use mpm::output::record::Record;
use mpm::output::results::Results;
use mpm::output::status::{Progress, StatusFile};
use mpm::output::summary::Start;
use mpm::timing::{Phase, Timings};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{dictionary, matrix};
use crate::errors::{Raised, exception};
use crate::laws::Laws;
use crate::link::{Changed, Ended, Event, Failure, Link, Name, Request};
use crate::preparation::{DeckText, loaded, pool, prepared};
use crate::worker::{Files, Worker};

/// Longest time between two checks for signals such as Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// The parts of a run that the methods of [`Session`] change.
struct Running {
    events: Receiver<Event>,
    requests: Option<Sender<Request>>,
    /// True if the next event belongs to a step that is still being solved.
    is_under_way: bool,
    has_ended: bool,
    /// The end of the run, until it is closed.
    ended: Option<Box<Ended>>,
    thread: Option<JoinHandle<()>>,
}

/// A run that the interpreter controls between steps.
#[pyclass(frozen, module = "mpm._mpm")]
pub struct Session {
    running: Mutex<Running>,
    laws: Laws,
    on_iteration: Mutex<Option<Py<PyAny>>>,
    threads: Option<usize>,
    /// True if code of the libraries that decks name may run.
    allow_libraries: bool,
    /// The process that began the run; the run's thread does not exist in a forked child.
    process: u32,
    /// Messages about the deck, as JSON.
    #[pyo3(get)]
    notes: String,
    /// Names of the history variables of the laws.
    #[pyo3(get)]
    history: Vec<String>,
    /// The results directory.
    #[pyo3(get)]
    directory: Option<PathBuf>,
}

#[pymethods]
impl Session {
    /// Begins a run of a deck and pauses it before the first step.
    #[new]
    #[pyo3(signature = (name, text, overrides, *, threads, out, laws, allow_libraries, on_iteration))]
    #[expect(clippy::too_many_arguments, reason = "they are the keywords of a function in Python")]
    fn new(
        py: Python<'_>,
        name: &str,
        text: &[u8],
        overrides: Vec<(String, String)>,
        threads: Option<usize>,
        out: Option<PathBuf>,
        laws: &Bound<'_, PyDict>,
        allow_libraries: bool,
        on_iteration: Option<Py<PyAny>>,
    ) -> PyResult<Session> {
        let laws = Laws::new(laws)?;
        let (events, received) = mpsc::channel();
        let (requests, link) = mpsc::channel();
        let link = Link { events, requests: link };
        let reports_iterations = on_iteration.is_some();
        let deck = DeckText { name, text, overrides: &overrides, allow_libraries };
        let begun = py.detach(|| begin(deck, threads, out.clone(), &laws, link, reports_iterations));
        let Begun { thread, notes, history } = begun.map_err(|error| laws.blamed(py, error))?;
        let running = Running {
            events: received,
            requests: Some(requests),
            is_under_way: true,
            has_ended: false,
            ended: None,
            thread: Some(thread),
        };
        let process = std::process::id();
        let session = Session {
            running: Mutex::new(running),
            laws,
            on_iteration: Mutex::new(on_iteration),
            threads,
            allow_libraries,
            process,
            notes,
            history,
            directory: out,
        };
        session.wait(py, &mut *session.lock()?)?;
        Ok(session)
    }

    /// Solves the next step and returns it as JSON; `None` at the end of the run.
    fn step(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let running = &mut *self.lock()?;
        if running.has_ended {
            return Ok(None);
        }
        if !running.is_under_way {
            self.send(running, Request::Go)?;
            running.is_under_way = true;
        }
        self.wait(py, running)
    }

    /// Ends the run before the next step, in the state after the last step; a step under way is awaited and returned.
    fn stop(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let running = &mut *self.lock()?;
        let mut last = None;
        while running.is_under_way && !running.has_ended {
            last = self.wait_until(py, running, None)?.or(last);
        }
        if !running.has_ended {
            self.send(running, Request::Stop)?;
            running.is_under_way = true;
            self.wait_until(py, running, None)?;
        }
        Ok(last)
    }

    /// Ends the run and releases its thread and its memory.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let mut running = self.lock()?;
        running.requests = None;
        let thread = running.thread.take();
        if self.process == std::process::id()
            && let Some(thread) = thread
        {
            py.detach(|| drop(thread.join()));
        }
        running.ended = None;
        running.events = mpsc::channel().1; // the end of the run may still wait in the channel
        Ok(())
    }

    /// Ends all calls of laws: the run is abandoned, or the interpreter is about to end.
    fn abandon(&self) {
        self.laws.end_calls();
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        if let Ok(heard) = self.on_iteration.try_lock()
            && let Some(heard) = heard.as_ref()
        {
            visit.call(heard)?;
        }
        self.laws.traverse(&visit)
    }

    fn __clear__(&self) {
        // The analysis holds the laws, so it must end before they can be released.
        self.laws.end_calls();
        let mut running = self.running.try_lock();
        if let Ok(running) = &mut running {
            running.requests = None;
            running.ended = None;
        }
        drop(running);
        let heard = self.on_iteration.try_lock().ok().and_then(|mut heard| heard.take());
        drop(heard);
    }

    /// True if the run has ended.
    fn has_ended(&self) -> PyResult<bool> {
        Ok(self.lock()?.has_ended)
    }

    /// The document of `summary.json`, as JSON; `None` before the end of the run.
    fn summary(&self) -> PyResult<Option<String>> {
        let running = self.lock()?;
        let summary = running.ended.as_ref().and_then(|ended| ended.record.summary.as_ref());
        Ok(summary.map(ToString::to_string))
    }

    /// An array of the points in the order of their permanent numbers.
    fn array<'py>(&self, py: Python<'py>, name: String) -> PyResult<Option<Bound<'py, PyAny>>> {
        let at_end = self.at_end(|ended| ended.array(&name))?;
        let found = match at_end {
            Some(found) => found,
            None => self.ask(py, |reply| Request::Array(name, reply))?,
        };
        found.map(|array| matrix(py, array.values, array.components)).transpose()
    }

    /// A table of the run: a dictionary of columns.
    fn table<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        let name = match name {
            "history" => Name::History,
            "quality" => Name::Quality,
            "convergence" => Name::Convergence,
            other => return Err(Raised::misuse(format!("there is no table {other:?}")).into()),
        };
        let rows = match self.at_end(|ended| name.rows(&ended.record).clone())? {
            Some(rows) => rows,
            None => self.ask(py, |reply| Request::Table(name, reply))?,
        };
        let columns = rows.columns.iter().enumerate().map(|(k, name)| (name.as_str(), rows.column(k)));
        dictionary(py, columns)
    }

    /// Continues with the loads, conditions, materials and steps of another deck.
    fn change(
        &self,
        py: Python<'_>,
        name: &str,
        text: &[u8],
        overrides: Vec<(String, String)>,
    ) -> PyResult<()> {
        let changed = py.detach(|| -> Result<Changed, Raised> {
            let pool = pool(self.threads)?;
            let allow_libraries = self.allow_libraries;
            let mut deck = loaded(DeckText { name, text, overrides: &overrides, allow_libraries })?;
            self.laws.replace(&mut deck)?;
            let Prepared { loaded, analysis, .. } = prepared(deck, &pool)?;
            Ok(Changed { loaded, analysis })
        });
        let changed = changed.map_err(|error| self.laws.blamed(py, error))?;
        let running = &mut *self.lock()?;
        self.is_paused(running)?;
        if running.has_ended {
            return Err(Raised::misuse("the run has ended").into());
        }
        let (reply, answer) = mpsc::channel();
        self.send(running, Request::Change(Box::new(changed), reply))?;
        let outcome = received(py, answer)?;
        outcome.map_err(|reason| Raised::misuse(reason).into())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Nobody awaits the step under way.
        self.laws.end_calls();
    }
}

impl Session {
    /// The run, for one thread of the interpreter at a time.
    fn lock(&self) -> Result<std::sync::MutexGuard<'_, Running>, Raised> {
        if self.process != std::process::id() {
            return Err(Raised::misuse(
                "this run belongs to another process; begin the run in the process that steps it",
            ));
        }
        self.running.try_lock().map_err(|_| {
            Raised::misuse(
                "the run is already solving a step for another thread, or for the function that called this one",
            )
        })
    }

    fn send(&self, running: &Running, request: Request) -> Result<(), Raised> {
        let closed = || Raised::misuse("the run is closed");
        running.requests.as_ref().ok_or_else(closed)?.send(request).map_err(|_| closed())
    }

    fn is_paused(&self, running: &Running) -> Result<(), Raised> {
        if running.is_under_way && !running.has_ended {
            return Err(Raised::misuse(
                "an interrupted step is still under way; take the next step first to finish it",
            ));
        }
        Ok(())
    }

    /// A value from a run that has ended; `None` before its end.
    fn at_end<T>(&self, read: impl FnOnce(&Ended) -> T) -> PyResult<Option<T>> {
        let running = self.lock()?;
        if running.requests.is_none() {
            return Err(Raised::misuse("the run is closed").into());
        }
        Ok(running.ended.as_deref().map(read))
    }

    /// Makes a request while the run is paused.
    fn ask<T: Send>(&self, py: Python<'_>, request: impl FnOnce(Sender<T>) -> Request) -> PyResult<T> {
        let running = &*self.lock()?;
        self.is_paused(running)?;
        let (reply, answer) = mpsc::channel();
        self.send(running, request(reply))?;
        received(py, answer)
    }

    /// Waits until the run pauses or ends; returns the report of the step as JSON, if there is one.
    fn wait(&self, py: Python<'_>, running: &mut Running) -> PyResult<Option<String>> {
        let hears = self.on_iteration.lock().ok().and_then(|heard| heard.as_ref().map(|f| f.clone_ref(py)));
        self.wait_until(py, running, hears.as_ref())
    }

    /// The same as `wait`, but for every iteration calls `hears`, if given, instead of `on_iteration`.
    fn wait_until(
        &self,
        py: Python<'_>,
        running: &mut Running,
        hears: Option<&Py<PyAny>>,
    ) -> PyResult<Option<String>> {
        loop {
            let events = Mutex::new(&mut running.events);
            let received = py.detach(|| events.lock().ok().map(|events| events.recv_timeout(LOOK)));
            match received {
                Some(Ok(Event::Paused(report))) => {
                    running.is_under_way = false;
                    return Ok(report.map(|report| report.to_string()));
                }
                Some(Ok(Event::Ended(ended))) => return self.end(py, running, ended),
                Some(Ok(Event::Iteration { step, iteration, residual })) => {
                    if let Some(hears) = hears {
                        hears.call1(py, (step, iteration, residual))?;
                    }
                    py.check_signals()?;
                }
                Some(Err(RecvTimeoutError::Timeout)) => py.check_signals()?,
                _ => return Err(Raised::misuse("the run is closed").into()),
            }
        }
    }

    /// Keeps the end of a run, and raises its error.
    fn end(&self, py: Python<'_>, running: &mut Running, ended: Box<Ended>) -> PyResult<Option<String>> {
        let failure = ended.failure.as_ref().filter(|failure| !failure.is_interruption);
        let error = failure.map(|Failure { code, message, help, residuals, .. }| {
            exception(py, "SolveError", (message.clone(), *code, help.clone(), residuals.clone()))
        });
        running.is_under_way = false;
        running.has_ended = true;
        running.ended = Some(ended);
        match (self.laws.take_raised(), error) {
            (Some(raised), Some(error)) => {
                error.set_cause(py, Some(raised));
                Err(error)
            }
            (None, Some(error)) => Err(error),
            // An exception in a call that serves only diagnostics does not stop the last step.
            (Some(raised), None) => {
                let message = format!("a law has failed: {raised}");
                let error = exception(py, "SolveError", (message, "S019"));
                error.set_cause(py, Some(raised));
                Err(error)
            }
            (None, None) => Ok(None),
        }
    }
}

/// The answer to a request.
fn received<T: Send>(py: Python<'_>, answer: Receiver<T>) -> PyResult<T> {
    py.detach(move || answer.recv().ok()).ok_or_else(|| Raised::misuse("the run is closed").into())
}

/// A run that has begun.
struct Begun {
    thread: JoinHandle<()>,
    /// Messages about the deck, as JSON.
    notes: String,
    /// Names of the history variables of the laws.
    history: Vec<String>,
}

/// Reads and builds a deck, opens its files and begins its run on a new thread.
fn begin(
    deck: DeckText,
    threads: Option<usize>,
    out: Option<PathBuf>,
    laws: &Laws,
    link: Link,
    reports_iterations: bool,
) -> Result<Begun, Raised> {
    let start = Start::now();
    let pool = pool(threads)?;
    let mut set_up = Timings::default();
    let prepared = set_up.measure(Phase::SetUp, || {
        let mut deck = loaded(deck)?;
        laws.replace(&mut deck)?;
        prepared(deck, &pool)
    })?;
    let Prepared { loaded, analysis, .. } = prepared;
    let notes = mpm::deck::diagnostic::as_json(&loaded.source, &loaded.notes).to_string();
    let mut account = loaded
        .account(start, set_up, pool.current_num_threads())
        .map_err(|error| Raised::misuse(error.to_string()))?;
    if !laws.are_none() {
        account.deck = None; // no checkpoint: the program could not go on with these laws
    }
    let asked = loaded.deck.request();
    let not_writable = |directory: &std::path::Path, error: std::io::Error| Raised::Results {
        code: Some("R001"),
        message: Results::refusal(directory, &error, "`out`"),
    };
    let files = match &out {
        None => None,
        Some(directory) => {
            let created = match &analysis {
                Analysis::Plane(parts) => Results::create(directory, &asked, &parts.0, account.clone())
                    .map(|results| (results, Progress::new(&parts.0, parts.1.len(), start))),
                Analysis::Solid(parts) => Results::create(directory, &asked, &parts.0, account.clone())
                    .map(|results| (results, Progress::new(&parts.0, parts.1.len(), start))),
            };
            let (results, progress) = created.map_err(|error| not_writable(directory, error))?;
            Some(Files { status: StatusFile::new(results.directory()), results, progress })
        }
    };
    let record = match &analysis {
        Analysis::Plane(parts) => Record::new(&parts.0, account),
        Analysis::Solid(parts) => Record::new(&parts.0, account),
    };
    let history = match &analysis {
        Analysis::Plane(parts) => parts.0.history_names(),
        Analysis::Solid(parts) => parts.0.history_names(),
    };
    let history = history.into_iter().map(str::to_owned).collect();
    let worker = Worker { link, record, files, reports_iterations };
    let builder = std::thread::Builder::new().name("mpm".to_owned());
    let thread = builder.spawn(move || pool.install(|| worker.run(analysis, loaded)));
    let thread = thread.map_err(|error| Raised::misuse(format!("the threads cannot be started: {error}")))?;
    Ok(Begun { thread, notes, history })
}
