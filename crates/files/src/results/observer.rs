//! What is written while a run goes on: each call of the solver adds its rows, files and checkpoints.

use std::borrow::Cow;
use std::io;
use std::sync::atomic::Ordering;

use mpm_core::basis::Connectivity;
use mpm_core::dofs::Field;
use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::ranks::Ranks;
use mpm_core::solver::{
    Cause, FailedAttempt, GridFields, NodalField, Observer, Reached, SolveError, Step, StepReport,
};
use mpm_core::surface::SurfaceFields;
use mpm_core::terms::{Contact, PairState, Surfaces, ToolState};

use super::{Results, Tables, is_due};
use crate::checkpoint;
use crate::failed;
use crate::findings::Extremes;
use crate::frames::{Frame, List, NodeValues, OnNodes};
use crate::history::{row_of_attempt, row_of_convergence, row_of_history, row_of_quality};
use crate::summary::{Outcome, Whole};
use crate::table::{Entry, Table};

/// Fields in the grid files: those of the displacement, and the unknowns and reactions of further fields.
fn on_nodes<'a, const D: usize>(
    delta_d: &'a [[f64; D]],
    reaction: &'a [[f64; D]],
    further: impl Iterator<Item = &'a NodalField>,
) -> Vec<OnNodes<'a, D>> {
    let vectors = [("displacement_increment", delta_d), ("reaction", reaction)];
    let displacement =
        vectors.map(|(name, values)| OnNodes { name: name.into(), values: NodeValues::Vectors(values) });
    let columns = |field: &'a NodalField| {
        let Field { name, components, .. } = &field.field;
        let of = |name: Cow<'a, str>, values: &'a [f64]| OnNodes {
            name,
            values: NodeValues::Numbers { components: *components, values },
        };
        [of(name.into(), &field.values), of(format!("{name}_reaction").into(), &field.reaction)]
    };
    displacement.into_iter().chain(further.flat_map(columns)).collect()
}

/// Writing of tables, frames and checkpoints.
impl Results {
    /// Writes a checkpoint of the last converged step, if there is none yet. Later failed attempts are not part of
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
            let files = &self.account.files_hash;
            checkpoint::write(&self.directory, deck, files, reached, &self.findings, points)?;
            self.checkpointed = self.last.index;
        }
        Ok(())
    }

    /// Begins to write the frames of a step; with several ranks, all ranks finish writing before this returns.
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

    /// True if VTU files are wanted and those of the last converged step are missing. All ranks must call this
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

