//! Keys of `[radar]` and the sections within.

use std::f64::consts::PI;

use crate::schema::{Bounds, Key, Kind, Need, Presence, Section};
use subaperture_model::units::Dimension;

pub static RADAR: Section = Section {
    path: "radar",
    presence: Presence::Always,
    when: &[],
    selector: "kind",
    doc: "What transmits and receives.",
    keys: &[
        Key::new(
            "kind",
            Kind::Choice(&["ideal", "pulsed", "fmcw", "stepped"]),
            Need::Required("\"ideal\""),
            "The waveform: flat phase history as the definition has it; pulses with a matched filter; \
             linear sweeps mixed with their echo; or carriers one after another.",
        ),
        Key::new(
            "pulses",
            Kind::Count(1, 10_000_000),
            Need::Required("64"),
            "Number of pulses, sweeps or cycles of carriers.",
        ),
        Key::new(
            "pri",
            Kind::Quantity(Dimension::Time, Bounds::Positive),
            Need::Optional("\"1 ms\""),
            "Time from pulse to pulse. Either this or prf.",
        ),
        Key::new(
            "prf",
            Kind::Quantity(Dimension::Frequency, Bounds::Positive),
            Need::Optional("\"1 kHz\""),
            "Pulses a second. Either this or pri.",
        ),
        Key::new(
            "first_pulse",
            Kind::Quantity(Dimension::Time, Bounds::Any),
            Need::Default("\"0 s\""),
            "Time of the first pulse on the platform's clock.",
        ),
        Key::new(
            "centre",
            Kind::Quantity(Dimension::Frequency, Bounds::Positive),
            Need::Required("\"10 GHz\""),
            "Centre frequency.",
        ),
        Key::new(
            "bandwidth",
            Kind::Quantity(Dimension::Frequency, Bounds::Positive),
            Need::Required("\"200 MHz\""),
            "Bandwidth over all samples: range resolution is c / (2 bandwidth). Of a sweep, the part \
             swept while it is sampled.",
        )
        .when(&["ideal", "fmcw", "stepped"]),
        Key::new(
            "samples",
            Kind::Count(2, 1 << 24),
            Need::Required("256"),
            "Samples a pulse: frequencies, carriers, or samples of the echo.",
        ),
        Key::new(
            "sample_rate",
            Kind::Quantity(Dimension::Frequency, Bounds::Positive),
            Need::Required("\"250 MHz\""),
            "Complex samples a second.",
        )
        .when(&["pulsed", "fmcw"]),
        Key::new(
            "window_start",
            Kind::Quantity(Dimension::Time, Bounds::NotNegative),
            Need::Optional("\"38.7 us\""),
            "Delay of sample 0 after the pulse's start. If left out, the echo of the reference lies in \
             the middle of the window, in the middle of the collection.",
        )
        .when(&["pulsed"]),
        Key::new(
            "sweep",
            Kind::Choice(&["up", "down"]),
            Need::Default("\"up\""),
            "Whether frequency rises or falls.",
        )
        .when(&["fmcw"]),
        Key::new(
            "mixer_delay",
            Kind::Quantity(Dimension::Time, Bounds::NotNegative),
            Need::Default("\"0 s\""),
            "Delay of the copy that the echo is mixed with; 0 for a plain homodyne radar.",
        )
        .when(&["fmcw"]),
        Key::new(
            "step_time",
            Kind::Quantity(Dimension::Time, Bounds::Positive),
            Need::Required("\"2 us\""),
            "Time from carrier to carrier.",
        )
        .when(&["stepped"]),
        Key::new(
            "dwell",
            Kind::Quantity(Dimension::Time, Bounds::Positive),
            Need::Optional("\"1 us\""),
            "Time over which a carrier's samples are averaged; noise bandwidth is its inverse. If left \
             out, step_time.",
        )
        .when(&["stepped"]),
        Key::new(
            "motion",
            Kind::Choice(&["stop-and-go", "true"]),
            Need::Default("\"stop-and-go\""),
            "Whether radar and scatterers stand still while a pulse lasts, or move as they do.",
        ),
        Key::new(
            "spreading",
            Kind::Flag,
            Need::Default("false"),
            "Whether echoes weaken with range, (R0 / R)^2 in amplitude, R0 the reference's range in the \
             middle pulse, number P/2 of P from 0.",
        ),
    ],
};

