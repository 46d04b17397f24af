//! Degrees of freedom of a load step: which of them boundary conditions prescribe, and the unknowns that are left.

mod covered;
pub mod rigid;

use crate::basis::Connectivity;
use crate::formula::Formula;
use crate::model::{BoundaryCondition, Model, NodeSet};
use crate::points::{Points, State, coordinates};
use crate::tensor::Mat3;

pub use covered::{Covered, covered};

/// Nodes nearer to the axis of revolution than this, relative to the size of the cells around them, lie on it.
pub const ON_AXIS: f64 = 1e-6;

/// What mends [`ConstraintError::LooseAxis`].
pub const HOLD_THE_AXIS: &str = "add `{name: axis, nodes: {x: 0}, fix: [x]}` to the boundary conditions";

/// Two prescribed increments that differ by less than this, relative to their size, agree.
const SAME: f64 = 1e-12;

const AXES: [&str; 3] = ["x", "y", "z"];

/// A boundary condition cannot be applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConstraintError {
    /// Two boundary conditions want different displacements of one node.
    #[error(
        "boundary conditions `{first}` and `{second}` prescribe the increments {a:e} and {b:e} along {axis} at node {node:?}"
    )]
    Conflict {
        /// The one that comes first.
        first: String,
        /// The other.
        second: String,
        /// Position of the grid node, [length].
        node: Vec<f64>,
        /// Name of the axis.
        axis: &'static str,
        /// Increment wanted by the first.
        a: f64,
        /// Increment wanted by the second.
        b: f64,
    },
    /// A formula has no finite value at a node.
    #[error(
        "the displacement of boundary condition `{name}` along {axis} is not finite at node {}: the formula `{formula}` \
         gives {value} at load factor {factor}", coordinates(.node)
    )]
    NotFinite {
        /// The boundary condition.
        name: String,
        /// Name of the axis.
        axis: &'static str,
        /// Position of the grid node, [length].
        node: Vec<f64>,
        /// The load factor.
        factor: f64,
        /// Text of the formula.
        formula: String,
        /// The increment that follows from it.
        value: f64,
    },
    /// Nodes on the axis of a body of revolution are free to leave it, or made to.
    #[error("{loose} of the {all} grid nodes of the body on the axis x = 0 can move off it")]
    LooseAxis {
        /// Number of these nodes.
        loose: usize,
        /// Number of nodes on the axis that points touch.
        all: usize,
    },
}

/// A degree of freedom: free with its unknown, or held by a boundary condition.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Dof {
    Free(u32),
    Held { condition: u16, increment: f64 },
}

/// What each degree of freedom of the active nodes is in one load step.
#[derive(Debug, Clone)]
pub struct DofMap<const D: usize> {
    dofs: Vec<[Dof; D]>,
    n_free: usize,
    /// Degrees of freedom that further conditions prescribe with the same motion: active node, axis and condition,
    /// ascending.
    shared: Vec<(u32, u8, u16)>,
}

