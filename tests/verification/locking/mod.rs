//! Nearly incompressible bodies and isochoric plastic flow, with and without cures of volumetric locking, against exact
//! solutions at finite strain.

mod cavity;
mod cook;
mod flexure;
mod patch;
mod torsion;

/// Orders of convergence from one error to the next, when the spacing is halved.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).abs().log2()).collect()
}

/// Errors formatted for the log.
fn in_powers(errors: &[f64]) -> String {
    errors.iter().map(|e| format!("{e:.2e} ")).collect()
}

/// ∫ f by Simpson's rule.
fn integral([from, to]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
    const N: usize = 20_000;
    let h = (to - from) / N as f64;
    let weight = |k: usize| match k {
        0 | N => 1.0,
        _ if k % 2 == 1 => 4.0,
        _ => 2.0,
    };
    (0..=N).map(|k| weight(k) * f(from + k as f64 * h)).sum::<f64>() * h / 3.0
}