pub static PULSE: Section = Section {
    path: "radar.pulse",
    presence: Presence::Always,
    when: &["pulsed"],
    selector: "kind",
    doc: "The shape of a pulse.",
    keys: &[
        Key::new(
            "kind",
            Kind::Choice(&["lfm", "code"]),
            Need::Required("\"lfm\""),
            "A linear frequency sweep, or chips of equal length and given phases.",
        ),
        Key::new(
            "bandwidth",
            Kind::Quantity(Dimension::Frequency, Bounds::Positive),
            Need::Required("\"200 MHz\""),
            "Swept bandwidth: range resolution is c / (2 bandwidth).",
        )
        .when(&["lfm"]),
        Key::new(
            "duration",
            Kind::Quantity(Dimension::Time, Bounds::Positive),
            Need::Required("\"500 ns\""),
            "Length of the pulse.",
        )
        .when(&["lfm"]),
        Key::new(
            "sweep",
            Kind::Choice(&["up", "down"]),
            Need::Default("\"up\""),
            "Whether frequency rises or falls.",
        )
        .when(&["lfm"]),
        Key::new(
            "code",
            Kind::Choice(&[
                "barker-2",
                "barker-3",
                "barker-4",
                "barker-5",
                "barker-7",
                "barker-11",
                "barker-13",
            ]),
            Need::Optional("\"barker-13\""),
            "Phases of the chips by name. Either this or phases.",
        )
        .when(&["code"]),
        Key::new(
            "phases",
            Kind::Rows(&[Dimension::Angle], 1),
            Need::Optional("[\"0 deg\", \"0 deg\", \"180 deg\"]"),
            "Phase of each chip. Either this or code.",
        )
        .when(&["code"]),
        Key::new(
            "chip",
            Kind::Quantity(Dimension::Time, Bounds::Positive),
            Need::Required("\"10 ns\""),
            "Length of a chip.",
        )
        .when(&["code"]),
    ],
};

pub const NAME: Key = Key::new(
    "name",
    Kind::Text,
    Need::Optional("\"left\""),
    "A name for channels and errors. If left out, T or R and its number from 1.",
);
pub const OFFSET: Key = Key::new(
    "offset",
    Kind::Vector(Dimension::Length),
    Need::Default("\"0, 0, 0 m\""),
    "Its phase centre on the body, body axes.",
);
pub const BORESIGHT: Key = Key::new(
    "boresight",
    Kind::Vector(Dimension::Ratio),
    Need::Default("\"0, 1, 0\""),
    "Where it looks, body axes: to the left by default.",
);
pub const UP: Key = Key::new(
    "up",
    Kind::Vector(Dimension::Ratio),
    Need::Default("\"0, 0, 1\""),
    "The beam's elevation axis, body axes: azimuth is turned about it. Only its part orthogonal to the \
     boresight counts.",
);
pub const PATTERN: Key = Key::new(
    "pattern",
    Kind::Choice(&["isotropic", "gaussian", "aperture"]),
    Need::Default("\"isotropic\""),
    "Alike everywhere, a Gaussian beam, or that of a uniformly lit rectangle with its side lobes.",
);
/// Half-power widths end where the beam would no longer be one.
const WIDTH: Bounds = Bounds::Within(1e-5, PI, "0.001 to 180 deg");
pub const AZIMUTH: Key = Key::new(
    "azimuth",
    Kind::Quantity(Dimension::Angle, WIDTH),
    Need::Required("\"20 deg\""),
    "Full half-power width in azimuth.",
)
.when(&["gaussian", "aperture"]);
pub const ELEVATION: Key = Key::new(
    "elevation",
    Kind::Quantity(Dimension::Angle, WIDTH),
    Need::Required("\"40 deg\""),
    "Full half-power width in elevation.",
)
.when(&["gaussian", "aperture"]);

pub static TRANSMITTER: Section = Section {
    path: "radar.transmitter",
    presence: Presence::Many,
    when: &[],
    selector: "pattern",
    doc: "An antenna that transmits; several take turns, pulse by pulse. One isotropic antenna at the \
          body's origin if there is none.",
    keys: &[NAME, OFFSET, BORESIGHT, UP, PATTERN, AZIMUTH, ELEVATION],
};

pub static RECEIVER: Section = Section {
    path: "radar.receiver",
    presence: Presence::Many,
    when: &[],
    selector: "pattern",
    doc: "An antenna that receives; all of them receive every pulse. One isotropic antenna at the body's \
          origin if there is none.",
    keys: &[NAME, OFFSET, BORESIGHT, UP, PATTERN, AZIMUTH, ELEVATION],
};

const DECIBELS: Bounds = Bounds::Within(-300.0, 300.0, "-300 to 300 dB");

