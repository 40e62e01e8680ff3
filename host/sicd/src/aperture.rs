//! Antenna trajectory (`Position`, `Timeline`) and geometry at the centre of aperture (`SCPCOA`).

use glam::DVec3;

use subaperture_io::product::Antennas;
use subaperture_io::xml::Writer;
use subaperture_model::geometry::{Geodetic, SceneFrame};

use crate::contour::{Antenna, Sensor};
use crate::pair::{Fitted, Pair};
use crate::polynomial::Path;
use crate::{Georeference, SicdError};

/// Largest angle between transmitter and receiver seen from the scene, radians; more is bistatic.
const MAX_APART: f64 = 1e-3;
/// Deviation of the trajectory from its polynomial above which it is reported, metres.
const REPORTED_M: f64 = 0.01;

/// Aperture reference point (ARP) over the time from the first pulse, ECF.
#[derive(Clone, Debug)]
pub(crate) struct Aperture {
    pub(crate) path: Path,
    /// Both antennas of a bistatic image.
    pub(crate) pair: Option<Pair>,
    /// Time of the first pulse, nanoseconds since 1970 (UTC).
    pub(crate) start_ns: i64,
    /// Time from the first pulse to the last, or to its reception in a bistatic image, seconds.
    pub(crate) duration_s: f64,
    /// Time of the centre of aperture, seconds after the first pulse. That of a bistatic image is the time at the scene.
    pub(crate) coa_s: f64,
    /// Assumptions made, one sentence each.
    pub(crate) assumed: Vec<String>,
}

impl Aperture {
    /// Trajectory of an image about `centre_m`, the scene centre point of a bistatic one (scene frame).
    pub(crate) fn new(
        antennas: &Antennas,
        frame: &SceneFrame,
        centre_m: DVec3,
        placing: &Georeference,
    ) -> Result<Self, SicdError> {
        let unsuited = |what: &str| SicdError::Unsuited(what.to_owned());
        let pairs = antennas.transmitters_m.iter().zip(&antennas.receivers_m);
        let apart =
            |(tx, rx): (&DVec3, &DVec3)| tx.distance(*rx) > MAX_APART * tx.distance(centre_m);
        let bistatic = pairs.clone().any(apart);
        if bistatic && !antennas.timed {
            return Err(unsuited(
                "the recording of a bistatic radar contains no pulse times; SICD needs them, as transmitter and receiver have no common speed",
            ));
        }
        let places: Vec<DVec3> = pairs
            .clone()
            .map(|(&tx, &rx)| frame.to_ecf_m(tx.midpoint(rx)))
            .collect();
        let mut assumed = Vec::new();
        let mut times_s: Vec<f64> = antennas
            .times_s
            .iter()
            .map(|t| t - antennas.times_s[0])
            .collect();
        if !antennas.timed {
            let mut travelled_m = 0.0;
            for (n, pair) in places.windows(2).enumerate() {
                travelled_m += pair[0].distance(pair[1]);
                times_s[n + 1] = travelled_m / placing.speed_m_s;
            }
            assumed.push(format!(
                "the recording contains no pulse times; the radar is assumed to move at {} m/s",
                placing.speed_m_s
            ));
        }
        let duration_s = *times_s.last().expect("there is a pulse");
        if !(duration_s > 0.0 && times_s.is_sorted_by(|a, b| a < b)) {
            return Err(unsuited(
                "expected a moving radar, found one pulse time or antenna position; SICD cannot describe it",
            ));
        }
        let (path, pair, coa_s, duration_s) = if bistatic {
            let places: Vec<[DVec3; 2]> = pairs
                .map(|(&tx, &rx)| [tx, rx].map(|place| frame.to_ecf_m(place)))
                .collect();
            let fitted = Fitted::new(&times_s, &places, frame.to_ecf_m(centre_m));
            let fitted = fitted.map_err(unsuited)?;
            (
                fitted.path,
                Some(fitted.pair),
                fitted.coa_s,
                fitted.duration_s,
            )
        } else {
            let path = Path::through(&times_s, &places)
                .ok_or_else(|| unsuited("no polynomial fits the radar's trajectory"))?;
            (path, None, 0.5 * duration_s, duration_s)
        };
        let mut report = |whose: &str, path: &Path| {
            if path.off_m > REPORTED_M {
                assumed.push(format!(
                    "the trajectory {whose}deviates from its polynomial by up to {:.3} m",
                    path.off_m
                ));
            }
        };
        match &pair {
            None => report("", &path),
            Some(pair) => {
                report("of the aperture reference point ", &path);
                report("of the transmitter ", &pair.transmitter);
                report("of the receiver ", &pair.receiver);
            }
        }
        if path.at(coa_s, 1).length() == 0.0 {
            return Err(unsuited(
                "the radar does not move at the centre of aperture",
            ));
        }
        let recorded_ns = antennas.start_ns.filter(|_| antennas.timed);
        let start_ns = placing.start_ns.or(recorded_ns).unwrap_or_else(|| {
            assumed.push("the recording contains no start time; 1970 is written".to_owned());
            0
        });
        let before_ns = match antennas.timed {
            true => (antennas.times_s[0] * 1e9).round() as i64,
            false => 0,
        };
        Ok(Self {
            path,
            pair,
            start_ns: start_ns.saturating_add(before_ns),
            duration_s,
            coa_s,
            assumed,
        })
    }
}

