//! The versions of the format.

/// Supported versions of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Version {
    V2,
    V40,
    V41,
}
