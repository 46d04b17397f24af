//! What a level has because several ranks share it.

use super::contributions::Contributions;
use super::ghosts::{Ghosts, Known};

/// What a level of several ranks has besides the rows of own nodes.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    pub known: Known,
    pub ghosts: Ghosts,
    /// Entries of rows that come from the points, or from the finer nodes, of other ranks.
    pub contributions: Contributions,
    /// The active nodes, in the order of the nodes of the finest level; nodes that this rank does not touch follow them. Empty
    /// on coarser levels.
    pub active: Vec<u32>,
}