/// The functions of the observer, for any number of axes.
impl Results {
    fn started_in<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        let ranks = &points.ranks;
        let all_points = ranks.count_all(points.len());
        let begun = if ranks.is_root() {
            self.account.write_start(&self.directory.join("run.json"), model, all_points, ranks.count())
        } else {
            Ok(())
        };
        if ranks.any(begun.is_err()) || self.every == 0 || self.last.index > 0 {
            return begun;
        }
        let mut frames = self.frames.point_frames(model, points, self.last);
        // The connectivity of the undeformed points is needed only to show the active cells.
        let methods = model.methods();
        let mut copy = points.clone();
        let links = Connectivity::default().with_body_groups(&model.body_groups.of_body);
        if let Ok(links) = links.renew(model.grid.as_ref(), &mut copy, &methods) {
            let zero = vec![[0.0; D]; links.n_active()];
            let further: Vec<NodalField> =
                (self.beside.fields.iter()).map(|field| NodalField::zero(field, links.n_active())).collect();
            let fields = on_nodes(&zero, &zero, further.iter());
            let frame = self.frames.grid_frame(model, &links, &fields, self.last);
            frames = frames.and_then(|frames| joined(frames, frame.map(Some)));
        }
        drop(copy);
        let surfaces = Surfaces::at_start(model, points);
        if ranks.is_root() {
            let frame = self.frames.surface_frame(&surfaces, self.last);
            frames = frames.and_then(|frames| joined(frames, frame));
            let tool_frames = self.frames.tool_frames(
                model,
                &Contact::at_start(model),
                &Contact::pairs_at_start(model),
                self.last,
            );
            frames = frames.and_then(|frames| joined(frames, tool_frames));
        }
        self.show(self.last, frames, ranks)
    }

    fn converged_in<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        reached: &Reached,
    ) -> io::Result<()> {
        let (ranks, summary) = (&points.ranks, &reached.summary);
        self.last = report.step;
        self.accepted = Some(reached.clone());
        self.findings.accept(model, report, summary);
        let row = row_of_history(model, points, report, summary, &self.beside);
        let mut settled = self.failure.take().map_or(Ok(()), Err);
        let is_due = is_due(self.every, model, report.step);
        if settled.is_ok() && (is_due || !self.writer.is_at_work()) {
            settled = self.settle(); // before the next frames take memory
        }
        if ranks.any(settled.is_err()) {
            return settled;
        }
        if is_due {
            let mut frames = self.frames.point_frames(model, points, report.step);
            let GridFields { links, delta_d, reaction, further, .. } = &report.grid;
            // All files of a series have the same fields.
            let further = further.iter().filter(|nodal| self.beside.fields.contains(&nodal.field));
            let fields = on_nodes(delta_d, reaction, further);
            let grid_frame = self.frames.grid_frame(model, links, &fields, report.step);
            frames = frames.and_then(|frames| joined(frames, grid_frame.map(Some)));
            if ranks.is_root() {
                let surface_frame = self.frames.surface_frame(report.list::<SurfaceFields<D>>(), report.step);
                frames = frames.and_then(|frames| joined(frames, surface_frame));
                let (tools, pairs) = (report.list::<ToolState<D>>(), report.list::<PairState<D>>());
                let tool_frames = self.frames.tool_frames(model, tools, pairs, report.step);
                frames = frames.and_then(|frames| joined(frames, tool_frames));
            }
            let shown = self.show(report.step, frames, ranks);
            if ranks.any(shown.is_err()) {
                return shown;
            }
        }
        let quality_row = row_of_quality(report, summary, &self.findings);
        let tabulated = self.tabulate(|tables| {
            tables.history.push(&row)?;
            tables.quality.push(&quality_row)
        });
        if ranks.any(tabulated.is_err()) {
            return tabulated;
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
        ended: Option<Cause<D>>,
    ) -> io::Result<()> {
        let failure = self.failure.take().map_or(Ok(()), Err);
        let tabulated = failure.and_then(|()| {
            self.tabulate(|tables| {
                let width = tables.history.width();
                tables.history.push(&row_of_attempt(width, attempt))
            })
        });
        if points.ranks.any(tabulated.is_err()) {
            return tabulated;
        }
        match ended {
            Some(cause) if self.every > 0 => failed::write(&self.directory, model, points, cause.attempt),
            _ => Ok(()),
        }
    }

    /// Writes the last step of a stage even if it is not due, for example because the stage has ended early.
    fn stage_ended_in<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        let settled = self.settle();
        if points.ranks.any(settled.is_err()) {
            return settled;
        }
        self.write_last(model, points)
    }

    /// Writes the VTU files of the last converged step if they are wanted and missing. All ranks must call this
    /// together.
    fn write_last<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        if !self.lacks_last(&points.ranks) {
            return Ok(());
        }
        let frames = self.frames.point_frames(model, points, self.last);
        self.show(self.last, frames, &points.ranks).and_then(|()| self.settle())
    }

    fn finished_in<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        reached: &Reached,
        error: Option<&SolveError>,
    ) -> io::Result<()> {
        let ranks = &points.ranks;
        let lost = self.settle();
        let is_lost = ranks.any(lost.is_err());
        let rows = self.failure.take().map_or(Ok(()), Err);
        let tables =
            self.tables.iter().flat_map(|tables| [&tables.history, &tables.quality, &tables.convergence]);
        let tables = tables.map(Table::check).find(Result::is_err).unwrap_or(Ok(()));
        // The last converged step is written even if it is not due, unless `every` is 0.
        let mesh = self.write_last(model, points);
        // A run that ended early can be resumed from its last step, unless the files of that step are missing.
        let has_lost_files = ranks.any(matches!(error, Some(SolveError::Output(_))));
        let checkpoint = match error {
            _ if has_lost_files || is_lost || error.is_none() && self.checkpoints.is_none() => Ok(()),
            _ => self.write_checkpoint(points),
        };
        self.findings.extremes = Extremes::new(model, points);
        let whole = Whole::new(model, points, &reached.summary);
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
        let outcome = Outcome::new(error.or(lost.as_ref()));
        let path = self.directory.join("summary.json");
        let summarised = self.account.write(&path, model, &whole, reached, &self.findings, &outcome);
        written.and(summarised)
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

            fn iteration(&mut self, step: Step, iteration: usize, residual: f64, by_field: &[f64]) {
                if let Some(tables) = &mut self.tables
                    && residual.is_finite()
                    && self.failure.is_none()
                {
                    // Without columns for them, the residuals of the fields are left out.
                    let mut row = row_of_convergence(step, iteration, residual, by_field);
                    row.resize(tables.convergence.width(), Entry::Missing);
                    self.failure = tables.convergence.push(&row).err();
                }
            }

            fn converged(
                &mut self,
                model: &Model<$D>,
                points: &Points<$D>,
                report: &StepReport<$D>,
                reached: &Reached,
            ) -> io::Result<()> {
                self.converged_in(model, points, report, reached)
            }

            fn failed(
                &mut self,
                model: &Model<$D>,
                points: &Points<$D>,
                attempt: &FailedAttempt<$D>,
                ended: Option<Cause<$D>>,
            ) -> io::Result<()> {
                self.failed_in(model, points, attempt, ended)
            }

            fn stage_ended(&mut self, model: &Model<$D>, points: &Points<$D>) -> io::Result<()> {
                self.stage_ended_in(model, points)
            }

            fn stage_began(&mut self, reached: Option<&Reached>) {
                self.accepted = reached.cloned();
            }

            fn interrupted(&self) -> bool {
                self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::SeqCst))
            }

            fn finished(
                &mut self,
                model: &Model<$D>,
                points: &Points<$D>,
                reached: &Reached,
                error: Option<&SolveError>,
            ) -> io::Result<()> {
                self.finished_in(model, points, reached, error)
            }
        }
    )*};
}

observe!(2 3);

/// Frames with any number of others added.
fn joined<I: IntoIterator<Item = Frame>>(
    mut frames: Vec<Frame>,
    more: io::Result<I>,
) -> io::Result<Vec<Frame>> {
    frames.extend(more?);
    Ok(frames)
}
