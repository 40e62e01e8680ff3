//! Sections of a scenario. The reader checks texts against them, `subap simulate --keys` prints them, and tests check that each key is
//! accepted.

use std::path::PathBuf;
use std::sync::LazyLock;

use glam::DVec3;
use subaperture_describe::declare::{Choice, Located, section};
use subaperture_describe::error::Location;
use subaperture_describe::radar::RadarKeys;
use subaperture_describe::schema::Schema;
use subaperture_describe::track::{At, LogKeys, TurnKeys};

use super::scene_keys::SceneKeys;

/// Schema of a scenario.
pub(super) static SCHEMA: LazyLock<Schema> =
    LazyLock::new(|| Schema::of::<ScenarioKeys>("A scenario is a TOML file."));

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

/// Description of a simulation.
#[section]
pub(super) struct ScenarioKeys {
    /// Name of the collection, for titles and reports.
    #[key(default = "scenario")]
    pub(super) name: String,
    /// Seed of all random effects: the same seed gives the same file.
    #[key(default = 0, whole(0, i64::MAX as u64))]
    pub(super) seed: u64,
    /// Method for sums over scatterers: by non-uniform FFT, or by the plain sum, which is slow and the reference for the fast method.
    #[key(default = "fast")]
    pub(super) method: Summation,
    /// Date and time of time 0, UTC, stated by CPHD and by navigation logs.
    #[key(example = "2017-05-04T14:00:00Z")]
    pub(super) collection_start: Option<Located<String>>,
    #[section]
    pub(super) scene: SceneKeys,
    /// Waveform, timing and antennas of the radar.
    #[section]
    pub(super) radar: RadarKeys,
    #[section]
    pub(super) platform: PlatformKeys,
    #[section]
    pub(super) navigation: Option<NavigationKeys>,
    #[section]
    pub(super) log: Vec<NavigationLogKeys>,
}

#[derive(Clone, Copy, Choice)]
pub(super) enum Summation {
    Fast,
    Sum,
}

/// Motion of the radar. The heading follows the velocity unless stated otherwise; a fixed platform has the scene's axes, and the x axis of
/// an arm is along the arm.
#[section]
pub(super) struct PlatformKeys {
    #[at]
    pub(super) header: Location,
    /// Straight line, horizontal circle, carriage on a rail, swinging arm, timed waypoints (straight segments or smooth curve), recorded
    /// track, or fixed position.
    #[key(
        required = "linear",
        select(Linear, Circular, Rail, Arc, Waypoints, Spline, Csv, Novatel, Fixed)
    )]
    pub(super) kind: PlatformMotion,
    /// Position at the time given by 'at'.
    #[key(required = "0, -5, 3 km", when(Linear, Fixed))]
    pub(super) position_m: DVec3,
    /// Velocity at the position; for a profile, before its first segment.
    #[key(required = "100, 0, 0 m/s", when(Linear))]
    pub(super) velocity_m_s: DVec3,
    /// Time of the position: time 0, or the middle of the collection.
    #[key(default = "middle", when(Linear, Circular))]
    pub(super) at: At,
    /// Centre of the circle, at the height of the track.
    #[key(required = "0, 0, 3 km", when(Circular))]
    pub(super) centre_m: DVec3,
    /// Pivot of the arm, at the height of the antenna.
    #[key(required = "0, -20, 2 m", when(Arc))]
    pub(super) pivot_m: DVec3,
    /// Radius of the circle, or length of the arm.
    #[key(required = "5 km", positive, when(Circular, Arc))]
    pub(super) radius_m: f64,
    /// Speed along the track.
    #[key(required = "100 m/s", positive, when(Circular, Rail))]
    pub(super) speed_m_s: f64,
    #[keys(when(Circular))]
    pub(super) turn: TurnKeys,
    /// Start of the rail.
    #[key(required = "-3, -5000, 3000 m", when(Rail))]
    pub(super) from_m: DVec3,
    /// End of the rail.
    #[key(required = "3, -5000, 3000 m", when(Rail))]
    pub(super) to_m: Located<DVec3>,
    /// First end of the swing, as angle from x towards y.
    #[key(required = "60 deg", when(Arc))]
    pub(super) from_angle_rad: f64,
    /// Second end of the swing.
    #[key(required = "120 deg", when(Arc))]
    pub(super) to_angle_rad: f64,
    /// Angular rate of the swing.
    #[key(required = "10 deg/s", positive, when(Arc))]
    pub(super) rate_rad_s: f64,
    /// Start time.
    #[key(default = "0 s", when(Rail, Arc))]
    pub(super) start_s: f64,
    /// Times and positions, connected by straight segments, or by a smooth curve for a spline.
    #[key(
        required = ["0 s, -3, -5000, 3000 m", "60 ms, 3, -5000, 3000 m"],
        rows(2, Time, Length, Length, Length),
        when(Waypoints, Spline)
    )]
    pub(super) points: Located<Vec<[f64; 4]>>,
    /// Recorded track: a CSV file with columns time_s, x_m, y_m, z_m (or time_ms, x_mm, x_cm and so on) and, optionally, roll_deg,
    /// pitch_deg, yaw_deg; an export of OptiTrack's Motive; or a NovAtel log, whose first record is at time 0.
    #[key(required = "track.csv", when(Csv, Novatel))]
    pub(super) file: Located<PathBuf>,
    #[keys(when(Novatel))]
    pub(super) log: LogKeys,
    #[section]
    pub(super) perturbation: Vec<PerturbationKeys>,
}

