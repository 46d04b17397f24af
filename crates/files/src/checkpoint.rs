//! Checkpoints: everything that a run needs to go on, bit for bit, from a step in equilibrium.
//!
//! A file holds a line with the version of the format, blocks of compressed bytes, and a checksum of all that (`blocks`).
//! The bytes are a JSON text with the deck and the account of the run so far, and the arrays of the points. What follows
//! from the deck alone, such as the masses, is built again. A file is written beside its place and renamed, and the one
//! before it stays until the next is complete, so that there is always a whole one.

mod blocks;

use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use mpm_core::model::Model;
use mpm_core::points::{FieldHandle, FieldKind, Further, FurtherField, Points};
use mpm_core::solver::{Reached, Step};

use super::findings::Findings;
use super::invalid;
use super::replace::replace_file;
use super::summary::VERSION;

/// What every file begins with.
pub(super) const NAME: &str = blocks::NAME;

/// How many checkpoints are kept: the last, and the one before for the case that the last is damaged.
const KEPT: usize = 2;

/// What a checkpoint knows beside the points.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Head {
    /// Version of the program that wrote it.
    pub program: String,
    /// The deck, its parameters inserted; it is for the reader to make sense of.
    pub deck: Value,
    /// Hash of the meshes and surfaces that the deck names.
    pub files: String,
    /// The last step in equilibrium, and the account of the run so far.
    pub reached: Reached,
    /// What the run has found so far.
    pub findings: Findings,
    /// Number of axes, of points, of history variables per point, and of places for corners per point.
    shape: [usize; 4],
    /// Fields of the points that only this analysis has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    further: Vec<FurtherField>,
}

/// A checkpoint that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub reason: String,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the checkpoint `{}` cannot be used: {}", self.path.display(), self.reason)
    }
}

/// A checkpoint that has been read.
#[derive(Debug)]
pub struct Checkpoint {
    /// The file.
    pub path: PathBuf,
    /// All but the points.
    pub head: Head,
    /// The arrays of the points, not yet made sense of.
    arrays: Vec<u8>,
}

/// Writes the checkpoint of a step in equilibrium and removes those that are no longer needed.
///
/// # Errors
/// An error of the file system; the checkpoints before it are then still there.
pub(super) fn write<const D: usize>(
    directory: &Path,
    identity: (&Value, &str),
    reached: &Reached,
    findings: &Findings,
    points: &Points<D>,
) -> io::Result<()> {
    let head = Head {
        program: VERSION.to_owned(),
        deck: identity.0.clone(),
        files: identity.1.to_owned(),
        reached: reached.clone(),
        findings: findings.clone(),
        shape: [D, points.len(), points.history_len, points.corners_per_point],
        further: points.further.iter().map(|(_, field)| field.clone()).collect(),
    };
    let head = serde_json::to_vec(&head)?;
    let path = directory.join(file_name(reached.step.index));
    replace_file(&path, |file| {
        blocks::write(file, |out| {
            out.write_all(&(head.len() as u64).to_le_bytes())?;
            out.write_all(&head)?;
            write_points(out, points)
        })
    })?;
    for old in find(directory)?.into_iter().skip(KEPT) {
        fs::remove_file(old)?;
    }
    Ok(())
}

fn file_name(step: usize) -> String {
    format!("checkpoint_{step:04}.mpm")
}

/// The step of a checkpoint by the name of its file; `None` for other files.
pub(super) fn step_of(name: &str) -> Option<usize> {
    let number = name.strip_prefix("checkpoint_")?.strip_suffix(".mpm")?;
    (number.len() >= 4 && number.bytes().all(|b| b.is_ascii_digit())).then(|| number.parse().ok())?
}

/// The checkpoints in a directory by their names, the last one first.
fn find(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        let step = path.file_name().and_then(|name| name.to_str()).and_then(step_of);
        // Whatever else has such a name, a directory for example, is not ours.
        found.extend(step.filter(|_| path.is_file()).map(|step| (step, path)));
    }
    found.sort();
    Ok(found.into_iter().rev().map(|(_, path)| path).collect())
}

/// The step of the last checkpoint in a directory by the name of its file, if there is one.
pub fn last_step(directory: &Path) -> Option<usize> {
    let found = find(directory).ok()?;
    found.first()?.file_name()?.to_str().and_then(step_of)
}

/// The last checkpoint in a directory that can be read, and those after it that cannot.
///
/// # Errors
/// An error of the file system. `NotFound` where there is no checkpoint.
pub fn latest(directory: &Path) -> io::Result<(Option<Checkpoint>, Vec<Refused>)> {
    let paths = find(directory)?;
    if paths.is_empty() {
        return Err(io::Error::new(io::ErrorKind::NotFound, "there is no checkpoint"));
    }
    let mut refused = Vec::new();
    for path in paths {
        match read(&path) {
            Ok(checkpoint) => return Ok((Some(checkpoint), refused)),
            Err(reason) => refused.push(Refused { path, reason }),
        }
    }
    Ok((None, refused))
}

