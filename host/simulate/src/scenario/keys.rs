//! Sections of a scenario. The reader checks texts against them, `subap simulate --keys` prints them, and tests check that each key is
//! accepted.

use std::path::PathBuf;
use std::sync::LazyLock;

use glam::DVec3;
use subaperture_describe::declare::{Choice, Located, section};
use subaperture_describe::error::Location;
use subaperture_describe::place::OriginKeys;
use subaperture_describe::radar::RadarKeys;
use subaperture_describe::schema::Schema;
use subaperture_describe::track::{At, LogKeys, TurnKeys};

use crate::scene::MAX_SPREAD_M_S;

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

/// Position, extent and reference of the scene.
#[section]
pub(super) struct SceneKeys {
    /// Motion compensation reference point, also for amplitudes: with isotropic antennas, 1 m^2 has amplitude 1 in an image; with spreading
    /// loss, at this point only. Default: the scene's origin, unless reference_range is given.
    #[key(example = "0, 0, 0 m")]
    pub(super) reference_m: Option<DVec3>,
    /// Alternative to a reference point: a constant range from the radar for all pulses, as with a receiver with one range gate.
    #[key(example = "5 km", positive)]
    pub(super) reference_range_m: Option<Located<f64>>,
    /// Extent of the scene in x, for default image grids. Give x and y, or neither.
    #[key(example = "-50, 50 m")]
    pub(super) x_m: Option<Located<(f64, f64)>>,
    /// Extent of the scene in y.
    #[key(example = "-50, 50 m")]
    pub(super) y_m: Option<Located<(f64, f64)>>,
    #[section]
    pub(super) origin: OriginKeys,
    #[section]
    pub(super) point: Vec<PointKeys>,
    #[section]
    pub(super) corner: Vec<CornerKeys>,
    #[section]
    pub(super) clutter: Vec<ClutterKeys>,
    #[section]
    pub(super) picture: Vec<PictureKeys>,
    #[section]
    pub(super) building: Vec<BuildingKeys>,
    #[section]
    pub(super) mover: Vec<MoverKeys>,
}

/// Strength of a reflection.
#[section]
pub(super) struct ReflectionKeys {
    /// Radar cross section.
    #[key(default = "1 m^2", not_negative)]
    pub(super) cross_section_m2: f64,
    /// Phase of the reflection.
    #[key(default = "0 deg")]
    pub(super) phase_rad: f64,
}

/// Isotropic point scatterer.
#[section]
pub(super) struct PointKeys {
    /// Position in the scene frame.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    #[keys]
    pub(super) reflection: ReflectionKeys,
}

/// Triangular trihedral corner reflector.
#[section]
pub(super) struct CornerKeys {
    /// Position in the scene frame.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    /// Boresight direction in scene axes.
    #[key(required = "0, -1, 0.6")]
    pub(super) boresight: Located<DVec3>,
    /// Length of an inner edge.
    #[key(required = "30 cm", positive)]
    pub(super) edge_m: f64,
}

/// Extent of an area.
#[section]
pub(super) struct ExtentKeys {
    /// Extent in x.
    #[key(required = "-20, 20 m")]
    pub(super) x_m: (f64, f64),
    /// Extent in y.
    #[key(required = "-20, 20 m")]
    pub(super) y_m: (f64, f64),
}

/// Ground clutter: many weak points on a horizontal plane.
#[section]
pub(super) struct ClutterKeys {
    /// Shape of the area.
    #[key(default = "rectangle", select(Rectangle, Disc))]
    pub(super) kind: AreaKeys,
    #[keys(when(Rectangle))]
    pub(super) extent: ExtentKeys,
    /// Centre of the disc; z is its height.
    #[key(required = "0, 0, 0 m", when(Disc))]
    pub(super) centre_m: DVec3,
    /// Radius of the disc.
    #[key(required = "20 m", positive, when(Disc))]
    pub(super) radius_m: f64,
    /// Height (z).
    #[key(default = "0 m", when(Rectangle))]
    pub(super) height_m: f64,
    /// Points per square metre; ten per resolution cell give speckle. Give either this or count.
    #[key(example = 1, positive)]
    pub(super) density: Located<Option<f64>>,
    /// Total number of points. Give either this or density.
    #[key(example = 1000, whole(1, 1 << 26))]
    pub(super) count: Option<Located<usize>>,
    /// Mean radar cross section per square metre (sigma nought).
    #[key(required = "-20 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) sigma0_db: Located<f64>,
    /// Internal clutter motion, as by wind: standard deviation of the radial velocity of the points, Gaussian. Each point has a constant
    /// velocity; positions are those at the middle of the collection. Echoes at a lag tau have the correlation
    /// exp(-8 pi^2 velocity_spread^2 tau^2 / wavelength^2). Give many points per resolution cell: the residue of few after cancellation is
    /// not Gaussian.
    #[key(default = "0 m/s", within(0.0, MAX_SPREAD_M_S, "0 to 100 m/s"))]
    pub(super) velocity_spread_m_s: Located<f64>,
}

