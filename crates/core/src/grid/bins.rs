//! A uniform lattice of bins over boxes: which boxes may hold a position.

use std::ops::RangeInclusive;

/// Lower and upper corner.
pub(super) type Bounds<const D: usize> = [[f64; D]; 2];

/// The smallest box that holds all positions.
pub(super) fn bounds<const D: usize>(positions: impl Iterator<Item = [f64; D]>) -> Bounds<D> {
    positions.fold([[f64::INFINITY; D], [f64::NEG_INFINITY; D]], |[lower, upper], x| {
        [std::array::from_fn(|d| lower[d].min(x[d])), std::array::from_fn(|d| upper[d].max(x[d]))]
    })
}

/// Bins and the boxes that meet each of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bins<const D: usize> {
    lower: [f64; D],
    spacing: [f64; D],
    counts: [usize; D],
    start: Vec<usize>,
    items: Vec<u32>,
}

impl<const D: usize> Bins<D> {
    /// Sorts boxes into bins: about as many bins as boxes, fewer when boxes are so large that their entries would
    /// be more than a small multiple of their number.
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

    /// About `n` bins over a box, as close to squares (cubes) as their number allows.
    fn divided(lower: [f64; D], sides: [f64; D], n: usize) -> Self {
        let mut counts = [1; D];
        let mut left = n;
        for d in 0..D {
            let axes = (D - d) as f64;
            // The ratios come first: the sides may be as large as numbers get.
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

    /// Index of the bin of a coordinate, of the nearest one for positions outside. It never decreases along the
    /// axis, so a position in a box is in one of the bins that the box meets, whatever the round-off.
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

    /// The bins that a box meets.
    fn for_each_met(&self, bounds: &Bounds<D>, mut visit: impl FnMut(usize)) {
        let ranges = self.ranges(bounds);
        for_each_row(&ranges, |row| {
            let first = self.row(row);
            ranges[0].clone().for_each(|column| visit(first + column));
        });
    }

    /// The first bin of a row along the first axis; the index along that axis does not count.
    fn row(&self, index: &[usize; D]) -> usize {
        (1..D).rev().fold(0, |bin, d| (bin + index[d]) * self.counts[d - 1])
    }

    fn items(&self, bin: usize) -> &[u32] {
        &self.items[self.start[bin]..self.start[bin + 1]]
    }

    /// The boxes that may hold a position, ascending; for positions outside, those that meet the nearest bin.
    pub(super) fn at(&self, x: &[f64; D]) -> &[u32] {
        let index = std::array::from_fn(|d| self.index(d, x[d]));
        self.items(self.row(&index) + index[0])
    }

    /// Visits the boxes in every bin that a box meets, some of them repeatedly.
    pub(super) fn meeting(&self, bounds: &Bounds<D>, mut visit: impl FnMut(&[u32])) {
        self.for_each_met(bounds, |bin| visit(self.items(bin)));
    }

    /// Visits boxes from near to far, by rings (shells) of bins around a position. After each ring, `visit` gets its
    /// boxes (some of them repeatedly) and the square of a distance that those still to come are at least away; it
    /// says whether to go on.
    pub(super) fn outwards(&self, x: &[f64; D], mut visit: impl FnMut(&[u32], f64) -> bool) {
        let centre: [usize; D] = std::array::from_fn(|d| self.index(d, x[d]));
        let step = self.spacing.iter().copied().fold(f64::INFINITY, f64::min);
        let last: usize = (0..D).map(|d| centre[d].max(self.counts[d] - 1 - centre[d])).max().unwrap_or(0);
        // The way to the lattice is at an angle of 90° or more with any way on from there, so squares add up.
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
                // Rows inside the ring contribute their two ends only.
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

/// The indices in a box of ranges with the first at its start, the second axis fastest.
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
