//! Contact on several ranks: their agreement on what each of them finds, sums and values at nodes that they share, and
//! values as plain numbers to exchange.

use std::hash::Hash;

use rustc_hash::FxHashMap;

use crate::ranks::Reduction;
use crate::terms::EvaluateError;
use crate::terms::failure::ContactError;
use crate::tool::Closest;

use super::interface::{Mode, Multiplier};
use super::key::Key;
use super::outer::Outer;

/// A value that can be written as a few numbers. Whole numbers must be below 2⁵³.
pub(super) trait Plain: Sized {
    /// Appends the numbers that represent the value.
    fn encode(&self, numbers: &mut Vec<f64>);

    /// The value that the next numbers represent; `None` if there are none left.
    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self>;
}

/// The values of all ranks, in the order of the ranks.
pub(super) fn gathered<T: Plain>(reduction: &Reduction, own: Vec<T>) -> Vec<T> {
    if reduction.is_alone() {
        return own;
    }
    reduction.gather_all(in_numbers(&own)).into_iter().flat_map(from_numbers).collect()
}

/// Adds what other ranks know of those of the keys `wanted` that this rank does not know.
pub(super) fn complete<K, V>(
    reduction: &Reduction,
    known: &mut FxHashMap<K, V>,
    wanted: impl IntoIterator<Item = K>,
) where
    K: Plain + Copy + Ord + Hash,
    V: Plain + Copy,
{
    if reduction.is_alone() {
        return;
    }
    let mut wanted: Vec<K> = wanted.into_iter().filter(|key| !known.contains_key(key)).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let wanted = gathered(reduction, wanted).into_iter();
    let own: Vec<(K, V)> = wanted.filter_map(|key| Some((key, *known.get(&key)?))).collect();
    known.extend(gathered(reduction, own));
}

/// The index of an active node among those that this rank shares with another rank; the same on both.
pub(super) fn place_of(shared: &[u32], node: usize) -> Option<usize> {
    shared.binary_search(&(node as u32)).ok()
}

/// Sends each rank with which this rank shares nodes the values that `select` returns for these nodes, given in
/// ascending order; returns the values from other ranks, each list with the nodes shared with its rank, in the order of
/// the ranks.
pub(super) fn exchange_at_nodes<T: Plain>(
    reduction: &Reduction,
    select: impl Fn(&[u32]) -> Vec<T>,
) -> Vec<(&[u32], Vec<T>)> {
    let halo = reduction.halo();
    let selected = halo.neighbours().map(|(rank, shared)| (rank, select(shared)));
    let sent = selected.filter(|(_, values)| !values.is_empty());
    let messages = sent.map(|(rank, values)| (rank, in_numbers(&values))).collect();
    let shared_with = |rank: usize| halo.neighbours().find(|(neighbour, _)| *neighbour == rank);
    let received = halo.ranks().exchange(messages).into_iter();
    received
        .filter_map(|(rank, numbers)| Some((shared_with(rank)?.1, from_numbers(numbers).collect())))
        .collect()
}

/// Adds the contributions of other ranks to the sums of this rank at nodes. `nodes` lists the tool, or the group of
/// contact points, and the active node of each sum, and `place` returns the index of the sum that belongs to these, if
/// this rank has it.
pub(super) fn add_at_nodes<const D: usize>(
    reduction: &Reduction,
    sums: &mut [NodalSum<D>],
    nodes: &[(u32, usize)],
    place: impl Fn(u32, usize) -> Option<usize>,
) {
    let select = |shared: &[u32]| -> Vec<((u32, usize), NodalSum<D>)> {
        let all = nodes.iter().zip(&*sums);
        all.filter_map(|((tool, node), sum)| Some(((*tool, place_of(shared, *node)?), *sum))).collect()
    };
    for (shared, contributions) in exchange_at_nodes(reduction, select) {
        for ((tool, k), added) in contributions {
            let node = shared.get(k).map(|node| *node as usize);
            if let Some(place) = node.and_then(|node| place(tool, node)) {
                let NodalSum { vector, weight } = &mut sums[place];
                (0..D).for_each(|d| vector[d] += added.vector[d]);
                *weight += added.weight;
            }
        }
    }
}

/// A sum of vectors and a sum of weights over contact points around a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NodalSum<const D: usize> {
    pub(super) vector: [f64; D],
    pub(super) weight: f64,
}

impl<const D: usize> NodalSum<D> {
    /// The sum over no contact points.
    pub(super) const NONE: NodalSum<D> = NodalSum { vector: [0.0; D], weight: 0.0 };
}

fn in_numbers<T: Plain>(values: &[T]) -> Vec<f64> {
    let mut numbers = Vec::new();
    values.iter().for_each(|value| value.encode(&mut numbers));
    numbers
}

fn from_numbers<T: Plain>(numbers: Vec<f64>) -> impl Iterator<Item = T> {
    let mut numbers = numbers.into_iter();
    std::iter::from_fn(move || T::decode(&mut numbers))
}

