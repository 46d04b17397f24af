//! Collection of the constraints of a load step, one at a time.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::basis::Connectivity;
use crate::linear::Numbering;
use crate::model::Model;
use crate::points::Points;

use super::fields::{Fields, displacement_along};
use super::turned::{Along, Turned};
use super::{Bound, ConstraintError, DofMap, FURTHER, ON_AXIS, Repeated, Tie, conditions_at};

/// Two prescribed increments agree if they differ by less than this, relative to their size or, for displacements, to
/// the size of a cell if that is larger.
const SAME: f64 = 1e-12;

/// Reason for refusing a tie that leads back to itself.
const CIRCLE: &str = "it would depend on itself";

/// Progress in the resolution of a tie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Resolution {
    Open,
    Begun,
    Done,
}

/// The role of a component.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Dof {
    Free,
    Bound(Bound),
}

/// The constraints on the increments of `N` components at each active node in one load step.
///
/// Conditions are numbered. The conditions of the model come first; a term numbers its own by
/// [`condition`](Constraints::condition).
pub struct Constraints<'a, const N: usize> {
    dofs: Vec<[Dof; N]>,
    repeated: Vec<Repeated>,
    along: BTreeMap<u32, Vec<Along<N>>>,
    ties: Vec<Tie>,
    /// Position of an active node, [length].
    position: Box<dyn Fn(usize) -> Vec<f64> + 'a>,
    /// Size of the cells around an active node, [length]; 0 for a component that is not a displacement.
    size: Box<dyn Fn(usize, usize) -> f64 + 'a>,
    /// Name of a condition; empty if it does not belong to the model.
    name: Box<dyn Fn(usize) -> String + 'a>,
    /// The fields to which the components belong.
    fields: Cow<'a, Fields>,
    /// Names of the conditions that terms impose.
    further: Vec<String>,
    /// Active nodes on the axis of revolution.
    on_axis: Vec<usize>,
}

impl<'a, const N: usize> Constraints<'a, N> {
    /// The constraints of a model in a step between two times.
    ///
    /// # Errors
    /// [`ConstraintError`] if two conditions contradict each other or a formula is not finite.
    #[inline(never)]
    pub fn from_model<const D: usize>(
        model: &'a Model<D>,
        points: &Points<D>,
        links: &'a Connectivity<D>,
        times: [f64; 2],
    ) -> Result<Self, ConstraintError> {
        let mut constraints = Constraints::new(model, links);
        constraints.prescribe(model, points, links, times)?;
        Ok(constraints)
    }

    /// An empty set of constraints.
    fn new<const D: usize>(model: &'a Model<D>, links: &'a Connectivity<D>) -> Self {
        let is_on_axis = |node: usize| {
            model.revolved && model.grid.node_position(node)[0] <= ON_AXIS * model.grid.size_around(node)
        };
        let nodes = links.active_nodes();
        Constraints {
            dofs: vec![[Dof::Free; N]; nodes.len()],
            repeated: Vec::new(),
            along: BTreeMap::new(),
            ties: Vec::new(),
            position: Box::new(|node| model.grid.node_position(nodes[node] as usize).to_vec()),
            size: Box::new(
                |node, component| {
                    if component < D { model.grid.size_around(nodes[node] as usize) } else { 0.0 }
                },
            ),
            name: Box::new(|number| {
                model
                    .boundary_conditions
                    .get(number)
                    .map_or_else(String::new, |condition| condition.name.clone())
            }),
            fields: Cow::Owned(Fields::displacement(D)),
            further: Vec::new(),
            on_axis: (0..nodes.len()).filter(|&n| is_on_axis(nodes[n] as usize)).collect(),
        }
    }

    #[cfg(test)]
    pub(super) fn on_nodes(n: usize) -> Self {
        Constraints {
            dofs: vec![[Dof::Free; N]; n],
            repeated: Vec::new(),
            along: BTreeMap::new(),
            ties: Vec::new(),
            position: Box::new(|node| vec![node as f64]),
            size: Box::new(|_, _| 1.0),
            name: Box::new(|number| number.to_string()),
            fields: Cow::Owned(Fields::displacement(N)),
            further: Vec::new(),
            on_axis: Vec::new(),
        }
    }

    /// The same constraints on the components of these fields, by whose names errors refer to the unknowns.
    #[must_use]
    pub fn with_fields(self, fields: &'a Fields) -> Self {
        Constraints { fields: Cow::Borrowed(fields), ..self }
    }

    /// The number of the condition that a term imposes under this name, by which its reaction is reported. With several
    /// ranks, each rank must ask for the same names in the same order, whether or not it holds nodes.
    pub fn condition(&mut self, name: &str) -> usize {
        let known = self.further.iter().position(|further| further == name);
        FURTHER
            + known.unwrap_or_else(|| {
                self.further.push(name.to_owned());
                self.further.len() - 1
            })
    }

