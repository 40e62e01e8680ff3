//! The memory that a run may take: all of the process, of which a part is the program's own.
//!
//! | part | of `--memory SIZE` |
//! |---|---|
//! | the program | [`PROGRAM_BYTES`] and [`THREAD_BYTES`] a thread |
//! | pictures | an eighth of the rest, within [`PICTURE_BYTES`] |
//! | work | what is left: images, samples, scratch |
//!
//! SIZE is never more than the machine has, its container allows, or the limit on the address space (`ulimit -v`)
//! leaves: what is refused before the work is not an abort within it.

use std::fs;

use anyhow::bail;
use subaperture::focus::FormError;
use subaperture::phase_history::ReadError;

use crate::failure::Usage;
use crate::text;

/// Code, tables, buffers of files; what the allocator keeps.
const PROGRAM_BYTES: u64 = 16 << 20;
/// A thread's stack and the allocator's for it.
const THREAD_BYTES: u64 = 1 << 20;
/// Least and most for the picture of an image.
const PICTURE_BYTES: (u64, u64) = (4 << 20, 64 << 20);
/// Least for work.
const LEAST_WORK_BYTES: u64 = 4 << 20;

/// How a run's memory is shared out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Memory {
    /// All of it.
    pub(crate) total_bytes: u64,
    /// For images, samples and scratch.
    pub(crate) work_bytes: u64,
    /// For drawing.
    pub(crate) picture_bytes: u64,
    /// What was asked, where the machine has less.
    pub(crate) asked_bytes: Option<u64>,
}

impl Memory {
    /// Of `--memory asked`, or half of what the machine has.
    ///
    /// # Errors
    /// If it is less than the program itself takes.
    pub(crate) fn new(asked: Option<u64>, threads: usize) -> anyhow::Result<Self> {
        let has = machine_bytes();
        let total_bytes = asked.unwrap_or(has / 2).min(has);
        let own = PROGRAM_BYTES + THREAD_BYTES * threads as u64;
        let least = own + PICTURE_BYTES.0 + LEAST_WORK_BYTES;
        if total_bytes < least {
            let needs = format!(
                "with {threads} threads the program itself takes {} and needs {} at the least",
                text::bytes(own.into()),
                text::bytes(least.into())
            );
            match asked {
                Some(asked) if asked < least => {
                    let asked = text::bytes(asked.into());
                    let what = format!("--memory {asked}: {needs}: give more, or fewer --threads");
                    return Err(Usage(what).into());
                }
                _ => bail!(
                    "this machine leaves {} of memory, and {needs}: raise its limit (ulimit -v), or give fewer \
                     --threads",
                    text::bytes(total_bytes.into())
                ),
            }
        }
        let rest = total_bytes - own;
        let picture_bytes = (rest / 8).clamp(PICTURE_BYTES.0, PICTURE_BYTES.1);
        Ok(Self {
            total_bytes,
            work_bytes: rest - picture_bytes,
            picture_bytes,
            asked_bytes: asked.filter(|&asked| asked > has),
        })
    }

    /// What the program itself takes, and drawing.
    pub(crate) fn own_bytes(&self) -> u64 {
        self.total_bytes - self.work_bytes
    }

    /// `error` with where the memory that it misses has gone.
    pub(crate) fn explain(&self, error: anyhow::Error) -> anyhow::Error {
        let of_memory = error.chain().any(|cause| {
            matches!(cause.downcast_ref(), Some(FormError::Memory { .. }))
                || matches!(cause.downcast_ref(), Some(ReadError::Memory { .. }))
        });
        if !of_memory {
            return error;
        }
        let [total, work] = [self.total_bytes, self.work_bytes].map(|n| text::bytes(n.into()));
        anyhow::anyhow!(
            "{error:#} (of {total} of memory, {work} are for the work, the rest is the program's own)"
        )
    }
}

/// What the machine has, its container allows, or the limit on the address space leaves, whichever is least; 4 GiB
/// where nothing tells.
fn machine_bytes() -> u64 {
    let number = |path: &str| fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    [
        kibibytes("/proc/meminfo", "MemTotal:"),
        number("/sys/fs/cgroup/memory.max"),
        number("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
        address_space(),
    ]
    .into_iter()
    .flatten()
    .min()
    .unwrap_or(4 << 30)
}

/// What a limit on the address space leaves of it.
fn address_space() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    // Maps of the program's file count as well, and a heap for each thread is reserved before it is used.
    let taken = kibibytes("/proc/self/status", "VmSize:").unwrap_or(0);
    Some(limit.saturating_sub(taken) / 2)
}

/// The most that the process held at any time.
pub(crate) fn peak_bytes() -> Option<u64> {
    kibibytes("/proc/self/status", "VmHWM:")
}

fn kibibytes(path: &str, label: &str) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(label))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
