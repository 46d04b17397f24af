//! Contact on several ranks: their agreement on what each of them finds, and values as plain numbers to exchange.

use crate::ranks::{Ranks, Reduction};
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

/// Sends values to some ranks, at most one message to each; returns the values for this rank, each message with the
/// rank that sent it, in ascending order of these ranks.
pub(super) fn exchange<T: Plain>(ranks: &Ranks, messages: Vec<(usize, Vec<T>)>) -> Vec<(usize, Vec<T>)> {
    let messages = messages.into_iter().map(|(rank, values)| (rank, in_numbers(&values))).collect();
    let received = ranks.exchange(messages).into_iter();
    received.map(|(rank, numbers)| (rank, from_numbers(numbers).collect())).collect()
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
