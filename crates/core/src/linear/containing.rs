//! Reuse of an analysed pattern for patterns that it contains.

use serde::{Deserialize, Serialize};

use super::Pattern;

/// Largest number of unknowns of a reused pattern, relative to the number of unknowns of the new pattern, [-].
const MOST: f64 = 1.25;

/// The analysed pattern of a symmetric matrix. The names of its unknowns remain valid from step to step: grid node
/// times the number of components of a node, plus the component; ascending.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Named {
    /// Name of each unknown.
    pub names: Vec<u64>,
    /// The couplings of the unknowns.
    pub pattern: Pattern,
    /// The unknowns in the order of elimination.
    pub order: Vec<usize>,
}

impl Named {
    /// True if this pattern can belong to a grid with this number of nodes in `D` dimensions. A pattern from a file
    /// need not satisfy this.
    pub fn fits<const D: usize>(&self, nodes: usize) -> bool {
        let Pattern { n, column_start, row, symmetric } = &self.pattern;
        let of_column = |j: usize| {
            let rows = row.get(column_start[j]..column_start[j + 1]);
            rows.is_some_and(|rows| {
                rows.first() == Some(&j)
                    && rows.is_sorted_by(|a, b| a < b)
                    && rows.last().is_some_and(|i| i < n)
            })
        };
        *symmetric
            && self.names.len() == *n
            && self.names.is_sorted_by(|a, b| a < b)
            && self.names.last().is_none_or(|name| *name < (nodes * D) as u64)
            && column_start.len().checked_sub(1) == Some(*n)
            && column_start.first() == Some(&0)
            && column_start.last() == Some(&row.len())
            && (0..*n).all(of_column)
            && self.is_order()
    }

    /// True if each unknown occurs once in the order of elimination.
    fn is_order(&self) -> bool {
        let mut is_met = vec![false; self.pattern.n];
        let mut once =
            |unknown: &usize| is_met.get_mut(*unknown).is_some_and(|met| !std::mem::replace(met, true));
        self.order.len() == self.pattern.n && self.order.iter().all(&mut once)
    }
}

/// The indices of the unknowns and entries of a pattern in a larger one that contains it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Embedding {
    unknown: Vec<usize>,
    entry: Vec<usize>,
    /// Diagonal entries of the unknowns that only the larger pattern has.
    absent: Vec<usize>,
    n: usize,
    n_entries: usize,
}

impl Embedding {
    /// The embedding; `None` if the larger pattern does not contain the given one, or is too large for reuse to be
    /// worthwhile.
    pub fn new(names: &[u64], of: &Pattern, outer: &Named) -> Option<Embedding> {
        let within = &outer.pattern;
        if within.n as f64 > MOST * of.n as f64 {
            return None;
        }
        let unknown = places(names, &outer.names)?;
        let mut entry = Vec::with_capacity(of.row.len());
        for j in 0..of.n {
            let (start, end) = (within.column_start[unknown[j]], within.column_start[unknown[j] + 1]);
            let rows: Vec<usize> =
                of.row[of.column_start[j]..of.column_start[j + 1]].iter().map(|&i| unknown[i]).collect();
            entry.extend(places(&rows, &within.row[start..end])?.iter().map(|place| start + place));
        }
        let mut is_absent = vec![true; within.n];
        unknown.iter().for_each(|&place| is_absent[place] = false);
        let absent = (0..within.n).filter(|&place| is_absent[place]).map(|place| within.column_start[place]);
        Some(Embedding { absent: absent.collect(), unknown, entry, n: within.n, n_entries: within.row.len() })
    }

    /// Values of the larger pattern: the values of the contained pattern, and an arbitrary diagonal entry for each
    /// unknown that the contained pattern does not have.
    pub fn values(&self, inner: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.n_entries];
        let mut largest = 0.0f64;
        for (&place, &value) in self.entry.iter().zip(inner) {
            values[place] = value;
            largest = largest.max(value.abs());
        }
        self.absent.iter().for_each(|&place| values[place] = largest);
        values
    }

    /// A right-hand side for the larger pattern.
    pub fn spread(&self, inner: &[f64]) -> Vec<f64> {
        let mut rhs = vec![0.0; self.n];
        for (&place, &value) in self.unknown.iter().zip(inner) {
            rhs[place] = value;
        }
        rhs
    }

    /// The part of a solution for the larger pattern that belongs to the unknowns of the contained pattern.
    pub fn gather(&self, outer: &[f64], inner: &mut [f64]) {
        for (&place, value) in self.unknown.iter().zip(inner) {
            *value = outer[place];
        }
    }

    /// The index, in the contained pattern, of an unknown of the larger pattern; `None` if the contained pattern lacks
    /// it.
    pub fn number(&self, outer: usize) -> Option<usize> {
        self.unknown.binary_search(&outer).ok()
    }
}

