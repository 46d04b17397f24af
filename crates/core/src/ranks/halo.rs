//! The active nodes that several ranks share.

use super::Ranks;

/// The active nodes that this rank shares with others; none if there are no other ranks.
///
/// A nodal field is *partial* as long as it holds the contributions of this rank's points only, and *complete* when all
/// ranks that have a node hold the same value there. [`Halo::add`] completes a partial field.
#[derive(Debug, Clone, Default)]
pub struct Halo {
    ranks: Ranks,
    /// Ranks with which nodes are shared, ascending.
    neighbours: Vec<usize>,
    /// Active nodes shared with each neighbour, in grid order.
    shared: Vec<Vec<u32>>,
    /// Active nodes shared with any rank, ascending.
    border: Vec<u32>,
    /// Active nodes that belong to another rank, each with that rank, ascending.
    foreign: Vec<(u32, u32)>,
    /// For each active node, true if it belongs to this rank; empty without other ranks.
    is_own: Vec<bool>,
}

/// A rank that has a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Sharer {
    /// Rank number.
    pub rank: u32,
    /// True if points of the rank touch the node; false if the rank has the node only because it lies in an adjoining
    /// cell, or because a term needs it.
    pub touches: bool,
}

/// Grid nodes that this rank shares with others, ascending, each with all ranks that have it, ascending and including
/// this one.
pub type Sharing = Vec<(u32, Vec<Sharer>)>;

/// Finds the ranks that share nodes with this one; `nodes` lists the nodes of this rank, ascending, each with a flag:
/// true if points of this rank touch the node. Each node has a home rank: all ranks that have the node report to the
/// home rank, which tells each of them about the others.
pub fn sharing(ranks: &Ranks, nodes: &[(u32, bool)], n_nodes: usize) -> Sharing {
    let Some(communicator) = ranks.communicator() else { return Vec::new() };
    let count = ranks.count();
    let per_home = n_nodes.div_ceil(count).max(1);
    let home_of = |node: u32| node as usize / per_home;
    let mut messages: Vec<(usize, Vec<u8>)> = Vec::new();
    for same_home in nodes.chunk_by(|a, b| home_of(a.0) == home_of(b.0)) {
        let numbers = same_home.iter().flat_map(|&(node, touches)| [node, u32::from(touches)]);
        messages.push((home_of(same_home[0].0), words(numbers)));
    }
    let mut having: Vec<(u32, Sharer)> = Vec::new();
    for (rank, message) in communicator.exchange(messages) {
        let mut numbers = numbers(&message);
        while let (Some(node), Some(touches)) = (numbers.next(), numbers.next()) {
            having.push((node, Sharer { rank: rank as u32, touches: touches == 1 }));
        }
    }
    having.sort_unstable();
    let mut answers = vec![Vec::new(); count];
    for sharers in having.chunk_by(|a, b| a.0 == b.0).filter(|sharers| sharers.len() > 1) {
        for (_, to) in sharers {
            let answer: &mut Vec<u32> = &mut answers[to.rank as usize];
            answer.extend([sharers[0].0, sharers.len() as u32]);
            answer.extend(sharers.iter().map(|(_, sharer)| sharer.rank << 1 | u32::from(sharer.touches)));
        }
    }
    let answers = answers.into_iter().enumerate().filter(|(_, answer)| !answer.is_empty());
    let messages = answers.map(|(rank, answer)| (rank, words(answer.into_iter()))).collect();
    let mut found = Vec::new();
    for (_, message) in communicator.exchange(messages) {
        let mut numbers = numbers(&message);
        while let (Some(node), Some(n)) = (numbers.next(), numbers.next()) {
            let sharer = |word: u32| Sharer { rank: word >> 1, touches: word & 1 == 1 };
            found.push((node, numbers.by_ref().take(n as usize).map(sharer).collect()));
        }
    }
    // Nodes are ascending, and so are their home ranks.
    found
}

fn words(numbers: impl Iterator<Item = u32>) -> Vec<u8> {
    numbers.flat_map(u32::to_ne_bytes).collect()
}

fn numbers(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.chunks_exact(4).map(|word| u32::from_ne_bytes(word.try_into().unwrap_or_default()))
}

impl From<&Ranks> for Halo {
    /// Without shared nodes.
    fn from(ranks: &Ranks) -> Self {
        Halo { ranks: ranks.clone(), ..Halo::default() }
    }
}

