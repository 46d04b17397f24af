//! Storage of basis functions on a structured grid as factors: one function along each axis.

use crate::grid::for_each_corner;

/// Largest number of nodes along an axis; larger domains store the products themselves.
const MAX_PER_AXIS: usize = 4;

/// Basis functions along one axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisFactors {
    /// Number of nodes.
    n: usize,
    value: [f64; MAX_PER_AXIS],
    slope: [f64; MAX_PER_AXIS],
}

/// Basis functions of a point as factors along all axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Factors<const D: usize>([AxisFactors; D]);

/// Storage format of the basis functions of a point. For each axis, there are four bits for the number of nodes and one
/// bit that marks a point inside one cell, for which only the local coordinate is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Form(u32);

const NODES: u32 = 0b1111;
const IN_CELL: u32 = 0b1_0000;
const BITS: usize = 5;
/// Marks explicit storage of values and gradients; the other bits are the number of nodes.
const EXPLICIT: u32 = 1 << 31;

impl Form {
    /// Explicit storage of the values and gradients of `n` nodes.
    pub fn explicit(n: usize) -> Form {
        Form(EXPLICIT | n as u32)
    }

    /// True if values and gradients are stored explicitly.
    #[inline(always)]
    pub fn is_explicit(self) -> bool {
        self.0 & EXPLICIT != 0
    }

    #[inline(always)]
    fn axis(self, d: usize) -> u32 {
        self.0 >> (BITS * d)
    }

    #[inline(always)]
    fn nodes_along(self, d: usize) -> usize {
        (self.axis(d) & NODES) as usize
    }

    /// Number of nodes.
    #[inline(always)]
    pub fn nodes<const D: usize>(self) -> usize {
        if self.is_explicit() {
            return (self.0 & !EXPLICIT) as usize;
        }
        (0..D).map(|d| self.nodes_along(d)).product()
    }

    /// The format for the two nodes of one cell along every axis.
    fn one_cell<const D: usize>() -> Form {
        Form((0..D).fold(0, |form, d| form | (IN_CELL | 2) << (BITS * d)))
    }
}

impl<const D: usize> Factors<D> {
    /// Factors from the values and slopes at consecutive nodes along each axis; `None` if there are too many nodes.
    pub fn new(axes: [&[(f64, f64)]; D]) -> Option<Self> {
        if axes.iter().any(|entries| entries.len() > MAX_PER_AXIS) {
            return None;
        }
        Some(Factors(axes.map(|entries| {
            let mut line =
                AxisFactors { n: entries.len(), value: [0.0; MAX_PER_AXIS], slope: [0.0; MAX_PER_AXIS] };
            for (k, &(value, slope)) in entries.iter().enumerate() {
                (line.value[k], line.slope[k]) = (value, slope);
            }
            line
        })))
    }

    /// Factors of a point at local coordinates `xi` (0 to 1) of its cell; `per_length` is 1/h along each axis.
    pub fn in_cell(xi: &[f64; D], per_length: &[f64; D]) -> Self {
        Factors(std::array::from_fn(|d| AxisFactors {
            n: 2,
            value: [1.0 - xi[d], xi[d], 0.0, 0.0],
            slope: [-per_length[d], per_length[d], 0.0, 0.0],
        }))
    }

    /// Appends the factors to `numbers`, in the shortest form from which they can be restored bit for bit; `per_length`
    /// is 1/h of the cell of the point along each axis.
    pub fn keep(&self, per_length: &[f64; D], numbers: &mut Vec<f64>) -> Form {
        let mut form = 0;
        for (d, line) in self.0.iter().enumerate() {
            let ([low, high, ..], [down, up, ..]) = (line.value, line.slope);
            let is_in_cell = line.n == 2
                && low.to_bits() == (1.0 - high).to_bits()
                && (down, up) == (-per_length[d], per_length[d]);
            if is_in_cell {
                numbers.push(high);
                form |= (IN_CELL | 2) << (BITS * d);
            } else {
                numbers.extend_from_slice(&line.value[..line.n]);
                numbers.extend_from_slice(&line.slope[..line.n]);
                form |= (line.n as u32) << (BITS * d);
            }
        }
        Form(form)
    }

    /// Restores the factors that [`Factors::keep`] stored.
    #[inline(always)]
    fn kept(form: Form, mut numbers: &[f64], per_length: &[f64; D]) -> Self {
        let mut lines = [AxisFactors { n: 2, value: [0.0; MAX_PER_AXIS], slope: [0.0; MAX_PER_AXIS] }; D];
        for (d, line) in lines.iter_mut().enumerate() {
            if form.axis(d) & IN_CELL != 0 {
                (line.value[0], line.value[1]) = (1.0 - numbers[0], numbers[0]);
                (line.slope[0], line.slope[1]) = (-per_length[d], per_length[d]);
                numbers = &numbers[1..];
            } else {
                line.n = form.nodes_along(d).min(MAX_PER_AXIS);
                let (values, rest) = numbers.split_at(line.n);
                let (slopes, rest) = rest.split_at(line.n);
                line.value[..line.n].copy_from_slice(values);
                line.slope[..line.n].copy_from_slice(slopes);
                numbers = rest;
            }
        }
        Factors(lines)
    }
}

