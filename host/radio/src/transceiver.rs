//! Interface of a radio with one transmitter and two receivers that share a synthesiser.
//!
//! The order of calls is: configure, tune both sides, burst, burst; tune, burst; and so on. A call blocks no longer
//! than the burst it requests and the retune time of the device.

use num_complex::{Complex, Complex32};
use serde::Serialize;
use subaperture_describe::declare::Choice;

use crate::error::RadioError;

/// Complex sample as sent over the wire: 16-bit counts, full scale 32768.
pub type Sample = Complex<i16>;

/// Closed interval of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower limit, included.
    pub from: f64,
    /// Upper limit, included.
    pub to: f64,
}

impl Range {
    /// Refuse a value that is outside the interval or NaN.
    ///
    /// # Errors
    /// [`RadioError::OutOfRange`], with the limits.
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

/// Limits of the settings of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Carrier frequency, hertz.
    pub carrier_hz: Range,
    /// Master clock rate, hertz.
    pub master_clock_hz: Range,
    /// Sample rate in samples per second, with two receivers active.
    pub sample_rate_hz: Range,
    /// Analog bandwidth, hertz.
    pub bandwidth_hz: Range,
    /// Transmit gain, dB.
    pub transmit_gain_db: Range,
    /// Receive gain, dB.
    pub receive_gain_db: Range,
    /// Names of the transmit ports. Empty: unknown, any name is accepted.
    pub transmit_antennas: Vec<String>,
    /// Names of the receive ports. Empty: unknown, any name is accepted.
    pub receive_antennas: Vec<String>,
    /// Duration of a retune of one side, seconds.
    pub retune_s: f64,
    /// Whether a retune can be scheduled at a device time. A B210 cannot: its synthesiser registers are written over a
    /// separate bus.
    pub timed_tune: bool,
}

impl Ranges {
    /// Limits of a USRP B210 with an AD9361 and two receivers (Chim 2018, appendix A; retune time of 2 ms by its
    /// driver).
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

/// Identity and limits of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct About {
    /// Product name, for example `B210`.
    pub product: String,
    /// Serial number of the device.
    pub serial: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Limits of its settings.
    pub ranges: Ranges,
}

/// Source of the reference clock or of the pulse per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Internal oscillator of the device.
    #[default]
    Internal,
    /// External input connector.
    External,
    /// Built-in GPS-disciplined oscillator.
    Gpsdo,
}

/// Settings made once before a capture.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Configuration {
    /// Master clock rate, hertz.
    pub master_clock_hz: f64,
    /// Sample rate of transmitter and receivers, samples per second.
    pub sample_rate_hz: f64,
    /// Analog bandwidth, hertz.
    pub bandwidth_hz: f64,
    /// Transmit gain, dB.
    pub transmit_gain_db: f64,
    /// Gains of receivers 0 and 1, dB.
    pub receive_gain_db: [f64; 2],
    /// Name of the transmit port.
    pub transmit_antenna: String,
    /// Names of the ports of receivers 0 and 1.
    pub receive_antennas: [String; 2],
    /// Source of the reference clock.
    pub clock: Source,
    /// Source of the pulse per second, which defines device time.
    pub pps: Source,
}

impl Configuration {
    /// Check the settings against the limits of a device.
    ///
    /// # Errors
    /// [`RadioError::OutOfRange`] for the first number outside its limits, [`RadioError::Unsupported`] for a port that
    /// the device does not have or a sample rate above the master clock.
    pub fn check(&self, ranges: &Ranges) -> Result<(), RadioError> {
        ranges
            .master_clock_hz
            .check("master clock", self.master_clock_hz, "Hz")?;
        ranges
            .sample_rate_hz
            .check("sample rate", self.sample_rate_hz, "Hz")?;
        ranges
            .bandwidth_hz
            .check("bandwidth", self.bandwidth_hz, "Hz")?;
        ranges
            .transmit_gain_db
            .check("transmit gain", self.transmit_gain_db, "dB")?;
        for gain_db in self.receive_gain_db {
            ranges
                .receive_gain_db
                .check("receive gain", gain_db, "dB")?;
        }
        if self.sample_rate_hz > self.master_clock_hz {
            return Err(RadioError::Unsupported(format!(
                "sample rate of {} Hz exceeds the master clock of {} Hz: raise the clock or lower the rate",
                self.sample_rate_hz, self.master_clock_hz
            )));
        }
        let port = |name: &String, known: &[String]| {
            if known.is_empty() || known.contains(name) {
                return Ok(());
            }
            Err(RadioError::Unsupported(format!(
                "unknown antenna port '{name}': expected one of {}",
                known.join(", ")
            )))
        };
        port(&self.transmit_antenna, &ranges.transmit_antennas)?;
        self.receive_antennas
            .iter()
            .try_for_each(|name| port(name, &ranges.receive_antennas))
    }
}

/// Side of the radio that is tuned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Transmitter.
    Transmit,
    /// Both receivers, which share a synthesiser.
    Receive,
}