impl Halo {
    /// The halo of these active nodes, given by their grid numbers, ascending; `sharing` lists the nodes that other
    /// ranks also have. A node belongs to the lowest rank whose points touch it or, if there is none, to the lowest
    /// rank that has it.
    pub fn new(ranks: &Ranks, nodes: &[u32], sharing: &Sharing) -> Self {
        if ranks.is_alone() {
            return Halo::default();
        }
        let own = ranks.own() as u32;
        let mut neighbours: Vec<usize> = sharing
            .iter()
            .flat_map(|(_, sharers)| sharers.iter().map(|sharer| sharer.rank as usize))
            .collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        neighbours.retain(|rank| *rank != own as usize);
        let mut shared = vec![Vec::new(); neighbours.len()];
        let (mut border, mut foreign, mut is_own) = (Vec::new(), Vec::new(), vec![true; nodes.len()]);
        for (node, sharers) in sharing {
            let Ok(active) = nodes.binary_search(node) else { continue };
            border.push(active as u32);
            for sharer in sharers.iter().filter(|sharer| sharer.rank != own) {
                if let Ok(k) = neighbours.binary_search(&(sharer.rank as usize)) {
                    shared[k].push(active as u32);
                }
            }
            let owner = sharers
                .iter()
                .find(|sharer| sharer.touches)
                .or(sharers.first())
                .map_or(own, |sharer| sharer.rank);
            if owner != own {
                foreign.push((active as u32, owner));
                is_own[active] = false;
            }
        }
        Halo { ranks: ranks.clone(), neighbours, shared, border, foreign, is_own }
    }

    /// True if other ranks have a node, too.
    pub fn is_shared(&self, node: usize) -> bool {
        self.border.binary_search(&(node as u32)).is_ok()
    }

    /// The ranks of the analysis.
    pub fn ranks(&self) -> &Ranks {
        &self.ranks
    }

    /// True if a node belongs to this rank: reductions over nodes count it here and nowhere else.
    #[inline]
    pub fn is_own(&self, node: usize) -> bool {
        self.is_own.is_empty() || self.is_own[node]
    }

    /// The rank to which a node belongs.
    pub fn owner(&self, node: usize) -> usize {
        match self.foreign.binary_search_by_key(&(node as u32), |(node, _)| *node) {
            Ok(place) => self.foreign[place].1 as usize,
            Err(_) => self.ranks.own(),
        }
    }

    /// The ranks with which this rank shares nodes, ascending, each with the shared active nodes in grid order.
    pub fn neighbours(&self) -> impl Iterator<Item = (usize, &[u32])> {
        self.neighbours.iter().copied().zip(self.shared.iter().map(Vec::as_slice))
    }

    /// Completes a partial field: at shared nodes, sums the values of all ranks in rank order, so that all ranks get
    /// the same bits.
    pub fn add<const N: usize>(&self, values: &mut [[f64; N]]) {
        self.merge(values, |sum, value| *sum += value);
    }

    /// As [`Halo::add`], for one number per node.
    pub fn add_numbers(&self, values: &mut [f64]) {
        self.add(as_arrays(values));
    }

    /// Replaces the values at shared nodes by the largest over all ranks.
    pub fn maximum(&self, values: &mut [f64]) {
        self.merge(as_arrays(values), |most, value| *most = most.max(value));
    }

    /// Replaces the values at shared nodes by the smallest over all ranks.
    pub fn minimum(&self, values: &mut [f64]) {
        self.merge(as_arrays(values), |least, value| *least = least.min(value));
    }

    /// Replaces the values at nodes of other ranks by the values of their owners.
    pub fn copy<const N: usize>(&self, values: &mut [[f64; N]]) {
        for node in 0..self.is_own.len() {
            if !self.is_own[node] {
                values[node] = [0.0; N];
            }
        }
        self.merge(values, |sum, value| {
            if value != 0.0 {
                *sum = value;
            }
        });
    }

    /// Fills in missing values at shared nodes from the ranks that know them.
    pub fn fill<const N: usize>(&self, values: &mut [Option<[f64; N]>]) {
        if self.ranks.is_alone() {
            return;
        }
        let mut numbers: Vec<[f64; N]> = values.iter().map(|value| value.unwrap_or([f64::NAN; N])).collect();
        self.merge(&mut numbers, |known, value| {
            if known.is_nan() {
                *known = value;
            }
        });
        for (value, found) in values.iter_mut().zip(numbers).filter(|(value, _)| value.is_none()) {
            *value = (!found.iter().any(|x| x.is_nan())).then_some(found);
        }
    }

    fn merge<const N: usize>(&self, values: &mut [[f64; N]], with: impl Fn(&mut f64, f64)) {
        let Some(communicator) = self.ranks.communicator() else { return };
        let collect =
            |nodes: &[u32]| -> Vec<f64> { nodes.iter().flat_map(|n| values[*n as usize]).collect() };
        let send: Vec<Vec<f64>> = self.shared.iter().map(|nodes| collect(nodes)).collect();
        let mut receive: Vec<Vec<f64>> = send.iter().map(|numbers| vec![0.0; numbers.len()]).collect();
        communicator.swap(&self.neighbours, &send, &mut receive);
        // The values of this rank take their turn in rank order.
        let own = collect(&self.border);
        let below = self.neighbours.partition_point(|rank| *rank < self.ranks.own());
        let received = |k: usize| (&self.shared[k], &receive[k]);
        let in_order = (0..below).map(received).chain([(&self.border, &own)]);
        let in_order = in_order.chain((below..self.neighbours.len()).map(received));
        let mut is_begun = vec![false; values.len()];
        for (nodes, numbers) in in_order {
            for (node, new) in nodes.iter().zip(numbers.chunks_exact(N)) {
                let sum = &mut values[*node as usize];
                if std::mem::replace(&mut is_begun[*node as usize], true) {
                    sum.iter_mut().zip(new).for_each(|(sum, value)| with(sum, *value));
                } else {
                    sum.copy_from_slice(new);
                }
            }
        }
    }

