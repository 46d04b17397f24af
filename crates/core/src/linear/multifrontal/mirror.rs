//! The two triangles of an unsymmetric matrix with a symmetric pattern.

use crate::linear::Pattern;

/// The lower triangle of the pattern and, for each of its entries (i, j), the indices of a_ij and of its mirror image
/// a_ji in the values of the matrix.
pub(super) struct Mirror {
    pub lower: Pattern,
    pub below: Vec<u32>,
    pub above: Vec<u32>,
}

impl Mirror {
    /// The two triangles of a pattern; `None` if an entry has no mirror image, or if a diagonal entry is missing.
    pub fn new(pattern: &Pattern) -> Option<Mirror> {
        let mut lower = Pattern { n: pattern.n, column_start: vec![0], row: Vec::new(), symmetric: true };
        let mut below = Vec::new();
        for j in 0..pattern.n {
            let diagonal = lower.row.len();
            for e in pattern.column_start[j]..pattern.column_start[j + 1] {
                if pattern.row[e] >= j {
                    lower.row.push(pattern.row[e]);
                    below.push(e as u32);
                }
            }
            if lower.row.get(diagonal) != Some(&j) {
                return None;
            }
            lower.column_start.push(lower.row.len());
        }
        // In a pass column by column, the entries of row i appear in the order of the lower part of column i.
        let mut above = vec![0; below.len()];
        let mut next = lower.column_start.clone();
        for j in 0..pattern.n {
            for e in pattern.column_start[j]..pattern.column_start[j + 1] {
                let i = pattern.row[e];
                if i > j {
                    break;
                }
                if next[i] == lower.column_start[i + 1] || lower.row[next[i]] != j {
                    return None;
                }
                above[next[i]] = e as u32;
                next[i] += 1;
            }
        }
        let is_complete = next.iter().zip(&lower.column_start[1..]).all(|(next, end)| next == end);
        is_complete.then_some(Mirror { lower, below, above })
    }
}
