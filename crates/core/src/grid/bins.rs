//! A uniform lattice of bins that finds the boxes around a position.

use std::ops::RangeInclusive;

/// Lower and upper corner of a box.
pub(super) type Bounds<const D: usize> = [[f64; D]; 2];

/// The bounding box of all positions.
pub(super) fn bounds<const D: usize>(positions: impl Iterator<Item = [f64; D]>) -> Bounds<D> {
    positions.fold([[f64::INFINITY; D], [f64::NEG_INFINITY; D]], |[lower, upper], x| {
        [std::array::from_fn(|d| lower[d].min(x[d])), std::array::from_fn(|d| upper[d].max(x[d]))]
    })
}

/// A lattice of bins; each bin lists the boxes that overlap it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bins<const D: usize> {
    lower: [f64; D],
    spacing: [f64; D],
    counts: [usize; D],
    start: Vec<usize>,
    items: Vec<u32>,
}

impl<const D: usize> Bins<D> {
    /// Sorts boxes into bins. There are about as many bins as boxes, or fewer if the boxes are so large that the number
    /// of entries would exceed a small multiple of the number of boxes.
    pub(super) fn new(boxes: &[Bounds<D>]) -> Self {
        let [lower, upper] = bounds(boxes.iter().flatten().copied());
        let sides = std::array::from_fn(|d| upper[d] - lower[d]);
        let mut n = boxes.len().max(1);
        loop {
            let mut bins = Bins::divided(lower, sides, n);
            let entries: usize = boxes.iter().map(|b| bins.number_met(b)).sum();
            if n == 1 || entries <= 4usize.pow(D as u32) * boxes.len() {
                bins.fill(boxes);
                return bins;
            }
            n = (n / 4).max(1);
        }
    }

    /// A lattice of about `n` bins over a box; bins are as close to squares (cubes) as possible.
    fn divided(lower: [f64; D], sides: [f64; D], n: usize) -> Self {
        let mut counts = [1; D];
        let mut left = n;
        for d in 0..D {
            let axes = (D - d) as f64;
            // Divide first: the product of two sides may overflow.
            let ratio: f64 = (d + 1..D).map(|e| sides[d] / sides[e]).product();
            let along = (ratio * left as f64).powf(1.0 / axes).clamp(1.0, left as f64) as usize;
            counts[d] = along.max(1);
            left = (left / counts[d]).max(1);
        }
        let spacing = std::array::from_fn(|d| sides[d] / counts[d] as f64);
        Bins { lower, spacing, counts, start: Vec::new(), items: Vec::new() }
    }

    fn fill(&mut self, boxes: &[Bounds<D>]) {
        let n_bins: usize = self.counts.iter().product();
        let mut next = vec![0; n_bins + 1];
        for b in boxes {
            self.for_each_met(b, |bin| next[bin + 1] += 1);
        }
        for bin in 0..n_bins {
            next[bin + 1] += next[bin];
        }
        self.start = next.clone();
        let mut items = vec![0; next[n_bins]];
        for (b, item) in boxes.iter().zip(0..) {
            self.for_each_met(b, |bin| {
                items[next[bin]] = item;
                next[bin] += 1;
            });
        }
        self.items = items;
    }

    /// Index of the bin at a coordinate; positions outside belong to the nearest bin. The index is monotonic, so
    /// round-off cannot place a position of a box into a bin that the box does not overlap.
    fn index(&self, axis: usize, x: f64) -> usize {
        let bin = (x - self.lower[axis]) / self.spacing[axis];
        (bin as usize).min(self.counts[axis] - 1)
    }

    fn ranges(&self, [lower, upper]: &Bounds<D>) -> [RangeInclusive<usize>; D] {
        std::array::from_fn(|d| self.index(d, lower[d])..=self.index(d, upper[d]))
    }

    fn number_met(&self, bounds: &Bounds<D>) -> usize {
        self.ranges(bounds).map(|range| range.count()).iter().product()
    }

