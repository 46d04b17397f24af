//! Fill-reducing order of elimination from the positions of the nodes: geometric nested dissection (George, 1973).
//!
//! The background grid is known, so no graph partitioner is needed: the set of nodes is cut across its longest side,
//! the two halves are ordered first and the separator between them last.

use std::ops::Range;

/// A part with at most this number of nodes is not cut further.
const LEAF: usize = 16;

/// Orders nodes given by integer coordinates; `reach[d]` is the largest distance along axis d at which two nodes are
/// coupled, and hence the necessary thickness of a separator. Returns the nodes in the order of elimination.
pub fn nested_dissection<const D: usize>(coordinates: &[[u32; D]], reach: [u32; D]) -> Vec<usize> {
    let mut nodes: Vec<usize> = (0..coordinates.len()).collect();
    let mut order = Vec::with_capacity(nodes.len());
    Dissection { coordinates, reach, order: &mut order, along: vec![], within: vec![], above: vec![] }
        .dissect(&mut nodes);
    order
}

struct Dissection<'a, const D: usize> {
    coordinates: &'a [[u32; D]],
    reach: [u32; D],
    order: &'a mut Vec<usize>,
    /// Working space for the coordinates of nodes along the axis of a cut, the nodes of a separator, and the nodes
    /// above it.
    along: Vec<u32>,
    within: Vec<usize>,
    above: Vec<usize>,
}

impl<const D: usize> Dissection<'_, D> {
    /// Appends nodes, given in ascending order, to the order of elimination.
    fn dissect(&mut self, nodes: &mut [usize]) {
        if nodes.len() <= LEAF {
            self.order.extend_from_slice(nodes);
            return;
        }
        let axis = self.longest(nodes);
        self.along.clear();
        self.along.extend(nodes.iter().map(|&node| self.coordinates[node][axis]));
        let middle = nodes.len() / 2;
        let cut = *self.along.select_nth_unstable(middle).1;
        let (left, right) = self.part(nodes, axis, cut..cut + self.reach[axis].max(1));
        let (parts, separator) = nodes.split_at_mut(right);
        if parts.is_empty() {
            self.order.extend_from_slice(separator);
            return;
        }
        let (low, high) = parts.split_at_mut(left);
        self.dissect(low);
        self.dissect(high);
        self.order.extend_from_slice(separator);
    }

    /// The axis along which the nodes extend farthest, in units of the separator thickness.
    fn longest(&self, nodes: &[usize]) -> usize {
        let (mut low, mut high) = ([u32::MAX; D], [0; D]);
        for &node in nodes {
            for d in 0..D {
                low[d] = low[d].min(self.coordinates[node][d]);
                high[d] = high[d].max(self.coordinates[node][d]);
            }
        }
        let extent = |d: usize| f64::from(high[d] - low[d] + 1) / f64::from(self.reach[d].max(1));
        (0..D).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0)
    }

    /// Reorders the nodes: first the nodes below a separator, then the nodes above it, then the separator itself;
    /// returns the starts of the second and the third group. Nodes of the same group keep their order.
    fn part(&mut self, nodes: &mut [usize], axis: usize, separator: Range<u32>) -> (usize, usize) {
        self.within.clear();
        self.above.clear();
        let mut left = 0;
        for k in 0..nodes.len() {
            let node = nodes[k];
            let c = self.coordinates[node][axis];
            if c < separator.start {
                nodes[left] = node;
                left += 1;
            } else if c < separator.end {
                self.within.push(node);
            } else {
                self.above.push(node);
            }
        }
        let right = left + self.above.len();
        nodes[left..right].copy_from_slice(&self.above);
        nodes[right..].copy_from_slice(&self.within);
        (left, right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of factor entries of the nine-point matrix on an m×m grid for a given order, by symbolic elimination.
    fn fill(m: usize, order: &[usize]) -> usize {
        let mut place = vec![0; m * m];
        for (k, &node) in order.iter().enumerate() {
            place[node] = k;
        }
        let mut columns: Vec<std::collections::BTreeSet<usize>> = vec![Default::default(); m * m];
        for a in 0..m * m {
            for b in 0..m * m {
                let near = (a % m).abs_diff(b % m) <= 1 && (a / m).abs_diff(b / m) <= 1;
                if near && place[a] > place[b] {
                    columns[place[b]].insert(place[a]);
                }
            }
        }
        let mut entries = 0;
        for k in 0..m * m {
            entries += columns[k].len() + 1;
            let column = std::mem::take(&mut columns[k]);
            if let Some(&parent) = column.first() {
                columns[parent].extend(column.into_iter().skip(1));
            }
        }
        entries
    }

    #[test]
    fn it_is_a_permutation_with_less_fill_than_the_natural_order() {
        let m = 60;
        let coordinates: Vec<[u32; 2]> = (0..m * m).map(|n| [(n % m) as u32, (n / m) as u32]).collect();
        let order = nested_dissection(&coordinates, [1, 1]);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..m * m).collect::<Vec<_>>());
        let natural: Vec<usize> = (0..m * m).collect();
        assert!(fill(m, &order) * 2 < fill(m, &natural), "{} {}", fill(m, &order), fill(m, &natural));
    }

    #[test]
    fn degenerate_sets_are_ordered() {
        assert!(nested_dissection::<2>(&[], [1, 1]).is_empty());
        let stacked = vec![[3u32, 3]; 100];
        assert_eq!(nested_dissection(&stacked, [1, 1]).len(), 100);
        let line: Vec<[u32; 2]> = (0..1000).map(|i| [i, 0]).collect();
        assert_eq!(nested_dissection(&line, [7, 1]).len(), 1000);
    }
}
