//! The division of the points between ranks: each rank keeps the points in its part of the grid.
//!
//! The grid is cut in two across the axis along which the points extend farthest, each part is cut in two, and so on
//! (recursive coordinate bisection; Berger and Bokhari 1987), so that parts are compact and have planar boundaries. The
//! cells of a patch stay together. Points that leave their part move to the rank of the part that they enter; new parts
//! are chosen when one of them holds too many points.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Points;
use crate::grid::Grid;
use crate::ranks::Ranks;

/// New parts are chosen when one part holds more points than this multiple of the mean, [-].
pub const MAX_IMBALANCE: f64 = 1.1;
/// If a choice leaves a larger imbalance, new parts are chosen only once the imbalance has grown by this factor, [-].
const WORSE: f64 = 1.05;
/// Number of bits of a cell coordinate.
const BITS: u32 = 20;

/// The parts of the grid.
#[derive(Debug, Clone, Default)]
pub struct Partition {
    /// For each rank but the first, the cut between its part and the parts of the ranks before it.
    cuts: Vec<Cut>,
    /// For each patch of cells, one of its cells; empty without patches.
    first_in_patch: Arc<Vec<u32>>,
    /// The imbalance that remained after the latest choice, [-].
    least: f64,
}

/// A cut through the cells of a range of ranks: the cells from `place` onwards belong to the upper ranks.
#[derive(Debug, Clone, Copy, Default)]
struct Cut {
    /// The axis that the cut crosses.
    axis: usize,
    place: u64,
}

/// The points of a cell.
#[derive(Debug, Clone, Copy)]
struct Occupied<const D: usize> {
    at: [u32; D],
    count: f64,
    /// The part to which these points belong while parts are being chosen.
    part: usize,
}

/// The place of a cell in an order along an axis; cells with the same coordinate along the axis are ordered by their
/// other coordinates, so that a cut divides the points equally to within the points of one cell.
fn along<const D: usize>(at: [u32; D], axis: usize) -> u64 {
    (0..D).fold(0, |place, k| place << BITS | u64::from(at[(axis + k) % D]))
}

/// The first of the upper ranks when a range of ranks is divided: the number of lower ranks is a power of two, so that
/// neighbours in a binary tree of the ranks are neighbours in the grid.
fn middle(ranks: &Range<usize>) -> usize {
    ranks.start + (ranks.len() as u64).next_power_of_two() as usize / 2
}

/// The division of points between ranks by their permanent numbers, into ranges of equal length.
#[derive(Debug, Clone, Copy)]
pub struct ByNumber {
    /// One more than the highest number.
    end: u64,
    ranks: u64,
}

impl ByNumber {
    /// The rank to which a number belongs.
    pub fn rank_of(&self, id: u32) -> usize {
        (u64::from(id) * self.ranks / self.end).min(self.ranks - 1) as usize
    }
}

impl Partition {
    /// The rank whose part contains a cell.
    pub fn rank_of<const D: usize>(&self, grid: &dyn Grid<D>, cell: u32) -> usize {
        let at = self.at(grid, cell);
        let mut ranks = 0..self.cuts.len() + 1;
        while ranks.len() > 1 {
            let middle = middle(&ranks);
            let Cut { axis, place } = self.cuts[middle - 1];
            ranks = if along(at, axis) < place { ranks.start..middle } else { middle..ranks.end };
        }
        ranks.start
    }

    /// The coordinates of a cell or, if it belongs to a patch, of the same cell of the patch for all of them.
    fn at<const D: usize>(&self, grid: &dyn Grid<D>, cell: u32) -> [u32; D] {
        let first_in_patch = grid.patches().and_then(|patches| {
            let patch = *patches.patch_of.get(cell as usize)?;
            self.first_in_patch.get(patch as usize)
        });
        let cell = first_in_patch.copied().unwrap_or(cell) as usize;
        grid.cell_lattice(cell, BITS)
    }

