//! The residual of each body alone, which the residual of a part with several bodies may hide.

use std::collections::BTreeMap;

use crate::basis::{Connectivity, TouchedBy};
use crate::model::Model;
use crate::points::Points;
use crate::ranks::Reduction;

use super::round_off::{ACCUMULATED, IN_MOTION, IN_STRAIN, forces_of_unit_strain};
use super::{Forces, ratio};

/// For each body, the out-of-balance force beyond round-off at the nodes that no other body touches, relative to the
/// larger of two forces: that on these nodes, and that which the points of the body exert on shared nodes, [-]. Empty
/// for a single body, 0 for a body without forces.
///
/// The residual of a part with several bodies is relative to all forces on the part. A body that carries little
/// compared with the others may then be out of balance unnoticed.
pub(crate) fn body_residuals<const D: usize, const N: usize>(
    forces: &Forces<'_, N>,
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<f64> {
    let bodies = model.bodies.len();
    if bodies < 2 {
        return Vec::new();
    }
    let reduction = links.reduction();
    let touched = links.bodies_at_nodes(points);
    let mut passed_on: BTreeMap<(u16, u32), [f64; D]> = BTreeMap::new();
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            let stress = &points.trial.kirchhoff_stress[p];
            links.for_each_link(p, |place, _, gradient| {
                let node = nodes[place];
                if touched[node as usize] == TouchedBy::Several {
                    let force = passed_on.entry((points.body[p], node)).or_insert([0.0; D]);
                    for i in 0..D {
                        let traction: f64 = (0..D).map(|j| stress.component(i, j) * gradient[j]).sum();
                        force[i] += traction * points.original_volume[p];
                    }
                }
            });
        }
    }
    let mut sums = vec![[0.0; 3]; bodies]; // squares: out of balance, on the body, on shared nodes
    if !reduction.is_alone() {
        passed_on = complete(passed_on, bodies, reduction, links.n_active());
    }
    for ((body, node), force) in &passed_on {
        if reduction.counts(*node as usize) {
            sums[*body as usize][2] += force.iter().map(|f| f * f).sum::<f64>();
        }
    }
    // A motion by one cell and a strain of one are assumed, because the stiffness is no longer available.
    let round_off = f64::EPSILON * ACCUMULATED * (IN_MOTION + IN_STRAIN);
    let unit = forces_of_unit_strain(model, points, links);
    for (node, touched) in touched.iter().enumerate().filter(|(node, _)| reduction.counts(*node)) {
        let TouchedBy::One(body) = touched else { continue };
        let [out, on, _] = &mut sums[usize::from(*body)];
        let beyond = |f: &f64| if f.abs() > round_off * unit[node] { f * f } else { 0.0 };
        *out += forces.out_of_balance[node][..D].iter().map(beyond).sum::<f64>();
        *on += forces.total(node)[..D].iter().map(|f| f * f).sum::<f64>();
    }
    reduction.sum(sums.as_flattened_mut());
    sums.into_iter().map(|[out, on, passed_on]| ratio(out.sqrt(), on.max(passed_on).sqrt())).collect()
}

/// Forces of bodies on nodes, added up over all ranks.
fn complete<const D: usize>(
    forces: BTreeMap<(u16, u32), [f64; D]>,
    bodies: usize,
    reduction: &Reduction,
    n_nodes: usize,
) -> BTreeMap<(u16, u32), [f64; D]> {
    let mut all = BTreeMap::new();
    for body in 0..bodies as u16 {
        let mut body_force = vec![[0.0; D]; n_nodes];
        for ((_, node), force) in forces.range((body, 0)..=(body, u32::MAX)) {
            body_force[*node as usize] = *force;
        }
        reduction.complete(&mut body_force);
        let acting = (0u32..).zip(body_force).filter(|(_, force)| *force != [0.0; D]);
        all.extend(acting.map(|(node, force)| ((body, node), force)));
    }
    all
}
