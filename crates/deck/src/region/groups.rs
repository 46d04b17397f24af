//! Groups of cells that regions are made of.

/// The groups of cells that the regions of a deck are made of, by the numbers that regions use for them.
#[derive(Default)]
pub(crate) struct Groups {
    pub(super) names: Vec<Option<String>>,
    /// For each group, true for its cells; empty for the group of all cells.
    pub(super) members: Vec<Vec<bool>>,
}

impl Groups {
    /// True if a cell belongs to a group.
    pub(crate) fn holds(&self, key: usize, cell: usize) -> bool {
        match self.names.get(key) {
            Some(None) => true,
            Some(Some(_)) => self.members[key].get(cell) == Some(&true),
            None => false,
        }
    }

    /// The cells of a group of a grid with `n_cells` cells, ascending.
    pub(crate) fn cells(&self, key: usize, n_cells: usize) -> Vec<u32> {
        (0..n_cells).filter(|&cell| self.holds(key, cell)).map(|cell| cell as u32).collect()
    }
}
