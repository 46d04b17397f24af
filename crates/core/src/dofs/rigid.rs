//! Rigid-body motions that boundary conditions leave free, determined from the held degrees of freedom.
//!
//! The grid represents every translation and every small rotation exactly, so a part of the bodies whose held degrees
//! of freedom do not prevent such a motion has a singular stiffness as long as it is free of stress.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DMatrix;

use crate::basis::{Connectivity, JoinedParts};
use crate::model::{Model, NodeSet};
use crate::points::Points;
use crate::ranks::Reduction;
use crate::surface::support;

use super::DofMap;

/// A motion counts as free if its eigenvalue, relative to the largest, is below this. Two held nodes at one end of a
/// body a million cells long still yield a larger eigenvalue.
const FREE: f64 = 1e-13;

/// A part of the bodies, connected through the grid, that can move as a rigid body.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePart<const D: usize> {
    /// The bodies with points in this part, ascending.
    pub bodies: Vec<u16>,
    /// True if these bodies have no points in other parts.
    pub whole: bool,
    /// Position of one of its nodes, [length].
    pub node: [f64; D],
    /// Axes along which nothing holds the part.
    pub axes: Vec<usize>,
    /// Other directions along which nothing holds the part, unit vectors perpendicular to each other and to these axes.
    pub directions: Vec<[f64; D]>,
    /// Number of independent free motions besides these translations.
    pub rotations: usize,
    /// Centre of rotation, [length], if one rotation in the plane is the only free motion.
    pub centre: Option<[f64; D]>,
}

/// Sums over the nodes of a part.
struct Part<const D: usize> {
    /// Sum of the node positions, and their number.
    sum: [f64; D],
    n_nodes: usize,
    low: [f64; D],
    high: [f64; D],
    /// Σ rᵀ r over the held degrees of freedom; each row r contains the displacement of one degree of freedom in every
    /// rigid motion.
    gram: DMatrix<f64>,
}

/// Number of rigid motions in `D` dimensions: translations, then rotations in the plane of each pair of axes.
const fn n_motions(dimensions: usize) -> usize {
    dimensions * (dimensions + 1) / 2
}

/// The parts that are free to move in the step that `dofs` describes, in the order of their lowest nodes. All ranks
/// must call this together.
#[inline(never)]
pub fn free_parts<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    dofs: &DofMap<D>,
) -> Vec<FreePart<D>> {
    let (joined, reduction) = (links.joined_parts(), links.reduction());
    let place = |node: usize| model.grid.node_position(links.active_nodes()[node] as usize);
    let mut parts: Vec<Part<D>> = joined.lowest.iter().map(|_| Part::empty()).collect();
    for (node, &part) in joined.at_node.iter().enumerate().filter(|(node, _)| reduction.counts(*node)) {
        parts[part as usize].add(&place(node));
    }
    add_up_nodes(reduction, &mut parts);
    for (node, &part) in joined.at_node.iter().enumerate().filter(|(node, _)| reduction.counts(*node)) {
        let x = place(node);
        dofs.for_each_held_direction(node, |direction| parts[part as usize].hold(&x, direction));
    }
    for (number, condition) in model.boundary_conditions.iter().enumerate() {
        let NodeSet::Surface(on) = condition.nodes else { continue };
        let surface = &model.surfaces[on.surface];
        if !model.is_set(number) {
            continue;
        }
        for (sample, x) in surface.samples.iter().enumerate() {
            let normal = surface.normal(sample);
            let carried = support(model.grid.as_ref(), links, surface.body as u16, x, &normal);
            // Each rank that shares the nodes counts the sample once; the repetition changes only the weight of the
            // held directions.
            let Some(&node) = carried.as_ref().and_then(|carried| carried.nodes().first()) else { continue };
            let part = &mut parts[joined.at_node[node as usize] as usize];
            for displacement in (0..D).filter(|&d| condition.displacement[d].is_some()) {
                part.hold(x, &condition.direction(displacement, normal));
            }
        }
    }
    add_up_held(reduction, &mut parts);
    if model.revolved {
        parts.iter_mut().for_each(Part::resist_by_hoops);
    }
    let mut free: BTreeMap<u32, FreePart<D>> = BTreeMap::new();
    for (number, part) in parts.iter().enumerate() {
        if let Some(motions) = part.free(model.grid.node_position(joined.lowest[number] as usize)) {
            free.insert(number as u32, motions);
        }
    }
    if !free.is_empty() {
        name_bodies(points, links, &joined, &mut free);
    }
    free.into_values().collect()
}

