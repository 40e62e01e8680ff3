//! A transport with frames on it: what is to go waits in an [`Outbox`], so that writing never keeps from
//! reading.

use std::io;
use std::time::{Duration, Instant};

use subaperture_core::link::{Command, Encoder, max_frame_bytes};

use super::transport::Transport;

/// Most samples of a pulse: that of the core's range transform.
pub(super) const MOST_SAMPLES: usize = 4096;

/// Wait for the other direction while bytes are still to go.
const TURN: Duration = Duration::from_millis(1);

/// Bytes a second of a slow line whose speed is not known: an emulator on a busy machine takes twice as
/// many.
const SLOW_BYTES_S: f64 = 4e3;

/// Most bytes that a system's buffers hold before a line.
const BUFFERED_BYTES: f64 = 256e3;

/// Frames on their way to the module. It does no input or output: a [`Line`] carries away what it holds.
pub(super) struct Outbox {
    encoder: Encoder,
    /// Number of the next frame, as the encoder counts.
    next: u32,
    frame: Vec<u8>,
    queue: Vec<u8>,
    /// Bytes of the queue that have gone.
    gone: usize,
    clear_at: Instant,
}

impl Outbox {
    pub(super) fn new() -> Self {
        Self {
            encoder: Encoder::new(),
            next: 1,
            frame: vec![0; max_frame_bytes(MOST_SAMPLES)],
            queue: Vec::new(),
            gone: 0,
            clear_at: Instant::now(),
        }
    }

    /// Puts a command at the end of the queue; its number.
    pub(super) fn send(&mut self, command: &Command<'_>) -> u32 {
        let sequence = if *command == Command::Hello {
            // Ends whatever noise came before.
            self.queue.push(0);
            0
        } else {
            self.next
        };
        let bytes = self.encoder.encode(command, &mut self.frame);
        self.queue.extend_from_slice(
            bytes.expect("the buffer holds the longest frame of the core's sizes"),
        );
        self.next = sequence.checked_add(1).unwrap_or(1);
        sequence
    }

    /// Bytes that are still to go.
    pub(super) fn backlog(&self) -> usize {
        self.queue.len() - self.gone
    }

    /// When all that was written has passed, at the latest; until then a question waits behind it.
    pub(super) fn clear_at(&self) -> Instant {
        self.clear_at
    }

    /// All that was written has passed.
    pub(super) fn is_clear(&mut self) {
        self.clear_at = Instant::now();
    }

    /// So many bytes have gone, on a line of this speed.
    pub(super) fn written(&mut self, bytes: usize, baud: Option<u32>) {
        let bytes_s = baud.map_or(SLOW_BYTES_S, |baud| f64::from(baud) / 10.0);
        let now = Instant::now();
        let clear_at = self.clear_at.max(now) + Duration::from_secs_f64(bytes as f64 / bytes_s);
        self.clear_at = clear_at.min(now + Duration::from_secs_f64(BUFFERED_BYTES / bytes_s));
        self.gone += bytes;
        if self.backlog() == 0 {
            self.queue.clear();
            self.gone = 0;
        }
    }

    /// What was to go is forgotten.
    fn forget(&mut self) {
        self.queue.clear();
        self.gone = 0;
        self.is_clear();
    }
}

/// A transport, and what is to go over it.
pub(super) struct Line<'b> {
    transport: &'b mut dyn Transport,
    pub(super) outbox: Outbox,
    inbox: Vec<u8>,
    /// Bytes to the module and from it.
    pub(super) bytes_out: u64,
    pub(super) bytes_in: u64,
}

impl<'b> Line<'b> {
    pub(super) fn new(transport: &'b mut dyn Transport) -> Self {
        Self {
            transport,
            outbox: Outbox::new(),
            inbox: vec![0; 1 << 16],
            bytes_out: 0,
            bytes_in: 0,
        }
    }

    /// Writes what goes, then reads what has come, waiting for it up to `wait`.
    pub(super) fn exchange(&mut self, wait: Duration) -> io::Result<&[u8]> {
        let outbox = &mut self.outbox;
        if outbox.backlog() > 0 {
            let written = self.transport.write(&outbox.queue[outbox.gone..])?;
            self.bytes_out += written as u64;
            outbox.written(written, self.transport.baud());
        }
        let wait = match outbox.backlog() {
            0 => wait,
            _ => wait.min(TURN),
        };
        let count = self.transport.read(&mut self.inbox, wait)?;
        self.bytes_in += count as u64;
        Ok(&self.inbox[..count])
    }

    /// Connects anew; what was to go is forgotten.
    pub(super) fn reconnect(&mut self) -> io::Result<()> {
        self.outbox.forget();
        self.transport.reconnect()
    }
}
