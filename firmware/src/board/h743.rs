//! ST Nucleo-H743ZI2 with an STM32H743ZI at 400 MHz. Compiled and measured for size; not yet run on the board.
//!
//! Serial link: USART3 on pins PD8 (TX) and PD9 (RX), which the board's debugger presents to the computer as a serial port;
//! 921 600 baud, 8 data bits, no parity. One interrupt per byte moves bytes between the USART and two ring buffers, so
//! nothing is lost while the program computes: the receive buffer holds 89 ms of the link at full speed. A full buffer drops
//! incoming bytes; the protocol detects it.
//!
//! Clocks: the internal 64 MHz oscillator and a PLL (64 / 4 * 50 / 2) give 400 MHz, half of it for the buses. Every revision
//! of the part supports this at voltage scale 1.

use core::future::Future;
#[cfg(feature = "spi-front-end")]
use core::num::NonZeroU16;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{IWDG1, USART3};
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, rcc};
#[cfg(feature = "spi-front-end")]
use embassy_stm32::{
    gpio::{Input, Pull},
    mode::Blocking,
    spi::{self, Spi, mode::Master},
};
#[cfg(feature = "spi-front-end")]
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use static_cell::ConstStaticCell;

use super::interface::Board;
#[cfg(feature = "spi-front-end")]
use crate::front_end::{Coding, SpiConverter};

const BAUD: u32 = 921_600;

bind_interrupts!(struct Interrupts {
    USART3 => usart::BufferedInterruptHandler<USART3>;
});

const RECEIVE_BYTES: usize = 8192;

static RECEIVED: ConstStaticCell<[u8; RECEIVE_BYTES]> = ConstStaticCell::new([0; RECEIVE_BYTES]);
static TO_SEND: ConstStaticCell<[u8; 2048]> = ConstStaticCell::new([0; 2048]);

/// Nucleo-H743ZI2 board.
pub struct H743 {
    light: Output<'static>,
    link: SerialLink,
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
    type Link = SerialLink;
    type Light = Output<'static>;
    const NAME: &'static str = "nucleo-h743zi2";
    const TICKS_HZ: u32 = 400_000_000;
    // A byte takes ten bits.
    const MAX_STEP_US: Option<u32> = Some(RECEIVE_BYTES as u32 * 10 * 1000 / (BAUD / 1000));
    const WATCHDOG_MS: u32 = 2000;

    fn take() -> Option<Self> {
        let (received, to_send) = (RECEIVED.try_take()?, TO_SEND.try_take()?);
        let mut core = cortex_m::Peripherals::take()?;
        core.SCB.enable_icache();
        // No DMA is used, so the data cache needs no maintenance.
        core.SCB.enable_dcache(&mut core.CPUID);
        core.DCB.enable_trace();
        cortex_m::peripheral::DWT::unlock();
        core.DWT.enable_cycle_counter();

        let board = embassy_stm32::init(clocks());
        let mut config = usart::Config::default();
        config.baudrate = BAUD;
        let uart = BufferedUart::new(
            board.USART3,
            board.PD9,
            board.PD8,
            to_send,
            received,
            Interrupts,
            config,
        );
        let (tx, rx) = uart.ok()?.split();
        Some(Self {
            // LD1, the green LED.
            light: Output::new(board.PB0, Level::Low, Speed::Low),
            link: SerialLink {
                rx,
                tx,
                waiting: None,
            },
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

    fn link(&mut self) -> &mut SerialLink {
        &mut self.link
    }

    fn light(&mut self) -> &mut Output<'static> {
        &mut self.light
    }

    fn wait(&mut self) {
        // Interrupts masked, so that a byte received between the check and the sleep ends the sleep.
        cortex_m::interrupt::free(|_| {
            if matches!(self.link.read_ready(), Ok(false)) {
                cortex_m::asm::wfi();
            }
        });
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
    config.rcc.mux.persel = rcc::mux::Persel::HSI;
    config.rcc.mux.spi123sel = rcc::mux::Saisel::PER;
    config
}

/// Serial link on USART3.
///
/// The driver cannot report whether its ring buffer has room without writing to it. A byte that found no room waits here.
pub struct SerialLink {
    rx: BufferedUartRx<'static>,
    tx: BufferedUartTx<'static>,
    waiting: Option<u8>,
}

impl SerialLink {
    /// Write as much of `buffer` to the ring buffer as fits. `None` if it is full.
    fn offer(&mut self, buffer: &[u8]) -> Result<Option<usize>, usart::Error> {
        // The driver's future keeps no state between polls, so it can be dropped when pending.
        let write = pin!(embedded_io_async::Write::write(&mut self.tx, buffer));
        match write.poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(result) => result.map(Some),
            Poll::Pending => Ok(None),
        }
    }
}

impl ErrorType for SerialLink {
    type Error = usart::Error;
}

impl ReadReady for SerialLink {
    fn read_ready(&mut self) -> Result<bool, usart::Error> {
        self.rx.read_ready()
    }
}

impl Read for SerialLink {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, usart::Error> {
        self.rx.read(buffer)
    }
}

impl WriteReady for SerialLink {
    fn write_ready(&mut self) -> Result<bool, usart::Error> {
        if let Some(byte) = self.waiting
            && self.offer(&[byte])?.is_some()
        {
            self.waiting = None;
        }
        Ok(self.waiting.is_none())
    }
}

impl Write for SerialLink {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, usart::Error> {
        while !self.write_ready()? {}
        let Some(first) = buffer.first() else {
            return Ok(0);
        };
        if let Some(count) = self.offer(buffer)? {
            return Ok(count);
        }
        self.waiting = Some(*first);
        Ok(1)
    }

    fn flush(&mut self) -> Result<(), usart::Error> {
        while !self.write_ready()? {}
        self.tx.flush()
    }
}
