//! Memory limits and memory use of the process.

use std::path::{Path, PathBuf};

/// Origin of the memory limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Physical memory of the machine.
    Machine,
    /// Control group (cgroup) of the process, as set by a container or a batch system.
    ControlGroup,
    /// Largest address space allowed for the process, `ulimit -v`.
    AddressSpace,
}

/// Memory available to the process, [byte].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// Largest amount that the process is allowed to use.
    pub limit: u64,
    /// Part of `limit` that is still free.
    pub available: u64,
    /// Origin of `limit`.
    pub bound: Bound,
}

impl Memory {
    /// Limits of this machine and process; `None` if the operating system does not report them (Linux does).
    pub fn this_machine() -> Option<Memory> {
        Memory::read(Path::new("/"))
    }

    /// Reads the limits from the Linux files below `root`: `/proc/meminfo`, the limits of the process, and the limits
    /// of its control groups (cgroup versions 1 and 2).
    fn read(root: &Path) -> Option<Memory> {
        let meminfo = std::fs::read_to_string(root.join("proc/meminfo")).ok()?;
        let limit = kibibytes(&meminfo, "MemTotal:")?;
        let available = kibibytes(&meminfo, "MemAvailable:").unwrap_or(limit);
        let mut memory = Memory { limit, available, bound: Bound::Machine };
        for group in control_groups(root) {
            if let Some(limit) = number(&group.limit) {
                let used = number(&group.usage).unwrap_or(0);
                memory.lower(limit, limit.saturating_sub(used), Bound::ControlGroup);
            }
        }
        let limits = std::fs::read_to_string(root.join("proc/self/limits")).unwrap_or_default();
        let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"));
        if let Some(limit) = line.and_then(|line| line.split_whitespace().next()?.parse().ok()) {
            let status = std::fs::read_to_string(root.join("proc/self/status")).unwrap_or_default();
            let used = kibibytes(&status, "VmSize:").unwrap_or(0);
            memory.lower(limit, limit.saturating_sub(used), Bound::AddressSpace);
        }
        Some(memory)
    }

    fn lower(&mut self, limit: u64, available: u64, bound: Bound) {
        if limit < self.limit {
            self.limit = limit;
            self.bound = bound;
        }
        self.available = self.available.min(available).min(self.limit);
    }
}

/// Resident memory of the process, [byte]; `None` if the operating system does not report it.
pub fn resident() -> Option<u64> {
    kibibytes(&std::fs::read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// Largest resident memory of the process so far, or since its counter was last reset, [byte]; `None` if the operating
/// system does not report it.
pub fn peak() -> Option<u64> {
    kibibytes(&std::fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// Value of the entry `name` in a file formatted like `/proc/meminfo`, [byte].
fn kibibytes(meminfo: &str, name: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|kib| kib.saturating_mul(1024))
}

/// Files that state the memory limit and the memory use of a control group.
struct ControlGroup {
    limit: PathBuf,
    usage: PathBuf,
}

/// The control group of the process, and all ancestors of this group.
fn control_groups(root: &Path) -> Vec<ControlGroup> {
    let own = std::fs::read_to_string(root.join("proc/self/cgroup")).unwrap_or_default();
    let mut groups = Vec::new();
    for line in own.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (mount, limit, usage) = if controllers.is_empty() {
            ("sys/fs/cgroup", "memory.max", "memory.current")
        } else if controllers.split(',').any(|name| name == "memory") {
            ("sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes")
        } else {
            continue;
        };
        for ancestor in Path::new(path.trim_start_matches('/')).ancestors() {
            let directory = root.join(mount).join(ancestor);
            groups.push(ControlGroup { limit: directory.join(limit), usage: directory.join(usage) });
        }
    }
    groups
}

/// The number in a file; `None` if the file is missing or states no limit.
fn number(path: &Path) -> Option<u64> {
    std::fs::read_to_string(path).ok()?.trim().parse().ok()
}

/// A size in a readable unit, such as `37 GiB`.
pub fn in_words(bytes: f64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    let mut size = bytes / 1024.0;
    let mut unit = 0;
    while size >= 1000.0 && unit + 1 < UNITS.len() {
        size /= 1024.0;
        unit += 1;
    }
    let name = UNITS[unit];
    if size < 9.95 { format!("{size:.1} {name}") } else { format!("{size:.0} {name}") }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const GIB: u64 = 1 << 30;

    /// The limits that are read from a directory with only these files.
    fn memory(files: &[(&str, &str)]) -> Option<Memory> {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        Memory::read(root.path())
    }

    const MEMINFO: (&str, &str) =
        ("proc/meminfo", "MemTotal:       16777216 kB\nMemFree: 1 kB\nMemAvailable:    8388608 kB\n");

    #[test]
    fn the_smallest_limit_counts() {
        assert_eq!(memory(&[]), None);
        let machine = Memory { limit: 16 * GIB, available: 8 * GIB, bound: Bound::Machine };
        assert_eq!(memory(&[MEMINFO]), Some(machine));
        let unlimited = [
            MEMINFO,
            ("proc/self/cgroup", "0::/a/b\n"),
            ("sys/fs/cgroup/a/memory.max", "max\n"),
            (
                "proc/self/limits",
                "Limit  Soft Limit  Hard Limit  Units\nMax address space  unlimited  unlimited  bytes\n",
            ),
        ];
        assert_eq!(memory(&unlimited), Some(machine));
        let container = [
            MEMINFO,
            ("proc/self/cgroup", "0::/a/b\n"),
            ("sys/fs/cgroup/a/memory.max", "4294967296\n"),
            ("sys/fs/cgroup/a/memory.current", "1073741824\n"),
            ("sys/fs/cgroup/a/b/memory.max", "8589934592\n"),
        ];
        let control_group = Memory { limit: 4 * GIB, available: 3 * GIB, bound: Bound::ControlGroup };
        assert_eq!(memory(&container), Some(control_group));
        let older = [
            MEMINFO,
            ("proc/self/cgroup", "3:cpu:/x\n2:hugetlb,memory:/x\n"),
            ("sys/fs/cgroup/memory/x/memory.limit_in_bytes", "4294967296\n"),
        ];
        assert_eq!(memory(&older).unwrap().limit, 4 * GIB);
        let ulimit = [MEMINFO, ("proc/self/limits", "Max address space  2147483648  unlimited  bytes\n")];
        let process = Memory { limit: 2 * GIB, available: 2 * GIB, bound: Bound::AddressSpace };
        assert_eq!(memory(&ulimit), Some(process));
        let status = ("proc/self/status", "VmPeak:  900000 kB\nVmSize:  524288 kB\n");
        let in_use = Memory { available: 3 * GIB / 2, ..process };
        assert_eq!(memory(&[ulimit[0], ulimit[1], status]), Some(in_use));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_machine_has_memory() {
        let memory = Memory::this_machine().unwrap();
        assert!(memory.available <= memory.limit && memory.limit > 1 << 24, "{memory:?}");
        let (resident, peak) = (resident().unwrap(), peak().unwrap());
        assert!(1 << 20 < resident && resident <= peak && peak < memory.limit, "{resident} {peak}");
    }

    #[test]
    fn sizes_as_a_person_would_say_them() {
        let size = |gib: f64| in_words(gib * GIB as f64);
        assert_eq!(size(37.2), "37 GiB");
        assert_eq!(size(1.55), "1.6 GiB");
        assert_eq!(size(0.5), "512 MiB");
        assert_eq!(size(4000.0), "3.9 TiB");
    }
}
