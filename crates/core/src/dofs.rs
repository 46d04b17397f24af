//! Degrees of freedom of a load step: u = C q + g, with the unknowns q.
//!
//! Most components of the nodal increments u either are unknowns themselves or are prescribed. A prescribed direction
//! that is not an axis turns the frame of its node: the unknowns are then components along other directions. A tie
//! makes a component a combination of others. All of this is linear, so the equations for the unknowns are Cᵀ K C δq =
//! Cᵀ r.

mod constraints;
mod covered;
mod error;
mod fields;
mod prescribed;
pub mod rigid;
mod turned;

use crate::basis::{Connectivity, JoinedParts};
use crate::linear::Numbering;
use crate::model::Model;
use crate::points::Points;
use crate::ranks::Reduction;

pub use constraints::Constraints;
pub use covered::{Covered, covered};
pub use error::ConstraintError;
pub use fields::{Field, Fields};
pub use prescribed::{displacement_increment, nodes_of};
pub use turned::Turned;

/// Nodes nearer to the axis of revolution than this distance, relative to the size of the cells around them, count as
/// lying on it.
pub const ON_AXIS: f64 = 1e-6;

/// A prescribed increment counts as reached if the remaining difference, relative to the increment, is below this.
const REACHED: f64 = 1e-12;

/// The first number of the conditions that terms impose.
pub(crate) const FURTHER: usize = 1 << 15;

pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

/// A component that is not an unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Bound {
    /// Prescribed by a boundary condition.
    Held { condition: u16, increment: f64 },
    /// Determined by other components through the tie with this number.
    Tied(u32),
}

/// A condition that repeats what an earlier one prescribes for a component of an active node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Repeated {
    node: u32,
    component: u8,
    condition: u16,
}

/// A component that is a combination of others, none of which is tied: u = Σ weight · u(node, component) + constant.
#[derive(Debug, Clone, PartialEq)]
struct Tie {
    node: u32,
    component: u8,
    terms: Vec<(u32, u8, f64)>,
    constant: f64,
}

/// The map u = C q + g of one load step, with `N` components at each active node.
#[derive(Debug, Clone)]
pub struct DofMap<const N: usize> {
    numbering: Numbering<N>,
    /// The components that are not unknowns, in order.
    bound: Vec<Bound>,
    /// Conditions that repeat the prescribed motion of a component, ascending.
    repeated: Vec<Repeated>,
    /// The nodes whose unknowns are not along the axes, ascending.
    turned: Vec<Turned<N>>,
    ties: Vec<Tie>,
    /// Names of the conditions that terms impose, numbered from [`FURTHER`].
    further: Vec<String>,
}

