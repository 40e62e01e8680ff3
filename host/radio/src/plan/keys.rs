//! The keys of a plan, and the plan that they make.

use subaperture_describe::Description;
use subaperture_describe::error::Found;
use subaperture_describe::schema::{Bounds, Key, Kind, Need, Presence, Schema, Section};
use subaperture_describe::values::Values;
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
        Kind::Text,
        Need::Default("\"capture\""),
        "A name for titles and records.",
    )],
};

const FREQUENCY: Kind = Kind::Quantity(Dimension::Frequency, Bounds::Positive);
const TIME: Kind = Kind::Quantity(Dimension::Time, Bounds::Positive);
const TIME_OR_NONE: Kind = Kind::Quantity(Dimension::Time, Bounds::NotNegative);

pub(crate) static PLAN: Section = Section {
    path: "plan",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "The carriers, how long at each, in which order, how often.",
    keys: &[
        Key::new(
            "start",
            FREQUENCY,
            Need::Required("\"1.1 GHz\""),
            "The first carrier.",
        ),
        Key::new(
            "stop",
            FREQUENCY,
            Need::Required("\"1.3 GHz\""),
            "The end of the last carrier's step: resolution is c / (2 (stop - start)).",
        ),
        Key::new(
            "steps",
            Kind::Count(1, 1 << 16),
            Need::Required("50"),
            "Carriers a sweep: ranges repeat after this many times the resolution.",
        ),
        Key::new(
            "avoid",
            Kind::Rows(&[Dimension::Frequency, Dimension::Frequency], 1),
            Need::Optional("[\"1.164 GHz, 1.188 GHz\"]"),
            "Bands in which nothing is sent, each from and to: carriers whose step reaches into one are left out, up to a third, and profiles fill them.",
        ),
        Key::new(
            "order",
            Kind::Choice(&["up", "down", "up-down", "shuffled"]),
            Need::Default("\"up\""),
            "The order of carriers; up-down turns at the ends, shuffled is another each sweep.",
        ),
        Key::new(
            "seed",
            Kind::Count(0, i64::MAX as u64),
            Need::Default("0"),
            "Seed of the shuffled order.",
        ),
        Key::new(
            "dwell",
            TIME,
            Need::Default("\"1 ms\""),
            "Time recorded at each carrier.",
        ),
        Key::new(
            "tone",
            FREQUENCY,
            Need::Default("\"125 kHz\""),
            "The tone above its carrier; the sample rate is a whole multiple of it, 3 or more.",
        ),
        Key::new(
            "amplitude",
            Kind::Quantity(Dimension::Ratio, Bounds::Within(1e-6, 1.0, "0.000001 to 1")),
            Need::Default("0.7"),
            "Amplitude of the tone, of the converter's full scale.",
        ),
        Key::new(
            "sweeps",
            Kind::Count(0, u64::MAX),
            Need::Default("1"),
            "Sweeps; 0 until stopped.",
        ),
        Key::new(
            "pri",
            TIME_OR_NONE,
            Need::Default("\"0 s\""),
            "From sweep to sweep; 0 for one after another.",
        ),
        Key::new(
            "lead",
            TIME,
            Need::Default("\"1 ms\""),
            "From a burst's command to the burst: what the command takes to the device.",
        ),
        Key::new(
            "steady",
            Kind::Quantity(Dimension::Ratio, Bounds::Positive),
            Need::Default("0.02"),
            "A reference is steady if its amplitude differs by no more than this part, and its phase from a straight line by no \
             more than this many radians.",
        ),
        Key::new(
            "bursts",
            Kind::Count(1, 1000),
            Need::Default("8"),
            "Bursts at a carrier, at most, until the reference is steady; the last is kept and marked.",
        ),
        Key::new(
            "reference",
            Kind::Choice(&["loopback", "leakage"]),
            Need::Default("\"loopback\""),
            "What phases are referred to: the transmitter by a cable to receiver 0, or heard directly by both receivers' antennas.",
        ),
    ],
};

