//! Extended Kalman filter of nearly constant velocity.

use glam::DVec3;
use subaperture_signal::dense::fixed::{
    Matrix, backward, factor, forward, plus, times, transposed, zero,
};

use super::fold::Measurement;
use super::plane::Plane;
use super::scan::{Detection, Scan};

/// Standard deviations of the predicted radial velocity within which folds are tried.
const DEVIATIONS: f64 = 4.0;

/// Largest number of folds tried on each side of the nearest velocity.
const MAX_SPAN: f64 = 8.0;

/// Mean and covariance of `(x, y, vx, vy)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    /// Metres and metres per second.
    pub(super) mean: [f64; 4],
    /// Covariance matrix, m^2, m * m/s and (m/s)^2.
    pub(super) covariance: Matrix<4, 4>,
}

/// Predicted state with its predicted measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prediction {
    state: State,
    measurement: [f64; 3],
    jacobian: Matrix<3, 4>,
    /// Covariance of the predicted measurement, `H P H^T`.
    spread: Matrix<3, 3>,
    /// Variance of the radial velocity's terms of second order, (m/s)^2.
    curvature: f64,
}

/// Difference of a detection and a predicted measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Innovation {
    residual: [f64; 3],
    /// Covariance of the measurement and of terms of second order.
    noise: Matrix<3, 3>,
    /// Cholesky factor of `S`.
    lower: Matrix<3, 3>,
    /// Mahalanobis distance squared, `d^2`.
    pub(super) distance: f64,
    /// Logarithm of the determinant of `S`.
    log_determinant: f64,
}

impl Innovation {
    /// `d^2 + ln det S`.
    pub(super) fn cost(&self) -> f64 {
        self.distance + self.log_determinant
    }
}

impl State {
    /// State of a measurement, with a prior standard deviation of the tangential speed. `None` without a radial velocity in the plane.
    pub(super) fn start(
        plane: &Plane,
        sensor_m: DVec3,
        measured: &Measurement,
        tangential_m_s: f64,
    ) -> Option<Self> {
        let [x, y, radial] = measured.z;
        let (_, at_rest) = plane.measure(sensor_m, [x, y, 0.0, 0.0])?;
        let [_, _, hx, hy] = at_rest[2];
        let level = libm::hypot(hx, hy);
        let towards = [hx / level, hy / level];
        let mean = [
            x,
            y,
            radial / level * towards[0],
            radial / level * towards[1],
        ];
        let (_, jacobian) = plane.measure(sensor_m, mean)?;
        // Errors of (x, y, v_r) change the velocity along the line of sight so that H times the state's error is theirs.
        let speed = [-jacobian[2][0], -jacobian[2][1], 1.0].map(|slope| slope / level);
        let inverse = [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            speed.map(|slope| slope * towards[0]),
            speed.map(|slope| slope * towards[1]),
        ];
        let known = times(
            &times(&inverse, &measured.covariance),
            &transposed(&inverse),
        );
        let across = [-towards[1], towards[0]];
        // The error of the position turns the tangential direction: the product of both errors is a radial velocity.
        let foot = plane.coordinates_m(sensor_m);
        let ground_m = libm::hypot(x - foot[0], y - foot[1]);
        let [[xx, xy, _], [_, yy, _], _] = measured.covariance;
        let [a, b] = across;
        let turn = (a * a * xx + 2.0 * a * b * xy + b * b * yy).sqrt() / ground_m;
        let row =
            |[a, b]: [f64; 2], deviation_m_s: f64| [0.0, 0.0, a * deviation_m_s, b * deviation_m_s];
        let prior = [
            row(across, tangential_m_s),
            row(towards, tangential_m_s * turn),
        ];
        let covariance = plus(&known, &times(&transposed(&prior), &prior));
        let finite = mean.iter().chain(covariance.as_flattened());
        finite
            .into_iter()
            .all(|value| value.is_finite())
            .then_some(Self { mean, covariance })
    }

    /// State after `interval_s` of white acceleration of this spectral density.
    pub(super) fn predicted(&self, interval_s: f64, density_m2_s3: f64) -> Self {
        let [x, y, vx, vy] = self.mean;
        let mut motion: Matrix<4, 4> = zero();
        let mut noise: Matrix<4, 4> = zero();
        for (i, row) in motion.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        for i in 0..2 {
            motion[i][i + 2] = interval_s;
            noise[i][i] = density_m2_s3 * interval_s * interval_s * interval_s / 3.0;
            noise[i][i + 2] = density_m2_s3 * interval_s * interval_s / 2.0;
            noise[i + 2][i] = noise[i][i + 2];
            noise[i + 2][i + 2] = density_m2_s3 * interval_s;
        }
        let moved = times(&times(&motion, &self.covariance), &transposed(&motion));
        Self {
            mean: [x + interval_s * vx, y + interval_s * vy, vx, vy],
            covariance: plus(&moved, &noise),
        }
    }
}

