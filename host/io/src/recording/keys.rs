//! Sections of a recording's description.

use std::path::PathBuf;
use std::sync::LazyLock;

use glam::DVec3;
use subaperture_describe::declare::{Choice, Located, section};
use subaperture_describe::error::{Fault, Location};
use subaperture_describe::place::OriginKeys;
use subaperture_describe::radar::{BeamKeys, IntraPulse, MountKeys, PulseKeys};
use subaperture_describe::schema::Schema;
use subaperture_describe::track::{At, LogKeys, TurnKeys};

/// Keys of a recording's description.
pub(super) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| {
    Schema::of::<RecordingDescription>(
        "The description of a recording is TOML. An ARRAY is named as in the .npz that holds the samples, or is the path of a .npy file.",
    )
});

/// Description of a recording.
#[section]
pub(super) struct RecordingDescription {
    /// Name for titles and reports. Default: the file name.
    #[key(example = "yard")]
    pub(super) name: Option<String>,
    #[section]
    pub(super) recording: RecordingKeys,
    #[section]
    pub(super) scene: SceneKeys,
    #[section]
    pub(super) radar: RadarKeys,
    #[section]
    pub(super) platform: PlatformKeys,
}

/// Samples, and the pulses to use.
#[section]
pub(super) struct RecordingKeys {
    /// File format: int16, little-endian, as a TI DCA1000 and most other capture programs write them; a NumPy array; an array of a NumPy
    /// archive; or Touchstone files (.s1p, .s2p, ...) of a vector network analyser, one for each pulse and receiver.
    #[key(required = "npz", select(Dca1000, Npy, Npz, Touchstone))]
    pub(super) format: FormatKeys,
    /// File of the samples. Pulses of several files follow one another.
    #[key(required = "scan.npz")]
    pub(super) file: Located<Vec<String>>,
    /// Name of the samples' array in the archive.
    #[key(required = "scan_data", when(Npz))]
    pub(super) array: Located<String>,
    /// Scattering parameter, from the transmitting port to the receiving port: s21 is from port 1 to port 2. Default: s21, or s11 of a single port.
    #[key(example = "s21", when(Touchstone))]
    pub(super) parameter: Option<Located<String>>,
    /// Axes of the array: rows and columns.
    #[key(default = "pulses-samples", when(Npy, Npz))]
    pub(super) layout: Layout,
    /// Order of the numbers: two I then two Q (two LVDS lanes, xWR16xx and xWR18xx); I and Q alternating; or real samples of kind = "fmcw".
    /// Default: the one of the first two with the clearly sharper image, otherwise iiqq, with a warning.
    #[key(example = "iiqq", when(Dca1000))]
    pub(super) order: Option<Order>,
    /// ARRAY of the values of integer codes, as of block-adaptive quantisation: entry c is the value of code c, and negative codes count from the
    /// end, as in NumPy. Codes of complex samples apply to I and Q. NaN is an invalid sample, which becomes 0. Default: codes are values.
    #[key(example = "table.npy")]
    pub(super) table: Option<Located<String>>,
    /// Samples per sweep.
    #[key(required = 256, whole(2, 1 << 24), when(Dca1000))]
    pub(super) samples: Located<usize>,
    /// Number of receivers, one after another in each sweep; in an array, as rows or as a middle axis.
    #[key(default = 1, whole(1, 64))]
    pub(super) receivers: Located<usize>,
    /// Number of the receiver to use, from 1. Default: all that have a section [[radar.receiver]], in its order, otherwise the first.
    #[key(example = 1, whole(1, 64))]
    pub(super) receiver: Option<Located<usize>>,
    /// Number of transmitters that alternate sweep by sweep. A pulse, here and in all counts, is one sweep of each of them.
    #[key(default = 1, whole(1, 64))]
    pub(super) transmitters: Located<usize>,
    /// Number of the transmitter to use, from 1. Default: all that have a section [[radar.transmitter]], in its order, otherwise the first.
    #[key(example = 1, whole(1, 64))]
    pub(super) transmitter: Option<Located<usize>>,
    /// Number of sweeps of each transmitter that are averaged into one pulse.
    #[key(default = 1, whole(1, 1 << 20))]
    pub(super) average: Located<usize>,
    /// Sign of the phase that a delay gives complex samples, exp(-j 2 pi f delay) or exp(+j ...). For rising sweeps with a positive beat it
    /// is plus. Real samples have both. Default: minus for Touchstone files; otherwise the sign with the clearly sharper image, and if neither is
    /// sharper, the recording is refused.
    #[key(example = "minus")]
    pub(super) phase: Option<Sign>,
    /// Excess of the recorded ranges, from delays in cables and filters.
    #[key(default = "0 m")]
    pub(super) range_bias_m: f64,
    /// ARRAY of the pulse times. Give either this or [radar] pri or prf.
    #[key(example = "scan_timestamps_ms")]
    pub(super) times: Option<Located<String>>,
    /// Unit of times.
    #[key(default = "s")]
    pub(super) times_unit: TimeUnit,
    /// First pulse to use, from 0.
    #[key(default = 0)]
    pub(super) first: Located<usize>,
    /// Number of pulses to use. Default: all.
    #[key(example = 400, positive)]
    pub(super) count: Option<Located<usize>>,
    /// Use every n-th pulse of these.
    #[key(default = 1, positive)]
    pub(super) every: usize,
    /// Leave out pulses while the platform stands still.
    #[key(default = "all")]
    pub(super) pulses: Located<PulsesUsed>,
    /// Minimum speed of a moving platform, averaged over 0.1 s.
    #[key(default = "2 cm/s", positive)]
    pub(super) moving_above_m_s: f64,
    /// Correction of I and Q of complex samples: keep them, or remove bias and imbalance of gain and phase of each receiver, with I as reference
    /// (Gram-Schmidt). They are estimated from the pulses used, and removed if significant.
    #[key(default = "keep")]
    pub(super) iq: Located<IqCorrection>,
    /// Background subtraction (static clutter): subtract the mean of the pulses used, or of those during which the platform moves.
    #[key(default = "keep")]
    pub(super) background: Located<Background>,
    /// First pulse of the mean, from 0 in the recording.
    #[key(default = 0)]
    pub(super) background_first: u64,
    /// Number of pulses of the mean. Default: all.
    #[key(example = 100, whole(2, u64::MAX))]
    pub(super) background_count: Option<u64>,
}

