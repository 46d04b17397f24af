//! Runs many cases one after another, each under a limit of time and of memory.

use std::alloc::System;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use cap::Cap;
use cpu_time::ProcessTime;

#[global_allocator]
pub static ALLOCATOR: Cap<System> = Cap::new(System, usize::MAX);

/// The memory that a case may take.
const MAX_MEMORY: usize = 768 << 20;
/// Time that a case may take.
const MAX_TIME: Duration = Duration::from_secs(10);

/// The inputs under test.
pub trait Bench: Send + 'static {
    /// Extension of the file names of its cases.
    const ENDING: &'static str;

    /// The content of the case with this number.
    fn case(&self, seed: u64) -> Vec<u8>;

    /// Runs a case; returns how far it came. A digit before the name orders the counts.
    fn run(&self, content: &[u8]) -> String;
}

/// Held by the running test.
static ALONE: Mutex<()> = Mutex::new(());

/// Waits until no other test limits the memory of the process, and locks the others out.
pub fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs for the processor time `FUZZ_SECONDS`, beginning with the case `FUZZ_SEED`.
pub fn fuzz_for_long<B: Bench>(make: impl FnOnce() -> B + Send + 'static) {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    let seed = number("FUZZ_SEED").unwrap_or(now.as_secs() * 1_000_000);
    fuzz(make, seed, u64::MAX / 2, Duration::from_secs(number("FUZZ_SECONDS").unwrap_or(600)));
}

/// Runs cases until the time or the number is used up; returns the counts.
pub fn fuzz<B: Bench>(make: impl FnOnce() -> B + Send + 'static, first: u64, most: u64, time: Duration) {
    // One limit of memory for the whole process.
    let _alone = alone();
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!(
        "fuzz/{}_{first}_{}",
        std::process::id(),
        B::ENDING
    ));
    std::fs::create_dir_all(&folder).unwrap();
    let current = folder.join(format!("current.{}", B::ENDING));
    let (send, receive) = channel::<Result<(u64, String, Duration, usize), (u64, String)>>();
    let start = ProcessTime::now();
    let (begun, file) = (channel::<u64>(), current.clone());
    let (sender, receiver) = begun;
    let worker = std::thread::spawn(move || {
        let bench = make();
        for seed in first..first + most {
            let text = bench.case(seed);
            std::fs::write(&file, &text).unwrap();
            if sender.send(seed).is_err() {
                return;
            }
            let before = ALLOCATOR.allocated();
            ALLOCATOR.set_limit(before + MAX_MEMORY).unwrap();
            let began = ProcessTime::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| bench.run(&text)));
            let took = began.elapsed();
            ALLOCATOR.set_limit(usize::MAX).unwrap();
            let report = match outcome {
                Ok(outcome) => Ok((seed, outcome, took, text.len())),
                Err(panic) => {
                    let words = panic.downcast_ref::<String>().cloned();
                    Err((
                        seed,
                        words.or(panic.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default(),
                    ))
                }
            };
            if send.send(report).is_err() || start.elapsed() > time {
                return;
            }
        }
    });
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let (mut total, mut longest, mut faults) = (0, (Duration::ZERO, 0), Vec::new());
    while let Ok(seed) = receiver.recv() {
        // Processor time, since the machine may be busy.
        let began = ProcessTime::now();
        let report = loop {
            match receive.recv_timeout(Duration::from_millis(500)) {
                Err(RecvTimeoutError::Timeout) if began.elapsed() < MAX_TIME => {}
                report => break report,
            }
        };
        match report {
            Ok(Ok((seed, outcome, took, _))) => {
                total += 1;
                *counts.entry(outcome).or_default() += 1;
                longest = longest.max((took, seed));
            }
            Ok(Err((seed, message))) => {
                let kept = folder.join(format!("panic_{seed}.{}", B::ENDING));
                std::fs::copy(&current, &kept).unwrap();
                faults.push(format!("seed {seed} panics: {message}\n  the case is {}", kept.display()));
                if faults.len() >= 20 {
                    break;
                }
            }
            Err(RecvTimeoutError::Timeout) => {
                faults.push(format!("seed {seed} takes more than {MAX_TIME:?}: {}", current.display()));
                break;
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    println!("{total} cases from seed {first}, {:.0} s of processor time", start.elapsed().as_secs_f64());
    for (outcome, count) in &counts {
        println!("  {count:>8}  {}", &outcome[2..]);
    }
    println!("  longest: {:.2} s, seed {}", longest.0.as_secs_f64(), longest.1);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    drop(receiver);
    worker.join().unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
}
