//! Dwell Segment.

use subaperture_model::geometry::Geodetic;

use super::encoded::Encoded;
use super::error::StanagError;
use super::field::{Field, Number};
use super::mission::DAY_NS;
use super::report::TargetReport;

const REVISIT: Field = Field::scaled(
    Number::D(2),
    "revisit index",
    2,
    (1.0, "revisit"),
    [0, 0xffff],
);
const INDEX: Field = Field::scaled(Number::D(3), "dwell index", 2, (1.0, "dwell"), [0, 0xffff]);
const LAST: Field = Field::scaled(
    Number::D(4),
    "last dwell of revisit",
    1,
    (1.0, "flag"),
    [0, 1],
);
const COUNT: Field = Field::scaled(
    Number::D(5),
    "target report count",
    2,
    (1.0, "reports"),
    [0, 0xffff],
);
const TIME: Field = Field::scaled(
    Number::D(6),
    "dwell time from midnight of the mission's day",
    4,
    (0.001, "s"),
    [0, 4_000_000_000],
);
const LATITUDE: Field = Field::latitude(Number::D(7), "sensor latitude");
const LONGITUDE: Field = Field::longitude(Number::D(8), "sensor longitude");
const ALTITUDE: Field = Field::scaled(
    Number::D(9),
    "sensor altitude",
    4,
    (0.01, "m"),
    [-50_000, 2_000_000_000],
);
const ALONG_TRACK: Field = Field::scaled(
    Number::D(12),
    "sensor along-track uncertainty",
    4,
    (0.01, "m"),
    [0, 1_000_000],
);
const CROSS_TRACK: Field = Field::scaled(
    Number::D(13),
    "sensor cross-track uncertainty",
    4,
    (0.01, "m"),
    [0, 1_000_000],
);
const ALTITUDE_DEVIATION: Field = Field::scaled(
    Number::D(14),
    "sensor altitude uncertainty",
    2,
    (0.01, "m"),
    [0, 0xffff],
);
const TRACK: Field = Field::angle(Number::D(15), "sensor track", 0xffff);
const SPEED: Field = Field::scaled(
    Number::D(16),
    "sensor speed",
    4,
    (0.001, "m/s"),
    [0, 8_000_000],
);
const VERTICAL_VELOCITY: Field = Field::scaled(
    Number::D(17),
    "sensor vertical velocity",
    1,
    (0.1, "m/s"),
    [-128, 127],
);
const CENTRE_LATITUDE: Field = Field::latitude(Number::D(24), "dwell area latitude");
const CENTRE_LONGITUDE: Field = Field::longitude(Number::D(25), "dwell area longitude");
/// B16 in kilometres, of positive sign: 7 fraction bits.
const RANGE_EXTENT: Field = Field::scaled(
    Number::D(26),
    "dwell area range half extent",
    2,
    (1000.0 / 128.0, "m"),
    [0, 0x7fff],
);
const ANGLE_EXTENT: Field = Field::angle(Number::D(27), "dwell angle half extent", 0xffff);

/// Standard deviations of the sensor position (D12, D13, D14).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorDeviation {
    /// Along the track (D12), metres, 0 to 10000.
    pub along_track_m: f64,
    /// Across the track, horizontally (D13), metres, 0 to 10000.
    pub cross_track_m: f64,
    /// Of the altitude (D14), metres, 0 to 655.35.
    pub altitude_m: f64,
}

/// Velocity of the sensor over ground (D15, D16, D17).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorVelocity {
    /// Ground track (D15), degrees clockwise from true north, -180 to 360.
    pub track_deg: f64,
    /// Ground speed (D16), metres per second, 0 to 8000.
    pub speed_m_s: f64,
    /// Vertical velocity (D17), metres per second, positive upwards, -12.8 to 12.7.
    pub up_m_s: f64,
}

