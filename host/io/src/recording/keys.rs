//! The table of keys of a recording's description.

use subaperture_describe::keys::motion::{
    AT, BEARING, CENTRE, POINTS, POSITION, TRACK_FILE, TRACK_RECORD, TRACK_SKIP_DAMAGED, TURN,
    VELOCITY,
};
use subaperture_describe::keys::place;
use subaperture_describe::keys::radar::{
    AZIMUTH, BORESIGHT, ELEVATION, NAME, OFFSET, PATTERN, PULSE, UP,
};
use subaperture_describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture_model::units::Dimension;

/// Keys of a recording's description.
pub(super) static SCHEMA: Schema = Schema {
    sections: &[
        &TOP,
        &RECORDING,
        &SCENE,
        &ORIGIN,
        &RADAR,
        &PULSE,
        &TRANSMITTER,
        &RECEIVER,
        &PLATFORM,
    ],
    introduction: "The description of a recording is TOML. An ARRAY is named as in the .npz that holds the samples, or is \
                   the path of a .npy file.",
};

static TOP: Section = Section {
    path: "",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "",
    keys: &[Key::new(
        "name",
        ValueType::Text,
        Requirement::Optional("\"yard\""),
        "Name for titles and reports. Default: the file name.",
    )],
};

const PHASE: Key = Key::new(
    "phase",
    ValueType::Quantity(Dimension::Angle, Bounds::Any),
    Requirement::Default("\"0 deg\""),
    "Phase error of the antenna, exp(+j phase) after [recording] phase. It is removed.",
);
const LEVEL: Key = Key::new(
    "level",
    ValueType::Quantity(
        Dimension::Level,
        Bounds::Within(-300.0, 300.0, "-300 to 300 dB"),
    ),
    Requirement::Default("\"0 dB\""),
    "Gain error of the antenna. It is removed.",
);

static TRANSMITTER: Section = Section {
    path: "radar.transmitter",
    presence: Presence::Many,
    when: &[],
    selector: "pattern",
    doc: "An antenna that transmits. Several are those that take turns, in their order. One at the body's origin if \
          there is none. Its pattern and boresight say which pulses see a place.",
    keys: &[
        NAME, OFFSET, PHASE, LEVEL, BORESIGHT, UP, PATTERN, AZIMUTH, ELEVATION,
    ],
};

static RECEIVER: Section = Section {
    path: "radar.receiver",
    presence: Presence::Many,
    when: &[],
    selector: "pattern",
    doc: "An antenna that receives. Several are those recorded, in their order. One at the body's origin if there is \
          none. Its pattern and boresight say which pulses see a place.",
    keys: &[
        NAME, OFFSET, PHASE, LEVEL, BORESIGHT, UP, PATTERN, AZIMUTH, ELEVATION,
    ],
};

const UNITS_OF_TIME: &[&str] = &["s", "ms", "us", "ns"];

