//! The processes that share an analysis: ranks, each of which holds the points in its part of the grid.
//!
//! All ranks run the same program on their own points. The reductions here provide the basis of joint decisions: each
//! combines the contributions in rank order and returns the same bits on all ranks, so that all ranks take the same
//! path.

mod halo;
mod reduction;
pub mod threads;

use std::ops::Range;
use std::sync::Arc;

use serde::{Serialize, de::DeserializeOwned};

pub use halo::{Halo, Sharer, Sharing, sharing};
pub use reduction::Reduction;

/// Messages between ranks. The methods that gather or exchange are collective: all ranks must call them, in the same
/// order.
pub trait Communicator: Send + Sync + std::fmt::Debug {
    /// Number of ranks.
    fn count(&self) -> usize;

    /// The number of this rank, from 0.
    fn own(&self) -> usize;

    /// The bytes that every rank supplies, in the order of the ranks.
    fn gather_all(&self, own: &[u8]) -> Vec<Vec<u8>>;

    /// On rank 0, the bytes that every rank supplies, in the order of the ranks; nothing on the other ranks.
    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>>;

    /// Sends messages to some ranks, at most one to each; returns the messages for this rank, each with the rank that
    /// sent it, in ascending order of these ranks.
    fn exchange(&self, messages: Vec<(usize, Vec<u8>)>) -> Vec<(usize, Vec<u8>)>;

    /// Swaps numbers with other ranks, listed in `with` in ascending order: `send[k]` goes to rank `with[k]`, whose own
    /// numbers fill `receive[k]`. Both sides must call this, and agree on the lengths, which may be 0.
    fn swap(&self, with: &[usize], send: &[Vec<f64>], receive: &mut [Vec<f64>]);
}

/// The ranks of an analysis; by default this process alone.
#[derive(Debug, Clone, Default)]
pub struct Ranks(Option<Arc<dyn Communicator>>);

impl Ranks {
    /// The ranks that a communicator connects.
    pub fn new(communicator: Arc<dyn Communicator>) -> Self {
        Ranks((communicator.count() > 1).then_some(communicator))
    }

    /// True if there is only one rank.
    #[inline]
    pub fn is_alone(&self) -> bool {
        self.0.is_none()
    }

    /// Number of ranks.
    pub fn count(&self) -> usize {
        self.0.as_ref().map_or(1, |ranks| ranks.count())
    }

    /// The number of this rank.
    pub fn own(&self) -> usize {
        self.0.as_ref().map_or(0, |ranks| ranks.own())
    }

    /// This rank's share of work that consists of `n` consecutive items; the shares of the ranks follow one another.
    pub fn share(&self, n: usize) -> Range<usize> {
        let (own, count) = (self.own(), self.count());
        let end = |rank: usize| (n as u128 * rank as u128 / count as u128) as usize;
        end(own)..end(own + 1)
    }

    /// Number of ranks on the same machine as this rank; all ranks if the system does not tell machines apart.
    pub fn on_this_machine(&self) -> usize {
        self.total_on_this_machine(1) as usize
    }

    /// The sum of `amount` over the ranks on the same machine as this rank.
    pub fn total_on_this_machine(&self, amount: u64) -> u64 {
        let machine = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        let all = self.gather_all((machine.clone(), amount));
        all.iter().filter(|(other, _)| *other == machine).map(|(_, amount)| amount).sum()
    }

    /// True on rank 0, which writes tables, lists and the summary.
    pub fn is_root(&self) -> bool {
        self.own() == 0
    }

    /// The communicator, if there are several ranks.
    pub fn communicator(&self) -> Option<&dyn Communicator> {
        self.0.as_deref()
    }

    /// The values of all ranks, in rank order.
    pub fn gather_all<T: Serialize + DeserializeOwned>(&self, own: T) -> Vec<T> {
        match &self.0 {
            None => vec![own],
            Some(ranks) => ranks.gather_all(&encode(&own)).iter().filter_map(|bytes| decode(bytes)).collect(),
        }
    }

    /// The items of all ranks, those of each rank in their order, in rank order.
    pub fn join<T: Serialize + DeserializeOwned>(&self, own: Vec<T>) -> Vec<T> {
        if self.is_alone() { own } else { self.gather_all(own).into_iter().flatten().collect() }
    }

    /// The values of all ranks on rank 0, in rank order; none on the other ranks.
    pub fn gather<T: Serialize + DeserializeOwned>(&self, own: T) -> Vec<T> {
        match &self.0 {
            None => vec![own],
            Some(ranks) => ranks.gather(&encode(&own)).iter().filter_map(|bytes| decode(bytes)).collect(),
        }
    }

    /// Sends values to some ranks, at most one to each; returns the values for this rank, each with the rank that sent
    /// it, in ascending order of these ranks.
    pub fn exchange<T: Serialize + DeserializeOwned>(&self, messages: Vec<(usize, T)>) -> Vec<(usize, T)> {
        let Some(ranks) = &self.0 else { return messages };
        let messages = messages.iter().map(|(rank, value)| (*rank, encode(value))).collect();
        let answers = ranks.exchange(messages).into_iter();
        answers.filter_map(|(rank, bytes)| Some((rank, decode(&bytes)?))).collect()
    }

    /// The value of the first rank that has one.
    pub fn first<T: Serialize + DeserializeOwned>(&self, own: Option<T>) -> Option<T> {
        if self.is_alone() { own } else { self.gather_all(own).into_iter().flatten().next() }
    }

    /// Combines corresponding numbers of all ranks, in rank order.
    fn combine(&self, values: &mut [f64], with: impl Fn(f64, f64) -> f64) {
        let Some(ranks) = &self.0 else { return };
        let own: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
        let all = ranks.gather_all(&own);
        for (rank, bytes) in all.iter().enumerate() {
            for (value, number) in values.iter_mut().zip(bytes.chunks_exact(size_of::<f64>())) {
                let number = f64::from_ne_bytes(number.try_into().unwrap_or_default());
                *value = if rank == 0 { number } else { with(*value, number) };
            }
        }
    }

    /// Replaces each number by its sum over all ranks.
    pub fn sum(&self, values: &mut [f64]) {
        self.combine(values, |a, b| a + b);
    }

    /// The sum of `value` over all ranks.
    pub fn total(&self, value: f64) -> f64 {
        let mut values = [value];
        self.sum(&mut values);
        values[0]
    }

    /// The sum of `count` over all ranks.
    pub fn count_all(&self, count: usize) -> usize {
        self.total(count as f64) as usize
    }

    /// Replaces each number by its maximum over all ranks; NaN if it is NaN on any rank.
    pub fn maximum(&self, values: &mut [f64]) {
        self.combine(values, |a, b| if a >= b || a.is_nan() { a } else { b });
    }

    /// The maximum of `value` over all ranks; NaN if it is NaN on any rank.
    pub fn largest(&self, value: f64) -> f64 {
        let mut values = [value];
        self.maximum(&mut values);
        values[0]
    }

    /// The minimum of `value` over all ranks; NaN if it is NaN on any rank.
    pub fn smallest(&self, value: f64) -> f64 {
        -self.largest(-value)
    }

    /// True if any rank passes true.
    pub fn any(&self, is: bool) -> bool {
        if self.is_alone() { is } else { self.largest(f64::from(u8::from(is))) > 0.0 }
    }

    /// True if all ranks pass true.
    pub fn all(&self, is: bool) -> bool {
        !self.any(!is)
    }
}

fn encode<T: Serialize>(value: &T) -> Vec<u8> {
    postcard::to_stdvec(value).unwrap_or_default()
}

fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    postcard::from_bytes(bytes).ok()
}
