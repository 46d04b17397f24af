//! The standard material point method: the finite element basis at the position of the point.

use super::{Basis, OffGrid, Support, tensor_product};
use crate::grid::Grid;

/// Standard material points: S_vp is the linear basis of the cell that holds the point.
#[derive(Debug, Clone, Copy)]
pub struct Mpm;

impl<const D: usize> Basis<D> for Mpm {
    fn support(
        &self,
        grid: &Grid<D>,
        position: &[f64; D],
        _half_lengths: &[f64; D],
        out: &mut Support<D>,
    ) -> Result<(), OffGrid> {
        let cell = grid.locate(position).ok_or(OffGrid)?;
        let hats: [[(f64, f64); 2]; D] = std::array::from_fn(|d| {
            let xi = grid.cell_coordinate(d, position[d]) - cell[d] as f64;
            let slope = 1.0 / grid.spacing()[d];
            [(1.0 - xi, -slope), (xi, slope)]
        });
        tensor_product(grid, &std::array::from_fn(|d| (cell[d], &hats[d][..])), out);
        Ok(())
    }
}
