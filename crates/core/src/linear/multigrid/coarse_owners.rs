//! The rank to which each node of a coarser level belongs.

use rustc_hash::FxHashMap;

use crate::ranks::Ranks;

/// The possible relations of a rank to a coarse node, from the weakest to the strongest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Claim {
    /// The rank has a ghost that is interpolated from the coarse node.
    Ghost,
    /// The rank has a node of its own that is interpolated from the coarse node.
    Child,
    /// The fine node at the same position belongs to the rank.
    Same,
}

/// The rank to which each coarse node belongs, given the position numbers of the nodes, ascending, and the claims of
/// this rank. A node belongs to the rank of the fine node at its position or, if there is no such fine node, to the
/// lowest rank that has one of its children. Each node has a home rank; all ranks that know the node query this rank.
pub(super) fn coarse_owners(ranks: &Ranks, claims: &[(u64, Claim)], places: u64) -> Vec<u32> {
    let per_home = places.div_ceil(ranks.count() as u64).max(1);
    let home = |key: u64| (key / per_home) as usize;
    // Each number has its claim appended as the last digit in base 3.
    let named = |&(key, claim): &(u64, Claim)| 3 * key + claim as u64;
    let by_home = claims.chunk_by(|a, b| home(a.0) == home(b.0));
    let messages = by_home.map(|claims| (home(claims[0].0), claims.iter().map(named).collect()));
    let asked: Vec<(usize, Vec<u64>)> = ranks.exchange(messages.collect());
    // The strongest claim on each node, and its rank.
    let mut owner: FxHashMap<u64, (u64, u32)> = FxHashMap::default();
    for (rank, nodes) in &asked {
        for node in nodes {
            let (key, claim) = (node / 3, node % 3);
            let best = owner.entry(key).or_insert((claim, *rank as u32));
            // Claims arrive in ascending order of ranks.
            if claim > best.0 {
                *best = (claim, *rank as u32);
            }
        }
    }
    let owner_of = |node: &u64| owner.get(&(node / 3)).map_or(0, |(_, rank)| *rank);
    let answers: Vec<(usize, Vec<u32>)> =
        asked.iter().map(|(rank, nodes)| (*rank, nodes.iter().map(owner_of).collect())).collect();
    // Home ranks are in the same order as the nodes.
    ranks.exchange(answers).into_iter().flat_map(|(_, owners)| owners).collect()
}