impl<const D: usize> DofMap<D> {
    /// Applies the boundary conditions of a step that runs from time `start` to time `end`.
    ///
    /// # Errors
    /// [`ConstraintError`] when two conditions contradict each other, a formula is not finite, or nodes can leave the axis
    /// of revolution.
    pub fn new(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        start: f64,
        end: f64,
    ) -> Result<Self, ConstraintError> {
        let mut dofs = vec![[Dof::Free(0); D]; links.n_active()];
        let mut shared = Vec::new();
        for (number, condition) in model.boundary_conditions.iter().enumerate() {
            // At time 0 nothing has moved yet, whatever the curve says.
            let reached = (start > 0.0).then(|| condition.curve.factor(start));
            let factors = [reached, Some(condition.curve.factor(end))];
            let acts_on = nodes_of(condition, points, links);
            let originals = condition.follows_material().then(|| original_places(model, points, links));
            for active in acts_on {
                let node = links.active_nodes()[active] as usize;
                let place = model.grid.node_position(node);
                let original = originals.as_ref().map_or(place, |originals| originals[active]);
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
                    let dof = &mut dofs[active][axis];
                    match *dof {
                        Dof::Free(_) => *dof = Dof::Held { condition: number as u16, increment },
                        Dof::Held { increment: held, .. }
                            if (held - increment).abs() <= SAME * held.abs().max(increment.abs()) =>
                        {
                            shared.push((active as u32, axis as u8, number as u16));
                        }
                        Dof::Held { condition: first, increment: held } => {
                            return Err(ConstraintError::Conflict {
                                first: model.boundary_conditions[first as usize].name.clone(),
                                second: condition.name.clone(),
                                node: place.to_vec(),
                                axis: AXES[axis % 3],
                                a: held,
                                b: increment,
                            });
                        }
                    }
                }
            }
        }
        if model.revolved {
            keep_axis(model, links, &dofs)?;
        }
        let mut n_free = 0;
        for dof in dofs.iter_mut().flatten() {
            if let Dof::Free(unknown) = dof {
                *unknown = n_free;
                n_free += 1;
            }
        }
        shared.sort_unstable();
        Ok(DofMap { dofs, n_free: n_free as usize, shared })
    }

    /// Number of unknowns.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// The unknown of a degree of freedom, or `None` when it is prescribed.
    #[inline]
    pub fn free(&self, node: usize, axis: usize) -> Option<usize> {
        match self.dofs[node][axis] {
            Dof::Free(unknown) => Some(unknown as usize),
            Dof::Held { .. } => None,
        }
    }

    /// The displacement increment and the boundary condition that prescribes a degree of freedom, or `None`.
    pub fn prescribed(&self, node: usize, axis: usize) -> Option<(f64, usize)> {
        match self.dofs[node][axis] {
            Dof::Free(_) => None,
            Dof::Held { condition, increment } => Some((increment, condition as usize)),
        }
    }

    /// The boundary conditions that share the reaction of a degree of freedom equally: those that hold it, or where none
    /// does those that move it; the first one of the deck first, none where it is free.
    pub fn bearers(&self, model: &Model<D>, node: usize, axis: usize) -> Vec<usize> {
        let mut bearers = self.conditions(node, axis);
        let holds = |number: &usize| model.boundary_conditions[*number].holds(axis);
        if bearers.len() > 1 && bearers.iter().any(holds) {
            bearers.retain(holds);
        }
        bearers
    }

    /// The boundary conditions that prescribe a degree of freedom, the first one of the deck first; none where it is free.
    /// All of them prescribe the same motion.
    pub fn conditions(&self, node: usize, axis: usize) -> Vec<usize> {
        let place = (node as u32, axis as u8);
        let begin = self.shared.partition_point(|(node, axis, _)| (*node, *axis) < place);
        let length = self.shared[begin..].partition_point(|(node, axis, _)| (*node, *axis) == place);
        let first = self.prescribed(node, axis).map(|(_, condition)| condition);
        let mut all: Vec<usize> = first.into_iter().collect();
        all.extend(self.shared[begin..][..length].iter().map(|(_, _, condition)| *condition as usize));
        all
    }

    /// Whether a node is prescribed along any axis.
    #[inline]
    pub fn is_held(&self, node: usize) -> bool {
        self.dofs[node].iter().any(|dof| matches!(dof, Dof::Held { .. }))
    }

    /// Active node and axis of an unknown.
    pub fn place_of(&self, unknown: usize) -> Option<(usize, usize)> {
        let wanted = |dof: &Dof| *dof == Dof::Free(unknown as u32);
        (0..self.dofs.len()).find_map(|node| self.dofs[node].iter().position(wanted).map(|axis| (node, axis)))
    }

    /// An active node and one of `axes` along which nothing holds the part of the body it belongs to: no degree of
    /// freedom along that axis is prescribed at any node coupled to it, directly or through others. `part_of` gives the
    /// part of each node.
    pub fn unheld(&self, part_of: &[usize], axes: std::ops::Range<usize>) -> Option<(usize, usize)> {
        let mut held = vec![[false; D]; self.dofs.len()];
        for (node, dofs) in self.dofs.iter().enumerate() {
            for (axis, dof) in dofs.iter().enumerate() {
                held[part_of[node]][axis] |= matches!(dof, Dof::Held { .. });
            }
        }
        (0..self.dofs.len()).find_map(|node| {
            axes.clone().find(|&axis| part_of[node] == node && !held[node][axis]).map(|axis| (node, axis))
        })
    }

    /// Visits all degrees of freedom in order: node, axis, and the unknown where it is free.
    pub fn for_each(&self, mut visit: impl FnMut(usize, usize, Option<usize>)) {
        for node in 0..self.n_nodes() {
            for axis in 0..D {
                visit(node, axis, self.free(node, axis));
            }
        }
    }

    /// Number of active nodes.
    pub fn n_nodes(&self) -> usize {
        self.dofs.len()
    }
}

