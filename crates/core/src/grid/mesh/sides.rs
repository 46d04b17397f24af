//! Sides (edges, faces) of cells: the boundary, and errors that become apparent at sides.

use std::collections::BTreeSet;

use super::{CellReport, Mesh, MeshError};

/// A side: an edge in the plane, a triangle or quadrilateral in space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Side {
    nodes: [u32; 4],
    n: u8,
}

impl Side {
    /// The side with these nodes, listed in order around it; only the first four are used.
    pub fn new(list: &[u32]) -> Self {
        let mut nodes = [0; 4];
        let n = list.len().min(4);
        nodes[..n].copy_from_slice(&list[..n]);
        Side { nodes, n: n as u8 }
    }

    /// The nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..usize::from(self.n)]
    }

    /// The side with its nodes in canonical order: from the lowest node towards the lower of its two neighbours. The
    /// two cells that share a side obtain the same order. The flag is true if the given order has the same direction.
    fn undirected(&self) -> (Side, bool) {
        let nodes = self.nodes();
        let n = nodes.len();
        let first = (1..n).fold(0, |least, k| if nodes[k] < nodes[least] { k } else { least });
        let (next, last) = (nodes[(first + 1) % n], nodes[(first + n - 1) % n]);
        let forward = if n == 2 { first == 0 } else { next < last };
        let mut side = *self;
        for k in 0..n {
            side.nodes[k] = nodes[if forward { first + k } else { first + n - k } % n];
        }
        (side, forward)
    }
}

/// A side that belongs to one cell only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoundarySide {
    /// The side with its nodes in the order of the cell: an edge has the cell to its left; a face is counterclockwise
    /// as seen from outside.
    pub side: Side,
    /// The cell.
    pub cell: u32,
}

impl<const D: usize> Mesh<D> {
    /// Finds the edges (faces) that belong to one cell only; an error if two cells that share an edge (face) lie on the
    /// same side of it.
    pub(super) fn find_boundary(&mut self, report: impl Fn(u32) -> CellReport) -> Result<(), MeshError> {
        // Canonical side, its direction in this cell, the cell, and the side as given.
        let mut sides: Vec<(Side, bool, u32, Side)> = Vec::with_capacity(self.cell_nodes.len());
        for cell in 0..self.n_cells() as u32 {
            let nodes = self.cell_nodes(cell);
            for corners in self.cell_shape(cell).sides::<D>() {
                let mut list = [0; 4];
                list.iter_mut().zip(*corners).for_each(|(node, k)| *node = nodes[*k]);
                let side = Side::new(&list[..corners.len()]);
                let (undirected, forward) = side.undirected();
                sides.push((undirected, forward, cell, side));
            }
        }
        sides.sort_unstable();
        let same = |pair: &&[(Side, bool, u32, Side)]| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1);
        let mut pairs = sides.windows(2).filter(same);
        if let Some(pair) = pairs.next() {
            let first = [pair[0].2, pair[1].2].map(report);
            return Err(MeshError::Overlap { n: 1 + pairs.count(), first });
        }
        for equal in sides.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, _, cell, side)] = *equal {
                self.boundary.push(BoundarySide { side, cell });
            }
        }
        self.check_faces(report)
    }

    /// Refuses a mesh in which a face of a tetrahedron covers half a face of a hexahedron.
    fn check_faces(&self, report: impl Fn(u32) -> CellReport) -> Result<(), MeshError> {
        let sorted = |mut nodes: [u32; 3]| {
            nodes.sort_unstable();
            nodes
        };
        let mut halves: BTreeSet<([u32; 3], u32)> = BTreeSet::new();
        for BoundarySide { side, cell } in &self.boundary {
            if let [a, b, c, d] = *side.nodes() {
                halves.extend([[a, b, c], [b, c, d], [c, d, a], [d, a, b]].map(|half| (sorted(half), *cell)));
            }
        }
        let hexahedron_at = |BoundarySide { side, cell }: &BoundarySide| match *side.nodes() {
            [a, b, c] => {
                let half = sorted([a, b, c]);
                halves.range((half, 0)..).next().filter(|found| found.0 == half).map(|found| [*cell, found.1])
            }
            _ => None,
        };
        let mut pairs = self.boundary.iter().filter_map(hexahedron_at);
        match pairs.next() {
            Some(pair) => Err(MeshError::Nonconforming { n: 1 + pairs.count(), first: pair.map(report) }),
            None => Ok(()),
        }
    }
}
