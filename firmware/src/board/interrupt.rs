//! Interrupt numbers of the AN500.

/// Interrupt of a peripheral.
#[derive(Clone, Copy)]
pub(super) struct Interrupt(pub(super) u16);

// SAFETY: the numbers are those of the AN500 interrupt table and never change.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self.0
    }
}
