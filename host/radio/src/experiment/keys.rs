//! TOML keys of an experiment beyond those of its plan.

use std::path::{Path, PathBuf};

use subaperture_describe::error::Fault;
use subaperture_describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture_describe::values::Values;
use subaperture_describe::{DEFAULT_MEMORY_BYTES, Description, DescriptionError};
use subaperture_model::units::Dimension;

use super::{Device, Experiment, ExperimentError, Simulated, Usrp, live, unread};
use crate::antennas::Reference;
use crate::fault::Faults;
use crate::plan::{Plan, keys as plan};
use crate::simulated::{Analogue, Coupled, Wiring};

const DELAY: ValueType = ValueType::Quantity(Dimension::Time, Bounds::NotNegative);
const CHANCE: ValueType = ValueType::Quantity(Dimension::Ratio, Bounds::Within(0.0, 1.0, "0 to 1"));

static DEVICE: Section = Section {
    path: "device",
    presence: Presence::Always,
    when: &[],
    selector: "kind",
    doc: "The radio: simulated, a USRP with the UHD driver, or the replay of a recording.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&["simulated", "uhd", "replay"]),
            Requirement::Required("\"simulated\""),
            "Kind of radio.",
        ),
        Key::new(
            "scenario",
            ValueType::Path,
            Requirement::Required("\"scene.toml\""),
            "Scenario file with scene, antenna positions and receiver, as for subap simulate.",
        )
        .when(&["simulated"]),
        Key::new(
            "real_time",
            ValueType::Flag,
            Requirement::Default("false"),
            "Run in real time; otherwise as fast as this machine allows.",
        )
        .when(&["simulated"]),
        Key::new(
            "impairments",
            ValueType::Flag,
            Requirement::Default("true"),
            "Simulate a B210's impairments: random phases, LO offset and settling after a retune, DC offset, IQ imbalance, gain steps.",
        )
        .when(&["simulated"]),
        Key::new(
            "loop_delay",
            DELAY,
            Requirement::Default("\"15 ns\""),
            "Delay of the loopback cable from the transmitter's coupler to receiver 0, with a loopback reference.",
        )
        .when(&["simulated"]),
        Key::new(
            "cable_delay",
            DELAY,
            Requirement::Default("\"20 ns\""),
            "Total delay of the cables to the transmit and receive antennas.",
        )
        .when(&["simulated"]),
        Key::new(
            "leakage",
            ValueType::Quantity(Dimension::Ratio, Bounds::NotNegative),
            Requirement::Default("3.0"),
            "Amplitude of the direct leakage from the transmit to the receive antennas, relative to the echo of 1 m^2 at the scenario's reference \
             point; 0 disables it.",
        )
        .when(&["simulated"]),
        Key::new(
            "leakage_delay",
            DELAY,
            Requirement::Default("\"0.5 ns\""),
            "Delay from antenna to antenna with a loopback reference. With a leakage reference it follows from the antenna positions.",
        )
        .when(&["simulated"]),
        Key::new(
            "serial",
            ValueType::Text,
            Requirement::Optional("\"30A1B2C\""),
            "Serial number, as printed by subap radio list. Not needed with a single device.",
        )
        .when(&["uhd"]),
        Key::new(
            "transmit_subdevice",
            ValueType::Text,
            Requirement::Default("\"A:A\""),
            "Transmit subdevice, in UHD's notation.",
        )
        .when(&["uhd"]),
        Key::new(
            "receive_subdevices",
            ValueType::Text,
            Requirement::Default("\"A:A A:B\""),
            "Subdevices of receiver 0 (the reference) and receiver 1, in UHD's notation.",
        )
        .when(&["uhd"]),
        Key::new(
            "wire",
            ValueType::Choice(&["sc16", "sc12"]),
            Requirement::Default("\"sc16\""),
            "Wire format of a sample: 16 bits, or the converter's 12 bits.",
        )
        .when(&["uhd"]),
        Key::new(
            "recording",
            ValueType::Path,
            Requirement::Required("\"walk.sigmf-meta\""),
            "Recording to replay.",
        )
        .when(&["replay"]),
    ],
};

static FAULTS: Section = Section {
    path: "faults",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Injected faults of the link between the radio and this machine, as probabilities per burst.",
    keys: &[
        Key::new(
            "overflow",
            CHANCE,
            Requirement::Default("0"),
            "Probability of an overrun, which loses the end of a burst.",
        ),
        Key::new(
            "lost_packet",
            CHANCE,
            Requirement::Default("0"),
            "Probability that a packet within a burst is lost.",
        ),
        Key::new(
            "late",
            CHANCE,
            Requirement::Default("0"),
            "Probability of a late command.",
        ),
        Key::new(
            "underflow",
            CHANCE,
            Requirement::Default("0"),
            "Probability of an underrun: the transmitter pauses for one packet.",
        ),
        Key::new(
            "packet",
            ValueType::Count(1, 1 << 20),
            Requirement::Default("200"),
            "Samples per packet.",
        ),
        Key::new(
            "unplug_at",
            ValueType::Count(0, u64::MAX),
            Requirement::Optional("500"),
            "Burst at which the radio is disconnected.",
        ),
        Key::new(
            "seed",
            ValueType::Count(0, i64::MAX as u64),
            Requirement::Default("0"),
            "Seed of the random faults.",
        ),
    ],
};

