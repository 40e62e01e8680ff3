//! Maximum of the coherent statistic over the parameters of a motion, and its covariance.

use glam::DVec3;
use subaperture_signal::dense::Factor;

use super::clean::Echo;
use super::cube::OVERSAMPLING;
use super::geometry::{Motion, Place};
use super::maps::{Local, SpaceTime};
use super::state::State;
use super::statistic::{Integrated, Snapshot};
use crate::motion::axes;

/// Smallest step of a single parameter, relative to a fine step.
const LEAST_STEP: f64 = 1.0 / 16.0;

/// Distances from a target at which the clutter is measured: range cells, and resolutions of the aperture in Doppler.
const LEVEL_CELLS: [f64; 6] = [1.5, 3.0, 4.5, 6.0, 7.5, 9.0];
const LEVEL_SLOPES: [f64; 3] = [-2.0, 0.0, 2.0];

/// Fewest neighbouring places that measure the errors of a target.
const LEAST_NEIGHBOURS: f64 = 12.0;

/// Largest number of steps of Newton's method.
const NEWTON_STEPS: usize = 12;

/// Smallest gain of a target, relative to that in noise alone.
const LEAST_GAIN: f64 = 5e-3;

/// Moving target detected by integration over sub-CPIs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Mover {
    /// Motion about the middle of the aperture.
    pub motion: Motion,
    /// Scene position at which the target appears in an image of stationary scatterers, metres. `None` where no point of the plane has its path and Doppler.
    pub image_position_m: Option<DVec3>,
    /// Velocity along the line of sight at the epoch, metres per second, positive when approaching.
    pub radial_velocity_m_s: f64,
    /// Horizontal velocity across the line of sight, metres per second, positive in the direction of the radar's motion.
    pub cross_range_velocity_m_s: f64,
    /// Covariance of position along x and y of the grid, metres, and velocity along x and y, metres per second.
    pub covariance: [[f64; 4]; 4],
    /// Standard deviations of radial and cross-range velocity, metres per second.
    pub velocity_deviations_m_s: [f64; 2],
    /// Statistic of the motion.
    pub integrated: Integrated,
    /// Radar cross-section, m^2, estimated.
    pub cross_section_m2: f64,
}

/// Derivatives of the statistic in `steps` of the parameters of a state.
struct Curve {
    steps: [f64; 4],
    slope: [f64; 4],
    /// Negative second derivatives: the statistic is the log-likelihood.
    information: [[f64; 4]; 4],
}

impl Curve {
    /// Factor of the information with `damping` times its diagonal added. `None` if it is not positive definite.
    fn factor(&self, damping: f64) -> Option<Factor> {
        let mut damped = self.information;
        for (i, row) in damped.iter_mut().enumerate() {
            row[i] += damping * row[i].abs();
        }
        Factor::new(4, &damped.concat(), 1e-12)
    }

    /// Step to the maximum (Levenberg and Marquardt), in units of the parameters.
    fn step(&self, damping: f64) -> Option<[f64; 4]> {
        let mut step = self.slope;
        self.factor(damping)?.solve(&mut step);
        Some([0, 1, 2, 3].map(|i| step[i] * self.steps[i]))
    }
}

impl SpaceTime {
    /// Statistic of a state. `None` beyond the largest speed, at places that are not on the side of the grid's edge stated by `local`, and at blind velocities, where the amplitude of a target is unknown.
    fn statistic(&self, state: &State, local: &Local) -> Option<Integrated> {
        let most = self.settings.max_speed_m_s;
        let slow = state.radial_m_s.abs() <= most && state.cross_m_s.abs() <= self.max_cross_m_s();
        let motion = slow.then(|| self.motion(state))??;
        if self.contains(motion.position_m) != local.inside {
            return None;
        }
        let integrated = self.integrate_with(&motion, local);
        (integrated.gain > LEAST_GAIN * self.full_gain).then_some(integrated)
    }

    /// Maximum of the coherent statistic near a state, with `echo` added to the samples: by steps of single parameters, then by Newton's method. `None` where it lies at a limit of the search.
    pub(super) fn maximised(
        &self,
        state: State,
        echo: Option<&Echo>,
    ) -> Option<(State, Integrated)> {
        let local = self.local(&state, echo)?;
        let mut best = (state, self.statistic(&state, &local)?);
        let steps = self.steps();
        let mut scale = 0.5;
        while scale > LEAST_STEP {
            let before = best.1.coherent;
            for (parameter, step) in steps.iter().enumerate() {
                for by in [-scale * step, scale * step] {
                    let state = best.0.moved(parameter, by);
                    if let Some(there) = self.statistic(&state, &local)
                        && there.coherent > best.1.coherent
                    {
                        best = (state, there);
                    }
                }
            }
            if best.1.coherent <= before * (1.0 + 1e-2) {
                scale /= 2.0;
            }
        }
        let local = self.local(&best.0, echo)?;
        best.1 = self.statistic(&best.0, &local)?;
        let mut damping = 0.0;
        for _ in 0..NEWTON_STEPS {
            let Some(curve) = self.curve(&best.0, &local) else {
                break;
            };
            let improved = curve.step(damping).and_then(|step| {
                let state = (0..4).fold(best.0, |state, i| state.moved(i, step[i]));
                let there = self.statistic(&state, &local)?;
                (there.coherent > best.1.coherent).then_some((state, there))
            });
            match improved {
                Some((state, there)) => {
                    let settled = there.coherent - best.1.coherent < 0.01;
                    best = (state, there);
                    damping /= 10.0;
                    if settled {
                        break;
                    }
                }
                None if damping > 10.0 => break,
                None => damping = 10.0 * f64::max(damping, 1e-3),
            }
        }
        self.is_interior(&best, &local).then_some(best)
    }

