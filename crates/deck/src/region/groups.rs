//! Groups of cells that regions are made from.

/// The groups of cells that the regions of a deck are made from, by the numbers that stand for them in regions.
#[derive(Default)]
pub(crate) struct Groups {
    pub(super) names: Vec<Option<String>>,
    /// For each group whether a cell belongs to it; nothing for all cells.
    pub(super) members: Vec<Vec<bool>>,
}

impl Groups {
    /// Whether a cell belongs to a group.
    pub(crate) fn holds(&self, key: usize, cell: usize) -> bool {
        match self.names.get(key) {
            Some(None) => true,
            Some(Some(_)) => self.members[key].get(cell) == Some(&true),
            None => false,
        }
    }
}
