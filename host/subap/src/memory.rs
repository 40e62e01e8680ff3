//! Memory budget of a run. It covers the whole process, including the program's own needs.
//!
//! | part | of `--memory SIZE` |
//! |---|---|
//! | the program | [`PROGRAM_BYTES`] and [`THREAD_BYTES`] a thread |
//! | pictures | an eighth of the rest, within [`PICTURE_BYTES`] |
//! | work | the remainder: images, samples, scratch |
//!
//! SIZE is limited to the memory of the machine, of its container, and of the address-space limit (`ulimit -v`). Work that does not
//! fit is refused before it starts.

use anyhow::bail;
use subaperture::focus::{FormError, machine};
use subaperture::phase_history::ReadError;

use crate::failure::Usage;
use crate::{advice, text};

/// Memory of code, tables, file buffers and allocator, bytes.
const PROGRAM_BYTES: u64 = 18 << 20;
/// Memory per thread: its stack and its allocator arena, bytes.
const THREAD_BYTES: u64 = 1 << 20;
/// Minimum and maximum memory for the picture of an image, bytes.
const PICTURE_BYTES: (u64, u64) = (4 << 20, 64 << 20);
/// Memory for the pictures of a small image, bytes per pixel: levels, colours and the compressed file.
const PIXEL_BYTES: u64 = 32;

/// Minimum memory for work, bytes.
const MIN_WORK_BYTES: u64 = 4 << 20;

/// Division of a run's memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Memory {
    /// Total memory of the process, bytes.
    pub(crate) total_bytes: u64,
    /// Memory for images, samples and scratch, bytes.
    pub(crate) work_bytes: u64,
    /// Memory for drawing pictures, bytes.
    pub(crate) picture_bytes: u64,
    /// Requested memory, if the machine has less, bytes.
    pub(crate) requested_bytes: Option<u64>,
}

impl Memory {
    /// Divide the requested memory, by default half of the machine's.
    ///
    /// # Errors
    /// If it is less than the program's minimum.
    pub(crate) fn new(requested: Option<u64>, threads: usize) -> anyhow::Result<Self> {
        let has = machine::memory_bytes(threads);
        let total_bytes = requested.unwrap_or(has / 2).min(has);
        let own = PROGRAM_BYTES + THREAD_BYTES * threads as u64;
        let least = own + PICTURE_BYTES.0 + MIN_WORK_BYTES;
        if total_bytes < least {
            let needs = format!(
                "with {threads} threads the program itself takes {}; the minimum is {}",
                text::bytes(own.into()),
                text::bytes(least.into())
            );
            match requested {
                Some(requested) if requested < least => {
                    let requested = text::bytes(requested.into());
                    let fault =
                        format!("--memory {requested}: {needs}: give more, or fewer --threads");
                    return Err(Usage(fault).into());
                }
                _ => bail!(
                    "available memory is {}; {needs}: raise the limit (ulimit -v), or give fewer \
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
            requested_bytes: requested.filter(|&requested| requested > has),
        })
    }

    /// Memory of the program itself and of drawing, bytes.
    pub(crate) fn own_bytes(&self) -> u64 {
        self.total_bytes - self.work_bytes
    }

    /// Memory of the program and of drawing pictures of an image of `pixels` pixels, bytes. Pictures of a small image take less than
    /// their budget.
    pub(crate) fn own_bytes_for(&self, pixels: u64) -> u64 {
        let program_bytes = self.own_bytes().saturating_sub(self.picture_bytes);
        program_bytes + self.picture_bytes.min(PIXEL_BYTES.saturating_mul(pixels))
    }

    /// Add the division of the memory to an error about missing memory.
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
            "{} (of {total} of memory, {work} are for images and samples, the rest is for the program)",
            advice::one_line(&error)
        )
    }
}
