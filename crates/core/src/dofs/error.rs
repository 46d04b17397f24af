//! Constraints that cannot be applied.

use crate::points::coordinates;

/// A boundary condition cannot be applied.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConstraintError {
    /// Two boundary conditions prescribe different displacements of one node.
    #[error(
        "boundary conditions `{first}` and `{second}` prescribe different increments along {axis} at node {}: {a:e} \
         and {b:e}",
        coordinates(.node)
    )]
    Conflict {
        /// Name of the first condition.
        first: String,
        /// Name of the second condition.
        second: String,
        /// Position of the grid node, [length].
        node: Vec<f64>,
        /// Name of the axis or of another direction.
        axis: &'static str,
        /// Increment that the first condition prescribes or that follows from earlier conditions.
        a: f64,
        /// Increment prescribed by the second condition.
        b: f64,
    },
    /// A formula has no finite value at a node or on a surface.
    #[error(
        "the displacement of boundary condition `{name}` along {axis} is not finite at {}: the formula `{formula}` \
         gives {value} at load factor {factor:?}", coordinates(.node)
    )]
    NotFinite {
        /// Name of the boundary condition.
        name: String,
        /// Name of the axis.
        axis: &'static str,
        /// Position of the grid node, or position on the surface, [length].
        node: Vec<f64>,
        /// The load factor.
        factor: f64,
        /// Text of the formula.
        formula: String,
        /// The resulting increment at a node, or the displacement of a surface.
        value: f64,
    },
    /// Other conditions keep a surface from reaching its prescribed displacement.
    #[error(
        "boundary condition `{name}` cannot be met: other conditions hold surface `{surface}`, whose displacement differs by \
         {distance:.3e} from the prescribed one"
    )]
    Unmet {
        /// Name of the boundary condition.
        name: String,
        /// Name of the surface.
        surface: String,
        /// Distance from the prescribed displacement, [length].
        distance: f64,
    },
    /// Nodes on the axis of a body of revolution can leave the axis, or are moved off it.
    #[error("{}", loose_axis(*.loose, *.all))]
    LooseAxis {
        /// Number of nodes that can leave the axis or are moved off it.
        loose: usize,
        /// Number of active nodes on the axis.
        all: usize,
    },
    /// A tied component is also prescribed, is tied twice, is tied to itself through other ties, or belongs to a node
    /// that is held along an inclined direction.
    #[error(
        "the motion along {axis} at node {} cannot be tied to that of other nodes: {reason}", coordinates(.node)
    )]
    Tie {
        /// Position of the grid node, [length].
        node: Vec<f64>,
        /// Name of the axis.
        axis: &'static str,
        /// The reason.
        reason: &'static str,
    },
}

fn loose_axis(loose: usize, all: usize) -> String {
    let nodes = match all {
        1 => "the grid node".to_owned(),
        _ => format!("{loose} of the {all} grid nodes"),
    };
    format!("{nodes} on the axis x = 0 can move off the axis")
}
