//! Ctrl-C and the other signals that ask the program to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, anyhow};

use crate::program::exit::INTERRUPTED;

/// Stack of the waiting thread, [byte].
#[cfg(unix)]
const STACK: usize = 128 << 10;

/// Returns a flag that Ctrl-C, SIGTERM or a closed terminal sets; a second signal ends the program at once. Each
/// signal prints a message if `speaks` is true.
#[cfg(unix)]
pub fn stop_on_interrupt(speaks: bool) -> anyhow::Result<Arc<AtomicBool>> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    let mut awaited = vec![SIGINT, SIGTERM];
    if !is_ignored(SIGHUP) {
        awaited.push(SIGHUP);
    }
    let mut signals =
        signal_hook::iterator::Signals::new(awaited).context("Ctrl-C and SIGTERM cannot be handled")?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .stack_size(STACK)
        .spawn(move || {
            for _ in signals.forever() {
                if raised.swap(true, Ordering::SeqCst) {
                    if speaks {
                        message!("interrupted at once: the current step is not written");
                    }
                    std::process::exit(i32::from(INTERRUPTED));
                }
                if !speaks {
                    continue;
                }
                message!("stopping after the current step; press Ctrl-C again to stop at once");
            }
        })
        .map_err(|error| {
            anyhow!(
                "the threads cannot be started: {error} (the thread that waits for Ctrl-C); raise `ulimit -u` or \
                 `ulimit -v`"
            )
        })?;
    Ok(stop)
}

/// Returns a flag that Ctrl-C sets; the second Ctrl-C ends the program at once.
#[cfg(not(unix))]
pub fn stop_on_interrupt(_: bool) -> anyhow::Result<Arc<AtomicBool>> {
    use signal_hook::consts::SIGINT;
    use signal_hook::flag;

    let stop = Arc::new(AtomicBool::new(false));
    // Registered in this order, so that the first Ctrl-C finds the flag unset.
    flag::register_conditional_shutdown(SIGINT, i32::from(INTERRUPTED), Arc::clone(&stop))
        .and_then(|_| flag::register(SIGINT, Arc::clone(&stop)))
        .context("Ctrl-C cannot be handled")?;
    Ok(stop)
}

/// True if the program was started with a signal ignored, as `nohup` does with SIGHUP; this is known only on Linux.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // If this is unknown, the signal is left alone.
    let Some(mask) = mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()) else { return true };
    mask >> (signal - 1) & 1 == 1
}
