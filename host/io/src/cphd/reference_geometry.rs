//! The ReferenceGeometry branch: platform positions as seen from the SRP of one vector (CPHD 1.1.0 section 6.5;
//! comments state the numbers of its equations).
//!
//! Several equations of the standard are ill-conditioned if the radar looks along an axis: rounding can put the
//! cosine of a zero graze angle above one, where the arc cosine is not a number, and a zero azimuth can become 360
//! degrees. A checker evaluates the equations with roundings of its own. [`choose`] therefore selects the vector
//! nearest the middle whose results are stable under several rounding rules, and the writer states it as the
//! reference vector. Angles that are undefined at every vector (twist, slope and layover of a platform at rest or
//! moving along the line of sight) are written as 0, and a Doppler cone angle as 90.

use glam::DVec3;

use super::pvp::Record;
use crate::xml::Writer;
use subaperture_model::geometry::Geodetic;

/// Rounding rules of the arithmetic in one trial.
#[derive(Clone, Copy)]
struct Arithmetic {
    /// Sums of products with a single rounding each, as compilers for recent processors make them.
    fused: bool,
    /// Factor on the latitude of the SRP, within one rounding of 1.
    nudge: f64,
    /// Whether cosines above 1 are limited to 1. A checker may not do so.
    clamped: bool,
}

const TRIALS: [Arithmetic; 4] = [
    trial(false, 1.0),
    trial(true, 1.0),
    trial(true, 1.0 + f64::EPSILON),
    trial(true, 1.0 - f64::EPSILON),
];

const fn trial(fused: bool, nudge: f64) -> Arithmetic {
    Arithmetic {
        fused,
        nudge,
        clamped: false,
    }
}

const WRITTEN: Arithmetic = Arithmetic {
    fused: false,
    nudge: 1.0,
    clamped: true,
};

impl Arithmetic {
    fn dot(self, a: DVec3, b: DVec3) -> f64 {
        if self.fused {
            a.z.mul_add(b.z, a.y.mul_add(b.y, a.x * b.x))
        } else {
            a.x * b.x + a.y * b.y + a.z * b.z
        }
    }

    fn length(self, a: DVec3) -> f64 {
        self.dot(a, a).sqrt()
    }

    fn unit(self, a: DVec3) -> DVec3 {
        a / self.length(a)
    }

    fn acos_deg(self, cosine: f64) -> f64 {
        libm::acos(self.clamp(cosine)).to_degrees()
    }

    fn asin_deg(self, sine: f64) -> f64 {
        libm::asin(self.clamp(sine)).to_degrees()
    }

    fn clamp(self, x: f64) -> f64 {
        if self.clamped { x.clamp(-1.0, 1.0) } else { x }
    }
}

/// Angle from north of a direction given by its north and east parts, degrees, 0 to 360.
fn bearing_deg(north: f64, east: f64) -> f64 {
    libm::atan2(east, north).to_degrees().rem_euclid(360.0)
}

/// Local directions at the SRP.
struct Place {
    srp: DVec3,
    east: DVec3,
    north: DVec3,
    up: DVec3,
}

impl Place {
    fn new(srp: DVec3, arithmetic: Arithmetic) -> Self {
        let mut at = Geodetic::from_ecf_m(srp);
        at.latitude_deg *= arithmetic.nudge;
        let [east, north, up] = at.east_north_up();
        Self {
            srp,
            east,
            north,
            up,
        }
    }
}

/// One platform as seen from the SRP; angles in degrees (6.5.2).
struct Platform {
    left: bool,
    slant_range_m: f64,
    ground_range_m: f64,
    doppler_cone: f64,
    graze: f64,
    azimuth: f64,
    twist: f64,
    slope: f64,
    layover: f64,
}

