//! Why a mesh file cannot be read, and where.

use std::fmt;

/// The most physical groups that one element may belong to. The number of links between elements and groups is
/// the product of two counts of the file; this keeps it in proportion to the size of the file.
pub(super) const MAX_GROUPS: usize = 1000;
/// The largest file that is read: some 30 million cells.
pub(super) const MAX_BYTES: u64 = 4 << 30;

/// Where in a file something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line of a text file, from 1.
    Line(usize),
    /// Offset into a binary file, from 0.
    Byte(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line(line) => write!(f, "line {line}"),
            Place::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// Why a mesh file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum GmshError {
    /// The file cannot be opened or read.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// A directory or a device.
    #[error("it is not a file")]
    NotAFile,
    /// The file is larger than any mesh that can be used.
    #[error("the file has {bytes} bytes; at most {MAX_BYTES} are possible")]
    TooLarge {
        /// Size of the file.
        bytes: u64,
    },
    /// The file is something else.
    #[error("not a gmsh mesh file: it does not begin with a section `$MeshFormat`")]
    NotGmsh,
    /// A version of the format that this reader does not know.
    #[error("gmsh format {version} is not supported; save the mesh in format 4.1 or 2.2")]
    Version {
        /// Version as the file states it.
        version: String,
    },
    /// Something else stands where the format demands a certain thing.
    #[error("{place}: expected {expected}, found {found}")]
    Expected {
        /// Where it stands.
        place: Place,
        /// What the format demands.
        expected: &'static str,
        /// What stands there, shortened.
        found: String,
    },
    /// The file ends too early.
    #[error("{place}: the file ends where {expected} was expected")]
    Truncated {
        /// Where it ends.
        place: Place,
        /// What the format demands there.
        expected: &'static str,
    },
    /// A section has no end.
    #[error("{place}: section `${section}` has no end")]
    Unclosed {
        /// Where the section begins.
        place: Place,
        /// Name of the section.
        section: String,
    },
    /// A count that the rest of the file is too short for.
    #[error("{place}: {count} {what} cannot fit into the {left} bytes that follow")]
    Count {
        /// Where the count stands.
        place: Place,
        /// What is counted.
        what: &'static str,
        /// The count.
        count: u64,
        /// Number of bytes after it.
        left: usize,
    },
    /// The blocks of a section do not add up to its total.
    #[error("{place}: the blocks of the section hold other than the announced {declared} {what}")]
    Total {
        /// Where the contradiction shows.
        place: Place,
        /// What is counted.
        what: &'static str,
        /// The total at the head of the section.
        declared: usize,
    },
    /// Element types that are not linear, or linear but not known to this program.
    #[error("{}", unsupported(.kinds))]
    Unsupported {
        /// Gmsh's name and number of elements of every such type.
        kinds: Vec<(&'static str, usize)>,
    },
    /// An element type that does not exist, so that the rest of the section cannot be understood.
    #[error("{place}: unknown element type {code}")]
    UnknownType {
        /// Where it stands.
        place: Place,
        /// Gmsh's number of the type.
        code: i32,
    },
    /// An element refers to a node that the file does not have.
    #[error("{place}: element {element} refers to node {node}, which does not exist")]
    UnknownNode {
        /// Where the reference ends.
        place: Place,
        /// Number of the element.
        element: u64,
        /// Number of the node.
        node: u64,
    },
    /// Two nodes have the same number.
    #[error("node {node} is defined twice")]
    DuplicateNode {
        /// Number of the node.
        node: u64,
    },
    /// A coordinate is infinite or not a number.
    #[error("{place}: a coordinate of node {node} is not finite")]
    NonFinite {
        /// Where the node ends.
        place: Place,
        /// Number of the node.
        node: u64,
    },
    /// The mesh is split into parts.
    #[error("{place}: the mesh is partitioned; save it without partitions")]
    Partitioned {
        /// Where the section begins.
        place: Place,
    },
    /// An element belongs to more groups than any sensible mesh has.
    #[error("an element belongs to {count} physical groups, more than {MAX_GROUPS}")]
    TooManyGroups {
        /// Number of its groups.
        count: usize,
    },
}

fn unsupported(kinds: &[(&'static str, usize)]) -> String {
    let found = list(kinds);
    if kinds.iter().all(|(name, _)| ["Prism 6", "Pyramid 5"].contains(name)) {
        format!("prisms and pyramids are not supported, the file has {found}; use tetrahedra or hexahedra")
    } else {
        format!("only linear elements are supported, the file has {found}; save it with order 1")
    }
}

fn list(kinds: &[(&'static str, usize)]) -> String {
    kinds.iter().map(|(name, n)| format!("{n} × `{name}`")).collect::<Vec<_>>().join(", ")
}
