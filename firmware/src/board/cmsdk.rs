//! ARM CMSDK peripherals (DDI 0479) of the AN500: registers, and the log on UART1.

#[cfg(not(defmt_log))]
use super::uart;

pub(super) const CLOCK_HZ: u32 = 25_000_000;
pub(super) const BAUD: u32 = 921_600;

/// Registers and bits of a timer.
pub(super) mod timer {
    pub(in crate::board) const CTRL: usize = 0x0;
    pub(in crate::board) const VALUE: usize = 0x4;
    pub(in crate::board) const RELOAD: usize = 0x8;
    pub(in crate::board) const ENABLE: u32 = 1 << 0;
    #[cfg(feature = "ethernet")]
    pub(in crate::board) const INTCLEAR: usize = 0xc;
    #[cfg(feature = "ethernet")]
    pub(in crate::board) const INTERRUPT: u32 = 1 << 3;
}

/// Write a line of log to UART1.
#[cfg(not(defmt_log))]
pub(super) fn line(message: core::fmt::Arguments<'_>) {
    let registers = Registers(0x4000_5000);
    // Set up every time, since a line may be logged before any other initialisation.
    registers.write(uart::BAUDDIV, CLOCK_HZ / BAUD);
    registers.write(uart::CTRL, uart::TX_ENABLE);
    // Cannot fail: it waits until there is room.
    let _ = core::fmt::write(&mut Log(registers), format_args!("{message}\n"));
}

/// UART1 as a text output.
#[cfg(not(defmt_log))]
struct Log(Registers);

#[cfg(not(defmt_log))]
impl core::fmt::Write for Log {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for byte in text.bytes() {
            while self.0.read(uart::STATE) & uart::TX_FULL != 0 {}
            self.0.write(uart::DATA, u32::from(byte));
        }
        Ok(())
    }
}

/// 32-bit registers of a peripheral.
#[derive(Debug)]
pub(super) struct Registers(pub(super) usize);

impl Registers {
    pub(super) fn read(&self, offset: usize) -> u32 {
        // SAFETY: only the files of this board create these, from peripheral addresses; `offset` is one of their constants,
        // aligned and within the peripheral.
        unsafe { ((self.0 + offset) as *const u32).read_volatile() }
    }

    pub(super) fn write(&self, offset: usize, value: u32) {
        // SAFETY: as above.
        unsafe { ((self.0 + offset) as *mut u32).write_volatile(value) }
    }
}
