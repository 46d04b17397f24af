//! Memory of the process, where the system tells: Linux.

/// Largest resident memory so far, or since it was last counted afresh, [byte].
pub(super) fn peak() -> Option<u64> {
    of("VmHWM:")
}

/// Resident memory now, [byte].
pub(super) fn resident() -> Option<u64> {
    of("VmRSS:")
}

fn of(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}
