//! The boundary of a group of grid cells, divided into flat facets.

use std::collections::BTreeMap;

use crate::grid::Grid;
use crate::grid::sides::{Side, sides_of};

use super::vector::norm;
use super::{Facet, MAX_FACETS, Motion, NoBoundary, area_vector, divided};

/// Neighbouring sides of cells belong to one smooth piece if the cosine of the angle between their normals exceeds this
/// value.
const SMOOTH: f64 = 0.9;

/// The boundary of a list of cells: the sides that no other cell of the list shares, moved by `motion` and divided into
/// facets whose edges are no longer than `spacing`, [length]. `group`, an ascending list of nodes, restricts the result
/// to sides whose nodes all belong to it. Each smooth piece counts as one side of the surface; the pieces are numbered
/// in the order of the cells.
///
/// # Errors
/// [`NoBoundary::TooMany`].
pub fn boundary_of_cells<const D: usize>(
    grid: &dyn Grid<D>,
    cells: &[u32],
    motion: &Motion<D>,
    group: Option<&[u32]>,
    spacing: f64,
) -> Result<Vec<Facet<D>>, NoBoundary> {
    let all = sides_of(grid, cells);
    let mut outer: Vec<&Side> = all
        .chunk_by(|a, b| a.key == b.key)
        .filter_map(|equal| if let [side] = equal { Some(side) } else { None })
        .filter(|side| {
            group.is_none_or(|group| side.nodes.iter().all(|node| group.binary_search(node).is_ok()))
        })
        .collect();
    outer.sort_unstable_by_key(|side| (side.cell, side.key));
    let corners = |side: &Side| -> Vec<[f64; D]> {
        side.nodes.iter().map(|&node| motion.apply(&grid.node_position(node as usize))).collect()
    };
    let numbers = smooth_pieces(&outer, &|side| normal(&corners(side)));
    let mut facets = Vec::new();
    for (side, number) in outer.iter().zip(numbers) {
        facets.extend(divided(&corners(side), spacing, number));
        if facets.len() > MAX_FACETS {
            return Err(NoBoundary::TooMany);
        }
    }
    Ok(facets)
}

/// The unit normal of a side, computed from its first corners.
fn normal<const D: usize>(corners: &[[f64; D]]) -> [f64; D] {
    let area = area_vector(&std::array::from_fn(|k| corners[k]));
    let size = norm(&area);
    if size > 0.0 { area.map(|a| a / size) } else { area }
}

/// For each side, the number of the smooth piece to which it belongs.
fn smooth_pieces<const D: usize>(sides: &[&Side], normal: &dyn Fn(&Side) -> [f64; D]) -> Vec<usize> {
    let normals: Vec<[f64; D]> = sides.iter().map(|side| normal(side)).collect();
    let mut piece: Vec<usize> = (0..sides.len()).collect();
    let root = |piece: &[usize], mut k: usize| {
        while piece[k] != k {
            k = piece[k];
        }
        k
    };
    // Neighbouring sides share a node in the plane and an edge in space.
    let mut last: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (k, side) in sides.iter().enumerate() {
        let n = side.nodes.len();
        for (i, &a) in side.nodes.iter().enumerate() {
            let b = if D > 2 { side.nodes[(i + 1) % n] } else { a };
            let sharing = last.entry([a.min(b), a.max(b)]).or_default();
            for &other in sharing.iter() {
                let cosine: f64 = (0..D).map(|d| normals[k][d] * normals[other][d]).sum();
                if cosine > SMOOTH {
                    let (a, b) = (root(&piece, k), root(&piece, other));
                    piece[a.max(b)] = a.min(b);
                }
            }
            sharing.push(k);
        }
    }
    let roots: Vec<usize> = (0..sides.len()).map(|k| root(&piece, k)).collect();
    let mut numbers = BTreeMap::new();
    roots
        .iter()
        .map(|root| {
            let next = numbers.len();
            *numbers.entry(*root).or_insert(next)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Structured;

    /// The boundary of a box of cells is closed, has the area of the box, and consists of one smooth piece per side.
    fn block<const D: usize>(area: f64) {
        let grid = Structured::new([0.0; D], [0.5; D], [4; D]);
        let cells: Vec<u32> = (0..grid.n_cells())
            .filter(|&cell| {
                let nodes = grid.corners(cell);
                nodes.nodes().iter().all(|&n| grid.node_position(n as usize).iter().all(|x| *x >= 1.0))
            })
            .map(|cell| cell as u32)
            .collect();
        assert_eq!(cells.len(), 1 << D);
        let facets = boundary_of_cells(&grid, &cells, &Motion::identity(), None, 0.2).unwrap();
        let mut sum = [0.0; D];
        let mut total = 0.0;
        for facet in &facets {
            let normal = area_vector(&facet.corners);
            (0..D).for_each(|d| sum[d] += normal[d]);
            total += normal.iter().map(|n| n * n).sum::<f64>().sqrt();
            // The normals point outwards.
            let centre = facet.centre();
            assert!((0..D).map(|d| normal[d] * (centre[d] - 1.5)).sum::<f64>() > 0.0);
        }
        assert!(sum.iter().all(|n| n.abs() < 1e-12), "{sum:?}");
        assert!((total - area).abs() < 1e-12, "{total}");
        let pieces: std::collections::BTreeSet<usize> = facets.iter().map(|facet| facet.side).collect();
        assert_eq!(pieces.into_iter().collect::<Vec<_>>(), (0..2 * D).collect::<Vec<_>>());
        // A group of nodes selects the sides that lie in it.
        let low: Vec<u32> =
            (0..grid.n_nodes()).filter(|&n| grid.node_position(n)[0] == 1.0).map(|n| n as u32).collect();
        let part = boundary_of_cells(&grid, &cells, &Motion::identity(), Some(&low), 0.2).unwrap();
        let size = |facet: &Facet<D>| area_vector(&facet.corners).iter().map(|n| n * n).sum::<f64>().sqrt();
        assert!((part.iter().map(size).sum::<f64>() - area / (2 * D) as f64).abs() < 1e-12);
        assert!(part.iter().all(|facet| facet.corners.iter().all(|x| x[0] == 1.0)));
    }

    #[test]
    fn the_boundary_of_cells_is_closed() {
        block::<2>(4.0);
        block::<3>(6.0);
    }
}
