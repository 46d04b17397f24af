//! A matrix with a block for each coupled pair of grid nodes, and its product with a vector.

use std::ops::Range;

use pulp::Arch;

/// The block of a pair of nodes, `[i][k]`: row component i, column component k.
pub type Block<const N: usize> = [[f64; N]; N];

/// Smallest number of columns in a task, except the last task.
const COLUMNS: usize = 2048;

/// Largest number of rows in a sum that is not divided further.
const ROWS: usize = 1024;

/// A square matrix of N×N blocks, stored by columns as assembled; a symmetric matrix has only the blocks with row ≥
/// column.
#[derive(Debug, Clone, Copy)]
pub struct BlockMatrix<'a, const N: usize> {
    /// True if only the lower triangle is given.
    pub symmetric: bool,
    /// Start of each column in `row` and `blocks`; one entry more than there are columns.
    pub column_start: &'a [usize],
    /// Row of each block, ascending within a column.
    pub row: &'a [u32],
    /// The blocks.
    pub blocks: &'a [Block<N>],
}

/// A fixed division of the columns of a matrix into tasks, each with its own working space, so that a product is the
/// same to the last bit for any number of threads.
#[derive(Debug, Clone, Default)]
pub struct Division<const N: usize> {
    tasks: Vec<Task>,
    room: Vec<[f64; N]>,
}

/// A range of consecutive columns and the rows that they reach.
#[derive(Debug, Clone)]
struct Task {
    columns: Range<usize>,
    rows: Range<usize>,
    /// Start of its rows in the common working space of all tasks.
    place: usize,
}

impl<const N: usize> Division<N> {
    /// A division of a matrix with these columns.
    pub fn new(column_start: &[usize], row: &[u32]) -> Self {
        let n = column_start.len().saturating_sub(1);
        let rows_of = |c: usize| &row[column_start[c]..column_start[c + 1]];
        let reach = |c: usize| rows_of(c).last().map_or(0, |&r| (r as usize).saturating_sub(c));
        // The working spaces are cheap to sum if they overlap little.
        let size = COLUMNS.max(2 * (0..n).map(reach).max().unwrap_or(0));
        let mut tasks = Vec::new();
        let mut place = 0;
        for first in (0..n).step_by(size) {
            let columns = first..(first + size).min(n);
            let mut rows = columns.clone();
            for c in columns.clone() {
                if let [low, ..] = *rows_of(c) {
                    rows.start = rows.start.min(low as usize);
                }
                rows.end = rows.end.max(c + reach(c) + 1);
            }
            let length = rows.len();
            tasks.push(Task { columns, rows, place });
            place += length;
        }
        Division { tasks, room: vec![[0.0; N]; place] }
    }
}

impl<const N: usize> BlockMatrix<'_, N> {
    /// Visits all blocks by columns: row, column, and index of the block.
    pub fn for_each(&self, mut visit: impl FnMut(usize, usize, usize)) {
        for column in 0..self.column_start.len() - 1 {
            for place in self.column_start[column]..self.column_start[column + 1] {
                visit(self.row[place] as usize, column, place);
            }
        }
    }

    /// Largest distance along each axis between two coupled nodes, given their integer coordinates.
    pub fn reach<const D: usize>(&self, lattice: impl Fn(usize) -> [u32; D]) -> [u32; D] {
        let mut reach = [0; D];
        self.for_each(|row, column, _| {
            let (a, b) = (lattice(row), lattice(column));
            for d in 0..D {
                reach[d] = reach[d].max(a[d].abs_diff(b[d]));
            }
        });
        reach
    }

    /// `out = A x`; `division` is the division of this pattern.
    pub fn multiply(&self, division: &mut Division<N>, x: &[[f64; N]], out: &mut [[f64; N]]) {
        let Division { tasks, room } = division;
        self.run(tasks, x, room);
        collect(tasks, room, 0, out);
    }

    fn run(&self, tasks: &[Task], x: &[[f64; N]], room: &mut [[f64; N]]) {
        match tasks {
            [] => {}
            [task] => Arch::new().dispatch(
                #[inline(always)]
                || self.add_columns(task, x, room),
            ),
            _ => {
                let (left, right) = tasks.split_at(tasks.len() / 2);
                let (room_l, room_r) = room.split_at_mut(right[0].place - left[0].place);
                rayon::join(|| self.run(left, x, room_l), || self.run(right, x, room_r));
            }
        }
    }

    #[inline(always)]
    fn add_columns(&self, task: &Task, x: &[[f64; N]], room: &mut [[f64; N]]) {
        room.fill([0.0; N]);
        let first = task.rows.start;
        for c in task.columns.clone() {
            let here = &x[c];
            let mut own = [0.0; N];
            let places = self.column_start[c]..self.column_start[c + 1];
            for (&row, block) in self.row[places.clone()].iter().zip(&self.blocks[places]) {
                let row = row as usize;
                let sum = &mut room[row - first];
                for i in 0..N {
                    let mut force = 0.0;
                    for k in 0..N {
                        force += block[i][k] * here[k];
                    }
                    sum[i] += force;
                }
                if self.symmetric && row != c {
                    let there = &x[row];
                    for k in 0..N {
                        let mut force = 0.0;
                        for i in 0..N {
                            force += block[i][k] * there[i];
                        }
                        own[k] += force;
                    }
                }
            }
            for k in 0..N {
                room[c - first][k] += own[k];
            }
        }
    }
}

