//! Prescribed displacements as they are stated.

use crate::formula::Formula;

use super::load::LoadCurve;

/// The nodes that a boundary condition acts on.
#[derive(Debug, Clone, PartialEq)]
pub enum NodeSet {
    /// Given grid nodes, ascending.
    Fixed(Vec<u32>),
    /// All nodes of the cells that hold, or overlap with the domain of, the points of the outer layer of a body;
    /// found afresh at each step.
    OuterLayer(u16),
}

/// A named set of prescribed nodal displacements.
#[derive(Debug, Clone)]
pub struct BoundaryCondition<const D: usize> {
    /// Name under which the reaction is reported.
    pub name: String,
    /// The nodes.
    pub nodes: NodeSet,
    /// Displacement along each prescribed axis, or direction of `axes`, [length]: a formula of the node's coordinates (`D` values), the original
    /// position of the material there (`D` values) and the load factor. One that does not depend on the factor is
    /// multiplied by it.
    pub displacement: [Option<Formula>; D],
    /// Directions to which `displacement` refers, where they are not the axes: orthonormal vectors, `[direction][axis]`.
    pub axes: Option<[[f64; D]; D]>,
    /// Load factor over time.
    pub curve: LoadCurve,
}

impl<const D: usize> BoundaryCondition<D> {
    /// A condition along the axes.
    pub fn new(
        name: impl Into<String>,
        nodes: NodeSet,
        displacement: [Option<Formula>; D],
        curve: LoadCurve,
    ) -> Self {
        BoundaryCondition { name: name.into(), nodes, displacement, axes: None, curve }
    }

    /// Whether a displacement depends on the original position of the material.
    pub fn follows_material(&self) -> bool {
        self.displacement.iter().flatten().any(|formula| (D..2 * D).any(|k| formula.depends_on(k)))
    }

    /// Whether it moves its nodes, rather than hold them.
    pub fn moves(&self) -> bool {
        self.displacement.iter().flatten().any(|formula| formula.as_constant() != Some(0.0))
    }

    /// Whether it keeps its nodes where they are along an axis.
    pub fn holds(&self, axis: usize) -> bool {
        self.displacement[axis].as_ref().is_some_and(|formula| formula.as_constant() == Some(0.0))
    }
}
