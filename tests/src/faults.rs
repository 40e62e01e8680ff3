//! A line with faults, in front of whatever module there is.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::module::link::Transport;

/// Most bytes taken for the line at a time.
const CHUNK_BYTES: usize = 2048;

/// What goes wrong on a line. Counts of bytes are of those that went to the module.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Seed of all that is random.
    pub seed: u64,
    /// Chance of every bit, both ways, to be wrong.
    pub bit_errors: f64,
    /// Chance of every byte, both ways, to be the first of up to 300 that vanish.
    pub cuts: f64,
    /// Chance of every frame to the module of 100 bytes or more, a pulse, to vanish.
    pub dropped_pulses: f64,
    /// After each of these counts of bytes the line is gone until it is connected anew.
    pub dies_at: Vec<u64>,
    /// After each of these counts of bytes the module begins anew.
    pub restarts_at: Vec<u64>,
    /// After each of these counts of bytes the host reads nothing for a while.
    pub stalls_at: Vec<(u64, Duration)>,
}

/// A module with its line, of which nothing is lost.
pub trait Device: Transport {
    /// Makes the module begin anew; what it held is lost.
    ///
    /// # Errors
    /// If it does not.
    fn restart(&mut self) -> io::Result<()>;
}

/// The host's end of a line with faults.
pub struct FaultyLine<D> {
    device: D,
    faults: Faults,
    random: ChaCha8Rng,
    /// Bytes to the module so far.
    sent: u64,
    /// Damaged bytes that the line has not taken yet.
    queue: VecDeque<u8>,
    frame: Vec<u8>,
    dead: bool,
    stalled_until: Option<Instant>,
}

impl<D: Device> FaultyLine<D> {
    /// A line to `device` with these faults.
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

    /// The device, taken off the line.
    pub fn into_device(self) -> D {
        self.device
    }

    fn chance(&mut self, probability: f64) -> bool {
        probability > 0.0 && f64::from(self.random.next_u32()) < probability * 4_294_967_296.0
    }

    /// What is left of bytes that go over the line.
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
            // Two wrong bits in a byte are rarer than anything here needs.
            let wrong = self.chance(8.0 * self.faults.bit_errors);
            left.push(match wrong {
                true => byte ^ (1 << (self.random.next_u32() % 8)),
                false => byte,
            });
        }
        left
    }

    /// Takes out frames that are to vanish.
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

/// The first of `list` that `sent` has come to, taken off.
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