    /// Prescribes the increment of a component at an active node.
    ///
    /// # Errors
    /// [`ConstraintError::Conflict`] if another condition prescribes a different increment, or
    /// [`ConstraintError::Tie`] if the component is tied.
    pub fn hold(
        &mut self,
        node: usize,
        component: usize,
        increment: f64,
        condition: usize,
    ) -> Result<(), ConstraintError> {
        let condition = condition.min(u16::MAX.into()) as u16;
        match self.dofs[node][component] {
            Dof::Free => self.dofs[node][component] = Dof::Bound(Bound::Held { condition, increment }),
            Dof::Bound(Bound::Held { increment: held, .. })
                if (held - increment).abs()
                    <= SAME * held.abs().max(increment.abs()).max((self.size)(node, component)) =>
            {
                self.repeated.push(Repeated { node: node as u32, component: component as u8, condition });
            }
            Dof::Bound(Bound::Held { condition: first, increment: held }) => {
                let unknown = self.fields.unknown(component);
                return Err(self.conflict(node, unknown, [first, condition], [held, increment]));
            }
            Dof::Bound(Bound::Tied(_)) => return Err(self.tied(node, component, "it is prescribed")),
        }
        Ok(())
    }

    /// Prescribes the increment of an active node along a unit vector.
    pub fn hold_along(&mut self, node: usize, direction: [f64; N], increment: f64, condition: usize) {
        let along = Along { direction, increment, condition: condition.min(u16::MAX.into()) as u16 };
        self.along.entry(node as u32).or_default().push(along);
    }

    /// Ties the increment of a component to a weighted sum of others, given by node, component and weight, plus a
    /// constant.
    ///
    /// # Errors
    /// [`ConstraintError::Tie`] if the component is already prescribed or tied.
    pub fn tie(
        &mut self,
        node: usize,
        component: usize,
        to: &[(usize, usize, f64)],
        constant: f64,
    ) -> Result<(), ConstraintError> {
        match self.dofs[node][component] {
            Dof::Free => self.dofs[node][component] = Dof::Bound(Bound::Tied(self.ties.len() as u32)),
            Dof::Bound(_) => return Err(self.tied(node, component, "it is already prescribed or tied")),
        }
        let terms = to.iter().map(|&(node, component, weight)| (node as u32, component as u8, weight));
        self.ties.push(Tie {
            node: node as u32,
            component: component as u8,
            terms: terms.collect(),
            constant,
        });
        Ok(())
    }

    /// The map of the unknowns.
    ///
    /// # Errors
    /// [`ConstraintError`] if constraints contradict each other, a tie depends on itself, or nodes can leave the axis
    /// of revolution.
    #[inline(never)]
    pub fn into_map(mut self) -> Result<DofMap<N>, ConstraintError> {
        self.resolve_ties()?;
        self.repeated.sort_unstable();
        let turned = self.turn()?;
        self.keep_axis(&turned)?;
        let Constraints { dofs, repeated, ties, further, .. } = self;
        let numbering = Numbering::new(dofs.len(), |node, component| dofs[node][component] == Dof::Free);
        let bound = dofs.as_flattened().iter().filter_map(|dof| match dof {
            Dof::Free => None,
            Dof::Bound(bound) => Some(*bound),
        });
        Ok(DofMap { numbering, bound: bound.collect(), repeated, turned, ties, further })
    }

    /// Turns the axes of the nodes with prescribed directions: the unknowns along the directions of such a node are
    /// stored in place of its components, and every condition on it prescribes a motion along a direction.
    fn turn(&mut self) -> Result<Vec<Turned<N>>, ConstraintError> {
        let mut turned = Vec::new();
        for (node, along) in std::mem::take(&mut self.along) {
            let dofs = self.dofs[node as usize];
            let mut motions = Vec::new();
            for (axis, dof) in dofs.iter().enumerate() {
                if let Dof::Bound(Bound::Held { condition, increment }) = *dof {
                    let direction = std::array::from_fn(|c| f64::from(u8::from(c == axis)));
                    motions.push(Along { direction, increment, condition });
                    let repeated = conditions_at(&self.repeated, node, axis as u8);
                    motions.extend(repeated.map(|condition| Along { direction, increment, condition }));
                } else if matches!(dof, Dof::Bound(Bound::Tied(_))) {
                    return Err(self.tied(
                        node as usize,
                        axis,
                        "the node is held along an inclined direction",
                    ));
                }
            }
            motions.extend(along);
            let found = Turned::new(node, &motions, (self.size)(node as usize, 0)).map_err(
                |(conditions, increments)| {
                    self.conflict(
                        node as usize,
                        displacement_along("the normal of a wall"),
                        conditions,
                        increments,
                    )
                },
            )?;
            for k in 0..N {
                self.dofs[node as usize][k] = match found.held(k) {
                    Some((increment, condition)) => Dof::Bound(Bound::Held { condition, increment }),
                    None => Dof::Free,
                };
            }
            turned.push(found);
        }
        let is_turned = |node: &u32| turned.binary_search_by_key(node, |turned| turned.node).is_ok();
        self.repeated.retain(|repeated| !is_turned(&repeated.node));
        Ok(turned)
    }

