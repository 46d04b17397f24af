//! Standard material point method: the finite element basis at the position of the point.

use super::factors::Factors;
use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::{CellBasis, Grid};

/// Standard material points: S_vp is the linear basis of the cell that contains the point.
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
        match grid.structured() {
            Some(grid) => {
                let base = grid.cell_index(point.cell as usize);
                let local = grid.local(base, point.position);
                if D > 2 {
                    out.factors = Some(Factors::in_cell(&local, &grid.sides(base).map(|h| 1.0 / h)));
                }
                append(&grid.basis_in(base, local), out);
            }
            None => append(&grid.basis_at(point.cell, point.position), out),
        }
        Ok(())
    }

    fn shares(&self, _: &dyn Grid<D>, point: &PointGeometry<D>) -> Vec<(u32, f64)> {
        vec![(point.cell, 1.0)]
    }
}

/// Adds the nodes of a cell, with values and gradients, to a support without nodes. It is inlined so that the basis is
/// not copied.
#[inline(always)]
fn append<const D: usize>(basis: &CellBasis<D>, out: &mut Support<D>) {
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
