//! From a deck to an analysis that is ready to run, in the plane or in space.

use std::sync::Arc;

use crate::build::{Built, built};
use crate::diagnostic::{self, Diagnostic};
use crate::first_step::{FirstStep, first_step};
use crate::load::{LoadFailure, LoadedDeck};
use crate::region::DeckRegion;
use mpm_core::linear::{Engine, Engines};
use mpm_core::memory::Memory;
use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::ranks::Ranks;
use mpm_core::region::Region;
use mpm_core::solver::{self, Observer, Reached, SolveError};

/// A model and its points.
#[derive(Debug)]
pub enum Analysis {
    /// In the plane.
    Plane(Box<(Model<2>, Points<2>)>),
    /// In space.
    Solid(Box<(Model<3>, Points<3>)>),
}

/// The size of an analysis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Number of bodies.
    pub bodies: usize,
    /// Number of points.
    pub points: usize,
    /// Number of cells of the grid.
    pub cells: usize,
    /// Number of load steps.
    pub steps: usize,
    /// The size of the first load step.
    pub first: FirstStep,
    /// Estimated peak memory of the analysis, [byte].
    pub memory: f64,
}

/// An analysis whose first load step can begin.
#[derive(Debug)]
pub struct Ready {
    /// The model and its points.
    pub analysis: Analysis,
    /// Size of the analysis.
    pub extent: Extent,
    /// Warnings and notes about the deck.
    pub notes: Vec<Diagnostic>,
}

/// A deck and the analysis built from it.
#[derive(Debug)]
pub struct Prepared {
    /// The deck, with all warnings and notes about it.
    pub loaded: LoadedDeck,
    /// The model and its points.
    pub analysis: Analysis,
    /// Size of the analysis.
    pub extent: Extent,
}

/// Like [`ready`], with all messages about the deck in one list. With `deny_warnings`, warnings are errors.
///
/// # Errors
/// All messages, if one of them is an error.
pub fn prepare(
    loaded: LoadedDeck,
    memory: Option<Memory>,
    deny_warnings: bool,
) -> Result<Prepared, Box<LoadFailure>> {
    prepare_on(&Ranks::default(), loaded, memory, deny_warnings)
}

/// Like [`prepare`], but divided between ranks as in [`ready_on`].
///
/// # Errors
/// As for [`prepare`], on all ranks.
pub fn prepare_on(
    ranks: &Ranks,
    mut loaded: LoadedDeck,
    memory: Option<Memory>,
    deny_warnings: bool,
) -> Result<Prepared, Box<LoadFailure>> {
    let built = ready_on(ranks, &loaded, memory);
    let mut diagnostics = std::mem::take(&mut loaded.notes);
    let built = match built {
        Ok(Ready { analysis, extent, notes }) => {
            diagnostics.extend(notes);
            Some((analysis, extent))
        }
        Err(found) => {
            diagnostics.extend(found);
            None
        }
    };
    diagnostic::sort(&mut diagnostics);
    let denied = deny_warnings && diagnostic::deny_warnings(&mut diagnostics);
    match built {
        Some((analysis, extent)) if !denied => {
            loaded.notes = diagnostics;
            Ok(Prepared { loaded, analysis, extent })
        }
        _ => Err(Box::new(LoadFailure { source: loaded.source, diagnostics })),
    }
}

/// Builds the model of a deck and checks its first load step. An analysis that does not fit in `memory` is refused.
///
/// # Errors
/// All faults that prevent the first load step from being solved, with warnings and notes.
pub fn ready(loaded: &LoadedDeck, memory: Option<Memory>) -> Result<Ready, Vec<Diagnostic>> {
    ready_on(&Ranks::default(), loaded, memory)
}

/// Like [`ready`], but divided between ranks: each creates a share of the points and receives the points in its part of
/// the grid. All ranks must call this with the same deck; all get the same messages.
///
/// # Errors
/// As for [`ready`], on all ranks.
pub fn ready_on(
    ranks: &Ranks,
    loaded: &LoadedDeck,
    memory: Option<Memory>,
) -> Result<Ready, Vec<Diagnostic>> {
    Ok(if loaded.deck.dimensions() == 3 {
        let (parts, extent, notes) = ready_parts::<3>(ranks, loaded, memory)?;
        Ready { analysis: Analysis::Solid(Box::new(parts)), extent, notes }
    } else {
        let (parts, extent, notes) = ready_parts::<2>(ranks, loaded, memory)?;
        Ready { analysis: Analysis::Plane(Box::new(parts)), extent, notes }
    })
}

type ReadyParts<const D: usize> = ((Model<D>, Points<D>), Extent, Vec<Diagnostic>);

fn ready_parts<const D: usize>(
    ranks: &Ranks,
    loaded: &LoadedDeck,
    memory: Option<Memory>,
) -> Result<ReadyParts<D>, Vec<Diagnostic>>
where
    Region<D>: DeckRegion<D>,
{
    let Built { mut model, mut points, mut notes, memory } = built::<D>(loaded, memory, ranks)?;
    match first_step(loaded, &mut model, &mut points) {
        Ok((first, more)) => {
            notes.extend(more);
            let extent = Extent {
                bodies: model.bodies.len(),
                points: ranks.count_all(points.len()),
                cells: model.grid.n_cells(),
                steps: model.steps_requested(),
                first,
                memory,
            };
            Ok(((model, points), extent, notes))
        }
        Err(found) => {
            notes.extend(found);
            Err(notes)
        }
    }
}

impl Analysis {
    /// Number of points of this rank.
    pub fn n_points(&self) -> usize {
        match self {
            Analysis::Plane(parts) => parts.1.len(),
            Analysis::Solid(parts) => parts.1.len(),
        }
    }

    /// The state before the first step.
    pub fn beginning(&self) -> Reached {
        match self {
            Analysis::Plane(parts) => Reached::nothing(&parts.1),
            Analysis::Solid(parts) => Reached::nothing(&parts.1),
        }
    }

    /// Makes the run solve its equations with this library.
    pub fn solve_with<E: Engine<2> + Engine<3> + 'static>(&mut self, engine: &Arc<E>) {
        match self {
            Analysis::Plane(parts) => parts.0.engines = Engines(Some(engine.clone())),
            Analysis::Solid(parts) => parts.0.engines = Engines(Some(engine.clone())),
        }
    }

    /// Runs the analysis from `reached`; the points must be in that state.
    ///
    /// # Errors
    /// As for [`solver::run`].
    pub fn run<O: Observer<2> + Observer<3>>(
        &mut self,
        reached: Reached,
        observer: &mut O,
    ) -> Result<Reached, SolveError> {
        match self {
            Analysis::Plane(parts) => {
                let (model, points) = &mut **parts;
                run_in_plane(model, points, reached, observer)
            }
            Analysis::Solid(parts) => {
                let (model, points) = &mut **parts;
                run_in_space(model, points, reached, observer)
            }
        }
    }
}

// These functions are not generic, so that `run_stages` is compiled here and not again in each program.
fn run_in_plane(
    model: &mut Model<2>,
    points: &mut Points<2>,
    reached: Reached,
    observer: &mut dyn Observer<2>,
) -> Result<Reached, SolveError> {
    solver::run_stages(model, points, reached, observer)
}

fn run_in_space(
    model: &mut Model<3>,
    points: &mut Points<3>,
    reached: Reached,
    observer: &mut dyn Observer<3>,
) -> Result<Reached, SolveError> {
    solver::run_stages(model, points, reached, observer)
}