/// Sums the node counts and positions of the parts over all ranks.
fn add_up_nodes<const D: usize>(reduction: &Reduction, parts: &mut [Part<D>]) {
    let mut sums: Vec<f64> = parts.iter().flat_map(|part| part.sum).collect();
    sums.extend(parts.iter().map(|part| part.n_nodes as f64));
    reduction.sum(&mut sums);
    // The lowest coordinates are the negatives of the largest negated coordinates.
    let mut ends: Vec<f64> = parts.iter().flat_map(|part| part.low.map(|x| -x)).collect();
    ends.extend(parts.iter().flat_map(|part| part.high));
    reduction.maximum(&mut ends);
    let n = parts.len();
    for (k, part) in parts.iter_mut().enumerate() {
        part.sum = std::array::from_fn(|d| sums[D * k + d]);
        part.n_nodes = sums[D * n + k] as usize;
        part.low = std::array::from_fn(|d| -ends[D * k + d]);
        part.high = std::array::from_fn(|d| ends[D * (n + k) + d]);
    }
}

/// Sums the constraints on each part over all ranks.
fn add_up_held<const D: usize>(reduction: &Reduction, parts: &mut [Part<D>]) {
    let mut sums: Vec<f64> = parts.iter().flat_map(|part| part.gram.iter().copied()).collect();
    reduction.sum(&mut sums);
    for (part, sums) in parts.iter_mut().zip(sums.chunks_exact(n_motions(D).pow(2))) {
        part.gram.copy_from_slice(sums);
    }
}

/// Lists the bodies that have points in each free part.
fn name_bodies<const D: usize>(
    points: &Points<D>,
    links: &Connectivity<D>,
    joined: &JoinedParts,
    free: &mut BTreeMap<u32, FreePart<D>>,
) {
    let mut members: BTreeSet<(u16, u32)> = BTreeSet::new();
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            if let Some(&first) = links.local_nodes(p).first() {
                members.insert((points.body[p], joined.at_node[nodes[first as usize] as usize]));
            }
        }
    }
    let members: BTreeSet<(u16, u32)> = links.reduction().gather_all(members).into_iter().flatten().collect();
    for (part, found) in free.iter_mut() {
        found.bodies = members.iter().filter(|(_, in_part)| in_part == part).map(|(body, _)| *body).collect();
        let elsewhere = |body: &u16| members.iter().any(|(other, in_part)| other == body && in_part != part);
        found.whole = !found.bodies.iter().any(elsewhere);
    }
}

impl<const D: usize> Part<D> {
    fn empty() -> Self {
        let n = n_motions(D);
        Part {
            sum: [0.0; D],
            n_nodes: 0,
            low: [f64::INFINITY; D],
            high: [f64::NEG_INFINITY; D],
            gram: DMatrix::zeros(n, n),
        }
    }

    fn add(&mut self, x: &[f64; D]) {
        self.n_nodes += 1;
        for d in 0..D {
            self.sum[d] += x[d];
            self.low[d] = self.low[d].min(x[d]);
            self.high[d] = self.high[d].max(x[d]);
        }
    }

    /// Centre and size of the part, [length].
    fn frame(&self) -> ([f64; D], f64) {
        let size = (0..D).map(|d| self.high[d] - self.low[d]).fold(f64::MIN_POSITIVE, f64::max);
        (self.sum.map(|sum| sum / self.n_nodes as f64), size)
    }

    /// Adds the resistance of hoops: a body of revolution moves as a rigid body only along its axis, because any other
    /// motion stretches its rings.
    fn resist_by_hoops(&mut self) {
        for motion in (0..n_motions(D)).filter(|&motion| motion != 1) {
            self.gram[(motion, motion)] += 1.0;
        }
    }

