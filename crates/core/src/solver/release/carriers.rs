//! The material that carries the forces which a stage releases.
//!
//! What a removed body carried acts on the sides of domains that its removal exposes: each gets the traction σ n of its
//! material point, corrected so that the nodal forces of all sides together come as close as possible to those that
//! maintain equilibrium. The weight of an added body acts on its points. What is then left stays at nodes, which do not
//! follow the material: all of it with standard points, which have no sides.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::basis::{Connectivity, Method};
use crate::grid::MAX_CORNERS;
use crate::model::{Model, Released, SideForce, Stage};
use crate::points::Points;
use crate::region::vector::{along, minus, norm};
use crate::region::{BoxTree, around};
use crate::surface::{
    DomainSide, OuterSides, contains, corner_count, corners_of, deformed_corners, side_basis, sides_of_domain,
};
use crate::terms::external_force::forces_on_points;
use crate::terms::water::forces_on_points as forces_of_water;

/// Distance beyond a side at which a removed domain is looked for, relative to the size of the domain, [-].
const BEYOND: f64 = 0.1;
/// Force on a node, relative to the largest one, above which the node counts as out of balance, [-].
const OUT_OF_BALANCE: f64 = 1e-3;
/// Reduction of the gradient of the squares at which the least squares end, [-], and largest number of iterations.
const ACCURACY: f64 = 1e-13;
const MOST_ITERATIONS: usize = 500;

/// What a stage has exchanged.
pub(in crate::solver) struct Exchange<const D: usize> {
    /// The domains of the bodies that it has removed.
    pub removed: RemovedDomains<D>,
    /// Out-of-balance force that may be round-off, and is not released, [force].
    pub left: f64,
}

/// The domains that a stage removes, in the state in which it begins.
pub(in crate::solver) struct RemovedDomains<const D: usize> {
    domains: Vec<Vec<[f64; D]>>,
    tree: BoxTree<D>,
    /// True if points without domains are removed, or conditions are released: what they exposed is not known.
    hides_some: bool,
}

impl<const D: usize> RemovedDomains<D> {
    /// The domains that `stage` will remove from the points. All ranks must call this together.
    pub(in crate::solver) fn new(model: &Model<D>, points: &Points<D>, stage: &Stage<D>) -> Self {
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let (mut own, mut hides_some): (Vec<Vec<f64>>, bool) = (Vec::new(), !stage.released.is_empty());
        for p in (0..points.len()).filter(|&p| stage.removed.contains(&usize::from(points.body[p]))) {
            if model.bodies[usize::from(points.body[p])].method == Method::Mpm {
                hides_some = true;
            } else {
                own.push(deformed_corners(points, p, &mut buffer).as_flattened().to_vec());
            }
        }
        let reduction = points.reduction();
        let vectors = |numbers: Vec<f64>| numbers.as_chunks::<D>().0.to_vec();
        let domains: Vec<Vec<[f64; D]>> = reduction.join(own).into_iter().map(vectors).collect();
        let boxes: Vec<_> = domains.iter().map(|corners| around(corners)).collect();
        RemovedDomains { tree: BoxTree::new(&boxes), domains, hides_some: reduction.any(hides_some) }
    }

    /// True if a removed domain contains this position.
    fn contains(&self, x: &[f64; D]) -> bool {
        let is_around = |[low, high]: &[[f64; D]; 2]| (0..D).all(|d| low[d] <= x[d] && x[d] <= high[d]);
        let mut found = false;
        self.tree
            .visit(is_around, |item| found |= contains(&self.domains[self.tree.order[item] as usize], x));
        found
    }
}

/// A side or a point that may carry force, with the basis of the grid on it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Carrier {
    /// Permanent number of the point.
    point: u32,
    /// Number of corners of its domain, and the number of the side; 0 for the point itself.
    corners: u8,
    side: u8,
    /// Force that it carries at first, [force].
    force: Vec<f64>,
    /// Area; 0 for a point.
    weight: f64,
    /// Lasting numbers of nodes, and the mean of N_v over the side, or S_vp, [-].
    basis: Vec<(u32, f64)>,
}

