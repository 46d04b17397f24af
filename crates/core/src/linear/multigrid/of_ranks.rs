//! Additional data of a level that several ranks share.

use super::contributions::Contributions;
use super::ghosts::{Ghosts, Known};

/// The data of a level that several ranks share, in addition to the rows of own nodes.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    pub known: Known,
    pub ghosts: Ghosts,
    /// Entries of rows that the points or the finer nodes of other ranks contribute.
    pub contributions: Contributions,
    /// The active nodes, in the order of the nodes of the finest level; the nodes that this rank does not touch come
    /// last. Empty on coarser levels.
    pub active: Vec<u32>,
}
