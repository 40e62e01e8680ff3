//! Pulses as the front end of a module delivers them, and the recording that holds the same samples.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embedded_io::{ErrorType, Read, ReadReady};
use num_complex::Complex32;
use subaperture::module::link::PulseSource;
use subaperture::phase_history::{InMemory, PhaseHistory};
use subaperture_core::link::{Encoding, sc16s};
use subaperture_firmware::front_end::frame::{self, Order, frame_bytes};

/// Samples of all pulses in 16 bits, as the recording that holds them, and as one frame per pulse.
///
/// # Panics
/// If the recording cannot be read.
pub fn digitised(history: &dyn PhaseHistory) -> (InMemory, Vec<Vec<u8>>) {
    let collection = history.collection().clone();
    let weights = vec![1.0; collection.pulses.len()];
    let mut pulses = PulseSource::new(&[history], &weights, Encoding::Sc16).unwrap();
    let mut samples: Vec<Complex32> = Vec::new();
    let mut frames = Vec::new();
    for number in 0..pulses.len() {
        let (_, bytes) = pulses.pulse(number).unwrap();
        samples.extend(sc16s(bytes).map(|z| z.to_complex32()));
        frames.push(framed(number, bytes));
    }
    (InMemory::new(collection, samples).unwrap(), frames)
}

/// Frame of a pulse, in-phase part first.
///
/// # Panics
/// If the pulse has more than 65 535 samples.
pub fn framed(number: u32, samples: &[u8]) -> Vec<u8> {
    let mut buffer = vec![0; frame_bytes(samples.len() / 4)];
    frame::write(number, Order::InPhaseFirst, samples, &mut buffer).expect("room");
    buffer
}

/// Serial port that delivers its bytes in pieces of 1 to 61 bytes.
#[derive(Clone, Default)]
pub struct Port(Arc<Mutex<VecDeque<u8>>>);

impl Port {
    /// Port with these bytes.
    pub fn with(bytes: impl IntoIterator<Item = u8>) -> Self {
        Self(Arc::new(Mutex::new(bytes.into_iter().collect())))
    }

    fn bytes(&self) -> MutexGuard<'_, VecDeque<u8>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ErrorType for Port {
    type Error = Infallible;
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.bytes().is_empty())
    }
}

impl Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let mut bytes = self.bytes();
        // Pieces of 1 to 61 bytes, by the number of bytes left.
        let most = 1 + bytes.len() % 61;
        let count = most.min(buffer.len()).min(bytes.len());
        for (place, byte) in buffer.iter_mut().zip(bytes.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}
