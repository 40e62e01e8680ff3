//! Job Definition Segment.

use super::encoded::Encoded;
use super::error::StanagError;
use super::field::{Field, Number};

const ID: Field = Field::scaled(Number::J(1), "job ID", 4, (1.0, "job"), [1, 0xffff_ffff]);
const SENSOR_TYPE: Field = Field::scaled(Number::J(2), "sensor type", 1, (1.0, "type"), [0, 255]);
const FILTERING: Field = Field::scaled(Number::J(4), "target filtering", 1, (1.0, "flags"), [0, 7]);
const PRIORITY: Field = Field::scaled(Number::J(5), "priority", 1, (1.0, "priority"), [1, 99]);
const RADAR_MODE: Field = Field::scaled(Number::J(14), "radar mode", 1, (1.0, "mode"), [0, 255]);
const REVISIT: Field = Field::scaled(
    Number::J(15),
    "nominal revisit interval",
    2,
    (0.1, "s"),
    [0, 0xffff],
);
const ALONG_TRACK: Field = Field::scaled(
    Number::J(16),
    "nominal along-track uncertainty",
    2,
    (0.1, "m"),
    [0, 10_000],
);
const CROSS_TRACK: Field = Field::scaled(
    Number::J(17),
    "nominal cross-track uncertainty",
    2,
    (0.1, "m"),
    [0, 10_000],
);
const ALTITUDE: Field = Field::scaled(
    Number::J(18),
    "nominal altitude uncertainty",
    2,
    (0.1, "m"),
    [0, 20_000],
);
const HEADING: Field = Field::scaled(
    Number::J(19),
    "nominal track heading uncertainty",
    1,
    (1.0, "degrees"),
    [0, 45],
);
const SPEED: Field = Field::scaled(
    Number::J(20),
    "nominal sensor speed uncertainty",
    2,
    (0.001, "m/s"),
    [0, 65_534],
);
const SLANT_RANGE: Field = Field::scaled(
    Number::J(21),
    "nominal slant range standard deviation",
    2,
    (0.01, "m"),
    [0, 65_534],
);
const CROSS_RANGE: Field = Field::angle(
    Number::J(22),
    "nominal cross range standard deviation",
    0x7fff,
);
const VELOCITY: Field = Field::scaled(
    Number::J(23),
    "nominal line-of-sight velocity standard deviation",
    2,
    (0.01, "m/s"),
    [0, 5000],
);
const MIN_VELOCITY: Field = Field::scaled(
    Number::J(24),
    "nominal minimum detectable velocity",
    1,
    (0.1, "m/s"),
    [0, 254],
);
const DETECTION: Field = Field::scaled(
    Number::J(25),
    "nominal detection probability",
    1,
    (0.01, "(probability)"),
    [0, 100],
);
const FALSE_ALARMS: Field = Field::scaled(
    Number::J(26),
    "nominal false alarm density",
    1,
    (1.0, "dB below 1 per square metre"),
    [0, 254],
);
const TERRAIN: Field = Field::scaled(
    Number::J(27),
    "terrain elevation model",
    1,
    (1.0, "model"),
    [0, 13],
);
const GEOID: Field = Field::scaled(Number::J(28), "geoid model", 1, (1.0, "model"), [0, 3]);

/// Radar job: area, sensor and nominal uncertainties (Job Definition Segment).
///
/// `None` stands for "no statement".
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Identifier of the job (J1, P10), 1 to 4294967295.
    pub id: u32,
    /// Type of the sensor (J2), of the table of the standard. Default: 255, no statement.
    pub sensor_type: u8,
    /// Variant of the sensor (J3), at most 6 characters. Default: empty.
    pub sensor_model: String,
    /// Applied filters (J4): sum of 1 for area filtering, 2 for area blanking, 4 for sector blanking. Default: 0.
    pub target_filtering: u8,
    /// Priority (J5), 1 (highest) to 99 (lowest). Default: 99.
    pub priority: u8,
    /// Corners of the bounding area in clockwise order (J6 to J13): latitude -90 to 90 and longitude -180 to 360, degrees.
    pub bounding_area_deg: [[f64; 2]; 4],
    /// Radar mode (J14), of the table of the standard. Default: 1, moving target indication.
    pub radar_mode: u8,
    /// Nominal revisit interval (J15), seconds. Default: 0, no revisit.
    pub revisit_interval_s: f64,
    /// Standard deviation of the sensor position along the track (J16), metres, 0 to 1000.
    pub along_track_deviation_m: Option<f64>,
    /// Standard deviation of the sensor position across the track (J17), metres, 0 to 1000.
    pub cross_track_deviation_m: Option<f64>,
    /// Standard deviation of the sensor altitude (J18), metres, 0 to 2000.
    pub altitude_deviation_m: Option<f64>,
    /// Standard deviation of the sensor track (J19), degrees, 0 to 45.
    pub track_deviation_deg: Option<f64>,
    /// Standard deviation of the sensor speed (J20), metres per second, 0 to 65.534.
    pub speed_deviation_m_s: Option<f64>,
    /// Standard deviation of a target's slant range (J21), metres, 0 to 655.34.
    pub slant_range_deviation_m: Option<f64>,
    /// Standard deviation of a target's cross-range angle (J22), degrees, below 180.
    pub cross_range_deviation_deg: Option<f64>,
    /// Standard deviation of a target's line-of-sight velocity (J23), metres per second, 0 to 50.
    pub velocity_deviation_m_s: Option<f64>,
    /// Minimum detectable line-of-sight velocity, MDV (J24), metres per second, 0 to 25.4.
    pub min_detectable_velocity_m_s: Option<f64>,
    /// Probability of detection of an unobscured target of 10 square metres (J25), 0 to 1.
    pub detection_probability: Option<f64>,
    /// False alarms per square metre (J26), `10^-25.4` to 1.
    pub false_alarm_density_per_m2: Option<f64>,
    /// Terrain elevation model of target positions (J27), 0 to 13 of the table of the standard. Default: 0, not specified.
    pub terrain_model: u8,
    /// Geoid model of target positions (J28): 0 not specified, 1 EGM96, 2 GEO96, 3 flat Earth. Default: 0.
    pub geoid_model: u8,
}

