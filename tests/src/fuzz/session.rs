//! The host's session with a module that sends arbitrary messages.
//!
//! A real endpoint answers, and the input determines the fate of each of its frames: dropped, repeated, delayed, changed with a valid
//! checksum, or preceded by an invented one. The line itself is lossless, so that all frames pass the frame checks.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use subaperture::module::link::{Buffers, Counts, Session, SessionObserver, Settings, Transport};
use subaperture_core::link::{
    Encoder, Encoding, Event, Level, Refusal, Report, State, Status, max_frame_bytes,
};
use subaperture_core::stream::FloatEngine;
use subaperture_firmware::endpoint::Endpoint;

use super::endpoint::Bench;
use super::stuffing;
use crate::link_scene::{Keep, MAPS, job, recorded, scene};

/// Maximum of frames that an input changes; each may cause a timeout.
const MAX_EDITS: usize = 120;

/// Steps of the module between two reads of the line.
const STEPS: usize = 256;

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let changes: Vec<u8> = (0..60).flat_map(|n| [8, n, 255 - n]).collect();
    let made_up: Vec<u8> = (0..40).flat_map(|n| [n % 20, n]).collect();
    vec![vec![], vec![0; 100], (0..=40).collect(), changes, made_up]
}

/// A module whose messages are changed on the line.
struct Hostile<'a> {
    endpoint: Endpoint<'a, FloatEngine<'a>>,
    edits: &'a [u8],
    count: usize,
    late: Option<Vec<u8>>,
    line: VecDeque<u8>,
}

impl Hostile<'_> {
    fn next(&mut self) -> u8 {
        let (first, rest) = self.edits.split_first().unwrap_or((&0, &[]));
        self.edits = rest;
        *first
    }

    fn number(&mut self) -> u32 {
        // Small, close to the true value, or arbitrary.
        match self.next() % 3 {
            0 => u32::from(self.next()),
            1 => u32::MAX - u32::from(self.next()),
            _ => u32::from_le_bytes([self.next(), self.next(), self.next(), self.next()]),
        }
    }

    /// Put a frame on the line after its change.
    fn pass(&mut self, frame: &[u8]) {
        let kind = match self.count < MAX_EDITS && !self.edits.is_empty() {
            true => self.next() % 16,
            false => 0,
        };
        self.count += 1;
        let bodies = stuffing::pieces(frame);
        let (Some(body), 6..) = (bodies.first(), kind) else {
            self.line.extend(frame);
            self.line.extend(self.late.take().unwrap_or_default());
            return;
        };
        let sequence = body.get(1..5).and_then(<[u8]>::first_chunk);
        let sequence = sequence.map_or(0, |bytes| u32::from_le_bytes(*bytes));
        let mut message = stuffing::message(body).to_vec();
        match kind {
            6 => {}
            7 => {
                self.line.extend(frame);
                self.line.extend(frame);
            }
            8..=10 => {
                let (at, value) = (usize::from(self.next()), self.next());
                let length = message.len().max(1);
                if let Some(place) = message.get_mut(at % length) {
                    *place = value;
                }
                self.line.extend(stuffing::frame(sequence, &message));
            }
            11 => {
                let length = usize::from(self.next() % 32);
                message = (0..length).map(|_| self.next()).collect();
                self.line.extend(stuffing::frame(sequence, &message));
            }
            12 => self.late = Some(frame.to_vec()),
            13 => {
                let other = self.number();
                self.line.extend(stuffing::frame(other, &message));
            }
            14 => {
                let garbage: Vec<u8> = (0..self.next() % 16).map(|_| self.next()).collect();
                self.line.extend(garbage);
                self.line.extend(frame);
            }
            _ => {
                let made_up = self.made_up();
                self.line.extend(made_up);
                self.line.extend(frame);
            }
        }
    }

    /// A frame that the endpoint did not send.
    fn made_up(&mut self) -> Vec<u8> {
        let states = [
            State::Idle,
            State::Ready,
            State::Running,
            State::Finishing,
            State::Done,
        ];
        let report = match self.next() % 4 {
            0 => Report::Event(Event::FramesLost {
                frames: self.number(),
            }),
            1 => Report::Refused {
                sequence: self.number(),
                what: Refusal::PulseLength {
                    expected: self.number(),
                    got: self.number(),
                },
            },
            _ => Report::Status(Status {
                state: states[usize::from(self.next()) % states.len()],
                configuration: self.number(),
                run: self.number(),
                next_pulse: self.number(),
                accept_through: self.number(),
                maps: self.number(),
                link: Default::default(),
                pulses: Default::default(),
            }),
        };
        let mut buffer = vec![0; max_frame_bytes(16)];
        let wire = Encoder::new()
            .encode(&report, &mut buffer)
            .expect("a short report");
        let sequence = self.number();
        let bodies = stuffing::pieces(wire);
        stuffing::frame(sequence, stuffing::message(&bodies[0]))
    }
}

impl Transport for Hostile<'_> {
    fn read(&mut self, buffer: &mut [u8], _wait: Duration) -> io::Result<usize> {
        for _ in 0..STEPS {
            let frame = self.endpoint.pending().to_vec();
            self.endpoint.sent(frame.len());
            if !frame.is_empty() {
                self.pass(&frame);
            }
            if !self.endpoint.work() && frame.is_empty() {
                break;
            }
        }
        let count = buffer.len().min(self.line.len());
        for (place, byte) in buffer.iter_mut().zip(self.line.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.endpoint.receive(bytes);
        Ok(bytes.len())
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.line.clear();
        Ok(())
    }
}

struct Listener;

impl SessionObserver for Listener {
    fn update(&mut self, counts: &Counts) {
        assert!(counts.maps_taken <= counts.maps_wanted);
    }

    fn event(&mut self, event: &Event) {
        assert!(event.level() >= Level::Info && !event.to_string().is_empty());
    }
}

pub(super) fn read(bytes: &[u8]) -> String {
    let scene = scene();
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let mut bench = Bench::new();
    let mut module = Hostile {
        endpoint: bench.endpoint(),
        edits: bytes,
        count: 0,
        late: None,
        line: VecDeque::new(),
    };
    let settings = Settings {
        answer: Duration::from_millis(1),
        idle: Duration::from_millis(5),
        retries: 1,
        rate_hz: None,
        first_number: 77,
        events: Some(Level::Info),
    };
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let mut session = match Session::open(&mut module, &mut buffers, settings, &mut Listener) {
        Ok(session) => session,
        Err(error) => return error.to_string(),
    };
    let version = &session.identity().version;
    assert!(!version.chars().any(char::is_control), "{version:?}");
    let outcome = session.transfer(&mut job, &mut keep, &mut Listener);
    assert_eq!(outcome.counts.maps_taken, keep.0.len() as u64);
    assert_eq!(outcome.missing.len() + keep.0.len(), MAPS);
    assert!(outcome.missing.iter().all(|key| !keep.0.contains_key(key)));
    format!("{:?}", outcome.ending)
}
