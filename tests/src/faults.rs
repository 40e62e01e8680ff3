//! A faulty line in front of a module.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::module::link::Transport;

/// Maximum of bytes given to the line at a time.
const CHUNK_BYTES: usize = 2048;

/// Faults of a line. Counts of bytes are of those sent to the module.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Seed of the random faults.
    pub seed: u64,
    /// Probability of an error of each bit, in both directions.
    pub bit_errors: f64,
    /// Probability that a byte, in either direction, is the first of up to 300 lost ones.
    pub cuts: f64,
    /// Probability that a frame of 100 bytes or more (a pulse) to the module is lost.
    pub dropped_pulses: f64,
    /// The line fails after each of these counts of bytes, until it is reconnected.
    pub dies_at: Vec<u64>,
    /// The module restarts after each of these counts of bytes.
    pub restarts_at: Vec<u64>,
    /// The host stops reading for a time after each of these counts of bytes.
    pub stalls_at: Vec<(u64, Duration)>,
}

/// A module with its lossless line.
pub trait Device: Transport {
    /// Restart the module; its memory is lost.
    ///
    /// # Errors
    /// If the restart fails.
    fn restart(&mut self) -> io::Result<()>;
}

/// Host's end of a faulty line.
pub struct FaultyLine<D> {
    device: D,
    faults: Faults,
    random: ChaCha8Rng,
    /// Number of bytes sent to the module.
    sent: u64,
    /// Damaged bytes not yet accepted by the line.
    queue: VecDeque<u8>,
    frame: Vec<u8>,
    dead: bool,
    stalled_until: Option<Instant>,
}

impl<D: Device> FaultyLine<D> {
    /// Create a line to `device` with these faults.
    pub fn new(device: D, faults: Faults) -> Self {
        Self {
            device,
            random: ChaCha8Rng::seed_from_u64(faults.seed),
            faults,
            sent: 0,
            queue: VecDeque::new(),
            frame: Vec::new(),
            dead: false,
            stalled_until: None,
        }
    }

    /// Return the device without the line.
    pub fn into_device(self) -> D {
        self.device
    }

    fn chance(&mut self, probability: f64) -> bool {
        probability > 0.0 && f64::from(self.random.next_u32()) < probability * 4_294_967_296.0
    }

    /// Bytes after the faults of the line.
    fn damage(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut left = Vec::with_capacity(bytes.len());
        let mut gone = 0;
        for &byte in bytes {
            if gone == 0 && self.chance(self.faults.cuts) {
                gone = 1 + self.random.next_u32() % 300;
            }
            if gone > 0 {
                gone -= 1;
                continue;
            }
            // Two wrong bits in one byte are rare enough to be ignored.
            let wrong = self.chance(8.0 * self.faults.bit_errors);
            left.push(match wrong {
                true => byte ^ (1 << (self.random.next_u32() % 8)),
                false => byte,
            });
        }
        left
    }

    /// Remove frames that are lost.
    fn drop_frames(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut left = Vec::new();
        for &byte in bytes {
            self.frame.push(byte);
            if byte == 0 {
                let vanishes = self.frame.len() >= 100 && self.chance(self.faults.dropped_pulses);
                if !vanishes {
                    left.append(&mut self.frame);
                }
                self.frame.clear();
            }
        }
        left
    }

    fn flush(&mut self) -> io::Result<()> {
        while !self.queue.is_empty() {
            let (bytes, _) = self.queue.as_slices();
            let count = self.device.write(bytes)?;
            if count == 0 {
                break;
            }
            self.queue.drain(..count);
        }
        Ok(())
    }

    fn check_line(&self) -> io::Result<()> {
        match self.dead {
            true => Err(io::Error::new(
                ErrorKind::ConnectionReset,
                "the line is gone",
            )),
            false => Ok(()),
        }
    }
}

/// Remove and return the first of `list` whose count `sent` has reached.
fn reached<T: Copy>(list: &mut Vec<T>, sent: u64, at: impl Fn(T) -> u64) -> Option<T> {
    let place = list.iter().position(|&entry| at(entry) <= sent)?;
    Some(list.remove(place))
}

impl<D: Device> Transport for FaultyLine<D> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.check_line()?;
        self.flush()?;
        if let Some((_, pause)) = reached(&mut self.faults.stalls_at, self.sent, |stall| stall.0) {
            self.stalled_until = Some(Instant::now() + pause);
        }
        if self
            .stalled_until
            .is_some_and(|until| Instant::now() < until)
        {
            std::thread::sleep(wait.min(Duration::from_millis(1)));
            return Ok(0);
        }
        let wait = match self.queue.is_empty() {
            true => wait,
            false => wait.min(Duration::from_micros(200)),
        };
        let count = self.device.read(buffer, wait)?;
        let left = self.damage(&buffer[..count]);
        buffer[..left.len()].copy_from_slice(&left);
        Ok(left.len())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check_line()?;
        if reached(&mut self.faults.dies_at, self.sent, |at| at).is_some() {
            self.dead = true;
            self.queue.clear();
            return self.check_line().map(|()| 0);
        }
        if reached(&mut self.faults.restarts_at, self.sent, |at| at).is_some() {
            self.device.restart()?;
        }
        self.flush()?;
        if !self.queue.is_empty() {
            return Ok(0);
        }
        let bytes = &bytes[..bytes.len().min(CHUNK_BYTES)];
        let framed = self.drop_frames(bytes);
        let left = self.damage(&framed);
        self.queue.extend(left);
        self.flush()?;
        self.sent += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.queue.clear();
        self.frame.clear();
        self.device.reconnect()?;
        self.dead = false;
        Ok(())
    }
}
