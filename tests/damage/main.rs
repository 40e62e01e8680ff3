//! Damaged files and arbitrary bytes: no panic, bounded time, and memory within the documented limits.
//!
//! A separate executable because its allocator counts, with one test at a time because the count is that of the process.

mod fuzz_targets;
mod gotcha;
mod gotcha_gmti;

use std::sync::{Mutex, MutexGuard, PoisonError};

use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Lock held by a test from its beginning to its end.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}
