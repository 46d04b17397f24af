//! The basis of the grid on the side of a domain.

use super::support::active;
use super::{DomainSide, corners_of, mean_over_side};
use crate::basis::{Connectivity, Method};
use crate::grid::{CellBasis, Grid, MAX_CORNERS};
use crate::points::Points;
use crate::region::vector::{along, minus};

/// Distance towards its point by which a corner is moved to find its cell, relative to the distance from the point,
/// [-].
const INWARDS: f64 = 1e-7;

/// The active nodes with the mean of N_v over a side of the domain of a point in the converged state, by the rule of
/// its method: the mean over the corners for CPDI, the integral over the side for GIMP. The forces of a uniform stress
/// on the side have this distribution. Empty if the domain has no such side.
pub fn side_basis<const D: usize>(
    grid: &dyn Grid<D>,
    links: &Connectivity<D>,
    points: &Points<D>,
    p: usize,
    side: &DomainSide,
    method: Method,
) -> Vec<(u32, f64)> {
    let (body, cell) = (points.body[p], points.cell[p]);
    let mut buffer = [[0.0; D]; MAX_CORNERS];
    let domain = corners_of(points, p, &mut buffer);
    let found: Option<Vec<[f64; D]>> = side.corners().iter().map(|&k| domain.get(k).copied()).collect();
    let Some(corners) = found else { return Vec::new() };
    let active = |basis: CellBasis<D>| active(basis, links, body);
    let inside = |x: &[f64; D]| {
        let x = along(x, INWARDS, &minus(&points.converged.position[p], x));
        grid.basis_near(&x, Some(cell)).0
    };
    let cells: Vec<u32> = corners.iter().map(inside).collect();
    let integral = || mean_over_side(grid, &corners, &cells, active);
    if let Some(mean) = (method == Method::Gimp).then(integral).flatten() {
        return mean;
    }
    let mut mean: Vec<(u32, f64)> = Vec::new();
    for (x, &cell) in corners.iter().zip(&cells) {
        let support = active(grid.basis_at(cell, x)).unwrap_or_default();
        for (&node, value) in support.nodes().iter().zip(support.value()) {
            let value = value / corners.len() as f64;
            match mean.iter_mut().find(|(other, _)| *other == node) {
                Some((_, sum)) => *sum += value,
                None => mean.push((node, value)),
            }
        }
    }
    mean
}
