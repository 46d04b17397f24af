//! The grid lines along one axis of a structured grid: evenly spaced, or graded by intervals.
//!
//! Positions along an axis are measured in *cell coordinates*: line i lies at i, and within a cell the cell coordinate
//! is linear in the position. Beyond each end, the cell coordinate continues with the size of the cell at that end.

use super::ON_LINE;

/// The grid lines along one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    n_cells: usize,
    lines: Lines,
}

#[derive(Debug, Clone, PartialEq)]
enum Lines {
    /// Evenly spaced lines; a position is located by arithmetic.
    Even { origin: f64, spacing: f64 },
    /// Coordinates of all lines, ascending; a position is located by bisection.
    Graded(Box<[f64]>),
}

/// Consecutive cells whose sizes form a geometric series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Coordinate at which the interval ends, [length].
    pub to: f64,
    /// Number of cells.
    pub cells: usize,
    /// Size of each cell relative to the previous cell in the direction of increasing coordinate, [-].
    pub ratio: f64,
}

/// Two successive grid lines that are not in ascending order, or are so close that the round-off of the coordinates
/// exceeds `ON_LINE` times their distance.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the grid lines {number} and {} at {at} do not ascend, or are too close for the precision of their coordinates",
    number + 1
)]
pub struct CoincidentLines {
    /// Index of the first of the two lines.
    pub number: usize,
    /// Coordinate of this line, [length].
    pub at: f64,
}

impl Axis {
    /// `n_cells` cells of equal size `spacing`, starting at the coordinate `origin`, both [length].
    pub fn even(origin: f64, spacing: f64, n_cells: usize) -> Axis {
        Axis { n_cells, lines: Lines::Even { origin, spacing } }
    }

    /// Cells between given lines, [length].
    ///
    /// # Errors
    /// [`CoincidentLines`] unless there are two or more ascending lines, far enough apart for the precision of their
    /// coordinates.
    pub fn graded(lines: Vec<f64>) -> Result<Axis, CoincidentLines> {
        if lines.len() < 2 {
            return Err(CoincidentLines { number: 0, at: lines.first().copied().unwrap_or(0.0) });
        }
        let farthest = lines.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        for (number, pair) in lines.windows(2).enumerate() {
            // Positions must be resolved to a fraction of the cell, and sizes must be positive and finite.
            let size = pair[1] - pair[0];
            if size.is_nan() || size * ON_LINE < f64::EPSILON * farthest || !(size > 0.0 && size.is_finite())
            {
                return Err(CoincidentLines { number, at: pair[0] });
            }
        }
        Ok(Axis { n_cells: lines.len() - 1, lines: Lines::Graded(lines.into()) })
    }

    /// Consecutive intervals, starting at `origin`, [length]. With the ratio r, line k of an interval of n cells and
    /// length L lies L (1 + r + … + r^(k−1)) / (1 + r + … + r^(n−1)) beyond the start of the interval.
    ///
    /// # Errors
    /// As for [`Axis::graded`]; in particular, if an interval ends before it starts.
    pub fn from_intervals(origin: f64, intervals: &[Interval]) -> Result<Axis, CoincidentLines> {
        let mut lines = vec![origin];
        let mut start = origin;
        for interval in intervals {
            let (mut size, mut sum, mut sums) = (1.0, 0.0, Vec::with_capacity(interval.cells));
            for _ in 0..interval.cells {
                sum += size;
                size *= interval.ratio;
                sums.push(sum);
            }
            sums.pop();
            lines.extend(sums.into_iter().map(|part| start + (interval.to - start) * (part / sum)));
            lines.push(interval.to);
            start = interval.to;
        }
        Axis::graded(lines)
    }