/// The ring through a node on the axis has no radius; nothing else may move the node off it.
fn keep_axis<const D: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    dofs: &[[Dof; D]],
) -> Result<(), ConstraintError> {
    let is_on_axis =
        |node: usize| model.grid.node_position(node)[0] <= ON_AXIS * model.grid.size_around(node);
    let on_axis = (links.active_nodes().iter().zip(dofs)).filter(|(node, _)| is_on_axis(**node as usize));
    let (mut all, mut loose) = (0, 0);
    for (_, dof) in on_axis {
        all += 1;
        loose += usize::from(!matches!(dof[0], Dof::Held { increment: 0.0, .. }));
    }
    if loose > 0 { Err(ConstraintError::LooseAxis { loose, all }) } else { Ok(()) }
}

/// Change of a prescribed displacement between two load factors; `None` stands for no displacement yet.
pub fn displacement_increment<const D: usize>(
    formula: &Formula,
    place: &[f64; D],
    original: &[f64; D],
    factors: [Option<f64>; 2],
) -> f64 {
    let mut variables = [0.0; 7];
    variables[..D].copy_from_slice(place);
    variables[D..2 * D].copy_from_slice(original);
    let mut at = |factor: Option<f64>| {
        let Some(factor) = factor else { return 0.0 };
        if formula.depends_on(2 * D) {
            variables[2 * D] = factor;
            formula.evaluate(&variables[..=2 * D])
        } else {
            formula.evaluate(&variables[..=2 * D]) * factor
        }
    };
    at(factors[1]) - at(factors[0])
}

/// Weight of a point whose basis function vanishes at a node: any weights do where the deformation is uniform.
const LEAST_WEIGHT: f64 = 1e-9;

/// Original position of the material at each active node at the start of a step: the mean, weighted by the basis functions,
/// of what each point around takes it for by its own deformation, X_p + F_p⁻¹ (x − x_p). Exact where the deformation is
/// uniform, of second order in the size of a cell elsewhere.
fn original_places<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<[f64; D]> {
    let mut sums = vec![([0.0; D], 0.0); links.n_active()];
    let State { position, deformation_gradient, .. } = &points.converged;
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        for p in links.points_of(group) {
            let inverse = deformation_gradient[p].try_inverse().unwrap_or_else(Mat3::identity);
            links.for_each_value(p, |local, value| {
                let active = nodes[local] as usize;
                let x = model.grid.node_position(links.active_nodes()[active] as usize);
                let weight = value.max(0.0) + LEAST_WEIGHT;
                let (sum, weights) = &mut sums[active];
                for i in 0..D {
                    let back: f64 = (0..D).map(|j| inverse[(i, j)] * (x[j] - position[p][j])).sum();
                    sum[i] += weight * (points.original_position[p][i] + back);
                }
                *weights += weight;
            });
        }
    }
    sums.into_iter().map(|(sum, weights)| sum.map(|part| part / weights)).collect()
}

/// The active nodes that a boundary condition acts on in a step, ascending.
pub fn nodes_of<const D: usize>(
    condition: &BoundaryCondition<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
) -> Vec<usize> {
    match &condition.nodes {
        NodeSet::Fixed(nodes) => {
            nodes.iter().filter_map(|&node| links.active_number(node as usize)).collect()
        }
        NodeSet::OuterLayer(body) => {
            let mut touched = vec![false; links.n_active()];
            for group in 0..links.n_groups() {
                let nodes = links.nodes_of(group);
                for p in links.points_of(group) {
                    if points.outer_layer[p] && points.body[p] == *body {
                        for &local in links.places(p) {
                            touched[nodes[local as usize] as usize] = true;
                        }
                    }
                }
            }
            (0..touched.len()).filter(|&node| touched[node]).collect()
        }
    }
}