    /// Chooses parts whose numbers of points are as equal as the cells allow, given the points of this rank.
    #[inline(never)]
    fn choose<const D: usize>(&mut self, ranks: &Ranks, mut occupied: Vec<Occupied<D>>) {
        let n = ranks.count();
        self.cuts = vec![Cut::default(); n - 1];
        occupied.iter_mut().for_each(|cell| cell.part = 0);
        // The ranks of each part.
        let mut parts: Vec<Range<usize>> = std::iter::once(0..n).collect();
        while parts.iter().any(|part| part.len() > 1) {
            let axes = longest_sides(ranks, &occupied, parts.len());
            occupied.sort_unstable_by_key(|cell| (cell.part, along(cell.at, axes[cell.part])));
            let places = places_of_cuts(ranks, &occupied, &parts, &axes);
            for cell in &mut occupied {
                let is_above =
                    parts[cell.part].len() > 1 && along(cell.at, axes[cell.part]) >= places[cell.part];
                cell.part = 2 * cell.part + usize::from(is_above);
            }
            let mut halves = Vec::with_capacity(2 * parts.len());
            for ((part, axis), place) in parts.into_iter().zip(axes).zip(places) {
                let middle = if part.len() > 1 { middle(&part) } else { part.end };
                if part.len() > 1 {
                    self.cuts[middle - 1] = Cut { axis, place };
                }
                halves.extend([part.start..middle, middle..part.end]);
            }
            parts = halves;
        }
    }
}

/// For each part, the axis along which its points extend farthest. In a tie, the last of these axes: bodies are filled
/// along the first axes first, so most points are then created on the rank where they stay.
fn longest_sides<const D: usize>(ranks: &Ranks, occupied: &[Occupied<D>], parts: usize) -> Vec<usize> {
    let mut ends = vec![f64::NEG_INFINITY; 2 * D * parts];
    for cell in occupied {
        for (d, ends) in ends[2 * D * cell.part..].chunks_exact_mut(2).take(D).enumerate() {
            let x = f64::from(cell.at[d]);
            (ends[0], ends[1]) = (ends[0].max(x), ends[1].max(-x));
        }
    }
    ranks.maximum(&mut ends);
    let longest = |ends: &[f64]| {
        let side = |d: usize| ends[2 * d] + ends[2 * d + 1];
        (0..D).max_by(|a, b| side(*a).total_cmp(&side(*b))).unwrap_or(0)
    };
    ends.chunks_exact(2 * D).map(longest).collect()
}

/// For each part, the lowest place of a cut below which its lower ranks get their share of the points, found by
/// bisection. The points are sorted by part and place.
fn places_of_cuts<const D: usize>(
    ranks: &Ranks,
    occupied: &[Occupied<D>],
    parts: &[Range<usize>],
    axes: &[usize],
) -> Vec<u64> {
    let mut below = vec![0.0];
    below.extend(occupied.iter().scan(0.0, |sum, cell| {
        *sum += cell.count;
        Some(*sum)
    }));
    let start = |part: usize| occupied.partition_point(|cell| cell.part < part);
    let ranges: Vec<Range<usize>> = (0..parts.len()).map(|part| start(part)..start(part + 1)).collect();
    let counts = |places: &[u64]| -> Vec<f64> {
        let below_cut = |((range, axis), place): ((&Range<usize>, &usize), &u64)| {
            let within = &occupied[range.clone()];
            let end = range.start + within.partition_point(|cell| along(cell.at, *axis) < *place);
            below[end] - below[range.start]
        };
        let mut counts: Vec<f64> = ranges.iter().zip(axes).zip(places).map(below_cut).collect();
        ranks.sum(&mut counts);
        counts
    };
    let (mut low, mut high) = (vec![0u64; parts.len()], vec![1u64 << (D as u32 * BITS); parts.len()]);
    let wanted: Vec<f64> = (counts(&high).iter().zip(parts))
        .map(|(all, part)| (all * (middle(part) - part.start) as f64 / part.len().max(1) as f64).floor())
        .collect();
    while low.iter().zip(&high).any(|(low, high)| low < high) {
        let halves: Vec<u64> = low.iter().zip(&high).map(|(low, high)| low + (high - low) / 2).collect();
        for (k, count) in counts(&halves).into_iter().enumerate() {
            if count >= wanted[k] {
                high[k] = halves[k];
            } else {
                low[k] = (halves[k] + 1).min(high[k]);
            }
        }
    }
    low
}

