//! Damaged files and bytes of any kind: no panic, bounded time, no memory beyond what is stated.
//!
//! An executable of its own, for its allocator counts, and one test at a time, for the count is the process's.

mod fuzz_targets;
mod gotcha;

use std::sync::{Mutex, MutexGuard, PoisonError};

use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Held by a test from its beginning to its end.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}
