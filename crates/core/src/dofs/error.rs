//! Constraints that cannot be applied.

use crate::points::coordinates;

/// A boundary condition cannot be applied.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConstraintError {
    /// Two conditions prescribe different increments of one unknown.
    #[error(
        "{} prescribe different increments of {unknown} at node {}: {a:e} and {b:e}",
        both(.first, .second, .term),
        coordinates(.node)
    )]
    Conflict {
        /// Name of the first condition; empty if a term of equilibrium sets it.
        first: String,
        /// Name of the second condition; empty if a term of equilibrium sets it.
        second: String,
        /// Position of the grid node, [length].
        node: Box<[f64]>,
        /// The unknown in words.
        unknown: Box<str>,
        /// Increment that the first condition prescribes or that follows from earlier conditions.
        a: f64,
        /// Increment prescribed by the second condition.
        b: f64,
        /// Name of the term of equilibrium that sets the second condition, if known.
        term: Option<&'static str>,
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
        "{unknown} at node {} cannot be tied to other unknowns: {reason}", coordinates(.node)
    )]
    Tie {
        /// Position of the grid node, [length].
        node: Vec<f64>,
        /// The unknown in words.
        unknown: Box<str>,
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

impl ConstraintError {
    /// The same error, found while the term of this name set its constraints.
    pub(crate) fn in_term(self, name: &'static str) -> Self {
        match self {
            ConstraintError::Conflict { first, second, node, unknown, a, b, term: None } => {
                ConstraintError::Conflict { first, second, node, unknown, a, b, term: Some(name) }
            }
            error => error,
        }
    }
}

fn both(first: &str, second: &str, term: &Option<&str>) -> String {
    let term = term.map_or_else(|| "a term of equilibrium".to_owned(), |name| format!("the term `{name}`"));
    match (first, second) {
        ("", "") => format!("{term} and an earlier constraint of a term"),
        ("", name) | (name, "") => format!("boundary condition `{name}` and {term}"),
        _ => format!("boundary conditions `{first}` and `{second}`"),
    }
}