/// Points that are being sent to another rank.
#[derive(Serialize, Deserialize)]
struct Packed {
    id: Vec<u32>,
    cell: Vec<u32>,
    fields: Vec<Vec<f64>>,
    further: Vec<Vec<f64>>,
}

impl<const D: usize> Points<D> {
    /// Divides the points between the ranks by the cells that hold them, regardless of the ranks that created the
    /// points.
    pub fn divide_by_cell(&mut self, grid: &dyn Grid<D>) {
        if self.ranks.is_alone() {
            return;
        }
        let mut first_in_patch = Vec::new();
        if let Some(patches) = grid.patches() {
            let count = patches.patch_of.iter().max().map_or(0, |last| *last as usize + 1);
            first_in_patch = vec![0; count];
            for (cell, patch) in patches.patch_of.iter().enumerate().rev() {
                first_in_patch[*patch as usize] = cell as u32;
            }
        }
        self.partition = Partition { first_in_patch: Arc::new(first_in_patch), ..Partition::default() };
        for p in 0..self.len() {
            self.cell[p] = cell_of(grid, &self.converged.position[p], self.cell[p]);
        }
        let ranks = self.ranks.clone();
        let occupied = self.occupied(grid);
        self.partition.choose(&ranks, occupied);
        self.migrate(grid);
    }

    /// Sends points that have left the part of this rank to the ranks of the cells that now hold them; chooses new
    /// parts if one part holds too many points.
    #[inline(never)]
    pub(super) fn migrate(&mut self, grid: &dyn Grid<D>) {
        if self.ranks.is_alone() {
            return;
        }
        let ranks = self.ranks.clone();
        let n = ranks.count();
        let owners = |points: &Self| points.by_cell(|cell| points.partition.rank_of(grid, cell));
        let mut to = owners(self);
        let imbalance = |to: &[usize]| {
            let mut counts = vec![0.0; n];
            to.iter().for_each(|rank| counts[*rank] += 1.0);
            ranks.sum(&mut counts);
            let all: f64 = counts.iter().sum();
            n as f64 * counts.iter().copied().fold(0.0, f64::max) / all.max(1.0)
        };
        if imbalance(&to) > MAX_IMBALANCE.max(WORSE * self.partition.least) {
            let occupied = self.occupied(grid);
            self.partition.choose(&ranks, occupied);
            to = owners(self);
            self.partition.least = imbalance(&to);
        }
        self.send(&to);
    }

    /// Divides the points between the ranks by their permanent numbers, until they are next grouped by cells.
    pub fn divide_by_number(&mut self) -> ByNumber {
        let last = self.id.iter().max().map_or(0.0, |id| f64::from(*id));
        let end = self.ranks.largest(last) as u64 + 1;
        let division = ByNumber { end, ranks: self.ranks.count() as u64 };
        let to: Vec<usize> = self.id.iter().map(|id| division.rank_of(*id)).collect();
        self.send(&to);
        division
    }

    /// Sends each point to the rank that `to` lists for its index.
    fn send(&mut self, to: &[usize]) {
        let ranks = self.ranks.clone();
        if !ranks.any(to.iter().any(|rank| *rank != ranks.own())) {
            return;
        }
        let mut places: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for (p, rank) in to.iter().enumerate() {
            places.entry(*rank).or_default().push(p as u32);
        }
        let staying = places.remove(&ranks.own()).unwrap_or_default();
        let messages = places.iter().map(|(rank, leaving)| (*rank, self.packed(leaving))).collect();
        if staying.len() < self.len() {
            self.select(&staying);
        }
        let arrived = ranks.communicator().map_or_else(Vec::new, |ranks| ranks.exchange(messages));
        for (_, message) in arrived {
            self.unpack(&message);
        }
    }