    /// The same cells, each divided into `parts` equal cells (at least one).
    pub fn subdivided(&self, parts: usize) -> Axis {
        let parts = parts.max(1);
        let n_cells = self.n_cells * parts;
        let lines = match &self.lines {
            Lines::Even { origin, spacing } => {
                Lines::Even { origin: *origin, spacing: spacing / parts as f64 }
            }
            Lines::Graded(_) => {
                let part = |k: usize| self.position((k / parts) as f64 + (k % parts) as f64 / parts as f64);
                Lines::Graded((0..=n_cells).map(part).collect())
            }
        };
        Axis { n_cells, lines }
    }

    /// The cells between two lines, of which `first` must be the lower one.
    pub fn between(&self, first: usize, last: usize) -> Axis {
        let lines = match &self.lines {
            Lines::Even { spacing, .. } => Lines::Even { origin: self.line(first), spacing: *spacing },
            Lines::Graded(lines) => Lines::Graded(lines[first..=last].into()),
        };
        Axis { n_cells: last - first, lines }
    }

    /// True if all cells have the same size by construction.
    #[inline(always)]
    pub fn is_even(&self) -> bool {
        matches!(self.lines, Lines::Even { .. })
    }

    /// Coordinates of all lines of a graded axis, [length], ascending; `None` for an even axis.
    pub fn graded_lines(&self) -> Option<&[f64]> {
        match &self.lines {
            Lines::Even { .. } => None,
            Lines::Graded(lines) => Some(lines),
        }
    }

    /// Number of cells.
    #[inline(always)]
    pub fn n_cells(&self) -> usize {
        self.n_cells
    }

    /// Coordinate of a line, [length].
    #[inline(always)]
    pub fn line(&self, number: usize) -> f64 {
        match &self.lines {
            Lines::Even { origin, spacing } => origin + spacing * number as f64,
            Lines::Graded(lines) => lines[number],
        }
    }

    /// Size of a cell, [length].
    #[inline(always)]
    pub fn size(&self, cell: usize) -> f64 {
        match &self.lines {
            Lines::Even { spacing, .. } => *spacing,
            Lines::Graded(lines) => lines[cell + 1] - lines[cell],
        }
    }

    /// Size of the cell at a position, [length]; beyond the ends, the size of the first or last cell.
    pub fn size_at(&self, x: f64) -> f64 {
        self.size(self.cell_of(self.coordinate(x)))
    }

    /// Size of the smaller of the two cells beside a line, [length].
    pub fn size_around(&self, line: usize) -> f64 {
        let last = self.n_cells - 1;
        self.size(line.saturating_sub(1).min(last)).min(self.size(line.min(last)))
    }

    /// Sizes of the smallest and the largest cell that overlap the range from `low` to `high`, [length]; if no cell
    /// does, the size of the nearest one.
    pub fn sizes_within(&self, low: f64, high: f64) -> [f64; 2] {
        match &self.lines {
            Lines::Even { spacing, .. } => [*spacing; 2],
            Lines::Graded(_) => {
                let first = self.cell_of(self.coordinate(low));
                let last = self.cell_of(self.coordinate(high).ceil() - 1.0).max(first);
                let sizes = (first..=last).map(|cell| self.size(cell));
                sizes.fold([f64::INFINITY, 0.0], |[least, most], size| [least.min(size), most.max(size)])
            }
        }
    }

    /// Size of the smallest cell that overlaps the range from `low` to `high`, [length]; see [`Axis::sizes_within`].
    pub fn smallest_within(&self, low: f64, high: f64) -> f64 {
        self.sizes_within(low, high)[0]
    }

    /// The cell at a cell coordinate; beyond the ends, the first or last cell. A line belongs to the cell above it.
    #[inline(always)]
    pub fn cell_of(&self, coordinate: f64) -> usize {
        (coordinate.max(0.0) as usize).min(self.n_cells - 1)
    }

    /// Cell coordinate of a position, [length], snapped to a line within [`ON_LINE`].
    #[inline(always)]
    pub fn coordinate(&self, x: f64) -> f64 {
        let xi = match &self.lines {
            Lines::Even { origin, spacing } => (x - origin) / spacing,
            Lines::Graded(lines) => among(lines, x),
        };
        let line = nearest_whole(xi);
        if (xi - line).abs() < ON_LINE { line } else { xi }
    }

