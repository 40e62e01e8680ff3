//! Memory available on this machine.

use std::{fs, thread};

/// Address space that the system allocator reserves per thread, bytes.
const HEAP_BYTES: u64 = 64 << 20;
/// Threads in addition to the workers: main thread, readers, signal and progress threads.
const OTHER_THREADS: usize = 4;

/// Default memory limit, bytes: half of the available memory.
pub fn default_bytes() -> u64 {
    memory_bytes(cores()) / 2
}

/// Memory available to `threads` worker threads, bytes: the smallest of installed memory, container limit and remaining address
/// space; 4 GiB if no limit is known.
pub fn memory_bytes(threads: usize) -> u64 {
    let number = |path: &str| fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    [
        kibibytes("/proc/meminfo", "MemTotal:"),
        number("/sys/fs/cgroup/memory.max"),
        number("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
        address_space(threads),
    ]
    .into_iter()
    .flatten()
    .min()
    .unwrap_or(4 << 30)
}

/// Address space available under a limit, bytes.
fn address_space(threads: usize) -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    // Mappings of the program file count as well.
    let taken = kibibytes("/proc/self/status", "VmSize:").unwrap_or(0);
    // The allocator briefly maps twice the heap size: one more heap.
    let heaps = (threads + OTHER_THREADS).min(8 * cores()) + 1;
    Some(without_heaps(limit.saturating_sub(taken), heaps as u64))
}

/// Share of `free` address space available when up to `heaps` threads have a heap each. A thread gets its own heap while
/// space remains, and shares the main heap afterwards. Half of the rest allows for fragmentation.
fn without_heaps(free: u64, heaps: u64) -> u64 {
    (free - HEAP_BYTES * heaps.min(free / HEAP_BYTES)) / 2
}

fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Peak memory of the process, bytes; `None` where the system does not report it.
pub fn peak_bytes() -> Option<u64> {
    kibibytes("/proc/self/status", "VmHWM:")
}

fn kibibytes(path: &str, label: &str) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(label))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heaps_share_limited_address_space() {
        let mib = |n: u64| n << 20;
        assert_eq!(without_heaps(mib(40), 6), mib(20));
        assert_eq!(without_heaps(mib(270), 6), mib(7));
        assert_eq!(without_heaps(mib(584), 6), mib(100));
    }
}