impl RecordingKeys {
    /// Number of sweeps in a pulse.
    pub(super) fn sweeps_a_pulse(&self) -> usize {
        self.transmitters.saturating_mul(*self.average)
    }

    /// Make a fault at the key that names the samples: the array of an archive, or the file.
    pub(super) fn values_fault(&self, message: impl Into<String>) -> Fault {
        match &self.format {
            FormatKeys::Npz(keys) => keys.array.fault(message),
            _ => self.file.fault(message),
        }
    }

    /// Whether the recording has an order of I and Q that its description omits.
    pub(super) fn order_is_unstated(&self) -> bool {
        matches!(self.format, FormatKeys::Dca1000 { .. }) && self.order.is_none()
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Choice)]
pub(super) enum Layout {
    PulsesSamples,
    SamplesPulses,
}

/// Order of the numbers in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub(super) enum Order {
    /// Two I, two Q.
    Iiqq,
    /// I and Q alternating.
    Iqiq,
    /// Real numbers without Q.
    Real,
}

#[derive(Clone, Copy, Choice)]
pub(super) enum Sign {
    Minus,
    Plus,
}

#[derive(Clone, Copy, Choice)]
pub(super) enum TimeUnit {
    S,
    Ms,
    Us,
    Ns,
}

impl TimeUnit {
    /// Length of the unit in seconds.
    pub(super) fn seconds(self) -> f64 {
        match self {
            Self::S => 1.0,
            Self::Ms => 1e-3,
            Self::Us => 1e-6,
            Self::Ns => 1e-9,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Choice)]
pub(super) enum PulsesUsed {
    All,
    Moving,
}

#[derive(Clone, Copy, PartialEq, Eq, Choice)]
pub(super) enum IqCorrection {
    Keep,
    Correct,
}

#[derive(Clone, Copy, PartialEq, Eq, Choice)]
pub(super) enum Background {
    Keep,
    Mean,
    MeanMoving,
}

/// Scene.
#[section]
pub(super) struct SceneKeys {
    /// Reference point of the phases. If neither this nor reference_range is given, phases are referred to the middle of the unambiguous
    /// ranges; to the origin for a pulsed radar that moves until the echo arrives.
    #[key(example = "0, 5, 0 m")]
    pub(super) reference_m: Option<DVec3>,
    /// Alternative to a reference point: the same range from the radar for all pulses.
    #[key(example = "5 m", positive)]
    pub(super) reference_range_m: Option<Located<f64>>,
    /// Extent of the scene in x, for default image grids. Give x and y, or neither.
    #[key(example = "-4, 4 m")]
    pub(super) x_m: Option<Located<(f64, f64)>>,
    /// Extent of the scene in y.
    #[key(example = "1, 9 m")]
    pub(super) y_m: Option<Located<(f64, f64)>>,
    /// Where on Earth (WGS 84) the scene's origin is; x points east, y north, z up. If left out, axes are local.
    #[section]
    pub(super) origin: Option<OriginKeys>,
}

/// Radar and its waveform.
#[section]
pub(super) struct RadarKeys {
    #[at]
    pub(super) header: Location,
    /// Waveform: beats of linear sweeps; echoes of a known pulse before any matched filter; a complex number for each of ascending
    /// frequencies; or range profiles, real waveforms or complex.
    #[key(required = "fmcw", select(Fmcw, Pulsed, Stepped, Profiles))]
    pub(super) kind: Located<WaveformKeys>,
    /// Pulse repetition interval. Default, without prf and times: 1 s.
    #[key(example = "1 ms", positive)]
    pub(super) pri_s: Located<Option<f64>>,
    /// Pulse repetition frequency.
    #[key(example = "1 kHz", positive)]
    pub(super) prf_hz: Located<Option<f64>>,
    /// Time of the recording's first pulse on the platform's clock. Default: the first of times, or 0.
    #[key(example = "9.22 s")]
    pub(super) first_pulse_s: Option<f64>,
    /// Time from a transmitter's sweep to the next one's within a pulse. Default: an equal part of the time from pulse to pulse, or 0 where
    /// sweeps are averaged while the radar stands still.
    #[key(example = "50 us", not_negative)]
    pub(super) transmitter_interval_s: Option<f64>,
    /// Frequency of the first sample. Touchstone files contain it; otherwise it is required.
    #[key(example = "77 GHz", positive, when(Fmcw, Stepped))]
    pub(super) start_hz: Option<Located<f64>>,
    /// Sweep rate; negative for falling sweeps.
    #[key(required = "40 MHz/us", when(Fmcw))]
    pub(super) slope_hz_s: f64,
    /// Frequency step. Touchstone files contain it; otherwise it is required.
    #[key(example = "4 MHz", positive, when(Stepped))]
    pub(super) step_hz: Option<Located<f64>>,
    /// Time from frequency to frequency. Needed if the radar moves meanwhile.
    #[key(example = "2 us", positive, when(Stepped))]
    pub(super) step_time_s: Option<f64>,
    /// Whether the radar moves during a sweep. A pulse's time is then that of its middle sample, number samples / 2 from 0, and the track
    /// must be accurate at that scale. For kind = "pulsed" a pulse's time is that of its start, the receiver moves on until the echo of the
    /// scene's reference point (default: the origin) arrives, and the phases include the motion during an LFM pulse. Default: stop-and-go; true
    /// for pulses from a platform with frame = "ecef".
    #[key(example = "true", when(Fmcw, Pulsed, Stepped))]
    pub(super) motion: Option<Located<IntraPulse>>,
    /// Sampling rate of complex samples.
    #[key(required = "2.5 MHz", positive, when(Fmcw, Pulsed))]
    pub(super) sample_rate_hz: f64,
    /// Delay of the copy that the echo is mixed with; 0 for a plain homodyne radar.
    #[key(default = "0 s", not_negative, when(Fmcw))]
    pub(super) mixer_delay_s: f64,
    /// Delay of sample 0 after the pulse's start.
    #[key(required = "38.7 us", not_negative, when(Pulsed))]
    pub(super) window_start_s: f64,
    /// Frequency that 0 Hz of the samples corresponds to. Required for complex samples; not permitted for real waveforms.
    #[key(example = "10 GHz", positive, when(Pulsed, Profiles))]
    pub(super) centre_hz: Option<Located<f64>>,
    /// Frequencies kept from the spectrum of the profiles.
    #[key(required = "3.1, 4.8 GHz", when(Profiles))]
    pub(super) band_hz: Located<(f64, f64)>,
    /// ARRAY of the bins' ranges in metres, evenly spaced. Give either this or first_range and range_step.
    #[key(example = "range_bins_m", when(Profiles))]
    pub(super) ranges: Option<Located<String>>,
    /// Range of the first bin.
    #[key(example = "2 m", when(Profiles))]
    pub(super) first_range_m: Option<f64>,
    /// Range bin spacing.
    #[key(example = "9.15 mm", positive, when(Profiles))]
    pub(super) range_step_m: Option<f64>,
    /// Shape of the pulse.
    #[section(when(Pulsed))]
    pub(super) pulse: PulseKeys,
    /// An antenna that transmits. Several are those that take turns, in their order. One at the body's origin if there is none. Its pattern
    /// and boresight say which pulses see a place.
    #[section]
    pub(super) transmitter: Vec<AntennaKeys>,
    /// An antenna that receives. Several are those recorded, in their order. One at the body's origin if there is none. Its pattern and
    /// boresight say which pulses see a place.
    #[section]
    pub(super) receiver: Vec<AntennaKeys>,
}

#[section]
pub(super) struct AntennaKeys {
    #[at]
    pub(super) header: Location,
    #[keys]
    pub(super) mount: MountKeys,
    /// Phase error of the antenna, exp(+j phase) after [recording] phase. It is removed.
    #[key(default = "0 deg")]
    pub(super) phase_rad: f64,
    /// Gain error of the antenna. It is removed.
    #[key(default = "0 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) level_db: f64,
    #[keys]
    pub(super) beam: BeamKeys,
}

/// Motion of the radar. By default its heading is along the velocity; a fixed radar has the scene's axes, and the x axis of a swinging arm
/// is along the arm.
#[section]
pub(super) struct PlatformKeys {
    #[at]
    pub(super) header: Location,
    /// A swinging arm, a carriage on a rail, a straight line, a level circle, points passed at given times (straight or smooth), a recorded
    /// track, or a fixed position.
    #[key(
        required = "arc",
        select(
            Arc, Rail, Linear, Circular, Waypoints, Spline, Csv, Motive, Novatel, Arrays, Fixed
        )
    )]
    pub(super) kind: MotionKeys,
    /// Pivot of the arm, at the antenna's height.
    #[key(required = "0, 0, 0 m", when(Arc))]
    pub(super) pivot_m: DVec3,
    /// Centre of the circle, at the height of the track.
    #[key(required = "0, 0, 3 km", when(Circular))]
    pub(super) centre_m: DVec3,
    /// Length of the arm, radius of the circle.
    #[key(required = "20 cm", positive, when(Arc, Circular))]
    pub(super) radius_m: f64,
    /// Angle of the arm in the first pulse, from x towards y.
    #[key(required = "0 deg", when(Arc))]
    pub(super) from_angle_rad: f64,
    /// Angle at the other end of the swing.
    #[key(required = "180 deg", when(Arc))]
    pub(super) to_angle_rad: f64,
    /// Rate of the swing. Default: one swing over the recording.
    #[key(example = "10 deg/s", positive, when(Arc))]
    pub(super) rate_rad_s: Option<f64>,
    /// Start of the rail.
    #[key(required = "-1, 0, 0 m", when(Rail))]
    pub(super) from_m: DVec3,
    /// End of the rail.
    #[key(required = "1, 0, 0 m", when(Rail))]
    pub(super) to_m: Located<DVec3>,
    /// Speed along the rail or the circle. Default: the whole rail over the recording.
    #[key(example = "0.1 m/s", positive, when(Rail, Circular))]
    pub(super) speed_m_s: Option<f64>,
    /// Alternative to a speed: distance from one pulse to the next.
    #[key(example = "1 mm", positive, when(Rail))]
    pub(super) spacing_m: Option<Located<f64>>,
    /// Constant roll, pitch and yaw; 0, 0, 0 aligns the body's axes with the scene's. Default: as recorded, otherwise along the velocity.
    #[key(
        example = "0, 0, 0 deg",
        when(Rail, Linear, Waypoints, Spline, Csv, Motive, Arrays, Fixed)
    )]
    pub(super) attitude_rad: Option<DVec3>,
    /// Start time. Default: that of the first pulse.
    #[key(example = "0 s", when(Arc, Rail))]
    pub(super) start_s: Option<f64>,
    /// Position at the time given by 'at'.
    #[key(required = "0, -5, 3 km", when(Linear, Fixed))]
    pub(super) position_m: DVec3,
    /// Velocity at the position; for a profile, before its first segment.
    #[key(required = "100, 0, 0 m/s", when(Linear))]
    pub(super) velocity_m_s: DVec3,
    /// Time of the position: time 0, or the middle of the collection.
    #[key(default = "middle", when(Linear, Circular))]
    pub(super) at: At,
    #[keys(when(Circular))]
    pub(super) turn: TurnKeys,
    /// Times and positions, connected by straight segments, or by a smooth curve for a spline.
    #[key(
        required = ["0 s, -3, -5000, 3000 m", "60 ms, 3, -5000, 3000 m"],
        rows(2, Time, Length, Length, Length),
        when(Waypoints, Spline)
    )]
    pub(super) points: Located<Vec<[f64; 4]>>,
    /// Recorded track: a CSV file with columns time_s, x_m, y_m, z_m (or time_ms, x_mm, x_cm and so on) and, optionally, roll_deg,
    /// pitch_deg, yaw_deg or vx_m_s, vy_m_s, vz_m_s; an export of OptiTrack's Motive; or a NovAtel log, whose first record is at time 0.
    #[key(required = "track.csv", when(Csv, Motive, Novatel))]
    pub(super) file: Located<PathBuf>,
    /// Rigid body of the motion capture. Required if there are several.
    #[key(example = "radar", when(Motive))]
    pub(super) body: Option<String>,
    /// The scene's x, y and z as axes of the track's file. Default: the same axes; for a motion capture, whose y is up, "x, -z, y".
    #[key(example = "x, -z, y", when(Csv, Motive, Arrays))]
    pub(super) axes: Option<Located<String>>,
    /// Axes of the positions and velocities of a CSV file or of arrays: those of the scene, or Earth-centred, Earth-fixed (ECEF, WGS 84), which
    /// needs [scene.origin]. Default: scene; positions 6300 to 50000 km from the origin are refused unless it is stated. With velocities, and for
    /// orbits, the track is a polynomial of degree 7 through the nearest state vectors: four with velocities, eight without. An orbit's must
    /// reach a hundredth of the wavelength, and the pulses may begin or end half an interval outside of the state vectors.
    #[key(example = "ecef", when(Csv, Arrays))]
    pub(super) frame: Option<Located<TrackFrame>>,
    #[keys(when(Novatel))]
    pub(super) log: LogKeys,
    /// ARRAY of the times of the track, ascending.
    #[key(required = "motion_timestamps_s", when(Arrays))]
    pub(super) times: Located<String>,
    /// Unit of times.
    #[key(default = "s", when(Arrays))]
    pub(super) times_unit: TimeUnit,
    /// ARRAY of the positions: x, y and z in a row for each time.
    #[key(required = "platform_pos_m", when(Arrays))]
    pub(super) positions: Located<String>,
    /// ARRAY of the velocities at the same times in metres per second: x, y and z in a row. Those of ECEF positions are Earth-fixed.
    #[key(example = "platform_vel_m_s", when(Arrays))]
    pub(super) velocities: Option<Located<String>>,
    /// ARRAY of the receiver positions at the same times, if it moves separately; positions are then the transmitter's.
    #[key(example = "receiver_pos_m", when(Arrays))]
    pub(super) receiver_positions: Option<Located<String>>,
    /// Unit of positions.
    #[key(default = "m", when(Arrays))]
    pub(super) positions_unit: LengthUnit,
}

#[derive(Clone, Copy, PartialEq, Eq, Choice)]
pub(super) enum TrackFrame {
    Scene,
    Ecef,
}

#[derive(Clone, Copy, Choice)]
pub(super) enum LengthUnit {
    M,
    Cm,
    Mm,
}

impl LengthUnit {
    /// Length of the unit in metres.
    pub(super) fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 1e-2,
            Self::Mm => 1e-3,
        }
    }
}