    /// Position at a cell coordinate, [length].
    #[inline]
    pub fn position(&self, coordinate: f64) -> f64 {
        match &self.lines {
            Lines::Even { origin, spacing } => origin + coordinate * spacing,
            Lines::Graded(lines) => {
                let cell = self.cell_of(coordinate);
                let xi = coordinate - cell as f64;
                if xi == 1.0 { lines[cell + 1] } else { lines[cell] + xi * (lines[cell + 1] - lines[cell]) }
            }
        }
    }

    /// Local coordinate of a position in a cell: 0 on its lower line, 1 on its upper line, continued linearly beyond
    /// them.
    #[inline(always)]
    pub fn local(&self, cell: usize, x: f64) -> f64 {
        let coordinate = self.coordinate(x);
        match &self.lines {
            Lines::Even { .. } => coordinate - cell as f64,
            Lines::Graded(_) if self.cell_of(coordinate) == cell => coordinate - cell as f64,
            Lines::Graded(lines) => {
                (self.position(coordinate) - lines[cell]) / (lines[cell + 1] - lines[cell])
            }
        }
    }

    /// Index of the line nearest to a position, [length].
    pub fn nearest_line(&self, x: f64) -> usize {
        (self.coordinate(x).round().max(0.0) as usize).min(self.n_cells)
    }

    /// Size of a cell relative to the first one, [-]; beyond each end, cells have the size of the cell at that end.
    #[inline(always)]
    pub fn relative_size(&self, cell: i64) -> f64 {
        match &self.lines {
            Lines::Even { .. } => 1.0,
            Lines::Graded(_) => self.size(cell.clamp(0, self.n_cells as i64 - 1) as usize) / self.size(0),
        }
    }

    /// Distance between two ascending cell coordinates, relative to the size of the first cell, [-].
    #[inline(always)]
    pub fn distance(&self, from: f64, to: f64) -> f64 {
        let Lines::Graded(lines) = &self.lines else { return to - from };
        let (first, last) = (self.cell_of(from), self.cell_of(to));
        let [first_size, last_size] = [first, last].map(|cell| self.relative_size(cell as i64));
        if first == last {
            return (to - from) * first_size;
        }
        // A sum of parts, each of which is exact for short distances.
        let whole = (lines[last] - lines[first + 1]) / (lines[1] - lines[0]);
        ((first + 1) as f64 - from) * first_size + whole + (to - last as f64) * last_size
    }

    /// Range of the lines between two positions, [length], enlarged by at least one line on both sides.
    pub(super) fn lines_near(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        let n = self.n_cells;
        let line = |x: f64| match &self.lines {
            Lines::Even { origin, spacing } => ((x - origin) / spacing).clamp(-2.0, n as f64 + 2.0),
            Lines::Graded(lines) => among(lines, x).clamp(-2.0, n as f64 + 2.0),
        };
        let first = (line(low).floor() - 1.0).max(0.0) as usize;
        let last = (line(high).ceil() + 1.0).max(0.0) as usize;
        first.min(n + 1)..(last + 1).min(n + 1)
    }
}

/// Cell coordinate of a position among ascending lines. Not inlined, so that code for even axes stays small.
#[inline(never)]
fn among(lines: &[f64], x: f64) -> f64 {
    let above = lines.partition_point(|line| *line <= x);
    let cell = above.saturating_sub(1).min(lines.len() - 2);
    cell as f64 + (x - lines[cell]) / (lines[cell + 1] - lines[cell])
}

