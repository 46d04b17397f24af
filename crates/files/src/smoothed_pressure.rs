//! Pressures smoothed over the grid, for pictures; the analysis never uses them.
//!
//! Pressures of points alternate where cells lock, and from cell to cell where a cell has one volume ratio. Their means at
//! the nodes, p_v = Σ S_vp V_p p_p / Σ S_vp V_p over the points of one body, do not; each point then takes Σ S_vp p_v. S_vp
//! is the linear basis of the grid at the current position, for all methods.

use std::collections::HashMap;

use mpm_core::model::Model;
use mpm_core::points::Points;

use super::fields::pressure;

/// A node of the grid, as it carries one body.
type NodeOfBody = (u16, u32);

/// Pressure of some points, smoothed over the points of their body among them, [stress]. Constant pressures are
/// reproduced; all values lie between the pressures of the points around. `volumes` has J and the current volume of each
/// of these points, [-] and [volume].
pub fn smoothed_pressures<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    order: &[usize],
    volumes: &[[f64; 2]],
) -> Vec<f64> {
    // Round-off may give a point on the border of its cell a negative basis value.
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
    let smoothed = |&p: &usize| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (node, value) in links(p) {
            if let Some([of_node, of_weight]) = means.get(&node).filter(|[_, of_weight]| *of_weight > 0.0) {
                sum += value * of_node / of_weight;
                weight += value;
            }
        }
        sum / weight
    };
    order.iter().map(smoothed).collect()
}