    /// Whether the statistic does not rise beyond the grid or the largest speed. Where it does, the target is elsewhere.
    fn is_interior(&self, (state, integrated): &(State, Integrated), local: &Local) -> bool {
        let steps = self.steps();
        let moves = (0..4).flat_map(|i| [-0.5, 0.5].map(|part| (i, part * steps[i])));
        let rises = |(parameter, by): (usize, f64)| {
            let moved = state.moved(parameter, by);
            let outside = self.statistic(&moved, local).is_none();
            let there = outside.then(|| self.motion(&moved)).flatten();
            there.is_some_and(|motion| {
                self.integrate_with(&motion, local).coherent > integrated.coherent
            })
        };
        !moves.into_iter().any(rises)
    }

    /// Tiles about a state, and an echo that is added to the samples.
    fn local<'a>(&'a self, state: &State, echo: Option<&'a Echo>) -> Option<Local<'a>> {
        let motion = self.motion(state)?;
        let mut place = Place::default();
        let tile = |sub_cpi: usize| {
            self.cube.sub_cpis[sub_cpi].place(|time_s| motion.at(time_s), &mut place);
            Snapshot::tile(&self.cube, &self.tiles, sub_cpi, &place)
        };
        let tiles = (0..self.cube.sub_cpis.len()).map(tile).collect();
        Some(Local {
            tiles,
            echo,
            inside: self.contains(motion.position_m),
        })
    }

