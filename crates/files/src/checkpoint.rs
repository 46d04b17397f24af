//! Checkpoints: everything a run needs to resume, bit for bit, from a converged step.
//!
//! A file consists of a line with the format version, blocks of compressed bytes, and a checksum of both (`blocks`).
//! The bytes hold JSON text with the deck and, as two parts, the progress and the summary of the run so far, followed by
//! the arrays of the points. Data that follow from the deck alone, such as masses, are computed again. A file is written
//! under a temporary name and then renamed, and the last two checkpoints are kept, so that a complete checkpoint exists
//! at all times after the first one.
//!
//! With several ranks, each rank writes its points to a piece, a file of the same format. The main file of the
//! checkpoint then states the sizes of the pieces in place of the arrays, and is written last. Any number of ranks can
//! read the checkpoint (`rows`).

mod blocks;
mod names;
mod rows;

use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use mpm_core::model::Model;
use mpm_core::points::{FieldHandle, FieldKind, Further, FurtherField, Points};
use mpm_core::ranks::Ranks;
use mpm_core::solver::{Path as SolutionPath, Reached, Step};

pub(super) use names::step_of;
use names::{file_name, piece_name, pieces_before};
use rows::Rows;

use super::findings::Findings;
use super::invalid;
use super::replace::replace_file;
use super::summary::VERSION;

/// First bytes of every file.
pub(super) const NAME: &str = blocks::NAME;

/// Number of checkpoints kept: the last one and, in case it is damaged, the one before it.
const KEPT: usize = 2;

/// The data of a checkpoint other than the points.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Head {
    /// Version of the program that wrote the checkpoint.
    pub program: String,
    /// The deck after parameter substitution; the reader interprets it.
    pub deck: Value,
    /// Hash of the files that the deck names.
    pub files: String,
    /// The last converged step: what the next step builds on, and what is reported on the run so far.
    pub reached: Reached,
    /// Findings of the run so far.
    pub findings: Findings,
    /// Numbers of axes, of points, of history variables per point, and of corner slots per point.
    shape: [usize; 4],
    /// Fields of the points that only this analysis has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    further: Vec<FurtherField>,
    /// Number of points in each piece; empty in a file that holds its points itself.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pieces: Vec<usize>,
}

/// A checkpoint that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The file.
    pub path: PathBuf,
    /// Why the file cannot be used.
    pub reason: String,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the checkpoint `{}` cannot be used: {}", self.path.display(), self.reason)
    }
}

/// A checkpoint that has been read from its file.
#[derive(Debug)]
pub struct Checkpoint {
    /// The file.
    pub path: PathBuf,
    /// All data other than the points.
    pub head: Head,
    /// The arrays of the points that this rank reads, not yet decoded: for each piece, its number of points and its
    /// bytes.
    arrays: Vec<(usize, Vec<u8>)>,
    /// The solution paths in these pieces.
    paths: Vec<SolutionPath>,
}

/// Writes the checkpoint of a converged step and removes checkpoints that are no longer needed. All ranks must
/// call this together.
///
/// # Errors
/// A file-system error, or `InvalidInput` if a number of the points is not finite; earlier checkpoints are then kept.
pub(super) fn write<const D: usize>(
    directory: &Path,
    deck: &Value,
    files: &str,
    reached: &Reached,
    findings: &Findings,
    points: &Points<D>,
) -> io::Result<()> {
    let ranks = &points.ranks;
    let mut head = Head {
        program: VERSION.to_owned(),
        deck: deck.clone(),
        files: files.to_owned(),
        reached: reached.clone(),
        findings: findings.clone(),
        shape: [D, points.len(), points.history_len, points.corners_per_point],
        further: points.further.iter().map(|(_, field)| field.clone()).collect(),
        pieces: Vec::new(),
    };
    let step = reached.progress.step.index;
    if ranks.is_alone() {
        write_file(&directory.join(file_name(step)), &head, Some(points))?;
    } else {
        let written = write_file(&directory.join(piece_name(step, ranks.own())), &head, Some(points));
        head.pieces = ranks.gather_all(points.len());
        head.shape[1] = head.pieces.iter().sum();
        if ranks.any(written.is_err()) || !ranks.is_root() {
            return written;
        }
        write_file::<D>(&directory.join(file_name(step)), &head, None)?;
    }
    let steps = find(directory)?;
    for old in steps.iter().skip(KEPT) {
        fs::remove_file(directory.join(file_name(*old)))?;
    }
    // Also removes pieces without a main file, left by a run that was killed while it wrote the checkpoint.
    let first = steps.get(KEPT - 1).copied().unwrap_or(0);
    pieces_before(directory, first)?.into_iter().try_for_each(fs::remove_file)
}