impl<const N: usize> DofMap<N> {
    /// The constraints of a model in a step from time `start` to time `end`.
    ///
    /// # Errors
    /// [`ConstraintError`] if two conditions contradict each other, a formula is not finite, or nodes can leave the
    /// axis of revolution.
    pub fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        start: f64,
        end: f64,
    ) -> Result<Self, ConstraintError> {
        Constraints::from_model(model, points, links, [start, end])?.into_map()
    }

    /// The map for `n_nodes` nodes without constraints.
    pub fn unconstrained(n_nodes: usize) -> Self {
        let numbering = Numbering::new(n_nodes, |_, _| true);
        DofMap {
            numbering,
            bound: Vec::new(),
            repeated: Vec::new(),
            turned: Vec::new(),
            ties: Vec::new(),
            further: Vec::new(),
        }
    }

    /// Number of unknowns.
    pub fn n_free(&self) -> usize {
        self.numbering.count()
    }

    /// Number of unknowns at the nodes for which `counts` is true.
    pub fn n_free_at(&self, counts: impl Fn(usize) -> bool) -> usize {
        let mut n = 0;
        self.for_each(|node, _, unknown| n += usize::from(unknown.is_some() && counts(node)));
        n
    }

    /// Number of active nodes.
    pub fn n_nodes(&self) -> usize {
        self.numbering.n_nodes()
    }

    /// The numbering of the unknowns; at a turned node, the unknowns are components along its directions.
    pub fn numbering(&self) -> &Numbering<N> {
        &self.numbering
    }

    /// The unknown of a component; `None` if the component is prescribed or tied.
    #[inline]
    pub fn free(&self, node: usize, component: usize) -> Option<usize> {
        self.numbering.unknown(node, component)
    }

    /// The prescribed increment of a component and the boundary condition that prescribes it, or `None`.
    #[inline]
    pub fn prescribed(&self, node: usize, component: usize) -> Option<(f64, usize)> {
        match self.bound[self.numbering.other(node, component)?] {
            Bound::Held { condition, increment } => Some((increment, condition as usize)),
            Bound::Tied(_) => None,
        }
    }

    /// True if C is the identity on the unknowns: no node is turned and no component is tied.
    pub fn is_plain(&self) -> bool {
        self.turned.is_empty() && self.ties.is_empty()
    }

    /// Node and component of an unknown.
    pub fn place_of(&self, unknown: usize) -> Option<(usize, usize)> {
        (0..self.n_nodes())
            .find_map(|node| (0..N).find(|&c| self.free(node, c) == Some(unknown)).map(|c| (node, c)))
    }

    /// Visits all components in order, with the node, the component, and its unknown if it has one.
    pub fn for_each(&self, visit: impl FnMut(usize, usize, Option<usize>)) {
        self.numbering.for_each(visit);
    }

    /// The directions of an active node if it is turned.
    pub fn turned(&self, node: usize) -> Option<&Turned<N>> {
        let place = self.turned.binary_search_by_key(&(node as u32), |turned| turned.node).ok()?;
        Some(&self.turned[place])
    }

    /// Visits the directions along which a node is prescribed or tied, as unit vectors.
    pub fn for_each_held_direction(&self, node: usize, mut visit: impl FnMut(&[f64; N])) {
        match self.turned(node) {
            Some(turned) => turned.directions[..turned.n_held()].iter().for_each(visit),
            None => (0..N).filter(|&component| self.free(node, component).is_none()).for_each(|component| {
                visit(&std::array::from_fn(|c| f64::from(u8::from(c == component))));
            }),
        }
    }

    /// True if the node cannot move freely along an axis.
    pub fn is_held_along(&self, node: usize, axis: usize) -> bool {
        match self.turned(node) {
            Some(turned) => turned.holds_along(axis),
            None => self.free(node, axis).is_none(),
        }
    }

    /// The first part of the bodies that nothing holds along one of `axes`, and this axis: all nodes of the part, on
    /// all ranks, are free along it. `None` if there is no such part.
    pub fn unheld(
        &self,
        parts: &JoinedParts,
        reduction: &Reduction,
        axes: std::ops::Range<usize>,
    ) -> Option<(usize, usize)> {
        let mut held = vec![0.0; N * parts.lowest.len()];
        for (node, part) in parts.at_node.iter().enumerate() {
            for axis in (0..N).filter(|&axis| self.is_held_along(node, axis)) {
                held[N * *part as usize + axis] = 1.0;
            }
        }
        reduction.maximum(&mut held);
        (0..parts.lowest.len())
            .find_map(|part| axes.clone().find(|axis| held[N * part + axis] == 0.0).map(|axis| (part, axis)))
    }

    /// A component as a linear combination of unknowns and prescribed components, without its constant: nodes,
    /// components and weights. In this combination, component k of a turned node is that along its direction k.
    pub fn expression(&self, node: usize, component: usize) -> Vec<(usize, usize, f64)> {
        let tie = self.numbering.other(node, component).and_then(|other| match self.bound[other] {
            Bound::Tied(tie) => Some(&self.ties[tie as usize]),
            Bound::Held { .. } => None,
        });
        let along_axes = match tie {
            Some(tie) => tie.terms.iter().map(|&(n, c, w)| (n as usize, c as usize, w)).collect(),
            None => vec![(node, component, 1.0)],
        };
        let turn = |(node, component, weight): (usize, usize, f64)| match self.turned(node) {
            None => vec![(node, component, weight)],
            Some(turned) => (0..N).map(|k| (node, k, weight * turned.directions[k][component])).collect(),
        };
        along_axes.into_iter().flat_map(turn).collect()
    }

    /// Visits the nodes that are turned or tied.
    pub fn for_each_transformed(&self, visit: impl FnMut(usize)) {
        let turned = self.turned.iter().map(|turned| turned.node);
        turned.chain(self.ties.iter().map(|tie| tie.node)).map(|node| node as usize).for_each(visit);
    }

    /// Visits each tied node with the nodes to which it is tied.
    pub fn for_each_tie(&self, mut visit: impl FnMut(usize, &mut dyn Iterator<Item = usize>)) {
        for tie in &self.ties {
            visit(tie.node as usize, &mut tie.terms.iter().map(|(node, ..)| *node as usize));
        }
    }

    /// Transfers the forces on tied components to the components to which they are tied, [force].
    pub fn condense(&self, force: &mut [[f64; N]]) {
        for Tie { node, component, terms, .. } in &self.ties {
            let tied = std::mem::take(&mut force[*node as usize][*component as usize]);
            for &(node, component, weight) in terms {
                force[node as usize][component as usize] += weight * tied;
            }
        }
    }

    /// Writes the remaining increment of the prescribed and tied components into `motion`, and zero into all other
    /// components. Returns true if any remaining increment is not zero.
    pub fn remaining(&self, increment: &[[f64; N]], motion: &mut [[f64; N]]) -> bool {
        motion.fill([0.0; N]);
        let mut lacks = false;
        self.for_each(|node, component, _| {
            if let Some((prescribed, _)) = self.prescribed(node, component) {
                motion[node][component] = prescribed - increment[node][component];
                lacks |= motion[node][component] != 0.0;
            }
        });
        if self.is_plain() {
            return lacks;
        }
        for turned in &self.turned {
            motion[turned.node as usize] = turned.remaining(&increment[turned.node as usize]);
        }
        for Tie { node, component, terms, constant } in &self.ties {
            let at = |n: usize, c: usize| increment[n][c] + motion[n][c];
            let parts = terms.iter().map(|&(n, c, weight)| weight * at(n as usize, c as usize));
            let (sum, size) = parts.fold((*constant, constant.abs()), |(s, a), x| (s + x, a + x.abs()));
            let now = increment[*node as usize][*component as usize];
            motion[*node as usize][*component as usize] = unless_round_off(sum - now, size + now.abs());
        }
        motion.as_flattened().iter().any(|u| *u != 0.0)
    }

    /// True if the prescribed and tied components of an increment have reached their prescribed values, up to
    /// round-off.
    pub fn is_reached(&self, increment: &[[f64; N]]) -> bool {
        let mut is_reached = true;
        self.for_each(|node, component, _| {
            if let Some((prescribed, _)) = self.prescribed(node, component)
                && self.turned(node).is_none()
            {
                let missed = (prescribed - increment[node][component]).abs();
                is_reached &= missed <= REACHED * prescribed.abs();
            }
        });
        if self.is_plain() || !is_reached {
            return is_reached;
        }
        let mut motion = vec![[0.0; N]; self.n_nodes()];
        self.remaining(increment, &mut motion);
        let turned = self.turned.iter().all(|turned| motion[turned.node as usize] == [0.0; N]);
        turned && self.ties.iter().all(|tie| motion[tie.node as usize][tie.component as usize] == 0.0)
    }

    /// Replaces condensed forces by the forces on the unknowns, Cᵀ f, with zeros for all other components.
    pub fn on_unknowns(&self, force: &mut [[f64; N]]) {
        for turned in &self.turned {
            let force = &mut force[turned.node as usize];
            *force = turned.components(force);
        }
        self.for_each(|node, component, unknown| {
            if unknown.is_none() {
                force[node][component] = 0.0;
            }
        });
    }

    /// Adds C δq, the increments of the unknowns and of the components tied to them, to a motion of the prescribed
    /// components, [length].
    pub fn add_unknowns(&self, delta_q: &[[f64; N]], motion: &mut [[f64; N]]) {
        self.for_each(|node, component, unknown| {
            if unknown.is_some() && self.turned(node).is_none() {
                motion[node][component] = delta_q[node][component];
            }
        });
        for turned in &self.turned {
            let node = turned.node as usize;
            turned.add(&delta_q[node], &mut motion[node]);
        }
        for Tie { node, component, terms, .. } in &self.ties {
            let mut add = |n: usize, c: usize, weight: f64| {
                let moved = match self.turned(n) {
                    None => {
                        if self.free(n, c).is_some() {
                            delta_q[n][c]
                        } else {
                            0.0
                        }
                    }
                    Some(turned) => turned.along(&delta_q[n], c),
                };
                motion[*node as usize][*component as usize] += weight * moved;
            };
            terms.iter().for_each(|&(n, c, weight)| add(n as usize, c as usize, weight));
        }
    }

    /// The part of the condensed force on a node that the constraints carry, [force].
    #[inline]
    pub fn held_part(&self, node: usize, force: &[f64; N]) -> [f64; N] {
        if !self.turned.is_empty()
            && let Some(turned) = self.turned(node)
        {
            return turned.held_part(force);
        }
        std::array::from_fn(|c| if self.free(node, c).is_none() { force[c] } else { 0.0 })
    }

    /// The indices of the boundary conditions that prescribe a component, in the order of the model; empty if it is
    /// free or tied. All of them prescribe the same motion.
    pub fn conditions(&self, node: usize, component: usize) -> Vec<usize> {
        let first = self.prescribed(node, component).map(|(_, condition)| condition);
        let others = conditions_at(&self.repeated, node as u32, component as u8).map(usize::from);
        first.into_iter().chain(others).collect()
    }

    /// Names of the conditions that terms impose, numbered from [`FURTHER`].
    pub(crate) fn further_conditions(&self) -> &[String] {
        &self.further
    }

    /// Distributes the reaction of a node among the conditions that carry it: `visit(condition, component, force)`.
    ///
    /// The conditions that fix a component carry equal shares; if none fixes it, the conditions that move it carry
    /// equal shares. At a turned node, each condition carries a force along its own direction. Conditions of terms,
    /// numbered from [`FURTHER`], carry the components that no condition of the model prescribes.
    pub fn for_each_share<const D: usize>(
        &self,
        model: &Model<D>,
        node: usize,
        reaction: &[f64; N],
        mut visit: impl FnMut(usize, usize, f64),
    ) {
        let is_of_model = |condition: &usize| *condition < model.boundary_conditions.len();
        if let Some(turned) = self.turned(node) {
            let fixes = |condition: usize, direction: &[f64; N]| {
                model.boundary_conditions.get(condition).is_some_and(|c| c.holds_along(direction))
            };
            turned.for_each_share(reaction, fixes, |condition, component, force| {
                if component < D || !is_of_model(&condition) {
                    visit(condition, component, force);
                }
            });
            return;
        }
        for (component, force) in reaction.iter().enumerate() {
            let mut bearers = self.conditions(node, component);
            if bearers.iter().any(is_of_model) {
                bearers.retain(is_of_model);
                let holds = |number: &usize| model.boundary_conditions[*number].holds(component);
                if bearers.len() > 1 && bearers.iter().any(holds) {
                    bearers.retain(holds);
                }
            }
            let share = force / bearers.len().max(1) as f64;
            bearers.into_iter().for_each(|condition| visit(condition, component, share));
        }
    }
}

/// The conditions that repeat what an earlier one prescribes for a component, from the sorted list of all such
/// conditions.
fn conditions_at(all: &[Repeated], node: u32, component: u8) -> impl Iterator<Item = u16> + '_ {
    let at = |repeated: &Repeated| (repeated.node, repeated.component);
    let begin = all.partition_point(|repeated| at(repeated) < (node, component));
    let here = all[begin..].iter().take_while(move |repeated| at(repeated) == (node, component));
    here.map(|repeated| repeated.condition)
}

/// The remainder `rest` of a sum whose terms are of magnitude `size`, or 0 if it is round-off.
fn unless_round_off(rest: f64, size: f64) -> f64 {
    if rest.abs() > REACHED * size { rest } else { 0.0 }
}

#[cfg(test)]
mod tests;
