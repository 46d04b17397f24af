//! Errors in surfaces.

use std::fmt;

use super::triangle::Triangle;
use crate::counted::counted;

/// Largest number of facets or edges listed in a message.
pub(super) const SHOWN: usize = 5;

/// A facet named in a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacetReport {
    /// Number of the facet in the given order, from 1.
    pub facet: usize,
    /// Corners of the facet, [length].
    pub corners: Triangle,
}

impl fmt::Display for FacetReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c] = self.corners.map(|x| position(&x));
        write!(f, "facet {} with the corners {a}, {b}, {c}", self.facet)
    }
}

/// An edge named in a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeReport {
    /// Number of a facet at the edge, from 1.
    pub facet: usize,
    /// Number of facets at the edge.
    pub facets: usize,
    /// Ends of the edge, [length].
    pub ends: [[f64; 3]; 2],
}

impl fmt::Display for EdgeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = self.ends.map(|x| position(&x));
        write!(f, "{a} to {b} of facet {}", self.facet)
    }
}

/// An error in a surface. Lists hold the first few facets or edges only.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Fewer facets than a tetrahedron has.
    #[error("the surface has {}; a closed one has at least 4", counted(*.facets, "facet", "facets"))]
    TooFewFacets {
        /// Number of facets.
        facets: usize,
    },
    /// Too many facets.
    #[error("the surface has {facets} facets, more than can be numbered")]
    TooManyFacets {
        /// Number of facets.
        facets: usize,
    },
    /// A coordinate is infinite, NaN or too large.
    #[error("a coordinate is infinite, not a number or too large: {at}")]
    NotANumber {
        /// The facet.
        at: FacetReport,
    },
    /// Facets with collinear or equal corners.
    #[error("{} no area: {}", counted(*.n, "facet has", "facets have"), list(.first))]
    Degenerate {
        /// Number of such facets.
        n: usize,
        /// The first of them.
        first: Vec<FacetReport>,
    },
    /// Edges with one facet only.
    #[error("the surface is open: {} one facet only: {}", counted(*.n, "edge has", "edges have"), list(.first))]
    Open {
        /// Number of such edges.
        n: usize,
        /// The first of them.
        first: Vec<EdgeReport>,
    },
    /// Edges with more than two facets.
    #[error("{} more than two facets: {}", counted(*.n, "edge has", "edges have"), list(.first))]
    Branched {
        /// Number of such edges.
        n: usize,
        /// The first of these edges.
        first: Vec<EdgeReport>,
    },
    /// A facet with the opposite orientation to its neighbours.
    #[error(
        "the corners of a facet are in the opposite order to those of {}: {at}",
        counted(*.n, "neighbour", "neighbours")
    )]
    Turned {
        /// Number of neighbours with the opposite orientation.
        n: usize,
        /// The facet that disagrees with the most neighbours.
        at: FacetReport,
    },
    /// Two facets meet beyond their shared corners and edges.
    #[error("the surface crosses or touches itself near {}: {} and {}", position(.near), .facets[0], .facets[1])]
    Crossing {
        /// A position close to both facets, [length].
        near: [f64; 3],
        /// The two facets.
        facets: Box<[FacetReport; 2]>,
    },
    /// A shell is inside out.
    #[error("{}, for example {at}", inside_out(*.cavity))]
    InsideOut {
        /// True if the shell lies in an odd number of other shells and so should bound a cavity.
        cavity: bool,
        /// First facet of the shell.
        at: FacetReport,
    },
}

fn list<T: fmt::Display>(items: &[T]) -> String {
    items.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn inside_out(cavity: bool) -> &'static str {
    if cavity {
        "a shell inside another one is not a cavity: its facets have counterclockwise corners"
    } else {
        "the surface is inside out: seen from outside, its facets have clockwise corners"
    }
}

/// A position with the number of digits of single precision.
fn position(x: &[f64; 3]) -> String {
    let number = |x: f64| match x.abs() {
        0.0 => "0".to_owned(),
        size if (1e-4..1e7).contains(&size) => format!("{}", x as f32),
        _ => format!("{x:.6e}"),
    };
    format!("({}, {}, {})", number(x[0]), number(x[1]), number(x[2]))
}