impl Platform {
    fn new(position: DVec3, velocity: DVec3, place: &Place, a: Arithmetic) -> Self {
        // (2): range, direction from the SRP to the platform, range rate.
        let offset = position - place.srp;
        let slant_range_m = a.length(offset);
        let u = offset / slant_range_m;
        let range_rate = a.dot(u, velocity);
        // (3, 4): ground range along a sphere through the SRP. The standard's arc cosine of two nearly equal
        // directions is wrong by some R^2 2^-50 / range, 0.4 mm of 12 m; the arc tangent is not.
        let position_unit = a.unit(position);
        let srp_radius = a.length(place.srp);
        let across = a.length(offset.cross(place.srp));
        let earth_angle = libm::atan2(across, a.dot(position, place.srp));
        // (5, 6): the SRP is to the left of the track if the platform is to the right of the SRP.
        let speed = a.length(velocity);
        let v = velocity / speed;
        let still = speed == 0.0; // then (6.5.3 (18)) the side is L and the cone angle 90
        let left = still || a.dot(position_unit.cross(v), u) < 0.0;
        // (8): ground plane at the SRP, x towards the platform.
        let y = a.unit(place.up.cross(u));
        let x = y.cross(place.up);
        // (11): normal of the slant plane, upwards.
        let normal = a.unit(if left { u.cross(v) } else { -u.cross(v) });
        Self {
            left,
            slant_range_m,
            ground_range_m: srp_radius * earth_angle,
            doppler_cone: if still {
                90.0
            } else {
                a.acos_deg(-range_rate / speed) // (7)
            },
            graze: a.acos_deg(a.dot(u, x)), // (9)
            azimuth: bearing_deg(a.dot(x, place.north), a.dot(x, place.east)), // (10)
            twist: -a.asin_deg(a.dot(normal, y)), // (12)
            slope: a.acos_deg(a.dot(place.up, normal)), // (13)
            layover: bearing_deg(a.dot(-normal, place.north), a.dot(-normal, place.east)), // (14)
        }
    }

    /// Numbers that a checker compares: lengths and angles. The side of track is coded as an angle, so that a change
    /// counts as an error.
    fn numbers(&self, slant_plane: bool) -> ([f64; 2], Vec<f64>) {
        let side = if self.left { 180.0 } else { 0.0 };
        let mut angles = vec![side, self.doppler_cone, self.graze, self.azimuth];
        if slant_plane {
            angles.extend([self.twist, self.slope, self.layover]);
        }
        ([self.slant_range_m, self.ground_range_m], angles)
    }

    fn write(&self, w: &mut Writer) {
        let graze = within_90(self.graze);
        w.text("SideOfTrack", if self.left { "L" } else { "R" });
        w.numbers(&[
            ("SlantRange", positive(self.slant_range_m)),
            ("GroundRange", positive(self.ground_range_m)),
            (
                "DopplerConeAngle",
                or(self.doppler_cone, 90.0).clamp(0.0, BELOW_180),
            ),
            ("GrazeAngle", graze),
            ("IncidenceAngle", within_90(90.0 - graze)),
            ("AzimuthAngle", within_360(self.azimuth)),
        ]);
    }
}

/// Both platforms together as seen from the SRP; angles in degrees, rates a second (6.5.3).
struct Bistatic {
    azimuth: f64,
    azimuth_rate: f64,
    bistatic: f64,
    bistatic_rate: f64,
    graze: f64,
    twist: f64,
    slope: f64,
    layover: f64,
    transmitter: Platform,
    receiver: Platform,
}

impl Bistatic {
    fn new(vector: &Record, a: Arithmetic) -> Self {
        let place = Place::new(vector.srp_pos, a);
        // (1, 2): unit vectors from the SRP and their rates.
        let direction = |position: DVec3, velocity: DVec3| {
            let offset = position - place.srp;
            let range = a.length(offset);
            let u = offset / range;
            (u, (velocity - u * a.dot(u, velocity)) / range)
        };
        let (u_tx, u_tx_rate) = direction(vector.tx_pos, vector.tx_vel);
        let (u_rcv, u_rcv_rate) = direction(vector.rcv_pos, vector.rcv_vel);
        // (3): the bisector, of length cos(bistatic angle / 2).
        let b = (u_tx + u_rcv) / 2.0;
        let b_rate = (u_tx_rate + u_rcv_rate) / 2.0;
        let b_length = a.length(b);
        let half = libm::acos(a.clamp(b_length)); // (4)
        let bistatic_rate = if b_length == 0.0 || b_length >= 1.0 {
            0.0
        } else {
            -4.0 * a.dot(b, b_rate) / libm::sin(2.0 * half) // (5)
        };
        // (6, 7): its part in the ground plane.
        let b_up = a.dot(b, place.up);
        let b_ground = b - place.up * b_up;
        let ground = a.length(b_ground);
        let x = b_ground / ground;
        let y = place.up.cross(x);
        // (10, 11): direction of rotation.
        let across = a.dot(b_rate, y);
        // (12, 13): normal of the bistatic slant plane, upwards.
        let b_unit = b / b_length;
        let b_normal_rate = b_rate - b_unit * a.dot(b_rate, b_unit);
        let n = a.unit(b.cross(b_normal_rate)) * if across > 0.0 { 1.0 } else { -1.0 };
        let turning = ground != 0.0 && across != 0.0;
        let if_turning = |angle: f64| if turning { angle } else { 0.0 };
        Self {
            azimuth: bearing_deg(a.dot(x, place.north), a.dot(x, place.east)), // (9)
            azimuth_rate: -(across / ground).to_degrees(),                     // (10)
            bistatic: (2.0 * half).to_degrees(),
            bistatic_rate: bistatic_rate.to_degrees(),
            graze: libm::atan(b_up / ground).to_degrees(), // (8)
            twist: if_turning(-a.asin_deg(a.dot(n, y))),   // (14)
            slope: if_turning(a.acos_deg(a.dot(place.up, n))), // (15)
            layover: if_turning(bearing_deg(a.dot(-n, place.north), a.dot(-n, place.east))), // (16)
            transmitter: Platform::new(vector.tx_pos, vector.tx_vel, &place, a), // (18)
            receiver: Platform::new(vector.rcv_pos, vector.rcv_vel, &place, a), // (19)
        }
    }
}