    /// The points of this rank, counted by cell; points of a cell mostly follow one another.
    fn occupied(&self, grid: &dyn Grid<D>) -> Vec<Occupied<D>> {
        let by_cell = self.cell.chunk_by(|a, b| a == b);
        let count = |cells: &[u32]| {
            let at = self.partition.at(grid, cells[0]);
            Occupied { at, count: cells.len() as f64, part: 0 }
        };
        by_cell.map(count).collect()
    }

    /// The value that `value` returns for the cell of each point; points of a cell mostly follow one another.
    fn by_cell<T: Copy>(&self, value: impl Fn(u32) -> T) -> Vec<T> {
        let mut last: Option<(u32, T)> = None;
        let mut at = |cell: u32| match last {
            Some((same, known)) if same == cell => known,
            _ => {
                let found = value(cell);
                last = Some((cell, found));
                found
            }
        };
        self.cell.iter().map(|cell| at(*cell)).collect()
    }

    /// The points with these indices as bytes.
    fn packed(&self, places: &[u32]) -> Vec<u8> {
        let numbers = |numbers: &[u32]| places.iter().map(|p| numbers[*p as usize]).collect();
        let further = (self.further.iter())
            .map(|(handle, field)| {
                let (values, n) = (self.further.converged(handle), field.components);
                places.iter().flat_map(|p| &values[*p as usize * n..][..n]).copied().collect()
            })
            .collect();
        let packed = Packed {
            id: numbers(&self.id),
            cell: numbers(&self.cell),
            fields: self.numbers_of_fields(places),
            further,
        };
        postcard::to_stdvec(&packed).unwrap_or_default()
    }

    /// Appends the points of a message.
    fn unpack(&mut self, message: &[u8]) {
        let Ok(Packed { id, cell, fields, further }) = postcard::from_bytes(message) else { return };
        let mut others = self.none();
        (others.id, others.cell) = (id, cell);
        others.take_fields(&fields);
        others.further.take(further, others.id.len());
        self.append(&others);
    }

    /// All points of the analysis on rank 0, in rank order; `None` on the other ranks, or if there is only one rank.
    #[inline(never)]
    pub fn gather(&self) -> Option<Points<D>> {
        let communicator = self.ranks.communicator()?;
        let own: Vec<u32> = (0..self.len() as u32).collect();
        let mut points = self.ranks.is_root().then(|| Points { ranks: Ranks::default(), ..self.clone() });
        // One rank after the other, so that memory holds only one message at a time.
        for rank in 1..self.ranks.count() {
            let is_ours = rank == self.ranks.own();
            let message = if is_ours { vec![(0, self.packed(&own))] } else { Vec::new() };
            for (_, message) in communicator.exchange(message) {
                points.iter_mut().for_each(|points| points.unpack(&message));
            }
        }
        points
    }

    /// The same fields without points.
    fn none(&self) -> Points<D> {
        let mut none = self.with_counts();
        none.further = self.further.emptied();
        none
    }
}