/// Forces on nodes, by their lasting numbers, [force].
type OnNodes<const D: usize> = BTreeMap<u32, [f64; D]>;

fn largest<const D: usize>(forces: &OnNodes<D>) -> f64 {
    forces.values().map(norm).fold(0.0, f64::max)
}

fn total<const D: usize>(forces: &OnNodes<D>) -> f64 {
    forces.values().flatten().map(|f| f * f).sum::<f64>().sqrt()
}

/// Distributes forces on grid nodes that maintain equilibrium, [force], to the material. All ranks must call this
/// together; all get the same forces.
pub(super) fn carried_by_material<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    forces: Vec<(u32, [f64; D])>,
    exchange: &Exchange<D>,
) -> Released<D> {
    let Exchange { removed, left } = exchange;
    let mut forces: OnNodes<D> = forces.into_iter().collect();
    let mut released = Released { cuts_before: points.cuts.len(), ..Released::default() };
    if total(&forces) <= *left {
        return released;
    }
    // Lines of a moving grid follow the material where conditions held it.
    if model.moving_grid.is_some() {
        released.nodes.extend(forces);
        return released;
    }
    let vector = |carrier: &Carrier| std::array::from_fn(|d| carrier.force.get(d).copied().unwrap_or(0.0));
    let mut added = joined(points, weights_of_added(model, points, links));
    carry(&mut forces, &mut added, false);
    released.points.extend(added.iter().map(|carrier| (carrier.point, vector(carrier))));
    let mut sides = joined(points, exposed_sides(model, points, links, removed, &forces));
    carry(&mut forces, &mut sides, true);
    released.sides.extend(sides.iter().map(|carrier| SideForce {
        point: carrier.point,
        corners: carrier.corners,
        side: carrier.side,
        force: vector(carrier),
    }));
    if total(&forces) > *left {
        released.nodes.extend(forces);
    }
    released
}

/// The carriers of all ranks, in the order of the permanent numbers.
fn joined<const D: usize>(points: &Points<D>, own: Vec<Carrier>) -> Vec<Carrier> {
    let mut all = points.reduction().join(own);
    all.sort_unstable_by_key(|carrier| (carrier.point, carrier.side));
    all
}

/// A point as the carrier of a force, [force].
fn point_carrier<const D: usize>(
    points: &Points<D>,
    links: &Connectivity<D>,
    p: usize,
    force: [f64; D],
) -> Carrier {
    let nodes = links.nodes_of(links.group_of(p));
    let mut basis = Vec::new();
    links.for_each_value(p, |local, value| {
        basis.push((links.lasting_number(nodes[local] as usize), value));
    });
    Carrier { point: points.id[p], force: force.to_vec(), basis, ..Carrier::default() }
}

/// The points of bodies that the current stage adds, each with a force that cancels its loads.
fn weights_of_added<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<Carrier> {
    let stage = &model.stages[model.present.stage];
    if stage.added.body.is_empty() {
        return Vec::new();
    }
    let bodies: BTreeSet<u16> = stage.added.body.iter().copied().collect();
    let is_added = |p: &usize| bodies.contains(&points.body[*p]);
    // Loads without a finite value end the run when the terms begin the stage.
    let start = model.stepping.start_time;
    let Ok((loads, _)) = forces_on_points(model, points, |load| load.curve.factor(start)) else {
        return Vec::new();
    };
    let water = forces_of_water(model, points, start);
    let force = |p: usize| std::array::from_fn(|d| -loads[p][d] - water.get(p).map_or(0.0, |force| force[d]));
    let added = (0..points.len()).filter(is_added);
    added.map(|p| point_carrier(points, links, p, force(p))).collect()
}