fn monostatic(vector: &Record, a: Arithmetic) -> (DVec3, DVec3, Platform) {
    let position = (vector.tx_pos + vector.rcv_pos) / 2.0; // (1)
    let velocity = (vector.tx_vel + vector.rcv_vel) / 2.0;
    let place = Place::new(vector.srp_pos, a);
    let platform = Platform::new(position, velocity, &place, a);
    (position, velocity, platform)
}

/// Whether one transmitter and receiver count as one platform: from the SRP they appear at most
/// 1 mrad apart (5 m at 5 km).
pub(super) fn is_monostatic(vectors: &[Record]) -> bool {
    vectors.iter().all(|v| {
        let range = (v.tx_pos - v.srp_pos).length();
        (v.tx_pos - v.rcv_pos).length() <= 1e-3 * range
    })
}

/// Index of the reference vector: the nearest to the middle for which the most [`TRIALS`] agree. At most a few
/// thousand vectors are examined.
pub(super) fn choose(vectors: &[Record], bistatic: bool) -> usize {
    let middle = vectors.len() / 2;
    let mut best = (0, middle);
    for step in 0..vectors.len().min(4096) {
        // middle, middle + 1, middle - 1, middle + 2, ..., around the ends
        let away = step.div_ceil(2);
        let index = if step % 2 == 1 {
            (middle + away) % vectors.len()
        } else {
            (middle + vectors.len() - away) % vectors.len()
        };
        let score = agreeing_trials(&vectors[index], bistatic);
        if score > best.0 {
            best = (score, index);
        }
        if score == TRIALS.len() {
            break;
        }
    }
    best.1
}

/// Number of trials that agree with the written numbers to half of the checkers' tolerance: 1 degree, and 1e-6 of a
/// length.
fn agreeing_trials(vector: &Record, bistatic: bool) -> usize {
    let numbers = |a| -> (Vec<f64>, Vec<f64>) {
        if bistatic {
            let b = Bistatic::new(vector, a);
            let (tx_lengths, tx_angles) = b.transmitter.numbers(false);
            let (rcv_lengths, rcv_angles) = b.receiver.numbers(false);
            let own = [b.azimuth, b.bistatic, b.graze, b.twist, b.slope, b.layover];
            (
                [tx_lengths, rcv_lengths].concat(),
                [&own[..], &tx_angles, &rcv_angles].concat(),
            )
        } else {
            let (lengths, angles) = monostatic(vector, a).2.numbers(true);
            (lengths.to_vec(), angles)
        }
    };
    let (lengths, angles) = numbers(WRITTEN);
    let close = |x: &f64, y: &f64, tolerance: f64| (x - y).abs() <= tolerance;
    TRIALS
        .iter()
        .filter(|&&trial| {
            let (l, d) = numbers(trial);
            l.iter().zip(&lengths).all(|(x, y)| close(x, y, 5e-7 * y))
                && d.iter().zip(&angles).all(|(x, y)| close(x, y, 0.5))
        })
        .count()
}

