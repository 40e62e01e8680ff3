//! Framed line: a transport with an [`Outbox`] of pending frames, so that writing never blocks reading.

use std::io;
use std::time::{Duration, Instant};

use subaperture_core::link::{Command, Encoder, max_frame_bytes};

use super::transport::Transport;

/// Maximum samples per pulse, as in the core's range transform.
pub(super) const MAX_SAMPLES: usize = 4096;

/// Wait time for the other direction while bytes are pending.
const TURN: Duration = Duration::from_millis(1);

/// Assumed bytes per second of a line with unknown bit rate: half the rate of an emulator on a busy machine.
const SLOW_BYTES_S: f64 = 4e3;

/// Maximum number of bytes that the system buffers for a line.
const BUFFERED_BYTES: f64 = 256e3;

/// Frames waiting to be sent to the module. Does no input or output itself: a [`Line`] sends them.
pub(super) struct Outbox {
    encoder: Encoder,
    /// Number of the next frame, in step with the encoder.
    next: u32,
    frame: Vec<u8>,
    queue: Vec<u8>,
    /// Number of bytes of the queue already sent.
    gone: usize,
    clear_at: Instant,
}

impl Outbox {
    pub(super) fn new() -> Self {
        Self {
            encoder: Encoder::new(),
            next: 1,
            frame: vec![0; max_frame_bytes(MAX_SAMPLES)],
            queue: Vec::new(),
            gone: 0,
            clear_at: Instant::now(),
        }
    }

    /// Append a command to the queue and return its sequence number.
    pub(super) fn send(&mut self, command: &Command<'_>) -> u32 {
        let sequence = if *command == Command::Hello {
            // Terminates any noise before the frame.
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

    /// Number of bytes still to be sent.
    pub(super) fn backlog(&self) -> usize {
        self.queue.len() - self.gone
    }

    /// Latest time at which everything written has passed the line. Until then a request waits behind it.
    pub(super) fn clear_at(&self) -> Instant {
        self.clear_at
    }

    /// Note that everything written has passed the line.
    pub(super) fn is_clear(&mut self) {
        self.clear_at = Instant::now();
    }

    /// Note that `bytes` were sent, on a line of this bit rate.
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

    /// Discard pending frames.
    fn forget(&mut self) {
        self.queue.clear();
        self.gone = 0;
        self.is_clear();
    }
}

/// Transport with pending frames.
pub(super) struct Line<'b> {
    transport: &'b mut dyn Transport,
    pub(super) outbox: Outbox,
    inbox: Vec<u8>,
    /// Bytes to the module, and from it.
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

    /// Write pending bytes, then read what was received, waiting up to `wait`.
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

    /// Reconnect and discard pending frames.
    pub(super) fn reconnect(&mut self) -> io::Result<()> {
        self.outbox.forget();
        self.transport.reconnect()
    }
}
