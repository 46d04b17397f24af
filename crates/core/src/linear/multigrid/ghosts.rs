//! The nodes of a level that several ranks know: each node belongs to one rank; other ranks keep copies of the node,
//! its ghosts.

use rustc_hash::FxHashMap;

use crate::ranks::Ranks;

/// The nodes of a level that this rank knows: first its own nodes, then ghosts.
#[derive(Debug, Clone, Default)]
pub(super) struct Known {
    /// Number of nodes of this rank.
    pub own: usize,
    /// The position number of each node, which is the same on all ranks.
    pub key: Vec<u64>,
    /// The rank to which each node belongs.
    pub owner: Vec<u32>,
}

/// The known nodes while their level is laid out, with an index that finds them by their position numbers.
pub(super) struct Register {
    pub known: Known,
    pub find: FxHashMap<u64, u32>,
}

impl Register {
    /// The known nodes, given with their ranks and reordered so that the nodes of this rank come first; both kinds keep
    /// their order.
    pub(super) fn new(rank: usize, nodes: &[(u64, u32)]) -> Self {
        let is_own = |node: &&(u64, u32)| node.1 as usize == rank;
        let own = nodes.iter().filter(is_own).count();
        let in_order = || nodes.iter().filter(is_own).chain(nodes.iter().filter(|node| !is_own(node)));
        let known = Known {
            own,
            key: in_order().map(|(key, _)| *key).collect(),
            owner: in_order().map(|(_, owner)| *owner).collect(),
        };
        let find = known.key.iter().copied().zip(0..).collect();
        Register { known, find }
    }

    /// The node of this rank at this position; `None` if there is none.
    pub(super) fn own(&self, key: u64) -> Option<u32> {
        self.find.get(&key).copied().filter(|node| (*node as usize) < self.known.own)
    }

    /// The node at this position; it becomes a ghost if it was not known.
    pub(super) fn find_or_add(&mut self, key: u64, owner: u32) -> u32 {
        let Register { known, find } = self;
        *find.entry(key).or_insert_with(|| {
            known.key.push(key);
            known.owner.push(owner);
            known.key.len() as u32 - 1
        })
    }
}

impl Known {
    pub(super) fn len(&self) -> usize {
        self.key.len()
    }

    /// The ranks to which ghosts belong, ascending, each with its ghosts for which `has` is true, in the order of their
    /// positions.
    pub(super) fn by_owner(&self, has: impl Fn(usize) -> bool) -> Vec<(usize, Vec<u32>)> {
        let mut ghosts: Vec<usize> = (self.own..self.len()).filter(|node| has(*node)).collect();
        ghosts.sort_unstable_by_key(|&node| (self.owner[node], self.key[node]));
        let by_owner = ghosts.chunk_by(|a, b| self.owner[*a] == self.owner[*b]);
        by_owner
            .map(|nodes| (self.owner[nodes[0]] as usize, nodes.iter().map(|node| *node as u32).collect()))
            .collect()
    }
}

/// The nodes whose values are exchanged between ranks.
#[derive(Debug, Clone, Default)]
pub(super) struct Messages {
    /// The other ranks, ascending.
    pub with: Vec<usize>,
    /// Nodes whose values are sent to each of these ranks.
    pub send: Vec<Vec<u32>>,
    /// Nodes whose values are received from each of these ranks.
    pub receive: Vec<Vec<u32>>,
}

impl Messages {
    /// Messages to and from other ranks, both in ascending order of ranks; ranks with which nothing is exchanged do not
    /// appear.
    pub(super) fn new(send: Vec<(usize, Vec<u32>)>, receive: Vec<(usize, Vec<u32>)>) -> Self {
        let mut with: Vec<usize> = send.iter().chain(&receive).map(|(rank, _)| *rank).collect();
        with.sort_unstable();
        with.dedup();
        let in_order = |lists: Vec<(usize, Vec<u32>)>| {
            let mut all = vec![Vec::new(); with.len()];
            for (rank, nodes) in lists {
                if let Ok(k) = with.binary_search(&rank) {
                    all[k] = nodes;
                }
            }
            all
        };
        Messages { send: in_order(send), receive: in_order(receive), with }
    }

