//! Speed of the machine: multiply-adds in registers, and streaming through memory.

use std::hint::black_box;

use pulp::{Arch, Simd, WithSimd};

use crate::clock::least;

/// Speed of one thread of the machine, with the vector instructions for which the kernels are compiled.
pub struct Machine {
    /// Products and sums rounded separately, as in the kernels, [GFLOP/s].
    pub separate: f64,
    /// Fused products and sums, [GFLOP/s].
    pub fused: f64,
    /// The triad a = b + s c of STREAM, 24 bytes per number, [GB/s].
    pub triad: f64,
}

impl Machine {
    /// Measures the machine.
    pub fn measure() -> Machine {
        let arch = Arch::new();
        let flops = |fused| {
            let lanes = arch.dispatch(Chains { rounds: 1, fused });
            let seconds = least(|| {
                black_box(arch.dispatch(Chains { rounds: black_box(ROUNDS), fused }));
            });
            (ROUNDS * CHAINS * 2 * lanes) as f64 / seconds * 1e-9
        };
        let (mut a, b, c) = (vec![0.0; TRIAD], vec![1.0; TRIAD], vec![2.0; TRIAD]);
        let seconds = least(|| {
            for ((a, b), c) in a.iter_mut().zip(&b).zip(&c) {
                *a = b + 3.0 * c;
            }
            black_box(&mut a);
        });
        Machine {
            separate: flops(false),
            fused: flops(true),
            triad: (TRIAD * 3 * size_of::<f64>()) as f64 / seconds * 1e-9,
        }
    }
}

/// Number of values in each array of the triad: 64 MiB, more than the capacity of the caches.
const TRIAD: usize = 1 << 23;
/// Number of independent chains of sums of products: large enough to hide their latency, small enough for the
/// registers.
const CHAINS: usize = 12;
const ROUNDS: usize = 1 << 20;

/// x ← x a + b on several registers; returns how many numbers a register holds.
struct Chains {
    rounds: usize,
    fused: bool,
}

impl WithSimd for Chains {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let (a, b) = (simd.splat_f64s(black_box(0.5)), simd.splat_f64s(black_box(1.0)));
        let mut chains = [simd.splat_f64s(1.0); CHAINS];
        if self.fused {
            for _ in 0..self.rounds {
                for x in &mut chains {
                    *x = simd.mul_add_f64s(*x, a, b);
                }
            }
        } else {
            for _ in 0..self.rounds {
                for x in &mut chains {
                    *x = simd.add_f64s(simd.mul_f64s(*x, a), b);
                }
            }
        }
        for x in chains {
            black_box(simd.reduce_sum_f64s(x));
        }
        S::F64_LANES
    }
}
