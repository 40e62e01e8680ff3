//! Keys of `[radar]` and its subsections.

use std::f64::consts::PI;

use crate::schema::{Bounds, Key, Presence, Requirement, Section, ValueType};
use subaperture_model::units::Dimension;

pub static RADAR: Section = Section {
    path: "radar",
    presence: Presence::Always,
    when: &[],
    selector: "kind",
    doc: "Waveform, timing and antennas of the radar.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&["ideal", "pulsed", "fmcw", "stepped"]),
            Requirement::Required("\"ideal\""),
            "Waveform: ideal phase history by definition; pulses with a matched filter; \
                        dechirped linear sweeps (FMCW); or a stepped-frequency waveform.",
        ),
        Key::new(
            "pulses",
            ValueType::Count(1, 10_000_000),
            Requirement::Required("64"),
            "Number of pulses, FMCW sweeps or sweeps over all carriers.",
        ),
        Key::new(
            "pri",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Optional("\"1 ms\""),
            "Pulse repetition interval. Give either this or prf.",
        ),
        Key::new(
            "prf",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Optional("\"1 kHz\""),
            "Pulse repetition frequency. Give either this or pri.",
        ),
        Key::new(
            "first_pulse",
            ValueType::Quantity(Dimension::Time, Bounds::Any),
            Requirement::Default("\"0 s\""),
            "Time of the first pulse on the platform's clock.",
        ),
        Key::new(
            "centre",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"10 GHz\""),
            "Centre frequency.",
        ),
        Key::new(
            "bandwidth",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"200 MHz\""),
            "Bandwidth over all samples. Range resolution is c / (2 bandwidth). For FMCW, the bandwidth \
                        swept during sampling.",
        )
        .when(&["ideal", "fmcw", "stepped"]),
        Key::new(
            "samples",
            ValueType::Count(2, 1 << 24),
            Requirement::Required("256"),
            "Samples per pulse: frequencies, carriers, or samples of the echo.",
        ),
        Key::new(
            "sample_rate",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"250 MHz\""),
            "Complex sample rate.",
        )
        .when(&["pulsed", "fmcw"]),
        Key::new(
            "window_start",
            ValueType::Quantity(Dimension::Time, Bounds::NotNegative),
            Requirement::Optional("\"38.7 us\""),
            "Delay of sample 0 after the start of the pulse. Default: the echo of the reference at the middle of \
                        the collection lies in the middle of the receive window.",
        )
        .when(&["pulsed"]),
        Key::new(
            "sweep",
            ValueType::Choice(&["up", "down"]),
            Requirement::Default("\"up\""),
            "Direction of the frequency sweep.",
        )
        .when(&["fmcw"]),
        Key::new(
            "mixer_delay",
            ValueType::Quantity(Dimension::Time, Bounds::NotNegative),
            Requirement::Default("\"0 s\""),
            "Delay of the transmitted copy with which the echo is mixed; 0 for a homodyne radar.",
        )
        .when(&["fmcw"]),
        Key::new(
            "step_time",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Required("\"2 us\""),
            "Time from carrier to carrier.",
        )
        .when(&["stepped"]),
        Key::new(
            "dwell",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Optional("\"1 us\""),
            "Dwell time over which the samples of a carrier are averaged; the noise bandwidth is its inverse. \
                        Default: step_time.",
        )
        .when(&["stepped"]),
        Key::new(
            "motion",
            ValueType::Choice(&["stop-and-go", "true"]),
            Requirement::Default("\"stop-and-go\""),
            "Stop-and-go approximation within a pulse, or true intra-pulse motion of radar and scatterers.",
        ),
        Key::new(
            "spreading",
            ValueType::Flag,
            Requirement::Default("false"),
            "Apply spreading loss, (R0 / R)^2 in amplitude, with R0 the range of the reference at the \
                        middle pulse, number P/2 of P from 0.",
        ),
    ],
};

