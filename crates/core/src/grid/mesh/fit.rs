//! Checks that the cells of a mesh fit together: finds overlapping cells, hanging nodes and coincident nodes.
//!
//! The number of cells that cover a position changes only at sides that belong to one cell, and is zero far away. If
//! two cells overlap, a cell at such a side therefore overlaps another cell. A hanging node and the side on which it
//! lies are both on the boundary. It is therefore enough to check the boundary.

use rayon::prelude::*;

use super::cell::{Cell, distance_squared, distance_squared_of_triangle};
use super::error::HangingNode;
use super::{BoundarySide, CellReport, Mesh, MeshError, MeshWarning};
use crate::grid::bins::{Bins, Bounds, bounds};
use crate::grid::element::{ElementShape, dot, minus, vector_product};
use crate::tensor::padded;

/// Distance, relative to the local cell size, within which cells count as touching rather than overlapping, nodes as
/// coincident, and nodes as lying on a side, [-].
const TOUCHES: f64 = 1e-6;

/// Number of positions listed in warnings.
const LISTED: usize = 5;

/// Corners of a triangle or tetrahedron; the first `D` + 1 are used.
type Simplex<const D: usize> = [[f64; D]; 4];

/// Position of a boundary node on a side to which it does not belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Meeting {
    /// At this corner of the side.
    Corner(u32),
    /// Elsewhere on the side with this number.
    Inside(u32),
}

impl<const D: usize> Mesh<D> {
    /// Finds misfits: an error if the basis would be ambiguous or discontinuous, a warning if cells touch without being
    /// connected there. `report` describes a cell; `tag` is the number of a node in the file.
    pub(super) fn check_fit(
        &self,
        report: impl Fn(u32) -> CellReport,
        tag: impl Fn(u32) -> u64,
    ) -> Result<Vec<MeshWarning>, MeshError> {
        let (n, first) = self.overlaps();
        if let Some(pair) = first {
            return Err(MeshError::Overlap { n, first: pair.map(report) });
        }
        let (mut pairs, mut hanging, mut apart) = (Vec::new(), Vec::new(), Vec::new());
        let part_of = self.parts();
        for (node, meeting) in self.meetings() {
            match meeting {
                Meeting::Corner(corner) => pairs.push([node.min(corner), node.max(corner)]),
                Meeting::Inside(side) => {
                    let cell = self.boundary[side as usize].cell;
                    let is_connected = part_of[node as usize] == part_of[self.cell_nodes(cell)[0] as usize];
                    if is_connected { &mut hanging } else { &mut apart }.push((node, side));
                }
            }
        }
        for list in [&mut hanging, &mut apart] {
            list.dedup_by_key(|(node, _)| *node);
        }
        if let Some(&(node, side)) = hanging.first() {
            let BoundarySide { side, cell } = self.boundary[side as usize];
            let position = self.positions[node as usize].to_vec();
            let side = side.nodes().iter().map(|node| tag(*node)).collect();
            let first = HangingNode { node: tag(node), position, side, cell: report(cell) };
            return Err(MeshError::Hanging { n: hanging.len(), first: Box::new(first) });
        }
        pairs.sort_unstable();
        pairs.dedup();
        let positions = |nodes: &mut dyn Iterator<Item = u32>| -> Vec<Vec<f64>> {
            nodes.take(LISTED).map(|node| self.positions[node as usize].to_vec()).collect()
        };
        let mut warnings = Vec::new();
        if !pairs.is_empty() {
            let first = positions(&mut pairs.iter().map(|pair| pair[0]));
            warnings.push(MeshWarning::Unmerged { n: pairs.len(), first });
        }
        if !apart.is_empty() {
            let first = positions(&mut apart.iter().map(|(node, _)| *node));
            warnings.push(MeshWarning::Apart { n: apart.len(), first });
        }
        Ok(warnings)
    }

