//! The natural logarithm and its divided differences on [`Lane`]s.

use std::f64::consts::LN_2;

use super::Lane;

/// Largest x² for which the series of artanh(x)/x is used: (√2 − 1)²/(√2 + 1)², the range that [`ln`] needs.
pub(super) const SERIES: f64 = 0.029_437_3;

/// artanh(√y)/√y for y up to [`SERIES`]; the first neglected term is below 3e-17.
#[inline(always)]
fn series<T: Lane>(y: T) -> T {
    let mut sum = T::splat(1.0 / 19.0);
    for odd in [17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = sum * y + T::splat(1.0 / odd);
    }
    sum
}

/// Natural logarithm of x, accurate to two units in the last place of max(|ln x|, ln 2). NaN unless x is positive and
/// normal.
///
/// With x = m·2^e and s = (m − 1)/(m + 1), ln(x) = e ln 2 + 2 artanh(s).
#[inline(always)]
pub fn ln<T: Lane>(x: T) -> T {
    let (m, e) = x.split();
    let s = (m - T::splat(1.0)) / (m + T::splat(1.0));
    e * LN_2 + s * 2.0 * series(s * s)
}

/// artanh(x)/x for 0 ≤ x < 1.
#[inline(always)]
pub fn artanh_over_x<T: Lane>(x: T) -> T {
    let y = x * x;
    let near = series(y);
    if y.is_below(SERIES) {
        return near;
    }
    let one = T::splat(1.0);
    let far = ln((one + x) / (one - x)) * 0.5 / x;
    y.where_below(T::splat(SERIES), near, far)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Lanes;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_logarithm_is_that_of_the_library(exponent in -300.0..300.0f64, near in -0.3..0.3f64) {
            for x in [10f64.powf(exponent), 1.0 + near, 1.0 + 1e-6 * near, 1.0 + 1e-14 * near] {
                let (own, exact) = (ln(x), x.ln());
                prop_assert!((own - exact).abs() <= 2.0 * f64::EPSILON * exact.abs(), "{x}: {own} {exact}");
                prop_assert_eq!(ln(Lanes([x, 1.0, 2.0, 0.5])).0[0].to_bits(), own.to_bits());
            }
        }

        #[test]
        fn the_divided_difference_is_that_of_the_library(x in 0.0..0.999f64, small in 0.0..0.18f64) {
            for x in [x, small, small * 1e-8] {
                let own = artanh_over_x(x);
                let exact = if x > 0.0 { x.atanh() / x } else { 1.0 };
                prop_assert!((own - exact).abs() <= 1e-15 * exact, "{x}: {own} {exact}");
                // Taking the other branch in some lanes must not change the rest.
                prop_assert_eq!(artanh_over_x(Lanes([x, 0.9, 0.0, 0.1])).0[0].to_bits(), own.to_bits());
            }
        }
    }

    #[test]
    fn what_has_no_logarithm_is_no_number() {
        for x in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ln(x).is_nan(), "{x}");
        }
    }
}
