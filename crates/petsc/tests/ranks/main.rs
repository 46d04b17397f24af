//! Messages and solvers on one to four ranks. Without `mpirun`, the program starts itself twice on each number of
//! ranks, and compares the two outputs.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a test")]

mod body;
mod direct;
mod krylov;
mod messages;

use std::process::Command;
use std::sync::Arc;

use mpm_core::ranks::{Communicator, Ranks};
use mpm_petsc::Session;

/// The variable that tells the processes of `mpirun` what to do.
const VARIABLE: &str = "MPM_PETSC_RANK";

fn main() {
    match std::env::var(VARIABLE).as_deref() {
        Ok("panic") => krylov::panic(&start("").1),
        Ok("option") => krylov::wrong_option(&start("-pc_type nonsense").1),
        Ok(_) => all(),
        Err(_) => start_ranks(),
    }
}

fn start_ranks() {
    for n in 1..=4 {
        let [first, second] = [run(n, "all"), run(n, "all")];
        assert_eq!(first, second, "the same bits in each run on {n} ranks");
        println!("{}", first.unwrap_or_else(|errors| panic!("{n} ranks: {errors}")));
    }
    for n in [1, 2] {
        assert_eq!(run(n, "option"), Ok(String::new()));
        let errors = run(n, "panic").expect_err("a panic ends all ranks");
        assert!(errors.contains("the preconditioner panics"), "{errors}");
    }
}

/// Runs this program on `n` ranks; returns what rank 0 prints, or the errors.
fn run(n: usize, what: &str) -> Result<String, String> {
    let program = std::env::current_exe().expect("a path");
    let output = Command::new("mpirun")
        .args(["--oversubscribe", "-n", &n.to_string()])
        .arg(program)
        .env(VARIABLE, what)
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OPENBLAS_NUM_THREADS", "1")
        .output()
        .expect("mpirun must be installed");
    let [text, errors] =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    if output.status.success() { Ok(text) } else { Err(format!("{}\n{text}\n{errors}", output.status)) }
}

fn start(options: &str) -> (Session, Ranks) {
    let session = mpm_petsc::start(options).expect("MPI and PETSc start");
    let ranks = Ranks::new(session.communicator() as Arc<dyn Communicator>);
    (session, ranks)
}

fn all() {
    let handled = caught_signals();
    let (session, ranks) = start("-direct_mat_mumps_icntl_7 2");
    assert_eq!(caught_signals() & !handled & SIGNALS, 0, "PETSc handles no signals");
    assert!(mpm_petsc::start("").is_err());
    print(&ranks, &format!("{} on {} ranks", mpm_petsc::version(), ranks.count()));
    messages::check(&session.communicator());
    direct::check(&ranks);
    krylov::check(&ranks);
    // A backend that outlives the session does no harm.
    let late = mpm_petsc::Direct::<2>::new();
    drop(session);
    drop(late);
    assert!(mpm_petsc::Direct::<2>::new().is_err());
}

/// Prints a line on rank 0.
fn print(ranks: &Ranks, line: &str) {
    if ranks.is_root() {
        println!("{line}");
    }
}

/// Signals that a program may want to handle: hang-up, interrupt, illegal instruction, termination.
const SIGNALS: u64 = 1 | 1 << 1 | 1 << 3 | 1 << 14;

/// The signals that this process handles, as bits; none if the system does not report them.
fn caught_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    line.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).unwrap_or(0)
}

/// Prints on rank 0 the outcome of a solution, with a hash of its bits on all ranks.
fn report<const N: usize>(ranks: &Ranks, name: &str, outcome: &str, error: f64, x: &[[f64; N]]) {
    let hash = |sum: u64, x: &f64| (sum ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(7);
    let hashes = ranks.gather_all(x.as_flattened().iter().fold(0, hash));
    let hash = hashes.iter().fold(0u64, |sum, hash| sum.wrapping_mul(31).wrapping_add(*hash));
    print(ranks, &format!("{name}: {outcome}, error {error:.1e}, bits {hash:016x}"));
}