/// Burst to transmit, and its start time.
#[derive(Clone, Copy, Debug)]
pub struct Burst<'a> {
    /// One period of the baseband waveform, full scale 1. The waveform is repeated for the duration of the burst.
    pub waveform: &'a [Complex32],
    /// Device time at which the first sample is sent and received, seconds. A common start time aligns the two
    /// receivers.
    pub at_s: f64,
}

/// Result of a burst.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Received {
    /// Device time of sample 0, seconds.
    pub first_s: f64,
    /// Whether the start time had passed when the device received the command. Nothing was sent and all samples are
    /// lost.
    pub late: bool,
    /// Ranges of lost samples of both channels, ascending. The buffers hold zeros there.
    pub lost: Vec<std::ops::Range<usize>>,
    /// Number of samples of each channel whose I or Q is at full scale.
    pub clipped: [u32; 2],
}

/// Sensor readings of the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Whether the transmit synthesiser is locked.
    pub transmit_locked: bool,
    /// Whether the receive synthesiser is locked.
    pub receive_locked: bool,
    /// Whether the external reference clock is locked; `None` with the internal clock.
    pub reference_locked: Option<bool>,
    /// Temperature, degrees Celsius; `None` if not measured.
    pub temperature_c: Option<f64>,
}

/// Kind of a fault reported by the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Overrun: the host read received samples too slowly (UHD's O).
    Overflow,
    /// Underrun: the host supplied transmit samples too slowly (UHD's U).
    Underflow,
    /// Late command: a command arrived after its time (UHD's L).
    LateCommand,
    /// Lost or out-of-order packet (UHD's S and D).
    LostPacket,
    /// The device is disconnected.
    Gone,
}

/// Fault event with its number of occurrences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Kind of the fault.
    pub kind: EventKind,
    /// Device time, seconds; `None` if unknown.
    pub time_s: Option<f64>,
    /// Number of occurrences.
    pub count: u32,
}

/// Radio with one transmitter and two receivers.
pub trait Transceiver: Send {
    /// Identity and limits of the device.
    fn about(&self) -> &About;

    /// Apply the settings, and return the settings in effect: gains and rates have steps.
    ///
    /// # Errors
    /// The errors of [`Configuration::check`]; [`RadioError::Gone`].
    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError>;

    /// Return the current device time, seconds.
    ///
    /// # Errors
    /// [`RadioError::Gone`] if the device is disconnected.
    fn now_s(&mut self) -> Result<f64, RadioError>;

    /// Tune one side, at a device time if the device supports it, and return the carrier in effect, hertz. The phase of
    /// the carrier is random after a retune.
    ///
    /// # Errors
    /// [`RadioError::OutOfRange`] for the carrier; [`RadioError::Unsupported`] for a scheduled retune that the device
    /// cannot do; [`RadioError::Gone`].
    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError>;

    /// Send a burst, and fill the two buffers, of equal length, with the samples that both channels receive during the
    /// burst.
    ///
    /// # Errors
    /// [`RadioError::NotReady`] before configuration and tuning, [`RadioError::Burst`] for an empty waveform or unequal
    /// buffers, [`RadioError::Gone`]. Late, lost or clipped bursts are reported in [`Received`], not as errors.
    fn burst(&mut self, burst: &Burst, receive: [&mut [Sample]; 2])
    -> Result<Received, RadioError>;

    /// Read the sensors of the device.
    ///
    /// # Errors
    /// [`RadioError::Gone`] if the device is disconnected.
    fn sensors(&mut self) -> Result<Sensors, RadioError>;

    /// Whether the built-in GPS-disciplined oscillator has a satellite lock; `None` without one. Reading it may take a
    /// second.
    ///
    /// # Errors
    /// [`RadioError::Gone`] if the device is disconnected.
    fn gps_locked(&mut self) -> Result<Option<bool>, RadioError> {
        Ok(None)
    }

    /// Whether the device waits for its consumer: bursts are computed or read from a file on request, and no time passes
    /// between them. False for a device whose clock runs.
    fn waits(&self) -> bool {
        false
    }

    /// Append the faults since the last call to `events`.
    fn events(&mut self, events: &mut Vec<Event>);
}

/// Refuse an invalid burst: empty or non-finite waveform, empty or unequal buffers, non-finite time.
pub(crate) fn check_burst(burst: &Burst, receive: &[&mut [Sample]; 2]) -> Result<(), RadioError> {
    let say = |what: &str| Err(RadioError::Burst(what.to_owned()));
    if burst.waveform.is_empty() || burst.waveform.iter().any(|z| !z.is_finite()) {
        return say("empty or non-finite waveform: expected one period of finite samples");
    }
    if receive[0].len() != receive[1].len() || receive[0].is_empty() {
        return say("expected two buffers of equal, non-zero length");
    }
    if !burst.at_s.is_finite() {
        return say("expected a finite start time");
    }
    Ok(())
}
