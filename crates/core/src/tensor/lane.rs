//! SIMD lanes: one expression evaluated for several points, or for several rows of a column, at the same time.

use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// A scalar or a short vector of scalars (lanes), so that an equation is written once for both. Every operation acts on
/// each lane independently and rounds once: results do not depend on how values are grouped into lanes.
pub trait Lane:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + Mul<f64, Output = Self>
{
    /// The same number in every lane.
    fn splat(x: f64) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// Magnitude.
    fn abs(self) -> Self;

    /// `yes` in the lanes where `self < limit`, `no` in all others, including lanes with NaN.
    fn where_below(self, limit: Self, yes: Self, no: Self) -> Self;

    /// True if every lane is finite and positive.
    fn is_positive(self) -> bool;

    /// True if every lane is below `limit`.
    fn is_below(self, limit: f64) -> bool;

    /// Mantissa m in [√½, √2] and integer exponent e with `self` = m·2^e. The mantissa is NaN unless `self` is
    /// positive and normal.
    fn split(self) -> (Self, Self);

    /// The nearest integer; in a tie, the even one. NaN unless |`self`| is below 2⁵¹.
    fn rounded(self) -> Self;

    /// 2 to the power of `self`, an integer; NaN unless the magnitude of `self` is below 1023.
    fn power_of_two(self) -> Self;
}

/// 2⁵². All doubles of at least this size are integers; adding 2⁵² moves a small integer into the low mantissa bits.
const WHOLE: f64 = 4_503_599_627_370_496.0;
/// Number of mantissa bits stored in a double.
const MANTISSA: u32 = f64::MANTISSA_DIGITS - 1;
/// Exponent bias of a double.
const BIAS: u64 = 1023;

impl Lane for f64 {
    #[inline(always)]
    fn splat(x: f64) -> f64 {
        x
    }

    #[inline(always)]
    fn sqrt(self) -> f64 {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        self.abs()
    }

    #[inline(always)]
    fn where_below(self, limit: f64, yes: f64, no: f64) -> f64 {
        if self < limit { yes } else { no }
    }

    #[inline(always)]
    fn is_positive(self) -> bool {
        self > 0.0 && self < f64::INFINITY
    }

    #[inline(always)]
    fn is_below(self, limit: f64) -> bool {
        self < limit
    }

    #[inline(always)]
    fn split(self) -> (f64, f64) {
        // Only unsigned shifts: every SIMD instruction set provides them.
        let bits = self.to_bits();
        let one = BIAS << MANTISSA;
        let stored = bits.wrapping_add(one.wrapping_sub(FRAC_1_SQRT_2.to_bits())) >> MANTISSA;
        let m = f64::from_bits(bits.wrapping_sub(stored << MANTISSA).wrapping_add(one));
        let e = f64::from_bits(WHOLE.to_bits() | stored) - (WHOLE + BIAS as f64);
        let normal = (f64::MIN_POSITIVE..f64::INFINITY).contains(&self);
        (if normal { m } else { f64::NAN }, e)
    }

    #[inline(always)]
    fn rounded(self) -> f64 {
        // Numbers of this size have no fraction, so that the sum is rounded.
        let rounded = (self + 1.5 * WHOLE) - 1.5 * WHOLE;
        if self.abs() < 0.5 * WHOLE { rounded } else { f64::NAN }
    }

    #[inline(always)]
    fn power_of_two(self) -> f64 {
        let stored = (self + (WHOLE + BIAS as f64)).to_bits();
        if self.abs() < BIAS as f64 { f64::from_bits(stored << MANTISSA) } else { f64::NAN }
    }
}

/// Four doubles, the width of a 256-bit vector register.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct Lanes(pub [f64; Lanes::WIDTH]);

impl Lanes {
    /// Number of lanes.
    pub const WIDTH: usize = 4;
    /// Zero in every lane.
    pub const ZERO: Lanes = Lanes([0.0; Lanes::WIDTH]);

    /// The values `of(0)` to `of(3)`.
    #[inline(always)]
    pub fn gather(value: impl Fn(usize) -> f64) -> Lanes {
        Lanes([value(0), value(1), value(2), value(3)])
    }

