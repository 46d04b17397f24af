//! Grid lines that are moved (carried) along their axis, and the stretching cells between them.

use super::{Axis, CoincidentLines, ON_LINE};

/// Smallest size of a cell relative to its original size, [-]. In smaller cells, the basis functions are too steep for
/// the points in the neighbouring cells.
pub const MIN_SIZE: f64 = 0.1;

/// Consecutive grid lines that move by the same displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarriedLines {
    /// Index of the first line.
    pub first: usize,
    /// Index of the last line, at least `first`.
    pub last: usize,
    /// Displacement of the lines, [length].
    pub by: f64,
}

/// Reason why lines cannot be carried to their required positions.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CarryError {
    /// Cells would become smaller than [`MIN_SIZE`] times their original size, or be inverted.
    #[error("{}", squeezed(*ratio))]
    Squeezed {
        /// Indices of the lines between which the cells lie.
        lines: [usize; 2],
        /// Size of the cells, relative to their original size, [-].
        ratio: f64,
    },
    /// Two lines are too close for the precision of their coordinates.
    #[error(transparent)]
    Coincident(#[from] CoincidentLines),
}

fn squeezed(ratio: f64) -> String {
    if ratio > 0.0 {
        format!(
            "cells would shrink to {ratio:.3} of their original size; the smallest allowed ratio is {MIN_SIZE}"
        )
    } else {
        format!("displacements would invert cells; a cell must keep at least {MIN_SIZE} of its original size")
    }
}

impl Axis {
    /// The axis after these groups of lines have been carried; the groups must be in ascending order, without overlap.
    /// All other lines keep their relative position between the carried lines on either side, or between a carried line
    /// and an end of the axis, which stays unless it is carried itself.
    ///
    /// # Errors
    /// [`CarryError`] as for [`Axis::check_carried`].
    pub fn carried(&self, carried: &[CarriedLines]) -> Result<Axis, CarryError> {
        let n = self.n_cells();
        self.check_carried(carried)?;
        match carried {
            _ if carried.iter().all(|lines| lines.by == 0.0) => return Ok(self.clone()),
            // Cells of exactly equal size keep exactly equal sizes.
            [CarriedLines { first: 0, last, by }] if *last == n && self.is_even() => {
                return Ok(Axis::even(self.line(0) + by, self.size(0), n));
            }
            _ => {}
        }
        let mut moved: Vec<f64> = (0..=n).map(|number| self.line(number)).collect();
        for [(first, by), (last, by_last)] in self.spans(carried) {
            let (start, length) = (self.line(first), self.line(last) - self.line(first));
            for number in first..last {
                let x = self.line(number);
                moved[number] = x + (by + (by_last - by) * ((x - start) / length));
            }
            moved[last] = self.line(last) + by_last;
        }
        Ok(Axis::graded(moved)?)
    }

    /// Checks the sizes of the cells after these lines have been carried, and checks that the coordinates resolve these
    /// sizes.
    ///
    /// # Errors
    /// [`CarryError`] for the first cells that would be too small, or for lines so far from the origin that their
    /// coordinates do not resolve the cells.
    pub fn check_carried(&self, carried: &[CarriedLines]) -> Result<(), CarryError> {
        for [(first, by), (last, by_last)] in self.spans(carried) {
            let ratio = 1.0 + (by_last - by) / (self.line(last) - self.line(first));
            if first < last && (ratio.is_nan() || ratio < MIN_SIZE) {
                return Err(CarryError::Squeezed { lines: [first, last], ratio });
            }
            let number = first.min(self.n_cells() - 1);
            let at = self.line(number) + by;
            let round_off = f64::EPSILON * at.abs();
            if round_off.is_nan() || round_off > ON_LINE * self.size(number) {
                return Err(CoincidentLines { number, at }.into());
            }
        }
        Ok(())
    }

    /// Pairs of lines with their displacements, from one end of the axis to the other. Within each pair, displacements
    /// vary linearly.
    fn spans(&self, carried: &[CarriedLines]) -> Vec<[(usize, f64); 2]> {
        let n = self.n_cells();
        let mut known = Vec::new();
        if carried.first().is_none_or(|lines| lines.first > 0) {
            known.push((0, 0.0));
        }
        known.extend(carried.iter().flat_map(|lines| [(lines.first, lines.by), (lines.last, lines.by)]));
        if carried.last().is_none_or(|lines| lines.last < n) {
            known.push((n, 0.0));
        }
        known.windows(2).map(|pair| [pair[0], pair[1]]).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn lines(axis: &Axis) -> Vec<f64> {
        (0..=axis.n_cells()).map(|number| axis.line(number)).collect()
    }

    #[test]
    fn carried_lines_move_and_those_between_stretch() {
        let axis = Axis::even(0.0, 1.0, 8);
        let one = [CarriedLines { first: 4, last: 5, by: -2.0 }];
        let exact = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 3.0 + 5.0 / 3.0, 3.0 + 10.0 / 3.0, 8.0];
        for (line, exact) in lines(&axis.carried(&one).unwrap()).iter().zip(exact) {
            assert!((line - exact).abs() < 1e-15);
        }
        let two = [CarriedLines { first: 0, last: 1, by: 0.5 }, CarriedLines { first: 3, last: 8, by: -0.5 }];
        assert_eq!(lines(&axis.carried(&two).unwrap()), [0.5, 1.5, 2.0, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5]);
    }

    #[test]
    fn an_axis_that_stays_or_moves_as_a_whole_stays_even() {
        let axis = Axis::even(0.0, 0.25, 8);
        let still = [CarriedLines { first: 2, last: 3, by: 0.0 }];
        assert_eq!(axis.carried(&still).unwrap(), axis);
        let whole = [CarriedLines { first: 0, last: 8, by: 0.3 }];
        assert_eq!(axis.carried(&whole).unwrap(), Axis::even(0.3, 0.25, 8));
    }

    #[test]
    fn cells_that_would_be_squeezed_are_named() {
        let axis = Axis::graded(vec![0.0, 1.0, 3.0, 4.0]).unwrap();
        let squeezed = |by| axis.carried(&[CarriedLines { first: 2, last: 2, by }]).unwrap_err();
        assert_eq!(squeezed(-2.85), CarryError::Squeezed { lines: [0, 2], ratio: 1.0 - 2.85 / 3.0 });
        assert_eq!(squeezed(2.0), CarryError::Squeezed { lines: [2, 3], ratio: -1.0 });
        assert!(axis.carried(&[CarriedLines { first: 2, last: 2, by: f64::NAN }]).is_err());
        assert!(axis.carried(&[CarriedLines { first: 2, last: 2, by: -2.69 }]).is_ok());
        for axis in [axis, Axis::even(0.0, 1.0, 3)] {
            for by in [1e12, f64::INFINITY, f64::NAN] {
                let far = [CarriedLines { first: 0, last: 3, by }];
                assert!(axis.carried(&far).is_err(), "{by}");
            }
        }
    }
}
