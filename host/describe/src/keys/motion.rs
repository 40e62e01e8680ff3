//! Keys of everything that moves: `[platform]`, its perturbations and navigation, `[[scene.mover]]`.

use crate::schema::{Bounds, Key, Presence, Requirement, Section, ValueType};
use subaperture_model::units::Dimension;

const POSITION_DOC: &str = "Position at the time given by 'at'.";
const AT_DOC: &str = "Time of the position: time 0, or the middle of the collection.";
pub const POSITION: Key = Key::new(
    "position",
    ValueType::Vector(Dimension::Length),
    Requirement::Required("\"0, -5, 3 km\""),
    POSITION_DOC,
);
pub const VELOCITY: Key = Key::new(
    "velocity",
    ValueType::Vector(Dimension::Speed),
    Requirement::Required("\"100, 0, 0 m/s\""),
    "Velocity at the position; for a profile, before its first segment.",
);
pub const AT: Key = Key::new(
    "at",
    ValueType::Choice(&["start", "middle"]),
    Requirement::Default("\"middle\""),
    AT_DOC,
);
pub const CENTRE: Key = Key::new(
    "centre",
    ValueType::Vector(Dimension::Length),
    Requirement::Required("\"0, 0, 3 km\""),
    "Centre of the circle, at the height of the track.",
)
.when(&["circular"]);
const RADIUS_DOC: &str = "Radius of the circle, or length of the arm.";
const SPEED_DOC: &str = "Speed along the track.";
pub const BEARING: Key = Key::new(
    "bearing",
    ValueType::Quantity(Dimension::Angle, Bounds::Any),
    Requirement::Default("\"-90 deg\""),
    "Angle on the circle at the time given by 'at', from x towards y.",
)
.when(&["circular"]);
pub const TURN: Key = Key::new(
    "turn",
    ValueType::Choice(&["left", "right"]),
    Requirement::Default("\"left\""),
    "Direction of rotation: left is counterclockwise seen from above.",
)
.when(&["circular"]);
pub const POINTS: Key = Key::new(
    "points",
    ValueType::Rows(
        &[
            Dimension::Time,
            Dimension::Length,
            Dimension::Length,
            Dimension::Length,
        ],
        2,
    ),
    Requirement::Required("[\"0 s, -3, -5000, 3000 m\", \"60 ms, 3, -5000, 3000 m\"]"),
    "Times and positions, connected by straight segments, or by a smooth curve for a spline.",
);
pub const START: Key = Key::new(
    "start",
    ValueType::Quantity(Dimension::Time, Bounds::Any),
    Requirement::Default("\"0 s\""),
    "Start time.",
);

pub const TRACK_FILE: Key = Key::new(
    "file",
    ValueType::Path,
    Requirement::Required("\"track.csv\""),
    "Recorded track: a CSV file with columns time_s, x_m, y_m, z_m (or time_ms, x_mm, x_cm and so on) and, optionally, \
        roll_deg, pitch_deg, yaw_deg; an export of OptiTrack's Motive; or a NovAtel log, whose first record is at time 0.",
);

pub const TRACK_RECORD: Key = Key::new(
    "record",
    ValueType::Choice(&["inspvax", "inspva", "bestpos"]),
    Requirement::Default("\"inspvax\""),
    "Records of the log used for the track; bestpos has no attitude.",
);

pub const TRACK_SKIP_DAMAGED: Key = Key::new(
    "skip_damaged",
    ValueType::Flag,
    Requirement::Default("false"),
    "Skip damaged lines of the log.",
);

