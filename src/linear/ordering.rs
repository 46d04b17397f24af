//! Fill-reducing order of elimination from the places of the nodes: geometric nested dissection (George, 1973).
//!
//! The background grid is known, so no graph partitioner is needed: the set of nodes is cut across its longest side,
//! the two halves are ordered first and the separator between them last.

/// Below this many nodes a part is not cut further.
const LEAF: usize = 32;

/// Orders nodes given by integer coordinates; `reach[d]` is the largest distance along axis d at which two nodes
/// are coupled, which is how thick a separator must be. Returns the nodes in the order of elimination.
pub fn nested_dissection<const D: usize>(coordinates: &[[u32; D]], reach: [u32; D]) -> Vec<usize> {
    let mut nodes: Vec<usize> = (0..coordinates.len()).collect();
    let mut order = Vec::with_capacity(nodes.len());
    dissect(coordinates, reach, &mut nodes, &mut order);
    order
}

fn dissect<const D: usize>(
    coordinates: &[[u32; D]],
    reach: [u32; D],
    nodes: &mut [usize],
    order: &mut Vec<usize>,
) {
    if nodes.len() <= LEAF {
        nodes.sort_unstable();
        order.extend_from_slice(nodes);
        return;
    }
    // The axis that holds the most separators' thicknesses side by side.
    let extent = |d: usize| {
        let along = nodes.iter().map(|&n| coordinates[n][d]);
        let (low, high) = along.fold((u32::MAX, 0), |(l, h), c| (l.min(c), h.max(c)));
        f64::from(high - low + 1) / f64::from(reach[d].max(1))
    };
    let axis = (0..D).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let middle = nodes.len() / 2;
    let (_, &mut median, _) = nodes.select_nth_unstable_by_key(middle, |&n| (coordinates[n][axis], n));
    let cut = coordinates[median][axis];
    let thickness = reach[axis].max(1);
    let side = |n: usize| match coordinates[n][axis] {
        c if c < cut => 0,
        c if c < cut + thickness => 2,
        _ => 1,
    };
    nodes.sort_unstable_by_key(|&n| (side(n), n));
    let left = nodes.partition_point(|&n| side(n) < 1);
    let right = nodes.partition_point(|&n| side(n) < 2);
    if left == 0 && right == 0 {
        // Everything lies in the separator.
        order.extend_from_slice(nodes);
        return;
    }
    let (parts, separator) = nodes.split_at_mut(right);
    let (low, high) = parts.split_at_mut(left);
    dissect(coordinates, reach, low, order);
    dissect(coordinates, reach, high, order);
    order.extend_from_slice(separator);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of entries of the factor of an m×m nine-point matrix under an order, by symbolic elimination.
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
