//! The forces that a stage releases, on the nodes.

use rustc_hash::FxHashMap;

use crate::basis::Connectivity;
use crate::model::{Model, SideForce};
use crate::points::Points;
use crate::step::Nodal;
use crate::surface::{side_basis, sides_of_domain};

use super::on_points::on_nodes;

/// The forces that the current stage releases, in full, on the active nodes, where the material that carries them is in
/// the converged state, [force]; `None` if it releases nothing.
pub(super) fn released_forces<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Option<Nodal<D>> {
    if model.present.released.is_empty() {
        return None;
    }
    let released = model.present.released.shared_out(points);
    let place: FxHashMap<u32, usize> = points.id.iter().zip(0..).map(|(id, p)| (*id, p)).collect();
    let mut on_points = vec![[0.0; D]; points.len()];
    for (id, force) in &released.points {
        if let Some(&p) = place.get(id) {
            (0..D).for_each(|d| on_points[p][d] += force[d]);
        }
    }
    let mut forces = on_nodes(links, &on_points);
    for (node, force) in &released.nodes {
        // A node without material carries no force.
        let active = links.with_lasting_number(*node);
        if let Some(active) = active.filter(|active| links.reduction().counts(*active)) {
            (0..D).for_each(|d| forces[active][d] += force[d]);
        }
    }
    for SideForce { point, corners, side, force } in &released.sides {
        let Some(&p) = place.get(point) else { continue };
        let Some(side) = sides_of_domain::<D>(usize::from(*corners)).nth(usize::from(*side)) else {
            continue;
        };
        let method = model.bodies[points.body[p] as usize].method;
        for (node, value) in side_basis(model.grid.as_ref(), links, points, p, &side, method) {
            (0..D).for_each(|d| forces[node as usize][d] += value * force[d]);
        }
    }
    Some(forces)
}
