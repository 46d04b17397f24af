//! The exponential function on [`Lane`]s.

use std::f64::consts::LOG2_E;

use super::Lane;

/// Leading digits of ln 2, few enough that their products with exponents are exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
/// ln 2 minus [`LN_2_HIGH`].
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// 1/k! for k from 13 down to 0; the first neglected term of the series is below 5e-18 for |r| ≤ ½ ln 2.
const SERIES: [f64; 14] = [
    1.0 / 6_227_020_800.0,
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5_040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// eˣ, accurate to two units in the last place. NaN unless |x| is below about 708.
///
/// With k = x/ln 2 rounded to an integer and r = x − k ln 2, eˣ = 2ᵏ eʳ.
#[inline(always)]
pub fn exp<T: Lane>(x: T) -> T {
    let k = (x * LOG2_E).rounded();
    let r = x - k * LN_2_HIGH - k * LN_2_LOW;
    let mut sum = T::splat(SERIES[0]);
    for coefficient in &SERIES[1..] {
        sum = sum * r + T::splat(*coefficient);
    }
    sum * k.power_of_two()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Lanes;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_exponential_is_that_of_the_library(x in -700.0..700.0f64) {
            for x in [x, 0.01 * x, 1e-6 * x, 1e-14 * x] {
                let (own, exact) = (exp(x), x.exp());
                prop_assert!((own - exact).abs() <= 2.0 * f64::EPSILON * exact, "{x}: {own} {exact}");
                prop_assert_eq!(exp(Lanes([1.0, x, -2.0, 0.0])).0[1].to_bits(), own.to_bits());
            }
        }
    }

    #[test]
    fn what_is_too_large_is_no_number() {
        assert_eq!(exp(0.0), 1.0);
        for x in [1e3, -1e3, 1e18, -1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(exp(x).is_nan(), "{x}");
        }
    }
}
