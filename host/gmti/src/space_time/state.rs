//! Parameters of a target's motion, their steps, and the motion that they describe.

use glam::DVec3;
use subaperture_model::geometry::Axis;

use super::cube::OVERSAMPLING;
use super::geometry::{Motion, Place};
use super::maps::SpaceTime;
use crate::motion::axes;

/// Corrections of Doppler, curvature and radial velocity per resolution cell.
pub(super) const FINE: f64 = 3.0;

/// Secant steps of the cross-range velocity of a curvature.
const SECANT_STEPS: usize = 4;

/// Margin of places beyond the grid, as a fraction of its extent.
const MARGIN: f64 = 0.05;

/// Parameters of a motion that are observed separately.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// Relative path at the epoch, metres.
    pub(super) path_m: f64,
    /// Slope of the path at the epoch, metres per metre of track.
    pub(super) slope: f64,
    pub(super) radial_m_s: f64,
    /// Horizontal velocity across the line of sight. Above the largest speed it stands for an acceleration along the line of sight of the same path curvature.
    pub(super) cross_m_s: f64,
}

impl State {
    pub(super) fn moved(&self, parameter: usize, by: f64) -> Self {
        let mut values = self.values();
        values[parameter] += by;
        Self::from_values(values)
    }

    fn values(&self) -> [f64; 4] {
        [self.path_m, self.slope, self.radial_m_s, self.cross_m_s]
    }

    fn from_values([path_m, slope, radial_m_s, cross_m_s]: [f64; 4]) -> Self {
        Self {
            path_m,
            slope,
            radial_m_s,
            cross_m_s,
        }
    }
}

impl SpaceTime {
    /// Resolution in slope of the aperture.
    pub(super) fn fine_slope(&self) -> f64 {
        self.wavelength_m() / self.section_m()
    }

    /// Step of the curvature in the coherent sum.
    pub(super) fn fine_curvature(&self) -> f64 {
        4.0 * self.fine_slope() / self.section_m() / FINE
    }

    /// Length of the aperture, metres.
    pub(super) fn section_m(&self) -> f64 {
        let (first, last) = (
            &self.cube.sub_cpis[0],
            &self.cube.sub_cpis[self.cube.sub_cpis.len() - 1],
        );
        last.section_m[1] - first.section_m[0]
    }

    /// Radial velocity that changes the phase between the channels farthest apart by half a cycle, metres per second.
    pub(super) fn velocity_cell_m_s(&self) -> f64 {
        self.wavelength_m() / (4.0 * self.lag_spread_s)
    }

    /// Curvatures of targets from the largest speed along the track to the largest against it, and of the largest acceleration along the line of sight.
    pub(super) fn curvature_limits(&self) -> [f64; 2] {
        let range_m = self.centre_m.distance(self.middle.antenna_m());
        let part = (self.settings.max_speed_m_s / self.speed_m_s).min(1.0);
        let of = |part: f64| 2.0 / range_m * ((1.0 - part) * (1.0 - part) - 1.0);
        let bent = 2.0 * self.settings.max_acceleration_m_s2 / self.speed_m_s.powi(2);
        [of(part).min(-bent), of(-part).max(bent)]
    }

    /// Acceleration along the line of sight with the path curvature of a cross-range velocity, per unit of it, 1 / s.
    fn acceleration_rate(&self) -> f64 {
        2.0 * self.speed_m_s / self.centre_m.distance(self.middle.antenna_m())
    }

    /// Whether a state has an acceleration in place of a cross-range velocity.
    pub(super) fn accelerates(&self, state: &State) -> bool {
        state.cross_m_s.abs() > self.settings.max_speed_m_s
    }

    /// Largest magnitude of the cross-range velocity of a state.
    pub(super) fn max_cross_m_s(&self) -> f64 {
        let accelerated_m_s = self.settings.max_acceleration_m_s2 / self.acceleration_rate();
        self.settings.max_speed_m_s.max(accelerated_m_s)
    }

