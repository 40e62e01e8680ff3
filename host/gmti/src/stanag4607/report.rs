//! Target reports of a dwell.

use super::encoded::Encoded;
use super::error::StanagError;
use super::field::{Field, Number};

const INDEX: Field = Field::scaled(
    Number::T(1),
    "MTI report index",
    2,
    (1.0, "report"),
    [0, 0xffff],
);
const LATITUDE: Field = Field::latitude(Number::T(2), "target latitude");
const LONGITUDE: Field = Field::longitude(Number::T(3), "target longitude");
const HEIGHT: Field = Field::scaled(
    Number::T(6),
    "target height",
    2,
    (1.0, "m"),
    [-1000, 32_767],
);
const VELOCITY: Field = Field::scaled(
    Number::T(7),
    "target velocity line-of-sight component",
    2,
    (0.01, "m/s"),
    [-32_768, 32_767],
);
const WRAP_VELOCITY: Field = Field::scaled(
    Number::T(8),
    "target wrap velocity",
    2,
    (0.01, "m/s"),
    [0, 0xffff],
);
const SNR: Field = Field::scaled(Number::T(9), "target SNR", 1, (1.0, "dB"), [-128, 127]);
const CLASS: Field = Field::scaled(
    Number::T(10),
    "target classification",
    1,
    (1.0, "class"),
    [0, 255],
);
const CLASS_PROBABILITY: Field = Field::scaled(
    Number::T(11),
    "target classification probability",
    1,
    (0.01, "(probability)"),
    [0, 100],
);
const SLANT_RANGE: Field = Field::scaled(
    Number::T(12),
    "slant range uncertainty",
    2,
    (0.01, "m"),
    [0, 0xffff],
);
const CROSS_RANGE: Field = Field::scaled(
    Number::T(13),
    "cross range uncertainty",
    2,
    (0.1, "m"),
    [0, 0xffff],
);
const HEIGHT_DEVIATION: Field =
    Field::scaled(Number::T(14), "height uncertainty", 1, (1.0, "m"), [0, 255]);
const VELOCITY_DEVIATION: Field = Field::scaled(
    Number::T(15),
    "radial velocity uncertainty",
    2,
    (0.01, "m/s"),
    [0, 5000],
);

/// Class of a target (D32.10) without the distinction of live and simulated targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetClass {
    /// No information, code 0.
    NoInformation = 0,
    /// Tracked vehicle, code 1.
    TrackedVehicle = 1,
    /// Wheeled vehicle, code 2.
    WheeledVehicle = 2,
    /// Rotary-wing aircraft, code 3.
    RotaryWingAircraft = 3,
    /// Fixed-wing aircraft, code 4.
    FixedWingAircraft = 4,
    /// Stationary rotator, for example an antenna, code 5.
    StationaryRotator = 5,
    /// Maritime target, code 6.
    Maritime = 6,
    /// Beacon, for example a transponder, code 7.
    Beacon = 7,
    /// Amphibious vehicle, code 8.
    Amphibious = 8,
    /// Person, also dismount, code 9.
    Person = 9,
    /// Vehicle, tracked or wheeled, code 10.
    Vehicle = 10,
    /// Animal of any kind, code 11.
    Animal = 11,
    /// Class outside of this list, code 126.
    Other = 126,
    /// Target that could not be classified, code 127.
    Unknown = 127,
}

/// Classification of a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classification {
    /// Class of the target (D32.10).
    pub class: TargetClass,
    /// Origin of the target: a simulation instead of a live target (D32.10, 128 added).
    pub simulated: bool,
    /// Probability that the class is correct (D32.11), 0 to 1.
    pub probability: Option<f64>,
}

/// Velocity of a target along the line of sight between sensor and target, corrected for the motion of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSightVelocity {
    /// Velocity away from the sensor (D32.7), metres per second: positive when the range increases, -327.68 to 327.67.
    ///
    /// The sign is opposite to that of [`Target::radial_velocity_m_s`](crate::Target::radial_velocity_m_s).
    pub away_m_s: f64,
    /// Wrap velocity (D32.8), metres per second, 0 to 655.35: half of the interval of velocities without ambiguity, half of
    /// [`Target::velocity_ambiguity_m_s`](crate::Target::velocity_ambiguity_m_s).
    pub wrap_m_s: f64,
    /// Standard deviation (D32.15), metres per second, 0 to 50.
    pub deviation_m_s: Option<f64>,
}