/// Multiplies stored factors into values and gradients; the first axis varies fastest.
#[inline(always)]
pub(super) fn multiply<const D: usize>(
    form: Form,
    numbers: &[f64],
    per_length: &[f64; D],
    value: &mut [f64],
    gradient: &mut [[f64; D]],
) {
    if form == Form::one_cell::<D>() {
        // Because the number of nodes is known, indices need no bounds checks.
        let (value, gradient) = (&mut value[..1 << D], &mut gradient[..1 << D]);
        return for_each_corner(local(numbers), per_length, |k, s, ds| (value[k], gradient[k]) = (s, ds));
    }
    for_each_node(form, numbers, per_length, |k, s, ds| (value[k], gradient[k]) = (s, ds));
}

/// Calls `visit` with the index of each node, its value and its gradient; the first axis varies fastest.
#[inline(always)]
pub(super) fn for_each_product<const D: usize>(
    form: Form,
    numbers: &[f64],
    per_length: &[f64; D],
    visit: impl FnMut(usize, f64, [f64; D]),
) {
    if form == Form::one_cell::<D>() {
        return for_each_corner(local(numbers), per_length, visit);
    }
    for_each_node(form, numbers, per_length, visit);
}

/// The local coordinates of a point inside one cell, which are its stored numbers.
#[inline(always)]
fn local<const D: usize>(numbers: &[f64]) -> [f64; D] {
    let mut local = [0.0; D];
    local.copy_from_slice(&numbers[..D]);
    local
}

/// The products for a point that is not inside one cell.
#[inline(always)]
fn for_each_node<const D: usize>(
    form: Form,
    numbers: &[f64],
    per_length: &[f64; D],
    mut visit: impl FnMut(usize, f64, [f64; D]),
) {
    let Factors(lines) = Factors::kept(form, numbers, per_length);
    let mut index = [0; D];
    for node in 0..form.nodes::<D>() {
        let mut product = 1.0;
        let mut slopes = [1.0; D];
        for d in 0..D {
            let (s, ds) = (lines[d].value[index[d]], lines[d].slope[index[d]]);
            product *= s;
            for e in 0..D {
                slopes[e] *= if e == d { ds } else { s };
            }
        }
        visit(node, product, slopes);
        for d in 0..D {
            index[d] += 1;
            if index[d] < lines[d].n {
                break;
            }
            index[d] = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::{Basis, Gimp, Mpm, PointGeometry, Support};
    use crate::grid::{Axis, Grid, Interval, Structured};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn products_are_those_of_the_basis(
            x in prop::array::uniform3(0.2..3.8f64),
            // At most four nodes along each axis.
            l in prop::array::uniform3(0.0..0.69f64),
        ) {
            let even = Structured::<3>::new([0.0; 3], [1.0, 0.7, 1.3], [4, 6, 3]);
            let graded = |to: f64| {
                let half = Interval { to: 0.5 * to, cells: 2, ratio: 1.2 };
                Axis::from_intervals(0.0, &[half, Interval { to, cells: 2, ratio: 0.9 }]).unwrap()
            };
            for grid in [even, Structured::with_axes([graded(4.0), Axis::even(0.0, 0.7, 6), graded(3.9)])] {
            let cell = grid.locate(&x, None).unwrap_or_else(|| grid.nearest_cell(&x));
            let per_length = grid.per_length(grid.cell_index(cell as usize));
            let mut support = Support::default();
            for (basis, numbers_of_cell) in [(&Mpm as &dyn Basis<3>, true), (&Gimp, false)] {
                let point = PointGeometry { cell, position: &x, half_lengths: &l, corners: &[] };
                basis.support(&grid, &point, &mut support).unwrap();
                let factors = support.factors.unwrap();
                let mut numbers = Vec::new();
                let form = factors.keep(&per_length, &mut numbers);
                let n = support.nodes.len();
                prop_assert_eq!(form.nodes::<3>(), n);
                prop_assert!(!numbers_of_cell || numbers.len() == 3);
                let (mut value, mut gradient) = (vec![0.0; n], vec![[0.0; 3]; n]);
                multiply(form, &numbers, &per_length, &mut value, &mut gradient);
                prop_assert_eq!(&value, &support.value);
                prop_assert_eq!(&gradient, &support.gradient);
            }
            }
        }
    }
}