    /// Sends the values of nodes, and calls `take(value, received)` for the values received, in rank order.
    fn pass<const N: usize>(
        &self,
        ranks: &Ranks,
        values: &mut [[f64; N]],
        take: impl Fn(&mut [f64; N], &[f64]),
    ) {
        let Some(communicator) = ranks.communicator() else { return };
        let send: Vec<Vec<f64>> =
            self.send.iter().map(|nodes| nodes.iter().flat_map(|n| values[*n as usize]).collect()).collect();
        let mut receive: Vec<Vec<f64>> =
            self.receive.iter().map(|nodes| vec![0.0; N * nodes.len()]).collect();
        communicator.swap(&self.with, &send, &mut receive);
        for (nodes, numbers) in self.receive.iter().zip(&receive) {
            for (node, new) in nodes.iter().zip(numbers.chunks_exact(N)) {
                take(&mut values[*node as usize], new);
            }
        }
    }

    /// Sends the values of own nodes and overwrites those of the ghosts with the received ones.
    fn copy<const N: usize>(&self, ranks: &Ranks, values: &mut [[f64; N]]) {
        self.pass(ranks, values, |value, new| value.copy_from_slice(new));
    }

    /// Adds the values received, in rank order.
    pub(super) fn add<const N: usize>(&self, ranks: &Ranks, values: &mut [[f64; N]]) {
        self.pass(ranks, values, |value, new| value.iter_mut().zip(new).for_each(|(sum, new)| *sum += new));
    }
}

/// Renews the values at the ghosts of a level.
#[derive(Debug, Clone)]
pub(super) struct Ghosts {
    pub ranks: Ranks,
    all: Messages,
    colours: Vec<Messages>,
}

impl Ghosts {
    /// The ghosts among the known nodes; `colour` gives the colour of a node, one of `n_colours`.
    pub(super) fn new(
        ranks: &Ranks,
        Register { known, find }: &Register,
        n_colours: usize,
        colour: impl Fn(usize) -> usize,
    ) -> Self {
        let receive = known.by_owner(|_| true);
        let keys = |nodes: &[u32]| -> Vec<u64> { nodes.iter().map(|n| known.key[*n as usize]).collect() };
        let asked = ranks.exchange(receive.iter().map(|(rank, nodes)| (*rank, keys(nodes))).collect());
        let nodes = |keys: Vec<u64>| keys.iter().filter_map(|key| find.get(key).copied()).collect();
        let send = asked.into_iter().map(|(rank, keys)| (rank, nodes(keys))).collect();
        let all = Messages::new(send, receive);
        let mut colours = vec![[Vec::new(), Vec::new()]; n_colours];
        for (side, lists) in [&all.send, &all.receive].into_iter().enumerate() {
            for (rank, nodes) in all.with.iter().zip(lists) {
                let mut by_colour = vec![Vec::new(); n_colours];
                nodes.iter().for_each(|node| by_colour[colour(*node as usize)].push(*node));
                let some = by_colour.into_iter().enumerate().filter(|(_, nodes)| !nodes.is_empty());
                some.for_each(|(colour, nodes)| colours[colour][side].push((*rank, nodes)));
            }
        }
        let colours = colours.into_iter().map(|[send, receive]| Messages::new(send, receive)).collect();
        Ghosts { ranks: ranks.clone(), all, colours }
    }

    /// Renews the values at all ghosts.
    pub(super) fn renew<const N: usize>(&self, values: &mut [[f64; N]]) {
        self.all.copy(&self.ranks, values);
    }

    /// Renews the values at the ghosts of one colour.
    pub(super) fn renew_colour<const N: usize>(&self, colour: usize, values: &mut [[f64; N]]) {
        self.colours[colour].copy(&self.ranks, values);
    }
}
