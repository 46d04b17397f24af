use super::*;
use crate::tensor::Mat3;
use proptest::prelude::*;

/// Rows of `spectral.csv`: a tensor, then its logarithm and its exponential, each followed by its derivative, to 13
/// digits.
fn reference() -> impl Iterator<Item = (Sym3, Vec<f64>)> {
    let lines =
        include_str!("../../../../../tests/data/spectral.csv").lines().filter(|line| !line.starts_with('#'));
    lines.map(|line| {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let [xx, yy, zz, yz, xz, xy] = *numbers.first_chunk::<6>().unwrap();
        let full = Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        (Sym3::symmetric_part(&full), numbers[6..].to_vec())
    })
}

/// Largest difference of a tensor, and of its derivative, from the reference numbers, relative to the largest entry of
/// each.
fn error(value: &Sym3, derivative: &Tangent, expected: &[f64]) -> f64 {
    let entries: Vec<f64> = (0..6).flat_map(|c| (c..6).map(move |r| derivative[(r, c)])).collect();
    let largest_error = |numbers: &[f64], exact: &[f64]| {
        let largest = exact.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        numbers.iter().zip(exact).fold(0.0f64, |m, (a, b)| m.max((a - b).abs() / largest))
    };
    largest_error(&value.0, &expected[..6]).max(largest_error(&entries, &expected[6..27]))
}

#[test]
fn logarithm_exponential_and_derivatives_equal_those_in_60_digits() {
    let (mut rows, mut worst_log, mut worst_exp) = (0, 0.0f64, 0.0f64);
    for (t, expected) in reference() {
        let (log, L) = log_with_derivative(&t);
        worst_log = worst_log.max(error(&log, &L, &expected[..27]));
        let exp = t.map_eigenvalues(f64::exp);
        worst_exp = worst_exp.max(error(&exp, &exp_derivative(&t), &expected[27..]));
        rows += 1;
    }
    assert_eq!(rows, 108);
    // The reference numbers have 13 digits.
    assert!(worst_log < 1e-12 && worst_exp < 1e-12, "{worst_log:e} {worst_exp:e}");
}

/// Tensors that are the identity up to some units in the last place of their entries.
#[test]
fn tensors_that_differ_from_the_identity_by_round_off_are_decomposed() {
    let unit = f64::EPSILON / 2.0;
    let steps = [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 6.0];
    for size in [1.0, 0.7, 3.0] {
        for k in 0..steps.len().pow(3) {
            let step = |power: u32| steps[k / steps.len().pow(power) % steps.len()];
            for shear in [0.0, unit, 1e-20] {
                let diagonal = [0, 1, 2].map(|power| 1.0 + step(power) * unit);
                let t = Sym3([diagonal[0], diagonal[1], diagonal[2], shear, 0.0, -shear]) * size;
                let s = t.spectrum();
                assert!((s.compose(s.values) - t).norm() < 3e-15 * size, "{t:?} {s:?}");
                for a in 0..3 {
                    for b in 0..3 {
                        let expected = f64::from(u8::from(a == b));
                        assert!((dot(&s.vectors[a], &s.vectors[b]) - expected).abs() < 2e-15, "{t:?} {s:?}");
                    }
                }
                let (log, L) = log_with_derivative(&t);
                assert!((log - Sym3::IDENTITY * size.ln()).norm() < 1e-14 && L.iter().all(|l| l.is_finite()));
            }
        }
    }
}

/// A tensor in any orientation, whose eigenvalues differ by gaps of any order of magnitude.
fn nearly_equal() -> impl Strategy<Value = Sym3> {
    let (base, exponents) = (0.3..3.0f64, prop::array::uniform2(0.0..17.0f64));
    let signs = prop::array::uniform2(prop::sample::select(vec![-0.6, 0.0, 0.7]));
    (base, exponents, signs, prop::array::uniform3(-3.2..3.2f64)).prop_map(|(base, gaps, signs, angles)| {
        let other = |k: usize| base * (1.0 + signs[k] * 10f64.powf(-gaps[k]));
        let q = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).into_inner();
        Sym3::symmetric_part(&(q * Mat3::from_diagonal(&[base, other(0), other(1)].into()) * q.transpose()))
    })
}