impl Prediction {
    /// Prediction of a scan from a radar at `sensor_m`. `None` without a radial velocity in the plane.
    pub(super) fn new(state: State, plane: &Plane, sensor_m: DVec3) -> Option<Self> {
        let (mut measurement, jacobian) = plane.measure(sensor_m, state.mean)?;
        let [x, y, ..] = state.mean;
        let mixed = plane.curvature(sensor_m, [x, y]);
        let mut hessian: Matrix<4, 4> = zero();
        for i in 0..2 {
            for j in 0..2 {
                hessian[i][j + 2] = mixed[i][j];
                hessian[j + 2][i] = mixed[i][j];
            }
        }
        let curved = times(&hessian, &state.covariance);
        measurement[2] += 0.5 * trace(&curved);
        let curvature = 0.5 * trace(&times(&curved, &curved));
        let spread = times(&times(&jacobian, &state.covariance), &transposed(&jacobian));
        Some(Self {
            state,
            measurement,
            jacobian,
            spread,
            curvature,
        })
    }

    /// Innovation of a detection at the fold of least `d^2 + ln det S`. `None` if no fold has a positive definite `S`.
    pub(super) fn innovation(
        &self,
        plane: &Plane,
        scan: &Scan,
        detection: &Detection,
    ) -> Option<Innovation> {
        let at = |folds: f64| self.difference(&Measurement::new(plane, scan, detection, folds)?);
        let Some(interval_m_s) = detection.velocity_ambiguity_m_s else {
            return at(0.0);
        };
        let velocity_m_s = detection.radial_velocity_m_s;
        let nearest = ((self.measurement[2] - velocity_m_s) / interval_m_s).round();
        let deviation_m_s = (self.spread[2][2] + detection.covariance[2][2]).sqrt();
        let span = (DEVIATIONS * deviation_m_s / interval_m_s).ceil();
        let span = span.min(MAX_SPAN) as i32;
        (-span..=span)
            .filter_map(|k| at(nearest + f64::from(k)))
            .min_by(|a, b| a.cost().total_cmp(&b.cost()))
    }

    fn difference(&self, measured: &Measurement) -> Option<Innovation> {
        let residual = std::array::from_fn(|i| measured.z[i] - self.measurement[i]);
        let mut noise = measured.covariance;
        noise[2][2] += self.curvature;
        let lower = factor(&plus(&self.spread, &noise), 0.0)?;
        let mut white = residual.map(|value| [value]);
        forward(&lower, &mut white);
        Some(Innovation {
            residual,
            noise,
            lower,
            distance: white.iter().map(|[value]| value * value).sum(),
            log_determinant: (0..3).map(|i| 2.0 * lower[i][i].ln()).sum(),
        })
    }

    /// State after the measurement, in Joseph's form.
    pub(super) fn updated(&self, innovation: &Innovation) -> State {
        // S^-1 H P, the transpose of the gain.
        let mut solved = times(&self.jacobian, &self.state.covariance);
        forward(&innovation.lower, &mut solved);
        backward(&innovation.lower, &mut solved);
        let gain = transposed(&solved);
        let mut mean = self.state.mean;
        for (value, gains) in mean.iter_mut().zip(&gain) {
            *value += dot(gains, &innovation.residual);
        }
        let mut rest = times(&gain, &self.jacobian).map(|row| row.map(|value| -value));
        for (i, row) in rest.iter_mut().enumerate() {
            row[i] += 1.0;
        }
        let kept = times(&times(&rest, &self.state.covariance), &transposed(&rest));
        let added = times(&times(&gain, &innovation.noise), &solved);
        let covariance = plus(&kept, &added);
        // Rounding leaves small asymmetries.
        let mirrored = transposed(&covariance);
        State {
            mean,
            covariance: plus(&covariance, &mirrored).map(|row| row.map(|value| 0.5 * value)),
        }
    }
}

fn trace(matrix: &Matrix<4, 4>) -> f64 {
    (0..4).map(|i| matrix[i][i]).sum()
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
