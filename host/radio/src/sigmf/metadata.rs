//! SigMF metadata of a recording and of its steps.

use serde::{Deserialize, Serialize};

use subaperture_model::phase_history::Band;

use crate::antennas::{Antennas, Reference};
use crate::transceiver::Received;

/// Namespace of the steps' keys.
pub(super) const SPACE: &str = "subaperture";
/// SigMF version written.
pub(super) const VERSION: &str = "1.2.0";
/// Two interleaved channels of 16-bit I and Q.
pub(super) const DATATYPE: &str = "ci16_le";

/// Parameters common to all steps of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Name of the recording.
    pub name: String,
    /// Device: product and serial number.
    pub hardware: String,
    /// Sample rate, samples per second.
    pub sample_rate_hz: f64,
    /// Samples per period of the tone.
    pub period: usize,
    /// Number of samples per step and channel.
    pub samples: usize,
    /// First carrier, hertz.
    pub start_hz: f64,
    /// Carrier spacing, hertz.
    pub step_hz: f64,
    /// Number of carriers per sweep.
    pub steps: usize,
    /// Transmit gain, dB.
    pub transmit_gain_db: f64,
    /// Gains of receivers 0 and 1, dB.
    pub receive_gain_db: [f64; 2],
    /// Ports of receivers 0 and 1.
    pub receive_antennas: [String; 2],
    /// Signal that the echo is divided by.
    #[serde(default)]
    pub reference: Reference,
    /// Antenna positions, if the plan contains them.
    #[serde(default)]
    pub antennas: Option<Antennas>,
    /// Maximum range of the plan, metres, if it states one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_m: Option<f64>,
}

/// Used part of the bandwidth of a chirp, whose spectrum falls off at its ends.
const CHIRP_BAND: f64 = 0.8;

impl Setup {
    /// Whether it is a recording of chirps ([`crate::chirp`]), with one carrier: `period` is the pulse repetition interval,
    /// and `step_hz` the bandwidth of the chirp.
    pub fn is_chirp(&self) -> bool {
        self.steps == 1
    }

    /// Frequencies of a sweep's response: carriers plus the tone, or of chirps the lines of their spectrum within
    /// 0.8 of the bandwidth.
    pub fn band(&self) -> Band {
        if self.is_chirp() {
            let step_hz = self.sample_rate_hz / self.period as f64;
            let half = (0.5 * CHIRP_BAND * self.step_hz / step_hz).floor();
            // At most one period, which has at most 65,536 samples.
            let half = half.min(0.5 * (self.period as f64 - 1.0)).floor();
            return Band {
                start_hz: self.start_hz - half * step_hz,
                step_hz,
                count: 2 * half as usize + 1,
            };
        }
        Band {
            start_hz: self.start_hz + self.sample_rate_hz / self.period as f64,
            step_hz: self.step_hz,
            count: self.steps,
        }
    }
}

/// Fault of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// The burst was late and was not sent: all its samples are lost.
    Late,
    /// Samples within the burst were lost.
    Lost,
    /// The reference was not steady.
    Unsteady,
    /// Samples reached full scale.
    Clipped,
    /// A synthesiser reported loss of lock.
    Unlocked,
}

impl Flag {
    /// All flags, in the order of counters.
    pub const ALL: [Self; 5] = [
        Self::Late,
        Self::Lost,
        Self::Unsteady,
        Self::Clipped,
        Self::Unlocked,
    ];
}