    #[inline(always)]
    fn each(self, f: impl Fn(f64) -> f64) -> Lanes {
        let [a, b, c, d] = self.0;
        Lanes([f(a), f(b), f(c), f(d)])
    }

    #[inline(always)]
    fn with(self, other: Lanes, f: impl Fn(f64, f64) -> f64) -> Lanes {
        let ([a, b, c, d], [p, q, r, s]) = (self.0, other.0);
        Lanes([f(a, p), f(b, q), f(c, r), f(d, s)])
    }
}

impl Lane for Lanes {
    #[inline(always)]
    fn splat(x: f64) -> Lanes {
        Lanes([x; Lanes::WIDTH])
    }

    #[inline(always)]
    fn sqrt(self) -> Lanes {
        self.each(f64::sqrt)
    }

    #[inline(always)]
    fn abs(self) -> Lanes {
        self.each(f64::abs)
    }

    #[inline(always)]
    fn where_below(self, limit: Lanes, yes: Lanes, no: Lanes) -> Lanes {
        Lanes::gather(|l| self.0[l].where_below(limit.0[l], yes.0[l], no.0[l]))
    }

    #[inline(always)]
    fn is_positive(self) -> bool {
        // No short-circuit evaluation: it would branch.
        self.0.iter().fold(true, |all, x| all & (*x > 0.0) & (*x < f64::INFINITY))
    }

    #[inline(always)]
    fn is_below(self, limit: f64) -> bool {
        self.0.iter().fold(true, |all, x| all & (*x < limit))
    }

    #[inline(always)]
    fn split(self) -> (Lanes, Lanes) {
        (self.each(|x| x.split().0), self.each(|x| x.split().1))
    }

    #[inline(always)]
    fn rounded(self) -> Lanes {
        self.each(f64::rounded)
    }

    #[inline(always)]
    fn power_of_two(self) -> Lanes {
        self.each(f64::power_of_two)
    }
}

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn div(self, other: Lanes) -> Lanes {
        self.with(other, |a, b| a / b)
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
        self.each(|x| x * factor)
    }
}

/// Transposes up to [`Lanes::WIDTH`] vectors: component j of all vectors in entry j. Lanes without a vector are zero.
#[inline(always)]
pub fn transposed<const E: usize>(vectors: &[[f64; E]]) -> [Lanes; E] {
    std::array::from_fn(|j| {
        Lanes(std::array::from_fn(|l| if l < vectors.len() { vectors[l][j] } else { 0.0 }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_split_exactly() {
        for x in [1.0, 0.5, 2.0, 0.75, 0.7, 0.71, 1.41, 1.42, 3e300, 2.3e-308, f64::MIN_POSITIVE, f64::MAX] {
            let (m, e) = x.split();
            assert!((FRAC_1_SQRT_2..=std::f64::consts::SQRT_2).contains(&m), "{x}: {m} {e}");
            // Two steps, because 2^e alone may overflow.
            let half = (e / 2.0).trunc();
            assert_eq!(m * half.exp2() * (e - half).exp2(), x);
        }
        for x in [0.0, -1.0, f64::NAN, f64::INFINITY, 5e-324] {
            assert!(x.split().0.is_nan(), "{x}");
        }
    }

    #[test]
    fn side_by_side_is_one_by_one() {
        let (a, b) = (Lanes([0.3, -2.0, 1e9, f64::NAN]), Lanes([0.7, 3.0, 1.5, 1.0]));
        let bits = |x: Lanes| x.0.map(f64::to_bits);
        let each = |f: fn(f64, f64) -> f64| Lanes(std::array::from_fn(|l| f(a.0[l], b.0[l])));
        assert_eq!(bits(a + b), bits(each(|a, b| a + b)));
        assert_eq!(bits(a - b), bits(each(|a, b| a - b)));
        assert_eq!(bits(a * b), bits(each(|a, b| a * b)));
        assert_eq!(bits(a / b), bits(each(|a, b| a / b)));
        assert_eq!(bits(a.where_below(b, a, b)), bits(each(|a, b| if a < b { a } else { b })));
        assert_eq!(bits(b.split().0), bits(each(|_, b| b.split().0)));
        assert!(b.is_positive() && !a.is_positive() && b.is_below(3.5) && !a.is_below(1e10));
    }
}
