//! Numerical factorisation: the fronts of each task assemble entries of the matrix and the updates of their children,
//! eliminate their unknowns, and pass on their own updates. With LU, each front has the columns and the update of L,
//! followed by the columns and the update of Uᵀ.

use std::ops::Range;

use rayon::prelude::*;

use super::dense;
use super::fronts::{Front, Fronts};
use super::tasks::Task;

/// Number of columns that one thread fills at a time if threads share a front.
const COLUMNS: usize = 32;
/// Threads share the columns, or the update, of a front if these have at least this number of values.
const SHARED: usize = 1 << 17;

/// A factorisation of the matrix with these values.
#[derive(Clone, Copy)]
pub(super) struct Elimination<'a> {
    pub fronts: &'a Fronts,
    pub values: &'a [f64],
}

impl Elimination<'_> {
    /// Computes the columns of the fronts of a task, given the memory for them; the update of the last front is then at
    /// the start of the working space. False if a pivot of LLᵀ is not positive, or a pivot of LU is zero or not finite.
    pub fn run(self, task: &Task, factor: &mut [f64], room: &mut [f64]) -> bool {
        let front = &self.fronts.front;
        let origin = front[task.fronts.start].panel;
        if !self.run_within(task, factor, origin, room) {
            return false;
        }
        for f in task.own.iter().cloned().flatten() {
            let panel = &mut factor[front[f].panel - origin..][..front[f].panel_len()];
            if !self.eliminate(&front[f], panel, room) {
                return false;
            }
        }
        let top = &front[task.fronts.end - 1];
        room.copy_within(top.update..top.update + top.update_len(), 0);
        true
    }

    fn run_within(self, task: &Task, factor: &mut [f64], origin: usize, room: &mut [f64]) -> bool {
        let panels = |task: &Task| {
            let last = &self.fronts.front[task.fronts.end - 1];
            self.fronts.front[task.fronts.start].panel..last.panel + last.panel_len()
        };
        let rooms = |task: &Task| task.base..task.base + task.room;
        if !task.apart {
            return task.within.iter().all(|task| {
                let panels = panels(task);
                let panels = &mut factor[panels.start - origin..panels.end - origin];
                self.run(task, panels, &mut room[rooms(task)])
            });
        }
        let factors = cut(factor, origin, task.within.iter().map(panels));
        let rooms = cut(room, 0, task.within.iter().map(rooms));
        let tasks = task.within.par_iter().zip(factors).zip(rooms);
        tasks.map(|((task, factor), room)| self.run(task, factor, room)).reduce(|| true, |a, b| a && b)
    }

    fn eliminate(self, front: &Front, panel: &mut [f64], room: &mut [f64]) -> bool {
        let (before, rest) = room.split_at_mut(front.update);
        let (update, after) = rest.split_at_mut(front.update_len());
        let passed = Passed { fronts: self.fronts, front, before, after };
        if self.fronts.is_kept(front) {
            self.assemble_left(front, update, passed);
            return true;
        }
        for_each_factor(front, panel, |factor, panel| {
            for_each_column(panel, dense::stride(front.rows), front.pivots, |first, columns| {
                columns.fill(0.0);
                self.take_entries(front, factor, first, columns);
                passed.add(factor, first, 0, columns);
            });
        });
        if !dense::eliminate(front.factors, front.rows, front.pivots, panel, update) {
            return false;
        }
        for_each_factor(front, update, |factor, update| {
            for_each_column(
                update,
                dense::stride(front.border_len()),
                front.border_len(),
                |first, columns| {
                    passed.add(factor, front.pivots + first, front.pivots, columns);
                },
            );
        });
        true
    }

    /// Assembles the matrix left for the kept unknowns from matrix entries and updates; the update of
    /// [`Fronts::before_kept`] is already in place.
    fn assemble_left(self, front: &Front, left: &mut [f64], passed: Passed) {
        let holds_update = self.fronts.before_kept().is_some();
        for_each_factor(front, left, |factor, left| {
            for_each_column(left, dense::stride(front.rows), front.rows, |first, columns| {
                if !holds_update {
                    columns.fill(0.0);
                    passed.add(factor, first, 0, columns);
                }
                self.take_entries(front, factor, first, columns);
            });
        });
    }

    /// Adds the matrix entries to the columns of a factor of a front, starting with column `first`.
    fn take_entries(self, front: &Front, factor: usize, first: usize, columns: &mut [f64]) {
        let start = &self.fronts.column_start[front.first + first..];
        let entry = &self.fronts.entry[factor];
        for (column, start) in columns.chunks_exact_mut(dense::stride(front.rows)).zip(start.windows(2)) {
            for entry in &entry[start[0]..start[1]] {
                column[entry.row as usize] += self.values[entry.source as usize];
            }
        }
    }
}

