//! ARM MPS2 board with FPGA image AN500, as emulated by QEMU's machine `mps2-an500`.
//!
//! LED 0 at 0x40028000, UART0 (the link, without the feature `ethernet`) at 0x40004000, UART1 (the log) at 0x40005000, UART2
//! (the front end) at 0x40006000, timer 0 at 0x40000000 and the watchdog at 0x40008000 are ARM CMSDK peripherals (DDI
//! 0479), clocked at 25 MHz. Differences of the emulation: the UART
//! has no bit rate (a byte is sent as fast as the other end accepts it), and time follows the host's clock unless `-icount`
//! ties it to instructions. The core's cycle counter (DWT) is not emulated; the timer replaces it.
//!
//! The receiver holds one byte. QEMU delivers the next byte only after it was read, so nothing is lost however slowly a
//! program reads. On the real board a program has the duration of one byte.

use core::convert::Infallible;
use core::sync::atomic::{AtomicBool, Ordering};

use embedded_hal::digital::{self, OutputPin};

use super::cmsdk::{CLOCK_HZ, Registers, timer};
#[cfg(feature = "ethernet")]
use super::ethernet::TcpLink as Link;
use super::interface::Board;
use super::serial::Uart;
#[cfg(not(feature = "ethernet"))]
use super::serial::Uart as Link;
use crate::front_end::FrameStream;

/// MPS2 board with FPGA image AN500.
pub struct An500 {
    link: Link,
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
    Some(FrameStream::new(Uart::of_front_end(), buffer))
}

impl Board for An500 {
    type Link = Link;
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
        let link = Link::start()?;
        let timer = Registers(0x4000_0000);
        timer.write(timer::RELOAD, u32::MAX);
        timer.write(timer::VALUE, u32::MAX);
        timer.write(timer::CTRL, timer::ENABLE);
        Some(Self {
            link,
            light: Light(Registers(0x4002_8000)),
            timer,
            watchdog: Registers(0x4000_8000),
        })
    }

    fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    fn light(&mut self) -> &mut Light {
        &mut self.light
    }

    fn wait(&mut self) {
        self.link.wait();
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

/// LED register, one bit per LED.
const FPGA_LEDS: usize = 0x0;

mod watchdog {
    pub(super) const LOAD: usize = 0x0;
    pub(super) const CONTROL: usize = 0x8;
    pub(super) const INTCLR: usize = 0xc;
    pub(super) const LOCK: usize = 0xc00;
    pub(super) const UNLOCK: u32 = 0x1acc_e551;
    pub(super) const INTERRUPT: u32 = 1 << 0;
    pub(super) const RESET: u32 = 1 << 1;
}