/// Writes a file of a checkpoint, with points or without.
fn write_file<const D: usize>(path: &Path, head: &Head, points: Option<&Points<D>>) -> io::Result<()> {
    let head = serde_json::to_vec(head)?;
    replace_file(path, |file| {
        blocks::write(file, |out| {
            out.write_all(&(head.len() as u64).to_le_bytes())?;
            out.write_all(&head)?;
            points.map_or(Ok(()), |points| write_points(out, points))
        })
    })
}

/// The steps of the checkpoints in a directory, from their file names, the last one first.
fn find(directory: &Path) -> io::Result<Vec<usize>> {
    let whole = |(step, rank, _): (usize, Option<usize>, PathBuf)| rank.is_none().then_some(step);
    let mut found: Vec<usize> = names::all(directory)?.into_iter().filter_map(whole).collect();
    found.sort_unstable_by(|a, b| b.cmp(a));
    Ok(found)
}

/// The step of the last checkpoint in a directory, from its file name; `None` if there is no checkpoint, or if the
/// directory cannot be read.
pub fn last_step(directory: &Path) -> Option<usize> {
    find(directory).ok()?.first().copied()
}

/// The last readable checkpoint in a directory, and the later ones that cannot be read. All ranks must call this
/// together; each reads its share of the pieces.
///
/// # Errors
/// A file-system error; `NotFound` if there is no checkpoint.
pub fn latest(directory: &Path, ranks: &Ranks) -> io::Result<(Option<Checkpoint>, Vec<Refused>)> {
    let steps = find(directory);
    if ranks.any(steps.is_err()) {
        return Err(steps.err().unwrap_or_else(|| io::Error::other("another rank cannot read it")));
    }
    // A shared directory may not look the same on all machines at once.
    let steps = ranks.first(Some(steps?)).unwrap_or_default();
    if steps.is_empty() {
        return Err(io::Error::new(io::ErrorKind::NotFound, "there is no checkpoint"));
    }
    let mut refused = Vec::new();
    for step in steps {
        let path = directory.join(file_name(step));
        let read = read_on(ranks, &path);
        match (ranks.first(read.as_ref().err().cloned()), read) {
            (None, Ok(checkpoint)) => return Ok((Some(checkpoint.with_joined_path(ranks)), refused)),
            (reason, _) => refused.push(Refused { path, reason: reason.unwrap_or_default() }),
        }
    }
    Ok((None, refused))
}

/// Reads a file, with all its pieces.
///
/// # Errors
/// The reason why the file cannot be used.
pub fn read(path: &Path) -> Result<Checkpoint, String> {
    let alone = Ranks::default();
    read_on(&alone, path).map(|checkpoint| checkpoint.with_joined_path(&alone))
}

/// Reads a file and this rank's share of the pieces.
fn read_on(ranks: &Ranks, path: &Path) -> Result<Checkpoint, String> {
    let (head, arrays) = read_file(path)?;
    let mut checkpoint = Checkpoint { path: path.to_owned(), arrays: Vec::new(), paths: Vec::new(), head };
    if checkpoint.head.pieces.is_empty() {
        if ranks.is_root() {
            checkpoint.arrays.push((checkpoint.head.shape[1], arrays));
        }
        return Ok(checkpoint);
    }
    for number in ranks.share(checkpoint.head.pieces.len()) {
        let (head, arrays) = read_piece(&checkpoint, number)?;
        checkpoint.arrays.push((head.shape[1], arrays));
        checkpoint.paths.push(head.reached.progress.path);
    }
    Ok(checkpoint)
}

/// The head of a piece, and the bytes of its arrays.
///
/// # Errors
/// The reason why the piece cannot be used.
fn read_piece(checkpoint: &Checkpoint, number: usize) -> Result<(Head, Vec<u8>), String> {
    let step = checkpoint.step().index;
    let directory = checkpoint.path.parent().unwrap_or(Path::new(""));
    let name = piece_name(step, number);
    let (head, arrays) =
        read_file(&directory.join(&name)).map_err(|reason| format!("its piece `{name}`: {reason}"))?;
    let whole = &checkpoint.head;
    let shape = [whole.shape[0], whole.pieces[number], whole.shape[2], whole.shape[3]];
    if head.shape != shape
        || head.reached.progress.step != whole.reached.progress.step
        || head.further != whole.further
    {
        return Err(format!("its piece `{name}` does not belong to `{}`", file_name(step)));
    }
    Ok((head, arrays))
}

/// The head of a file, and the bytes of its arrays.
fn read_file(path: &Path) -> Result<(Head, Vec<u8>), String> {
    let mut bytes = blocks::read(path)?;
    let damaged = || "its content is inconsistent".to_owned();
    let (length, rest) = bytes.split_at_checked(8).ok_or_else(damaged)?;
    let length = length.try_into().map(u64::from_le_bytes).map_err(|_| damaged())?;
    let (head, arrays) =
        usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length)).ok_or_else(damaged)?;
    let begin = bytes.len() - arrays.len();
    let head: Head =
        serde_json::from_slice(head).map_err(|error| format!("its summary cannot be read: {error}"))?;
    Ok((head, bytes.split_off(begin)))
}

