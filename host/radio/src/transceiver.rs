//! What a radio of one transmitter and two receivers that share their synthesisers can do.
//!
//! The order is: configure, tune both sides, burst, burst; tune, burst; and so on. Nothing here waits longer than the burst
//! asked for and the device's own time to retune.

use num_complex::{Complex, Complex32};

use crate::error::RadioError;

/// A complex sample as it comes over the wire: counts, full scale 32768.
pub type Sample = Complex<i16>;

/// What a quantity can be, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The least.
    pub from: f64,
    /// The most.
    pub to: f64,
}

impl Range {
    /// Refuses what is outside, and what is no number.
    ///
    /// # Errors
    /// [`RadioError::OutOfRange`].
    pub fn check(
        &self,
        what: &'static str,
        asked: f64,
        unit: &'static str,
    ) -> Result<(), RadioError> {
        if (self.from..=self.to).contains(&asked) {
            return Ok(());
        }
        Err(RadioError::OutOfRange {
            what,
            asked,
            from: self.from,
            to: self.to,
            unit,
        })
    }
}

/// What a device can be set to.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Carriers, hertz.
    pub carrier_hz: Range,
    /// Master clock, hertz.
    pub master_clock_hz: Range,
    /// Complex samples a second with two receivers.
    pub sample_rate_hz: Range,
    /// Analog bandwidth, hertz.
    pub bandwidth_hz: Range,
    /// Gain of the transmitter, dB.
    pub transmit_gain_db: Range,
    /// Gain of the receivers, dB.
    pub receive_gain_db: Range,
    /// Names of the transmitter's ports; none where they are not known, and any will do.
    pub transmit_antennas: Vec<String>,
    /// Names of the receivers' ports.
    pub receive_antennas: Vec<String>,
    /// What a retune of one side takes, seconds.
    pub retune_s: f64,
    /// Whether a retune can be asked for at a time; a B210's cannot, its registers are written over a bus of its own.
    pub timed_tune: bool,
}

impl Ranges {
    /// A USRP B210 with an AD9361, two receivers (Chim 2018, appendix A; 2 ms a retune in its driver).
    pub fn b210() -> Self {
        let range = |from, to| Range { from, to };
        Self {
            carrier_hz: range(70e6, 6e9),
            master_clock_hz: range(5e6, 30.72e6),
            sample_rate_hz: range(0.2e6, 30.72e6),
            bandwidth_hz: range(0.2e6, 56e6),
            transmit_gain_db: range(0.0, 89.75),
            receive_gain_db: range(0.0, 76.0),
            transmit_antennas: vec!["TX/RX".to_owned()],
            receive_antennas: vec!["RX2".to_owned(), "TX/RX".to_owned()],
            retune_s: 2e-3,
            timed_tune: false,
        }
    }
}

/// Which device this is.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Its kind.
    pub product: String,
    /// Its serial number.
    pub serial: String,
    /// What it can be set to.
    pub ranges: Ranges,
}

/// Where a clock or its pulse per second comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// The device itself.
    #[default]
    Internal,
    /// Its connector.
    External,
    /// A GPS-disciplined oscillator within.
    Gpsdo,
}

/// All that is set once before a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// Master clock, hertz.
    pub master_clock_hz: f64,
    /// Complex samples a second, both ways.
    pub sample_rate_hz: f64,
    /// Analog bandwidth, hertz.
    pub bandwidth_hz: f64,
    /// Gain of the transmitter, dB.
    pub transmit_gain_db: f64,
    /// Gains of the two receivers, dB.
    pub receive_gain_db: [f64; 2],
    /// Port of the transmitter.
    pub transmit_antenna: String,
    /// Ports of the two receivers.
    pub receive_antennas: [String; 2],
    /// What frequencies come from.
    pub clock: Source,
    /// What times come from.
    pub pps: Source,
}

impl Configuration {
    /// Checks it against what a device can do.
    ///
    /// # Errors
    /// [`RadioError::OutOfRange`] for the first number, [`RadioError::Unsupported`] for a port that the device has not.
    pub fn check(&self, ranges: &Ranges) -> Result<(), RadioError> {
        ranges
            .master_clock_hz
            .check("a master clock", self.master_clock_hz, "Hz")?;
        ranges
            .sample_rate_hz
            .check("a sample rate", self.sample_rate_hz, "Hz")?;
        ranges
            .bandwidth_hz
            .check("a bandwidth", self.bandwidth_hz, "Hz")?;
        ranges
            .transmit_gain_db
            .check("a transmitting gain", self.transmit_gain_db, "dB")?;
        for gain_db in self.receive_gain_db {
            ranges
                .receive_gain_db
                .check("a receiving gain", gain_db, "dB")?;
        }
        if self.sample_rate_hz > self.master_clock_hz {
            return Err(RadioError::Unsupported(format!(
                "{} samples a second from a master clock of {} Hz; raise the clock",
                self.sample_rate_hz, self.master_clock_hz
            )));
        }
        let port = |name: &String, known: &[String]| {
            if known.is_empty() || known.contains(name) {
                return Ok(());
            }
            Err(RadioError::Unsupported(format!(
                "it has no port '{name}'; its ports are {}",
                known.join(", ")
            )))
        };
        port(&self.transmit_antenna, &ranges.transmit_antennas)?;
        self.receive_antennas
            .iter()
            .try_for_each(|name| port(name, &ranges.receive_antennas))
    }
}