static RECORDING: Section = Section {
    path: "recording",
    presence: Presence::Always,
    when: &[],
    selector: "format",
    doc: "Samples, and the pulses to use.",
    keys: &[
        Key::new(
            "format",
            ValueType::Choice(&["dca1000", "npy", "npz"]),
            Requirement::Required("\"npz\""),
            "File format: int16, little-endian, as a TI DCA1000 and most other capture programs write them; a NumPy array; or \
             an array of a NumPy archive.",
        ),
        Key::new(
            "file",
            ValueType::Paths,
            Requirement::Required("\"scan.npz\""),
            "File of the samples. Pulses of several files follow one another.",
        ),
        Key::new(
            "array",
            ValueType::Text,
            Requirement::Required("\"scan_data\""),
            "Name of the samples' array in the archive.",
        )
        .when(&["npz"]),
        Key::new(
            "layout",
            ValueType::Choice(&["pulses-samples", "samples-pulses"]),
            Requirement::Default("\"pulses-samples\""),
            "Axes of the array: rows and columns.",
        )
        .when(&["npy", "npz"]),
        Key::new(
            "order",
            ValueType::Choice(&["iiqq", "iqiq", "real"]),
            Requirement::Optional("\"iiqq\""),
            "Order of the numbers: two I then two Q (two LVDS lanes, xWR16xx and xWR18xx); I and Q alternating; or real samples of \
             kind = \"fmcw\". Default: the one of the first two with the clearly sharper image, otherwise \
             iiqq, with a warning.",
        )
        .when(&["dca1000"]),
        Key::new(
            "samples",
            ValueType::Count(2, 1 << 24),
            Requirement::Required("256"),
            "Samples per sweep.",
        )
        .when(&["dca1000"]),
        Key::new(
            "receivers",
            ValueType::Count(1, 64),
            Requirement::Default("1"),
            "Number of receivers, one after another in each sweep; in an array, as rows or as a middle axis.",
        ),
        Key::new(
            "receiver",
            ValueType::Count(1, 64),
            Requirement::Optional("1"),
            "Number of the receiver to use, from 1. Default: all that have a section [[radar.receiver]], in its \
             order, otherwise the first.",
        ),
        Key::new(
            "transmitters",
            ValueType::Count(1, 64),
            Requirement::Default("1"),
            "Number of transmitters that alternate sweep by sweep. A pulse, here and in all counts, is one sweep of each of them.",
        ),
        Key::new(
            "transmitter",
            ValueType::Count(1, 64),
            Requirement::Optional("1"),
            "Number of the transmitter to use, from 1. Default: all that have a section [[radar.transmitter]], in \
             its order, otherwise the first.",
        ),
        Key::new(
            "average",
            ValueType::Count(1, 1 << 20),
            Requirement::Default("1"),
            "Number of sweeps of each transmitter that are averaged into one pulse.",
        ),
        Key::new(
            "phase",
            ValueType::Choice(&["minus", "plus"]),
            Requirement::Optional("\"minus\""),
            "Sign of the phase that a delay gives complex samples, exp(-j 2 pi f delay) or exp(+j ...). For \
             rising sweeps with a positive beat it is plus. Real samples have both. Default: the sign with the clearly \
             sharper image; if neither is sharper, the recording is refused.",
        ),
        Key::new(
            "range_bias",
            ValueType::Quantity(Dimension::Length, Bounds::Any),
            Requirement::Default("\"0 m\""),
            "Excess of the recorded ranges, from delays in cables and filters.",
        ),
        Key::new(
            "times",
            ValueType::Text,
            Requirement::Optional("\"scan_timestamps_ms\""),
            "ARRAY of the pulse times. Give either this or [radar] pri or prf.",
        ),
        Key::new(
            "times_unit",
            ValueType::Choice(UNITS_OF_TIME),
            Requirement::Default("\"s\""),
            "Unit of times.",
        ),
        Key::new(
            "first",
            ValueType::Count(0, u64::MAX),
            Requirement::Default("0"),
            "First pulse to use, from 0.",
        ),
        Key::new(
            "count",
            ValueType::Count(1, u64::MAX),
            Requirement::Optional("400"),
            "Number of pulses to use. Default: all.",
        ),
        Key::new(
            "every",
            ValueType::Count(1, u64::MAX),
            Requirement::Default("1"),
            "Use every n-th pulse of these.",
        ),
        Key::new(
            "pulses",
            ValueType::Choice(&["all", "moving"]),
            Requirement::Default("\"all\""),
            "Leave out pulses while the platform stands still.",
        ),
        Key::new(
            "moving_above",
            ValueType::Quantity(Dimension::Speed, Bounds::Positive),
            Requirement::Default("\"2 cm/s\""),
            "Minimum speed of a moving platform, averaged over 0.1 s.",
        ),
        Key::new(
            "background",
            ValueType::Choice(&["keep", "mean", "mean-moving"]),
            Requirement::Default("\"keep\""),
            "Background subtraction (static clutter): subtract the mean of the pulses used, or of \
             those during which the platform moves.",
        ),
        Key::new(
            "background_first",
            ValueType::Count(0, u64::MAX),
            Requirement::Default("0"),
            "First pulse of the mean, from 0 in the recording.",
        ),
        Key::new(
            "background_count",
            ValueType::Count(2, u64::MAX),
            Requirement::Optional("100"),
            "Number of pulses of the mean. Default: all.",
        ),
    ],
};

static SCENE: Section = Section {
    path: "scene",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Scene.",
    keys: &[
        Key::new(
            "reference",
            ValueType::Vector(Dimension::Length),
            Requirement::Optional("\"0, 5, 0 m\""),
            "Reference point of the phases. If neither this nor reference_range is given, phases are \
             referred to the middle of the unambiguous ranges.",
        ),
        Key::new(
            "reference_range",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Optional("\"5 m\""),
            "Alternative to a reference point: the same range from the radar for all pulses.",
        ),
        Key::new(
            "x",
            ValueType::Interval(Dimension::Length),
            Requirement::Optional("\"-4, 4 m\""),
            "Extent of the scene in x, for default image grids. Give x and y, or neither.",
        ),
        Key::new(
            "y",
            ValueType::Interval(Dimension::Length),
            Requirement::Optional("\"1, 9 m\""),
            "Extent of the scene in y.",
        ),
    ],
};

static ORIGIN: Section = Section {
    path: "scene.origin",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Where on Earth (WGS 84) the scene's origin is; x points east, y north, z up. If left out, axes are \
          local.",
    keys: place::ORIGIN.keys,
};

