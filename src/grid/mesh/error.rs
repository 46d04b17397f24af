//! What can be wrong with a mesh.

/// A cell in a report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellReport {
    /// Number of the element in the file.
    pub element: u64,
    /// Mean position of its nodes, [length].
    pub position: [f64; 2],
}

/// Why a mesh file is not a mesh for an analysis in the plane. Lists of cells hold the first few only.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The file has no elements of two dimensions.
    #[error("the mesh has no triangles or quadrilaterals")]
    NoCells,
    /// The file has elements of three dimensions.
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
    /// Cells whose area is next to nothing compared with the length of their sides.
    #[error("{n} cells have no area: {}", list(.first))]
    ZeroArea {
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: Vec<CellReport>,
    },
    /// Some cells are clockwise.
    #[error("{n} cells have their nodes in clockwise order: {}", list(.first))]
    Clockwise {
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: Vec<CellReport>,
    },
    /// All cells are clockwise.
    #[error("all cells have their nodes in clockwise order; reverse the surfaces of the mesh")]
    AllClockwise,
    /// Quadrilaterals that are not convex.
    #[error("{n} quadrilaterals are not convex: {}", list(.first))]
    NotConvex {
        /// Number of such cells.
        n: usize,
        /// The first of them.
        first: Vec<CellReport>,
    },
    /// Two cells lie on the same side of an edge.
    #[error("{n} pairs of cells overlap, for example {} and {}", show(&.first[0]), show(&.first[1]))]
    Overlap {
        /// Number of edges with two cells on one side.
        n: usize,
        /// The cells at the first of them.
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
    #[error("{n} pairs of nodes coincide without being one, the first at ({}, {})", .first[0][0], .first[0][1])]
    Unmerged {
        /// Number of such pairs.
        n: usize,
        /// Positions of the first of them, [length].
        first: Vec<[f64; 2]>,
    },
}

fn show(cell: &CellReport) -> String {
    format!("element {} at ({}, {})", cell.element, cell.position[0], cell.position[1])
}

fn list(cells: &[CellReport]) -> String {
    cells.iter().map(show).collect::<Vec<_>>().join(", ")
}
