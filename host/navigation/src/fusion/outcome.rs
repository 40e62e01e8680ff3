//! Result and errors of a fusion.

use glam::{DQuat, DVec3};

/// Reason why there is no track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FusionError {
    /// A measurement is invalid.
    #[error("{kind} {number}, at {time_s} s, has {fault}")]
    Input {
        /// Kind of the measurement.
        kind: &'static str,
        /// Number of the measurement, from 1.
        number: usize,
        /// Time of the measurement, seconds.
        time_s: f64,
        /// Description of the invalid value.
        fault: &'static str,
    },
    /// Invalid parameter of the model.
    #[error(
        "{name} is {value}: expected a finite number up to 1e9, and a standard deviation or noise density that is not negative"
    )]
    Model {
        /// Name of the parameter.
        name: &'static str,
        /// Value of the parameter.
        value: f64,
    },
    /// No measurement of position.
    #[error(
        "no position: expected positions of a receiver or an inertial solution, as increments do not determine where the track starts"
    )]
    NoPosition,
    /// The measurements do not determine a state.
    #[error("the measurements do not determine the track{}", time_s.map(|t| format!(" at {t} s")).unwrap_or_default())]
    Undetermined {
        /// Time of that state, seconds.
        time_s: Option<f64>,
    },
    /// The least squares did not converge.
    #[error(
        "the least squares did not converge in {steps} steps: measurements contradict each other"
    )]
    NotConverged {
        /// Number of steps taken.
        steps: usize,
    },
    /// The monitor cancelled the fusion.
    #[error("cancelled")]
    Cancelled,
}

/// Source of a part of the track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// Increments of the radar.
    Radar,
    /// No increments, or outliers: bridged by other measurements.
    Bridged,
}

/// State of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Time, seconds of the radar's clock.
    pub time_s: f64,
    /// Position of the radar, metres.
    pub position_m: DVec3,
    /// Velocity of the radar, m/s.
    pub velocity_m_s: DVec3,
    /// Heading of the x axis, radians counterclockwise, unwrapped.
    pub heading_rad: f64,
    /// Attitude: x forward, y left, z up.
    pub attitude: DQuat,
    /// Covariance of x, y, z (metres) and heading (radians).
    pub covariance: [[f64; 4]; 4],
    /// Source of this part of the track.
    pub basis: Basis,
}

/// Estimated parameter with its accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Estimated value of the parameter.
    pub value: f64,
    /// Standard deviation of the estimate.
    pub sigma: f64,
    /// Standard deviation of the prior.
    pub assumed_sigma: f64,
}

impl Found {
    /// Whether the data determine the parameter: the standard deviation is at least 10 % below that of the prior.
    pub fn is_observed(&self) -> bool {
        self.sigma < 0.9 * self.assumed_sigma
    }
}

/// Measurement with little weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Kind of the measurement.
    pub of: Measured,
    /// Time, seconds of the radar's clock.
    pub time_s: f64,
    /// Weight, 0 to 1.
    pub weight: f64,
}

/// Kind of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Increments of the radar: a single outlier, or those of up to a tenth of a second.
    Increments,
    /// Position of a receiver.
    Position,
    /// Velocity of a receiver.
    Velocity,
    /// Position of the inertial solution.
    InertialPosition,
    /// Velocity of the inertial solution.
    InertialVelocity,
    /// Heading of the inertial solution.
    InertialHeading,
}

/// Positions, velocities and headings at the times of measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Plausible {
    /// Times of the radar's clock, seconds.
    pub times_s: Vec<f64>,
    /// Positions of the radar, metres.
    pub positions_m: Vec<DVec3>,
    /// Velocities of the radar, m/s.
    pub velocities_m_s: Vec<DVec3>,
    /// Headings of the x axis, radians.
    pub headings_rad: Vec<f64>,
}