/// The sides that the stage has exposed, with the tractions of the stress of their points.
fn exposed_sides<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    removed: &RemovedDomains<D>,
    forces: &OnNodes<D>,
) -> Vec<Carrier> {
    if removed.domains.is_empty() && !removed.hides_some {
        return Vec::new();
    }
    let mut outer = OuterSides::default();
    outer.find(points, &points.reduction());
    let enough = OUT_OF_BALANCE * largest(forces);
    let mut found = Vec::new();
    let mut buffer = [[0.0; D]; MAX_CORNERS];
    for p in 0..points.len() {
        let (mask, method) = (outer.of_point(points.id[p]), model.bodies[usize::from(points.body[p])].method);
        if mask == 0 || method == Method::Mpm {
            continue;
        }
        let n = corner_count(points, p);
        for (number, side) in sides_of_domain::<D>(n).enumerate() {
            if mask >> number & 1 == 0 {
                continue;
            }
            let was_covered = removed.contains(&beyond(&side, deformed_corners(points, p, &mut buffer)));
            if !was_covered && !removed.hides_some {
                continue;
            }
            let values = side_basis(model.grid.as_ref(), links, points, p, &side, method);
            let basis: Vec<(u32, f64)> = values
                .into_iter()
                .map(|(node, value)| (links.lasting_number(node as usize), value))
                .collect();
            let lacks = |(node, _): &(u32, f64)| forces.get(node).is_some_and(|force| norm(force) > enough);
            if !was_covered && !basis.iter().all(lacks) {
                continue;
            }
            let corners = corners_of(points, p, &mut buffer);
            let depth = model.depth(&side.centre(corners));
            let area = side.area(corners).map(|a| depth * a);
            let stress = points.cauchy_stress(p);
            let force = |i: usize| (0..D).map(|j| stress.component(i, j) * area[j]).sum::<f64>();
            let force = if was_covered { (0..D).map(force).collect() } else { vec![0.0; D] };
            let (corners, side) = (n as u8, number as u8);
            found.push(Carrier { point: points.id[p], corners, side, force, weight: norm(&area), basis });
        }
    }
    found
}

/// A position just outside a side of a domain with these corners, [length].
fn beyond<const D: usize>(side: &DomainSide, corners: &[[f64; D]]) -> [f64; D] {
    let [low, high] = around(corners);
    let area = side.area(corners);
    let size = norm(&area);
    let distance = if size > 0.0 { BEYOND * norm(&minus(&high, &low)) / size } else { 0.0 };
    along(&side.centre(corners), distance, &area)
}

/// Takes the forces of carriers away from the forces on the nodes. If `may_change`, the forces of the carriers first
/// change by what reduces the squares of the remaining nodal forces most, with the smallest change per weight: least
/// squares by conjugate gradients.
fn carry<const D: usize>(forces: &mut OnNodes<D>, carriers: &mut [Carrier], may_change: bool) {
    if carriers.is_empty() {
        return;
    }
    let nodes: BTreeMap<u32, usize> = {
        let touched = carriers.iter().flat_map(|carrier| carrier.basis.iter().map(|(node, _)| *node));
        let mut all: Vec<u32> = touched.chain(forces.keys().copied()).collect();
        all.sort_unstable();
        all.dedup();
        all.into_iter().zip(0..).collect()
    };
    let rows: Vec<Vec<(usize, f64)>> = (carriers.iter())
        .map(|carrier| carrier.basis.iter().map(|(node, value)| (nodes[node], *value)).collect())
        .collect();
    let roots: Vec<f64> = carriers.iter().map(|carrier| carrier.weight.sqrt()).collect();
    let mut rest = vec![[0.0; D]; nodes.len()];
    forces.iter().for_each(|(node, force)| rest[nodes[node]] = *force);
    for (row, carrier) in rows.iter().zip(carriers.iter()) {
        for (node, value) in row {
            (0..D).for_each(|d| rest[*node][d] -= value * carrier.force[d]);
        }
    }
    if may_change {
        let changes = least_squares(&rows, &roots, &mut rest);
        for (carrier, change) in carriers.iter_mut().zip(changes) {
            carrier.force.iter_mut().zip(change).for_each(|(force, change)| *force += change);
        }
    }
    *forces = nodes.into_iter().map(|(node, number)| (node, rest[number])).collect();
}

