//! A uniform lattice of bins over boxes in the plane: which boxes may hold a position.

use std::ops::RangeInclusive;

/// Lower and upper corner.
pub(super) type Bounds = [[f64; 2]; 2];

/// The smallest box that holds all positions.
pub(super) fn bounds(positions: impl Iterator<Item = [f64; 2]>) -> Bounds {
    positions.fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[lower, upper], x| {
        [[lower[0].min(x[0]), lower[1].min(x[1])], [upper[0].max(x[0]), upper[1].max(x[1])]]
    })
}

/// Bins and the boxes that meet each of them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Bins {
    lower: [f64; 2],
    spacing: [f64; 2],
    counts: [usize; 2],
    start: Vec<usize>,
    items: Vec<u32>,
}

impl Bins {
    /// Sorts boxes into bins: about as many bins as boxes, fewer when boxes are so large that their entries would
    /// be more than a small multiple of their number.
    pub(super) fn new(boxes: &[Bounds]) -> Self {
        let [lower, upper] = bounds(boxes.iter().flatten().copied());
        let sides = [upper[0] - lower[0], upper[1] - lower[1]];
        let mut n = boxes.len().max(1);
        loop {
            let mut bins = Bins { lower, ..Bins::default() };
            bins.divide(sides, n);
            let entries: usize = boxes.iter().map(|b| bins.number_met(b)).sum();
            if n == 1 || entries <= 16 * boxes.len() {
                bins.fill(boxes);
                return bins;
            }
            n = (n / 4).max(1);
        }
    }

    /// Lays about `n` bins over a box, as close to squares as their number allows.
    fn divide(&mut self, sides: [f64; 2], n: usize) {
        // The ratio comes first: the sides may be as large as numbers get.
        let along = (sides[0] / sides[1] * n as f64).sqrt().clamp(1.0, n as f64) as usize;
        self.counts = [along.max(1), (n / along.max(1)).max(1)];
        self.spacing = std::array::from_fn(|d| sides[d] / self.counts[d] as f64);
    }

    fn fill(&mut self, boxes: &[Bounds]) {
        let n_bins = self.counts[0] * self.counts[1];
        let mut next = vec![0; n_bins + 1];
        for b in boxes {
            for bin in self.met(b) {
                next[bin + 1] += 1;
            }
        }
        for bin in 0..n_bins {
            next[bin + 1] += next[bin];
        }
        self.start = next.clone();
        self.items = vec![0; next[n_bins]];
        for (b, item) in boxes.iter().zip(0..) {
            for bin in self.met(b) {
                self.items[next[bin]] = item;
                next[bin] += 1;
            }
        }
    }

    /// Index of the bin of a coordinate, of the nearest one for positions outside. It never decreases along the
    /// axis, so a position in a box is in one of the bins that the box meets, whatever the round-off.
    fn index(&self, axis: usize, x: f64) -> usize {
        let bin = (x - self.lower[axis]) / self.spacing[axis];
        (bin as usize).min(self.counts[axis] - 1)
    }

    fn ranges(&self, [lower, upper]: &Bounds) -> [RangeInclusive<usize>; 2] {
        std::array::from_fn(|d| self.index(d, lower[d])..=self.index(d, upper[d]))
    }

    fn number_met(&self, bounds: &Bounds) -> usize {
        self.ranges(bounds).map(|range| range.count()).iter().product()
    }

    /// The bins that a box meets.
    fn met(&self, bounds: &Bounds) -> impl Iterator<Item = usize> + use<> {
        let ([columns, rows], stride) = (self.ranges(bounds), self.counts[0]);
        rows.flat_map(move |row| columns.clone().map(move |column| row * stride + column))
    }

    fn items(&self, column: usize, row: usize) -> &[u32] {
        let bin = row * self.counts[0] + column;
        &self.items[self.start[bin]..self.start[bin + 1]]
    }

    /// The boxes that may hold a position, ascending; for positions outside, those that meet the nearest bin.
    pub(super) fn at(&self, x: &[f64; 2]) -> &[u32] {
        self.items(self.index(0, x[0]), self.index(1, x[1]))
    }

    /// Visits boxes from near to far, by rings of bins around a position. After each ring, `visit` gets its boxes
    /// (some of them repeatedly) and the square of a distance that those still to come are at least away; it says
    /// whether to go on.
    pub(super) fn outwards(&self, x: &[f64; 2], mut visit: impl FnMut(&[u32], f64) -> bool) {
        let centre: [usize; 2] = std::array::from_fn(|d| self.index(d, x[d]));
        let step = self.spacing[0].min(self.spacing[1]);
        let last: usize = (0..2).map(|d| centre[d].max(self.counts[d] - 1 - centre[d])).max().unwrap_or(0);
        // The way to the lattice is at an angle of 90° or more with any way on from there, so squares add up.
        let outside: f64 = (0..2)
            .map(|d| {
                let upper = self.lower[d] + self.spacing[d] * self.counts[d] as f64;
                (x[d] - x[d].clamp(self.lower[d], upper.max(self.lower[d]))).powi(2)
            })
            .sum();
        let mut found = Vec::new();
        for ring in 0..=last {
            found.clear();
            let range = |d: usize| {
                centre[d].saturating_sub(ring)..=centre[d].saturating_add(ring).min(self.counts[d] - 1)
            };
            for row in range(1) {
                // Rows inside the ring contribute their two ends only.
                let whole = row.abs_diff(centre[1]) == ring;
                let ends = [centre[0].checked_sub(ring), Some(centre[0] + ring)];
                if whole {
                    range(0).for_each(|column| found.extend_from_slice(self.items(column, row)));
                } else {
                    let inside = |column: &usize| *column < self.counts[0];
                    for column in ends.into_iter().flatten().filter(inside) {
                        found.extend_from_slice(self.items(column, row));
                    }
                }
            }
            if !visit(&found, outside + (ring as f64 * step).powi(2)) {
                return;
            }
        }
    }
}
