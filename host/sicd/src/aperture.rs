//! The way of the radar (`Position`, `Timeline`) and what is seen of the scene's centre at the centre of the aperture (`SCPCOA`).

use glam::DVec3;

use subaperture_io::product::Antennas;
use subaperture_model::geometry::{Geodetic, SceneFrame};

use crate::polynomial::Path;
use crate::{Placing, SicdError};

/// Antennas that are farther apart, as seen from the scene, are two platforms, radians.
const MOST_APART: f64 = 1e-3;
/// A way that is off its polynomial by more is told of, metres.
const TOLD_M: f64 = 0.01;

/// The antenna reference point over the time from the first pulse, in ECF.
#[derive(Clone, Debug)]
pub(crate) struct Aperture {
    pub(crate) path: Path,
    /// Nanoseconds from the beginning of 1970 to the first pulse.
    pub(crate) start_ns: i64,
    /// Seconds from the first pulse to the last.
    pub(crate) duration_s: f64,
    /// What was assumed, in sentences.
    pub(crate) told: Vec<String>,
}

impl Aperture {
    pub(crate) fn new(
        antennas: &Antennas,
        frame: &SceneFrame,
        centre_m: DVec3,
        placing: &Placing,
    ) -> Result<Self, SicdError> {
        let unsuited = |what: &str| SicdError::Unsuited(what.to_owned());
        let pairs = antennas.transmitters_m.iter().zip(&antennas.receivers_m);
        let apart =
            |(tx, rx): (&DVec3, &DVec3)| tx.distance(*rx) > MOST_APART * tx.distance(centre_m);
        if pairs.clone().any(apart) {
            return Err(unsuited(
                "transmitter and receiver are more than a milliradian apart as seen from the scene, and SICD 1.3 describes images of one platform",
            ));
        }
        let places: Vec<DVec3> = pairs
            .map(|(&tx, &rx)| frame.to_ecf_m(tx.midpoint(rx)))
            .collect();
        let mut told = Vec::new();
        let mut times_s: Vec<f64> = antennas
            .times_s
            .iter()
            .map(|t| t - antennas.times_s[0])
            .collect();
        if !antennas.timed {
            let mut way_m = 0.0;
            for (n, pair) in places.windows(2).enumerate() {
                way_m += pair[0].distance(pair[1]);
                times_s[n + 1] = way_m / placing.speed_m_s;
            }
            told.push(format!(
                "the recording tells no times: the radar is taken to move at {} m/s",
                placing.speed_m_s
            ));
        }
        let duration_s = *times_s.last().expect("there is a pulse");
        if !(duration_s > 0.0 && times_s.is_sorted_by(|a, b| a < b)) {
            return Err(unsuited(
                "the radar does not move: an aperture of one moment or one place has no SICD",
            ));
        }
        let path = Path::through(&times_s, &places)
            .ok_or_else(|| unsuited("no polynomial follows the radar's track"))?;
        if path.off_m > TOLD_M {
            told.push(format!(
                "the track is up to {:.3} m off the polynomial that tells of it",
                path.off_m
            ));
        }
        if path.at(0.5 * duration_s, 1).length() == 0.0 {
            return Err(unsuited(
                "the radar does not move in the middle of the aperture",
            ));
        }
        let recorded_ns = antennas.start_ns.filter(|_| antennas.timed);
        let start_ns = placing.start_ns.or(recorded_ns).unwrap_or_else(|| {
            told.push("the recording does not say when it began: 1970 is written".to_owned());
            0
        });
        let before_ns = match antennas.timed {
            true => (antennas.times_s[0] * 1e9).round() as i64,
            false => 0,
        };
        Ok(Self {
            path,
            start_ns: start_ns.saturating_add(before_ns),
            duration_s,
            told,
        })
    }

    /// The centre of the aperture, seconds.
    pub(crate) fn coa_s(&self) -> f64 {
        0.5 * self.duration_s
    }
}

/// The geometry at the centre of aperture; SICD volume 1, 4.9. Angles in degrees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scpcoa {
    pub(crate) place: DVec3,
    pub(crate) velocity: DVec3,
    pub(crate) acceleration: DVec3,
    pub(crate) left: bool,
    pub(crate) slant_range_m: f64,
    pub(crate) ground_range_m: f64,
    pub(crate) doppler_cone: f64,
    pub(crate) graze: f64,
    pub(crate) twist: f64,
    pub(crate) slope: f64,
    pub(crate) azimuth: f64,
    pub(crate) layover: f64,
}

impl Scpcoa {
    /// Of a point in ECF, seen at a time.
    pub(crate) fn new(path: &Path, time_s: f64, scp: DVec3) -> Self {
        let [place, velocity, acceleration] = [0, 1, 2].map(|k| path.at(time_s, k));
        let slant_range_m = place.distance(scp);
        let los = (scp - place) / slant_range_m;
        let way = velocity.normalize();
        let left = place.cross(way).dot(los) > 0.0;
        let [east, north, up] = Geodetic::from_ecf_m(scp).east_north_up();
        let height_m = (place - scp).dot(up);
        let level = place - up * height_m - scp;
        let x = level.normalize_or(north);
        let y = up.cross(x);
        let normal = if left { way.cross(los) } else { los.cross(way) };
        let normal = normal.normalize_or(up);
        let bearing = |v: DVec3| {
            let degrees = libm::atan2(v.dot(east), v.dot(north)).to_degrees();
            // Of a direction slightly west of north 360 would be rounded to.
            let around = degrees.rem_euclid(360.0);
            if around < 360.0 { around } else { 0.0 }
        };
        let degrees_of = |cosine: f64| libm::acos(cosine.clamp(-1.0, 1.0)).to_degrees();
        let lies = up - normal / normal.dot(up);
        Self {
            place,
            velocity,
            acceleration,
            left,
            slant_range_m,
            // The arc between two directions from the Earth's centre.
            ground_range_m: scp.length() * libm::atan2(place.cross(scp).length(), place.dot(scp)),
            doppler_cone: degrees_of(way.dot(los)),
            graze: libm::atan2(height_m, level.length()).to_degrees(),
            twist: -libm::asin(y.dot(normal).clamp(-1.0, 1.0)).to_degrees(),
            slope: degrees_of(up.dot(normal)),
            azimuth: bearing(x),
            layover: bearing(lies),
        }
    }
}