    /// Along-track position of a sub-CPI relative to the middle, metres.
    pub(super) fn offset_m(&self, sub_cpi: usize) -> f64 {
        self.cube.sub_cpis[sub_cpi].along_m() - self.middle.along_m()
    }

    /// Motion of a state. `None` where no place of the plane has it.
    pub(super) fn motion(&self, state: &State) -> Option<Motion> {
        let slope = state.slope + 2.0 * state.radial_m_s / self.speed_m_s;
        let plane = [self.grid.x_axis, self.grid.y_axis];
        let position_m = self
            .middle
            .locate(self.centre_m, plane, state.path_m, slope)?;
        let sight = position_m - self.middle.antenna_m();
        let [x_axis, y_axis] = axes(sight, self.along)?;
        let level = y_axis.dot(sight.normalize_or_zero());
        let (cross_m_s, away_m_s2) = match self.accelerates(state) {
            true => (0.0, -state.cross_m_s * self.acceleration_rate()),
            false => (state.cross_m_s, 0.0),
        };
        Some(Motion {
            epoch_s: self.middle.time_s(),
            position_m,
            velocity_m_s: x_axis * cross_m_s - y_axis * (state.radial_m_s / level),
            acceleration_m_s2: y_axis * (away_m_s2 / level),
        })
    }

    /// Whether a place lies within the grid.
    pub(super) fn contains(&self, position_m: DVec3) -> bool {
        let [row, column] = self.grid.coordinates(position_m);
        let within = |axis: &Axis, value: f64| {
            let (a, b) = (axis.at(0), axis.at(axis.count - 1));
            let margin = MARGIN * (b - a).abs();
            (a.min(b) - margin..=a.max(b) + margin).contains(&value)
        };
        within(&self.grid.rows, row) && within(&self.grid.columns, column)
    }

    /// Cross-range velocity of a state whose path has this curvature.
    pub(super) fn with_curvature(&self, state: &State, curvature: f64) -> Option<State> {
        const STEP_M_S: f64 = 10.0;
        let of = |cross_m_s: f64| {
            let motion = self.motion(&State {
                cross_m_s,
                ..*state
            })?;
            let [first, last] = [0, self.cube.sub_cpis.len() - 1].map(|sub_cpi| {
                let mut place = Place::default();
                self.cube.sub_cpis[sub_cpi].place(|time_s| motion.at(time_s), &mut place);
                place.slope
            });
            let apart_m = self.offset_m(self.cube.sub_cpis.len() - 1) - self.offset_m(0);
            Some((last - first) / apart_m)
        };
        // The curvature is a quadratic function of the velocity: few secant steps suffice.
        let (mut last, mut cross_m_s) = ((0.0, of(0.0)?), STEP_M_S);
        for _ in 0..SECANT_STEPS {
            let own = (cross_m_s, of(cross_m_s)?);
            if own.1 == last.1 {
                break;
            }
            let slope = (own.0 - last.0) / (own.1 - last.1);
            cross_m_s = own.0 + (curvature - own.1) * slope;
            last = own;
        }
        Some(State {
            cross_m_s,
            ..*state
        })
    }

    /// Steps of each parameter of a state that change the statistic by some tenths.
    pub(super) fn steps(&self) -> [f64; 4] {
        // An acceleration `a` has the curvature `2 a / V^2`.
        let cross_m_s =
            self.fine_curvature() * self.speed_m_s.powi(2) / (2.0 * self.acceleration_rate());
        [
            self.cube.axes.path_step_m * OVERSAMPLING as f64 / FINE,
            self.fine_slope() / FINE,
            self.velocity_cell_m_s() / FINE,
            cross_m_s,
        ]
    }

    /// Whether two states are in the same resolution cell of path and slope.
    pub(super) fn near(&self, a: &State, b: &State) -> bool {
        let [path_m, slope, ..] = self.steps();
        (a.path_m - b.path_m).abs() < FINE * path_m && (a.slope - b.slope).abs() < FINE * slope
    }
}