pub static PULSE: Section = Section {
    path: "radar.pulse",
    presence: Presence::Always,
    when: &["pulsed"],
    selector: "kind",
    doc: "Shape of the pulse.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&["lfm", "code"]),
            Requirement::Required("\"lfm\""),
            "Linear frequency modulation (chirp), or a phase code with chips of equal duration.",
        ),
        Key::new(
            "bandwidth",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"200 MHz\""),
            "Swept bandwidth. Range resolution is c / (2 bandwidth).",
        )
        .when(&["lfm"]),
        Key::new(
            "duration",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Required("\"500 ns\""),
            "Duration of the pulse.",
        )
        .when(&["lfm"]),
        Key::new(
            "sweep",
            ValueType::Choice(&["up", "down"]),
            Requirement::Default("\"up\""),
            "Direction of the frequency sweep.",
        )
        .when(&["lfm"]),
        Key::new(
            "code",
            ValueType::Choice(&[
                "barker-2",
                "barker-3",
                "barker-4",
                "barker-5",
                "barker-7",
                "barker-11",
                "barker-13",
            ]),
            Requirement::Optional("\"barker-13\""),
            "Name of the phase code. Give either this or phases.",
        )
        .when(&["code"]),
        Key::new(
            "phases",
            ValueType::Rows(&[Dimension::Angle], 1),
            Requirement::Optional("[\"0 deg\", \"0 deg\", \"180 deg\"]"),
            "Phase of each chip. Give either this or code.",
        )
        .when(&["code"]),
        Key::new(
            "chip",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Required("\"10 ns\""),
            "Duration of a chip.",
        )
        .when(&["code"]),
    ],
};

pub const NAME: Key = Key::new(
    "name",
    ValueType::Text,
    Requirement::Optional("\"left\""),
    "Name, for channels and errors. Default: T or R, and a number from 1.",
);
pub const OFFSET: Key = Key::new(
    "offset",
    ValueType::Vector(Dimension::Length),
    Requirement::Default("\"0, 0, 0 m\""),
    "Phase centre in body axes.",
);
pub const BORESIGHT: Key = Key::new(
    "boresight",
    ValueType::Vector(Dimension::Ratio),
    Requirement::Default("\"0, 1, 0\""),
    "Boresight direction in body axes; the default is to the left.",
);
pub const UP: Key = Key::new(
    "up",
    ValueType::Vector(Dimension::Ratio),
    Requirement::Default("\"0, 0, 1\""),
    "Elevation axis of the beam in body axes, about which azimuth is measured. Only its component orthogonal \
        to the boresight is used.",
);
pub const PATTERN: Key = Key::new(
    "pattern",
    ValueType::Choice(&["isotropic", "gaussian", "aperture"]),
    Requirement::Default("\"isotropic\""),
    "Antenna pattern: isotropic, Gaussian beam, or uniformly illuminated rectangular aperture with sidelobes.",
);
/// Half-power beamwidths.
const WIDTH: Bounds = Bounds::Within(1e-5, PI, "0.001 to 180 deg");
pub const AZIMUTH: Key = Key::new(
    "azimuth",
    ValueType::Quantity(Dimension::Angle, WIDTH),
    Requirement::Required("\"20 deg\""),
    "Full half-power beamwidth in azimuth.",
)
.when(&["gaussian", "aperture"]);
pub const ELEVATION: Key = Key::new(
    "elevation",
    ValueType::Quantity(Dimension::Angle, WIDTH),
    Requirement::Required("\"40 deg\""),
    "Full half-power beamwidth in elevation.",
)
.when(&["gaussian", "aperture"]);

pub static TRANSMITTER: Section = Section {
    path: "radar.transmitter",
    presence: Presence::Many,
    when: &[],
    selector: "pattern",
    doc: "Transmit antenna; several transmit alternately, pulse by pulse. Default: one isotropic antenna at the \
             body's origin.",
    keys: &[NAME, OFFSET, BORESIGHT, UP, PATTERN, AZIMUTH, ELEVATION],
};

