//! The connected parts of the active nodes.

use super::Connectivity;

impl<const D: usize> Connectivity<D> {
    /// Connected parts of the active nodes: for each node, the lowest node coupled to it directly or through others.
    /// Two nodes are coupled if one point touches both.
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
            let of_group = self.points_of(group);
            let looked_at = if self.is_whole(group) { of_group.start..of_group.start + 1 } else { of_group };
            for p in looked_at {
                let local = self.local_nodes(p);
                if local == last {
                    continue; // points of a cell mostly touch the same nodes
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
        // Every root is lower than its nodes, so one pass is sufficient.
        for node in 0..root.len() {
            root[node] = root[root[node]];
        }
        root
    }
}