proptest! {
    #[test]
    fn a_spectrum_is_orthonormal_and_gives_the_tensor_back(t in nearly_equal(), size in -12.0..12.0f64, shift in -2.0..2.0f64) {
        let size = 10f64.powf(size);
        let t = (t - Sym3::IDENTITY * shift) * size;
        let s = t.spectrum();
        let scale = t.norm();
        prop_assert!((s.compose(s.values) - t).norm() < 3e-15 * scale);
        for a in 0..3 {
            for b in 0..3 {
                let expected = f64::from(u8::from(a == b));
                prop_assert!((dot(&s.vectors[a], &s.vectors[b]) - expected).abs() < 2e-15);
            }
        }
    }

    #[test]
    fn exponential_undoes_the_logarithm_and_so_do_their_derivatives(b in nearly_equal()) {
        let (log, L) = log_with_derivative(&b);
        prop_assert!((log.map_eigenvalues(f64::exp) - b).norm() < 1e-14 * b.norm());
        prop_assert!((exp_derivative(&log) * L - Tangent::identity()).norm() < 1e-13);
        prop_assert!((L - L.transpose()).norm() < 1e-15 * L.norm());
    }

    #[test]
    fn log_derivative_matches_central_differences(b in nearly_equal()) {
        let log = |b: &Sym3| b.map_eigenvalues(f64::ln);
        let numeric = Tangent::from_fn(|r, c| {
            let h = 1e-6;
            let (mut p, mut m) = (b, b);
            p.0[c] += h;
            m.0[c] -= h;
            (log(&p).0[r] - log(&m).0[r]) / (2.0 * h)
        });
        prop_assert!((numeric - log_derivative(&b)).norm() < 1e-8 * numeric.norm());
    }
}

#[test]
fn special_tensors_have_a_spectrum() {
    for (t, expected) in [
        (Sym3::ZERO, [0.0; 3]),
        (Sym3::IDENTITY, [1.0; 3]),
        (Sym3([1.0, 1.0, -2.0, 0.0, 0.0, 0.0]), [-2.0, 1.0, 1.0]),
        (Sym3([-1.0, 2.0, -1.0, 0.0, 0.0, 0.0]), [-1.0, -1.0, 2.0]),
        (Sym3([0.0, 0.0, 0.0, SQRT_2, SQRT_2, SQRT_2]), [-1.0, -1.0, 2.0]),
        (Sym3([1e-300, -1e-300, 0.0, 0.0, 0.0, 0.0]), [-1e-300, 0.0, 1e-300]),
        (Sym3([1e150, -1e150, 0.0, 0.0, 0.0, 0.0]), [-1e150, 0.0, 1e150]),
    ] {
        let mut values = t.spectrum().values;
        values.sort_by(f64::total_cmp);
        let scale = expected.iter().fold(0.0f64, |m: f64, x: &f64| m.max(x.abs()));
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() <= 1e-15 * scale, "{t:?}: {values:?}");
        }
    }
    for place in 0..6 {
        let mut entries = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3];
        entries[place] = f64::NAN;
        assert!(Sym3(entries).spectrum().values.iter().all(|value| value.is_nan()), "{place}");
    }
}

#[test]
fn divided_differences_match_their_series() {
    assert!((log_divided_difference(2.0, 1.0) - std::f64::consts::LN_2).abs() < 3e-16);
    for gap in [1e-3f64, 1e-6, 1e-9, 1e-13, 1e-16] {
        let delta = (1.0 + gap) - 1.0; // the gap that is left after rounding
        let exact = 1.0 - delta / 2.0 + delta.powi(2) / 3.0 - delta.powi(3) / 4.0 + delta.powi(4) / 5.0;
        assert!((log_divided_difference(1.0 + gap, 1.0) - exact).abs() < 3e-16);
    }
    assert_eq!(log_divided_difference(3.0, 3.0), 1.0 / 3.0);
    assert_eq!(exp_divided_difference(1.0, 1.0), 1f64.exp());
    assert!((exp_divided_difference(1.0, 0.0) - (1f64.exp() - 1.0)).abs() < 3e-16);
}