    /// Number of pairs of overlapping cells, and the first pair.
    fn overlaps(&self) -> (usize, Option<[u32; 2]>) {
        // Few cells are near a side at the boundary, while all slender cells around a node may be near each other.
        if !self.boundary.par_iter().any(|side| self.is_overlapped_at(side)) {
            return (0, None);
        }
        let mut outer: Vec<u32> = self.boundary.iter().map(|b| b.cell).collect();
        outer.sort_unstable();
        outer.dedup();
        let is_counted = |[a, b]: [u32; 2]| a < b || outer.binary_search(&b).is_err();
        let overlaps = |&cell: &u32| {
            let mut near = self.cells_near(cell);
            near.retain(|&other| is_counted([cell, other]) && self.overlap(cell, other));
            (near.len(), near.iter().map(|&other| [cell.min(other), cell.max(other)]).min())
        };
        let add = |a: (usize, Option<[u32; 2]>), b: (usize, Option<[u32; 2]>)| {
            (a.0 + b.0, a.1.into_iter().chain(b.1).min())
        };
        outer.par_iter().map(overlaps).reduce(|| (0, None), add)
    }

    /// True if another cell overlaps the cell of a side at the boundary, and touches this side. If any cells overlap,
    /// some side bounds the part of space that several cells cover.
    fn is_overlapped_at(&self, BoundarySide { side, cell }: &BoundarySide) -> bool {
        let [low, high] = bounds(side.nodes().iter().map(|node| self.positions[*node as usize]));
        let margin = |x: &[f64; D]| 2.0 * Self::tolerance(self.size(*cell), x);
        let around = [low.map(|x| x - margin(&low)), high.map(|x| x + margin(&high))];
        let touches = |other: u32| {
            let [low, high] =
                bounds(self.cell_nodes(other).iter().map(|node| self.positions[*node as usize]));
            (0..D).all(|d| low[d] <= around[1][d] && around[0][d] <= high[d])
        };
        let mut is_overlapped = false;
        self.bins.meeting(&around, |items| {
            is_overlapped = is_overlapped
                || items.iter().any(|&other| {
                    other != *cell
                        && touches(other)
                        && !self.share_a_side(*cell, other)
                        && self.overlap(*cell, other)
                });
        });
        is_overlapped
    }

    /// Other cells that may overlap a cell, ascending.
    fn cells_near(&self, cell: u32) -> Vec<u32> {
        let mut near = Vec::new();
        self.bins.meeting(&self.cell(cell).bounds(), |items| near.extend_from_slice(items));
        near.sort_unstable();
        near.dedup();
        near.retain(|&other| other != cell && !self.share_a_side(cell, other));
        near
    }

    /// True if two cells have a common edge (face); the cells then lie on opposite sides of it.
    fn share_a_side(&self, a: u32, b: u32) -> bool {
        let common = self.cell_nodes(a).iter().filter(|node| self.cell_nodes(b).contains(node)).count();
        let corners = |cell: u32| match (self.cell_shape(cell), D) {
            (ElementShape::Box, 3) => 4,
            _ => D,
        };
        common >= corners(a).min(corners(b))
    }

    /// Geometric tolerance at a position, for cells of this size.
    fn tolerance(size: f64, x: &[f64; D]) -> f64 {
        let largest = x.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        TOUCHES * size + 4.0 * f64::EPSILON * largest
    }

    /// True if two cells overlap by more than the tolerance.
    fn overlap(&self, a: u32, b: u32) -> bool {
        let origin = self.positions[self.cell_nodes(a)[0] as usize];
        let tolerance = Self::tolerance(self.size(a).min(self.size(b)), &origin);
        // Coordinates are relative to a corner of one of the cells, so that their round-off scales with the cell size.
        let [a, b] = [a, b].map(|cell| {
            let mut cell = self.cell(cell);
            cell.x.iter_mut().for_each(|x| *x = minus(*x, origin));
            cell
        });
        if !meet(&a.bounds(), &b.bounds(), tolerance) {
            return false;
        }
        let parts = b.simplices();
        a.simplices().iter().any(|first| {
            let around = bounds(first[..=D].iter().copied());
            parts.iter().filter(|second| meet(&around, &bounds(second[..=D].iter().copied()), tolerance)).any(
                |second| {
                    let common = common::<D>(first, second, tolerance);
                    // The simplices of a hexahedron with curved faces only approximate it.
                    common.iter().map(middle).any(|x| a.holds(&x, 0.0) && b.holds(&x, 0.0))
                },
            )
        })
    }