/// Detected target of a dwell (D32, Target Report).
///
/// All targets of a dwell have the same optional fields, because they share one existence mask. Standard deviations require
/// [`Dwell::sensor_deviation`](super::Dwell::sensor_deviation).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetReport {
    /// Sequential number of the report in the dwell, MTI report index (D32.1).
    pub index: Option<u16>,
    /// Latitude (D32.2), degrees, north positive, -90 to 90.
    pub latitude_deg: f64,
    /// Longitude (D32.3), degrees, east positive, -180 to 360.
    pub longitude_deg: f64,
    /// Geodetic height above the WGS 84 ellipsoid (D32.6), metres, -1000 to 32767.
    pub height_m: Option<f64>,
    /// Velocity along the line of sight (D32.7, D32.8, D32.15).
    pub velocity: Option<LineOfSightVelocity>,
    /// Signal-to-noise ratio (D32.9), dB, -128 to 127.
    pub snr_db: Option<f64>,
    /// Classification of the target (D32.10, D32.11).
    pub classification: Option<Classification>,
    /// Standard deviation of the slant range (D32.12), metres, 0 to 655.35.
    pub slant_range_deviation_m: Option<f64>,
    /// Standard deviation of the position across the line of sight (D32.13), metres, 0 to 6553.5.
    pub cross_range_deviation_m: Option<f64>,
    /// Standard deviation of the height (D32.14), metres, 0 to 255. It requires a height.
    pub height_deviation_m: Option<f64>,
}

impl TargetReport {
    /// Report of a position, without optional fields.
    pub fn new(latitude_deg: f64, longitude_deg: f64) -> Self {
        Self {
            index: None,
            latitude_deg,
            longitude_deg,
            height_m: None,
            velocity: None,
            snr_db: None,
            classification: None,
            slant_range_deviation_m: None,
            cross_range_deviation_m: None,
            height_deviation_m: None,
        }
    }

    /// Encoded report and the bits of its fields in the existence mask.
    pub(super) fn encoded(&self, has_sensor_deviation: bool) -> Result<Encoded, StanagError> {
        let mut out = Encoded::default();
        if let Some(index) = self.index {
            out.raw(&INDEX, index.into());
        }
        out.nearest(&LATITUDE, self.latitude_deg)?;
        out.circle(&LONGITUDE, self.longitude_deg)?;
        if let Some(height) = self.height_m {
            out.nearest(&HEIGHT, height)?;
        }
        if let Some(velocity) = self.velocity {
            out.nearest(&VELOCITY, velocity.away_m_s)?;
            out.nearest(&WRAP_VELOCITY, velocity.wrap_m_s)?;
        }
        if let Some(snr) = self.snr_db {
            out.nearest(&SNR, snr)?;
        }
        if let Some(classification) = self.classification {
            let class = classification.class as i64;
            out.raw(&CLASS, class + 128 * i64::from(classification.simulated));
            if let Some(probability) = classification.probability {
                out.nearest(&CLASS_PROBABILITY, probability)?;
            }
        }
        let missing = |field: &Field, needed: String| StanagError::Missing {
            field: field.label(),
            needed,
        };
        if self.height_deviation_m.is_some() && self.height_m.is_none() {
            return Err(missing(&HEIGHT_DEVIATION, HEIGHT.label()));
        }
        let deviations = [
            (&SLANT_RANGE, self.slant_range_deviation_m),
            (&CROSS_RANGE, self.cross_range_deviation_m),
            (&HEIGHT_DEVIATION, self.height_deviation_m),
            (
                &VELOCITY_DEVIATION,
                self.velocity.and_then(|velocity| velocity.deviation_m_s),
            ),
        ];
        for (field, deviation) in deviations {
            let Some(deviation) = deviation else { continue };
            if !has_sensor_deviation {
                let needed = "D12, D13, D14 (sensor position uncertainty)";
                return Err(missing(field, needed.into()));
            }
            out.up(field, deviation)?;
        }
        Ok(out)
    }
}
