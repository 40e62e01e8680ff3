//! Front end with an analogue-to-digital converter on an SPI bus.

use core::num::NonZeroU16;

use embedded_hal::digital::InputPin;
use embedded_hal::spi::SpiDevice;

use super::FrontEnd;

/// Code of the converter's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// Two's complement: 0 at mid-scale.
    TwosComplement,
    /// Offset binary: 0x8000 at mid-scale.
    OffsetBinary,
}

/// Converter with two channels of 16 bits on an SPI bus, and a pin that signals pulses.
///
/// Each sample is two words, most significant bit first: the in-phase and the quadrature channel. The pin is high while a pulse
/// waits to be read, and goes low before its last sample was read. A converter with a buffer sends a whole pulse in one transfer.
/// A converter without a buffer takes one sample per transfer, at its start; the program then sets the sampling times, with its
/// jitter.
///
/// Reading blocks for the transfers of one pulse: 432 samples at 16 MHz take 0.86 ms, and the gaps between the transfers. If the
/// bus fails, the pulse is lost.
#[derive(Debug)]
pub struct SpiConverter<'a, SPI, PIN> {
    spi: SPI,
    ready: PIN,
    coding: Coding,
    samples_per_transfer: NonZeroU16,
    buffer: &'a mut [u8],
    num_samples: usize,
    /// Number of the pulse in the buffer, or of the next one.
    number: u32,
    /// Whether the buffer holds a pulse.
    held: bool,
}

impl<'a, SPI: SpiDevice, PIN: InputPin> SpiConverter<'a, SPI, PIN> {
    /// Create a front end. `ready` signals pulses; each SPI transfer reads `samples_per_transfer` samples, fewer at the end of a
    /// pulse. `buffer` holds one pulse, 4 bytes per sample.
    pub fn new(
        spi: SPI,
        ready: PIN,
        coding: Coding,
        samples_per_transfer: NonZeroU16,
        buffer: &'a mut [u8],
    ) -> Self {
        Self {
            spi,
            ready,
            coding,
            samples_per_transfer,
            buffer,
            num_samples: 0,
            number: 0,
            held: false,
        }
    }

    /// Read a pulse into the buffer.
    fn read(&mut self) -> Result<(), SPI::Error> {
        let transfer_bytes = 4 * usize::from(self.samples_per_transfer.get());
        let samples = self.buffer.get_mut(..4 * self.num_samples);
        let samples = samples.unwrap_or_default();
        for transfer in samples.chunks_mut(transfer_bytes) {
            self.spi.read(transfer)?;
        }
        let flip = match self.coding {
            Coding::TwosComplement => 0,
            Coding::OffsetBinary => 0x80,
        };
        for word in samples.as_chunks_mut::<2>().0 {
            let [high, low] = *word;
            *word = [low, high ^ flip];
        }
        Ok(())
    }
}

impl<SPI: SpiDevice + Send, PIN: InputPin + Send> FrontEnd for SpiConverter<'_, SPI, PIN> {
    fn max_samples(&self) -> usize {
        self.buffer.len() / 4
    }

    fn begin(&mut self, first: u32, num_samples: usize) {
        self.num_samples = num_samples.min(self.max_samples());
        self.number = first;
        self.held = false;
    }

    fn pulse(&mut self) -> Option<(u32, &[u8])> {
        if !self.held {
            // A pin that cannot be read signals no pulse.
            if !self.ready.is_high().unwrap_or(false) {
                return None;
            }
            if self.read().is_err() {
                self.number = self.number.wrapping_add(1);
                return None;
            }
            self.held = true;
        }
        let samples = self.buffer.get(..4 * self.num_samples)?;
        Some((self.number, samples))
    }

    fn release(&mut self) {
        if self.held {
            self.held = false;
            self.number = self.number.wrapping_add(1);
        }
    }
}
