//! Sums over nodal vectors. All norms and scalar products of the iterative solvers are formed here.

use crate::ranks::{Halo, Ranks};

use super::LinearError;

/// Largest number of nodes in a sum that is not divided further.
pub(super) const TERMS: usize = 1024;

/// Sums over the nodes of all ranks.
#[derive(Clone, Copy)]
pub(super) struct Reduction<'a>(pub &'a Halo);

impl Reduction<'_> {
    /// Completes a nodal field with the contributions of all points.
    pub(super) fn complete<const N: usize>(self, field: &mut [[f64; N]]) {
        self.0.add(field);
    }

    /// Scalar product of complete fields; the result is the same to the last bit on all ranks.
    pub(super) fn dot<const N: usize>(self, a: &[[f64; N]], b: &[[f64; N]]) -> f64 {
        let Reduction(halo) = self;
        if halo.ranks().is_alone() { dot(a, b) } else { halo.ranks().total(dot_of_own(halo, 0, a, b)) }
    }
}

/// Returns, on all ranks, the error of the first rank that has one, so that no rank continues alone.
pub(super) fn agree<T>(ranks: &Ranks, outcome: Result<T, LinearError>) -> Result<T, LinearError> {
    match ranks.first(outcome.as_ref().err().cloned()) {
        Some(error) => Err(error),
        None => outcome,
    }
}

/// The contribution of the nodes of this rank to a scalar product, computed by recursive halving; the vectors start at
/// node `first`.
fn dot_of_own<const N: usize>(halo: &Halo, first: usize, a: &[[f64; N]], b: &[[f64; N]]) -> f64 {
    if a.len() <= TERMS {
        let mut sum = [0.0; N];
        for (_, (a, b)) in a.iter().zip(b).enumerate().filter(|(n, _)| halo.is_own(first + n)) {
            for d in 0..N {
                sum[d] += a[d] * b[d];
            }
        }
        return sum.iter().sum();
    }
    let middle = a.len() / 2;
    let ((a_low, a_high), (b_low, b_high)) = (a.split_at(middle), b.split_at(middle));
    let (low, high) = rayon::join(
        || dot_of_own(halo, first, a_low, b_low),
        || dot_of_own(halo, first + middle, a_high, b_high),
    );
    low + high
}

/// Scalar product, computed by recursive halving: the order of summation is the same for any number of threads.
fn dot<const N: usize>(a: &[[f64; N]], b: &[[f64; N]]) -> f64 {
    if a.len() <= TERMS {
        let mut sum = [0.0; N];
        for (a, b) in a.iter().zip(b) {
            for d in 0..N {
                sum[d] += a[d] * b[d];
            }
        }
        return sum.iter().sum();
    }
    let middle = a.len() / 2;
    let ((a_low, a_high), (b_low, b_high)) = (a.split_at(middle), b.split_at(middle));
    let (low, high) = rayon::join(|| dot(a_low, b_low), || dot(a_high, b_high));
    low + high
}

/// x ← x + α p.
pub(super) fn add<const N: usize>(x: &mut [[f64; N]], alpha: f64, p: &[[f64; N]]) {
    for (x, p) in x.as_flattened_mut().iter_mut().zip(p.as_flattened()) {
        *x += alpha * p;
    }
}
