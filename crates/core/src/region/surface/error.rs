//! What can be wrong with a surface.

use std::fmt;

use super::triangle::Triangle;

/// The most places that an error lists.
pub(super) const SHOWN: usize = 5;

/// A facet in a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacetReport {
    /// Its number in the order in which the facets were given, from 1.
    pub facet: usize,
    /// Its corners, [length].
    pub corners: Triangle,
}

impl fmt::Display for FacetReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c] = self.corners.map(|x| position(&x));
        write!(f, "facet {} with the corners {a}, {b}, {c}", self.facet)
    }
}

/// An edge in a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeReport {
    /// Number of a facet at the edge, from 1.
    pub facet: usize,
    /// Number of facets at the edge.
    pub facets: usize,
    /// Its ends, [length].
    pub ends: [[f64; 3]; 2],
}

impl fmt::Display for EdgeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = self.ends.map(|x| position(&x));
        write!(f, "{a} to {b} of facet {}", self.facet)
    }
}

/// Why triangles do not enclose a body. Lists hold the first few places only.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Less facets than a tetrahedron has.
    #[error("the surface has {facets} facets; a closed one has at least 4")]
    TooFewFacets {
        /// Number of facets.
        facets: usize,
    },
    /// More corners than can be numbered.
    #[error("the surface has {facets} facets, more than can be numbered")]
    TooManyFacets {
        /// Number of facets.
        facets: usize,
    },
    /// A coordinate is not a number, infinite or beyond all use.
    #[error("a coordinate is not a number or too large: {at}")]
    NotANumber {
        /// The facet.
        at: FacetReport,
    },
    /// Facets whose corners lie on a line or are the same.
    #[error("{} no area: {}", count(*.n, "facet has", "facets have"), list(.first))]
    Degenerate {
        /// Number of such facets.
        n: usize,
        /// The first of them.
        first: Vec<FacetReport>,
    },
    /// Edges with one facet only.
    #[error("the surface is open: {} one facet only: {}", count(*.n, "edge has", "edges have"), list(.first))]
    Open {
        /// Number of such edges.
        n: usize,
        /// The first of them.
        first: Vec<EdgeReport>,
    },
    /// Edges with more than two facets.
    #[error("{} more than two facets: {}", count(*.n, "edge has", "edges have"), list(.first))]
    Branched {
        /// Number of such edges.
        n: usize,
        /// The first of them.
        first: Vec<EdgeReport>,
    },
    /// A facet whose corners go round the other way than those of its neighbours.
    #[error("the corners of a facet go round the other way than those of {}: {at}", count(*.n, "neighbour", "neighbours"))]
    Turned {
        /// Number of such neighbours.
        n: usize,
        /// The facet that disagrees with most of its neighbours.
        at: FacetReport,
    },
    /// Two facets have more in common than the corners and edges that join them.
    #[error("the surface crosses or touches itself near {}: {} and {}", position(.near), .facets[0], .facets[1])]
    Crossing {
        /// A place next to both, [length].
        near: [f64; 3],
        /// The two facets.
        facets: Box<[FacetReport; 2]>,
    },
    /// A shell is inside out.
    #[error("{}: {at}", inside_out(*.cavity))]
    InsideOut {
        /// Whether it lies in an odd number of other shells, so that it should be the border of a cavity.
        cavity: bool,
        /// Its first facet.
        at: FacetReport,
    },
}

fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

fn list<T: fmt::Display>(places: &[T]) -> String {
    places.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn inside_out(cavity: bool) -> &'static str {
    if cavity {
        "a shell within another one is no cavity: its corners go round against the clock, beginning with"
    } else {
        "the surface is inside out: seen from outside its corners go round with the clock, beginning with"
    }
}

/// A position with the digits that a file of single precision has.
fn position(x: &[f64; 3]) -> String {
    let number = |x: f64| match x.abs() {
        0.0 => "0".to_owned(),
        size if (1e-4..1e7).contains(&size) => format!("{}", x as f32),
        _ => format!("{x:.6e}"),
    };
    format!("({}, {}, {})", number(x[0]), number(x[1]), number(x[2]))
}
