//! Errors and warnings about meshes.

use crate::counted::counted;
use crate::grid::ON_LINE;
use crate::grid::gmsh::Straightened;

/// Largest range of z of a mesh in the plane that is ignored with a note, relative to its extent, [-].
pub(super) const NEARLY_FLAT: f64 = 1e-6;

/// A cell named in a message.
#[derive(Debug, Clone, PartialEq)]
pub struct CellReport {
    /// Element number in the file.
    pub element: u64,
    /// Mean position of the nodes of the cell, [length].
    pub position: Vec<f64>,
}

/// A node that lies on a side of a cell without being a corner of that side.
#[derive(Debug, Clone, PartialEq)]
pub struct HangingNode {
    /// Node number in the file.
    pub node: u64,
    /// Position of the node, [length].
    pub position: Vec<f64>,
    /// Node numbers, in the file, of the corners of the side.
    pub side: Vec<u64>,
    /// The cell that has this side.
    pub cell: CellReport,
}

/// An error in a mesh. Lists contain only the first few cells.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The file has no elements of the dimension of the analysis.
    #[error("{}", no_cells(*.dimension, *.n_surface))]
    NoCells {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of surface elements, if the analysis is in space and the mesh has no volume elements.
        n_surface: usize,
    },
    /// The mesh has volume elements but the analysis is in the plane.
    #[error(
        "the mesh has {}; an analysis in the plane needs triangles or quadrilaterals only",
        counted(*.n, "solid element", "solid elements")
    )]
    Solid {
        /// Number of such elements.
        n: usize,
    },
    /// The cells do not lie in one plane of constant z.
    #[error("the mesh is not flat: z ranges from {low} to {high}{}", other_plane(*.constant))]
    NotFlat {
        /// Lowest z of a cell, [length].
        low: f64,
        /// Highest z of a cell, [length].
        high: f64,
        /// The axis, 0 or 1, along which all cells have one coordinate, if there is one.
        constant: Option<usize>,
    },
    /// Cells whose volume is negligible relative to the lengths of their edges.
    #[error("{} no {}: {}", counted(*.n, "cell has", "cells have"), measure(*.dimension), list(.first))]
    NoVolume {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// The first of these cells.
        first: Vec<CellReport>,
    },
    /// Quadrilaterals that are not convex, or hexahedra whose map turns inside out somewhere.
    #[error("{}: {}", folded(*.dimension, *.n), list(.first))]
    Folded {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// The first of these cells.
        first: Vec<CellReport>,
    },
    /// Cells so far from the origin that their coordinates have too few significant digits.
    #[error(
        "the round-off error of the coordinates exceeds {ON_LINE:e} of the size of {}{} {}; move the origin of \
         the coordinates closer to the bodies", counted(*.n, "cell", "cells"), example(*.n), show(.first)
    )]
    FarAway {
        /// Number of such cells.
        n: usize,
        /// The first of these cells.
        first: CellReport,
    },
    /// Overlapping cells.
    #[error(
        "{}{} {} and {}; remove one of the two, or mesh both bodies as one part",
        counted(*.n, "pair of cells overlaps", "pairs of cells overlap"), example(*.n), show(&.first[0]),
        show(&.first[1])
    )]
    Overlap {
        /// Number of such pairs. If any two cells lie on the same side of a shared edge or face, only pairs of this
        /// kind are counted.
        n: usize,
        /// The first pair.
        first: [CellReport; 2],
    },
    /// Nodes that lie on a side of a connected cell without being one of its corners; the basis functions are
    /// discontinuous there.
    #[error(
        "{} on a side of a cell without being one of its corners{} node {} at ({}) on the side between the \
         nodes {} of {}; the basis functions are discontinuous there: cut that cell at the node, or give the cells on \
         both sides the same nodes",
        counted(*.n, "node lies", "nodes lie"), example(*.n), .first.node, numbers(&.first.position),
        tags(&.first.side), show(&.first.cell)
    )]
    Hanging {
        /// Number of such nodes.
        n: usize,
        /// The first of these nodes.
        first: Box<HangingNode>,
    },
    /// Tetrahedra that share half a face with a hexahedron; the basis functions do not match there.
    #[error(
        "{} three nodes with a face of a hexahedron{} the faces of {} and {}; the basis functions are discontinuous \
         there: use one kind of element, or keep the two kinds apart",
        counted(*.n, "face of a tetrahedron shares", "faces of tetrahedra share"), example(*.n), show(&.first[0]),
        show(&.first[1])
    )]
    Nonconforming {
        /// Number of such faces.
        n: usize,
        /// The first such tetrahedron and its hexahedron.
        first: [CellReport; 2],
    },
}

