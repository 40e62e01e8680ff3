//! The metadata: what holds for all of a recording, and for a step.

use std::collections::BTreeMap;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use subaperture_model::phase_history::Band;

use crate::antennas::{Antennas, Reference};
use crate::transceiver::Received;

/// What the name of the steps' keys begins with.
pub(super) const SPACE: &str = "subaperture";
/// Version of SigMF that is written.
pub(super) const VERSION: &str = "1.2.0";
/// Two channels of 16-bit I and Q side by side.
pub(super) const DATATYPE: &str = "ci16_le";

/// What holds for all steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// A name.
    pub name: String,
    /// The device: kind and serial number.
    pub hardware: String,
    /// Complex samples a second.
    pub sample_rate_hz: f64,
    /// Samples a period of the tone.
    pub period: usize,
    /// Samples a step.
    pub samples: usize,
    /// First carrier, hertz.
    pub start_hz: f64,
    /// From carrier to carrier, hertz.
    pub step_hz: f64,
    /// Carriers a sweep.
    pub steps: usize,
    /// Gain of the transmitter, dB.
    pub transmit_gain_db: f64,
    /// Gains of the receivers, dB.
    pub receive_gain_db: [f64; 2],
    /// Ports of the receivers.
    pub receive_antennas: [String; 2],
    /// What phases are referred to.
    #[serde(default)]
    pub reference: Reference,
    /// Where the antennas are, if the plan said so.
    #[serde(default)]
    pub antennas: Option<Antennas>,
}

impl Setup {
    /// Frequencies of what a sweep comes to: carriers, each with the tone.
    pub fn band(&self) -> Band {
        Band {
            start_hz: self.start_hz + self.sample_rate_hz / self.period as f64,
            step_hz: self.step_hz,
            count: self.steps,
        }
    }
}

/// Why a step is not as good as others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flag {
    /// The burst came too late and was not sent: no sample of it is one.
    Late,
    /// Samples were lost.
    Lost,
    /// The reference was not steady.
    Unsteady,
    /// Samples at full scale.
    Clipped,
    /// A synthesiser said that it was not locked.
    Unlocked,
}

impl Flag {
    /// Every one, in the order in which they are counted.
    pub const ALL: [Self; 5] = [
        Self::Late,
        Self::Lost,
        Self::Unsteady,
        Self::Clipped,
        Self::Unlocked,
    ];
}

/// A step: a burst at a carrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Its first sample in the recording.
    #[serde(rename = "core:sample_start")]
    pub start: u64,
    /// Samples of each channel.
    #[serde(rename = "core:sample_count")]
    pub samples: usize,
    /// Lower edge of the band that it stands for, hertz.
    #[serde(rename = "core:freq_lower_edge")]
    pub lower_hz: f64,
    /// Upper edge, hertz.
    #[serde(rename = "core:freq_upper_edge")]
    pub upper_hz: f64,
    /// Its carrier, hertz.
    #[serde(rename = "subaperture:carrier_hz")]
    pub carrier_hz: f64,
    /// Index of the sweep.
    #[serde(rename = "subaperture:sweep")]
    pub sweep: u64,
    /// Index of the carrier.
    #[serde(rename = "subaperture:step")]
    pub step: usize,
    /// Device time of its first sample, seconds.
    #[serde(rename = "subaperture:time_s")]
    pub time_s: f64,
    /// Gains of both receivers, dB.
    #[serde(rename = "subaperture:gain_db")]
    pub gain_db: [f64; 2],
    /// Bursts until it was taken.
    #[serde(rename = "subaperture:bursts")]
    pub bursts: u32,
    /// What is wrong with it.
    #[serde(rename = "subaperture:flags")]
    pub flags: Vec<Flag>,
    /// Samples that are none, from and to, counted from its first.
    #[serde(rename = "subaperture:lost")]
    pub lost: Vec<(usize, usize)>,
}

impl Step {
    /// A burst of `samples` as it was received at a carrier, in a recording of this set-up. Its place in the recording is set as it is written.
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

/// `.sigmf-meta` as it is read.
#[derive(Deserialize)]
pub(super) struct Meta {
    pub(super) global: Global,
    #[serde(default)]
    pub(super) annotations: Vec<Annotation>,
}

/// Its global part.
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

/// An extension's namespace.
#[derive(Serialize, Deserialize)]
pub(super) struct Extension {
    pub(super) name: String,
    pub(super) version: String,
    pub(super) optional: bool,
}

/// A step, or what others have annotated.
#[derive(Deserialize)]
#[serde(untagged)]
pub(super) enum Annotation {
    Step(Box<Step>),
    Other(BTreeMap<String, IgnoredAny>),
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