/// The index of each number of an ascending list in another ascending list; `None` if a number is missing there.
fn places<T: PartialEq>(of: &[T], among: &[T]) -> Option<Vec<usize>> {
    let mut next = 0;
    of.iter()
        .map(|x| {
            next += 1 + among[next..].iter().position(|y| y == x)?;
            Some(next - 1)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Direct, LinearSolver};
    use super::*;

    /// A row of nodes with two unknowns each, coupled with their neighbours.
    fn row(nodes: &[u64]) -> Named {
        let names: Vec<u64> = nodes.iter().flat_map(|node| [2 * node, 2 * node + 1]).collect();
        let mut pattern = Pattern { n: names.len(), column_start: vec![0], row: Vec::new(), symmetric: true };
        for j in 0..names.len() {
            pattern.row.extend((j..names.len()).filter(|&i| names[i] / 2 - names[j] / 2 <= 1));
            pattern.column_start.push(pattern.row.len());
        }
        // An order that differs from the natural order.
        let order = (0..names.len()).rev().collect();
        Named { names, pattern, order }
    }

    #[test]
    fn what_a_pattern_contains_is_solved_with_it() {
        let outer = row(&[3, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        for nodes in [&[3u64, 4, 5, 6, 7, 8, 9, 10, 11, 12][..], &[4, 5, 6, 8, 9, 10, 11, 12]] {
            let inner = row(nodes);
            let embedding = Embedding::new(&inner.names, &inner.pattern, &outer).unwrap();
            let values: Vec<f64> = (0..inner.pattern.n)
                .flat_map(|j| {
                    let n = inner.pattern.column_start[j + 1] - inner.pattern.column_start[j];
                    (0..n).map(move |k| if k == 0 { 5.0 + j as f64 } else { -0.3 - 0.01 * (j + k) as f64 })
                })
                .collect();
            let given: Vec<f64> = (0..inner.pattern.n).map(|j| (j as f64).cos()).collect();
            let mut direct = Direct::default();
            direct.analyse(inner.pattern.clone(), inner.order.clone()).unwrap();
            direct.factorise(&values).unwrap();
            let mut expected = given.clone();
            direct.solve(&mut expected).unwrap();
            let mut direct = Direct::default();
            direct.analyse(outer.pattern.clone(), outer.order.clone()).unwrap();
            direct.factorise(&embedding.values(&values)).unwrap();
            let mut all = embedding.spread(&given);
            direct.solve(&mut all).unwrap();
            let mut found = given.clone();
            embedding.gather(&all, &mut found);
            assert!(
                found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-14),
                "{found:?} {expected:?}"
            );
            for (k, name) in inner.names.iter().enumerate() {
                let place = outer.names.iter().position(|n| n == name).unwrap();
                assert_eq!(embedding.number(place), Some(k));
            }
        }
    }

    #[test]
    fn what_is_missing_or_too_large_does_not_serve() {
        let serves =
            |inner: &Named, outer: &Named| Embedding::new(&inner.names, &inner.pattern, outer).is_some();
        let outer = row(&[3, 4, 5, 6, 7, 8]);
        assert!(!serves(&row(&[3, 4, 5, 6, 7, 9]), &outer), "an unknown");
        assert!(!serves(&row(&[3, 4, 5]), &outer), "half of it");
        let mut coupled = outer.clone();
        coupled.pattern.row.insert(coupled.pattern.column_start[1], 11);
        coupled.pattern.column_start[1..].iter_mut().for_each(|start| *start += 1);
        assert!(coupled.fits::<2>(9));
        assert!(!serves(&coupled, &outer), "an entry");
        assert!(serves(&outer, &coupled));
    }

    #[test]
    fn what_no_grid_has_is_noticed() {
        let good = row(&[3, 4, 5]);
        assert!(good.fits::<2>(6) && !good.fits::<2>(5));
        let damage: [fn(&mut Named); 11] = [
            |named| named.order[0] = 0,
            |named| named.order[0] = 6,
            |named| named.order.truncate(5),
            |named| named.names.swap(0, 1),
            |named| named.names.truncate(5),
            |named| named.pattern.n = 7,
            |named| named.pattern.row[1] = 600,
            |named| named.pattern.row[0] = 1,
            |named| named.pattern.column_start[2] = usize::MAX,
            |named| named.pattern.column_start[1] = 9,
            |named| named.pattern.symmetric = false,
        ];
        for damage in damage {
            let mut named = good.clone();
            damage(&mut named);
            assert!(!named.fits::<2>(6), "{named:?}");
        }
    }
}
