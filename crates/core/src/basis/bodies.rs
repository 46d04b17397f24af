//! The bodies that touch each active node.

use std::collections::BTreeSet;

use super::Connectivity;
use crate::points::Points;
use crate::ranks::Reduction;

/// Values of basis functions below this are round-off from domains that end at the node, and do not join points, [-].
pub(crate) const MIN_SHARE: f64 = 1e-6;

/// The bodies whose points touch a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TouchedBy {
    /// No body of this rank: only points of other ranks touch the node.
    None,
    /// Only the body with this index.
    One(u16),
    /// Several bodies, which share the node.
    Several,
}

impl TouchedBy {
    /// The result after one more body touches the node.
    fn and(self, body: u16) -> TouchedBy {
        match self {
            TouchedBy::None => TouchedBy::One(body),
            TouchedBy::One(other) if other == body => self,
            _ => TouchedBy::Several,
        }
    }
}

impl<const D: usize> Connectivity<D> {
    /// The bodies that touch each active node, on any rank. All ranks must call this together.
    pub fn bodies_at_nodes(&self, points: &Points<D>) -> Vec<TouchedBy> {
        let mut touched = vec![TouchedBy::None; self.n_active()];
        for group in 0..self.n_groups() {
            let nodes = self.nodes_of(group);
            // Points of a cell usually touch the same nodes.
            let mut last: Option<(u16, &[u32])> = None;
            for p in self.points_of(group) {
                let (body, local) = (points.body[p], self.local_nodes(p));
                if last == Some((body, local)) {
                    continue;
                }
                last = Some((body, local));
                for &place in local {
                    let node = &mut touched[nodes[place as usize] as usize];
                    *node = node.and(body);
                }
            }
        }
        join(self.reduction(), &mut touched);
        touched
    }

    /// The pairs of bodies, the lower number first, that share an active node and thus move with one displacement field
    /// there. All ranks must call this together; all get the same pairs.
    pub fn joined_bodies(&self, points: &Points<D>) -> BTreeSet<[u16; 2]> {
        let is_shared: Vec<bool> =
            self.bodies_at_nodes(points).into_iter().map(|bodies| bodies == TouchedBy::Several).collect();
        let mut at_nodes: BTreeSet<(u32, u16)> = BTreeSet::new();
        for group in 0..self.n_groups() {
            let nodes = self.nodes_of(group);
            if !nodes.iter().any(|&node| is_shared[node as usize]) {
                continue;
            }
            for p in self.points_of(group) {
                self.for_each_value(p, |place, value| {
                    let node = nodes[place] as usize;
                    if is_shared[node] && value > MIN_SHARE {
                        at_nodes.insert((self.active_nodes()[node], points.body[p]));
                    }
                });
            }
        }
        let mut at_nodes: Vec<(u32, u16)> = self.reduction().join(at_nodes.into_iter().collect());
        at_nodes.sort_unstable();
        at_nodes.dedup();
        let mut pairs = BTreeSet::new();
        for at_node in at_nodes.chunk_by(|(a, _), (b, _)| a == b) {
            for (place, (_, a)) in at_node.iter().enumerate() {
                pairs.extend(at_node[place + 1..].iter().map(|(_, b)| [*a, *b]));
            }
        }
        pairs
    }
}

/// Adds the bodies of other ranks at shared nodes.
fn join(reduction: &Reduction, touched: &mut [TouchedBy]) {
    // The lowest and the highest body at each node; if they differ, several bodies touch it.
    let numbers = |none: f64, several: f64| -> Vec<f64> {
        let number = |touched: &TouchedBy| match touched {
            TouchedBy::None => none,
            TouchedBy::One(body) => f64::from(*body),
            TouchedBy::Several => several,
        };
        touched.iter().map(number).collect()
    };
    let mut least = numbers(f64::INFINITY, -1.0);
    let mut most = numbers(f64::NEG_INFINITY, f64::from(u32::MAX));
    reduction.smallest_at_nodes(&mut least);
    reduction.largest_at_nodes(&mut most);
    for (touched, (least, most)) in touched.iter_mut().zip(least.into_iter().zip(most)) {
        *touched = if least < most {
            TouchedBy::Several
        } else if least == most {
            TouchedBy::One(least as u16)
        } else {
            TouchedBy::None
        };
    }
}
