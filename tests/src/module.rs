//! A module in a thread of this process: the firmware's own station on a line with the faults wanted.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::link::Transport;
use subaperture_core::Complex32;
use subaperture_core::cfar::Column;
use subaperture_core::link::{max_frame_bytes, max_received_bytes};
use subaperture_core::stream::{FixedBuffers, FloatBuffers, SubCpiProcessor};
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::products::{ChipKernel, ProductBuffers};
use subaperture_firmware::station::{LinkBuffers, Station};

/// Sizes of the module's buffers: pulses, frequencies, range bins, Doppler rows, patches.
type Float = FloatBuffers<8, 40, 128, 24, 4>;
/// The same in fixed point, 3 exponents a row.
type Fixed = FixedBuffers<8, 40, 128, 24, 3, 4>;
/// Most samples of a row of a map.
const ROW: usize = 128;

/// Bytes that a direction of the line holds: a small part of a map, so that each side feels the other.
const LINE_BYTES: usize = 2048;

/// One direction of a line.
#[derive(Default)]
struct Pipe {
    bytes: Mutex<VecDeque<u8>>,
    came: Condvar,
}

impl Pipe {
    fn write(&self, bytes: &[u8]) -> usize {
        let mut held = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        let count = bytes.len().min(LINE_BYTES - held.len());
        held.extend(&bytes[..count]);
        self.came.notify_all();
        count
    }

    fn read(&self, buffer: &mut [u8], wait: Duration) -> usize {
        let held = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self
            .came
            .wait_timeout_while(held, wait, |held| held.is_empty());
        let (mut held, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let count = buffer.len().min(held.len());
        for (place, byte) in buffer.iter_mut().zip(held.drain(..count)) {
            *place = byte;
        }
        count
    }
}

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
    /// The module is slowed down: a pause after every piece of work.
    pub pause: Duration,
    /// It computes in fixed point.
    pub fixed: bool,
}

/// A module, and the host's end of the line to it.
pub struct Module {
    to: Arc<Pipe>,
    from: Arc<Pipe>,
    restart: Arc<AtomicBool>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
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

impl Module {
    /// Starts a module behind a line with these faults.
    pub fn start(faults: Faults) -> Self {
        let (to, from) = (Arc::<Pipe>::default(), Arc::<Pipe>::default());
        let (restart, end) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let thread = std::thread::spawn({
            let (to, from) = (to.clone(), from.clone());
            let (restart, end) = (restart.clone(), end.clone());
            let (pause, fixed) = (faults.pause, faults.fixed);
            move || {
                while !end.load(Ordering::Relaxed) {
                    restart.store(false, Ordering::Relaxed);
                    let over = || end.load(Ordering::Relaxed) || restart.load(Ordering::Relaxed);
                    if fixed {
                        let mut buffers = Box::new(Fixed::new());
                        let processor = buffers.processor().expect("buffers of one size");
                        serve(processor, &to, &from, &over, pause);
                    } else {
                        let mut buffers = Box::new(Float::new());
                        serve(buffers.processor(), &to, &from, &over, pause);
                    }
                }
            }
        });
        Self {
            to,
            from,
            restart,
            end,
            thread: Some(thread),
            random: ChaCha8Rng::seed_from_u64(faults.seed),
            faults,
            sent: 0,
            queue: VecDeque::new(),
            frame: Vec::new(),
            dead: false,
            stalled_until: None,
        }
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

    fn flush(&mut self) {
        let (bytes, _) = self.queue.as_slices();
        let count = self.to.write(bytes);
        self.queue.drain(..count);
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

impl Drop for Module {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
            && !std::thread::panicking()
        {
            panic!("the module's thread panicked");
        }
    }
}

/// The first of `list` that `sent` has come to, taken off.
fn reached<T: Copy>(list: &mut Vec<T>, sent: u64, at: impl Fn(T) -> u64) -> Option<T> {
    let place = list.iter().position(|&entry| at(entry) <= sent)?;
    Some(list.remove(place))
}

impl Transport for Module {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.check_line()?;
        self.flush();
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
        let count = self.from.read(buffer, wait);
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
            self.restart.store(true, Ordering::Relaxed);
        }
        self.flush();
        if !self.queue.is_empty() {
            return Ok(0);
        }
        let bytes = &bytes[..bytes.len().min(LINE_BYTES)];
        let framed = self.drop_frames(bytes);
        let left = self.damage(&framed);
        self.queue.extend(left);
        self.flush();
        self.sent += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.dead = false;
        Ok(())
    }
}

/// Serves the line until `over`; what the module held is gone then.
fn serve<E: WireEngine>(
    processor: SubCpiProcessor<'_, E>,
    to: &Pipe,
    from: &Pipe,
    over: &dyn Fn() -> bool,
    pause: Duration,
) {
    let mut received = vec![0; max_received_bytes(ROW)];
    let mut frame = vec![0; max_frame_bytes(ROW)];
    let mut row = vec![0; 8 * ROW];
    let link = LinkBuffers {
        received: &mut received,
        frame: &mut frame,
        row: &mut row,
    };
    let mut chip = vec![Complex32::ZERO; 256];
    let mut columns = vec![Column::EMPTY; ROW];
    let kernel = ChipKernel::new();
    let products = ProductBuffers {
        chip: &mut chip,
        kernel: &kernel,
        columns: &mut columns,
    };
    let mut station = Station::new(processor, link, products, "station of the tests");
    let mut bytes = [0; 64];
    let mut idle = false;
    while !over() {
        let wait = Duration::from_micros(if idle { 200 } else { 0 });
        let count = to.read(&mut bytes, wait);
        station.receive(&bytes[..count]);
        let sent = from.write(station.pending());
        station.sent(sent);
        idle = !station.work() && count == 0 && sent == 0;
        if !pause.is_zero() && !idle {
            std::thread::sleep(pause);
        }
    }
}
