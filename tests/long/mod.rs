//! Which part of a large matrix of tests runs: `tests/run --long` runs all of it, `tests/run` what represents it.
#![allow(dead_code, reason = "not every test binary uses all of these")]

/// True in `tests/run --long`.
pub fn is_long() -> bool {
    std::env::var_os("MPM_LONG").is_some()
}

/// All entries of a matrix in `tests/run --long`, otherwise its first `n`, which represent the others.
pub fn first<T>(n: usize, all: &[T]) -> &[T] {
    if is_long() { all } else { &all[..n] }
}

/// `all` random cases in `tests/run --long`, otherwise a quarter of them.
pub fn share(all: u64) -> u64 {
    if is_long() { all } else { all / 4 }
}
