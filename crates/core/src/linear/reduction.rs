//! Sums over vectors of the nodes. All norms and scalar products of the iterative solvers are formed here.

/// Numbers that one thread adds up.
pub(super) const TERMS: usize = 1024;

/// Scalar product, by halves: the order of the sum is fixed, whatever the number of threads.
pub(super) fn dot<const N: usize>(a: &[[f64; N]], b: &[[f64; N]]) -> f64 {
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
