//! Numbers side by side: the pairs of one column with several rows at a time.

use std::ops::{Add, AddAssign, Mul};

/// A number or several of them side by side, on which the equation of a block is written once.
pub trait Lane: Copy + Add<Output = Self> + AddAssign + Mul<f64, Output = Self> {}

impl Lane for f64 {}

/// Four numbers side by side: what a vector register of this decade holds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct Lanes(pub [f64; Lanes::WIDTH]);

impl Lanes {
    /// How many there are.
    pub const WIDTH: usize = 4;
    /// Zeros.
    pub const ZERO: Lanes = Lanes([0.0; Lanes::WIDTH]);
}

impl Lane for Lanes {}

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        Lanes(std::array::from_fn(|l| self.0[l] + other.0[l]))
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Lanes) {
        *self = *self + other;
    }
}

impl Mul<f64> for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, factor: f64) -> Lanes {
        Lanes(std::array::from_fn(|l| self.0[l] * factor))
    }
}

/// The components of up to [`Lanes::WIDTH`] vectors, each side by side; those of missing vectors are zero.
#[inline(always)]
pub(super) fn transposed<const E: usize>(vectors: &[[f64; E]]) -> [Lanes; E] {
    std::array::from_fn(|j| {
        Lanes(std::array::from_fn(|l| if l < vectors.len() { vectors[l][j] } else { 0.0 }))
    })
}
