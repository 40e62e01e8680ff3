//! TOML keys of a stepped-frequency capture plan.

use std::io;
use std::path::Path;

use subaperture_describe::error::Fault;
use subaperture_describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture_describe::values::Values;
use subaperture_describe::{Description, DescriptionError};
use subaperture_model::units::Dimension;

use super::{Order, Plan};
use crate::antennas::{Antennas, Reference};
use crate::transceiver::{Configuration, Source};

pub(crate) static TOP: Section = Section {
    path: "",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "",
    keys: &[Key::new(
        "name",
        ValueType::Text,
        Requirement::Default("\"capture\""),
        "Name of the capture, for titles and records.",
    )],
};

const FREQUENCY: ValueType = ValueType::Quantity(Dimension::Frequency, Bounds::Positive);
const TIME: ValueType = ValueType::Quantity(Dimension::Time, Bounds::Positive);
const TIME_OR_NONE: ValueType = ValueType::Quantity(Dimension::Time, Bounds::NotNegative);

pub(crate) static PLAN: Section = Section {
    path: "plan",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Carriers, dwell time, order and repetition of the sweeps.",
    keys: &[
        Key::new(
            "start",
            FREQUENCY,
            Requirement::Required("\"1.1 GHz\""),
            "First carrier.",
        ),
        Key::new(
            "stop",
            FREQUENCY,
            Requirement::Required("\"1.3 GHz\""),
            "Upper edge of the last carrier's step. Range resolution is c / (2 (stop - start)).",
        ),
        Key::new(
            "steps",
            ValueType::Count(1, 1 << 16),
            Requirement::Required("50"),
            "Carriers per sweep. The unambiguous range is this many times the resolution.",
        ),
        Key::new(
            "avoid",
            ValueType::Rows(&[Dimension::Frequency, Dimension::Frequency], 1),
            Requirement::Optional("[\"1.164 GHz, 1.188 GHz\"]"),
            "Bands without transmission, each as lower and upper edge. Carriers whose step overlaps a band are skipped, at most a third of all, and interpolated in range profiles.",
        ),
        Key::new(
            "order",
            ValueType::Choice(&["up", "down", "up-down", "shuffled"]),
            Requirement::Default("\"up\""),
            "Order of the carriers. up-down alternates from sweep to sweep; shuffled is a new random order each sweep.",
        ),
        Key::new(
            "seed",
            ValueType::Count(0, i64::MAX as u64),
            Requirement::Default("0"),
            "Seed of the shuffled order.",
        ),
        Key::new(
            "dwell",
            TIME,
            Requirement::Default("\"1 ms\""),
            "Recording time at each carrier.",
        ),
        Key::new(
            "tone",
            FREQUENCY,
            Requirement::Default("\"125 kHz\""),
            "Offset of the tone above its carrier (IF). The sample rate must be a whole multiple of it, at least 3 times.",
        ),
        Key::new(
            "amplitude",
            ValueType::Quantity(Dimension::Ratio, Bounds::Within(1e-6, 1.0, "0.000001 to 1")),
            Requirement::Default("0.7"),
            "Amplitude of the tone, relative to the converter's full scale.",
        ),
        Key::new(
            "sweeps",
            ValueType::Count(0, u64::MAX),
            Requirement::Default("1"),
            "Number of sweeps; 0 runs until stopped.",
        ),
        Key::new(
            "pri",
            TIME_OR_NONE,
            Requirement::Default("\"0 s\""),
            "Sweep repetition interval; 0 for back-to-back sweeps.",
        ),
        Key::new(
            "lead",
            TIME,
            Requirement::Default("\"1 ms\""),
            "Lead time from a burst's command to its start, for the command to reach the device.",
        ),
        Key::new(
            "steady",
            ValueType::Quantity(Dimension::Ratio, Bounds::Positive),
            Requirement::Default("0.02"),
            "Settling threshold of the reference tone: largest relative deviation of its amplitude, and largest deviation of its phase \
             from a straight line in radians.",
        ),
        Key::new(
            "bursts",
            ValueType::Count(1, 1000),
            Requirement::Default("8"),
            "Maximum number of bursts at a carrier until the reference is steady. If it never is, the last burst is kept and flagged.",
        ),
        Key::new(
            "reference",
            ValueType::Choice(&["loopback", "leakage"]),
            Requirement::Default("\"loopback\""),
            "Phase reference: a loopback cable from the transmitter to receiver 0, or the direct leakage received by both antennas.",
        ),
    ],
};

pub(crate) static ANTENNAS: Section = Section {
    path: "antennas",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Antenna positions on the body: x forward, y left, z up. Required with a leakage reference.",
    keys: &[
        Key::new(
            "transmitter",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"0, 0, 0 m\""),
            "Transmit antenna.",
        ),
        Key::new(
            "receiver_0",
            ValueType::Vector(Dimension::Length),
            Requirement::Optional("\"20, 0, 0 cm\""),
            "Antenna of receiver 0; unused with a loopback reference.",
        ),
        Key::new(
            "receiver_1",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"30.7, 0, 0 cm\""),
            "Antenna of receiver 1.",
        ),
    ],
};

