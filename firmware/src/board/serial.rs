//! Serial ports of the AN500: the link on UART0, and the front end on UART2.

use cortex_m::peripheral::NVIC;
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};

use super::cmsdk::{BAUD, CLOCK_HZ, Registers};
use super::uart;

/// Serial port on UART0 or UART2. The interrupts that end a sleep are those of UART0.
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
    /// Enable the receiver of UART2, without interrupts.
    pub(super) fn of_front_end() -> Self {
        let uart = Self(Registers(0x4000_6000));
        uart.0.write(uart::BAUDDIV, CLOCK_HZ / BAUD);
        uart.0.write(uart::CTRL, uart::RX_ENABLE);
        uart
    }

    /// Enable UART0, and its interrupts as ends of a sleep.
    pub(super) fn start() -> Option<Self> {
        let uart = Self(Registers(0x4000_4000));
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
        Some(uart)
    }

    /// Sleep until a byte was received.
    pub(super) fn wait(&mut self) {
        self.wait_for(uart::RX_FULL, uart::RX_FULL);
    }

    /// Sleep until the masked state equals `wanted`, and return the state.
    ///
    /// Polling the register would also work, but would occupy a processor of the host.
    fn wait_for(&mut self, mask: u32, wanted: u32) -> u32 {
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
        let mut state = self.wait_for(uart::RX_FULL, uart::RX_FULL);
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
        self.wait_for(uart::TX_FULL, 0);
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
        self.wait_for(uart::TX_FULL, 0);
        Ok(())
    }
}
