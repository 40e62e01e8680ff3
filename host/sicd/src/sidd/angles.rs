//! Collection geometry and image phenomenology angles (SIDD volume 1, chapter 7).

use glam::DVec3;

use subaperture_model::geometry::Geodetic;

use crate::aperture::Scpcoa;

/// Angles in degrees; those in the image run from ascending columns towards ascending rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Angles {
    pub(crate) azimuth: f64,
    pub(crate) slope: f64,
    pub(crate) squint: f64,
    pub(crate) graze: f64,
    pub(crate) tilt: f64,
    pub(crate) doppler_cone: f64,
    /// Direction of the shadow, and its length per unit of height.
    pub(crate) shadow: [f64; 2],
    pub(crate) layover: [f64; 2],
    pub(crate) multipath: f64,
    pub(crate) ground_track: f64,
    pub(crate) north: f64,
}

impl Angles {
    /// Angles at a scene centre (ECF) for an image whose rows and columns ascend along `row` and `column`.
    pub(crate) fn new(scp: DVec3, seen: &Scpcoa, [row, column]: [DVec3; 2]) -> Self {
        let to_radar = (seen.place - scp).normalize();
        let heading = seen.velocity.normalize();
        // Slant plane: direction to the radar, and upward normal.
        let normal = to_radar.cross(heading).normalize_or(scp.normalize());
        let normal = if scp.dot(normal) < 0.0 {
            -normal
        } else {
            normal
        };
        let across = normal.cross(to_radar);
        let plane = row.cross(column);
        let [east, north, up] = Geodetic::from_ecf_m(scp).east_north_up();
        let degrees = |y: f64, x: f64| libm::atan2(y, x).to_degrees();
        let around = |degrees: f64| {
            let turned = degrees.rem_euclid(360.0);
            if turned < 360.0 { turned } else { 0.0 }
        };
        let cosine = |x: f64| libm::acos(x.clamp(-1.0, 1.0)).to_degrees();
        let in_image = |v: DVec3| around(degrees(v.dot(row), v.dot(column)));
        // Projection onto the image plane along the slant plane's normal.
        let seen_at = |v: DVec3| v - normal * (v.dot(plane) / normal.dot(plane));
        let level = |v: DVec3| {
            let vertical = seen.place.normalize();
            (v - vertical * v.dot(vertical)).normalize_or(east)
        };
        let left = seen.place.cross(seen.velocity).dot(to_radar) < 0.0;
        let squint = cosine(-level(to_radar).dot(level(heading)));
        let shadow = seen_at(up - to_radar / to_radar.dot(up));
        let layover = plane - normal / normal.dot(plane);
        Self {
            azimuth: around(degrees(east.dot(to_radar), north.dot(to_radar))),
            slope: cosine(normal.dot(up)),
            squint: if left { squint } else { -squint },
            graze: libm::asin(to_radar.dot(up).clamp(-1.0, 1.0)).to_degrees(),
            tilt: libm::atan(up.dot(across) / up.dot(normal)).to_degrees(),
            doppler_cone: cosine(-to_radar.dot(heading)),
            shadow: [in_image(shadow), shadow.length()],
            layover: [in_image(layover), layover.length()],
            multipath: in_image(seen_at(to_radar)),
            ground_track: in_image(seen.velocity - plane * seen.velocity.dot(plane)),
            north: in_image(seen_at(north)),
        }
    }
}