/// Rounds a number below 2⁵¹ in magnitude to the nearest integer by adding and subtracting 1.5 × 2⁵², which needs no
/// function call on older instruction sets.
#[inline]
fn nearest_whole(x: f64) -> f64 {
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 × 2⁵²
    (x + SHIFT) - SHIFT
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Four cells from 0 to 1, each half as large as the previous one, then three cells of size 2 up to 7.
    fn graded() -> Axis {
        let intervals =
            [Interval { to: 1.0, cells: 4, ratio: 0.5 }, Interval { to: 7.0, cells: 3, ratio: 1.0 }];
        Axis::from_intervals(0.0, &intervals).unwrap()
    }

    #[test]
    fn sizes_form_geometric_series() {
        let axis = graded();
        let first = 8.0 / 15.0;
        let exact = [first, first / 2.0, first / 4.0, first / 8.0, 2.0, 2.0, 2.0];
        assert_eq!(axis.n_cells(), exact.len());
        for (cell, size) in exact.iter().enumerate() {
            assert!((axis.size(cell) / size - 1.0).abs() < 1e-14, "{cell}");
        }
        assert_eq!((axis.line(0), axis.line(4), axis.line(7)), (0.0, 1.0, 7.0));
        assert_eq!((axis.size_around(4), axis.size_around(7)), (axis.size(3), 2.0));
        assert_eq!((axis.smallest_within(0.1, 0.2), axis.smallest_within(1.0, 9.0)), (axis.size(0), 2.0));
        assert_eq!(axis.sizes_within(0.6, 9.0), [axis.size(3), 2.0]);
    }

    #[test]
    fn a_position_on_a_line_belongs_to_the_cell_above_whatever_its_round_off() {
        let axis = graded();
        for line in 0..=7 {
            for noise in [-1e-10, -1e-16, 0.0, 1e-16, 1e-10] {
                let x = axis.line(line) + noise;
                assert_eq!(axis.coordinate(x), line as f64);
                assert_eq!(axis.nearest_line(x), line);
                // Local coordinates agree from both sides of a line, although the cells differ in size.
                let (below, above) = (line.saturating_sub(1), line.min(6));
                assert_eq!(axis.local(below, x), if line > 0 { 1.0 } else { 0.0 });
                assert_eq!(axis.local(above, x), if line < 7 { 0.0 } else { 1.0 });
            }
        }
        assert_eq!(axis.local(2, 7.0), (7.0 - axis.line(2)) / axis.size(2));
    }

    #[test]
    fn lines_that_do_not_ascend_are_refused() {
        for lines in [
            vec![],
            vec![1.0],
            vec![0.0, 0.0],
            vec![0.0, 2.0, 1.0],
            vec![0.0, f64::NAN],
            vec![1.0, 1.0 + 1e-9],
        ] {
            assert!(Axis::graded(lines.clone()).is_err(), "{lines:?}");
        }
        for ratio in [1e300, 1e-300, f64::INFINITY, f64::NAN, 0.0, -1.0] {
            let interval = Interval { to: 1.0, cells: 5, ratio };
            assert!(Axis::from_intervals(0.0, &[interval]).is_err(), "{ratio}");
        }
    }

    proptest! {
        #[test]
        fn coordinates_and_positions_are_inverse(x in -3.0..12.0f64, y in -3.0..12.0f64) {
            let axis = graded();
            prop_assert!((axis.position(axis.coordinate(x)) - x).abs() < 1e-7);
            let (from, to) = (axis.coordinate(x.min(y)), axis.coordinate(x.max(y)));
            let exact = (axis.position(to) - axis.position(from)) / axis.size(0);
            prop_assert!((axis.distance(from, to) - exact).abs() < 1e-13);
        }

        #[test]
        fn equal_intervals_are_an_even_axis(x in -3.0..7.0f64, cell in 0usize..8) {
            let even = Axis::even(-1.0, 0.5, 8);
            let ends = [Interval { to: 0.5, cells: 3, ratio: 1.0 }, Interval { to: 3.0, cells: 5, ratio: 1.0 }];
            let graded = Axis::from_intervals(-1.0, &ends).unwrap();
            prop_assert!((graded.coordinate(x) - even.coordinate(x)).abs() < 1e-14);
            prop_assert!((graded.local(cell, x) - even.local(cell, x)).abs() < 1e-14);
            prop_assert_eq!(graded.lines_near(x, x + 1.0), even.lines_near(x, x + 1.0));
        }
    }
}
