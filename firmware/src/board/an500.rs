//! ARM's MPS2 with FPGA image AN500, as QEMU's machine `mps2-an500` emulates it.
//!
//! LED 0 at 0x40028000, UART0 (the link) at 0x40004000, UART1 (the log) at 0x40005000, timer 0 at 0x40000000 and the watchdog at 0x40008000 are ARM's CMSDK parts
//! (DDI 0479); all run at the board's 25 MHz. What the emulator leaves out: the UART has no speed (a byte
//! goes as fast as the other end takes it), and time passes with the host's clock unless `-icount`
//! ties it to instructions. The core's own cycle counter (DWT) is not emulated; the timer stands in.
//!
//! The receiver holds one byte. QEMU gives it the next only when that one was read, so nothing is lost
//! however slowly a program reads; on the real board a program has one byte's time.

use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use embedded_hal::digital::{self, OutputPin};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};

use super::Board;

const CLOCK_HZ: u32 = 25_000_000;
const BAUD: u32 = 921_600;

/// The board.
#[derive(Debug)]
pub struct An500 {
    uart: Uart,
    light: Light,
    timer: Registers,
    watchdog: Registers,
}

static TAKEN: AtomicBool = AtomicBool::new(false);

impl Board for An500 {
    type Link = Uart;
    type Light = Light;
    const NAME: &'static str = "mps2-an500";
    const TICKS_HZ: u32 = CLOCK_HZ;
    const WATCHDOG_MS: u32 = 2000;

    fn take() -> Option<Self> {
        if TAKEN.swap(true, Ordering::Relaxed) {
            return None;
        }
        let uart = Uart(Registers(0x4000_4000));
        uart.0.write(uart::BAUDDIV, CLOCK_HZ / BAUD);
        uart.0.write(
            uart::CTRL,
            uart::TX_ENABLE | uart::RX_ENABLE | uart::TX_INTERRUPT | uart::RX_INTERRUPT,
        );
        // Interrupts end a sleep and do nothing else: masked, they are never taken.
        cortex_m::interrupt::disable();
        for interrupt in [uart::RX, uart::TX] {
            // SAFETY: nothing relies on these being off; they are not taken.
            unsafe { NVIC::unmask(interrupt) };
        }
        let timer = Registers(0x4000_0000);
        timer.write(timer::RELOAD, u32::MAX);
        timer.write(timer::VALUE, u32::MAX);
        timer.write(timer::CTRL, timer::ENABLE);
        Some(Self {
            uart,
            light: Light(Registers(0x4002_8000)),
            timer,
            watchdog: Registers(0x4000_8000),
        })
    }

    fn link(&mut self) -> &mut Uart {
        &mut self.uart
    }

    fn light(&mut self) -> &mut Light {
        &mut self.light
    }

    fn wait(&mut self) {
        self.uart.wait(uart::RX_FULL, uart::RX_FULL);
    }

    fn ticks(&self) -> u32 {
        // The timer runs down.
        !self.timer.read(timer::VALUE)
    }

    fn feed_watchdog(&mut self) {
        // The first expiry is a non-maskable interrupt, which logs and resets (`fault`); should that
        // fail, the second resets by itself.
        self.watchdog.write(watchdog::LOCK, watchdog::UNLOCK);
        self.watchdog
            .write(watchdog::LOAD, CLOCK_HZ / 1000 * Self::WATCHDOG_MS);
        self.watchdog
            .write(watchdog::CONTROL, watchdog::INTERRUPT | watchdog::RESET);
        self.watchdog.write(watchdog::INTCLR, 1);
        self.watchdog.write(watchdog::LOCK, 0);
    }
}

/// User LED 0, a bit of the FPGA's own registers.
#[derive(Debug)]
pub struct Light(Registers);

impl digital::ErrorType for Light {
    type Error = Infallible;
}

impl OutputPin for Light {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.write(FPGA_LEDS, 0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.write(FPGA_LEDS, 1);
        Ok(())
    }
}

/// The serial link, UART0.
#[derive(Debug)]
pub struct Uart(Registers);

/// What the serial link can fail with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UartError {
    /// A byte came before the last one was read; it is lost.
    Overrun,
}

impl core::fmt::Display for UartError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("a byte came before the last one was read")
    }
}

impl core::error::Error for UartError {}

impl embedded_io::Error for UartError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl Uart {
    /// Sleeps until `mask` of the state reads `wanted`; the state.
    ///
    /// A loop that only reads the register works too, but takes a processor of the host for nothing.
    fn wait(&mut self, mask: u32, wanted: u32) -> u32 {
        loop {
            // First forget what was, then look: an interrupt that comes after the look ends the sleep.
            self.0.write(uart::INTCLEAR, u32::MAX);
            NVIC::unpend(uart::RX);
            NVIC::unpend(uart::TX);
            let state = self.0.read(uart::STATE);
            if state & mask == wanted {
                return state;
            }
            cortex_m::asm::wfi();
        }
    }
}