/// A valid but suspicious property of a mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshWarning {
    /// Nodes of different cells at the same position; the cells are not connected there.
    #[error(
        "{} but not merged, {} ({})",
        counted(*.n, "pair of nodes is coincident", "pairs of nodes are coincident"), first_at(*.n), numbers(&.first[0])
    )]
    Unmerged {
        /// Number of such pairs.
        n: usize,
        /// Positions of the first of these pairs, [length].
        first: Vec<Vec<f64>>,
    },
    /// Nodes that lie on sides of a part of the mesh without being connected to it.
    #[error(
        "{} on a side of another part of the mesh without being connected to it, {} ({}): \
         bodies separate there",
        counted(*.n, "node lies", "nodes lie"),
        first_at(*.n),
        numbers(&.first[0])
    )]
    Apart {
        /// Number of such nodes.
        n: usize,
        /// Positions of the first of these nodes, [length].
        first: Vec<Vec<f64>>,
    },
    /// Cells whose nodes were in clockwise order, or that were inside out, and have been turned.
    #[error("{}: {}", turned(*.dimension, *.n, *.all), list(.first))]
    Turned {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// Number of all cells.
        all: usize,
        /// The first of these cells.
        first: Vec<CellReport>,
    },
    /// Cells of a higher order, of which only the corners are used.
    #[error("{}", straightened(.0))]
    Straightened(Straightened),
    /// A mesh in the plane that is not exactly flat; z is ignored.
    #[error("the mesh is not exactly flat: z ranges from {low} to {high}, and is ignored")]
    Flattened {
        /// Lowest z of a cell, [length].
        low: f64,
        /// Highest z of a cell, [length].
        high: f64,
    },
}

impl MeshWarning {
    /// True if the mesh is as good as its author meant it: the reader only says what it did.
    pub fn is_note(&self) -> bool {
        !matches!(self, MeshWarning::Unmerged { .. } | MeshWarning::Apart { .. })
    }
}

fn tags(nodes: &[u64]) -> String {
    let nodes: Vec<String> = nodes.iter().map(u64::to_string).collect();
    match nodes.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => nodes.concat(),
    }
}

fn numbers(position: &[f64]) -> String {
    position.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

fn no_cells(dimension: usize, n_surface: usize) -> String {
    match (dimension, n_surface) {
        (3, 0) => "the mesh has no tetrahedra or hexahedra".to_owned(),
        (3, n) => format!(
            "the mesh has no tetrahedra or hexahedra, only {}; a three-dimensional analysis needs a mesh of \
             the volume (in gmsh, `Mesh 3`; if the mesh has physical groups, add one for the volume)",
            counted(n, "surface element", "surface elements")
        ),
        _ => "the mesh has no triangles or quadrilaterals".to_owned(),
    }
}

/// Introduces one of `n` cases.
fn example(n: usize) -> &'static str {
    if n == 1 { ":" } else { ", for example" }
}

/// Introduces the position of the first of `n` cases.
fn first_at(n: usize) -> &'static str {
    if n == 1 { "at" } else { "the first at" }
}

fn measure(dimension: usize) -> &'static str {
    if dimension == 3 { "volume" } else { "area" }
}

fn turned(dimension: usize, n: usize, all: usize) -> String {
    let which = match (n == all, dimension) {
        (true, 3) => "all cells were inside out and have been turned".to_owned(),
        (true, _) => "all cells had their nodes in clockwise order and have been turned".to_owned(),
        (false, 3) => counted(
            n,
            "cell was inside out and has been turned",
            "cells were inside out and have been turned",
        ),
        (false, _) => counted(
            n,
            "cell had its nodes in clockwise order and has been turned",
            "cells had their nodes in clockwise order and have been turned",
        ),
    };
    if n == all { format!("{which} ({n})") } else { format!("{which}, of {all}") }
}

fn straightened(lost: &Straightened) -> String {
    let kinds: Vec<String> = lost.kinds.iter().map(|(name, n)| format!("{n} × `{name}`")).collect();
    // Files of text have about ten digits.
    let farthest = match (lost.unknown, lost.relative > 1e-8) {
        (true, _) => "how far they lie from straight sides was not measured".to_owned(),
        (false, false) => "all of them lie in the middle of straight sides, so nothing is lost".to_owned(),
        (false, true) => format!(
            "they lie up to {:.3e} from the middle of their sides, {:.2} % of the length of that side",
            lost.farthest,
            100.0 * lost.relative
        ),
    };
    format!(
        "cells are linear: only the corners of {} are used, the nodes between them are dropped; {farthest}",
        kinds.join(", ")
    )
}

fn other_plane(constant: Option<usize>) -> String {
    match constant {
        Some(axis) => format!("; it lies in a plane of constant {}", if axis == 0 { "x" } else { "y" }),
        None => format!(" (a range up to {NEARLY_FLAT:e} of its extent is ignored)"),
    }
}

fn folded(dimension: usize, n: usize) -> String {
    match dimension {
        3 => {
            counted(
                n,
                "hexahedron is so distorted that it turns",
                "hexahedra are so distorted that they turn",
            ) + " inside out"
        }
        _ => counted(n, "quadrilateral is not convex", "quadrilaterals are not convex"),
    }
}

fn show(cell: &CellReport) -> String {
    format!("element {} at ({})", cell.element, numbers(&cell.position))
}

fn list(cells: &[CellReport]) -> String {
    cells.iter().map(show).collect::<Vec<_>>().join(", ")
}
