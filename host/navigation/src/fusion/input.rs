//! Input of the fusion: increments of the radar, positions of a receiver, an inertial solution, and the model.

use glam::{DMat3, DVec3};

use subaperture_signal::dense::fixed::factor;

use super::{FusionError, MIN_PIVOT};

/// Motion of the radar between two times, by its own measurement.
///
/// In the body's axes at `from_s`: x (along the array) and y span the plane of measurement, and the heading is that of x, counterclockwise from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// Start, seconds of the radar's clock.
    pub from_s: f64,
    /// End, seconds of the radar's clock.
    pub to_s: f64,
    /// Motion along x and y, metres.
    pub moved_m: [f64; 2],
    /// Change of heading, radians.
    pub turned_rad: f64,
    /// Covariance of x, y and turn. Increments are assumed to be independent.
    pub covariance: DMat3,
}

/// Unbiased position of a GNSS receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Time, seconds of the receiver's clock.
    pub time_s: f64,
    /// Position of the receiver's antenna, metres.
    pub position_m: DVec3,
    /// Standard deviations of x, y and z, metres.
    pub sigma_m: DVec3,
    /// Velocity with standard deviations, m/s.
    pub velocity_m_s: Option<[DVec3; 2]>,
}

/// State of an inertial solution, whose errors drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Time, seconds of its clock.
    pub time_s: f64,
    /// Position with standard deviations from one state to the next, without drift, metres.
    pub position_m: Option<[DVec3; 2]>,
    /// Velocity with the same standard deviations, m/s.
    pub velocity_m_s: Option<[DVec3; 2]>,
    /// Heading of its x axis with the same standard deviation, radians, counterclockwise from the frame's x.
    pub heading_rad: Option<[f64; 2]>,
    /// Roll and pitch, radians ([`subaperture_model::track::turned`]).
    pub roll_pitch_rad: [f64; 2],
}

/// All measurements, each kind in the order of time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs<'a> {
    /// Increments of the radar.
    pub increments: &'a [Increment],
    /// Positions of a receiver.
    pub positions: &'a [Position],
    /// States of an inertial solution.
    pub inertial: &'a [Inertial],
}

/// Parameter with its prior.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Assumed<T> {
    /// Mean of the prior.
    pub value: T,
    /// Prior standard deviation; 0 holds the parameter.
    pub sigma: T,
}

/// Model of sensors and vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Density of horizontal acceleration noise, m/s a root second: a vehicle that changes its velocity by 1 m/s within a second has 1.
    pub acceleration: f64,
    /// Density of vertical acceleration noise, m/s a root second.
    pub acceleration_up: f64,
    /// Random walk of the heading where the radar does not measure it, radians a root second.
    pub turning: f64,
    /// Initial position error of the inertial solution, metres, and its random walk beyond that of its velocity error, metres a root second.
    pub inertial_position: [f64; 2],
    /// Initial velocity error of the inertial solution, m/s, and its random walk, m/s a root second.
    pub inertial_velocity: [f64; 2],
    /// Random walk of its heading error, radians a root second. The constant part is `squint`.
    pub inertial_heading: f64,
    /// Standard deviations from its neighbours beyond which an increment is an outlier; `None` accepts all.
    pub outlier_sigmas: Option<f64>,
    /// Standard deviation of the relative scale error of the radar's x; 0 for none.
    pub scale: f64,
    /// Correlation time of the scale error, seconds.
    pub scale_time_s: f64,
    /// Advance of the receiver's clock over the radar's, seconds.
    pub receiver_clock_s: Assumed<f64>,
    /// Advance of the inertial clock over the radar's, seconds.
    pub inertial_clock_s: Assumed<f64>,
    /// Angle from the inertial x axis to the radar's, radians, counterclockwise.
    pub squint_rad: Assumed<f64>,
    /// Lever arm from the radar to the receiver's antenna, along the radar's axes, metres.
    pub receiver_arm_m: Assumed<DVec3>,
    /// Lever arm from the radar to the reference point of the inertial solution, metres.
    pub inertial_arm_m: Assumed<DVec3>,
}

impl Default for Model {
    /// Ground vehicle with all sensors in one place and on one clock.
    fn default() -> Self {
        Self {
            acceleration: 1.0,
            acceleration_up: 0.1,
            turning: 0.2,
            inertial_position: [10.0, 1e-3],
            inertial_velocity: [0.1, 1e-3],
            inertial_heading: 1e-4,
            outlier_sigmas: Some(8.0),
            scale: 0.005,
            scale_time_s: 30.0,
            receiver_clock_s: Assumed::default(),
            inertial_clock_s: Assumed::default(),
            squint_rad: Assumed {
                value: 0.0,
                sigma: 0.05,
            },
            receiver_arm_m: Assumed::default(),
            inertial_arm_m: Assumed::default(),
        }
    }
}

/// Largest sensible value of any quantity: squares of larger ones overflow models.
const LARGEST: f64 = 1e9;