pub static RECEIVER: Section = Section {
    path: "radar.receiver",
    presence: Presence::Many,
    when: &[],
    selector: "pattern",
    doc: "Receive antenna; all of them receive every pulse. Default: one isotropic antenna at the body's \
             origin.",
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
            ValueType::Choice(&["relative", "equation"]),
            Requirement::Default("\"relative\""),
            "Noise power relative to an echo, or by the radar equation.",
        ),
        Key::new(
            "power",
            ValueType::Quantity(Dimension::Level, DECIBELS),
            Requirement::Required("\"-20 dB\""),
            "Noise power of a raw sample relative to the echo of 1 m^2 at the reference.",
        )
        .when(&["relative"]),
        Key::new(
            "transmitted",
            ValueType::Quantity(Dimension::Power, Bounds::Positive),
            Requirement::Required("\"30 dBm\""),
            "Peak transmit power.",
        )
        .when(&["equation"]),
        Key::new(
            "transmit_gain",
            ValueType::Quantity(Dimension::Gain, DECIBELS),
            Requirement::Default("\"0 dBi\""),
            "Gain of the transmit antenna on boresight.",
        )
        .when(&["equation"]),
        Key::new(
            "receive_gain",
            ValueType::Quantity(Dimension::Gain, DECIBELS),
            Requirement::Default("\"0 dBi\""),
            "Gain of the receive antenna on boresight.",
        )
        .when(&["equation"]),
        Key::new(
            "losses",
            ValueType::Quantity(Dimension::Level, Bounds::Within(0.0, 300.0, "0 to 300 dB")),
            Requirement::Default("\"0 dB\""),
            "System losses.",
        )
        .when(&["equation"]),
        Key::new(
            "noise_figure",
            ValueType::Quantity(Dimension::Level, Bounds::Within(0.0, 300.0, "0 to 300 dB")),
            Requirement::Default("\"3 dB\""),
            "Noise figure of the receiver.",
        )
        .when(&["equation"]),
        Key::new(
            "temperature",
            ValueType::Quantity(Dimension::Temperature, Bounds::NotNegative),
            Requirement::Default("\"290 K\""),
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
    doc: "Phase noise of the oscillator shared by transmitter and receiver.",
    keys: &[Key::new(
        "levels",
        ValueType::Rows(&[Dimension::Frequency, Dimension::PhaseNoise], 2),
        Requirement::Required(
            "[\"10 Hz, -60 dBc/Hz\", \"1 kHz, -90 dBc/Hz\", \"1 MHz, -120 dBc/Hz\"]",
        ),
        "Ascending offset frequencies from the carrier, and single-sideband levels; interpolated linearly on \
                logarithmic axes, zero outside.",
    )],
};

pub static CLOCK: Section = Section {
    path: "radar.clock",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Errors of the sample clock.",
    keys: &[
        Key::new(
            "offset",
            ValueType::Quantity(Dimension::Ratio, Bounds::Within(-0.1, 0.1, "-10 to 10 %")),
            Requirement::Default("\"0 ppm\""),
            "Fractional error of all frequencies.",
        ),
        Key::new(
            "jitter",
            ValueType::Quantity(Dimension::Time, Bounds::NotNegative),
            Requirement::Default("\"0 s\""),
            "RMS jitter of the start of sampling of each pulse.",
        ),
    ],
};

pub static INTERFERENCE: Section = Section {
    path: "radar.interference",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "Interfering transmitter.",
    keys: &[
        Key::new(
            "frequency",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"10.02 GHz\""),
            "Carrier frequency.",
        ),
        Key::new(
            "bandwidth",
            ValueType::Quantity(Dimension::Frequency, Bounds::NotNegative),
            Requirement::Default("\"0 Hz\""),
            "Bandwidth of a noise-like signal; 0 for a tone.",
        ),
        Key::new(
            "power",
            ValueType::Quantity(Dimension::Level, DECIBELS),
            Requirement::Required("\"10 dB\""),
            "Power of the interference in a raw sample relative to the echo of 1 m^2 at the reference.",
        ),
        Key::new(
            "duty",
            ValueType::Quantity(Dimension::Ratio, Bounds::Within(0.0, 1.0, "0 to 1")),
            Requirement::Default("1"),
            "Duty cycle: fraction of the pulses with interference.",
        ),
    ],
};

pub static CONVERTER: Section = Section {
    path: "radar.converter",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Analogue-to-digital converters of I and Q.",
    keys: &[
        Key::new(
            "bits",
            ValueType::Count(1, 24),
            Requirement::Required("12"),
            "Number of bits, sign included.",
        ),
        Key::new(
            "full_scale",
            ValueType::Quantity(Dimension::Level, DECIBELS),
            Requirement::Required("\"40 dB\""),
            "Largest magnitude of I or Q relative to the echo of 1 m^2 at the reference; larger values \
                        saturate.",
        ),
    ],
};
