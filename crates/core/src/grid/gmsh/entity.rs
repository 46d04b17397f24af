//! Elements and physical groups of a mesh file.

use std::collections::HashMap;

use super::kinds::ElementKind;

/// An element of a mesh file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Element {
    /// Element number in the file; not necessarily unique.
    pub tag: u64,
    /// Type of the element.
    pub kind: ElementKind,
    pub(super) nodes: [u32; 8],
    pub(super) group_set: u32,
}

impl Element {
    /// Indices of the nodes into [`GmshFile::nodes`], in gmsh order.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.kind.n_nodes()]
    }

    /// Reverses the orientation of the element: the sign of its area or volume changes.
    pub(crate) fn turn(&mut self) {
        match self.kind {
            ElementKind::Point | ElementKind::Line => {}
            ElementKind::Triangle | ElementKind::Tetrahedron => self.nodes.swap(1, 2),
            ElementKind::Quadrilateral => self.nodes.swap(1, 3),
            ElementKind::Hexahedron => self.nodes.rotate_left(4),
        }
    }
}

/// A named set of elements of one dimension.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PhysicalGroup {
    /// Dimension, from 0 (points) to 3 (volumes).
    pub dimension: u8,
    /// Group number; unique within its dimension.
    pub tag: u32,
    /// Name of the group; its tag as text if the file has no name for it.
    pub name: String,
}

/// A physical group as (dimension, tag).
pub(super) type GroupKey = (u8, u32);

/// The physical groups of the entities in a file of format 4.1, keyed by entity dimension and tag.
pub(super) type EntityGroups = HashMap<(u8, i32), Vec<GroupKey>>;