/// Write the branch for a reference vector. `srp_iac` is its SRP in the scene frame; `dwell` the centre and duration
/// of its illumination.
pub(super) fn describe(
    w: &mut Writer,
    vector: &Record,
    bistatic: bool,
    srp_iac: DVec3,
    dwell: (f64, f64),
) {
    w.element("ReferenceGeometry", "", |w| {
        w.element("SRP", "", |w| {
            w.xyz("ECF", vector.srp_pos);
            w.xyz("IAC", srp_iac);
        });
        w.numbers(&[
            ("ReferenceTime", vector.reference_time()),
            ("SRPCODTime", dwell.0),
            ("SRPDwellTime", dwell.1),
        ]);
        if bistatic {
            describe_bistatic(w, vector);
        } else {
            let (position, velocity, platform) = monostatic(vector, WRITTEN);
            w.element("Monostatic", "", |w| {
                w.xyz("ARPPos", position);
                w.xyz("ARPVel", velocity);
                platform.write(w);
                w.numbers(&[
                    ("TwistAngle", or(platform.twist, 0.0)),
                    ("SlopeAngle", within_90(platform.slope)),
                    ("LayoverAngle", within_360(platform.layover)),
                ]);
            });
        }
    });
}

fn describe_bistatic(w: &mut Writer, vector: &Record) {
    let b = Bistatic::new(vector, WRITTEN);
    w.element("Bistatic", "", |w| {
        w.numbers(&[
            ("AzimuthAngle", within_360(b.azimuth)),
            ("AzimuthAngleRate", or(b.azimuth_rate, 0.0)),
            ("BistaticAngle", or(b.bistatic, 0.0).clamp(0.0, BELOW_180)),
            ("BistaticAngleRate", or(b.bistatic_rate, 0.0)),
            ("GrazeAngle", within_90(b.graze)),
            ("TwistAngle", or(b.twist, 0.0)),
            ("SlopeAngle", within_90(b.slope)),
            ("LayoverAngle", within_360(b.layover)),
        ]);
        let sides = [
            (
                "TxPlatform",
                vector.tx_time,
                vector.tx_pos,
                vector.tx_vel,
                &b.transmitter,
            ),
            (
                "RcvPlatform",
                vector.rcv_time,
                vector.rcv_pos,
                vector.rcv_vel,
                &b.receiver,
            ),
        ];
        for (name, time, position, velocity, platform) in sides {
            w.element(name, "", |w| {
                w.number("Time", time);
                w.xyz("Pos", position);
                w.xyz("Vel", velocity);
                platform.write(w);
            });
        }
    });
}

/// The schema excludes 90, 180 and 360 degrees and zero ranges, which can occur. They are replaced by the largest
/// permitted value below.
const BELOW_90: f64 = 90.0 - 1e-9;
const BELOW_180: f64 = 180.0 - 1e-9;

fn or(value: f64, otherwise: f64) -> f64 {
    if value.is_finite() { value } else { otherwise }
}

fn within_90(degrees: f64) -> f64 {
    or(degrees, 0.0).clamp(0.0, BELOW_90)
}

fn within_360(degrees: f64) -> f64 {
    if degrees < 360.0 { degrees } else { 0.0 }
}

fn positive(metres: f64) -> f64 {
    or(metres, 0.0).max(1e-11)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radar at 12 m on the Earth's surface: the arc length equals the tangent offset to `(12 / R)^2`; the arc cosine
    /// has an error of at least 0.4 mm.
    #[test]
    fn short_ground_ranges_keep_precision() {
        let srp = Geodetic {
            latitude_deg: 52.1,
            longitude_deg: 4.3,
            height_m: 60.0,
        }
        .to_ecf_m();
        // Along the sphere through the SRP and not the ellipsoid: a direction square to the radius.
        let across = DVec3::Z.cross(srp).normalize();
        for distance_m in [0.5, 12.0, 700.0] {
            let at = srp + across * distance_m;
            let place = Place::new(srp, WRITTEN);
            let platform = Platform::new(at, across, &place, WRITTEN);
            let true_m = srp.length() * (distance_m / srp.length()).atan();
            let error_m = (platform.ground_range_m - true_m).abs();
            // Positions are rounded to 1e-9 m.
            assert!(error_m < 4e-9, "{distance_m}: {error_m:e}");
        }
    }
}