static RADAR: Section = Section {
    path: "radar",
    presence: Presence::Always,
    when: &[],
    selector: "kind",
    doc: "Radar and its waveform.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&["fmcw", "pulsed", "stepped", "profiles"]),
            Requirement::Required("\"fmcw\""),
            "Waveform: beats of linear sweeps; echoes of a known pulse before any matched filter; a complex number for \
             each of ascending frequencies; or range profiles, real waveforms or complex.",
        ),
        Key::new(
            "pri",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Optional("\"1 ms\""),
            "Pulse repetition interval. Default, without prf and times: 1 s.",
        ),
        Key::new(
            "prf",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Optional("\"1 kHz\""),
            "Pulse repetition frequency.",
        ),
        Key::new(
            "first_pulse",
            ValueType::Quantity(Dimension::Time, Bounds::Any),
            Requirement::Optional("\"9.22 s\""),
            "Time of the recording's first pulse on the platform's clock. Default: the first of times, or 0.",
        ),
        Key::new(
            "transmitter_interval",
            ValueType::Quantity(Dimension::Time, Bounds::NotNegative),
            Requirement::Optional("\"50 us\""),
            "Time from a transmitter's sweep to the next one's within a pulse. Default: an equal part of the time from \
             pulse to pulse, or 0 where sweeps are averaged while the radar stands still.",
        ),
        Key::new(
            "start",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"77 GHz\""),
            "Frequency of the first sample.",
        )
        .when(&["fmcw", "stepped"]),
        Key::new(
            "slope",
            ValueType::Quantity(Dimension::SweepRate, Bounds::Any),
            Requirement::Required("\"40 MHz/us\""),
            "Sweep rate; negative for falling sweeps.",
        )
        .when(&["fmcw"]),
        Key::new(
            "step",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"4 MHz\""),
            "Frequency step.",
        )
        .when(&["stepped"]),
        Key::new(
            "step_time",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Optional("\"2 us\""),
            "Time from frequency to frequency. Needed if the radar moves meanwhile.",
        )
        .when(&["stepped"]),
        Key::new(
            "motion",
            ValueType::Choice(&["stop-and-go", "true"]),
            Requirement::Default("\"stop-and-go\""),
            "Whether the radar moves during a sweep. A pulse's time is then that of its middle sample, \
             number samples / 2 from 0, and the track must be accurate at that scale.",
        )
        .when(&["fmcw", "stepped"]),
        Key::new(
            "sample_rate",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"2.5 MHz\""),
            "Sampling rate of complex samples.",
        )
        .when(&["fmcw", "pulsed"]),
        Key::new(
            "mixer_delay",
            ValueType::Quantity(Dimension::Time, Bounds::NotNegative),
            Requirement::Default("\"0 s\""),
            "Delay of the copy that the echo is mixed with; 0 for a plain homodyne radar.",
        )
        .when(&["fmcw"]),
        Key::new(
            "window_start",
            ValueType::Quantity(Dimension::Time, Bounds::NotNegative),
            Requirement::Required("\"38.7 us\""),
            "Delay of sample 0 after the pulse's start.",
        )
        .when(&["pulsed"]),
        Key::new(
            "centre",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Optional("\"10 GHz\""),
            "Frequency that 0 Hz of the samples corresponds to. Required for complex samples; not permitted for real waveforms.",
        )
        .when(&["pulsed", "profiles"]),
        Key::new(
            "band",
            ValueType::Interval(Dimension::Frequency),
            Requirement::Required("\"3.1, 4.8 GHz\""),
            "Frequencies kept from the spectrum of the profiles.",
        )
        .when(&["profiles"]),
        Key::new(
            "ranges",
            ValueType::Text,
            Requirement::Optional("\"range_bins_m\""),
            "ARRAY of the bins' ranges in metres, evenly spaced. Give either this or first_range and range_step.",
        )
        .when(&["profiles"]),
        Key::new(
            "first_range",
            ValueType::Quantity(Dimension::Length, Bounds::Any),
            Requirement::Optional("\"2 m\""),
            "Range of the first bin.",
        )
        .when(&["profiles"]),
        Key::new(
            "range_step",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Optional("\"9.15 mm\""),
            "Range bin spacing.",
        )
        .when(&["profiles"]),
    ],
};