/// Step of a recording: one burst at a carrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Index of its first sample in the recording.
    #[serde(rename = "core:sample_start")]
    pub start: u64,
    /// Number of samples per channel.
    #[serde(rename = "core:sample_count")]
    pub samples: usize,
    /// Lower edge of the band that the step represents, hertz.
    #[serde(rename = "core:freq_lower_edge")]
    pub lower_hz: f64,
    /// Upper edge of that band, hertz.
    #[serde(rename = "core:freq_upper_edge")]
    pub upper_hz: f64,
    /// Carrier, hertz.
    #[serde(rename = "subaperture:carrier_hz")]
    pub carrier_hz: f64,
    /// Index of the sweep.
    #[serde(rename = "subaperture:sweep")]
    pub sweep: u64,
    /// Index of the carrier.
    #[serde(rename = "subaperture:step")]
    pub step: usize,
    /// Device time of the first sample, seconds.
    #[serde(rename = "subaperture:time_s")]
    pub time_s: f64,
    /// Gains of receivers 0 and 1, dB.
    #[serde(rename = "subaperture:gain_db")]
    pub gain_db: [f64; 2],
    /// Number of bursts sent until this one was kept.
    #[serde(rename = "subaperture:bursts")]
    pub bursts: u32,
    /// Faults of the step.
    #[serde(rename = "subaperture:flags")]
    pub flags: Vec<Flag>,
    /// Ranges of lost samples (start, end), relative to the first sample.
    #[serde(rename = "subaperture:lost")]
    pub lost: Vec<(usize, usize)>,
}

impl Step {
    /// Make a step for a received burst of `samples` at a carrier. The writer sets its position in the recording.
    pub(crate) fn received(
        setup: &Setup,
        received: &Received,
        samples: usize,
        carrier_hz: f64,
    ) -> Self {
        let half_hz = 0.5 * setup.step_hz;
        let flags = [
            (Flag::Late, received.late),
            (Flag::Lost, !received.late && !received.lost.is_empty()),
            (Flag::Clipped, received.clipped != [0; 2]),
        ];
        let is = flags.into_iter().filter(|(_, is)| *is);
        Self {
            start: 0,
            samples,
            lower_hz: carrier_hz - half_hz,
            upper_hz: carrier_hz + half_hz,
            carrier_hz,
            sweep: 0,
            step: 0,
            time_s: received.first_s,
            gain_db: setup.receive_gain_db,
            bursts: 1,
            flags: is.map(|(flag, _)| flag).collect(),
            lost: received
                .lost
                .iter()
                .map(|gap| (gap.start, gap.end))
                .collect(),
        }
    }
}

/// Content of `.sigmf-meta` except its annotations.
#[derive(Deserialize)]
pub(super) struct Meta {
    pub(super) global: Global,
}

/// Global object of the metadata.
#[derive(Serialize, Deserialize)]
pub(super) struct Global {
    #[serde(rename = "core:datatype")]
    pub(super) datatype: String,
    #[serde(rename = "core:sample_rate")]
    pub(super) sample_rate_hz: f64,
    #[serde(rename = "core:num_channels", default = "one")]
    pub(super) num_channels: u32,
    #[serde(rename = "core:version")]
    pub(super) version: String,
    #[serde(rename = "core:recorder", default)]
    pub(super) recorder: String,
    #[serde(rename = "core:hw", default)]
    pub(super) hardware: String,
    #[serde(rename = "core:extensions", default)]
    pub(super) extensions: Vec<Extension>,
    #[serde(rename = "subaperture:setup")]
    pub(super) setup: Option<Setup>,
}

fn one() -> u32 {
    1
}

/// Namespace of an extension.
#[derive(Serialize, Deserialize)]
pub(super) struct Extension {
    pub(super) name: String,
    pub(super) version: String,
    pub(super) optional: bool,
}

impl Global {
    pub(super) fn of(setup: &Setup) -> Self {
        Self {
            datatype: DATATYPE.to_owned(),
            sample_rate_hz: setup.sample_rate_hz,
            num_channels: 2,
            version: VERSION.to_owned(),
            recorder: "subaperture-radio".to_owned(),
            hardware: setup.hardware.clone(),
            extensions: vec![Extension {
                name: SPACE.to_owned(),
                version: "1.0.0".to_owned(),
                optional: true,
            }],
            setup: Some(setup.clone()),
        }
    }
}
