//! Simulated targets, radar and measurements, and small linear algebra that shares no code with the library.

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Poisson, StandardNormal, Uniform};
use subaperture_gmti::tracker::{Detection, Scan};

/// Radar's speed along x, metres per second.
pub(crate) const SPEED_M_S: f64 = 125.0;

/// Standard deviation of the radial velocity, metres per second: 12 m along the track at 5.1 km.
pub(crate) const VELOCITY_DEVIATION_M_S: f64 = 0.3;

/// Standard deviation of the image place along x and y, metres.
pub(crate) const PLACE_DEVIATION_M: f64 = 1.5;

/// Half the side of the observed square, metres.
pub(crate) const HALF_M: f64 = 500.0;

/// Largest radial velocity of false alarms, metres per second.
pub(crate) const FASTEST_M_S: f64 = 25.0;

/// State `(x, y, vx, vy)` of a target at height 0.
pub(crate) type Truth = [f64; 4];

/// Random generator with the draws of a simulation.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        Uniform::new(low, high).unwrap().sample(&mut self.0)
    }

    pub(crate) fn poisson(&mut self, mean: f64) -> usize {
        Poisson::new(mean).unwrap().sample(&mut self.0) as usize
    }

    /// Target after `step_s` of white acceleration: the velocity changes by `sqrt(q T) a`, and the position by half of that times `T` and an
    /// independent `sqrt(q T^3 / 12) b`.
    pub(crate) fn moved(&mut self, truth: &mut Truth, step_s: f64, density: f64) {
        for axis in 0..2 {
            let change = (density * step_s).sqrt() * self.normal();
            let bend = (density * step_s.powi(3) / 12.0).sqrt() * self.normal();
            truth[axis] += step_s * (truth[axis + 2] + 0.5 * change) + bend;
            truth[axis + 2] += change;
        }
    }

    /// Detection of a target. An error of the radial velocity moves it along its range circle.
    pub(crate) fn detection(&mut self, truth: &Truth, sensor: [f64; 3]) -> Detection {
        let error = VELOCITY_DEVIATION_M_S * self.normal();
        let [x, y] = displaced([truth[0], truth[1]], sensor, error);
        let (x, y) = (
            x + PLACE_DEVIATION_M * self.normal(),
            y + PLACE_DEVIATION_M * self.normal(),
        );
        let at = DVec3::new(x, y, 0.0);
        detection(
            at,
            closing_m_s(truth, sensor) + error,
            lever_s(truth, sensor),
        )
    }

    /// Detections that do not come from targets: uniform in the square and in radial velocity.
    pub(crate) fn false_alarms(&mut self, mean: f64, sensor: [f64; 3]) -> Vec<Detection> {
        let count = self.poisson(mean);
        (0..count)
            .map(|_| {
                let at = [0, 1].map(|_| self.uniform(-HALF_M, HALF_M));
                let lever_s = lever_s(&[at[0], at[1], 0.0, 0.0], sensor);
                let velocity = self.uniform(-FASTEST_M_S, FASTEST_M_S);
                detection(DVec3::new(at[0], at[1], 0.0), velocity, lever_s)
            })
            .collect()
    }
}

/// Position of the same range at which a radial velocity higher by `change_m_s` places a target: the Doppler of the image place is that of the
/// target at rest plus that of its motion.
pub(crate) fn displaced([x, y]: [f64; 2], sensor: [f64; 3], change_m_s: f64) -> [f64; 2] {
    let range_m = range_m(&[x, y, 0.0, 0.0], sensor);
    let along = x - sensor[0] - range_m * change_m_s / SPEED_M_S;
    let across = (range_m * range_m - sensor[2] * sensor[2] - along * along).sqrt();
    [sensor[0] + along, sensor[1] + across]
}

/// Movement of the position per radial velocity, seconds.
fn lever_s(truth: &Truth, sensor: [f64; 3]) -> [f64; 2] {
    let along = -range_m(truth, sensor) / SPEED_M_S;
    let slope = (truth[0] - sensor[0]) / (truth[1] - sensor[1]);
    [along, -slope * along]
}

/// Detection with the covariance of the simulated errors.
pub(crate) fn detection(
    position_m: DVec3,
    radial_velocity_m_s: f64,
    lever_s: [f64; 2],
) -> Detection {
    let (place, velocity) = (PLACE_DEVIATION_M.powi(2), VELOCITY_DEVIATION_M_S.powi(2));
    let [a, b] = lever_s;
    Detection {
        position_m,
        radial_velocity_m_s,
        covariance: [
            [place + a * a * velocity, a * b * velocity, a * velocity],
            [a * b * velocity, place + b * b * velocity, b * velocity],
            [a * velocity, b * velocity, velocity],
        ],
        velocity_ambiguity_m_s: None,
    }
}

/// Detection with its velocity folded into half the ambiguity interval, and its position moved accordingly.
pub(crate) fn folded(detection: &Detection, ambiguity_m_s: f64, sensor: [f64; 3]) -> Detection {
    let folds = (detection.radial_velocity_m_s / ambiguity_m_s).round();
    let change_m_s = -folds * ambiguity_m_s;
    let at = detection.position_m;
    let [x, y] = displaced([at.x, at.y], sensor, change_m_s);
    let lever_s = lever_s(&[x, y, 0.0, 0.0], sensor);
    let velocity_m_s = detection.radial_velocity_m_s + change_m_s;
    Detection {
        velocity_ambiguity_m_s: Some(ambiguity_m_s),
        ..self::detection(DVec3::new(x, y, 0.0), velocity_m_s, lever_s)
    }
}

/// Radar at a time: at the middle of its track after 30 s.
pub(crate) fn sensor(time_s: f64) -> [f64; 3] {
    [SPEED_M_S * (time_s - 30.0), -5000.0, 1000.0]
}

/// Scan of detections at a time.
pub(crate) fn scan(time_s: f64, detections: Vec<Detection>) -> Scan {
    Scan {
        time_s,
        sensor_m: sensor(time_s).into(),
        sensor_velocity_m_s: DVec3::new(SPEED_M_S, 0.0, 0.0),
        detections,
    }
}

/// Distance of a target.
pub(crate) fn range_m(truth: &Truth, sensor: [f64; 3]) -> f64 {
    let (x, y, z) = (truth[0] - sensor[0], truth[1] - sensor[1], -sensor[2]);
    (x * x + y * y + z * z).sqrt()
}

/// Closing speed of a target: minus its velocity along the line of sight.
pub(crate) fn closing_m_s(truth: &Truth, sensor: [f64; 3]) -> f64 {
    let (x, y) = (truth[0] - sensor[0], truth[1] - sensor[1]);
    -(x * truth[2] + y * truth[3]) / range_m(truth, sensor)
}

/// `e^T A^-1 e` by elimination with pivots.
pub(crate) fn quadratic<const N: usize>(mut a: [[f64; N]; N], e: [f64; N]) -> f64 {
    let mut x = e;
    for k in 0..N {
        let pivot = (k..N)
            .max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))
            .unwrap();
        a.swap(k, pivot);
        x.swap(k, pivot);
        for i in (0..N).filter(|&i| i != k) {
            let factor = a[i][k] / a[k][k];
            let row = a[k];
            for (value, known) in a[i].iter_mut().zip(row) {
                *value -= factor * known;
            }
            x[i] -= factor * x[k];
        }
    }
    (0..N).map(|i| e[i] * x[i] / a[i][i]).sum()
}
