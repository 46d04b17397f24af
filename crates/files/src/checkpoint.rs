//! Checkpoints: everything a run needs to resume, bit for bit, from a step in equilibrium.
//!
//! A file consists of a line with the version of the format, blocks of compressed bytes, and a checksum of both
//! (`blocks`). The bytes are a JSON text with the deck and the summary of the run so far, and the arrays of the points.
//! Data that follow from the deck alone, such as the masses, are built again. A file is written under a temporary name
//! and renamed, and the previous one stays until the next is complete, so that there is always a complete one.

mod blocks;

use std::collections::HashSet;
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

/// First bytes of every file.
pub(super) const NAME: &str = blocks::NAME;

/// Number of checkpoints that are kept: the last one and, in case it is damaged, the one before.
const KEPT: usize = 2;

/// The data of a checkpoint other than the points.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Head {
    /// Version of the program that wrote it.
    pub program: String,
    /// The deck, its parameters inserted; interpreted by the reader.
    pub deck: Value,
    /// Hash of the meshes and surfaces that the deck names.
    pub files: String,
    /// The last step in equilibrium, and the summary of the run so far.
    pub reached: Reached,
    /// Findings of the run so far.
    pub findings: Findings,
    /// Number of axes, of points, of history variables per point, and of slots for corners per point.
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
    /// The fault.
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
    /// All data other than the points.
    pub head: Head,
    /// The arrays of the points, not yet decoded.
    arrays: Vec<u8>,
}

/// Writes the checkpoint of a step in equilibrium and removes those that are no longer needed.
///
/// # Errors
/// An error of the file system; earlier checkpoints are then kept.
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

/// The step of a checkpoint, from the name of its file; `None` for other files.
pub(super) fn step_of(name: &str) -> Option<usize> {
    let number = name.strip_prefix("checkpoint_")?.strip_suffix(".mpm")?;
    (number.len() >= 4 && number.bytes().all(|b| b.is_ascii_digit())).then(|| number.parse().ok())?
}

/// The checkpoints in a directory, from their names, the last one first.
fn find(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        let step = path.file_name().and_then(|name| name.to_str()).and_then(step_of);
        // Anything else with such a name, such as a directory, was not written by a run.
        found.extend(step.filter(|_| path.is_file()).map(|step| (step, path)));
    }
    found.sort();
    Ok(found.into_iter().rev().map(|(_, path)| path).collect())
}

/// The step of the last checkpoint in a directory, from the name of its file, if there is one.
pub fn last_step(directory: &Path) -> Option<usize> {
    let found = find(directory).ok()?;
    found.first()?.file_name()?.to_str().and_then(step_of)
}

/// The last readable checkpoint in a directory, and the unreadable ones after it.
///
/// # Errors
/// An error of the file system; `NotFound` if there is no checkpoint.
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
/// The reason why it cannot be used.
pub fn read(path: &Path) -> Result<Checkpoint, String> {
    let bytes = blocks::read(path)?;
    let damaged = || "its content is inconsistent".to_owned();
    let (length, rest) = bytes.split_at_checked(8).ok_or_else(damaged)?;
    let length = length.try_into().map(u64::from_le_bytes).map_err(|_| damaged())?;
    let (head, arrays) =
        usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length)).ok_or_else(damaged)?;
    let head: Head =
        serde_json::from_slice(head).map_err(|error| format!("its summary cannot be read: {error}"))?;
    Ok(Checkpoint { path: path.to_owned(), arrays: arrays.to_vec(), head })
}

impl Checkpoint {
    /// Restores the points of a newly built model to the state and the order of the checkpoint. Each of several ranks takes those
    /// that it holds.
    ///
    /// # Errors
    /// If the points differ, or if no run of this model can have written the checkpoint.
    pub fn restore<const D: usize>(&self, model: &Model<D>, points: &mut Points<D>) -> Result<(), String> {
        let Head { reached, findings, .. } = &self.head;
        if !reached.fits(model) || !findings.fits(model) {
            return Err("its summary does not belong to this analysis".to_owned());
        }
        let n = self.head.shape[1];
        let wanted = [D, n, points.history_len, points.corners_per_point];
        if self.head.shape != wanted || points.ranks.is_alone() && n != points.len() {
            return Err("it belongs to other points".to_owned());
        }
        let further = self.further_of(&points.further)?;
        let mut rest = Arrays { bytes: &self.arrays };
        let (id, cell) = (rest.words(n)?, rest.words(n)?);
        let own = Own::of(&id, points);
        let (id, cell) = (own.of_words(&id), own.of_words(&cell));
        let state = points.read_state(|field, _| {
            Ok::<_, String>(own.numbers(rest.numbers(n * field.components)?, field.components))
        })?;
        let mut values = Vec::new();
        for handle in further {
            let components = points.further.field(handle).components;
            values.push((handle, own.numbers(rest.numbers(n * components)?, components)));
        }
        if !rest.bytes.is_empty() {
            return Err("it is longer than its number of points requires".to_owned());
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

/// The places of the points of this rank in a checkpoint; `None` if it has all of them.
struct Own(Option<Vec<usize>>);

impl Own {
    fn of<const D: usize>(id: &[u32], points: &Points<D>) -> Own {
        if points.ranks.is_alone() {
            return Own(None);
        }
        let held: HashSet<u32> = points.id.iter().copied().collect();
        Own(Some((0..id.len()).filter(|place| held.contains(&id[*place])).collect()))
    }

    fn of_words(&self, words: &[u32]) -> Vec<u32> {
        match &self.0 {
            None => words.to_vec(),
            Some(places) => places.iter().map(|place| words[*place]).collect(),
        }
    }

    fn numbers(&self, numbers: Vec<f64>, components: usize) -> Vec<f64> {
        match &self.0 {
            None => numbers,
            Some(places) => places
                .iter()
                .flat_map(|place| &numbers[place * components..][..components])
                .copied()
                .collect(),
        }
    }
}

/// Reader of consecutive arrays.
struct Arrays<'a> {
    bytes: &'a [u8],
}

impl Arrays<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], String> {
        let (taken, rest) = self.bytes.split_at_checked(n).ok_or_else(|| {
            "it is shorter than its number of points \
             requires"
                .to_owned()
        })?;
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
