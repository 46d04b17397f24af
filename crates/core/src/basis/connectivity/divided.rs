//! Links that are divided between ranks: the nodes and cells that the ranks share.

use std::collections::BTreeMap;

use super::super::slivers::Carriers;
use super::Connectivity;
use crate::grid::Grid;
use crate::ranks::{Halo, Ranks, Reduction, Sharing, sharing};

impl<const D: usize> Connectivity<D> {
    /// Replaces the reduction and returns the previous one. With the default, the links are treated as if no other rank
    /// shared them, and nothing is summed over ranks.
    pub(crate) fn exchange_reduction(&mut self, reduction: Reduction) -> Reduction {
        std::mem::replace(&mut self.reduction, reduction)
    }

    /// Adds active nodes of other ranks, given by their grid numbers, to the active nodes of this rank; those that no
    /// rank touches, which would have no stiffness, stay inactive.
    pub fn with_nodes(mut self, grid: &dyn Grid<D>, ranks: &Ranks, mut wanted: Vec<u32>) -> Self {
        wanted.retain(|node| !self.is_active(*node as usize));
        if !ranks.any(!wanted.is_empty()) {
            return self;
        }
        self.group_nodes.iter_mut().for_each(|node| *node = self.copies.nodes()[*node as usize]);
        let mut is_own = vec![false; grid.n_nodes()];
        self.group_nodes.iter().for_each(|node| is_own[*node as usize] = true);
        let mut own = ranks.gather_all(wanted.clone()).concat();
        own.retain(|node| is_own[*node as usize]);
        let mut touched = ranks.gather_all(own).concat();
        touched.sort_unstable();
        wanted.retain(|node| touched.binary_search(node).is_ok());
        self.layer_nodes.extend(wanted);
        self.number_active_nodes(grid.n_nodes());
        self.reduction = Reduction::new(self.find_halo(ranks, grid.n_nodes()));
        self
    }

    /// Adds those cells of other ranks that adjoin cells of this rank, together with the active nodes of the added
    /// cells. Nodes are identified by their grid numbers.
    #[inline(never)]
    pub(super) fn add_layer(&mut self, grid: &dyn Grid<D>, ranks: &Ranks, sharing: &Sharing) {
        let Some(communicator) = ranks.communicator() else { return };
        let mut is_touched = vec![false; grid.n_nodes()];
        self.group_nodes.iter().for_each(|node| is_touched[*node as usize] = true);
        let mut messages: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for &cell in &self.active_cells {
            let corners = grid.corners(cell as usize);
            let mut others: Vec<u32> = (corners.nodes().iter())
                .filter_map(|node| sharing.binary_search_by_key(node, |(node, _)| *node).ok())
                .flat_map(|place| sharing[place].1.iter().map(|sharer| sharer.rank))
                .filter(|rank| *rank as usize != ranks.own())
                .collect();
            others.sort_unstable();
            others.dedup();
            let nodes: Vec<u32> =
                corners.nodes().iter().copied().filter(|node| is_touched[*node as usize]).collect();
            for rank in others {
                let message = messages.entry(rank as usize).or_default();
                message.extend([cell, nodes.len() as u32]);
                message.extend(&nodes);
            }
        }
        let bytes = |words: Vec<u32>| words.into_iter().flat_map(u32::to_ne_bytes).collect();
        let messages = messages.into_iter().map(|(rank, words)| (rank, bytes(words))).collect();
        for (_, message) in communicator.exchange(messages) {
            let mut words =
                message.chunks_exact(4).map(|word| u32::from_ne_bytes(word.try_into().unwrap_or_default()));
            while let (Some(cell), Some(n)) = (words.next(), words.next()) {
                self.layer_cells.push(cell);
                self.layer_nodes.extend(words.by_ref().take(n as usize));
            }
        }
        self.layer_cells.sort_unstable();
        self.layer_cells.dedup();
        let own = &self.active_cells;
        self.layer_cells.retain(|cell| own.binary_search(cell).is_err());
    }

