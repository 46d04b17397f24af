//! What the ranks of a run determine together to judge its quality: connected parts, overlapping domains, warnings.

use crate::basis::Connectivity;
use crate::ranks::Ranks;

use super::cohesion::{Parts, find, unite};
use super::overlap::Domain;
use super::warning::Warning;

impl Parts {
    /// The parts joined across all ranks: clusters of one body that share a node are in the same part even if they are
    /// on different ranks. The root of a part is then a number among the clusters of all ranks.
    pub(super) fn joined<const D: usize>(mut self, links: &Connectivity<D>) -> Parts {
        let ranks = links.halo().ranks();
        if ranks.is_alone() {
            return self;
        }
        let counts = ranks.gather_all(self.clusters.len() as u32);
        let first: u32 = counts[..ranks.own()].iter().sum();
        // For each shared node and each body at that node, the roots of the clusters of the body.
        let mut at: Vec<(u32, u16, u32)> = Vec::new();
        for (number, cluster) in self.clusters.iter().enumerate() {
            for &node in &cluster.shared {
                at.push((links.active_nodes()[node as usize], cluster.body, first + self.root[number]));
            }
        }
        at.sort_unstable();
        at.dedup();
        let mut root: Vec<u32> = (0..counts.iter().sum()).collect();
        for (number, local) in self.root.iter().enumerate() {
            root[(first as usize) + number] = first + local;
        }
        let mut all = ranks.join(at);
        all.sort_unstable();
        for pair in all.windows(2).filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1)) {
            unite(&mut root, pair[0].2, pair[1].2);
        }
        let mut together: Vec<u32> = (0..self.together.len() as u32).collect();
        for pair in all.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            unite(&mut together, u32::from(pair[0].1), u32::from(pair[1].1));
        }
        for representatives in
            ranks.gather_all(self.together.iter().map(|body| *body as u32).collect::<Vec<_>>())
        {
            for (body, other) in (0u32..).zip(representatives) {
                unite(&mut together, body, other);
            }
        }
        for number in 0..self.root.len() {
            self.root[number] = find(&mut root, first + number as u32);
        }
        self.together = (0..together.len() as u32).map(|body| find(&mut together, body) as usize).collect();
        self
    }
}

impl<const D: usize> Domain<D> {
    /// The domains of lower ranks that may meet those of this rank.
    #[inline(never)]
    pub(super) fn from_lower_ranks(ranks: &Ranks, own: &[Self]) -> Vec<Self> {
        if ranks.is_alone() {
            return Vec::new();
        }
        let hull = own.iter().fold([[f64::INFINITY; D], [f64::NEG_INFINITY; D]], |[low, high], domain| {
            [
                std::array::from_fn(|d| low[d].min(domain.low[d])),
                std::array::from_fn(|d| high[d].max(domain.high[d])),
            ]
        });
        let hulls = ranks.gather_all(hull.as_flattened().to_vec());
        let mut messages = Vec::new();
        for (rank, hull) in hulls.iter().enumerate().skip(ranks.own() + 1) {
            let meets =
                |domain: &&Domain<D>| (0..D).all(|d| domain.low[d] < hull[D + d] && hull[d] < domain.high[d]);
            let message: Vec<Vec<f64>> = own.iter().filter(meets).map(Domain::numbers).collect();
            if !message.is_empty() {
                messages.push((rank, message));
            }
        }
        let received = ranks.exchange(messages).into_iter().flat_map(|(_, domains)| domains);
        received.filter_map(|numbers| Domain::from_numbers(&numbers)).collect()
    }

    /// The domain as numbers, for other ranks: the ends of the bounding box, and the corners of the halves if it has
    /// any.
    fn numbers(&self) -> Vec<f64> {
        let halves = self.halves.iter().flatten().flatten().flatten();
        self.low.iter().chain(&self.high).chain(halves).copied().collect()
    }

    fn from_numbers(numbers: &[f64]) -> Option<Self> {
        let (low, rest) = numbers.split_first_chunk()?;
        let (high, rest) = rest.split_first_chunk()?;
        let halves = (!rest.is_empty()).then(|| {
            std::array::from_fn(|h| std::array::from_fn(|k| std::array::from_fn(|d| rest[6 * h + 2 * k + d])))
        });
        Some(Domain { low: *low, high: *high, halves })
    }
}

fn read(text: &str) -> Option<Vec<(usize, Warning)>> {
    serde_json::from_str(text).ok()
}

/// The warnings raised on any rank, each once.
pub(super) fn all_warnings(ranks: &Ranks, own: Vec<(usize, Warning)>) -> Vec<(usize, Warning)> {
    if !ranks.any(!own.is_empty()) || ranks.is_alone() {
        return own;
    }
    // Warnings omit the fields that they lack, so that only a format with field names can read them back.
    let texts = ranks.gather_all(serde_json::to_string(&own).unwrap_or_default());
    let mut all: Vec<(usize, Warning)> = Vec::new();
    for (number, warning) in texts.iter().filter_map(|text| read(text)).flatten() {
        if !all.iter().any(|(other, known)| (*other, known.code) == (number, warning.code)) {
            all.push((number, warning));
        }
    }
    all
}