/// Sums the working spaces of all tasks, in task order, into the rows of `out`, which start at row `first`.
fn collect<const N: usize>(tasks: &[Task], room: &[[f64; N]], first: usize, out: &mut [[f64; N]]) {
    if out.len() > ROWS {
        let middle = out.len() / 2;
        let (left, right) = out.split_at_mut(middle);
        rayon::join(|| collect(tasks, room, first, left), || collect(tasks, room, first + middle, right));
        return;
    }
    out.fill([0.0; N]);
    for task in tasks {
        let low = task.rows.start.max(first);
        let high = task.rows.end.min(first + out.len());
        for row in low..high {
            let part = &room[task.place + row - task.rows.start];
            for d in 0..N {
                out[row - first][d] += part[d];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the product of a banded matrix of several tasks, given once by its lower triangle and once in full,
    /// with a plain sum.
    #[test]
    fn products_agree_with_a_plain_sum() {
        let n = 3 * COLUMNS + 17;
        let entry = |r: usize, c: usize| {
            let (a, b) = (r.max(c) as f64, r.min(c) as f64);
            let off = 0.1 * (a - b);
            let block = [[2.0 + (a * 0.7).sin(), off], [(b * 0.3).cos(), 1.0 - off]];
            // A block above the diagonal is the transpose of its mirror image.
            if r >= c { block } else { [[block[0][0], block[1][0]], [block[0][1], block[1][1]]] }
        };
        let x: Vec<[f64; 2]> = (0..n).map(|i| [(i as f64).sin(), (i as f64).cos()]).collect();
        let mut plain = vec![[0.0; 2]; n];
        for symmetric in [true, false] {
            let (mut column_start, mut row, mut blocks) = (vec![0], Vec::new(), Vec::new());
            plain.fill([0.0; 2]);
            for c in 0..n {
                for r in c.saturating_sub(40)..(c + 41).min(n) {
                    if (r + c) % 3 == 1 && r != c {
                        continue;
                    }
                    let mut block = entry(r, c);
                    if r == c {
                        block[0][1] = block[1][0];
                    }
                    for i in 0..2 {
                        for k in 0..2 {
                            plain[r][i] += block[i][k] * x[c][k];
                        }
                    }
                    if r >= c || !symmetric {
                        row.push(r as u32);
                        blocks.push(block);
                    }
                }
                column_start.push(row.len());
            }
            let matrix = BlockMatrix { symmetric, column_start: &column_start, row: &row, blocks: &blocks };
            let mut division = Division::new(&column_start, &row);
            assert!(division.tasks.len() > 2);
            let mut out = vec![[f64::NAN; 2]; n];
            matrix.multiply(&mut division, &x, &mut out);
            for (a, b) in out.iter().flatten().zip(plain.iter().flatten()) {
                assert!((a - b).abs() < 1e-12, "{a} {b}");
            }
        }
    }
}
