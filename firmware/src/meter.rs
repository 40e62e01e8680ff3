//! Execution cost: instruction count on the emulated board, cycle count on a real one.
//!
//! The emulator has no cycle counter. Under `-icount shift=5` each instruction takes 32 ns, and the board's timer counts at
//! 25 MHz: 1.25 ticks per instruction. The meter does not rely on this ratio: it calibrates ticks against a loop with a
//! known number of instructions. Without `-icount` ticks measure host time and are meaningless. No interrupts are taken, so
//! repeated measurements agree.

use core::arch::asm;

use crate::board::{Board, Current};

/// Unit of the meter's counts.
pub const UNIT: &str = if cfg!(feature = "board-an500") {
    "instructions"
} else {
    "cycles"
};

/// Execute `2 rounds` instructions plus those of the call.
#[inline(never)]
pub fn spin(rounds: u32) {
    // SAFETY: counts a register down; touches no memory.
    unsafe {
        asm!("2: subs {0}, {0}, #1", "bne 2b", inout(reg) rounds => _, options(nomem, nostack));
    }
}

/// Converts timer ticks to instructions, or to cycles where the timer counts them.
#[derive(Clone, Copy, Debug)]
pub struct Meter {
    known_instructions: u64,
    known_ticks: u64,
    empty_ticks: u32,
}

impl Meter {
    /// Create a meter and calibrate its own overhead.
    pub fn new(board: &Current) -> Self {
        let mut meter = Self {
            known_instructions: 1,
            known_ticks: 1,
            empty_ticks: 0,
        };
        meter.empty_ticks = meter.ticks(board, || ()).0;
        if cfg!(feature = "board-an500") {
            let rounds = 1_000_000;
            meter.known_ticks = u64::from(meter.ticks(board, || spin(rounds)).0.max(1));
            meter.known_instructions = 2 * u64::from(rounds);
        }
        meter
    }

    fn ticks<T>(&self, board: &Current, work: impl FnOnce() -> T) -> (u32, T) {
        let start = board.ticks();
        let result = work();
        let ticks = board.ticks().wrapping_sub(start);
        (ticks.saturating_sub(self.empty_ticks), result)
    }

    /// Measure the cost of `work`. Returns the count and the result of `work`.
    #[inline(never)]
    pub fn measure<T>(&self, board: &Current, work: impl FnOnce() -> T) -> (u64, T) {
        let (ticks, result) = self.ticks(board, work);
        let count = u64::from(ticks) * self.known_instructions / self.known_ticks.max(1);
        (count, result)
    }
}