/// The cell that contains a position or is nearest to it.
fn cell_of<const D: usize>(grid: &dyn Grid<D>, position: &[f64; D], hint: u32) -> u32 {
    grid.locate(position, Some(hint)).unwrap_or_else(|| grid.nearest_cell(position))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Structured;
    use crate::points::{FieldKind, PointFieldSpec, Seed};
    use crate::ranks::threads;

    /// A square of points around the origin, each with a history variable and every other one with four corners; each
    /// rank creates a share of the points.
    fn square(n: usize, ranks: &Ranks) -> Points<2> {
        let own = ranks.share(n * n);
        let seeds: Vec<Seed<2>> = (own.clone())
            .map(|k| {
                let position = [k % n, k / n].map(|i| 2.0 * (i as f64 + 0.5) / n as f64 - 1.0);
                Seed {
                    body: (k % 3) as u16,
                    position,
                    half_lengths: [0.0; 2],
                    corners: vec![position; k % 2 * 4],
                    volume: 1.0 + k as f64,
                    mass: k as f64,
                    outer_layer: k % 5 == 0,
                    history: vec![k as f64],
                }
            })
            .collect();
        let mut points = Points::numbered(&seeds, own.clone().map(|k| k as u32).collect(), ranks);
        let spec = PointFieldSpec {
            name: "further".to_owned(),
            unit: "-".to_owned(),
            kind: FieldKind::Answer,
            components: 1,
            start: own.map(|k| 0.5 * k as f64).collect(),
        };
        points.declare(spec).unwrap();
        points
    }

    /// Asserts that the points of a rank have kept all their data.
    fn are_whole(points: &Points<2>) {
        let handle = points.further.handle("further").unwrap();
        for (p, &id) in points.id.iter().enumerate() {
            let k = f64::from(id);
            assert_eq!((points.mass[p], points.original_volume[p]), (k, 1.0 + k));
            assert_eq!((points.converged.history[p], points.further.converged(handle)[p]), (k, 0.5 * k));
            assert_eq!((points.body[p], points.outer_layer[p]), ((id % 3) as u16, id % 5 == 0));
            assert_eq!(points.corners(p).len(), (id % 2 * 4) as usize);
        }
    }

    /// A body makes a quarter turn in each step, so that on four ranks all points leave their rank: none is lost or
    /// duplicated. `MIGRATING=1000` turns a million points.
    #[test]
    fn points_that_turn_migrate_without_loss() {
        let n: usize = std::env::var("MIGRATING").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
        let grid = Structured::<2>::new([-2.0; 2], [0.125; 2], [32, 32]);
        for count in [2, 4] {
            let left = threads::run(count, |ranks| {
                let mut points = square(n, &ranks);
                points.divide_by_cell(&grid);
                let mut left = 0;
                for _ in 0..4 {
                    let before = points.id.clone();
                    for x in &mut points.converged.position {
                        *x = [-x[1], x[0]];
                    }
                    points.group_by_cell(&grid, &[]).unwrap();
                    are_whole(&points);
                    let own = ranks.own();
                    assert!(points.cell.iter().all(|cell| points.partition.rank_of(&grid, *cell) == own));
                    let here: std::collections::HashSet<u32> = points.id.iter().copied().collect();
                    left += before.iter().filter(|id| !here.contains(id)).count();
                    let mut all = ranks.gather_all(points.id.clone()).concat();
                    all.sort_unstable();
                    assert!(all.into_iter().eq(0..(n * n) as u32));
                    let most = ranks.largest(points.len() as f64) * count as f64 / (n * n) as f64;
                    assert!(most <= MAX_IMBALANCE, "{most}");
                }
                let gathered = points.gather();
                assert_eq!(gathered.as_ref().map(Points::len), ranks.is_root().then_some(n * n));
                gathered.iter().for_each(are_whole);
                left
            });
            // A quarter turn takes each quadrant to another, and half of each half to the other half.
            let all: usize = left.iter().sum();
            assert_eq!(all, if count == 4 { 4 * n * n } else { 2 * n * n }, "{left:?}");
        }
    }

    #[test]
    fn points_added_later_join_the_ranks_of_their_cells() {
        let grid = Structured::<2>::new([-2.0; 2], [0.125; 2], [32, 32]);
        let lengths = threads::run(3, |ranks| {
            let mut points = square(20, &ranks);
            points.divide_by_cell(&grid);
            let before = points.len();
            points.append(&square(10, &ranks));
            points.group_by_cell(&grid, &[]).unwrap();
            are_whole(&points);
            let own = ranks.own();
            assert!(points.cell.iter().all(|cell| points.partition.rank_of(&grid, *cell) == own));
            (before, points.len())
        });
        assert_eq!(lengths.iter().map(|(before, _)| before).sum::<usize>(), 400);
        assert_eq!(lengths.iter().map(|(_, after)| after).sum::<usize>(), 500);
    }
}
