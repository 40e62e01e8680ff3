//! The device: a simulated radio with UHD's interface of separate settings, and with samples in packets.

use std::collections::VecDeque;
use std::ops::Range;

use num_complex::Complex32;
use subaperture_radio::{
    Burst, Configuration, EventKind, RadioError, Received, Sample, Sensors, Side, Source,
    Transceiver,
};

/// UHD's error code and text.
pub(crate) type Fault = (u32, String);

pub(crate) const ERROR_INDEX: u32 = 10;
pub(crate) const ERROR_USB: u32 = 21;
pub(crate) const ERROR_VALUE: u32 = 43;
pub(crate) const ERROR_RUNTIME: u32 = 44;

/// Samples of a packet; few, so that there are many packets.
pub(crate) const PACKET: usize = 200;
/// Number of packets that are buffered until samples are read.
const ROOM: usize = 3;

/// Error in UHD's words.
fn thrown(error: RadioError) -> Fault {
    match error {
        RadioError::Gone(_) => (ERROR_USB, "USBError: LIBUSB_TRANSFER_NO_DEVICE".to_owned()),
        other => (ERROR_RUNTIME, format!("RuntimeError: {other}")),
    }
}

pub(crate) fn wrong(text: &str) -> Fault {
    (ERROR_VALUE, format!("ValueError: {text}"))
}

/// A packet or an error waiting to be received.
#[derive(Clone, Debug)]
pub(crate) enum Waiting {
    /// UHD's error code, and whether it is a sequence error.
    Error(u32, bool),
    Samples(Range<usize>),
}

pub(crate) struct Device {
    radio: Box<dyn Transceiver>,
    asked: Configuration,
    set: Option<Configuration>,
    pub(crate) subdevices: bool,
    /// Number of times that the state of the reference clock was read.
    pub(crate) reference: u32,
    /// Tuned frequencies of the transmitter and both receivers, hertz.
    pub(crate) tuned_hz: [f64; 3],
    /// Number of requested samples and their start time, seconds.
    command: Option<(usize, f64)>,
    sending: Vec<Complex32>,
    sending_at_s: Option<f64>,
    room: usize,
    first_s: f64,
    buffers: [Vec<Sample>; 2],
    pub(crate) waiting: VecDeque<Waiting>,
    pub(crate) said: VecDeque<u32>,
}

impl Device {
    pub(crate) fn new(radio: Box<dyn Transceiver>) -> Self {
        Self {
            radio,
            // A program must not rely on the initial settings of a B210.
            asked: Configuration {
                master_clock_hz: 30.72e6,
                sample_rate_hz: 1e6,
                bandwidth_hz: 5e6,
                transmit_gain_db: 0.0,
                receive_gain_db: [0.0; 2],
                transmit_antenna: "TX/RX".to_owned(),
                receive_antennas: ["TX/RX".to_owned(), "TX/RX".to_owned()],
                clock: Source::Internal,
                pps: Source::Internal,
            },
            set: None,
            subdevices: false,
            reference: 0,
            tuned_hz: [0.0; 3],
            command: None,
            sending: Vec::new(),
            sending_at_s: None,
            room: ROOM,
            first_s: 0.0,
            buffers: [Vec::new(), Vec::new()],
            waiting: VecDeque::new(),
            said: VecDeque::new(),
        }
    }

    pub(crate) fn ranges(&self) -> &subaperture_radio::Ranges {
        &self.radio.about().ranges
    }

    /// Refuse a channel that does not exist.
    pub(crate) fn channel(&self, channel: usize, of: usize) -> Result<usize, Fault> {
        let there = if self.subdevices { of } else { 1 };
        match channel < there {
            true => Ok(channel),
            false => Err((ERROR_INDEX, format!("IndexError: no channel {channel}"))),
        }
    }

    /// Change a setting; it takes effect at the next access to the device.
    pub(crate) fn ask(&mut self, change: impl FnOnce(&mut Configuration)) {
        change(&mut self.asked);
        self.set = None;
    }

    /// Settings in effect.
    pub(crate) fn set(&mut self) -> Result<&Configuration, Fault> {
        if self.set.is_none() {
            self.set = Some(self.radio.configure(&self.asked).map_err(thrown)?);
        }
        self.set.as_ref().ok_or((ERROR_RUNTIME, String::new()))
    }

    pub(crate) fn now_s(&mut self) -> Result<f64, Fault> {
        self.radio.now_s().map_err(thrown)
    }

    pub(crate) fn sensors(&mut self) -> Result<Sensors, Fault> {
        self.radio.sensors().map_err(thrown)
    }

