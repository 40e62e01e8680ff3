//! TOML keys of a chirp plan.

use std::io;
use std::path::Path;

use subaperture_describe::error::Fault;
use subaperture_describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture_describe::{Description, DescriptionError};
use subaperture_model::units::Dimension;

use super::Plan;
use crate::plan::{RADIO, TOP, configuration};

const FREQUENCY: ValueType = ValueType::Quantity(Dimension::Frequency, Bounds::Positive);
const TIME: ValueType = ValueType::Quantity(Dimension::Time, Bounds::Positive);

static CHIRP: Section = Section {
    path: "chirp",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Waveform and timing of the pulses.",
    keys: &[
        Key::new(
            "carrier",
            FREQUENCY,
            Requirement::Default("\"1.2 GHz\""),
            "Centre frequency of the chirp.",
        ),
        Key::new(
            "bandwidth",
            FREQUENCY,
            Requirement::Required("\"16 MHz\""),
            "Swept bandwidth. Range resolution is c / (2 bandwidth). At most the radio's bandwidth and sample rate.",
        ),
        Key::new(
            "duration",
            TIME,
            Requirement::Default("\"50 us\""),
            "Duration of the chirp.",
        ),
        Key::new(
            "interval",
            TIME,
            Requirement::Default("\"200 us\""),
            "Pulse repetition interval, a whole number of samples. The unambiguous range is c / 2 times the interval.",
        ),
        Key::new(
            "pulses",
            ValueType::Count(1, 1 << 20),
            Requirement::Default("16"),
            "Contiguous pulses per burst.",
        ),
        Key::new(
            "bursts",
            ValueType::Count(0, u64::MAX),
            Requirement::Default("1"),
            "Number of bursts; 0 runs until stopped.",
        ),
        Key::new(
            "reach",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Default("\"300 m\""),
            "Maximum range of a profile.",
        ),
        Key::new(
            "amplitude",
            ValueType::Quantity(Dimension::Ratio, Bounds::Within(1e-6, 1.0, "0.000001 to 1")),
            Requirement::Default("0.7"),
            "Amplitude of the chirp, relative to the converter's full scale.",
        ),
        Key::new(
            "lead",
            TIME,
            Requirement::Default("\"1 ms\""),
            "Lead time from a burst's command to its start, for the command to reach the device.",
        ),
    ],
};

static SCHEMA: Schema = Schema {
    sections: &[&TOP, &CHIRP, &RADIO],
    introduction: "The plan of a chirp radar is a TOML file.",
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
    let chirp = top.section("chirp");
    let built = Plan {
        name: top.text("name").to_owned(),
        carrier_hz: chirp.number("carrier"),
        bandwidth_hz: chirp.number("bandwidth"),
        duration_s: chirp.number("duration"),
        interval_s: chirp.number("interval"),
        pulses: chirp.count("pulses") as usize,
        bursts: chirp.count("bursts"),
        reach_m: chirp.number("reach"),
        amplitude: chirp.number("amplitude"),
        lead_s: chirp.number("lead"),
        radio: configuration(top.section("radio")),
    };
    debug_assert_eq!(top.not_taken(), Vec::<String>::new(), "keys never read");
    Ok(built)
}