/// Transmitter or receivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The transmitter.
    Transmit,
    /// Both receivers, which have one synthesiser.
    Receive,
}

/// What is sent, and when.
#[derive(Clone, Copy, Debug)]
pub struct Burst<'a> {
    /// One period at baseband, full scale 1; repeated as long as the burst lasts.
    pub waveform: &'a [Complex32],
    /// Device time of the first sample, sent and received. Two receivers need one to start together.
    pub at_s: f64,
}

/// What came of a burst.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Received {
    /// Device time of sample 0.
    pub first_s: f64,
    /// The burst's time had passed when the device got it: nothing was sent, all samples are lost.
    pub late: bool,
    /// Samples that did not come, ascending, of both channels; zeros in the buffers.
    pub lost: Vec<std::ops::Range<usize>>,
    /// Samples of each channel of which I or Q was at full scale.
    pub clipped: [u32; 2],
}

/// What the device knows of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Whether the transmitter's synthesiser is locked.
    pub transmit_locked: bool,
    /// Whether the receivers' is.
    pub receive_locked: bool,
    /// Whether the reference clock is there; `None` where it is the device's own.
    pub reference_locked: Option<bool>,
    /// Temperature, degrees Celsius, where it is measured.
    pub temperature_c: Option<f64>,
}

/// Something that went wrong beside the commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The host was too slow to take samples (UHD's O).
    Overflow,
    /// The host was too slow to give samples (U).
    Underflow,
    /// A command came after its time (L).
    LateCommand,
    /// Packets lost on the way (S, D).
    LostPacket,
    /// The device is gone.
    Gone,
}

/// An event and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// What.
    pub kind: EventKind,
    /// Device time, where it is known.
    pub time_s: Option<f64>,
    /// How many at once.
    pub count: u32,
}

/// A radio of one transmitter and two receivers.
pub trait Transceiver: Send {
    /// Which device this is, and what it can do.
    fn about(&self) -> &About;

    /// Sets all that is set once. What it has been set to: gains and rates go in steps.
    ///
    /// # Errors
    /// What [`Configuration::check`] refuses; [`RadioError::Gone`].
    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError>;

    /// Device time, seconds.
    ///
    /// # Errors
    /// [`RadioError::Gone`].
    fn now_s(&mut self) -> Result<f64, RadioError>;

    /// Tunes a side, at a time where the device can; the carrier that it has been tuned to. Its phase is another than before.
    ///
    /// # Errors
    /// Out of range; [`RadioError::Unsupported`] for a time where the device knows none; [`RadioError::Gone`].
    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError>;

    /// Sends a burst and fills the buffers, of equal length, with what both channels receive meanwhile.
    ///
    /// # Errors
    /// [`RadioError::NotReady`] before configuring and tuning, [`RadioError::Burst`] for an empty waveform or unequal
    /// buffers, [`RadioError::Gone`]. A late, lost or clipped burst is no error.
    fn burst(&mut self, burst: &Burst, receive: [&mut [Sample]; 2])
    -> Result<Received, RadioError>;

    /// What the device knows of itself.
    ///
    /// # Errors
    /// [`RadioError::Gone`].
    fn sensors(&mut self) -> Result<Sensors, RadioError>;

    /// Whether a GPS-disciplined oscillator within has found its satellites; `None` where there is none. It listens to what that says, which may take a second.
    ///
    /// # Errors
    /// [`RadioError::Gone`].
    fn gps_locked(&mut self) -> Result<Option<bool>, RadioError> {
        Ok(None)
    }

    /// Moves what went wrong since the last call to the end of `events`.
    fn events(&mut self, events: &mut Vec<Event>);
}

/// Refuses a burst that makes no sense.
pub(crate) fn check_burst(burst: &Burst, receive: &[&mut [Sample]; 2]) -> Result<(), RadioError> {
    let say = |what: &str| Err(RadioError::Burst(what.to_owned()));
    if burst.waveform.is_empty() || burst.waveform.iter().any(|z| !z.is_finite()) {
        return say("the waveform is empty or not finite: give one period of it");
    }
    if receive[0].len() != receive[1].len() || receive[0].is_empty() {
        return say("give two buffers of equal length, not empty");
    }
    if !burst.at_s.is_finite() {
        return say("its time is no number");
    }
    Ok(())
}
