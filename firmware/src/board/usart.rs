//! Serial link of the H743 on USART3: pins PD8 (TX) and PD9 (RX), 8 data bits, no parity, 921 600 baud.
//!
//! The board's debugger presents it to the computer as a serial port. One interrupt per byte moves bytes between the USART and
//! two ring buffers, so nothing is lost while the program computes: the receive buffer holds 89 ms of the link at full speed. A
//! full buffer drops incoming bytes; the protocol detects it.
//!
//! **12 Mbaud.** With the feature `serial-12m` PLL 2 clocks the USART with 96 MHz, eight times the bit rate. The receive buffer
//! then holds 6.8 ms. Not run on a board. Processor time, computed from the instructions of the interrupt handler in the linked
//! program with one cycle per instruction and 24 cycles for entry and return: a byte received takes 109 cycles, one received and
//! one sent together 137. A byte arrives every 333 cycles, so reception at the full rate takes 33 % of the processor, and both
//! directions take 41 %. The accesses to the USART's registers, seven per received byte, wait for the bus; these waits are not
//! included. The USART's FIFO of 16 bytes covers 13 us in which interrupts are masked.

use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use embassy_stm32::peripherals::{PD8, PD9, USART3};
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_stm32::{Peri, bind_interrupts};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use static_cell::ConstStaticCell;

/// Bit rate of the link.
pub const BAUD: u32 = if cfg!(feature = "serial-12m") {
    12_000_000
} else {
    921_600
};

bind_interrupts!(struct Interrupts {
    USART3 => usart::BufferedInterruptHandler<USART3>;
});

const RECEIVE_BYTES: usize = 8192;

static RECEIVED: ConstStaticCell<[u8; RECEIVE_BYTES]> = ConstStaticCell::new([0; RECEIVE_BYTES]);
static TO_SEND: ConstStaticCell<[u8; 2048]> = ConstStaticCell::new([0; 2048]);

/// Ring buffers of received bytes and of bytes to send.
type Buffers = (&'static mut [u8; RECEIVE_BYTES], &'static mut [u8; 2048]);

/// Serial link on USART3.
///
/// The driver cannot report whether its ring buffer has room without writing to it. A byte that found no room waits here.
pub struct SerialLink {
    rx: BufferedUartRx<'static>,
    tx: BufferedUartTx<'static>,
    waiting: Option<u8>,
}

impl SerialLink {
    /// Duration that fills the receive buffer in microseconds. A byte takes ten bits.
    pub(super) const MAX_STEP_US: u32 = RECEIVE_BYTES as u32 * 10 * 1000 / (BAUD / 1000);

    /// Add the clock of the USART to those of the board.
    pub(super) fn add_clock(clocks: &mut embassy_stm32::rcc::Config) {
        #[cfg(feature = "serial-12m")]
        {
            use embassy_stm32::rcc::{Pll, PllDiv, PllMul, PllPreDiv, PllSource, mux};
            clocks.pll2 = Some(Pll {
                source: PllSource::HSI,
                prediv: PllPreDiv::DIV4,
                mul: PllMul::MUL24,
                fracn: None,
                divp: None,
                divq: Some(PllDiv::DIV4),
                divr: None,
            });
            clocks.mux.usart234578sel = mux::Usart234578sel::PLL2_Q;
        }
        #[cfg(not(feature = "serial-12m"))]
        let _ = clocks;
    }

    /// Take the ring buffers. `None` if they were taken before.
    #[inline(always)]
    pub(super) fn buffers() -> Option<Buffers> {
        Some((RECEIVED.try_take()?, TO_SEND.try_take()?))
    }

    /// Enable the USART.
    #[inline(always)]
    pub(super) fn start(
        (received, to_send): Buffers,
        usart: Peri<'static, USART3>,
        rx: Peri<'static, PD9>,
        tx: Peri<'static, PD8>,
    ) -> Option<Self> {
        let mut config = usart::Config::default();
        config.baudrate = BAUD;
        let uart = BufferedUart::new(usart, rx, tx, to_send, received, Interrupts, config);
        let (tx, rx) = uart.ok()?.split();
        Some(Self {
            rx,
            tx,
            waiting: None,
        })
    }

    /// Sleep until a byte was received. May return early.
    pub(super) fn wait(&mut self) {
        // Interrupts masked, so that a byte received between the check and the sleep ends the sleep.
        cortex_m::interrupt::free(|_| {
            if matches!(self.read_ready(), Ok(false)) {
                cortex_m::asm::wfi();
            }
        });
    }

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
