//! Newton iterations assemble in place: after the first evaluation of a system, evaluating it allocates nothing.

#![allow(unsafe_code, reason = "an allocator that counts cannot be written without")]
#![allow(clippy::unwrap_used)]

#[path = "method/assembly/states.rs"]
mod states;

use std::alloc::{GlobalAlloc, Layout, System as Heap};
use std::cell::Cell;

use mpm::assembly::Wanted;
use mpm::step::{At, StepContext};
use mpm::stress::PlaneStrain;
use mpm::terms::Sum;

use states::{FORMULATIONS, Random, State, cases, random_state};

thread_local! {
    /// Number of allocations of this thread, without those of the test harness.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

/// The system allocator with a counter.
struct Counting;

// SAFETY: every call is passed on unchanged to the allocator of the system; counting neither allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { Heap.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Number of allocations that `work` makes on this thread.
fn allocations(work: impl FnOnce()) -> usize {
    let before = COUNT.get();
    work();
    COUNT.get() - before
}

#[test]
fn assembling_again_allocates_nothing() {
    assert!(allocations(|| drop(std::hint::black_box(vec![0u8; 100]))) == 1, "the counter does not count");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        for (method, law) in cases() {
            for formulation in FORMULATIONS {
                let mut state = random_state::<2, PlaneStrain>(method, law, 400, 5);
                state.model.formulation = formulation;
                let State { model, points, links, delta_d } = &mut state;
                let mut sum =
                    Sum::from_model::<PlaneStrain>(&StepContext::first(model, links), points).unwrap();
                let mut assemble = |delta_d: &[[f64; 2]]| {
                    sum.evaluate(
                        &StepContext::first(model, links),
                        points,
                        At::new(delta_d),
                        Wanted::Stiffness,
                    )
                    .unwrap();
                };
                let first = allocations(|| assemble(delta_d));
                let mut random = Random(1);
                for again in 0..3 {
                    delta_d.iter_mut().flatten().for_each(|u| *u *= random.within(0.98, 1.02));
                    let later = allocations(|| assemble(delta_d));
                    assert_eq!(later, 0, "{method:?} {law:?} {formulation:?}, call {again}; first {first}");
                }
            }
        }
    });
}