/// Geometry at the centre of aperture (SICD volume 1, 4.9); angles in degrees.
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
    /// Geometry of a scene point (ECF) at a time.
    pub(crate) fn new(path: &Path, time_s: f64, scp: DVec3) -> Self {
        let [place, velocity, acceleration] = [0, 1, 2].map(|k| path.at(time_s, k));
        let slant_range_m = place.distance(scp);
        let los = (scp - place) / slant_range_m;
        // A fixed antenna has no heading: its Doppler cone angle is 90 degrees.
        let heading = velocity.normalize_or_zero();
        let left = place.cross(heading).dot(los) > 0.0;
        let [east, north, up] = Geodetic::from_ecf_m(scp).east_north_up();
        let height_m = (place - scp).dot(up);
        let level = place - up * height_m - scp;
        let x = level.normalize_or(north);
        let y = up.cross(x);
        let normal = if left {
            heading.cross(los)
        } else {
            los.cross(heading)
        };
        let normal = normal.normalize_or(up);
        let bearing = |v: DVec3| {
            let degrees = libm::atan2(v.dot(east), v.dot(north)).to_degrees();
            // A bearing slightly west of north rounds to 360.
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
            // Arc between the directions from the Earth's centre.
            ground_range_m: scp.length() * libm::atan2(place.cross(scp).length(), place.dot(scp)),
            doppler_cone: degrees_of(heading.dot(los)),
            graze: libm::atan2(height_m, level.length()).to_degrees(),
            twist: -libm::asin(y.dot(normal).clamp(-1.0, 1.0)).to_degrees(),
            slope: degrees_of(up.dot(normal)),
            azimuth: bearing(x),
            layover: bearing(lies),
        }
    }
    /// Antenna of a monostatic image at the aperture reference point.
    pub(crate) fn sensor(&self) -> Sensor {
        Sensor {
            transmitter: Antenna {
                place: self.place,
                velocity: self.velocity,
            },
            receiver: None,
        }
    }

    /// Write `SideOfTrack`, ranges and angles that images and platforms have in common.
    pub(crate) fn write_sides(&self, w: &mut Writer) {
        w.text("SideOfTrack", if self.left { "L" } else { "R" });
        w.numbers(&[
            ("SlantRange", self.slant_range_m),
            ("GroundRange", self.ground_range_m),
            ("DopplerConeAng", self.doppler_cone),
            ("GrazeAng", self.graze),
            ("IncidenceAng", 90.0 - self.graze),
        ]);
    }
}