impl Checkpoint {
    /// The checkpoint with the solution path joined from its pieces, each written by one rank. All ranks that have read
    /// the checkpoint must call this together.
    fn with_joined_path(mut self, ranks: &Ranks) -> Checkpoint {
        let paths = ranks.gather_all(std::mem::take(&mut self.paths)).concat();
        if !paths.is_empty() {
            self.head.reached.progress.path = SolutionPath::joined(&paths);
        }
        self
    }

    /// Restores the points of a newly built model to the state and the order of the checkpoint. Several ranks must call
    /// this together; the points are then divided between them anew.
    ///
    /// # Errors
    /// If the points differ, or if no run of this model can have written the checkpoint; all ranks then return an
    /// error.
    pub fn restore<const D: usize>(&self, model: &Model<D>, points: &mut Points<D>) -> Result<(), String> {
        let ranks = points.ranks.clone();
        let rows = self.rows(model, points);
        if let Some(reason) = ranks.first(rows.as_ref().err().cloned()) {
            return Err(reason);
        }
        let mut rows = rows?;
        if !ranks.is_alone() {
            let division = points.divide_by_number();
            rows = rows.by_number(&ranks, division);
        }
        let restored = rows.restore(model, points);
        if let Some(reason) = ranks.first(restored.err()) {
            return Err(reason);
        }
        points.divide_by_cell(model.grid.as_ref());
        Ok(())
    }

    /// The points that this rank has read.
    ///
    /// # Errors
    /// If they cannot belong to this analysis.
    fn rows<const D: usize>(&self, model: &Model<D>, points: &Points<D>) -> Result<Rows, String> {
        let Head { reached, findings, shape, .. } = &self.head;
        if !reached.fits(model) || !findings.fits(model) {
            return Err("its summary does not belong to this analysis".to_owned());
        }
        let n = points.len();
        let wanted = [D, if points.ranks.is_alone() { n } else { shape[1] }];
        if shape[..2] != wanted || shape[2..] != [points.history_len, points.corners_per_point] {
            return Err("it belongs to other points".to_owned());
        }
        let mut rows = Rows::new(points, &self.further_of(&points.further)?);
        for (n, bytes) in &self.arrays {
            rows.read(*n, bytes)?;
        }
        Ok(rows)
    }

    /// The further fields whose values the checkpoint holds, in the order of the checkpoint.
    ///
    /// # Errors
    /// If the fields differ from those of the analysis.
    fn further_of(&self, declared: &Further) -> Result<Vec<FieldHandle>, String> {
        let mut found = Vec::new();
        for field in &self.head.further {
            let name = &field.name;
            let Some(handle) = declared.handle(name) else {
                return Err(format!(
                    "it contains the point field `{name}`, which this analysis does not declare"
                ));
            };
            let wanted = declared.field(handle);
            if wanted != field {
                return Err(format!(
                    "its point field `{name}` is {field}, but that of this analysis is {wanted}"
                ));
            }
            if found.contains(&handle) {
                return Err(format!("it contains the point field `{name}` twice"));
            }
            found.push(handle);
        }
        if let Some((_, field)) = declared.iter().find(|(handle, _)| !found.contains(handle)) {
            return Err(format!("it lacks the point field `{}`, which this analysis declares", field.name));
        }
        found.retain(|handle| declared.field(*handle).kind != FieldKind::Fixed);
        Ok(found)
    }

    /// The last converged step.
    pub fn step(&self) -> Step {
        self.head.reached.progress.step
    }
}

/// Writes the arrays that [`Checkpoint::restore`] reads.
fn write_points<const D: usize>(out: &mut dyn Write, points: &Points<D>) -> io::Result<()> {
    for words in [&points.id, &points.cell] {
        for word in words {
            out.write_all(&word.to_le_bytes())?;
        }
    }
    // A file with a non-finite number would be refused when the run is resumed.
    let mut numbers =
        |name: &str, per_point: usize, values: &mut dyn Iterator<Item = f64>| -> io::Result<()> {
            for (place, value) in values.enumerate() {
                if !value.is_finite() {
                    let point = points.id[place / per_point.max(1)];
                    return Err(invalid(format!("the {name} of point {point} is {value}")));
                }
                out.write_all(&value.to_le_bytes())?;
            }
            Ok(())
        };
    points.for_each_field(|field, values| numbers(field.label, field.components, values))?;
    for (handle, field) in points.further.iter().filter(|(_, field)| field.kind != FieldKind::Fixed) {
        let label = format!("field `{}`", field.name);
        numbers(&label, field.components, &mut points.further.converged(handle).iter().copied())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
