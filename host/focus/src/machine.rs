//! What memory this machine has.

use std::{fs, thread};

/// Address space that the system's allocator keeps for each thread, whether used or not.
const HEAP_BYTES: u64 = 64 << 20;
/// Threads beside those that work: the program's first, its readers, what watches for signals and tells of progress.
const OTHER_THREADS: usize = 4;

/// Bytes that work may take unless told otherwise: half of what the machine has.
pub fn default_bytes() -> u64 {
    memory_bytes(cores()) / 2
}

/// What the machine has for work by `threads` threads: what is installed, its container allows, or the limit on the
/// address space leaves, whichever is least, bytes; 4 GiB where nothing tells.
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

/// What a limit on the address space leaves of it.
fn address_space(threads: usize) -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    // Maps of the program's file count as well.
    let taken = kibibytes("/proc/self/status", "VmSize:").unwrap_or(0);
    // A heap is cut from twice its size: one more for a moment.
    let heaps = (threads + OTHER_THREADS).min(8 * cores()) + 1;
    Some(beside_heaps(limit.saturating_sub(taken), heaps as u64))
}

/// What `free` bytes of address space leave once up to `heaps` threads have a heap of their own: a thread gets one as
/// long as there is room for it, and shares the first thread's from there on. Half of it, for what lies in pieces.
fn beside_heaps(free: u64, heaps: u64) -> u64 {
    (free - HEAP_BYTES * heaps.min(free / HEAP_BYTES)) / 2
}

fn cores() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// The most that the process held at any time, bytes; `None` where the system does not tell.
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
    fn heaps_take_what_there_is_room_for() {
        let mib = |n: u64| n << 20;
        assert_eq!(beside_heaps(mib(40), 6), mib(20));
        assert_eq!(beside_heaps(mib(270), 6), mib(7));
        assert_eq!(beside_heaps(mib(584), 6), mib(100));
    }
}
