//! Ctrl-C and the other ways to ask a program to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, anyhow};

use crate::exit::INTERRUPTED;

/// Stack of the waiting thread, [byte].
#[cfg(unix)]
const STACK: usize = 128 << 10;

/// A flag that Ctrl-C, SIGTERM and a closed terminal raise; the second time, they end the program at once.
#[cfg(unix)]
pub fn stop_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
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
                    tell!("interrupted at once: the step in hand is not written");
                    std::process::exit(i32::from(INTERRUPTED));
                }
                tell!("stopping after the step in hand; press Ctrl-C again to stop at once");
            }
        })
        .map_err(|error| {
            anyhow!(
                "the threads cannot be started: the one that waits for Ctrl-C: {error}; `ulimit -u` and `ulimit -v` \
                 limit what a program may have"
            )
        })?;
    Ok(stop)
}

/// A flag that Ctrl-C raises; the second time, it ends the program at once.
#[cfg(not(unix))]
pub fn stop_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    use signal_hook::consts::SIGINT;
    use signal_hook::flag;

    let stop = Arc::new(AtomicBool::new(false));
    // In this order, so that the first Ctrl-C finds the flag lowered.
    flag::register_conditional_shutdown(SIGINT, i32::from(INTERRUPTED), Arc::clone(&stop))
        .and_then(|_| flag::register(SIGINT, Arc::clone(&stop)))
        .context("Ctrl-C cannot be handled")?;
    Ok(stop)
}

/// Whether the program was started with a signal ignored, as `nohup` does it with SIGHUP; Linux tells.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    // Where nothing is known it is better not to answer: what ignores the signal then stays as it is.
    let Some(mask) = mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()) else { return true };
    mask >> (signal - 1) & 1 == 1
}
