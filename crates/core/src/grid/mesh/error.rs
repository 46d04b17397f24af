//! Errors and warnings about meshes.

use crate::counted::counted;
use crate::grid::ON_LINE;

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
    #[error("the mesh is not flat: z ranges from {low} to {high}")]
    NotFlat {
        /// Lowest z of a cell, [length].
        low: f64,
        /// Highest z of a cell, [length].
        high: f64,
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
    /// Some cells have negative volume.
    #[error("{}: {}", inverted(*.dimension, *.n), list(.first))]
    Inverted {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// The first of these cells.
        first: Vec<CellReport>,
    },
    /// All cells have negative volume.
    #[error("{}", all_inverted(*.dimension))]
    AllInverted {
        /// Dimension of the analysis.
        dimension: usize,
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
    /// Groups of different dimensions with the same name, so that the name would not denote a unique set of nodes.
    #[error("physical groups of dimensions {} and {} are both called `{name}`; give them different names",
        .dimensions[0], .dimensions[1])]
    SharedName {
        /// The name that the groups share.
        name: String,
        /// Dimensions of the groups.
        dimensions: [u8; 2],
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

fn inverted(dimension: usize, n: usize) -> String {
    match dimension {
        3 => counted(n, "cell is inside out", "cells are inside out"),
        _ => counted(n, "cell has its nodes in clockwise order", "cells have their nodes in clockwise order"),
    }
}

fn all_inverted(dimension: usize) -> &'static str {
    match dimension {
        3 => "all cells are inside out; reverse the order of the nodes of the mesh",
        _ => "all cells have their nodes in clockwise order; reverse the surfaces of the mesh",
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