    /// Adds a direction in which a node is held; all nodes must already be known.
    fn hold(&mut self, x: &[f64; D], direction: &[f64; D]) {
        let (centre, size) = self.frame();
        let arm: [f64; D] = std::array::from_fn(|d| (x[d] - centre[d]) / size);
        // Displacement along the direction in each rigid motion; the rotation from axis i to axis j is −x_j along i and
        // x_i along j.
        let mut row = vec![0.0; n_motions(D)];
        row[..D].copy_from_slice(direction);
        let mut rotation = D;
        for i in 0..D {
            for j in i + 1..D {
                row[rotation] = arm[i] * direction[j] - arm[j] * direction[i];
                rotation += 1;
            }
        }
        for (a, &by_row) in row.iter().enumerate() {
            for (b, &by_column) in row.iter().enumerate() {
                self.gram[(a, b)] += by_row * by_column;
            }
        }
    }

    /// The motions that are left free; `None` if there are none.
    fn free(&self, node: [f64; D]) -> Option<FreePart<D>> {
        let eigen = self.gram.clone().symmetric_eigen();
        let largest = eigen.eigenvalues.iter().fold(0.0_f64, |a, &b| a.max(b));
        let is_free = |k: &usize| eigen.eigenvalues[*k] <= FREE * largest;
        let null: Vec<usize> = (0..n_motions(D)).filter(is_free).collect();
        if null.is_empty() {
            return None;
        }
        let (axes, directions) = self.free_translations(FREE * largest);
        let rotations = null.len().saturating_sub(axes.len() + directions.len());
        let mut centre = None;
        if let (2, 1, [only]) = (D, rotations, null.as_slice()) {
            let motion = eigen.eigenvectors.column(*only);
            let ((middle, size), turn) = (self.frame(), motion[2]);
            // The displacement (t_x − ω y, t_y + ω x) vanishes at the centre.
            let offset = [-motion[1] / turn, motion[0] / turn];
            let found: [f64; D] = std::array::from_fn(|d| middle[d] + size * offset[d]);
            centre = Some(found).filter(|x| x.iter().all(|x| x.is_finite()));
        }
        Some(FreePart { bodies: Vec::new(), whole: true, node, axes, directions, rotations, centre })
    }

    /// Axes along which the part can translate, and other directions along which it can; eigenvalues up to `bound`
    /// count as zero.
    fn free_translations(&self, bound: f64) -> (Vec<usize>, Vec<[f64; D]>) {
        let (axes, others): (Vec<usize>, Vec<usize>) = (0..D).partition(|&d| self.gram[(d, d)] <= bound);
        if others.is_empty() {
            return (axes, Vec::new());
        }
        let among = DMatrix::from_fn(others.len(), others.len(), |i, j| self.gram[(others[i], others[j])]);
        let eigen = among.symmetric_eigen();
        let mut directions = Vec::new();
        for (vector, _) in
            eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues).filter(|(_, value)| **value <= bound)
        {
            // The sign that makes the component of largest magnitude positive.
            let sign = vector[vector.iamax()].signum();
            let mut direction = [0.0; D];
            for (&d, &component) in others.iter().zip(vector.iter()) {
                direction[d] = sign * component;
            }
            directions.push(direction);
        }
        (axes, directions)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn unit<const D: usize>(axis: usize) -> [f64; D] {
        std::array::from_fn(|d| f64::from(u8::from(d == axis)))
    }

    /// The free motions of a plane box with some nodes held along an axis.
    fn plane(held: &[([f64; 2], usize)]) -> Option<FreePart<2>> {
        let mut part = Part::empty();
        for i in 0..=10 {
            for j in 0..=4 {
                part.add(&[f64::from(i), f64::from(j)]);
            }
        }
        for (x, axis) in held {
            part.hold(x, &unit(*axis));
        }
        part.free([0.0, 0.0])
    }