    /// Replaces tied components in ties by the components to which they are tied.
    fn resolve_ties(&mut self) -> Result<(), ConstraintError> {
        let mut state = vec![Resolution::Open; self.ties.len()];
        for first in 0..self.ties.len() {
            let mut stack = vec![first];
            while let Some(&k) = stack.last() {
                if state[k] == Resolution::Done {
                    stack.pop();
                    continue;
                }
                state[k] = Resolution::Begun;
                let tied = |&(node, component, _): &(u32, u8, f64)| self.tie_of(node, component);
                let open = self.ties[k].terms.iter().filter_map(tied).find(|&m| state[m] != Resolution::Done);
                match open {
                    Some(other) if state[other] == Resolution::Begun => {
                        let Tie { node, component, .. } = self.ties[k];
                        return Err(self.tied(node as usize, component as usize, CIRCLE));
                    }
                    Some(other) => stack.push(other),
                    None => {
                        self.substitute(k);
                        state[k] = Resolution::Done;
                        stack.pop();
                    }
                }
            }
        }
        Ok(())
    }

    /// Substitutes the resolved ties into a tie and merges terms of the same component.
    fn substitute(&mut self, k: usize) {
        let mut terms: BTreeMap<(u32, u8), f64> = BTreeMap::new();
        let mut constant = self.ties[k].constant;
        for (node, component, weight) in std::mem::take(&mut self.ties[k].terms) {
            match self.tie_of(node, component) {
                None => *terms.entry((node, component)).or_default() += weight,
                Some(other) => {
                    let other = &self.ties[other];
                    constant += weight * other.constant;
                    for &(node, component, w) in &other.terms {
                        *terms.entry((node, component)).or_default() += weight * w;
                    }
                }
            }
        }
        self.ties[k].constant = constant;
        self.ties[k].terms = terms.into_iter().map(|((node, component), w)| (node, component, w)).collect();
    }

    fn tie_of(&self, node: u32, component: u8) -> Option<usize> {
        match self.dofs[node as usize][component as usize] {
            Dof::Bound(Bound::Tied(tie)) => Some(tie as usize),
            _ => None,
        }
    }

    /// Checks that the nodes on the axis of revolution stay on it, because the ring through such a node has zero
    /// radius. An increment that is round-off becomes 0.
    fn keep_axis(&mut self, turned: &[Turned<N>]) -> Result<(), ConstraintError> {
        let mut loose = 0;
        for &node in &self.on_axis {
            let size = (self.size)(node, 0);
            let is_kept = match turned.iter().find(|turned| turned.node as usize == node) {
                Some(turned) => turned.fixes_axis(0, size),
                None => match &mut self.dofs[node][0] {
                    Dof::Bound(Bound::Held { increment, .. }) if increment.abs() <= SAME * size => {
                        *increment = 0.0;
                        true
                    }
                    _ => false,
                },
            };
            loose += usize::from(!is_kept);
        }
        if loose > 0 {
            return Err(ConstraintError::LooseAxis { loose, all: self.on_axis.len() });
        }
        Ok(())
    }

    fn conflict(
        &self,
        node: usize,
        unknown: String,
        conditions: [u16; 2],
        [a, b]: [f64; 2],
    ) -> ConstraintError {
        let [first, second] = conditions.map(|number| (self.name)(number as usize));
        ConstraintError::Conflict {
            first,
            second,
            node: (self.position)(node).into(),
            unknown: unknown.into(),
            a,
            b,
            term: None,
        }
    }

    fn tied(&self, node: usize, component: usize, reason: &'static str) -> ConstraintError {
        ConstraintError::Tie {
            node: (self.position)(node),
            unknown: self.fields.unknown(component).into(),
            reason,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_stay_on_the_axis_in_spite_of_round_off() {
        let on_axis = |increment: f64| {
            let mut constraints = Constraints::<2>::on_nodes(2);
            constraints.on_axis = vec![1];
            constraints.hold(1, 0, increment, 0).unwrap();
            constraints.into_map()
        };
        assert_eq!(on_axis(-2.2e-18).unwrap().prescribed(1, 0), Some((0.0, 0)));
        assert!(matches!(on_axis(1e-9), Err(ConstraintError::LooseAxis { .. })));
    }
}
