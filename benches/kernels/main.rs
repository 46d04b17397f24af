//! Cost of the parts of an analysis, with the speed of the machine measured in the same run.
//!
//! ```sh
//! cargo bench --bench kernels [-- TEXT]
//! ```
//!
//! With TEXT, only assembly and linear systems are measured, on those examples for which the name followed by the
//! method contains this text. Everything runs on one thread. The measure is the smallest CPU time of that thread over
//! several calls, so that other programs on the machine have little effect. Tables are Markdown, for
//! `docs/performance.md`.
#![allow(clippy::print_stdout, reason = "a program")]

mod calibration;
mod clock;
mod count;
mod elasticity;
mod files;
mod point;
mod system;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let only = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    let machine = calibration::Machine::measure();
    println!(
        "Calibration: {:.1} GFLOP/s of products and sums, {:.1} GFLOP/s fused, {:.1} GB/s of the triad.",
        machine.separate, machine.fused, machine.triad
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    pool.install(|| -> std::io::Result<()> {
        if only.is_none() {
            point::print();
        }
        system::print(&machine, only.as_deref());
        if only.is_none() {
            elasticity::print(&machine);
            files::print(tempfile::tempdir()?.path())?;
        }
        Ok(())
    })?;
    Ok(())
}
