//! Prescribed displacements: the boundary conditions of the model at the nodes on which they act.

use crate::basis::Connectivity;
use crate::formula::Formula;
use crate::model::{BoundaryCondition, Model, NodeSet, displacement_at};
use crate::points::{Points, State};
use crate::tensor::Mat3;

use super::{AXES, ConstraintError, Constraints};

impl<const N: usize> Constraints<'_, N> {
    /// Adds the boundary conditions of a model in a step between two times.
    pub(super) fn prescribe<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        [start, end]: [f64; 2],
    ) -> Result<(), ConstraintError> {
        let set = || model.boundary_conditions.iter().enumerate().filter(|(number, _)| model.is_set(*number));
        // Collective calls come before anything that may fail on one rank only.
        let nodes: Vec<_> = set().map(|(_, condition)| nodes_of(condition, points, links)).collect();
        let originals = set()
            .any(|(_, condition)| condition.follows_material())
            .then(|| original_places(model, points, links));
        for ((number, condition), nodes) in set().zip(nodes) {
            // Nothing has moved yet at time 0, whatever the value of the curve.
            let reached = (start > 0.0).then(|| condition.curve.factor(start));
            let factors = [reached, Some(condition.curve.factor(end))];
            let originals = originals.as_ref().filter(|_| condition.follows_material());
            for active in nodes {
                let place = model.grid.node_position(links.active_nodes()[active] as usize);
                let original = originals.map_or(place, |originals| originals[active]);
                for (axis, formula) in condition.displacement.iter().enumerate() {
                    let Some(formula) = formula else { continue };
                    let increment = displacement_increment(formula, &place, &original, factors);
                    if !increment.is_finite() {
                        return Err(ConstraintError::NotFinite {
                            name: condition.name.clone(),
                            axis: AXES[axis % 3],
                            node: place.to_vec(),
                            factor: factors[1].unwrap_or_default(),
                            formula: formula.text().to_owned(),
                            value: increment,
                        });
                    }
                    match &condition.axes {
                        None => self.hold(active, axis, increment, number)?,
                        Some(axes) => {
                            let mut direction = [0.0; N];
                            direction[..D].copy_from_slice(&axes[axis]);
                            self.hold_along(active, direction, increment, number);
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// Change of a prescribed displacement between two load factors; `None` means that nothing has moved yet.
pub fn displacement_increment<const D: usize>(
    formula: &Formula,
    place: &[f64; D],
    original: &[f64; D],
    factors: [Option<f64>; 2],
) -> f64 {
    let at = |factor: Option<f64>| factor.map_or(0.0, |f| displacement_at(formula, place, original, f));
    at(factors[1]) - at(factors[0])
}

/// Added to the weight of each point at a node, so that the sum of the weights is positive even if the basis function of
/// the node vanishes at all points. If the deformation is uniform, this does not change the result.
const MIN_WEIGHT: f64 = 1e-9;

/// Original position of the material at each active node at the start of a step: the mean of the estimates X_p + F_p⁻¹
/// (x − x_p) of the points around it, weighted by the basis functions. The result is exact if the deformation is
/// uniform; otherwise its error is of second order in the cell size.
fn original_places<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<[f64; D]> {
    let mut sums = vec![[0.0; D]; links.n_active()];
    let mut weights = vec![0.0; links.n_active()];
    let State { position, deformation_gradient, .. } = &points.converged;
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            let inverse = deformation_gradient[p].try_inverse().unwrap_or_else(Mat3::identity);
            links.for_each_value(p, |local, value| {
                let active = nodes[local] as usize;
                let x = model.grid.node_position(links.active_nodes()[active] as usize);
                let weight = value.max(0.0) + MIN_WEIGHT;
                let sum = &mut sums[active];
                for i in 0..D {
                    let back: f64 = (0..D).map(|j| inverse[(i, j)] * (x[j] - position[p][j])).sum();
                    sum[i] += weight * (points.original_position[p][i] + back);
                }
                weights[active] += weight;
            });
        }
    }
    links.reduction().complete(&mut sums);
    links.reduction().complete_numbers(&mut weights);
    sums.iter().zip(weights).map(|(sum, weights)| sum.map(|part| part / weights)).collect()
}

/// The active nodes on which a boundary condition acts in a step, ascending.
pub fn nodes_of<const D: usize>(
    condition: &BoundaryCondition<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<usize> {
    match &condition.nodes {
        NodeSet::Fixed(nodes) => nodes.iter().flat_map(|&node| links.copies(node as usize)).collect(),
        NodeSet::Surface(_) => Vec::new(),
        NodeSet::OuterLayer(body) => {
            let mut touched = vec![0.0; links.n_active()];
            for group in 0..links.n_groups() {
                let nodes = links.nodes_of(group);
                for p in links.points_of(group) {
                    if points.outer_layer[p] && points.body[p] == *body {
                        for &local in links.local_nodes(p) {
                            touched[nodes[local as usize] as usize] = 1.0;
                        }
                    }
                }
            }
            links.reduction().largest_at_nodes(&mut touched);
            (0..touched.len()).filter(|&node| touched[node] > 0.0).collect()
        }
    }
}
