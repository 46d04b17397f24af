//! Forces on material points, on the nodes.

use crate::basis::Connectivity;
use crate::step::Nodal;

/// Nodal forces of eq. (29) for forces on the points, [force].
pub(super) fn on_nodes<const D: usize>(links: &Connectivity<D>, at_points: &[[f64; D]]) -> Nodal<D> {
    let mut force = vec![[0.0; D]; links.n_active()];
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            if at_points[p] == [0.0; D] {
                continue; // true of most points if forces act on only a few
            }
            links.for_each_value(p, |local, value| {
                let node = &mut force[nodes[local] as usize];
                for d in 0..D {
                    node[d] += value * at_points[p][d];
                }
            });
        }
    }
    force
}