pub(crate) static RADIO: Section = Section {
    path: "radio",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Radio settings.",
    keys: &[
        Key::new(
            "master_clock",
            FREQUENCY,
            Requirement::Default("\"16 MHz\""),
            "Master clock rate.",
        ),
        Key::new(
            "sample_rate",
            FREQUENCY,
            Requirement::Default("\"1 MHz\""),
            "Complex sample rate of transmitter and receivers.",
        ),
        Key::new(
            "bandwidth",
            FREQUENCY,
            Requirement::Default("\"1 MHz\""),
            "Analog bandwidth.",
        ),
        Key::new(
            "transmit_gain",
            ValueType::Quantity(Dimension::Level, Bounds::NotNegative),
            Requirement::Default("\"60 dB\""),
            "Transmit gain.",
        ),
        Key::new(
            "reference_gain",
            ValueType::Quantity(Dimension::Level, Bounds::NotNegative),
            Requirement::Default("\"40 dB\""),
            "Gain of receiver 0, the reference.",
        ),
        Key::new(
            "receive_gain",
            ValueType::Quantity(Dimension::Level, Bounds::NotNegative),
            Requirement::Default("\"40 dB\""),
            "Gain of receiver 1, the echo.",
        ),
        Key::new(
            "transmit_antenna",
            ValueType::Text,
            Requirement::Default("\"TX/RX\""),
            "Transmit port.",
        ),
        Key::new(
            "reference_antenna",
            ValueType::Text,
            Requirement::Default("\"RX2\""),
            "Port of receiver 0.",
        ),
        Key::new(
            "receive_antenna",
            ValueType::Text,
            Requirement::Default("\"RX2\""),
            "Port of receiver 1.",
        ),
        Key::new(
            "clock",
            ValueType::Choice(&["internal", "external", "gpsdo"]),
            Requirement::Default("\"internal\""),
            "Source of the reference clock.",
        ),
        Key::new(
            "pps",
            ValueType::Choice(&["internal", "external", "gpsdo"]),
            Requirement::Default("\"internal\""),
            "Source of the pulse per second, which defines device time.",
        ),
    ],
};

static SCHEMA: Schema = Schema {
    sections: &[&TOP, &PLAN, &ANTENNAS, &RADIO],
    introduction: "A capture plan is a TOML file.",
};

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

impl Plan {
    /// Read a plan from a TOML file.
    ///
    /// # Errors
    /// The outer error if the file cannot be read, the inner one if its text is invalid.
    pub fn read(path: &Path) -> io::Result<Result<Self, DescriptionError>> {
        Description::read(path).map(|description| Self::describe(&description))
    }

    /// Make a plan from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        build(description).map_err(|faults| description.explain(faults))
    }
}

fn build(description: &Description) -> Result<Plan, Vec<Fault>> {
    let top = description.resolve(&SCHEMA)?;
    let built = plan(&top)?;
    debug_assert_eq!(top.not_taken(), Vec::<String>::new(), "keys never read");
    Ok(built)
}

/// Build the plan of a description that may have more sections.
pub(crate) fn plan(top: &Values) -> Result<Plan, Vec<Fault>> {
    let (plan, radio) = (top.section("plan"), top.section("radio"));
    let (start_hz, stop_hz) = (plan.number("start"), plan.number("stop"));
    if stop_hz <= start_hz {
        return Err(vec![plan.fault(
            "stop",
            "expected a stop frequency above the start: exchange them, and set order = \"down\"",
        )]);
    }
    let avoid = plan.optional_rows("avoid").unwrap_or_default();
    let avoid: Vec<(f64, f64)> = avoid.iter().map(|row| (row[0], row[1])).collect();
    if avoid.iter().any(|(from_hz, to_hz)| to_hz <= from_hz) {
        let what =
            "expected the lower and upper edges of a band, where the upper edge is above the lower";
        return Err(vec![plan.fault("avoid", what)]);
    }
    let seed = plan.count("seed");
    let reference = match plan.text("reference") {
        "leakage" => Reference::Leakage,
        _ => Reference::Loopback,
    };
    let antennas = match top.optional_section("antennas") {
        Some(places) => {
            let first = places.optional_vector("receiver_0");
            if first.is_none() && reference == Reference::Leakage {
                return Err(vec![places.fault(
                    "receiver_0",
                    "a leakage reference uses both receivers: give the position of receiver 0's antenna",
                )]);
            }
            Some(Antennas {
                transmitter_m: places.vector("transmitter"),
                receivers_m: [first.unwrap_or_default(), places.vector("receiver_1")],
            })
        }
        None => None,
    };
    Ok(Plan {
        name: top.text("name").to_owned(),
        start_hz,
        stop_hz,
        steps: plan.count("steps") as usize,
        avoid,
        order: match plan.text("order") {
            "down" => Order::Down,
            "up-down" => Order::UpDown,
            "shuffled" => Order::Shuffled(seed),
            _ => Order::Up,
        },
        dwell_s: plan.number("dwell"),
        tone_hz: plan.number("tone"),
        amplitude: plan.number("amplitude"),
        sweeps: plan.count("sweeps"),
        pri_s: plan.number("pri"),
        lead_s: plan.number("lead"),
        steady: plan.number("steady"),
        bursts: plan.count("bursts") as u32,
        reference,
        antennas,
        radio: configuration(radio),
    })
}

/// Radio settings of the `[radio]` section.
pub(crate) fn configuration(radio: &Values) -> Configuration {
    let source = |key: &str| match radio.text(key) {
        "external" => Source::External,
        "gpsdo" => Source::Gpsdo,
        _ => Source::Internal,
    };
    Configuration {
        master_clock_hz: radio.number("master_clock"),
        sample_rate_hz: radio.number("sample_rate"),
        bandwidth_hz: radio.number("bandwidth"),
        transmit_gain_db: radio.number("transmit_gain"),
        receive_gain_db: [radio.number("reference_gain"), radio.number("receive_gain")],
        transmit_antenna: radio.text("transmit_antenna").to_owned(),
        receive_antennas: ["reference_antenna", "receive_antenna"]
            .map(|key| radio.text(key).to_owned()),
        clock: source("clock"),
        pps: source("pps"),
    }
}