impl Plain for f64 {
    fn encode(&self, numbers: &mut Vec<f64>) {
        numbers.push(*self);
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        numbers.next()
    }
}

/// A type represented by one number.
macro_rules! plain_number {
    ($type:ty, $encode:expr, $decode:expr) => {
        impl Plain for $type {
            fn encode(&self, numbers: &mut Vec<f64>) {
                numbers.push($encode(*self));
            }

            fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
                numbers.next().map($decode)
            }
        }
    };
}

plain_number!(u32, f64::from, |x| x as u32);
plain_number!(usize, |x| x as f64, |x| x as usize);
plain_number!(bool, |x| f64::from(u8::from(x)), |x| x != 0.0);
plain_number!(Mode, |mode| f64::from(mode as u8), |x| match x as u8 {
    0 => Mode::Stick,
    1 => Mode::Slip,
    _ => Mode::Parting,
});

impl<T: Plain + Copy, const N: usize> Plain for [T; N] {
    fn encode(&self, numbers: &mut Vec<f64>) {
        self.iter().for_each(|value| value.encode(numbers));
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let mut values = [T::decode(numbers)?; N];
        for value in values.iter_mut().skip(1) {
            *value = T::decode(numbers)?;
        }
        Some(values)
    }
}

impl<T: Plain> Plain for Vec<T> {
    fn encode(&self, numbers: &mut Vec<f64>) {
        self.len().encode(numbers);
        self.iter().for_each(|value| value.encode(numbers));
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let n = usize::decode(numbers)?;
        (0..n).map(|_| T::decode(numbers)).collect()
    }
}

/// A type represented by its parts, one after the other.
macro_rules! plain_parts {
    ([$($generics:tt)*] $type:ty, { $($field:ident),* }) => {
        impl<$($generics)*> Plain for $type {
            fn encode(&self, numbers: &mut Vec<f64>) {
                $(self.$field.encode(numbers);)*
            }

            fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
                Some(Self { $($field: Plain::decode(numbers)?),* })
            }
        }
    };
}

pub(super) use plain_parts;

plain_parts!([] Key, { tool, point, corner });
plain_parts!([const D: usize] NodalSum<D>, { vector, weight });
plain_parts!([const D: usize] Outer<D>, { sides, facing, count, normals });
plain_parts!([const D: usize] Multiplier<D>, { normal, shear });
plain_parts!([const D: usize] Closest<D>, { gap, normal, point, part, normal_derivative });

impl<A: Plain, B: Plain> Plain for (A, B) {
    fn encode(&self, numbers: &mut Vec<f64>) {
        self.0.encode(numbers);
        self.1.encode(numbers);
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        Some((A::decode(numbers)?, B::decode(numbers)?))
    }
}

impl<A: Plain, B: Plain, C: Plain> Plain for (A, B, C) {
    fn encode(&self, numbers: &mut Vec<f64>) {
        self.0.encode(numbers);
        self.1.encode(numbers);
        self.2.encode(numbers);
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        Some((A::decode(numbers)?, B::decode(numbers)?, C::decode(numbers)?))
    }
}

/// The reason why contact cannot be evaluated on this rank.
#[derive(Debug)]
pub(super) enum Failure {
    /// An error on this rank.
    Own(ContactError),
    /// Another rank has an error.
    OnRank,
}

impl From<ContactError> for Failure {
    fn from(error: ContactError) -> Self {
        Failure::Own(error)
    }
}

impl From<Failure> for EvaluateError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Own(error) => error.into(),
            Failure::OnRank => EvaluateError::OnRank { is_final: false },
        }
    }
}

/// Turns success into failure unless all ranks have succeeded.
pub(super) fn agreed<T>(reduction: &Reduction, outcome: Result<T, ContactError>) -> Result<T, Failure> {
    let fails = reduction.any(outcome.is_err());
    let outcome = outcome.map_err(Failure::Own);
    if fails { outcome.and(Err(Failure::OnRank)) } else { outcome }
}

/// Sets each value to true if it is true on any rank.
pub(super) fn any_of_each(reduction: &Reduction, values: &mut [bool]) {
    let mut numbers: Vec<f64> = values.iter().map(|is| f64::from(u8::from(*is))).collect();
    reduction.maximum(&mut numbers);
    values.iter_mut().zip(numbers).for_each(|(is, number)| *is = number > 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_tell_values() {
        let multiplier = Multiplier { normal: -0.1, shear: [f64::MAX, 3.0] };
        let key = Key { tool: 1, point: u32::MAX, corner: 8 };
        let values = vec![
            (key, multiplier, vec![true, false]),
            (key, Multiplier { normal: 0.0, ..multiplier }, vec![]),
        ];
        let again: Vec<(Key, Multiplier<2>, Vec<bool>)> = from_numbers(in_numbers(&values)).collect();
        assert_eq!(again, values);
        for mode in [Mode::Stick, Mode::Slip, Mode::Parting] {
            assert_eq!(from_numbers(in_numbers(&[mode])).collect::<Vec<Mode>>(), [mode]);
        }
    }
}
