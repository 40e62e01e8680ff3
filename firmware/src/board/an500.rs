//! ARM MPS2 board with FPGA image AN500, as emulated by QEMU's machine `mps2-an500`.
//!
//! LED 0 at 0x40028000, UART0 (the link) at 0x40004000, UART1 (the log) at 0x40005000, UART2 (the front end) at 0x40006000, timer 0 at 0x40000000 and the
//! watchdog at 0x40008000 are ARM CMSDK peripherals (DDI 0479), clocked at 25 MHz. Differences of the emulation: the UART
//! has no bit rate (a byte is sent as fast as the other end accepts it), and time follows the host's clock unless `-icount`
//! ties it to instructions. The core's cycle counter (DWT) is not emulated; the timer replaces it.
//!
//! The receiver holds one byte. QEMU delivers the next byte only after it was read, so nothing is lost however slowly a
//! program reads. On the real board a program has the duration of one byte.

use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::NVIC;
use embedded_hal::digital::{self, OutputPin};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};

use super::cmsdk::{BAUD, CLOCK_HZ, Registers};
use super::interface::Board;
use super::uart;
use crate::front_end::FrameStream;

/// MPS2 board with FPGA image AN500.
#[derive(Debug)]
pub struct An500 {
    uart: Uart,
    light: Light,
    timer: Registers,
    watchdog: Registers,
}

static TAKEN: AtomicBool = AtomicBool::new(false);
static FRONT_END_TAKEN: AtomicBool = AtomicBool::new(false);

/// Front end: frames on UART2. `None` if it was taken before.
pub fn front_end<'a>(_: &mut An500, buffer: &'a mut [u8]) -> Option<FrameStream<'a, Uart>> {
    if FRONT_END_TAKEN.swap(true, Ordering::Relaxed) {
        return None;
    }
    let uart = Uart(Registers(0x4000_6000));
    uart.0.write(uart::BAUDDIV, CLOCK_HZ / BAUD);
    uart.0.write(uart::CTRL, uart::RX_ENABLE);
    Some(FrameStream::new(uart, buffer))
}

impl Board for An500 {
    type Link = Uart;
    type Light = Light;
    const NAME: &'static str = "mps2-an500";
    const TICKS_HZ: u32 = CLOCK_HZ;
    // Its time is that of the emulator's computer.
    const MAX_STEP_US: Option<u32> = None;
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
        // Interrupts only end a sleep: they are masked and never taken.
        cortex_m::interrupt::disable();
        for interrupt in [uart::RX, uart::TX] {
            // SAFETY: no code relies on these interrupts being disabled; they are not taken.
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
        // The timer counts down.
        !self.timer.read(timer::VALUE)
    }

    fn feed_watchdog(&mut self) {
        // The first expiry is a non-maskable interrupt, which logs and resets (`fault`). If that fails, the second expiry
        // resets the board by itself.
        self.watchdog.write(watchdog::LOCK, watchdog::UNLOCK);
        self.watchdog
            .write(watchdog::LOAD, CLOCK_HZ / 1000 * Self::WATCHDOG_MS);
        self.watchdog
            .write(watchdog::CONTROL, watchdog::INTERRUPT | watchdog::RESET);
        self.watchdog.write(watchdog::INTCLR, 1);
        self.watchdog.write(watchdog::LOCK, 0);
    }
}

/// User LED 0, one bit of the FPGA registers.
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

/// UART: UART0 is the serial link, UART2 the front end. The interrupts that end a sleep are those of UART0.
#[derive(Debug)]
pub struct Uart(Registers);

/// Error of the serial link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UartError {
    /// A byte was received before the previous one was read, and is lost.
    Overrun,
}

impl core::fmt::Display for UartError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("UART overrun: a byte was received before the previous one was read")
    }
}

impl core::error::Error for UartError {}

impl embedded_io::Error for UartError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl Uart {
    /// Sleep until the masked state equals `wanted`, and return the state.
    ///
    /// Polling the register would also work, but would occupy a processor of the host.
    fn wait(&mut self, mask: u32, wanted: u32) -> u32 {
        loop {
            // Clear pending interrupts first, then check: an interrupt after the check ends the sleep.
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

/// LED register, one bit per LED.
const FPGA_LEDS: usize = 0x0;

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
