//! Additional data of a level that several ranks share.

use super::contributions::Contributions;
use super::ghosts::{Ghosts, Known};

/// The data of a level that several ranks share, in addition to the rows of own nodes.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    pub known: Known,
    pub ghosts: Ghosts,
    /// Entries that the points or the finer nodes of one rank contribute to the rows of another.
    pub contributions: Contributions,
    /// The active nodes, in the order of the nodes of the finest level; the nodes that belong to other ranks come last.
    /// Empty on coarser levels.
    pub active: Vec<u32>,
}