pub static PLATFORM: Section = Section {
    path: "platform",
    presence: Presence::Always,
    when: &[],
    selector: "kind",
    doc: "Motion of the radar. The heading follows the velocity unless stated otherwise; a fixed platform has the \
             scene's axes, and the x axis of an arm is along the arm.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&[
                "linear",
                "circular",
                "rail",
                "arc",
                "waypoints",
                "spline",
                "csv",
                "novatel",
                "fixed",
            ]),
            Requirement::Required("\"linear\""),
            "Straight line, horizontal circle, carriage on a rail, swinging arm, timed waypoints (straight \
                        segments or smooth curve), recorded track, or fixed position.",
        ),
        POSITION.when(&["linear", "fixed"]),
        VELOCITY.when(&["linear"]),
        AT.when(&["linear", "circular"]),
        CENTRE,
        Key::new(
            "pivot",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"0, -20, 2 m\""),
            "Pivot of the arm, at the height of the antenna.",
        )
        .when(&["arc"]),
        Key::new(
            "radius",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Required("\"5 km\""),
            RADIUS_DOC,
        )
        .when(&["circular", "arc"]),
        Key::new(
            "speed",
            ValueType::Quantity(Dimension::Speed, Bounds::Positive),
            Requirement::Required("\"100 m/s\""),
            SPEED_DOC,
        )
        .when(&["circular", "rail"]),
        BEARING,
        TURN,
        Key::new(
            "from",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"-3, -5000, 3000 m\""),
            "Start of the rail.",
        )
        .when(&["rail"]),
        Key::new(
            "to",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"3, -5000, 3000 m\""),
            "End of the rail.",
        )
        .when(&["rail"]),
        Key::new(
            "from_angle",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Required("\"60 deg\""),
            "First end of the swing, as angle from x towards y.",
        )
        .when(&["arc"]),
        Key::new(
            "to_angle",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Required("\"120 deg\""),
            "Second end of the swing.",
        )
        .when(&["arc"]),
        Key::new(
            "rate",
            ValueType::Quantity(Dimension::AngularRate, Bounds::Positive),
            Requirement::Required("\"10 deg/s\""),
            "Angular rate of the swing.",
        )
        .when(&["arc"]),
        START.when(&["rail", "arc"]),
        POINTS.when(&["waypoints", "spline"]),
        TRACK_FILE.when(&["csv", "novatel"]),
        TRACK_RECORD.when(&["novatel"]),
        TRACK_SKIP_DAMAGED.when(&["novatel"]),
    ],
};

pub static PERTURBATION: Section = Section {
    path: "platform.perturbation",
    presence: Presence::Many,
    when: &[],
    selector: "kind",
    doc: "Perturbation of the platform's motion.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&["sway", "vibration", "acceleration", "wobble"]),
            Requirement::Required("\"sway\""),
            "Smooth random displacement, sinusoidal displacement, constant acceleration from a given time, or \
                        sinusoidal rotation of the body.",
        ),
        Key::new(
            "rms",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"2, 2, 1 cm\""),
            "RMS displacement in scene axes.",
        )
        .when(&["sway"]),
        Key::new(
            "correlation",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Required("\"500 ms\""),
            "Correlation time of the displacement.",
        )
        .when(&["sway"]),
        Key::new(
            "amplitude",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"0, 0, 1 mm\""),
            "Amplitude in scene axes.",
        )
        .when(&["vibration"]),
        Key::new(
            "frequency",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Required("\"20 Hz\""),
            "Frequency of the vibration.",
        )
        .when(&["vibration"]),
        Key::new(
            "acceleration",
            ValueType::Vector(Dimension::Acceleration),
            Requirement::Required("\"0, 0.1, 0 m/s^2\""),
            "Acceleration in scene axes.",
        )
        .when(&["acceleration"]),
        Key::new(
            "from",
            ValueType::Quantity(Dimension::Time, Bounds::Any),
            Requirement::Default("\"0 s\""),
            "Start time of the acceleration.",
        )
        .when(&["acceleration"]),
        Key::new(
            "angles",
            ValueType::Vector(Dimension::Angle),
            Requirement::Required("\"2, 1, 1 deg\""),
            "Amplitudes of roll, pitch and yaw.",
        )
        .when(&["wobble"]),
        Key::new(
            "period",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Required("\"5 s\""),
            "Period of the rotation.",
        )
        .when(&["wobble"]),
        Key::new(
            "phase",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Default("\"0 deg\""),
            "Phase at time 0.",
        )
        .when(&["vibration", "wobble"]),
    ],
};