static PLATFORM: Section = Section {
    path: "platform",
    presence: Presence::Always,
    when: &[],
    selector: "kind",
    doc: "Motion of the radar. By default its heading is along the velocity; a fixed radar has the scene's \
          axes, and the x axis of a swinging arm is along the arm.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&[
                "arc", "rail", "linear", "circular", "waypoints", "spline", "csv", "motive", "novatel", "arrays",
                "fixed",
            ]),
            Requirement::Required("\"arc\""),
            "A swinging arm, a carriage on a rail, a straight line, a level circle, points passed at given \
             times (straight or smooth), a recorded track, or a fixed position.",
        ),
        Key::new(
            "pivot",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"0, 0, 0 m\""),
            "Pivot of the arm, at the antenna's height.",
        )
        .when(&["arc"]),
        CENTRE,
        Key::new(
            "radius",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Required("\"20 cm\""),
            "Length of the arm, radius of the circle.",
        )
        .when(&["arc", "circular"]),
        Key::new(
            "from_angle",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Required("\"0 deg\""),
            "Angle of the arm in the first pulse, from x towards y.",
        )
        .when(&["arc"]),
        Key::new(
            "to_angle",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Required("\"180 deg\""),
            "Angle at the other end of the swing.",
        )
        .when(&["arc"]),
        Key::new(
            "rate",
            ValueType::Quantity(Dimension::AngularRate, Bounds::Positive),
            Requirement::Optional("\"10 deg/s\""),
            "Rate of the swing. Default: one swing over the recording.",
        )
        .when(&["arc"]),
        Key::new(
            "from",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"-1, 0, 0 m\""),
            "Start of the rail.",
        )
        .when(&["rail"]),
        Key::new(
            "to",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"1, 0, 0 m\""),
            "End of the rail.",
        )
        .when(&["rail"]),
        Key::new(
            "speed",
            ValueType::Quantity(Dimension::Speed, Bounds::Positive),
            Requirement::Optional("\"0.1 m/s\""),
            "Speed along the rail or the circle. Default: the whole rail over the recording.",
        )
        .when(&["rail", "circular"]),
        Key::new(
            "spacing",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Optional("\"1 mm\""),
            "Alternative to a speed: distance from one pulse to the next.",
        )
        .when(&["rail"]),
        Key::new(
            "attitude",
            ValueType::Vector(Dimension::Angle),
            Requirement::Optional("\"0, 0, 0 deg\""),
            "Constant roll, pitch and yaw; 0, 0, 0 aligns the body's axes with the scene's. Default: \
             as recorded, otherwise along the velocity.",
        )
        .when(&["rail", "linear", "waypoints", "spline", "csv", "motive", "arrays", "fixed"]),
        Key::new(
            "start",
            ValueType::Quantity(Dimension::Time, Bounds::Any),
            Requirement::Optional("\"0 s\""),
            "Start time. Default: that of the first pulse.",
        )
        .when(&["arc", "rail"]),
        POSITION.when(&["linear", "fixed"]),
        VELOCITY.when(&["linear"]),
        AT.when(&["linear", "circular"]),
        BEARING,
        TURN,
        POINTS.when(&["waypoints", "spline"]),
        TRACK_FILE.when(&["csv", "motive", "novatel"]),
        Key::new(
            "body",
            ValueType::Text,
            Requirement::Optional("\"radar\""),
            "Rigid body of the motion capture. Required if there are several.",
        )
        .when(&["motive"]),
        Key::new(
            "axes",
            ValueType::Text,
            Requirement::Optional("\"x, -z, y\""),
            "The scene's x, y and z as axes of the track's file. Default: the same axes; for a motion \
             capture, whose y is up, \"x, -z, y\".",
        )
        .when(&["csv", "motive", "arrays"]),
        TRACK_RECORD.when(&["novatel"]),
        TRACK_SKIP_DAMAGED.when(&["novatel"]),
        Key::new(
            "times",
            ValueType::Text,
            Requirement::Required("\"motion_timestamps_s\""),
            "ARRAY of the times of the track, ascending.",
        )
        .when(&["arrays"]),
        Key::new(
            "times_unit",
            ValueType::Choice(UNITS_OF_TIME),
            Requirement::Default("\"s\""),
            "Unit of times.",
        )
        .when(&["arrays"]),
        Key::new(
            "positions",
            ValueType::Text,
            Requirement::Required("\"platform_pos_m\""),
            "ARRAY of the positions: x, y and z in a row for each time.",
        )
        .when(&["arrays"]),
        Key::new(
            "receiver_positions",
            ValueType::Text,
            Requirement::Optional("\"receiver_pos_m\""),
            "ARRAY of the receiver positions at the same times, if it moves separately; positions are \
             then the transmitter's.",
        )
        .when(&["arrays"]),
        Key::new(
            "positions_unit",
            ValueType::Choice(&["m", "cm", "mm"]),
            Requirement::Default("\"m\""),
            "Unit of positions.",
        )
        .when(&["arrays"]),
    ],
};
