//! The keys of a plan of chirps, and the plan that they make.

use subaperture_describe::Description;
use subaperture_describe::error::Found;
use subaperture_describe::schema::{Bounds, Key, Kind, Need, Presence, Schema, Section};
use subaperture_model::units::Dimension;

use super::Plan;
use crate::plan::{RADIO, TOP, configuration};

const FREQUENCY: Kind = Kind::Quantity(Dimension::Frequency, Bounds::Positive);
const TIME: Kind = Kind::Quantity(Dimension::Time, Bounds::Positive);

static CHIRP: Section = Section {
    path: "chirp",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "The pulses.",
    keys: &[
        Key::new(
            "carrier",
            FREQUENCY,
            Need::Default("\"1.2 GHz\""),
            "The carrier, in the middle of the chirp.",
        ),
        Key::new(
            "bandwidth",
            FREQUENCY,
            Need::Required("\"16 MHz\""),
            "What a chirp sweeps: resolution is c / (2 bandwidth). At most the radio's bandwidth and sample rate.",
        ),
        Key::new(
            "duration",
            TIME,
            Need::Default("\"50 us\""),
            "How long it takes.",
        ),
        Key::new(
            "interval",
            TIME,
            Need::Default("\"200 us\""),
            "From pulse to pulse, a whole number of samples: ranges repeat after c / 2 times this.",
        ),
        Key::new(
            "pulses",
            Kind::Count(1, 1 << 20),
            Need::Default("16"),
            "Pulses a burst, one after another without a gap.",
        ),
        Key::new(
            "bursts",
            Kind::Count(0, u64::MAX),
            Need::Default("1"),
            "Bursts; 0 until stopped.",
        ),
        Key::new(
            "reach",
            Kind::Quantity(Dimension::Length, Bounds::Positive),
            Need::Default("\"300 m\""),
            "The farthest range of a profile.",
        ),
        Key::new(
            "amplitude",
            Kind::Quantity(Dimension::Ratio, Bounds::Within(1e-6, 1.0, "0.000001 to 1")),
            Need::Default("0.7"),
            "Amplitude of the chirp, of the converter's full scale.",
        ),
        Key::new(
            "lead",
            TIME,
            Need::Default("\"1 ms\""),
            "From a burst's command to the burst: what the command takes to the device.",
        ),
    ],
};

static SCHEMA: Schema = Schema {
    sections: &[&TOP, &CHIRP, &RADIO],
    introduction: "A plan of a radar of chirps is TOML.",
};

/// Every key with its kind, default and explanation, as text.
pub fn reference() -> String {
    SCHEMA.reference()
}

pub(super) fn build(description: &Description) -> Result<Plan, Vec<Found>> {
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