    /// Grid nodes, with the carriers of sliver nodes in place of these, which are active on no rank.
    pub fn with_carriers_of(&self, mut nodes: Vec<u32>) -> Vec<u32> {
        let of_all = || self.carriers.iter();
        let carriers = nodes.iter().flat_map(|node| of_all().filter_map(|all| all.get(node))).flatten();
        let more: Vec<u32> = carriers.map(|(carrier, _)| *carrier).collect();
        nodes.retain(|node| !of_all().any(|all| all.contains_key(node)));
        nodes.extend(more);
        nodes
    }

    /// Adds the nodes of those groups with carriers, on any rank, that have a node of this rank: carriers couple nodes
    /// beyond the layer of adjacent cells. Nodes are identified by their grid numbers.
    pub(super) fn add_carriers(&mut self, ranks: &Ranks, n_nodes: usize) {
        let mut is_carrier = vec![false; n_nodes];
        let carriers = self.carriers.iter().flat_map(Carriers::values).flatten();
        carriers.for_each(|(node, _)| is_carrier[*node as usize] = true);
        let mut is_own = vec![false; n_nodes];
        self.group_nodes.iter().for_each(|node| is_own[*node as usize] = true);
        let groups = self.group_node_start.windows(2).map(|ends| &self.group_nodes[ends[0]..ends[1]]);
        let with_carriers = groups.filter(|nodes| nodes.iter().any(|node| is_carrier[*node as usize]));
        let lists: Vec<Vec<u32>> = with_carriers.map(<[u32]>::to_vec).collect();
        for nodes in ranks.gather_all(lists).into_iter().flatten() {
            if nodes.iter().any(|node| is_own[*node as usize]) {
                self.layer_nodes.extend(nodes.into_iter().filter(|node| !is_own[*node as usize]));
            }
        }
    }

    /// The active nodes that other ranks also have.
    pub(super) fn find_halo(&self, ranks: &Ranks, n_nodes: usize) -> Halo {
        if ranks.is_alone() {
            return Halo::default();
        }
        let mut nodes: Vec<(u32, bool)> = self.active_nodes().iter().map(|node| (*node, false)).collect();
        self.group_nodes.iter().for_each(|active| nodes[*active as usize].1 = true);
        Halo::new(ranks, self.active_nodes(), &sharing(ranks, &nodes, n_nodes))
    }

    /// The active cells that this rank writes to result files; if several ranks have a cell, the lowest of them writes
    /// it. All ranks must call this together.
    #[inline(never)]
    pub fn shown_cells(&self, grid: &dyn Grid<D>) -> Vec<u32> {
        let ranks = self.halo().ranks();
        let mut cells = self.active_cells.clone();
        let own: Vec<(u32, bool)> = cells.iter().map(|cell| (*cell, true)).collect();
        let shared = sharing(ranks, &own, grid.n_cells());
        let is_of_lower = |cell: &u32| {
            let sharers = shared.binary_search_by_key(cell, |(cell, _)| *cell).map(|place| &shared[place].1);
            sharers
                .is_ok_and(|sharers| sharers.first().is_some_and(|first| (first.rank as usize) < ranks.own()))
        };
        cells.retain(|cell| !is_of_lower(cell));
        cells
    }

    /// The nodes that are touched by groups of this rank and also by groups of other ranks.
    pub(super) fn sharing(&self, ranks: &Ranks, n_nodes: usize) -> Sharing {
        if ranks.is_alone() {
            return Vec::new();
        }
        let mut nodes = self.group_nodes.clone();
        nodes.sort_unstable();
        nodes.dedup();
        let nodes: Vec<(u32, bool)> = nodes.into_iter().map(|node| (node, true)).collect();
        sharing(ranks, &nodes, n_nodes)
    }
}