impl Job {
    /// Job with the defaults of all other fields: no statement about uncertainties.
    pub fn new(id: u32, bounding_area_deg: [[f64; 2]; 4]) -> Self {
        Self {
            id,
            sensor_type: 255,
            sensor_model: String::new(),
            target_filtering: 0,
            priority: 99,
            bounding_area_deg,
            radar_mode: 1,
            revisit_interval_s: 0.0,
            along_track_deviation_m: None,
            cross_track_deviation_m: None,
            altitude_deviation_m: None,
            track_deviation_deg: None,
            speed_deviation_m_s: None,
            slant_range_deviation_m: None,
            cross_range_deviation_deg: None,
            velocity_deviation_m_s: None,
            min_detectable_velocity_m_s: None,
            detection_probability: None,
            false_alarm_density_per_m2: None,
            terrain_model: 0,
            geoid_model: 0,
        }
    }

    /// Job Definition Segment without its header (J1 to J28).
    pub(super) fn segment(&self) -> Result<Vec<u8>, StanagError> {
        let mut out = Encoded::default();
        out.nearest(&ID, self.id.into())?;
        out.raw(&SENSOR_TYPE, self.sensor_type.into());
        out.text((Number::J(3), "sensor model"), &self.sensor_model, 0, 6)?;
        out.nearest(&FILTERING, self.target_filtering.into())?;
        out.nearest(&PRIORITY, self.priority.into())?;
        for (number, [latitude, longitude]) in (6..).step_by(2).zip(self.bounding_area_deg) {
            let field = Field::latitude(Number::J(number), "bounding area latitude");
            out.nearest(&field, latitude)?;
            let field = Field::longitude(Number::J(number + 1), "bounding area longitude");
            out.circle(&field, longitude)?;
        }
        check_area(&self.bounding_area_deg)?;
        out.raw(&RADAR_MODE, self.radar_mode.into());
        out.nearest(&REVISIT, self.revisit_interval_s)?;
        out.up_or_none(&ALONG_TRACK, self.along_track_deviation_m)?;
        out.up_or_none(&CROSS_TRACK, self.cross_track_deviation_m)?;
        out.up_or_none(&ALTITUDE, self.altitude_deviation_m)?;
        out.up_or_none(&HEADING, self.track_deviation_deg)?;
        out.up_or_none(&SPEED, self.speed_deviation_m_s)?;
        out.up_or_none(&SLANT_RANGE, self.slant_range_deviation_m)?;
        match self.cross_range_deviation_deg {
            Some(deviation) => out.up(&CROSS_RANGE, deviation)?,
            // 180 degrees: no statement.
            None => out.raw(&CROSS_RANGE, 0x8000),
        }
        out.up_or_none(&VELOCITY, self.velocity_deviation_m_s)?;
        out.up_or_none(&MIN_VELOCITY, self.min_detectable_velocity_m_s)?;
        match self.detection_probability {
            Some(probability) => out.nearest(&DETECTION, probability)?,
            None => out.raw(&DETECTION, 255),
        }
        match self.false_alarm_density_per_m2 {
            Some(density) => out.nearest(&FALSE_ALARMS, -10.0 * libm::log10(density))?,
            None => out.raw(&FALSE_ALARMS, 255),
        }
        out.nearest(&TERRAIN, self.terrain_model.into())?;
        out.nearest(&GEOID, self.geoid_model.into())?;
        Ok(out.bytes)
    }
}

/// Refuse corners that are not those of a convex quadrilateral in clockwise order, seen from above.
fn check_area(corners: &[[f64; 2]; 4]) -> Result<(), StanagError> {
    let edge = |corner: usize| {
        let [from, to] = [corners[corner % 4], corners[(corner + 1) % 4]];
        // The shorter difference of longitudes, across the meridian of 180 degrees where need be.
        let east = (to[1] - from[1] + 180.0).rem_euclid(360.0) - 180.0;
        [east, to[0] - from[0]]
    };
    for corner in 0..4 {
        let ([x0, y0], [x1, y1]) = (edge(corner + 3), edge(corner));
        if x0 * y1 - y0 * x1 >= 0.0 {
            return Err(StanagError::BoundingArea { corner });
        }
    }
    Ok(())
}