/// Observation of an area at one time (Dwell Segment), with its targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Dwell {
    /// Sequential number of the revisit of the bounding area (D2), from 0.
    pub revisit_index: u16,
    /// Sequential number of the dwell in the revisit (D3), from 0.
    pub dwell_index: u16,
    /// Flag of the last dwell of the revisit (D4).
    pub is_last: bool,
    /// Temporal centre, nanoseconds since 1970 (UTC). D6 is the time from midnight of the mission's day: at most 46 days.
    pub centre_utc_ns: i64,
    /// Position of the sensor (D7, D8, D9): latitude -90 to 90 and longitude -180 to 360 degrees, height -500 to 20000000 m.
    pub sensor: Geodetic,
    /// Standard deviations of the sensor position (D12, D13, D14).
    pub sensor_deviation: Option<SensorDeviation>,
    /// Velocity of the sensor (D15, D16, D17).
    pub sensor_velocity: Option<SensorVelocity>,
    /// Centre of the dwell area (D24, D25): latitude -90 to 90 and longitude -180 to 360, degrees.
    pub area_centre_deg: [f64; 2],
    /// Distance on the ground from the near edge to the centre of the dwell area (D26), metres, 0 to 255992.
    pub range_half_extent_m: f64,
    /// Half of the 3 dB beamwidth, or of the angle that the dwell covers seen from the sensor (D27), degrees, 0 to 359.99.
    pub angle_half_extent_deg: f64,
    /// Detected targets (D5, D32), at most 65535. A dwell without targets is reported too.
    pub targets: Vec<TargetReport>,
}

impl Dwell {
    /// Dwell Segment without its header (D1 to D32), for a mission that starts on the day after 1970 of number `day`.
    pub(super) fn segment(&self, day: i64) -> Result<Vec<u8>, StanagError> {
        let mut out = Encoded::default();
        out.raw(&REVISIT, self.revisit_index.into());
        out.raw(&INDEX, self.dwell_index.into());
        out.raw(&LAST, self.is_last.into());
        match u16::try_from(self.targets.len()) {
            Ok(count) => out.raw(&COUNT, count.into()),
            Err(_) => {
                let found = self.targets.len();
                return Err(StanagError::Targets { found });
            }
        }
        let since_midnight_ns =
            i128::from(self.centre_utc_ns) - i128::from(day) * i128::from(DAY_NS);
        out.nearest(&TIME, since_midnight_ns as f64 * 1e-9)?;
        out.nearest(&LATITUDE, self.sensor.latitude_deg)?;
        out.circle(&LONGITUDE, self.sensor.longitude_deg)?;
        out.nearest(&ALTITUDE, self.sensor.height_m)?;
        if let Some(deviation) = self.sensor_deviation {
            out.up(&ALONG_TRACK, deviation.along_track_m)?;
            out.up(&CROSS_TRACK, deviation.cross_track_m)?;
            out.up(&ALTITUDE_DEVIATION, deviation.altitude_m)?;
        }
        if let Some(velocity) = self.sensor_velocity {
            out.circle(&TRACK, velocity.track_deg)?;
            out.nearest(&SPEED, velocity.speed_m_s)?;
            out.nearest(&VERTICAL_VELOCITY, velocity.up_m_s)?;
        }
        out.nearest(&CENTRE_LATITUDE, self.area_centre_deg[0])?;
        out.circle(&CENTRE_LONGITUDE, self.area_centre_deg[1])?;
        out.nearest(&RANGE_EXTENT, self.range_half_extent_m)?;
        out.nearest(&ANGLE_EXTENT, self.angle_half_extent_deg)?;
        let mut shared = None;
        for (index, target) in self.targets.iter().enumerate() {
            let at = |error: StanagError| error.at("target report", index);
            let report = target
                .encoded(self.sensor_deviation.is_some())
                .map_err(at)?;
            let different = report.mask ^ *shared.get_or_insert(report.mask);
            if different != 0 {
                let number = Number::T(34 - different.ilog2());
                let field = number.to_string();
                return Err(at(StanagError::Mixed { field }));
            }
            out.bytes.extend(report.bytes);
        }
        let mask = out.mask | shared.unwrap_or(0);
        Ok([mask.to_be_bytes().as_slice(), &out.bytes].concat())
    }
}
