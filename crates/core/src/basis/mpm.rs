//! Standard material point method: the finite element basis at the position of the point.

use super::factors::Factors;
use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::Grid;

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
        match grid.lines() {
            Some(lines) => {
                let base = lines.cell_index(point.cell as usize);
                let (local, per_length) = (lines.local(base, point.position), lines.per_length(base));
                out.set_corners(local, &per_length, |corner| lines.corner(base, corner) as u32);
                out.factors = (D > 2).then(|| Factors::in_cell(&local, &per_length));
            }
            None => {
                out.clear();
                let basis = grid.basis_at(point.cell, point.position);
                for ((&node, &value), &gradient) in
                    basis.nodes().iter().zip(basis.value()).zip(basis.gradient())
                {
                    out.add(node, value, gradient);
                }
            }
        }
        out.cells.clear();
        out.cells.push(point.cell);
        Ok(())
    }

    fn shares(&self, _: &dyn Grid<D>, point: &PointGeometry<D>) -> Vec<(u32, f64)> {
        vec![(point.cell, 1.0)]
    }
}