    pub(crate) fn tune_tx(&mut self, hz: f64) -> Result<f64, Fault> {
        self.set()?;
        let set = self.radio.tune(Side::Transmit, hz, None).map_err(thrown)?;
        self.tuned_hz[0] = set;
        Ok(set)
    }

    /// The receivers have one synthesiser: the same frequency again changes nothing.
    pub(crate) fn tune_rx(&mut self, hz: f64, channel: usize) -> Result<f64, Fault> {
        self.set()?;
        if channel == 1 {
            if hz != self.tuned_hz[1] {
                return Err(wrong("two receivers of one synthesiser at two carriers"));
            }
        } else {
            self.tuned_hz[1] = self.radio.tune(Side::Receive, hz, None).map_err(thrown)?;
        }
        self.tuned_hz[1 + channel] = self.tuned_hz[1];
        Ok(self.tuned_hz[1])
    }

    pub(crate) fn command(&mut self, samples: usize, at_s: f64) -> Result<(), Fault> {
        self.set()?;
        self.command = Some((samples, at_s));
        self.waiting.clear();
        self.said.clear();
        Ok(())
    }

    /// Number of accepted samples.
    pub(crate) fn send(
        &mut self,
        samples: &[Complex32],
        start_s: Option<f64>,
        last: bool,
    ) -> Result<usize, Fault> {
        if self.room == 0 && !samples.is_empty() {
            return Ok(0);
        }
        match (start_s, self.sending_at_s) {
            (Some(at_s), None) => self.sending_at_s = Some(at_s),
            (None, Some(_)) => {}
            _ => return Err(wrong("a burst begins once, and with a time")),
        }
        if samples.len() > PACKET {
            return Err(wrong("more than a packet"));
        }
        self.room = self.room.saturating_sub(1);
        self.sending.extend(samples);
        if last {
            let at_s = self.sending_at_s.take();
            let sent = std::mem::take(&mut self.sending);
            if !samples.is_empty() {
                self.burst(&sent, at_s.unwrap_or_default())?;
            }
        }
        Ok(samples.len())
    }

    /// Next waiting packet or error, and the time of its first sample.
    pub(crate) fn receive(&mut self) -> Option<(Waiting, f64)> {
        self.room = ROOM;
        let next = self.waiting.pop_front()?;
        let rate_hz = self.asked.sample_rate_hz;
        let first_s = match &next {
            Waiting::Samples(range) => self.first_s + range.start as f64 / rate_hz,
            Waiting::Error(..) => self.first_s,
        };
        Some((next, first_s))
    }

    pub(crate) fn samples(&self, channel: usize, range: &Range<usize>) -> &[Sample] {
        &self.buffers[channel][range.clone()]
    }

    fn burst(&mut self, sent: &[Complex32], at_s: f64) -> Result<(), Fault> {
        let Some((samples, from_s)) = self.command.take() else {
            return Err(wrong("samples sent without a request"));
        };
        if samples != sent.len() || from_s.to_bits() != at_s.to_bits() {
            return Err(wrong("samples sent differ from the request"));
        }
        // The simulated radio needs a single period.
        let repeats = |period: &usize| sent[*period..] == sent[..sent.len() - period];
        let period = (1..sent.len()).find(repeats).unwrap_or(sent.len());
        self.buffers = [0, 1].map(|_| vec![Sample::ZERO; samples]);
        let [a, b] = &mut self.buffers;
        let burst = Burst {
            waveform: &sent[..period],
            at_s,
        };
        let received = self.radio.burst(&burst, [a, b]).map_err(thrown)?;
        self.first_s = received.first_s;
        self.queue(&received, samples);
        Ok(())
    }

    /// Queue errors first, then the packets that are not lost.
    fn queue(&mut self, received: &Received, samples: usize) {
        let mut events = Vec::new();
        self.radio.events(&mut events);
        for event in events {
            match event.kind {
                EventKind::Overflow => self.waiting.push_back(Waiting::Error(8, false)),
                EventKind::LostPacket => self.waiting.push_back(Waiting::Error(8, true)),
                EventKind::Underflow => self.said.push_back(2),
                EventKind::LateCommand => {
                    self.waiting.push_back(Waiting::Error(2, false));
                    self.said.push_back(8);
                }
                EventKind::Gone => {}
            }
        }
        let mut next = 0;
        for gap in received
            .lost
            .iter()
            .cloned()
            .chain(std::iter::once(samples..samples))
        {
            while next < gap.start {
                let end = gap.start.min(next + PACKET);
                self.waiting.push_back(Waiting::Samples(next..end));
                next = end;
            }
            next = gap.end;
        }
        if !received.late {
            self.said.push_back(1);
        }
    }
}
