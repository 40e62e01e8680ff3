//! ST Nucleo-H743ZI2 with an STM32H743ZI at 400 MHz. Compiled and measured for size; not yet run on the board.
//!
//! Link: USART3 (`usart.rs`), or USB with the feature `usb` (`usb.rs`).
//!
//! Clocks: the internal 64 MHz oscillator and a PLL (64 / 4 * 50 / 2) give 400 MHz, half of it for the buses. Every revision
//! of the part supports this at voltage scale 1.

#[cfg(feature = "spi-front-end")]
use core::num::NonZeroU16;

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::rcc;
use embassy_stm32::wdg::IndependentWatchdog;
#[cfg(feature = "spi-front-end")]
use embassy_stm32::{
    gpio::{Input, Pull},
    mode::Blocking,
    spi::{self, Spi, mode::Master},
};
#[cfg(feature = "spi-front-end")]
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};

use super::interface::Board;
#[cfg(not(feature = "usb"))]
use super::usart::SerialLink as Link;
#[cfg(feature = "usb")]
use super::usb::UsbLink as Link;
#[cfg(feature = "spi-front-end")]
use crate::front_end::{Coding, SpiConverter};

/// Nucleo-H743ZI2 board.
pub struct H743 {
    light: Output<'static>,
    link: Link,
    watchdog: IndependentWatchdog<'static, IWDG1>,
    watching: bool,
    #[cfg(feature = "spi-front-end")]
    converter: Option<Converter>,
}

/// Bus, chip select and pulse signal of the converter.
#[cfg(feature = "spi-front-end")]
type Converter = (
    Spi<'static, Blocking, Master>,
    Output<'static>,
    Input<'static>,
);

/// Front end with a converter on SPI1.
#[cfg(feature = "spi-front-end")]
pub type SpiFrontEnd<'a> = SpiConverter<
    'a,
    ExclusiveDevice<Spi<'static, Blocking, Master>, Output<'static>, NoDelay>,
    Input<'static>,
>;

/// Front end: a converter in two's complement, read sample by sample. Arduino connector: D13 (PA5) clock, D12 (PA6) data, D10
/// (PD14) chip select, D9 (PD15) high while a pulse waits. `None` if it was taken before.
#[cfg(feature = "spi-front-end")]
pub fn front_end<'a>(board: &mut H743, buffer: &'a mut [u8]) -> Option<SpiFrontEnd<'a>> {
    let (bus, select, ready) = board.converter.take()?;
    let device = ExclusiveDevice::new_no_delay(bus, select).ok()?;
    let coding = Coding::TwosComplement;
    Some(SpiConverter::new(
        device,
        ready,
        coding,
        NonZeroU16::MIN,
        buffer,
    ))
}

impl Board for H743 {
    type Link = Link;
    type Light = Output<'static>;
    const NAME: &'static str = "nucleo-h743zi2";
    const TICKS_HZ: u32 = 400_000_000;
    const MAX_STEP_US: Option<u32> = Some(Link::MAX_STEP_US);
    const WATCHDOG_MS: u32 = 2000;

    fn take() -> Option<Self> {
        let buffers = Link::buffers()?;
        let mut core = cortex_m::Peripherals::take()?;
        core.SCB.enable_icache();
        // No DMA is used, so the data cache needs no maintenance.
        core.SCB.enable_dcache(&mut core.CPUID);
        core.DCB.enable_trace();
        cortex_m::peripheral::DWT::unlock();
        core.DWT.enable_cycle_counter();

        let board = embassy_stm32::init(clocks());
        #[cfg(not(feature = "usb"))]
        let link = Link::start(buffers, board.USART3, board.PD9, board.PD8)?;
        #[cfg(feature = "usb")]
        let link = Link::start(buffers, board.USB_OTG_FS, board.PA11, board.PA12)?;
        Some(Self {
            // LD1, the green LED.
            light: Output::new(board.PB0, Level::Low, Speed::Low),
            link,
            watchdog: IndependentWatchdog::new(board.IWDG1, Self::WATCHDOG_MS * 1000),
            watching: false,
            #[cfg(feature = "spi-front-end")]
            converter: Some((
                Spi::new_blocking_rxonly(board.SPI1, board.PA5, board.PA6, converter_bus()),
                Output::new(board.PD14, Level::High, Speed::VeryHigh),
                Input::new(board.PD15, Pull::Down),
            )),
        })
    }

    fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    fn light(&mut self) -> &mut Output<'static> {
        &mut self.light
    }

    fn wait(&mut self) {
        self.link.wait();
    }

    fn ticks(&self) -> u32 {
        cortex_m::peripheral::DWT::cycle_count()
    }

    fn feed_watchdog(&mut self) {
        if self.watching {
            self.watchdog.pet();
        } else {
            self.watchdog.unleash();
            self.watching = true;
        }
    }
}

/// Bus of the converter: mode 0, 16 MHz.
#[cfg(feature = "spi-front-end")]
fn converter_bus() -> spi::Config {
    let mut config = spi::Config::default();
    config.frequency = embassy_stm32::time::Hertz(16_000_000);
    config
}

fn clocks() -> embassy_stm32::Config {
    use rcc::{
        AHBPrescaler, APBPrescaler, HSIPrescaler, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
    };
    let mut config = embassy_stm32::Config::default();
    config.rcc.hsi = Some(HSIPrescaler::DIV1);
    config.rcc.pll1 = Some(Pll {
        source: PllSource::HSI,
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL50,
        fracn: None,
        divp: Some(PllDiv::DIV2),
        divq: None,
        divr: None,
    });
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV2;
    config.rcc.apb1_pre = APBPrescaler::DIV2;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config.rcc.apb3_pre = APBPrescaler::DIV2;
    config.rcc.apb4_pre = APBPrescaler::DIV2;
    config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
    // The clock of SPI1: 64 MHz.
    #[cfg(feature = "spi-front-end")]
    {
        config.rcc.mux.persel = rcc::mux::Persel::HSI;
        config.rcc.mux.spi123sel = rcc::mux::Saisel::PER;
    }
    Link::add_clock(&mut config.rcc);
    config
}
