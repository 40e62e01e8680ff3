//! What comes out of a fusion, or why nothing does.

use glam::{DQuat, DVec3};

/// Why there is no track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FusionError {
    /// A measurement cannot be computed with.
    #[error("{what} {number}, at {time_s} s, has {fault}")]
    Input {
        /// Of which kind.
        what: &'static str,
        /// Which, from 1.
        number: usize,
        /// When.
        time_s: f64,
        /// What is wrong with it.
        fault: &'static str,
    },
    /// An assumption cannot be made.
    #[error(
        "{name} is {value}: it has to be a finite number, and not negative where it is a spread"
    )]
    Model {
        /// Which.
        name: &'static str,
        /// What it is.
        value: f64,
    },
    /// Nothing says where the radar is.
    #[error(
        "no position, of a receiver or an inertial solution: increments alone do not tell where they begin"
    )]
    Nowhere,
    /// The state does not follow.
    #[error("what was measured does not determine the track{}", time_s.map(|t| format!(" at {t} s")).unwrap_or_default())]
    Undetermined {
        /// Where that showed.
        time_s: Option<f64>,
    },
    /// The least squares did not come to an end.
    #[error(
        "the least squares were not settled after {steps} steps: measurements contradict each other"
    )]
    Unsettled {
        /// How many.
        steps: usize,
    },
    /// It was asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// What a part of the track rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// The radar's own increments.
    Radar,
    /// There were none, or they were not believed: bridged by the rest.
    Bridged,
}

/// A moment of the track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// When, seconds of the radar's clock.
    pub time_s: f64,
    /// Where the radar is, metres.
    pub position_m: DVec3,
    /// How fast, metres a second.
    pub velocity_m_s: DVec3,
    /// Of its x axis, radians against the clock; goes on past half a turn.
    pub heading_rad: f64,
    /// How it is turned: x forward, y left, z up.
    pub attitude: DQuat,
    /// Of x, y, z and heading.
    pub covariance: [[f64; 4]; 4],
    /// What it rests on.
    pub basis: Basis,
}

/// A number that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Most likely.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// What was assumed of that.
    pub assumed_sigma: f64,
}

impl Found {
    /// Whether the data told it at all: by a tenth better than it was known.
    pub fn told(&self) -> bool {
        self.sigma < 0.9 * self.assumed_sigma
    }
}

/// A time of one kind of measurement that was left out for being far off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Of what.
    pub of: Measured,
    /// Seconds of the radar's clock.
    pub time_s: f64,
    /// How much it counts, 0 to 1.
    pub weight: f64,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Increments of the radar: one that is far off from its neighbours, or those up to a tenth of a second together.
    Increments,
    /// A receiver's position.
    Position,
    /// A receiver's velocity.
    Velocity,
    /// An inertial position.
    InertialPosition,
    /// An inertial velocity.
    InertialVelocity,
    /// An inertial heading.
    InertialHeading,
}

/// Where, how fast and how turned at the moments of measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Plausible {
    /// Seconds.
    pub times_s: Vec<f64>,
    /// Metres.
    pub positions_m: Vec<DVec3>,
    /// Metres a second.
    pub velocities_m_s: Vec<DVec3>,
    /// Radians.
    pub headings_rad: Vec<f64>,
}