pub static NOISE: Section = Section {
    path: "radar.noise",
    presence: Presence::Optional,
    when: &[],
    selector: "kind",
    doc: "Thermal noise of the receiver.",
    keys: &[
        Key::new(
            "kind",
            Kind::Choice(&["relative", "equation"]),
            Need::Default("\"relative\""),
            "Relative to an echo, or from the radar equation.",
        ),
        Key::new(
            "power",
            Kind::Quantity(Dimension::Level, DECIBELS),
            Need::Required("\"-20 dB\""),
            "Power of a raw sample's noise relative to the echo of 1 m^2 at the reference.",
        )
        .when(&["relative"]),
        Key::new(
            "transmitted",
            Kind::Quantity(Dimension::Power, Bounds::Positive),
            Need::Required("\"30 dBm\""),
            "Peak transmitted power.",
        )
        .when(&["equation"]),
        Key::new(
            "transmit_gain",
            Kind::Quantity(Dimension::Gain, DECIBELS),
            Need::Default("\"0 dBi\""),
            "Gain of the transmitting antenna on boresight.",
        )
        .when(&["equation"]),
        Key::new(
            "receive_gain",
            Kind::Quantity(Dimension::Gain, DECIBELS),
            Need::Default("\"0 dBi\""),
            "Gain of the receiving antenna on boresight.",
        )
        .when(&["equation"]),
        Key::new(
            "losses",
            Kind::Quantity(Dimension::Level, Bounds::Within(0.0, 300.0, "0 to 300 dB")),
            Need::Default("\"0 dB\""),
            "Losses.",
        )
        .when(&["equation"]),
        Key::new(
            "noise_figure",
            Kind::Quantity(Dimension::Level, Bounds::Within(0.0, 300.0, "0 to 300 dB")),
            Need::Default("\"3 dB\""),
            "Noise figure of the receiver.",
        )
        .when(&["equation"]),
        Key::new(
            "temperature",
            Kind::Quantity(Dimension::Temperature, Bounds::NotNegative),
            Need::Default("\"290 K\""),
            "Noise temperature of the antenna.",
        )
        .when(&["equation"]),
    ],
};

pub static PHASE_NOISE: Section = Section {
    path: "radar.phase_noise",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Noise of the oscillator that transmission and reception share.",
    keys: &[Key::new(
        "levels",
        Kind::Rows(&[Dimension::Frequency, Dimension::PhaseNoise], 2),
        Need::Required("[\"10 Hz, -60 dBc/Hz\", \"1 kHz, -90 dBc/Hz\", \"1 MHz, -120 dBc/Hz\"]"),
        "Offsets from the carrier, rising, and single-sideband levels; straight between them on \
         logarithmic axes, nothing outside.",
    )],
};

pub static CLOCK: Section = Section {
    path: "radar.clock",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Errors of the radar's clock.",
    keys: &[
        Key::new(
            "offset",
            Kind::Quantity(Dimension::Ratio, Bounds::Within(-0.1, 0.1, "-10 to 10 %")),
            Need::Default("\"0 ppm\""),
            "Relative error of all frequencies.",
        ),
        Key::new(
            "jitter",
            Kind::Quantity(Dimension::Time, Bounds::NotNegative),
            Need::Default("\"0 s\""),
            "RMS jitter of a pulse's start of sampling.",
        ),
    ],
};

pub static INTERFERENCE: Section = Section {
    path: "radar.interference",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "A foreign transmitter.",
    keys: &[
        Key::new(
            "frequency",
            Kind::Quantity(Dimension::Frequency, Bounds::Positive),
            Need::Required("\"10.02 GHz\""),
            "Its carrier.",
        ),
        Key::new(
            "bandwidth",
            Kind::Quantity(Dimension::Frequency, Bounds::NotNegative),
            Need::Default("\"0 Hz\""),
            "Bandwidth of its noise-like signal; 0 for a tone.",
        ),
        Key::new(
            "power",
            Kind::Quantity(Dimension::Level, DECIBELS),
            Need::Required("\"10 dB\""),
            "Power of a raw sample relative to the echo of 1 m^2 at the reference.",
        ),
        Key::new(
            "duty",
            Kind::Quantity(Dimension::Ratio, Bounds::Within(0.0, 1.0, "0 to 1")),
            Need::Default("1"),
            "Part of the pulses that it disturbs.",
        ),
    ],
};

pub static CONVERTER: Section = Section {
    path: "radar.converter",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "The converter to numbers, one for I and one for Q.",
    keys: &[
        Key::new(
            "bits",
            Kind::Count(1, 24),
            Need::Required("12"),
            "Bits, sign included.",
        ),
        Key::new(
            "full_scale",
            Kind::Quantity(Dimension::Level, DECIBELS),
            Need::Required("\"40 dB\""),
            "Largest magnitude of I or Q relative to the echo of 1 m^2 at the reference; what is larger \
             saturates.",
        ),
    ],
};
