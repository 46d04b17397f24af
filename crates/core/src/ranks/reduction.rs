//! Sums, extremes, products and decisions over a whole run.

use super::{Halo, Ranks};

/// Sums, extremes, scalar products and decisions over all points and nodes of a run, whether one rank or several ranks
/// share them.
///
/// Code that computes forms them here and looks the same for any number of ranks. Each rank supplies the contributions
/// of its own points and nodes; all ranks must call the same methods in the same order, and get the same bits. The
/// methods of [`Ranks`] that combine values, such as [`Ranks::total`] and [`Ranks::any`], are available as well.
#[derive(Debug, Clone, Default)]
pub struct Reduction(Halo);

impl Reduction {
    /// Reductions over nodes that are shared in this way.
    pub fn new(halo: Halo) -> Self {
        Reduction(halo)
    }

    /// The nodes that ranks share.
    pub fn halo(&self) -> &Halo {
        &self.0
    }

    /// True if sums over nodes count a node on this rank; exactly one rank counts each node.
    #[inline]
    pub fn counts(&self, node: usize) -> bool {
        self.0.is_own(node)
    }

    /// True if sums of the equations of global unknowns count what is added on this rank, for example a load that all
    /// ranks know; exactly one rank counts it.
    pub fn counts_globals(&self) -> bool {
        self.is_root()
    }

    /// Completes a nodal field: adds the contributions of all points to those of the points of this rank.
    pub fn complete<const N: usize>(&self, field: &mut [[f64; N]]) {
        self.0.add(field);
    }

    /// As [`Reduction::complete`], for one number per node.
    pub fn complete_numbers(&self, numbers: &mut [f64]) {
        self.0.add_numbers(numbers);
    }

    /// Replaces the number at each node by the largest one that any rank has for the node.
    pub fn largest_at_nodes(&self, numbers: &mut [f64]) {
        self.0.maximum(numbers);
    }

    /// Replaces the number at each node by the smallest one that any rank has for the node.
    pub fn smallest_at_nodes(&self, numbers: &mut [f64]) {
        self.0.minimum(numbers);
    }

    /// Fills in the values at nodes that are missing here but known elsewhere.
    pub fn fill<const N: usize>(&self, field: &mut [Option<[f64; N]>]) {
        self.0.fill(field);
    }

    /// The sum of a value over all of `n` nodes, each counted once.
    pub fn sum_over_nodes(&self, n: usize, value: impl Fn(usize) -> f64) -> f64 {
        self.0.sum_over_nodes(n, value)
    }

    /// The scalar product of two complete fields.
    pub fn dot<const N: usize>(&self, a: &[[f64; N]], b: &[[f64; N]]) -> f64 {
        self.0.dot(a, b)
    }

    /// The Euclidean norm of a complete field.
    pub fn norm<const N: usize>(&self, field: &[[f64; N]]) -> f64 {
        self.0.norm(field)
    }
}

impl std::ops::Deref for Reduction {
    type Target = Ranks;

    fn deref(&self) -> &Ranks {
        self.0.ranks()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{sharing, threads};
    use super::*;

    /// A line of nine nodes whose eight cells are divided between ranks: the same code finds the same sums, extremes
    /// and products on one rank and on several.
    #[test]
    fn reductions_look_the_same_on_any_number_of_ranks() {
        for (count, most) in [(1, 8.0), (2, 9.0), (4, 13.0)] {
            threads::run(count, |ranks| {
                let cells = ranks.share(8);
                let nodes: Vec<u32> = (cells.start as u32..=cells.end as u32).collect();
                let touched: Vec<(u32, bool)> = nodes.iter().map(|node| (*node, true)).collect();
                let reduction = Reduction::new(Halo::new(&ranks, &nodes, &sharing(&ranks, &touched, 9)));
                // Each cell adds its number, from 1, to its two nodes.
                let mut field = vec![[0.0; 2]; nodes.len()];
                for (place, cell) in cells.enumerate() {
                    for node in [place, place + 1] {
                        field[node] = field[node].map(|x| x + 1.0 + cell as f64);
                    }
                }
                reduction.complete(&mut field);
                let exact = |node: u32| {
                    if node == 0 || node == 8 { f64::from(node.max(1)) } else { f64::from(2 * node + 1) }
                };
                assert!(nodes.iter().zip(&field).all(|(node, value)| *value == [exact(*node); 2]));
                let counted = (0..nodes.len()).filter(|node| reduction.counts(*node)).count();
                assert_eq!(reduction.count_all(counted), 9);
                assert_eq!(reduction.sum_over_nodes(nodes.len(), |node| field[node][0]), 72.0);
                let squares: f64 = (0..9).map(|node| exact(node).powi(2)).sum();
                assert_eq!(reduction.dot(&field, &field), 2.0 * squares);
                assert_eq!(reduction.norm(&field), (2.0 * squares).sqrt());
                let last = field.last().map_or(0.0, |value| value[0]);
                assert_eq!((reduction.largest(last), reduction.any(last == 8.0)), (most, true));
                let mut known: Vec<Option<[f64; 1]>> = (nodes.iter().zip(0..))
                    .map(|(node, place)| reduction.counts(place).then_some([f64::from(*node)]))
                    .collect();
                reduction.fill(&mut known);
                assert!(nodes.iter().zip(&known).all(|(node, value)| *value == Some([f64::from(*node)])));
                let everywhere = reduction.join(vec![nodes.len() as u32 - 1]);
                assert_eq!(everywhere.iter().sum::<u32>(), 8);
            });
        }
    }
}
