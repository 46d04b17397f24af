//! Pressures smoothed over the grid, for pictures; the analysis never uses them.
//!
//! Point pressures alternate where cells lock, and from cell to cell where a cell has a single volume ratio. Their
//! nodal means over the points of one body, p_v = Σ S_vp V_p p_p / Σ S_vp V_p, do not alternate; each point then takes
//! Σ S_vp p_v. S_vp is the linear basis of the grid at the current position, for all methods.

use std::collections::HashMap;

use mpm_core::model::Model;
use mpm_core::points::Points;
use mpm_core::ranks::Ranks;

use super::fields::pressure;

/// A body and a node of the grid to which points of the body contribute.
type NodeOfBody = (u16, u32);

/// Pressures of the points in `order`, smoothed over points of the same body, [stress]. Constant pressures are
/// reproduced; all values lie between the pressures of the surrounding points. `volumes` holds J and the current volume
/// of each of these points, [-] and [volume]. All ranks must call this together.
pub fn smoothed_pressures<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    order: &[usize],
    volumes: &[[f64; 2]],
) -> Vec<f64> {
    // Round-off may give a point on the boundary of its cell a negative basis value.
    let links = |p: usize| {
        let (_, basis) = model.grid.basis_near(&points.converged.position[p], Some(points.cell[p]));
        let body = points.body[p];
        (0..basis.nodes().len()).map(move |n| ((body, basis.nodes()[n]), basis.value()[n].max(0.0)))
    };
    let mut means: HashMap<NodeOfBody, [f64; 2]> = HashMap::new();
    for (&p, [ratio, volume]) in order.iter().zip(volumes) {
        let pressure = pressure(&points.converged.kirchhoff_stress[p]) / ratio;
        for (node, value) in links(p) {
            let [sum, weight] = means.entry(node).or_default();
            *sum += value * volume * pressure;
            *weight += value * volume;
        }
    }
    add_up(&points.ranks, &mut means);
    let smoothed = |&p: &usize| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (node, value) in links(p) {
            if let Some([nodal_sum, nodal_weight]) =
                means.get(&node).filter(|[_, nodal_weight]| *nodal_weight > 0.0)
            {
                sum += value * nodal_sum / nodal_weight;
                weight += value;
            }
        }
        sum / weight
    };
    order.iter().map(smoothed).collect()
}

/// A node of a body with its sum and weight, on the way to another rank.
type Sent = (NodeOfBody, [f64; 2]);

/// Adds up the sums of the nodes that several ranks touch. Each node has a home rank, which adds the contributions in
/// rank order and returns the total to these ranks.
fn add_up(ranks: &Ranks, means: &mut HashMap<NodeOfBody, [f64; 2]>) {
    if ranks.is_alone() {
        return;
    }
    let mut messages: Vec<(usize, Vec<Sent>)> = (0..ranks.count()).map(|rank| (rank, Vec::new())).collect();
    for (node, sums) in means.iter() {
        messages[node.1 as usize % ranks.count()].1.push((*node, *sums));
    }
    messages.iter_mut().for_each(|(_, sent)| sent.sort_unstable_by_key(|(node, _)| *node));
    let received = ranks.exchange(messages);
    let mut totals: HashMap<NodeOfBody, [f64; 2]> = HashMap::new();
    for (node, [sum, weight]) in received.iter().flat_map(|(_, sent)| sent) {
        let total = totals.entry(*node).or_default();
        total[0] += sum;
        total[1] += weight;
    }
    let answer = |sent: &[Sent]| sent.iter().map(|(node, _)| (*node, totals[node])).collect::<Vec<Sent>>();
    let answers = received.iter().map(|(rank, sent)| (*rank, answer(sent))).collect();
    means.extend(ranks.exchange(answers).into_iter().flat_map(|(_, answers)| answers));
}
