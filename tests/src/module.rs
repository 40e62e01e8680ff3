//! A module in a thread of this process: the firmware's endpoint on a line.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use subaperture::module::link::Transport;
use subaperture_core::Complex32;
use subaperture_core::accumulate::ChipKernel;
use subaperture_core::cfar::Column;
use subaperture_core::link::{max_frame_bytes, max_received_bytes};
use subaperture_core::motion::Odometer;
use subaperture_core::stream::{FixedBuffers, FloatBuffers, SubCpiProcessor};
use subaperture_firmware::endpoint::{Endpoint, LinkBuffers};
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::front_end::frame::frame_bytes;
use subaperture_firmware::front_end::{FrameStream, GeometryQueue};
use subaperture_firmware::products::{Chip, NO_VALUES, ProductBuffers};

use crate::faults::{Device, Faults, FaultyLine};
use crate::front_end::Port;
use crate::sweep_scene::SceneProfiler;

/// Sizes of the module's buffers: pulses, frequencies, range bins, Doppler rows, patches.
type Float = FloatBuffers<8, 40, 128, 24, 4>;
/// The same in fixed point, with 3 exponents per row.
type Fixed = FixedBuffers<8, 40, 128, 24, 3, 4>;
/// Maximum of samples in a row of a map.
const ROW: usize = 128;

/// Bytes that each direction of the line can hold: a small part of a map, so that each side affects the other.
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

/// A module, and the host's end of its line.
pub struct Module {
    to: Arc<Pipe>,
    from: Arc<Pipe>,
    restart: Arc<AtomicBool>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Arithmetic and speed of a module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Manner {
    /// Pause after every step, which slows the module down.
    pub pause: Duration,
    /// Whether it computes in fixed point.
    pub fixed: bool,
}

impl Module {
    /// Start a module.
    pub fn start(manner: Manner) -> Self {
        Self::launch(manner, None)
    }

    /// Start a module with a front end that receives frames from `port`.
    pub fn with_front_end(manner: Manner, port: Port) -> Self {
        Self::launch(manner, Some(port))
    }

    fn launch(manner: Manner, port: Option<Port>) -> Self {
        let (to, from) = (Arc::<Pipe>::default(), Arc::<Pipe>::default());
        let (restart, end) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let thread = std::thread::spawn({
            let (to, from) = (to.clone(), from.clone());
            let (restart, end) = (restart.clone(), end.clone());
            let Manner { pause, fixed } = manner;
            move || {
                while !end.load(Ordering::Relaxed) {
                    restart.store(false, Ordering::Relaxed);
                    let port = port.clone();
                    let over = || end.load(Ordering::Relaxed) || restart.load(Ordering::Relaxed);
                    if fixed {
                        let mut buffers = Box::new(Fixed::new());
                        let processor = buffers.processor().expect("buffers of one size");
                        serve(processor, (&to, &from), port, &over, pause);
                    } else {
                        let mut buffers = Box::new(Float::new());
                        serve(buffers.processor(), (&to, &from), port, &over, pause);
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
        }
    }

    /// A module behind a faulty line.
    pub fn behind(faults: Faults, manner: Manner) -> FaultyLine<Self> {
        FaultyLine::new(Self::start(manner), faults)
    }
}

impl Transport for Module {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        Ok(self.from.read(buffer, wait))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(self.to.write(bytes))
    }

    fn reconnect(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Device for Module {
    fn restart(&mut self) -> io::Result<()> {
        self.restart.store(true, Ordering::Relaxed);
        Ok(())
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

/// Serve the line until `over`; the module's memory is lost then.
fn serve<E: WireEngine>(
    processor: SubCpiProcessor<'_, E>,
    (to, from): (&Pipe, &Pipe),
    port: Option<Port>,
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
    let mut pixels = vec![Complex32::ZERO; 256];
    let mut chips = vec![Chip::EMPTY; 4];
    let mut accumulated = [0; 16];
    let mut columns = vec![Column::EMPTY; ROW];
    let mut values = Box::new(NO_VALUES);
    let kernel = ChipKernel::new();
    let products = ProductBuffers {
        pixels: &mut pixels,
        chips: &mut chips,
        accumulated: &mut accumulated,
        kernel: &kernel,
        columns: &mut columns,
        values: &mut values,
    };
    let mut odometer = Box::new(Odometer::<8, 4, 64, 256>::new());
    let mut profiler = Box::new(SceneProfiler::new());
    let mut station = Endpoint::new(processor, link, products, "station of the tests")
        .with_odometer(&mut *odometer)
        .with_profiler(&mut *profiler);
    let mut samples = [0; frame_bytes(ROW)];
    let (mut front_end, mut queue) = (None, GeometryQueue::new());
    if let Some(port) = port {
        let front_end = front_end.insert(FrameStream::new(port, &mut samples));
        station = station.with_front_end(front_end, &mut queue);
    }
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