    /// Visits the bins that a box overlaps.
    fn for_each_met(&self, bounds: &Bounds<D>, mut visit: impl FnMut(usize)) {
        let ranges = self.ranges(bounds);
        for_each_row(&ranges, |row| {
            let first = self.row(row);
            ranges[0].clone().for_each(|column| visit(first + column));
        });
    }

    /// The first bin of a row along the first axis; `index[0]` is ignored.
    fn row(&self, index: &[usize; D]) -> usize {
        (1..D).rev().fold(0, |bin, d| (bin + index[d]) * self.counts[d - 1])
    }

    fn items(&self, bin: usize) -> &[u32] {
        &self.items[self.start[bin]..self.start[bin + 1]]
    }

    /// The boxes that may contain a position, ascending; for positions outside the lattice, the boxes of the nearest
    /// bin.
    pub(super) fn at(&self, x: &[f64; D]) -> &[u32] {
        let index = std::array::from_fn(|d| self.index(d, x[d]));
        self.items(self.row(&index) + index[0])
    }

    /// Visits the boxes in every bin that the given box overlaps; a box may be visited more than once.
    pub(super) fn meeting(&self, bounds: &Bounds<D>, mut visit: impl FnMut(&[u32])) {
        self.for_each_met(bounds, |bin| visit(self.items(bin)));
    }

    /// Visits boxes in order of distance, by rings (shells) of bins around a position. After each ring, `visit`
    /// receives its boxes (possibly repeated) and a lower bound on the squared distance to all remaining boxes; the
    /// search continues while `visit` returns true.
    pub(super) fn outwards(&self, x: &[f64; D], mut visit: impl FnMut(&[u32], f64) -> bool) {
        let centre: [usize; D] = std::array::from_fn(|d| self.index(d, x[d]));
        let step = self.spacing.iter().copied().fold(f64::INFINITY, f64::min);
        let last: usize = (0..D).map(|d| centre[d].max(self.counts[d] - 1 - centre[d])).max().unwrap_or(0);
        // The angle between the vector to the nearest point of the lattice and any vector from that point into the
        // lattice is at most 90°, so squared distances add up to a lower bound.
        let outside: f64 = (0..D)
            .map(|d| {
                let upper = self.lower[d] + self.spacing[d] * self.counts[d] as f64;
                (x[d] - x[d].clamp(self.lower[d], upper.max(self.lower[d]))).powi(2)
            })
            .sum();
        let mut found = Vec::new();
        for ring in 0..=last {
            found.clear();
            let ranges: [RangeInclusive<usize>; D] = std::array::from_fn(|d| {
                centre[d].saturating_sub(ring)..=centre[d].saturating_add(ring).min(self.counts[d] - 1)
            });
            for_each_row(&ranges, |row| {
                let first = self.row(row);
                // Only the two end bins of a row inside the ring belong to the ring.
                if (1..D).any(|d| row[d].abs_diff(centre[d]) == ring) {
                    ranges[0].clone().for_each(|column| found.extend_from_slice(self.items(first + column)));
                } else {
                    let ends = [centre[0].checked_sub(ring), Some(centre[0] + ring)];
                    for column in ends.into_iter().flatten().filter(|column| *column < self.counts[0]) {
                        found.extend_from_slice(self.items(first + column));
                    }
                }
            });
            if !visit(&found, outside + (ring as f64 * step).powi(2)) {
                return;
            }
        }
    }
}

/// Visits the multi-indices in a box of ranges, with the first index fixed at the start of its range; the second axis
/// varies fastest.
fn for_each_row<const D: usize>(ranges: &[RangeInclusive<usize>; D], mut visit: impl FnMut(&[usize; D])) {
    let mut index: [usize; D] = std::array::from_fn(|d| *ranges[d].start());
    loop {
        visit(&index);
        let Some(axis) = (1..D).find(|&d| index[d] < *ranges[d].end()) else { return };
        index[axis] += 1;
        for d in 1..axis {
            index[d] = *ranges[d].start();
        }
    }
}