/// Perturbation of the platform's motion.
#[section]
pub(super) struct PerturbationKeys {
    /// Smooth random displacement, sinusoidal displacement, constant acceleration from a given time, or sinusoidal rotation of the body.
    #[key(required = "sway", select(Sway, Vibration, Acceleration, Wobble))]
    pub(super) kind: PerturbationKind,
    /// RMS displacement in scene axes.
    #[key(required = "2, 2, 1 cm", when(Sway))]
    pub(super) rms_m: Located<DVec3>,
    /// Correlation time of the displacement.
    #[key(required = "500 ms", positive, when(Sway))]
    pub(super) correlation_s: f64,
    /// Amplitude in scene axes.
    #[key(required = "0, 0, 1 mm", when(Vibration))]
    pub(super) amplitude_m: DVec3,
    /// Frequency of the vibration.
    #[key(required = "20 Hz", positive, when(Vibration))]
    pub(super) frequency_hz: f64,
    /// Acceleration in scene axes.
    #[key(required = "0, 0.1, 0 m/s^2", when(Acceleration))]
    pub(super) acceleration_m_s2: DVec3,
    /// Start time of the acceleration.
    #[key(default = "0 s", when(Acceleration))]
    pub(super) from_s: f64,
    /// Amplitudes of roll, pitch and yaw.
    #[key(required = "2, 1, 1 deg", when(Wobble))]
    pub(super) angles_rad: DVec3,
    /// Period of the rotation.
    #[key(required = "5 s", positive, when(Wobble))]
    pub(super) period_s: f64,
    /// Phase at time 0.
    #[key(default = "0 deg", when(Vibration, Wobble))]
    pub(super) phase_rad: f64,
}

/// Navigation errors of the recorded track. Without this section the true track is recorded.
#[section]
pub(super) struct NavigationKeys {
    #[at]
    pub(super) header: Location,
    /// Constant position error in scene axes.
    #[key(default = "0, 0, 0 m")]
    pub(super) bias_m: DVec3,
    /// RMS of the slow position drift in scene axes.
    #[key(default = "0, 0, 0 m")]
    pub(super) drift_m: DVec3,
    /// RMS of a fix's position noise in scene axes.
    #[key(default = "0, 0, 0 m")]
    pub(super) noise_m: DVec3,
    /// Fixes per second.
    #[key(default = "10 Hz", positive)]
    pub(super) fix_rate_hz: f64,
    /// Constant errors of roll, pitch and yaw.
    #[key(default = "0, 0, 0 deg")]
    pub(super) attitude_bias_rad: DVec3,
    /// RMS of the slow drifts of roll, pitch and yaw.
    #[key(default = "0, 0, 0 deg")]
    pub(super) attitude_drift_rad: DVec3,
    /// Correlation time of both drifts.
    #[key(default = "60 s", positive)]
    pub(super) drift_time_s: f64,
}

/// Navigation log of the true track, as an instrument on the platform writes it. It is written next to the recording, and needs
/// collection_start and the latitude and longitude of [scene.origin].
#[section]
pub(super) struct NavigationLogKeys {
    #[at]
    pub(super) header: Location,
    /// File name.
    #[key(required = "drive.log")]
    pub(super) file: Located<PathBuf>,
    /// NMEA 0183 (GGA, RMC, GST, HDT), NovAtel ASCII INSPVAX, NovAtel ASCII BESTPOS and BESTVEL, or SBET.
    #[key(required = "inspvax")]
    pub(super) format: LogFormatKey,
    /// Records per second, from one second before the first pulse to one second after the last.
    #[key(default = "20 Hz", within(1e-3, 1e3, "0.001 to 1000 Hz"))]
    pub(super) rate_hz: Located<f64>,
    /// Standard deviation of positions along east and along north, also the stated one.
    #[key(default = "0 m", within(0.0, 1e4, "0 to 10 km"))]
    pub(super) horizontal_m: f64,
    /// Standard deviation of heights.
    #[key(default = "0 m", within(0.0, 1e4, "0 to 10 km"))]
    pub(super) vertical_m: f64,
    /// Standard deviation of each component of velocity.
    #[key(default = "0 m/s", within(0.0, 1e3, "0 to 1000 m/s"))]
    pub(super) velocity_m_s: f64,
    /// Standard deviation of roll, pitch and azimuth.
    #[key(default = "0 deg", within(0.0, 0.5, "0 to 0.5 rad"))]
    pub(super) attitude_rad: f64,
    /// Lever arm from the middle of transmitters and receivers to the navigation antenna, in body axes: x forward, y left, z up.
    #[key(default = "0, 0, 0 m")]
    pub(super) lever_arm_m: DVec3,
    /// Height of the geoid above the ellipsoid that the log states.
    #[key(default = "0 m", within(-200.0, 200.0, "-200 to 200 m"))]
    pub(super) undulation_m: f64,
    /// Start and end of outages, from time 0 of the collection: the log has no records within, unless drift is given.
    #[key(example = ["2 s, 5 s"], rows(1, Time, Time))]
    pub(super) outages: Located<Vec<(f64, f64)>>,
    /// Standard deviation of the constant acceleration error of inertial sensors, with which an INSPVAX or SBET continues through outages.
    #[key(example = "5 mm/s^2", within(0.0, 10.0, "0 to 10 m/s^2"))]
    pub(super) drift_m_s2: Option<Located<f64>>,
}

#[derive(Clone, Copy, Choice)]
pub(super) enum LogFormatKey {
    Nmea,
    Inspvax,
    Bestpos,
    Sbet,
}
