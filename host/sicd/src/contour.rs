//! Contours of constant range and range rate (NGA.STND.0024-3).
//!
//! Range and range rate of a bistatic image are averages over transmitter and receiver: half of the length of the path, and of its rate.

use glam::{DMat2, DVec2, DVec3};

use subaperture_model::geometry::Geodetic;

/// Largest number of iterations on a plane.
const MAX_STEPS: usize = 20;

/// Antenna phase centre at one time, ECF.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Antenna {
    pub(crate) place: DVec3,
    pub(crate) velocity: DVec3,
}

impl Antenna {
    /// Range and range rate of a point: metres, metres per second.
    fn range_and_rate(&self, point: DVec3) -> [f64; 2] {
        let sight = self.place - point;
        let range_m = sight.length();
        [range_m, self.velocity.dot(sight) / range_m]
    }

    /// Gradients of range and range rate over the point.
    fn gradients(&self, point: DVec3) -> [DVec3; 2] {
        let sight = self.place - point;
        let range_m = sight.length();
        let away = -sight / range_m;
        let across = self.velocity - away * self.velocity.dot(away);
        [away, -across / range_m]
    }
}

/// Antennas of an image at a centre of aperture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensor {
    /// Antenna of a monostatic image, or transmitter.
    pub(crate) transmitter: Antenna,
    /// Receiver of a bistatic image.
    pub(crate) receiver: Option<Antenna>,
}

impl Sensor {
    /// Range and range rate of a point: metres, metres per second.
    pub(crate) fn range_and_rate(&self, point: DVec3) -> [f64; 2] {
        let [range_m, rate_m_s] = self.transmitter.range_and_rate(point);
        match &self.receiver {
            None => [range_m, rate_m_s],
            Some(receiver) => {
                let [a, b] = receiver.range_and_rate(point);
                [0.5 * (range_m + a), 0.5 * (rate_m_s + b)]
            }
        }
    }

    /// Gradients of range and range rate over the point. Those of a bistatic image are minus the bisector of the directions to both antennas and minus its rate.
    pub(crate) fn gradients(&self, point: DVec3) -> [DVec3; 2] {
        let [away, turning] = self.transmitter.gradients(point);
        match &self.receiver {
            None => [away, turning],
            Some(receiver) => {
                let [a, b] = receiver.gradients(point);
                [0.5 * (away + a), 0.5 * (turning + b)]
            }
        }
    }

    /// Whether positions and velocities are finite.
    pub(crate) fn is_finite(&self) -> bool {
        let finite = |antenna: &Antenna| (antenna.place + antenna.velocity).is_finite();
        finite(&self.transmitter) && self.receiver.as_ref().is_none_or(finite)
    }

    /// Point of the plane through `origin`, tangent to the Earth there, with the range and range rate of `point`, by Newton's method. If both contours do not
    /// intersect the plane, the foot of `point`.
    pub(crate) fn on_tangent_plane(&self, point: DVec3, origin: DVec3) -> DVec3 {
        let [east, north, up] = Geodetic::from_ecf_m(origin).east_north_up();
        let [range_m, rate_m_s] = self.range_and_rate(point);
        let foot = point - up * (point - origin).dot(up);
        let mut ground = foot;
        for _ in 0..MAX_STEPS {
            let [range, rate] = self.range_and_rate(ground);
            let [away, turning] = self.gradients(ground);
            let on_plane = |v: DVec3| DVec2::new(v.dot(east), v.dot(north));
            let rows = DMat2::from_cols(on_plane(away), on_plane(turning)).transpose();
            let step = rows.inverse() * DVec2::new(range - range_m, rate - rate_m_s);
            if !step.is_finite() || step.length() > range_m {
                return foot;
            }
            ground -= east * step.x + north * step.y;
            if step.length() < 1e-6 {
                return ground;
            }
        }
        foot
    }
}

/// Range and range rate of an image position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contour {
    pub(crate) sensor: Sensor,
    pub(crate) range_m: f64,
    pub(crate) rate_m_s: f64,
}

impl Contour {
    /// Range and range rate of a point minus those of the contour: metres, metres per second.
    pub(crate) fn off(&self, point: DVec3) -> [f64; 2] {
        let [range_m, rate_m_s] = self.sensor.range_and_rate(point);
        [range_m - self.range_m, rate_m_s - self.rate_m_s]
    }
}
