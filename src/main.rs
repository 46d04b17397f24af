//! The program `mpm`.

use std::process::ExitCode;

#[global_allocator]
static HEAP: mpm::program::Heap = mpm::program::Heap;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    ExitCode::from(mpm::program::main(&arguments))
}