/// Reads a file.
///
/// # Errors
/// Why it cannot be used.
pub fn read(path: &Path) -> Result<Checkpoint, String> {
    let bytes = blocks::read(path)?;
    let damaged = || "its content does not fit together".to_owned();
    let (length, rest) = bytes.split_at_checked(8).ok_or_else(damaged)?;
    let length = length.try_into().map(u64::from_le_bytes).map_err(|_| damaged())?;
    let (head, arrays) =
        usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length)).ok_or_else(damaged)?;
    let head: Head =
        serde_json::from_slice(head).map_err(|error| format!("its account cannot be read: {error}"))?;
    Ok(Checkpoint { path: path.to_owned(), arrays: arrays.to_vec(), head })
}

impl Checkpoint {
    /// Puts the points of a freshly built model into the state and the order that the checkpoint holds.
    ///
    /// # Errors
    /// When they are not the same points, or nothing that a run of this model can have written.
    pub fn restore<const D: usize>(&self, model: &Model<D>, points: &mut Points<D>) -> Result<(), String> {
        let Head { reached, findings, .. } = &self.head;
        if !reached.fits(model) || !findings.fits(model) {
            return Err("its account is not one of this analysis".to_owned());
        }
        let wanted = [D, points.len(), points.history_len, points.corners_per_point];
        if self.head.shape != wanted {
            return Err("it belongs to other points".to_owned());
        }
        let further = self.further_of(&points.further)?;
        let mut rest = Arrays { bytes: &self.arrays };
        let n = points.len();
        let id: Vec<u32> = rest.words(n)?;
        let cell: Vec<u32> = rest.words(n)?;
        let state = points.read_state(|_, count| rest.numbers(count))?;
        let mut values = Vec::new();
        for handle in further {
            values.push((handle, rest.numbers(n * points.further.field(handle).components)?));
        }
        if !rest.bytes.is_empty() {
            return Err("it is longer than its points".to_owned());
        }
        if cell.iter().any(|&cell| cell as usize >= model.grid.n_cells()) {
            return Err("a point is in a cell that does not exist".to_owned());
        }
        if state.half_lengths.iter().flatten().any(|length| *length < 0.0) {
            return Err("a domain has a negative length".to_owned());
        }
        if state.deformation_gradient.iter().any(|f| f.determinant() <= 0.0) {
            return Err("a point is turned inside out".to_owned());
        }
        points.restore(&id, cell, state)?;
        values.iter().for_each(|(handle, values)| points.further.restore(*handle, values));
        Ok(())
    }

    /// The further fields whose values the checkpoint holds, in its order.
    ///
    /// # Errors
    /// When its fields are not those of the analysis.
    fn further_of(&self, declared: &Further) -> Result<Vec<FieldHandle>, String> {
        let mut found = Vec::new();
        for field in &self.head.further {
            let name = &field.name;
            let Some(handle) = declared.handle(name) else {
                return Err(format!(
                    "it has a field `{name}` of the points, which this analysis does not declare"
                ));
            };
            let wanted = declared.field(handle);
            if wanted != field {
                return Err(format!(
                    "its field `{name}` of the points is {field}, that of this analysis {wanted}"
                ));
            }
            if found.contains(&handle) {
                return Err(format!("it names the field `{name}` of the points twice"));
            }
            found.push(handle);
        }
        if let Some((_, field)) = declared.iter().find(|(handle, _)| !found.contains(handle)) {
            return Err(format!(
                "it lacks the field `{}` of the points, which this analysis declares",
                field.name
            ));
        }
        found.retain(|handle| declared.field(*handle).kind != FieldKind::Fixed);
        Ok(found)
    }

    /// The last step in equilibrium.
    pub fn step(&self) -> Step {
        self.head.reached.step
    }
}

/// Writes the arrays that [`Checkpoint::restore`] reads.
fn write_points<const D: usize>(out: &mut dyn Write, points: &Points<D>) -> io::Result<()> {
    for words in [&points.id, &points.cell] {
        for word in words {
            out.write_all(&word.to_le_bytes())?;
        }
    }
    // A file with a number that is not finite would be refused when it is needed.
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

/// Arrays in a row of bytes.
struct Arrays<'a> {
    bytes: &'a [u8],
}

impl Arrays<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], String> {
        let (taken, rest) =
            self.bytes.split_at_checked(n).ok_or_else(|| "it is shorter than its points".to_owned())?;
        self.bytes = rest;
        Ok(taken)
    }

    fn words(&mut self, n: usize) -> Result<Vec<u32>, String> {
        Ok(self.take(4 * n)?.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
    }

    fn numbers(&mut self, n: usize) -> Result<Vec<f64>, String> {
        let numbers: Vec<f64> =
            self.take(8 * n)?.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        if numbers.iter().all(|x| x.is_finite()) {
            Ok(numbers)
        } else {
            Err("a number is not finite".to_owned())
        }
    }
}

#[cfg(test)]
mod tests;