static FILES: Section = Section {
    path: "files",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Recording to write, and calibration of cables and channels.",
    keys: &[
        Key::new(
            "recording",
            ValueType::Path,
            Requirement::Optional("\"walk\""),
            "Name of the recording; the suffixes .sigmf-data and .sigmf-meta are added.",
        ),
        Key::new(
            "calibration",
            ValueType::Path,
            Requirement::Optional("\"calibration.json\""),
            "Calibration file written by subap radio calibrate for this set-up.",
        ),
    ],
};

pub(super) static SCHEMA: Schema = Schema {
    sections: &[
        &plan::TOP,
        &plan::PLAN,
        &plan::ANTENNAS,
        &plan::RADIO,
        &DEVICE,
        &FAULTS,
        &FILES,
        &live::LIVE,
    ],
    introduction: "A radio experiment is a TOML file with the capture plan, the radio, and the files.",
};

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

impl Experiment {
    /// Read an experiment file, and override keys with `settings` (pairs such as `plan.steps` and `50`). Its text may take
    /// [`DEFAULT_MEMORY_BYTES`] when it is parsed.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise all faults of its text.
    pub fn read(path: &Path, settings: &[(String, String)]) -> Result<Self, ExperimentError> {
        Self::read_within(path, settings, DEFAULT_MEMORY_BYTES)
    }

    /// As [`Self::read`], for a text that takes at most `memory_bytes` when it is parsed.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise all faults of its text.
    pub fn read_within(
        path: &Path,
        settings: &[(String, String)],
        memory_bytes: u64,
    ) -> Result<Self, ExperimentError> {
        let mut description = Description::read_within(path, memory_bytes).map_err(unread(path))?;
        for (key, value) in settings {
            description.set(&SCHEMA, "--set", key, value)?;
        }
        Ok(Self::describe(&description)?)
    }

    /// Make an experiment from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        build(description).map_err(|faults| description.explain(faults))
    }
}

fn build(description: &Description) -> Result<Experiment, Vec<Fault>> {
    let top = description.resolve(&SCHEMA)?;
    let folder = description.folder();
    let (device, files) = (top.section("device"), top.section("files"));
    let path = |values: &Values, key: &str| values.optional_text(key).map(|text| folder.join(text));
    let plan = plan::plan(&top)?;
    if plan.reference == Reference::Leakage
        && device.text("kind") == "simulated"
        && device.number("leakage") <= 0.0
    {
        let what = "expected a leakage above 0, since the leakage is the reference";
        return Err(vec![device.fault("leakage", what)]);
    }
    let live = match top.optional_section("live") {
        Some(values) => Some(live::build(values, folder, plan.reference)?),
        None => None,
    };
    let built = Experiment {
        device: match device.text("kind") {
            "uhd" => Device::Uhd(Usrp {
                serial: device.optional_text("serial").map(str::to_owned),
                transmit_subdevice: device.text("transmit_subdevice").to_owned(),
                receive_subdevices: device.text("receive_subdevices").to_owned(),
                twelve_bits: device.text("wire") == "sc12",
            }),
            "replay" => Device::Replay(folder.join(device.text("recording"))),
            _ => {
                let scenario = folder.join(device.text("scenario"));
                Device::Simulated(Box::new(simulated(device, scenario, &plan)))
            }
        },
        plan,
        faults: top.optional_section("faults").map(faults),
        recording: path(files, "recording"),
        calibration: path(files, "calibration"),
        live,
    };
    debug_assert_eq!(top.not_taken(), Vec::<String>::new(), "keys never read");
    Ok(built)
}

fn simulated(device: &Values, scenario: PathBuf, plan: &Plan) -> Simulated {
    let (cable_s, amplitude) = (device.number("cable_delay"), device.number("leakage"));
    let direct = Coupled {
        delay_s: device.number("leakage_delay"),
        amplitude,
    };
    let loop_s = device.number("loop_delay");
    let wiring = match (plan.reference, plan.antennas) {
        (Reference::Leakage, Some(antennas)) => Wiring::leakage(
            [0, 1].map(|receiver| antennas.direct_s(receiver)),
            [cable_s; 2],
            amplitude,
        ),
        _ => Wiring::loopback(loop_s, cable_s, (amplitude > 0.0).then_some(direct)),
    };
    Simulated {
        scenario,
        real_time: device.flag("real_time"),
        wiring,
        analogue: match device.flag("impairments") {
            true => Analogue::b210(),
            false => Analogue::default(),
        },
    }
}

fn faults(values: &Values) -> Faults {
    Faults {
        overflow: values.number("overflow"),
        lost_packet: values.number("lost_packet"),
        late: values.number("late"),
        underflow: values.number("underflow"),
        packet: values.count("packet") as usize,
        unplug_at: values.optional_count("unplug_at"),
        seed: values.count("seed"),
    }
}
