//! Front end that receives frames over an `embedded-io` port.

use embedded_io::{Read, ReadReady};

use super::FrontEnd;
use super::frame::{HEAD_BYTES, Head, Order, SYNC, frame_bytes, is_intact};

/// Front end that receives the frames of [`frame`](super::frame) from a port.
///
/// A damaged frame is dropped and the next synchronisation searched within its bytes, so a lost byte costs one pulse. Frames with
/// another number of samples than the run's are passed on, and the endpoint refuses them by their length.
#[derive(Debug)]
pub struct FrameStream<'a, R> {
    port: R,
    buffer: &'a mut [u8],
    /// Number of bytes received.
    filled: usize,
    /// Head of the intact frame at the start of the buffer.
    frame: Option<Head>,
}

impl<'a, R: Read + ReadReady> FrameStream<'a, R> {
    /// Create a front end. `buffer` holds one frame: [`frame_bytes`] of the maximum number of samples.
    pub fn new(port: R, buffer: &'a mut [u8]) -> Self {
        Self {
            port,
            buffer,
            filled: 0,
            frame: None,
        }
    }

    /// Read from the port up to `end` bytes in the buffer, if there are any.
    fn read_to(&mut self, end: usize) {
        let Some(room) = self.buffer.get_mut(self.filled..end) else {
            return;
        };
        // Bytes lost by the port damage a frame, which is detected.
        if let Ok(true) = self.port.read_ready()
            && let Ok(count) = self.port.read(room)
        {
            self.filled = self.filled.saturating_add(count).min(end);
        }
    }

    /// Head of the frame that the received bytes begin with.
    fn head(&self) -> Option<Head> {
        let (head, _) = self.received().split_first_chunk::<HEAD_BYTES>()?;
        Head::parse(head).filter(|head| head.frame_bytes() <= self.buffer.len())
    }

    fn received(&self) -> &[u8] {
        self.buffer.get(..self.filled).unwrap_or(&[])
    }

    /// Receive, and check a frame that is complete.
    fn receive(&mut self) {
        if self.filled < HEAD_BYTES {
            self.read_to(HEAD_BYTES);
        }
        if self.filled < HEAD_BYTES {
            return;
        }
        let Some(head) = self.head() else {
            self.resynchronise();
            return;
        };
        let end = head.frame_bytes();
        if self.filled < end {
            self.read_to(end);
        }
        if self.filled < end {
            return;
        }
        let intact = self.buffer.get(..end).is_some_and(is_intact);
        if !intact {
            self.resynchronise();
            return;
        }
        if head.order == Order::QuadratureFirst
            && let Some(samples) = self.buffer.get_mut(HEAD_BYTES..end - 4)
        {
            for sample in samples.as_chunks_mut::<4>().0 {
                let [q0, q1, i0, i1] = *sample;
                *sample = [i0, i1, q0, q1];
            }
        }
        self.frame = Some(head);
    }

    /// Drop bytes up to the next synchronisation or its beginning.
    fn resynchronise(&mut self) {
        let received = self.received();
        let begins = |at: &usize| {
            let rest = received.get(*at..).unwrap_or(&[]);
            rest.iter().zip(&SYNC).all(|(a, b)| a == b)
        };
        let next = (1..self.filled).find(begins);
        self.drop_first(next.unwrap_or(self.filled));
    }

    fn drop_first(&mut self, count: usize) {
        let count = count.min(self.filled).min(self.buffer.len());
        if let Some(received) = self.buffer.get_mut(..self.filled) {
            received.copy_within(count.., 0);
        }
        self.filled -= count;
    }
}

impl<R: Read + ReadReady + Send> FrontEnd for FrameStream<'_, R> {
    fn max_samples(&self) -> usize {
        let samples = self.buffer.len().saturating_sub(frame_bytes(0)) / 4;
        samples.min(u16::MAX.into())
    }

    fn begin(&mut self, _first: u32, _num_samples: usize) {
        // Frames are numbered: those of earlier pulses are recognised.
    }

    fn pulse(&mut self) -> Option<(u32, &[u8])> {
        if self.frame.is_none() {
            self.receive();
        }
        let head = self.frame?;
        let samples = self.buffer.get(HEAD_BYTES..head.frame_bytes() - 4)?;
        Some((head.number, samples))
    }

    fn release(&mut self) {
        if let Some(head) = self.frame.take() {
            self.drop_first(head.frame_bytes());
        }
    }
}