fn sound(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// Refuse measurements of a kind that are not finite or whose times descend.
fn in_order(kind: &'static str, all: impl Iterator<Item = (f64, bool)>) -> Result<(), FusionError> {
    let mut before_s = f64::NEG_INFINITY;
    for (n, (time_s, whole)) in all.enumerate() {
        let fault = match () {
            () if !(whole && sound(time_s)) => {
                "numbers that are not finite, or standard deviations that are not positive"
            }
            () if time_s <= before_s => "a time that is not later than the previous one",
            () => {
                before_s = time_s;
                continue;
            }
        };
        return Err(FusionError::Input {
            kind,
            number: n + 1,
            time_s,
            fault,
        });
    }
    Ok(())
}

impl Inputs<'_> {
    /// Refuse measurements that are not usable.
    pub(super) fn check(&self) -> Result<(), FusionError> {
        let vector = |v: DVec3| v.to_array().into_iter().all(sound);
        let spread = |v: DVec3| v.to_array().into_iter().all(|s| s > 0.0 && sound(s));
        let pair = |v: &Option<[DVec3; 2]>| v.is_none_or(|[v, s]| vector(v) && spread(s));
        for (n, one) in self.increments.iter().enumerate() {
            let matrix = one.covariance.to_cols_array_2d();
            let numbers = [
                one.from_s,
                one.to_s,
                one.turned_rad,
                one.moved_m[0],
                one.moved_m[1],
            ];
            let symmetric = (0..9).all(|k| {
                let (a, b) = (matrix[k / 3][k % 3], matrix[k % 3][k / 3]);
                (a - b).abs() <= 1e-9 * (matrix[k / 3][k / 3] * matrix[k % 3][k % 3]).abs().sqrt()
            });
            let fault = match () {
                () if !numbers.into_iter().all(sound) => "numbers that are not finite",
                () if one.to_s <= one.from_s => "an end that is not later than its start",
                () if n > 0 && one.from_s < self.increments[n - 1].to_s - 1e-9 => {
                    "a start before the end of the previous increment"
                }
                () if !symmetric || factor(&matrix, MIN_PIVOT).is_none() => {
                    "a covariance that is not symmetric and positive definite"
                }
                () => continue,
            };
            return Err(FusionError::Input {
                kind: "increment",
                number: n + 1,
                time_s: one.from_s,
                fault,
            });
        }
        let position = |one: &Position| {
            let whole = vector(one.position_m) && spread(one.sigma_m) && pair(&one.velocity_m_s);
            (one.time_s, whole)
        };
        in_order("position", self.positions.iter().map(position))?;
        let inertial = |one: &Inertial| {
            let heading = one.heading_rad;
            let whole = pair(&one.position_m)
                && pair(&one.velocity_m_s)
                && heading.is_none_or(|[h, s]| sound(h) && s > 0.0 && sound(s))
                && one.roll_pitch_rad.into_iter().all(sound);
            (one.time_s, whole)
        };
        in_order("inertial state", self.inertial.iter().map(inertial))?;
        let placed = self.inertial.iter().any(|one| one.position_m.is_some());
        match self.positions.is_empty() && !placed {
            true => Err(FusionError::NoPosition),
            false => Ok(()),
        }
    }
}

impl Model {
    /// Refuse an invalid model.
    pub(super) fn check(&self) -> Result<(), FusionError> {
        let positive = [
            ("acceleration", self.acceleration),
            ("acceleration_up", self.acceleration_up),
            ("turning", self.turning),
            ("inertial_position", self.inertial_position[0]),
            ("inertial_position", self.inertial_position[1]),
            ("inertial_velocity", self.inertial_velocity[0]),
            ("inertial_velocity", self.inertial_velocity[1]),
            ("inertial_heading", self.inertial_heading),
            ("outlier_sigmas", self.outlier_sigmas.unwrap_or(1.0)),
            ("scale_time_s", self.scale_time_s),
        ];
        let wrong = |&(_, value): &(&str, f64)| !(value > 0.0 && value <= LARGEST);
        if let Some(&(name, value)) = positive.iter().find(|one| wrong(one)) {
            return Err(FusionError::Model { name, value });
        }
        let known = [
            ("scale", 0.0, self.scale),
            (
                "receiver_clock_s",
                self.receiver_clock_s.value,
                self.receiver_clock_s.sigma,
            ),
            (
                "inertial_clock_s",
                self.inertial_clock_s.value,
                self.inertial_clock_s.sigma,
            ),
            ("squint_rad", self.squint_rad.value, self.squint_rad.sigma),
        ];
        let arms = [
            ("receiver_arm_m", self.receiver_arm_m),
            ("inertial_arm_m", self.inertial_arm_m),
        ];
        let parts = arms.iter().flat_map(|(name, arm)| {
            let pairs = arm.value.to_array().into_iter().zip(arm.sigma.to_array());
            pairs.map(|(value, sigma)| (*name, value, sigma))
        });
        for (name, value, sigma) in known.into_iter().chain(parts) {
            if !(value.abs() <= LARGEST && (0.0..=LARGEST).contains(&sigma)) {
                let value = if value.abs() <= LARGEST { sigma } else { value };
                return Err(FusionError::Model { name, value });
            }
        }
        Ok(())
    }
}
