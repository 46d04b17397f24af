//! The sides of cells: edges in the plane, faces in space.

use super::Grid;
use super::element::ElementShape;

/// A side of a cell from a list of cells.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Side {
    /// Its nodes, ascending, padded with `u32::MAX`; the same for all cells that share the side.
    pub key: [u32; 4],
    /// Index, in the list of cells, of the cell to which the side belongs.
    pub cell: usize,
    /// Its nodes in order: an edge has the cell to its left, a face is counterclockwise as seen from outside.
    pub nodes: Vec<u32>,
}

/// The sides of the cells in a list, sorted so that equal sides are adjacent.
pub fn sides_of<const D: usize>(grid: &dyn Grid<D>, cells: &[u32]) -> Vec<Side> {
    let mut sides = Vec::new();
    for (place, &cell) in cells.iter().enumerate() {
        let corners = grid.corners(cell as usize);
        let Some(shape) = ElementShape::from_nodes::<D>(corners.nodes().len()) else { continue };
        for side in shape.sides::<D>() {
            let nodes: Vec<u32> = side.iter().map(|&k| corners.nodes()[k]).collect();
            let mut key = [u32::MAX; 4];
            key[..nodes.len()].copy_from_slice(&nodes);
            key.sort_unstable();
            sides.push(Side { key, cell: place, nodes });
        }
    }
    sides.sort_unstable();
    sides
}