/// Picture on a horizontal plane, with brightness proportional to amplitude.
#[section]
pub(super) struct PictureKeys {
    /// Greyscale PNG with 8 or 16 bits, or NumPy array of real numbers.
    #[key(required = "picture.png")]
    pub(super) file: Located<PathBuf>,
    #[keys]
    pub(super) extent: ExtentKeys,
    /// Height (z).
    #[key(default = "0 m")]
    pub(super) height_m: f64,
    /// Spacing of the points.
    #[key(required = "2 m", positive)]
    pub(super) spacing_m: Located<f64>,
    /// Radar cross section per square metre of white pixels.
    #[key(required = "0 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) sigma0_db: f64,
    /// Use complex Gaussian amplitudes (speckle), as of rough ground.
    #[key(default = true)]
    pub(super) speckle: bool,
}

/// Building: an upright box with reflecting walls, roof edges and foot, which occludes objects behind it.
#[section]
pub(super) struct BuildingKeys {
    /// Centre of the ground plan, at the foot.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    /// Length, width and height.
    #[key(required = "12, 8, 6 m")]
    pub(super) size_m: Located<DVec3>,
    /// Angle from the scene's x axis to the length of the building, towards y.
    #[key(default = "0 deg")]
    pub(super) yaw_rad: f64,
    /// Spacing of the points.
    #[key(required = "2 m", positive)]
    pub(super) spacing_m: f64,
    /// Mean radar cross section per square metre of wall.
    #[key(default = "-10 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) wall_db: f64,
    /// Radar cross section per metre of roof edge.
    #[key(default = "-10 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) edge_db: f64,
    /// Radar cross section per metre of foot, where wall and ground form a dihedral.
    #[key(default = "0 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) foot_db: f64,
}

/// Moving point target.
#[section]
pub(super) struct MoverKeys {
    /// Straight line, horizontal circle, straight segments between timed waypoints, or segments of constant acceleration.
    #[key(required = "linear", select(Linear, Circular, Waypoints, Profile))]
    pub(super) kind: MoverMotion,
    /// Position at the time given by 'at'.
    #[key(required = "10, 5, 0 m", when(Linear, Profile))]
    pub(super) position_m: DVec3,
    /// Velocity at the position; for a profile, before its first segment.
    #[key(required = "0, 8, 0 m/s", when(Linear, Profile))]
    pub(super) velocity_m_s: DVec3,
    /// Time of the position: time 0, or the middle of the collection.
    #[key(default = "middle", when(Linear, Circular))]
    pub(super) at: At,
    /// Centre of the circle, at the height of the track.
    #[key(required = "0, 0, 3 km", when(Circular))]
    pub(super) centre_m: DVec3,
    /// Radius of the circle, or length of the arm.
    #[key(required = "20 m", positive, when(Circular))]
    pub(super) radius_m: f64,
    /// Speed along the track.
    #[key(required = "5 m/s", positive, when(Circular))]
    pub(super) speed_m_s: f64,
    #[keys(when(Circular))]
    pub(super) turn: TurnKeys,
    /// Times and positions, connected by straight segments, or by a smooth curve for a spline.
    #[key(
        required = ["0 s, -3, -5000, 3000 m", "60 ms, 3, -5000, 3000 m"],
        rows(2, Time, Length, Length, Length),
        when(Waypoints)
    )]
    pub(super) points: Located<Vec<[f64; 4]>>,
    /// Start time.
    #[key(default = "0 s", when(Profile))]
    pub(super) start_s: f64,
    /// Durations and accelerations of consecutive segments from 'start' on, beginning at 'position' with 'velocity'.
    #[key(
        required = ["20 ms, 0, 2, 0 m/s^2", "20 ms, 0, -2, 0 m/s^2"],
        rows(1, Time, Acceleration, Acceleration, Acceleration),
        when(Profile)
    )]
    pub(super) pieces: Located<Vec<[f64; 4]>>,
    #[keys]
    pub(super) reflection: ReflectionKeys,
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
