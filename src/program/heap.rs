//! The heap of the program: that of the system, which remembers whether a request for memory was refused.
#![allow(unsafe_code, reason = "an allocator cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicBool, Ordering};

/// True once the system has refused a request for memory.
static REFUSED: AtomicBool = AtomicBool::new(false);

/// The allocator of the system. A refused allocation ends a Rust program with SIGABRT, as any other abort does; the two
/// are told apart by [`refused`].
pub struct Heap;

// SAFETY: every call is passed on unchanged to the allocator of the system; the note neither allocates nor unwinds.
unsafe impl GlobalAlloc for Heap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of this function, which is the same.
        noted(unsafe { System.alloc(layout) })
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        noted(unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        noted(unsafe { System.realloc(pointer, layout, size) })
    }
}

/// The memory, after a note if there is none.
#[inline]
fn noted(memory: *mut u8) -> *mut u8 {
    if memory.is_null() {
        note_refusal();
    }
    memory
}

/// Records that the system has refused memory.
#[cold]
pub fn note_refusal() {
    REFUSED.store(true, Ordering::SeqCst);
}

/// True once the system has refused a request for memory.
pub fn refused() -> bool {
    REFUSED.load(Ordering::SeqCst)
}