pub(crate) static ANTENNAS: Section = Section {
    path: "antennas",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Where the antennas are on what carries them: x forward, y left, z up. The leakage as the reference needs it.",
    keys: &[
        Key::new(
            "transmitter",
            Kind::Vector(Dimension::Length),
            Need::Required("\"0, 0, 0 m\""),
            "The antenna that sends.",
        ),
        Key::new(
            "receiver_0",
            Kind::Vector(Dimension::Length),
            Need::Optional("\"20, 0, 0 cm\""),
            "That of receiver 0; with a loop there is none.",
        ),
        Key::new(
            "receiver_1",
            Kind::Vector(Dimension::Length),
            Need::Required("\"30.7, 0, 0 cm\""),
            "That of receiver 1.",
        ),
    ],
};

pub(crate) static RADIO: Section = Section {
    path: "radio",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "What the radio is set to.",
    keys: &[
        Key::new(
            "master_clock",
            FREQUENCY,
            Need::Default("\"16 MHz\""),
            "Its master clock.",
        ),
        Key::new(
            "sample_rate",
            FREQUENCY,
            Need::Default("\"1 MHz\""),
            "Complex samples a second, both ways.",
        ),
        Key::new(
            "bandwidth",
            FREQUENCY,
            Need::Default("\"1 MHz\""),
            "Analog bandwidth.",
        ),
        Key::new(
            "transmit_gain",
            Kind::Quantity(Dimension::Level, Bounds::NotNegative),
            Need::Default("\"60 dB\""),
            "Gain of the transmitter.",
        ),
        Key::new(
            "reference_gain",
            Kind::Quantity(Dimension::Level, Bounds::NotNegative),
            Need::Default("\"40 dB\""),
            "Gain of receiver 0, the reference.",
        ),
        Key::new(
            "receive_gain",
            Kind::Quantity(Dimension::Level, Bounds::NotNegative),
            Need::Default("\"40 dB\""),
            "Gain of receiver 1, the echo.",
        ),
        Key::new(
            "transmit_antenna",
            Kind::Text,
            Need::Default("\"TX/RX\""),
            "The transmitter's port.",
        ),
        Key::new(
            "reference_antenna",
            Kind::Text,
            Need::Default("\"RX2\""),
            "Receiver 0's port.",
        ),
        Key::new(
            "receive_antenna",
            Kind::Text,
            Need::Default("\"RX2\""),
            "Receiver 1's port.",
        ),
        Key::new(
            "clock",
            Kind::Choice(&["internal", "external", "gpsdo"]),
            Need::Default("\"internal\""),
            "What frequencies come from.",
        ),
        Key::new(
            "pps",
            Kind::Choice(&["internal", "external", "gpsdo"]),
            Need::Default("\"internal\""),
            "What times come from.",
        ),
    ],
};

static SCHEMA: Schema = Schema {
    sections: &[&TOP, &PLAN, &ANTENNAS, &RADIO],
    introduction: "A plan of a capture is TOML.",
};

/// Every key with its kind, default and explanation, as text.
pub fn reference() -> String {
    SCHEMA.reference()
}

pub(super) fn build(description: &Description) -> Result<Plan, Vec<Found>> {
    let top = description.resolve(&SCHEMA)?;
    let built = plan(&top)?;
    debug_assert_eq!(top.not_taken(), Vec::<String>::new(), "keys never read");
    Ok(built)
}

/// The plan of a text that may have more sections.
pub(crate) fn plan(top: &Values) -> Result<Plan, Vec<Found>> {
    let (plan, radio) = (top.section("plan"), top.section("radio"));
    let (start_hz, stop_hz) = (plan.number("start"), plan.number("stop"));
    if stop_hz <= start_hz {
        return Err(vec![plan.fault(
            "stop",
            "the stop has to be above the start: exchange them, and say order = \"down\"",
        )]);
    }
    let avoid = plan.optional_rows("avoid").unwrap_or_default();
    let avoid: Vec<(f64, f64)> = avoid.iter().map(|row| (row[0], row[1])).collect();
    if avoid.iter().any(|(from_hz, to_hz)| to_hz <= from_hz) {
        let what = "a band to avoid is from and to, and to is above from";
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
                    "the leakage as the reference is heard by both receivers: say where receiver 0's antenna is",
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

/// What a radio is set to, of its section.
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