/// Calls `work` for each factor of a front, with its index and its part of `numbers`, which are the columns or the
/// update of the front.
fn for_each_factor(front: &Front, numbers: &mut [f64], mut work: impl FnMut(usize, &mut [f64])) {
    let len = numbers.len() / front.factors;
    if len > 0 {
        numbers.chunks_exact_mut(len).enumerate().for_each(|(factor, numbers)| work(factor, numbers));
    }
}

/// Cuts these pieces out of a slice whose first value has index `origin`.
fn cut(slice: &mut [f64], origin: usize, pieces: impl Iterator<Item = Range<usize>>) -> Vec<&mut [f64]> {
    let (mut rest, mut at) = (slice, origin);
    let piece = |piece: Range<usize>| {
        let (_, after) = std::mem::take(&mut rest).split_at_mut(piece.start - at);
        let (own, after) = after.split_at_mut(piece.len());
        (rest, at) = (after, piece.end);
        own
    };
    pieces.map(piece).collect()
}

/// Calls `work` for all columns at once or for each of several pieces, with the index of the first column and the
/// values.
fn for_each_column(
    numbers: &mut [f64],
    stride: usize,
    columns: usize,
    work: impl Fn(usize, &mut [f64]) + Sync,
) {
    if columns == 0 {
        return;
    }
    let numbers = &mut numbers[..stride * columns];
    if numbers.len() < SHARED {
        work(0, numbers);
    } else {
        let pieces = numbers.par_chunks_mut(COLUMNS * stride).enumerate();
        pieces.for_each(|(piece, numbers)| work(piece * COLUMNS, numbers));
    }
}

/// The updates of the children of a front, in the working space before and after its own update.
#[derive(Clone, Copy)]
struct Passed<'a> {
    fronts: &'a Fronts,
    front: &'a Front,
    before: &'a [f64],
    after: &'a [f64],
}

impl Passed<'_> {
    /// The update of a child for one factor.
    fn update(&self, child: &Front, factor: usize) -> &[f64] {
        let len = child.update_len();
        let update = if child.passed < self.front.update {
            &self.before[child.passed..child.passed + len]
        } else {
            let place = child.passed - self.front.update - self.front.update_len();
            &self.after[place..place + len]
        };
        &update[factor * len / child.factors..(factor + 1) * len / child.factors]
    }

    /// Adds the updates to the columns of a factor, starting with column `first`; the first value of each column is in
    /// row `offset` of the front.
    fn add(&self, factor: usize, first: usize, offset: usize, columns: &mut [f64]) {
        let stride = dense::stride(self.front.rows - offset);
        let end = first + columns.len() / stride;
        for &child in &self.fronts.children[self.front.children.clone()] {
            let child = &self.fronts.front[child as usize];
            let border = child.border_len();
            let height = dense::stride(border);
            let rows = &self.fronts.relative[child.border..child.border + border];
            let update = self.update(child, factor);
            let begin = rows.partition_point(|&row| (row as usize) < first);
            for (c, &column) in rows.iter().enumerate().skip(begin) {
                if column as usize >= end {
                    break;
                }
                let source = &update[c * height + c..c * height + border];
                let target = &mut columns[(column as usize - first) * stride..][..stride];
                add_rows(source, &rows[c..], offset, target);
            }
        }
    }
}

/// Adds values to these rows (ascending, at least one); the first value of the target is in row `offset`.
pub(super) fn add_rows(source: &[f64], rows: &[u32], offset: usize, target: &mut [f64]) {
    let (first, last) = (rows[0] as usize, rows[rows.len() - 1] as usize);
    if last - first + 1 == rows.len() {
        for (target, source) in target[first - offset..].iter_mut().zip(source) {
            *target += source;
        }
    } else {
        for (source, &row) in source.iter().zip(rows) {
            target[row as usize - offset] += source;
        }
    }
}