    /// Boundary nodes on corners and sides to which they do not belong, ascending.
    fn meetings(&self) -> Vec<(u32, Meeting)> {
        let mut nodes: Vec<u32> = self.boundary.iter().flat_map(|b| b.side.nodes().iter().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        let boxes: Vec<Bounds<D>> = (self.boundary.iter())
            .map(|BoundarySide { side, cell }| {
                let corners = || side.nodes().iter().map(|node| self.positions[*node as usize]);
                let [low, high] = bounds(corners());
                let margin = |x: &[f64; D]| 2.0 * Self::tolerance(self.size(*cell), x);
                [low.map(|x| x - margin(&low)), high.map(|x| x + margin(&high))]
            })
            .collect();
        let bins = Bins::new(&boxes);
        let meetings = |&node: &u32| {
            let sides = bins.at(&self.positions[node as usize]).iter();
            sides.filter_map(|&side| Some((node, self.meeting(node, side)?))).collect::<Vec<_>>()
        };
        let mut found: Vec<(u32, Meeting)> = nodes.par_iter().flat_map_iter(meetings).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    fn meeting(&self, node: u32, number: u32) -> Option<Meeting> {
        let BoundarySide { side, cell } = self.boundary[number as usize];
        if self.cell_nodes(cell).contains(&node) {
            return None;
        }
        let x = self.positions[node as usize];
        let tolerance = Self::tolerance(self.node_size[node as usize].min(self.size(cell)), &x);
        let is_near = |at: [f64; D]| dot(minus(x, at), minus(x, at)) <= tolerance * tolerance;
        let corner = side.nodes().iter().find(|corner| is_near(self.positions[**corner as usize]));
        if let Some(corner) = corner {
            return Some(Meeting::Corner(*corner));
        }
        self.is_on(&side, cell, &x, tolerance).then_some(Meeting::Inside(number))
    }

    /// True if a position is on a side of a cell.
    fn is_on(&self, side: &super::Side, cell: u32, x: &[f64; D], tolerance: f64) -> bool {
        let at = |k: usize| self.positions[side.nodes()[k] as usize];
        match side.nodes().len() {
            2 => distance_squared(x, at(0), at(1)) <= tolerance * tolerance,
            3 => {
                let corners = [0, 1, 2].map(|k| padded(&at(k)));
                distance_squared_of_triangle(padded(x), corners) <= tolerance * tolerance
            }
            _ => {
                let corners = self.cell(cell);
                let Some(xi) = corners.shape.inverse(&corners, x) else { return false };
                let nodes = self.cell_nodes(cell).iter().enumerate();
                let mut on_side = nodes.filter(|(_, node)| side.nodes().contains(node)).map(|(k, _)| k);
                let Some(first) = on_side.next().map(|k| corners.shape.node_coordinates::<D>(k)) else {
                    return false;
                };
                let fixed = on_side.fold([true; D], |fixed, k| {
                    let other = corners.shape.node_coordinates::<D>(k);
                    std::array::from_fn(|d| fixed[d] && first[d] == other[d])
                });
                let nearest =
                    std::array::from_fn(|d| if fixed[d] { first[d] } else { xi[d].clamp(-1.0, 1.0) });
                let away = minus(*x, corners.shape.map(&corners, nearest));
                dot(away, away) <= tolerance * tolerance
            }
        }
    }

    /// For each node, the lowest node that is connected to it by cells, directly or through other nodes.
    fn parts(&self) -> Vec<u32> {
        fn root(parent: &mut [u32], mut node: u32) -> u32 {
            while parent[node as usize] != node {
                parent[node as usize] = parent[parent[node as usize] as usize];
                node = parent[node as usize];
            }
            node
        }
        let mut parent: Vec<u32> = (0..self.n_nodes() as u32).collect();
        for cell in 0..self.n_cells() as u32 {
            let nodes = self.cell_nodes(cell);
            for &node in &nodes[1..] {
                let (a, b) = (root(&mut parent, nodes[0]), root(&mut parent, node));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        (0..self.n_nodes() as u32).map(|node| root(&mut parent, node)).collect()
    }
}

impl<const D: usize> Cell<D> {
    /// Triangles or tetrahedra that make up the cell. A hexahedron is divided at its centre and its face centres, so
    /// that neighbours agree on their common face.
    fn simplices(&self) -> Vec<Simplex<D>> {
        let simplex = |corners: [usize; 4]| corners.map(|k| self.x[k]);
        match (self.shape, D) {
            (ElementShape::Simplex, _) => vec![simplex([0, 1, 2, 3])],
            (ElementShape::Box, 3) => {
                let mean = |list: &[usize]| -> [f64; D] {
                    std::array::from_fn(|d| {
                        list.iter().map(|k| self.x[*k][d]).sum::<f64>() / list.len() as f64
                    })
                };
                let centre = mean(&[0, 1, 2, 3, 4, 5, 6, 7]);
                let pyramids = |side: &'static [usize]| {
                    let middle = mean(side);
                    (0..4).map(move |k| [self.x[side[k]], self.x[side[(k + 1) % 4]], middle, centre])
                };
                self.shape.sides::<D>().iter().flat_map(|side| pyramids(side)).collect()
            }
            (ElementShape::Box, _) => vec![simplex([0, 1, 2, 3]), simplex([0, 2, 3, 1])],
        }
    }
}

/// True if two boxes overlap by more than `tolerance` along every axis.
fn meet<const D: usize>(a: &Bounds<D>, b: &Bounds<D>, tolerance: f64) -> bool {
    (0..D).all(|d| a[1][d].min(b[1][d]) - a[0][d].max(b[0][d]) > tolerance)
}

/// The parts of `first` inside `second`, at least `tolerance` away from the sides of `second`.
fn common<const D: usize>(first: &Simplex<D>, second: &Simplex<D>, tolerance: f64) -> Vec<Simplex<D>> {
    let mut pieces = vec![*first];
    for k in 0..=D {
        let base = second[(k + 1) % (D + 1)];
        let normal = inner_normal(second, k);
        let depth = |x: &[f64; D]| dot(normal, minus(*x, base)) - tolerance;
        let mut left = Vec::new();
        for piece in &pieces {
            cut(*piece, piece.map(|x| depth(&x)), &mut left);
        }
        pieces = left;
    }
    pieces.retain(|piece| {
        let depth = dot(inner_normal(piece, 0), minus(piece[0], piece[1]));
        depth > 0.0
    });
    pieces
}

/// Unit normal of the side opposite to a corner, towards that corner; in either direction, or NaN, for a degenerate
/// simplex.
fn inner_normal<const D: usize>(simplex: &Simplex<D>, corner: usize) -> [f64; D] {
    let at = |k: usize| simplex[(corner + k) % (D + 1)];
    let edge = padded(&minus(at(2), at(1)));
    let normal = if D == 3 {
        vector_product(edge, padded(&minus(at(3), at(1))))
    } else {
        vector_product(edge, [0.0, 0.0, 1.0])
    };
    let height = dot(normal, padded(&minus(at(0), at(1))));
    let scale = height.signum() / dot(normal, normal).sqrt();
    std::array::from_fn(|d| scale * normal[d])
}

/// Adds the pieces of a simplex in which a linear function with these corner values is positive.
fn cut<const D: usize>(simplex: Simplex<D>, values: [f64; 4], pieces: &mut Vec<Simplex<D>>) {
    let Some(i) = (0..=D).find(|&k| values[k] > 0.0) else { return };
    let Some(j) = (0..=D).find(|&k| values[k] < 0.0) else {
        pieces.push(simplex);
        return;
    };
    let t = values[i] / (values[i] - values[j]);
    let between: [f64; D] = std::array::from_fn(|d| simplex[i][d] + t * (simplex[j][d] - simplex[i][d]));
    for corner in [i, j] {
        let (mut half, mut at) = (simplex, values);
        half[corner] = between;
        at[corner] = 0.0;
        cut(half, at, pieces);
    }
}

fn middle<const D: usize>(simplex: &Simplex<D>) -> [f64; D] {
    std::array::from_fn(|d| simplex[..=D].iter().map(|x| x[d]).sum::<f64>() / (D + 1) as f64)
}