/// The changes g of the forces of carriers with the smallest Σ |g|²/w that minimise the squares of what they leave of
/// the nodal forces `rest`; the rows hold the nodes of each carrier with their values, and `roots` are √w.
fn least_squares<const D: usize>(
    rows: &[Vec<(usize, f64)>],
    roots: &[f64],
    rest: &mut [[f64; D]],
) -> Vec<[f64; D]> {
    let gradient = |rest: &[[f64; D]]| -> Vec<[f64; D]> {
        let at = |(row, root): (&Vec<(usize, f64)>, &f64)| {
            std::array::from_fn(|d| {
                root * row.iter().map(|(node, value)| value * rest[*node][d]).sum::<f64>()
            })
        };
        rows.iter().zip(roots).map(at).collect()
    };
    let on_nodes = |forces: &[[f64; D]]| -> Vec<[f64; D]> {
        let mut sum = vec![[0.0; D]; rest.len()];
        for ((row, root), force) in rows.iter().zip(roots).zip(forces) {
            for (node, value) in row {
                (0..D).for_each(|d| sum[*node][d] += root * value * force[d]);
            }
        }
        sum
    };
    let squares = |vectors: &[[f64; D]]| vectors.iter().flatten().map(|x| x * x).sum::<f64>();
    let mut rest_now = rest.to_vec();
    let mut scaled = vec![[0.0; D]; rows.len()];
    let mut slope = gradient(&rest_now);
    let mut direction = slope.clone();
    let mut size = squares(&slope);
    let enough = ACCURACY * ACCURACY * size;
    for _ in 0..MOST_ITERATIONS {
        let moved = on_nodes(&direction);
        let length = squares(&moved);
        if size <= enough || length == 0.0 {
            break;
        }
        let step = size / length;
        let pairs = |to: &mut Vec<[f64; D]>, by: &[[f64; D]], step: f64| {
            to.iter_mut().flatten().zip(by.iter().flatten()).for_each(|(to, by)| *to += step * by);
        };
        pairs(&mut scaled, &direction, step);
        pairs(&mut rest_now, &moved, -step);
        slope = gradient(&rest_now);
        let next = squares(&slope);
        let ratio = next / size;
        for (direction, slope) in direction.iter_mut().flatten().zip(slope.iter().flatten()) {
            *direction = slope + ratio * *direction;
        }
        size = next;
    }
    rest.copy_from_slice(&rest_now);
    scaled.iter().zip(roots).map(|(force, root)| force.map(|f| root * f)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carriers_take_over_forces_on_nodes() {
        // Three sides of length 1 along a line of nodes with a spacing of 1.5, and the nodal forces of a traction that
        // is not that of their points.
        let basis = |x: f64| {
            let node = (x / 1.5).floor();
            vec![(node as u32, 1.0 - (x / 1.5 - node)), (node as u32 + 1, x / 1.5 - node)]
        };
        let carrier = |k: u32, force: f64| Carrier {
            point: k,
            force: vec![force, 0.0],
            weight: 1.0,
            basis: basis(f64::from(k) + 0.5),
            ..Carrier::default()
        };
        let mut forces = OnNodes::<2>::new();
        for k in 0..3 {
            for (node, value) in basis(f64::from(k) + 0.5) {
                let force = forces.entry(node).or_insert([0.0; 2]);
                *force = [force[0] + 2.0 * value, force[1] - 3.0 * value];
            }
        }
        let mut carriers: Vec<Carrier> = (0..3).map(|k| carrier(k, 1.5)).collect();
        carry(&mut forces, &mut carriers, true);
        assert!(total(&forces) < 1e-12, "{forces:?}");
        for carrier in &carriers {
            assert!(
                (carrier.force[0] - 2.0).abs() < 1e-12 && (carrier.force[1] + 3.0).abs() < 1e-12,
                "{carrier:?}"
            );
        }
    }
}