impl ErrorType for Uart {
    type Error = UartError;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, UartError> {
        Ok(self.0.read(uart::STATE) & uart::RX_FULL != 0)
    }
}

impl Read for Uart {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, UartError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let mut state = self.wait(uart::RX_FULL, uart::RX_FULL);
        let mut count = 0;
        for place in buffer {
            if state & uart::RX_OVERRUN != 0 {
                self.0.write(uart::STATE, uart::RX_OVERRUN);
                return Err(UartError::Overrun);
            }
            if state & uart::RX_FULL == 0 {
                break;
            }
            *place = self.0.read(uart::DATA) as u8;
            count += 1;
            state = self.0.read(uart::STATE);
        }
        Ok(count)
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, UartError> {
        Ok(self.0.read(uart::STATE) & uart::TX_FULL == 0)
    }
}

impl Write for Uart {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, UartError> {
        let Some((first, rest)) = buffer.split_first() else {
            return Ok(0);
        };
        self.wait(uart::TX_FULL, 0);
        self.0.write(uart::DATA, u32::from(*first));
        let mut count = 1;
        for byte in rest {
            if self.0.read(uart::STATE) & uart::TX_FULL != 0 {
                break;
            }
            self.0.write(uart::DATA, u32::from(*byte));
            count += 1;
        }
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), UartError> {
        self.wait(uart::TX_FULL, 0);
        Ok(())
    }
}

/// Writes a line of log to UART1.
#[cfg(not(feature = "defmt"))]
pub(super) fn line(message: core::fmt::Arguments<'_>) {
    let registers = Registers(0x4000_5000);
    // Each time, for a line may come before anything was set up.
    registers.write(uart::BAUDDIV, CLOCK_HZ / BAUD);
    registers.write(uart::CTRL, uart::TX_ENABLE);
    // Cannot fail: it waits for room.
    let _ = core::fmt::write(&mut Log(registers), format_args!("{message}\n"));
}

/// UART1, for text.
#[cfg(not(feature = "defmt"))]
struct Log(Registers);

#[cfg(not(feature = "defmt"))]
impl core::fmt::Write for Log {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for byte in text.bytes() {
            while self.0.read(uart::STATE) & uart::TX_FULL != 0 {}
            self.0.write(uart::DATA, u32::from(byte));
        }
        Ok(())
    }
}

/// A peripheral's 32-bit registers.
#[derive(Debug)]
struct Registers(usize);

impl Registers {
    fn read(&self, offset: usize) -> u32 {
        // SAFETY: only `An500::take` and `line` make these, from addresses of peripherals; `offset` is one of
        // the constants below, aligned and within the peripheral.
        unsafe { ((self.0 + offset) as *const u32).read_volatile() }
    }

    fn write(&self, offset: usize, value: u32) {
        // SAFETY: as above.
        unsafe { ((self.0 + offset) as *mut u32).write_volatile(value) }
    }
}

/// LEDs, one a bit.
const FPGA_LEDS: usize = 0x0;

mod uart {
    /// UART0's interrupts.
    #[derive(Clone, Copy)]
    pub(super) struct Interrupt(u16);

    // SAFETY: the numbers are those of the AN500's table and never change.
    unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
        fn number(self) -> u16 {
            self.0
        }
    }

    pub(super) const RX: Interrupt = Interrupt(0);
    pub(super) const TX: Interrupt = Interrupt(1);

    pub(super) const DATA: usize = 0x0;
    pub(super) const STATE: usize = 0x4;
    pub(super) const CTRL: usize = 0x8;
    pub(super) const INTCLEAR: usize = 0xc;
    pub(super) const BAUDDIV: usize = 0x10;
    pub(super) const TX_FULL: u32 = 1 << 0;
    pub(super) const RX_FULL: u32 = 1 << 1;
    pub(super) const RX_OVERRUN: u32 = 1 << 3;
    pub(super) const TX_ENABLE: u32 = 1 << 0;
    pub(super) const RX_ENABLE: u32 = 1 << 1;
    pub(super) const TX_INTERRUPT: u32 = 1 << 2;
    pub(super) const RX_INTERRUPT: u32 = 1 << 3;
}

mod timer {
    pub(super) const CTRL: usize = 0x0;
    pub(super) const VALUE: usize = 0x4;
    pub(super) const RELOAD: usize = 0x8;
    pub(super) const ENABLE: u32 = 1 << 0;
}

mod watchdog {
    pub(super) const LOAD: usize = 0x0;
    pub(super) const CONTROL: usize = 0x8;
    pub(super) const INTCLR: usize = 0xc;
    pub(super) const LOCK: usize = 0xc00;
    pub(super) const UNLOCK: u32 = 0x1acc_e551;
    pub(super) const INTERRUPT: u32 = 1 << 0;
    pub(super) const RESET: u32 = 1 << 1;
}