    /// First and second derivatives of the coherent statistic at a state. `None` where a nearby state has no place.
    fn curve(&self, state: &State, local: &Local) -> Option<Curve> {
        let centre = self.integrate_with(&self.motion(state)?, local).coherent;
        // Steps that change the statistic by about one, so that terms of higher order are small.
        let scale = (0.25 * (100.0 / centre).sqrt()).clamp(0.02, 0.25);
        let steps = self.steps().map(|step| step * scale);
        let at = |moves: &[(usize, f64)]| {
            let moved = moves
                .iter()
                .fold(*state, |state, &(i, by)| state.moved(i, by * steps[i]));
            Some(self.integrate_with(&self.motion(&moved)?, local).coherent)
        };
        let mut slope = [0.0; 4];
        let mut information = [[0.0; 4]; 4];
        for (i, j) in (0..4).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            if i == j {
                let (above, below) = (at(&[(i, 1.0)])?, at(&[(i, -1.0)])?);
                slope[i] = (above - below) / 2.0;
                information[i][i] = 2.0 * centre - above - below;
                continue;
            }
            let [pp, pm, mp, mm] = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
                .map(|(a, b)| at(&[(i, a), (j, b)]));
            let mixed = -(pp? - pm? - mp? + mm?) / 4.0;
            (information[i][j], information[j][i]) = (mixed, mixed);
        }
        Some(Curve {
            steps,
            slope,
            information,
        })
    }

    /// Derivatives of the coherent statistic in units of `steps`, by central differences. `None` where a nearby state has no place.
    fn slope(&self, state: &State, steps: &[f64; 4], local: &Local) -> Option<[f64; 4]> {
        let mut slope = [0.0; 4];
        for (i, slope) in slope.iter_mut().enumerate() {
            let [above, below] = [steps[i], -steps[i]].map(|by| {
                let motion = self.motion(&state.moved(i, by))?;
                Some(self.integrate_with(&motion, local).coherent)
            });
            *slope = (above? - below?) / 2.0;
        }
        Some(slope)
    }

    /// States of a target's motion in neighbouring places, displaced in range and in position along the track.
    fn neighbours(&self, state: &State) -> impl Iterator<Item = State> + use<'_> {
        let cell_m = self.cube.axes.path_step_m * OVERSAMPLING as f64;
        let state = *state;
        let apart = LEVEL_CELLS.into_iter().flat_map(|cells| [-cells, cells]);
        let places = apart.flat_map(|range| LEVEL_SLOPES.map(|slope| (range, slope)));
        places.map(move |(range, slope)| {
            let state = state.moved(0, range * cell_m);
            state.moved(1, slope * self.fine_slope())
        })
    }

    /// Ratios of the RMS errors of the parameters to the Cramer-Rao bound, at least 1. The echo of a target that was removed from the samples is added in neighbouring places, and the step from its
    /// motion to the maximum of the statistic there is its error by the clutter of that place. `None` with fewer than [`LEAST_NEIGHBOURS`].
    pub(super) fn error_ratios(&self, state: &State, echo: &Echo) -> Option<[f64; 4]> {
        let local = self.local(state, Some(echo))?;
        let curve = self.curve(state, &local)?;
        let information = curve.factor(0.0)?;
        let (mut sums, mut count) = ([0.0; 4], 0.0);
        for state in self.neighbours(state) {
            let Some(motion) = self.motion(&state) else {
                continue;
            };
            let echo = Echo { motion, ..*echo };
            let slope = self
                .local(&state, Some(&echo))
                .and_then(|local| self.slope(&state, &curve.steps, &local));
            if let Some(mut step) = slope {
                information.solve(&mut step);
                sums.iter_mut()
                    .zip(step)
                    .for_each(|(sum, step)| *sum += step * step);
                count += 1.0;
            }
        }
        if count < LEAST_NEIGHBOURS {
            return None;
        }
        let bound = information.inverse();
        Some([0, 1, 2, 3].map(|i| (sums[i] / count / bound[5 * i]).sqrt().max(1.0)))
    }

    /// Mean of the coherent statistic at the motion of a target that was removed from the samples, displaced in range and in position along the track; at least 1, its value in
    /// clutter that is independent from sub-CPI to sub-CPI. The residual of a target near a blind velocity raises it.
    pub(super) fn clutter_level(&self, state: &State) -> f64 {
        let levels = self.neighbours(state).filter_map(|state| {
            let integrated = self.integrate(&self.motion(&state)?);
            (2 * integrated.sub_cpis > self.cube.sub_cpis.len()).then_some(integrated.coherent)
        });
        let levels: Vec<f64> = levels.collect();
        (levels.iter().sum::<f64>() / levels.len().max(1) as f64).max(1.0)
    }

    /// Target of a maximum, with the covariance by the curvature of the statistic and the `ratios` of the standard deviations of the parameters to it.
    pub(super) fn mover(
        &self,
        state: &State,
        integrated: Integrated,
        (echo, ratios): (Option<&Echo>, [f64; 4]),
    ) -> Option<Mover> {
        let motion = self.motion(state)?;
        let local = self.local(state, echo)?;
        let curve = self.curve(state, &local)?;
        let (steps, information) = (curve.steps, curve.factor(0.0)?);
        let errors: Vec<[f64; 4]> = (0..4)
            .map(|i| {
                let mut column = [0.0; 4];
                column[i] = 1.0;
                information.solve(&mut column);
                [0, 1, 2, 3].map(|j| column[j] * ratios[i] * ratios[j])
            })
            .collect();
        let plane = [self.grid.x_axis, self.grid.y_axis];
        let values = |motion: &Motion| {
            let place = plane.map(|axis| motion.position_m.dot(axis));
            let velocity = plane.map(|axis| motion.velocity_m_s.dot(axis));
            [place[0], place[1], velocity[0], velocity[1]]
        };
        let own = values(&motion);
        let mut slopes = [[0.0; 4]; 4];
        for (i, slope) in slopes.iter_mut().enumerate() {
            let moved = values(&self.motion(&state.moved(i, steps[i]))?);
            *slope = [0, 1, 2, 3].map(|k| moved[k] - own[k]);
        }
        let mut covariance = [0, 1, 2, 3].map(|k| {
            [0, 1, 2, 3].map(|l| {
                let terms = (0..16).map(|ij| (ij / 4, ij % 4));
                terms
                    .map(|(i, j)| slopes[i][k] * errors[i][j] * slopes[j][l])
                    .sum()
            })
        });
        let deviation = |i: usize| steps[i] * errors[i][i].max(0.0).sqrt();
        let mut cross_deviation_m_s = deviation(3);
        let mut cross_m_s = state.cross_m_s;
        if self.accelerates(state) {
            // The path does not observe the cross-range velocity of an accelerating target: uniform up to the largest speed.
            let most = self.settings.max_speed_m_s;
            cross_m_s = 0.0;
            let sight = motion.position_m - self.middle.antenna_m();
            let [x_axis, _] = axes(sight, self.along)?;
            cross_deviation_m_s = most / 3f64.sqrt();
            let moved = plane.map(|axis| cross_deviation_m_s * x_axis.dot(axis));
            for (k, l) in (0..4).map(|kl| (kl / 2, kl % 2)) {
                covariance[2 + k][2 + l] += moved[k] * moved[l];
            }
        }
        Some(Mover {
            motion,
            image_position_m: self
                .middle
                .locate(self.centre_m, plane, state.path_m, state.slope),
            radial_velocity_m_s: state.radial_m_s,
            cross_range_velocity_m_s: cross_m_s,
            covariance,
            velocity_deviations_m_s: [deviation(2), cross_deviation_m_s],
            integrated,
            cross_section_m2: integrated.coherent / integrated.gain,
        })
    }
}
