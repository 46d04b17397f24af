//! A test of whether a law returns the same results when several threads evaluate it at once.

use std::thread;

use mpm_core::material::{Material, MaterialError, Response};
use mpm_core::tensor::Sym3;

/// Number of threads that evaluate the law at once.
const THREADS: usize = 4;
/// Number of strains.
const STRAINS: usize = 64;
/// Number of times that each thread evaluates each strain.
const ROUNDS: usize = 8;

type Outcome = (Result<Response, MaterialError>, Vec<f64>);

/// The response to a strain, with initial history.
fn evaluate(law: &dyn Material, strain: &Sym3) -> Outcome {
    let old = law.initial_history();
    let mut new = old.clone();
    (law.update(strain, &old, &mut new), new)
}

/// True if a law returns different results when several threads evaluate it at once than when one thread does: the law
/// then keeps data that its calls share. The components of the strains are at most `largest`, [-]. A law that passes
/// may still have this fault, since the calls need not overlap.
pub fn differs_between_threads(law: &dyn Material, largest: f64) -> bool {
    let strain = |k: usize| {
        let size = largest * [1.0, 0.1, 0.01][k % 3];
        Sym3(std::array::from_fn(|c| size * ((7 * k + 3 * c) as f64).sin()))
    };
    let strains: Vec<Sym3> = (0..STRAINS).map(strain).collect();
    let expected: Vec<Outcome> = strains.iter().map(|strain| evaluate(law, strain)).collect();
    let agrees = |first: usize| {
        // Each thread begins at a different strain, so that threads evaluate different strains at the same time.
        (0..ROUNDS * STRAINS)
            .map(|k| (first + k) % STRAINS)
            .all(|k| evaluate(law, &strains[k]) == expected[k])
    };
    thread::scope(|scope| {
        let agrees = &agrees;
        let threads: Vec<_> =
            (0..THREADS).map(|t| scope.spawn(move || agrees(t * STRAINS / THREADS))).collect();
        // A thread that cannot be joined has panicked, which a law that follows the interface never does.
        threads.into_iter().any(|thread| !thread.join().unwrap_or(false))
    })
}
