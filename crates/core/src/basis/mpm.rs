//! Standard material point method: the finite element basis at the position of the point.

use super::factors::Factors;
use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::{CellBasis, Grid};

/// Standard material points: S_vp is the linear basis of the cell that holds the point.
#[derive(Debug, Clone, Copy)]
pub struct Mpm;

impl<const D: usize> Basis<D> for Mpm {
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError> {
        out.clear();
        out.cells.push(point.cell);
        let basis = match grid.structured() {
            Some(grid) => {
                let base = grid.cell_index(point.cell as usize);
                let local = grid.local(base, point.position);
                if D > 2 {
                    out.factors = Some(Factors::in_cell(&local, &grid.sides(base).map(|h| 1.0 / h)));
                }
                grid.basis_in(base, local)
            }
            None => grid.basis_at(point.cell, point.position),
        };
        sort(&basis, out);
        Ok(())
    }

    fn at_centres(&self, grid: &dyn Grid<D>, point: &PointGeometry<D>, revolved: bool, out: &mut Support<D>) {
        out.clear();
        let corners = grid.corners(point.cell as usize);
        let n = corners.nodes().len() as f64;
        let mut centre = [0.0; D];
        for &node in corners.nodes() {
            let position = grid.node_position(node as usize);
            (0..D).for_each(|d| centre[d] += position[d] / n);
        }
        sort(&grid.basis_at(point.cell, &centre), out);
        if revolved {
            out.value.iter_mut().for_each(|value| *value /= centre[0]);
        }
    }
}

/// Writes the basis of a cell with its nodes ascending.
#[inline(always)]
fn sort<const D: usize>(basis: &CellBasis<D>, out: &mut Support<D>) {
    if basis.nodes().is_sorted() {
        out.nodes.extend_from_slice(basis.nodes());
        out.value.extend_from_slice(basis.value());
        out.gradient.extend_from_slice(basis.gradient());
        return;
    }
    for ((&node, &value), &gradient) in basis.nodes().iter().zip(basis.value()).zip(basis.gradient()) {
        out.add(node, value, gradient);
    }
}
