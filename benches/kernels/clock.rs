//! CPU time of a piece of work on one thread.

use std::time::Duration;

use cpu_time::ThreadTime;

/// CPU time after which a measurement ends, but not before five calls.
const ENOUGH: Duration = Duration::from_millis(400);

/// Smallest CPU time among repeated calls of `work`, [s]: the cost with the least interference from other programs. CPU
/// time does not count other programs, but these programs share the caches and the memory.
///
/// Calls are timed one by one, because most of them take far longer than reading the clock.
pub fn least(mut work: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    let begin = ThreadTime::now();
    let mut calls = 0;
    while calls < 5 || begin.elapsed() < ENOUGH {
        let start = ThreadTime::now();
        work();
        least = least.min(start.elapsed().as_secs_f64());
        calls += 1;
    }
    least
}

/// Exponent of growth: slope of the least-squares line through the points (ln size, ln cost).
pub fn exponent(measured: &[(f64, f64)]) -> f64 {
    let n = measured.len() as f64;
    let logs: Vec<(f64, f64)> = measured.iter().map(|(size, cost)| (size.ln(), cost.ln())).collect();
    let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (along, across) =
        logs.iter().fold((0.0, 0.0), |(a, c), p| (a + (p.0 - x).powi(2), c + (p.0 - x) * (p.1 - y)));
    across / along
}
