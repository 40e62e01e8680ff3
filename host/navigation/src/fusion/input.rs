//! What is fused: increments of the radar, positions of a receiver, and an inertial solution; and what is assumed of them.

use glam::{DMat3, DVec3};

use subaperture_signal::dense::fixed::factor;

use super::{FusionError, LEAST_PIVOT};

/// How the radar moved from one moment to another, by its own measurement.
///
/// In the body's axes at `from_s`: x and y span the plane in which it measures (x along the array), and the heading is that of x, against the clock seen
/// from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// From when, seconds of the radar's clock.
    pub from_s: f64,
    /// To when.
    pub to_s: f64,
    /// How far along x and y, metres.
    pub moved_m: [f64; 2],
    /// By how much it turned, radians.
    pub turned_rad: f64,
    /// Covariance of the three: x, y, turn. Increments are taken for independent of one another.
    pub covariance: DMat3,
}

/// A position that is right on average, of a receiver of GNSS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// When, seconds of the receiver's clock.
    pub time_s: f64,
    /// Where, metres.
    pub position_m: DVec3,
    /// Standard deviation of x, y and z, metres.
    pub sigma_m: DVec3,
    /// Velocity and its standard deviation, metres a second.
    pub velocity_m_s: Option<[DVec3; 2]>,
}

/// A moment of an inertial solution, whose errors drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// When, seconds of its clock.
    pub time_s: f64,
    /// Where and its standard deviation from one moment to the next, without what drifts, metres.
    pub position_m: Option<[DVec3; 2]>,
    /// The same of the velocity, metres a second.
    pub velocity_m_s: Option<[DVec3; 2]>,
    /// The same of the heading of its x axis, radians, from the frame's x against the clock.
    pub heading_rad: Option<[f64; 2]>,
    /// Roll and pitch, radians, as tracks have them ([`subaperture_model::track::turned`]).
    pub roll_pitch_rad: [f64; 2],
}

/// All that is fused, each in the order of time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs<'a> {
    /// Of the radar.
    pub increments: &'a [Increment],
    /// Of a receiver.
    pub positions: &'a [Position],
    /// Of an inertial solution.
    pub inertial: &'a [Inertial],
}

/// A number that is assumed, and how well it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Assumed<T> {
    /// Most likely.
    pub value: T,
    /// Standard deviation; 0 of what is held.
    pub sigma: T,
}

/// What is assumed of sensors and vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// How far accelerations in the plane go, as noise of this density: metres a second by the root of a second. A vehicle that changes its velocity by
    /// 1 m/s within a second has 1.
    pub acceleration: f64,
    /// The same upwards.
    pub acceleration_up: f64,
    /// How the heading wanders where the radar does not measure it, radians by the root of a second.
    pub turning: f64,
    /// The inertial solution's constant error at first, metres, and how it wanders besides what its velocity's error makes of it, metres by the root of a second.
    pub inertial_position: [f64; 2],
    /// The same of its velocity, metres a second, and by the root of a second.
    pub inertial_velocity: [f64; 2],
    /// How its heading's error wanders, radians by the root of a second. What is constant is `squint`.
    pub inertial_heading: f64,
    /// Increments that are off their neighbours by more standard deviations are left out; none where all are to be believed.
    pub doubted: Option<f64>,
    /// By which share the radar's x may be too long, standard deviation; 0 if it is right.
    pub scale: f64,
    /// Seconds after which that is another.
    pub scale_time_s: f64,
    /// By how much the receiver's clock is ahead of the radar's, seconds.
    pub receiver_clock_s: Assumed<f64>,
    /// By how much the inertial solution's clock is ahead of the radar's, seconds.
    pub inertial_clock_s: Assumed<f64>,
    /// From the inertial solution's x axis to the radar's, radians against the clock.
    pub squint_rad: Assumed<f64>,
    /// From the radar to the receiver's antenna, along the radar's axes, metres.
    pub receiver_arm_m: Assumed<DVec3>,
    /// From the radar to the place of the inertial solution.
    pub inertial_arm_m: Assumed<DVec3>,
}

impl Default for Model {
    /// A vehicle on the ground with all sensors in one place and on one clock.
    fn default() -> Self {
        Self {
            acceleration: 1.0,
            acceleration_up: 0.1,
            turning: 0.2,
            inertial_position: [10.0, 1e-3],
            inertial_velocity: [0.1, 1e-3],
            inertial_heading: 1e-4,
            doubted: Some(8.0),
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

/// Largest number that is sensible of anything: beyond, squares of what is assumed are none.
const LARGEST: f64 = 1e9;

fn sound(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// Refuses measurements of a kind, each with its time and whether all else of it can be computed with, that cannot be or that go back in time.
fn in_order(what: &'static str, all: impl Iterator<Item = (f64, bool)>) -> Result<(), FusionError> {
    let mut before_s = f64::NEG_INFINITY;
    for (n, (time_s, whole)) in all.enumerate() {
        let fault = match () {
            () if !(whole && sound(time_s)) => {
                "numbers that are not finite, or standard deviations that are not positive"
            }
            () if time_s <= before_s => "a time that is not after the one before",
            () => {
                before_s = time_s;
                continue;
            }
        };
        return Err(FusionError::Input {
            what,
            number: n + 1,
            time_s,
            fault,
        });
    }
    Ok(())
}

impl Inputs<'_> {
    /// Refuses what cannot be computed with.
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
            let even = (0..9).all(|k| {
                let (a, b) = (matrix[k / 3][k % 3], matrix[k % 3][k / 3]);
                (a - b).abs() <= 1e-9 * (matrix[k / 3][k / 3] * matrix[k % 3][k % 3]).abs().sqrt()
            });
            let what = match () {
                () if !numbers.into_iter().all(sound) => "numbers that are not finite",
                () if one.to_s <= one.from_s => "an end that is not after its beginning",
                () if n > 0 && one.from_s < self.increments[n - 1].to_s - 1e-9 => {
                    "a beginning before the end of the one before"
                }
                () if !even || factor(&matrix, LEAST_PIVOT).is_none() => {
                    "a covariance that is none: it has to be symmetric and positive definite"
                }
                () => continue,
            };
            return Err(FusionError::Input {
                what: "increment",
                number: n + 1,
                time_s: one.from_s,
                fault: what,
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
        in_order("inertial moment", self.inertial.iter().map(inertial))?;
        let placed = self.inertial.iter().any(|one| one.position_m.is_some());
        match self.positions.is_empty() && !placed {
            true => Err(FusionError::Nowhere),
            false => Ok(()),
        }
    }
}

impl Model {
    /// Refuses what cannot be assumed.
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
            ("doubted", self.doubted.unwrap_or(1.0)),
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
