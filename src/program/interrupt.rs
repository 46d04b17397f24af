//! Ctrl-C and the other signals that ask the program to stop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, anyhow};

use crate::program::exit::INTERRUPTED;

/// Stack of the waiting thread, [byte].
#[cfg(unix)]
const STACK: usize = 128 << 10;

/// Time after the first signal within which further signals count as the same request: `timeout` sends SIGTERM twice
/// within milliseconds, and a queue may signal a job and each of its processes.
const ONE_REQUEST: std::time::Duration = std::time::Duration::from_secs(2);

/// Returns a flag that Ctrl-C, a closed terminal or another signal that asks for an end sets: SIGTERM, SIGXCPU,
/// SIGUSR1, SIGUSR2 and SIGALRM, which queues and systems send shortly before a limit. Ctrl-C, SIGTERM or a closed
/// terminal later than [`ONE_REQUEST`] after the first signal ends the program at once. Each of the two prints a
/// message if `speaks` is true.
///
/// # Errors
/// If the signals cannot be handled or the thread that waits for them cannot be started.
#[cfg(unix)]
pub fn stop_on_interrupt(speaks: bool) -> anyhow::Result<Arc<AtomicBool>> {
    use signal_hook::consts::{SIGALRM, SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2, SIGXCPU};

    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    let awaited = [SIGINT, SIGTERM, SIGXCPU, SIGUSR1, SIGUSR2, SIGALRM];
    let mut awaited = awaited.to_vec();
    if !is_ignored(SIGHUP) {
        awaited.push(SIGHUP);
    }
    let mut signals =
        signal_hook::iterator::Signals::new(awaited).context("Ctrl-C and SIGTERM cannot be handled")?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .stack_size(STACK)
        .spawn(move || {
            let mut first: Option<std::time::Instant> = None;
            for signal in signals.forever() {
                let Some(began) = first else {
                    first = Some(std::time::Instant::now());
                    raised.store(true, Ordering::SeqCst);
                    if speaks {
                        message!("{}", request(signal));
                    }
                    continue;
                };
                // The system repeats SIGXCPU every second, and a timer may repeat, too: nobody asks for haste.
                if [SIGINT, SIGTERM, SIGHUP].contains(&signal) && began.elapsed() > ONE_REQUEST {
                    if speaks {
                        message!("interrupted at once: the current step is not written");
                    }
                    std::process::exit(i32::from(INTERRUPTED));
                }
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

/// The message about the first signal.
#[cfg(unix)]
fn request(signal: i32) -> String {
    use signal_hook::consts::{SIGHUP, SIGINT};

    let seconds = ONE_REQUEST.as_secs();
    let cause = match signal {
        // The user of the terminal knows.
        SIGINT | SIGHUP => String::new(),
        signal => {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("a signal");
            format!(" ({name})")
        }
    };
    format!(
        "stopping after the current step{cause}; to stop at once, press Ctrl-C again after {seconds} seconds or more"
    )
}

/// Returns a flag that Ctrl-C sets; Ctrl-C later than [`ONE_REQUEST`] after the first ends the program at once.
///
/// # Errors
/// If the signal cannot be handled.
#[cfg(not(unix))]
pub fn stop_on_interrupt(_: bool) -> anyhow::Result<Arc<AtomicBool>> {
    use signal_hook::consts::SIGINT;
    use signal_hook::flag;

    let (stop, hurry) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    // Registered in this order, so that the first Ctrl-C finds both flags unset.
    flag::register_conditional_shutdown(SIGINT, i32::from(INTERRUPTED), Arc::clone(&hurry))
        .and_then(|_| flag::register(SIGINT, Arc::clone(&stop)))
        .context("Ctrl-C cannot be handled")?;
    let raised = Arc::clone(&stop);
    std::thread::spawn(move || {
        while !raised.load(Ordering::SeqCst) {
            std::thread::sleep(ONE_REQUEST / 20);
        }
        std::thread::sleep(ONE_REQUEST);
        hurry.store(true, Ordering::SeqCst);
    });
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
