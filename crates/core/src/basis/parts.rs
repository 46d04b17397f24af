//! The connected parts of the active nodes.

use super::Connectivity;

/// The connected parts of the active nodes of all ranks, numbered in the order of their lowest nodes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JoinedParts {
    /// Part number of each active node of this rank.
    pub at_node: Vec<u32>,
    /// The lowest grid node of each part.
    pub lowest: Vec<u32>,
}

impl JoinedParts {
    /// The parts on a single rank, from the lowest active node of each node's part, as [`Connectivity::parts`] returns
    /// it; active node numbers take the place of grid node numbers.
    pub fn on_one_rank(lowest: &[usize]) -> Self {
        let mut parts = JoinedParts { at_node: vec![0; lowest.len()], lowest: Vec::new() };
        for (node, &first) in lowest.iter().enumerate() {
            if first == node {
                parts.at_node[node] = parts.lowest.len() as u32;
                parts.lowest.push(node as u32);
            } else {
                parts.at_node[node] = parts.at_node[first];
            }
        }
        parts
    }
}

impl<const D: usize> Connectivity<D> {
    /// Connected parts of the active nodes: for each node, the lowest node coupled to it directly or through other
    /// nodes. Two nodes are coupled if one point touches both.
    pub fn parts(&self) -> Vec<usize> {
        fn find(root: &mut [usize], mut node: usize) -> usize {
            while root[node] != node {
                root[node] = root[root[node]];
                node = root[node];
            }
            node
        }
        let mut root: Vec<usize> = (0..self.n_active()).collect();
        for group in 0..self.n_groups() {
            let nodes = self.nodes_of(group);
            let mut last: &[u32] = &[];
            let in_group = self.points_of(group);
            let looked_at = if self.is_whole(group) { in_group.start..in_group.start + 1 } else { in_group };
            for p in looked_at {
                let local = self.local_nodes(p);
                if local == last {
                    continue; // points of a cell usually touch the same nodes
                }
                last = local;
                let Some((&first, others)) = local.split_first() else { continue };
                let mut lowest = find(&mut root, nodes[first as usize] as usize);
                for &k in others {
                    let other = find(&mut root, nodes[k as usize] as usize);
                    if other != lowest {
                        root[other.max(lowest)] = other.min(lowest);
                        lowest = lowest.min(other);
                    }
                }
            }
        }
        // Every parent has a lower number than its children, so one pass in ascending order is sufficient.
        for node in 0..root.len() {
            root[node] = root[root[node]];
        }
        root
    }

    /// The connected parts of the active nodes of all ranks: parts that share a node count as one.
    #[inline(never)]
    pub fn joined_parts(&self) -> JoinedParts {
        let lowest = self.parts();
        let mut parts = JoinedParts::on_one_rank(&lowest);
        let nodes = self.active_nodes();
        let ranks = self.halo().ranks();
        if ranks.is_alone() {
            parts.lowest.iter_mut().for_each(|node| *node = nodes[*node as usize]);
            return parts;
        }
        let mut label: Vec<f64> = lowest.iter().map(|&node| f64::from(nodes[node])).collect();
        loop {
            let mut least = vec![f64::INFINITY; parts.lowest.len()];
            let before = label.clone();
            self.halo().minimum(&mut label);
            for (label, part) in label.iter().zip(&parts.at_node) {
                least[*part as usize] = label.min(least[*part as usize]);
            }
            for (label, part) in label.iter_mut().zip(&parts.at_node) {
                *label = least[*part as usize];
            }
            if !ranks.any(label != before) {
                break;
            }
        }
        let mut present: Vec<u32> = label.iter().map(|label| *label as u32).collect();
        let at_node = present.clone();
        present.sort_unstable();
        present.dedup();
        let mut all: Vec<u32> = ranks.gather_all(present).concat();
        all.sort_unstable();
        all.dedup();
        let number = |label: &u32| all.partition_point(|other| other < label) as u32;
        JoinedParts { at_node: at_node.iter().map(number).collect(), lowest: all }
    }
}
