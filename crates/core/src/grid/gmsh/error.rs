//! Errors in mesh files.

use std::fmt;

use crate::counted::counted;
use crate::input_file::InputFileError;

/// Largest number of physical groups of an element. The number of element-group pairs is the product of two counts in
/// the file; this limit keeps it proportional to the file size.
pub(super) const MAX_GROUPS: usize = 1000;
/// Size of the largest file that is read, [byte]; it corresponds to about 30 million cells.
pub(super) const MAX_BYTES: u64 = 4 << 30;

/// Location of an error in a mesh file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileLocation {
    /// Line of a text file, from 1.
    Line(usize),
    /// Byte offset in a binary file, from 0.
    Byte(usize),
}

impl fmt::Display for FileLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FileLocation::Line(line) => write!(f, "line {line}"),
            FileLocation::Byte(byte) => write!(f, "byte {byte}"),
        }
    }
}

/// An error in a mesh file.
#[derive(Debug, thiserror::Error)]
pub enum GmshError {
    /// The file cannot be read, is not a regular file, or is too large.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// The file is not a gmsh mesh file.
    #[error("not a gmsh mesh file: it does not begin with a section `$MeshFormat`")]
    NotGmsh,
    /// The format version is not supported.
    #[error("gmsh format {version} is not supported")]
    Version {
        /// Version stated by the file.
        version: String,
    },
    /// The file does not conform to its format.
    #[error("{location}: expected {expected}, found {found}")]
    Expected {
        /// Location of the unexpected data.
        location: FileLocation,
        /// The data required by the format.
        expected: &'static str,
        /// The data found, abbreviated.
        found: String,
    },
    /// The file ends too early.
    #[error("{location}: the file ends where {expected} was expected")]
    Truncated {
        /// Location of the end.
        location: FileLocation,
        /// The data required by the format.
        expected: &'static str,
    },
    /// A section is not closed.
    #[error("{location}: section `${section}` has no end")]
    Unclosed {
        /// Location of the start of the section.
        location: FileLocation,
        /// Name of the section.
        section: String,
    },
    /// A count exceeds the size of the rest of the file.
    #[error(
        "{location}: the count of {what}, {count}, is too large for the rest of the file ({})",
        counted(*.left, "byte", "bytes")
    )]
    Count {
        /// Location of the count.
        location: FileLocation,
        /// The counted items.
        what: &'static str,
        /// The count.
        count: u64,
        /// Number of bytes that follow.
        left: usize,
    },
    /// The blocks of a section do not sum to its total.
    #[error("{location}: the section declares {declared} {what}, but its blocks contain a different number")]
    Total {
        /// Location of the contradiction.
        location: FileLocation,
        /// The counted items.
        what: &'static str,
        /// The total in the header of the section.
        declared: usize,
    },
    /// The mesh has prisms or pyramids.
    #[error("prisms and pyramids are not supported, but the file has {}", list(.kinds))]
    Unsupported {
        /// Name in gmsh and number of elements of each such type.
        kinds: Vec<(&'static str, usize)>,
    },
    /// An unknown element type; the rest of the section cannot be read.
    #[error("{location}: unknown element type {code}")]
    UnknownType {
        /// Location of the type.
        location: FileLocation,
        /// Type code in gmsh.
        code: i32,
    },
    /// An element refers to a node that is not defined.
    #[error("{location}: element {element} refers to node {node}, which does not exist")]
    UnknownNode {
        /// Location of the end of the reference.
        location: FileLocation,
        /// Element number.
        element: u64,
        /// Node number.
        node: u64,
    },
    /// Two nodes have the same number.
    #[error("node {node} is defined twice")]
    DuplicateNode {
        /// Node number.
        node: u64,
    },
    /// A coordinate is infinite or NaN.
    #[error("{location}: a coordinate of node {node} is not finite")]
    NonFinite {
        /// Location of the end of the node.
        location: FileLocation,
        /// Node number.
        node: u64,
    },
    /// An element belongs to too many physical groups.
    #[error("an element belongs to {count} physical groups, more than {MAX_GROUPS}")]
    TooManyGroups {
        /// Number of groups to which the element belongs.
        count: usize,
    },
}

fn list(kinds: &[(&'static str, usize)]) -> String {
    kinds.iter().map(|(name, n)| format!("{n} × `{name}`")).collect::<Vec<_>>().join(", ")
}