const NO_LENGTH: Requirement = Requirement::Default("\"0, 0, 0 m\"");
const NO_ANGLE: Requirement = Requirement::Default("\"0, 0, 0 deg\"");

pub static NAVIGATION: Section = Section {
    path: "navigation",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Navigation errors of the recorded track. Without this section the true track is recorded.",
    keys: &[
        Key::new(
            "bias",
            ValueType::Vector(Dimension::Length),
            NO_LENGTH,
            "Constant position error in scene axes.",
        ),
        Key::new(
            "drift",
            ValueType::Vector(Dimension::Length),
            NO_LENGTH,
            "RMS of the slow position drift in scene axes.",
        ),
        Key::new(
            "noise",
            ValueType::Vector(Dimension::Length),
            NO_LENGTH,
            "RMS of a fix's position noise in scene axes.",
        ),
        Key::new(
            "fix_rate",
            ValueType::Quantity(Dimension::Frequency, Bounds::Positive),
            Requirement::Default("\"10 Hz\""),
            "Fixes per second.",
        ),
        Key::new(
            "attitude_bias",
            ValueType::Vector(Dimension::Angle),
            NO_ANGLE,
            "Constant errors of roll, pitch and yaw.",
        ),
        Key::new(
            "attitude_drift",
            ValueType::Vector(Dimension::Angle),
            NO_ANGLE,
            "RMS of the slow drifts of roll, pitch and yaw.",
        ),
        Key::new(
            "drift_time",
            ValueType::Quantity(Dimension::Time, Bounds::Positive),
            Requirement::Default("\"60 s\""),
            "Correlation time of both drifts.",
        ),
    ],
};

pub static MOVER: Section = Section {
    path: "scene.mover",
    presence: Presence::Many,
    when: &[],
    selector: "kind",
    doc: "Moving point target.",
    keys: &[
        Key::new(
            "kind",
            ValueType::Choice(&["linear", "circular", "waypoints", "profile"]),
            Requirement::Required("\"linear\""),
            "Straight line, horizontal circle, straight segments between timed waypoints, or \
                        segments of constant acceleration.",
        ),
        Key::new(
            "position",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"10, 5, 0 m\""),
            POSITION_DOC,
        )
        .when(&["linear", "profile"]),
        Key::new(
            "velocity",
            ValueType::Vector(Dimension::Speed),
            Requirement::Required("\"0, 8, 0 m/s\""),
            "Velocity at the position; for a profile, before its first segment.",
        )
        .when(&["linear", "profile"]),
        AT.when(&["linear", "circular"]),
        CENTRE,
        Key::new(
            "radius",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Required("\"20 m\""),
            RADIUS_DOC,
        )
        .when(&["circular"]),
        Key::new(
            "speed",
            ValueType::Quantity(Dimension::Speed, Bounds::Positive),
            Requirement::Required("\"5 m/s\""),
            SPEED_DOC,
        )
        .when(&["circular"]),
        BEARING,
        TURN,
        POINTS.when(&["waypoints"]),
        START.when(&["profile"]),
        Key::new(
            "pieces",
            ValueType::Rows(
                &[
                    Dimension::Time,
                    Dimension::Acceleration,
                    Dimension::Acceleration,
                    Dimension::Acceleration,
                ],
                1,
            ),
            Requirement::Required("[\"20 ms, 0, 2, 0 m/s^2\", \"20 ms, 0, -2, 0 m/s^2\"]"),
            "Durations and accelerations of consecutive segments from 'start' on, beginning at 'position' with \
                        'velocity'.",
        )
        .when(&["profile"]),
        Key::new(
            "cross_section",
            ValueType::Quantity(Dimension::CrossSection, Bounds::NotNegative),
            Requirement::Default("\"1 m^2\""),
            "Radar cross section.",
        ),
        Key::new(
            "phase",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Default("\"0 deg\""),
            "Phase of the reflection.",
        ),
    ],
};