    /// The scalar product of two complete fields. With a single rank, it is summed number by number.
    pub fn dot<const N: usize>(&self, a: &[[f64; N]], b: &[[f64; N]]) -> f64 {
        if self.ranks.is_alone() {
            return a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum();
        }
        self.sum_over_nodes(a.len(), |node| (0..N).map(|c| a[node][c] * b[node][c]).sum())
    }

    /// The Euclidean norm of a complete field.
    pub fn norm<const N: usize>(&self, field: &[[f64; N]]) -> f64 {
        self.dot(field, field).sqrt()
    }

    /// The sum of a value over all nodes of all ranks, each counted once.
    pub fn sum_over_nodes(&self, n: usize, value: impl Fn(usize) -> f64) -> f64 {
        let own = (0..n).filter(|node| self.is_own(*node)).map(value).sum();
        self.ranks.total(own)
    }
}

/// Numbers as a field with one component.
fn as_arrays(values: &mut [f64]) -> &mut [[f64; 1]] {
    values.as_chunks_mut::<1>().0
}

#[cfg(test)]
mod tests {
    use super::super::threads;
    use super::*;

    /// Three ranks on a line of nodes, with nodes 0-3, 3-5 and 3, 5, 8; rank 0 does not touch node 3.
    #[test]
    fn shared_nodes_are_found_and_completed() {
        let nodes = [vec![0, 1, 2, 3], vec![3, 4, 5], vec![3, 5, 8]];
        threads::run(3, |ranks| {
            let own = ranks.own();
            let touched: Vec<(u32, bool)> =
                nodes[own].iter().map(|node| (*node, own > 0 || *node < 3)).collect();
            let found = sharing(&ranks, &touched, 9);
            let sharer = |rank| Sharer { rank, touches: rank > 0 };
            let at_3 = (3, vec![sharer(0), sharer(1), sharer(2)]);
            let with = [vec![at_3.clone()], vec![at_3, (5, vec![sharer(1), sharer(2)])]];
            assert_eq!(found, with[own.min(1)]);
            let halo = Halo::new(&ranks, &nodes[own], &found);
            let owners: Vec<usize> = (0..nodes[own].len()).map(|node| halo.owner(node)).collect();
            assert_eq!(owners, [vec![0, 0, 0, 1], vec![1, 1, 1], vec![1, 1, 2]][own]);
            assert_eq!(halo.sum_over_nodes(nodes[own].len(), |_| 1.0), 7.0);
            // 1 + 1e16 − 1e16 depends on the order of summation.
            let part = [1.0, 1e16, -1e16][own];
            let mut values: Vec<[f64; 2]> = nodes[own].iter().map(|_| [part, own as f64]).collect();
            halo.add(&mut values);
            let at = |node: u32| nodes[own].binary_search(&node).map(|k| values[k]);
            assert_eq!(at(3), Ok([(1.0 + 1e16) - 1e16, 3.0]));
            assert_eq!(at(5).unwrap_or([0.0, 3.0]), [0.0, 3.0]);
            assert_eq!(at(8).unwrap_or([-1e16, 2.0]), [-1e16, 2.0]);
            let mut values: Vec<[f64; 1]> = nodes[own].iter().map(|_| [own as f64]).collect();
            halo.copy(&mut values);
            let expected: Vec<[f64; 1]> = owners.iter().map(|owner| [*owner as f64]).collect();
            assert_eq!(values, expected);
            let mut values: Vec<f64> = nodes[own].iter().map(|_| own as f64).collect();
            halo.maximum(&mut values);
            assert_eq!(values[nodes[own].binary_search(&3).unwrap()], 2.0);
            halo.minimum(&mut values);
            let mut known: Vec<Option<[f64; 1]>> =
                nodes[own].iter().map(|node| (own == 1).then_some([f64::from(*node)])).collect();
            halo.fill(&mut known);
            let is_known = |node: u32| own == 1 || node == 3 || node == 5;
            let expected: Vec<_> =
                nodes[own].iter().map(|node| is_known(*node).then_some([f64::from(*node)])).collect();
            assert_eq!(known, expected);
        });
    }
}