    #[test]
    fn three_motions_of_a_plane_body() {
        let free =
            |held: &[([f64; 2], usize)]| plane(held).map_or((vec![], 0), |free| (free.axes, free.rotations));
        assert_eq!(free(&[]), (vec![0, 1], 1));
        assert_eq!(free(&[([0.0, 0.0], 0)]), (vec![1], 1));
        assert_eq!(free(&[([0.0, 0.0], 0), ([0.0, 1.0], 0)]), (vec![1], 0));
        assert_eq!(free(&[([0.0, 0.0], 0), ([5.0, 0.0], 0), ([0.0, 0.0], 1)]), (vec![], 1));
        assert_eq!(free(&[([0.0, 0.0], 0), ([0.0, 4.0], 0), ([3.0, 2.0], 1)]), (vec![], 0));
        assert_eq!(free(&[([0.0, 0.0], 1), ([0.1, 0.0], 1), ([3.0, 2.0], 0)]), (vec![], 0));
    }

    #[test]
    fn the_centre_of_a_rotation_is_where_the_held_lines_meet() {
        // Sliding along a floor and a wall at once: the instantaneous centre is above the contact with the floor and
        // level with the contact with the wall.
        let free = plane(&[([7.0, 0.0], 1), ([0.0, 3.0], 0)]).unwrap();
        let centre = free.centre.unwrap();
        assert!((centre[0] - 7.0).abs() < 1e-9 && (centre[1] - 3.0).abs() < 1e-9, "{centre:?}");
        let pinned = plane(&[([2.0, 1.0], 1), ([2.0, 1.0], 0)]).unwrap().centre.unwrap();
        assert!((pinned[0] - 2.0).abs() < 1e-9 && (pinned[1] - 1.0).abs() < 1e-9, "{pinned:?}");
    }

    #[test]
    fn a_body_held_along_an_inclined_direction_can_slide_across_it() {
        let mut part = Part::<2>::empty();
        for corner in 0..4 {
            part.add(&std::array::from_fn(|d| f64::from(corner >> d & 1)));
        }
        let (sine, cosine) = 30f64.to_radians().sin_cos();
        for x in [[0.0, 0.0], [1.0, 0.0]] {
            part.hold(&x, &[-sine, cosine]);
        }
        let free = part.free([0.0; 2]).unwrap();
        assert_eq!((free.axes, free.rotations, free.centre), (vec![], 0, None));
        let [along] = free.directions.as_slice() else { panic!("{:?}", free.directions) };
        assert!((along[0] - cosine).abs() < 1e-12 && (along[1] - sine).abs() < 1e-12, "{along:?}");

        let mut pinned = Part::<3>::empty();
        for corner in 0..8 {
            pinned.add(&std::array::from_fn(|d| f64::from(corner >> d & 1)));
        }
        pinned.hold(&[0.0; 3], &[0.0, -sine, cosine]);
        let free = pinned.free([0.0; 3]).unwrap();
        assert_eq!((free.axes, free.directions.len(), free.rotations), (vec![0], 1, 3));
    }

    #[test]
    fn six_motions_of_a_solid_body() {
        let free = |held: &[([f64; 3], usize)]| {
            let mut part = Part::<3>::empty();
            for corner in 0..8 {
                part.add(&std::array::from_fn(|d| f64::from(corner >> d & 1)));
            }
            for (x, axis) in held {
                part.hold(x, &unit(*axis));
            }
            part.free([0.0; 3]).map_or((vec![], 0), |free| (free.axes, free.rotations))
        };
        let corner = [0.0; 3];
        assert_eq!(free(&[]), (vec![0, 1, 2], 3));
        assert_eq!(free(&[(corner, 0), (corner, 1), (corner, 2)]), (vec![], 3));
        let hinge = [([0.0, 0.0, 1.0], 0), ([0.0, 0.0, 1.0], 1)];
        let pinned = [(corner, 0), (corner, 1), (corner, 2), hinge[0], hinge[1]];
        assert_eq!(free(&pinned), (vec![], 1));
        let held: Vec<_> = pinned.into_iter().chain([([1.0, 0.0, 0.0], 1)]).collect();
        assert_eq!(free(&held), (vec![], 0));
    }
}
