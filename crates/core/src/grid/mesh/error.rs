//! What can be wrong with a mesh.

use crate::grid::ON_LINE;
use crate::grid::element::ElementShape;

/// A cell in a report.
#[derive(Debug, Clone, PartialEq)]
pub struct CellReport {
    /// Number of the element in the file.
    pub element: u64,
    /// Mean position of its nodes, [length].
    pub position: Vec<f64>,
}

/// A node on a side of a cell that it is no corner of.
#[derive(Debug, Clone, PartialEq)]
pub struct HangingNode {
    /// Number of the node in the file.
    pub node: u64,
    /// Its position, [length].
    pub position: Vec<f64>,
    /// Numbers in the file of the corners of the side.
    pub side: Vec<u64>,
    /// The cell that the side belongs to.
    pub cell: CellReport,
}

/// Why a mesh file is not a mesh for an analysis in the plane or in space. Lists of cells hold the first few only.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The file has no elements of the dimension of the analysis.
    #[error("{}", no_cells(*.dimension, *.n_surface))]
    NoCells {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of surface elements that a mesh without volume elements has, if it ought to have those.
        n_surface: usize,
    },
    /// The file has elements of three dimensions, and the analysis is in the plane.
    #[error(
        "the mesh has {n} solid elements; an analysis in the plane needs triangles or quadrilaterals only"
    )]
    Solid {
        /// Number of such elements.
        n: usize,
    },
    /// Cells are not in one plane of constant z.
    #[error("the mesh is not flat: z goes from {low} to {high}")]
    NotFlat {
        /// Least z of a cell, [length].
        low: f64,
        /// Greatest z of a cell, [length].
        high: f64,
    },
    /// Cells whose volume is next to nothing compared with the length of their sides.
    #[error("{n} cells have no {}: {}", if *.dimension == 3 { "volume" } else { "area" }, list(.first))]
    NoVolume {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: Vec<CellReport>,
    },
    /// Some cells have negative volume.
    #[error("{n} cells {}: {}", inverted(*.dimension), list(.first))]
    Inverted {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: Vec<CellReport>,
    },
    /// All cells have negative volume.
    #[error("all cells {}; reverse the {} of the mesh", inverted(*.dimension), whole(*.dimension))]
    AllInverted {
        /// Dimension of the analysis.
        dimension: usize,
    },
    /// Quadrilaterals that are not convex, or hexahedra whose map turns inside out somewhere.
    #[error("{n} {}: {}", folded(*.dimension), list(.first))]
    Folded {
        /// Dimension of the analysis.
        dimension: usize,
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: Vec<CellReport>,
    },
    /// Cells are so far from the origin that their coordinates have hardly a digit left.
    #[error(
        "coordinates of {n} cells have a round-off of more than {ON_LINE:e} of their sides, for example {}; take the \
         origin of the coordinates near the bodies", show(.first)
    )]
    FarAway {
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: CellReport,
    },
    /// Cells have more in common than their sides.
    #[error(
        "{n} pairs of cells overlap, for example {} and {}; take one of the two out, or mesh what overlaps as one part",
        show(&.first[0]), show(&.first[1])
    )]
    Overlap {
        /// Number of such pairs; where two cells lie on the same side of an edge or face, the number of those.
        n: usize,
        /// The first pair.
        first: [CellReport; 2],
    },
    /// Nodes lie on sides of cells that they are connected with but no corners of, so that the basis is not continuous.
    #[error(
        "{n} nodes lie on a side of a cell without being its corner, for example node {} at ({}) on the side between the \
         nodes {} of {}; such meshes are not continuous: cut that cell at the node, or give the cells on both sides the \
         same nodes", .first.node, numbers(&.first.position), tags(&.first.side), show(&.first.cell)
    )]
    Hanging {
        /// Number of such nodes.
        n: usize,
        /// The first of them.
        first: Box<HangingNode>,
    },
    /// Tetrahedra share half a face with hexahedra, where their basis functions do not agree.
    #[error(
        "{n} faces of tetrahedra share three nodes with a face of a hexahedron, for example of {} and {}; such \
         meshes are not continuous: use one kind of element, or keep the two kinds apart",
        show(&.first[0]), show(&.first[1])
    )]
    Nonconforming {
        /// Number of such faces.
        n: usize,
        /// The first tetrahedron and its hexahedron.
        first: [CellReport; 2],
    },
    /// Groups of different dimensions have the same name, so that the set of nodes would be ambiguous.
    #[error("physical groups of dimensions {} and {} are both called `{name}`; give them different names",
        .dimensions[0], .dimensions[1])]
    SharedName {
        /// The name.
        name: String,
        /// Dimensions of the groups.
        dimensions: [u8; 2],
    },
}

/// What is allowed in a mesh but probably not meant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshWarning {
    /// Nodes of different cells at the same position, so that the cells are not connected there.
    #[error("{n} pairs of nodes coincide without being one, the first at ({})", numbers(&.first[0]))]
    Unmerged {
        /// Number of such pairs.
        n: usize,
        /// Positions of the first of them, [length].
        first: Vec<Vec<f64>>,
    },
    /// Nodes of one part of the mesh on sides of another part, which it is not connected with.
    #[error(
        "{n} nodes lie on sides of another part that they are not connected with, the first at ({}): bodies are torn there",
        numbers(&.first[0])
    )]
    Apart {
        /// Number of such nodes.
        n: usize,
        /// Positions of the first of them, [length].
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
            "the mesh has no tetrahedra or hexahedra, only {n} surface elements; an analysis in space needs the volume \
             meshed (in gmsh, `Mesh 3`; if there are physical groups, one of the volume, too)"
        ),
        _ => "the mesh has no triangles or quadrilaterals".to_owned(),
    }
}

fn inverted(dimension: usize) -> &'static str {
    if dimension == 3 { "are inside out" } else { "have their nodes in clockwise order" }
}

fn whole(dimension: usize) -> &'static str {
    if dimension == 3 { "order of the nodes" } else { "surfaces" }
}

fn folded(dimension: usize) -> String {
    let cells =
        if dimension == 3 { ElementShape::Box.plural::<3>() } else { ElementShape::Box.plural::<2>() };
    let fault = if dimension == 3 { "are so distorted that they turn inside out" } else { "are not convex" };
    format!("{cells} {fault}")
}

fn show(cell: &CellReport) -> String {
    format!("element {} at ({})", cell.element, numbers(&cell.position))
}

fn list(cells: &[CellReport]) -> String {
    cells.iter().map(show).collect::<Vec<_>>().join(", ")
}
