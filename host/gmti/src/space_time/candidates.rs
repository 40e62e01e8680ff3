//! Candidates: maxima of the non-coherent sum over sub-CPIs, and their best Doppler and curvature by the coherent sum.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;
use subaperture_signal::phase::phasor;

use super::cube::OVERSAMPLING;
use super::geometry::Place;
use super::maps::SpaceTime;
use super::state::{FINE, State};
use super::statistic::{Scratch, Snapshot};

/// Probability that the non-coherent statistic of a cell without target is a candidate, as a quantile of the normal distribution.
const CANDIDATE_SIGMA: f64 = 3.7;

/// Largest number of candidates, the strongest first.
const MAX_CANDIDATES: usize = 1000;

/// Level of the weakest target of a pass, relative to the strongest.
pub(super) const GROUP: f64 = 0.1;

/// Cell and curvature of a candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) cell: [usize; 2],
    pub(super) curvature: usize,
    pub(super) energy: f32,
}

/// Curvatures of the path that are searched, `1 / m`: second derivative of the relative path over the along-track position.
pub(super) struct Curvatures {
    pub(super) first: f64,
    pub(super) step: f64,
    pub(super) count: usize,
}

impl Curvatures {
    pub(super) fn at(&self, i: usize) -> f64 {
        self.first + i as f64 * self.step
    }
}

impl SpaceTime {
    /// SNR of a candidate in all sub-CPIs: its energy beyond the mean of clutter and noise.
    pub(super) fn excess(&self, candidate: &Candidate) -> f64 {
        let mean = self.cube.sub_cpis.len() * self.tiles.degrees_of_freedom();
        f64::from(candidate.energy) - mean as f64
    }

    /// Curvatures of the search.
    pub(super) fn curvatures(&self) -> Curvatures {
        let sub_cpi_m = self.section_m() / self.cube.sub_cpis.len() as f64;
        // A Doppler cell of a sub-CPI at the ends of the aperture.
        let step = self.wavelength_m() / sub_cpi_m / (self.section_m() / 2.0);
        let [low, high] = self.curvature_limits();
        let half = ((high - low) / (2.0 * step)).ceil();
        Curvatures {
            first: (low + high) / 2.0 - half * step,
            step,
            count: 2 * half as usize + 1,
        }
    }

    /// Energies of all cells of a sub-CPI, each of mean `N` in clutter and noise.
    fn energies(&self, sub_cpi: usize) -> Vec<f32> {
        let mut scratch = Scratch::default();
        let axes = &self.cube.axes;
        let size = self.tiles.degrees_of_freedom();
        let energy = |place: usize, scratch: &mut Scratch| {
            let cell = [place / axes.ranges, place % axes.ranges];
            let snapshot = Snapshot::of_cell(&self.cube, &self.tiles, sub_cpi, cell, scratch);
            snapshot.map_or(size as f64, |snapshot| {
                let count = snapshot.tile.snapshots as f64;
                let removed = f64::from(u8::from(snapshot.tile.stationary.is_some()));
                snapshot.energy() * (count - size as f64) / count + removed
            }) as f32
        };
        let cells = 0..axes.dopplers * axes.ranges;
        cells.map(|place| energy(place, &mut scratch)).collect()
    }

    /// Maxima of the non-coherent sum over cells and curvatures.
    pub(super) fn candidates(&self, curvatures: &Curvatures) -> Vec<Candidate> {
        let count = self.cube.sub_cpis.len();
        let energies: Vec<Vec<f32>> = (0..count)
            .into_par_iter()
            .map(|sub_cpi| self.energies(sub_cpi))
            .collect();
        let [dopplers, ranges] = [self.cube.axes.dopplers, self.cube.axes.ranges];
        let sum = |curvature: usize, doppler: usize| {
            let curvature = curvatures.at(curvature);
            let (_, slope) = self.cube.path_and_slope([doppler as f64, 0.0]);
            let mut line = vec![0f32; ranges];
            for (sub_cpi, energies) in energies.iter().enumerate() {
                let offset_m = self.offset_m(sub_cpi);
                let moved_m = (slope + 0.5 * curvature * offset_m) * offset_m;
                let bin = self.cube.doppler_bin(slope + curvature * offset_m);
                let shift = (moved_m / self.cube.axes.path_step_m).round() as i64;
                let bin = bin.round();
                if !(0.0..dopplers as f64).contains(&bin) {
                    continue;
                }
                let row = &energies[bin as usize * ranges..][..ranges];
                let from = shift.clamp(0, ranges as i64) as usize;
                let start = (-shift).clamp(0, ranges as i64) as usize;
                let pairs = line[start..].iter_mut().zip(&row[from..]);
                pairs.for_each(|(sum, energy)| *sum += energy);
            }
            line
        };
        let lines: Vec<Vec<f32>> = (0..curvatures.count * dopplers)
            .into_par_iter()
            .map(|i| sum(i / dopplers, i % dopplers))
            .collect();
        let mean = (count * self.tiles.degrees_of_freedom()) as f64;
        let threshold = gamma_quantile(mean, CANDIDATE_SIGMA) as f32;
        let largest = |i: usize, range: usize| {
            let own = lines[i][range];
            let (k, d) = (i / dopplers, i % dopplers);
            let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
            near(k, curvatures.count).all(|k| {
                near(d, dopplers).all(|d| {
                    let line = &lines[k * dopplers + d][near(range, ranges)];
                    line.iter().all(|&other| other <= own)
                })
            })
        };
        let of_line = |i: usize| {
            let line = lines[i].iter().enumerate();
            let maxima = line.filter(|&(range, &energy)| energy > threshold && largest(i, range));
            let candidate = |(range, &energy): (usize, &f32)| Candidate {
                cell: [i % dopplers, range],
                curvature: i / dopplers,
                energy,
            };
            maxima.map(candidate).collect::<Vec<_>>()
        };
        let mut candidates: Vec<Candidate> = (0..lines.len())
            .into_par_iter()
            .flat_map_iter(of_line)
            .collect();
        candidates.sort_by(|a, b| b.energy.total_cmp(&a.energy));
        // Weaker ones are left to the next pass.
        let least = GROUP / 2.0 * candidates.first().map_or(0.0, |first| self.excess(first));
        candidates.retain(|candidate| self.excess(candidate) >= least);
        candidates.truncate(MAX_CANDIDATES);
        candidates
    }

    /// Best Doppler and curvature of a candidate by the coherent sum for each radial velocity, the best first: at places within the grid, or outside.
    pub(super) fn focused(
        &self,
        candidate: &Candidate,
        curvatures: &Curvatures,
        inside: bool,
    ) -> Vec<State> {
        let count = self.cube.sub_cpis.len();
        let curvature = curvatures.at(candidate.curvature);
        let [doppler, range] = candidate.cell.map(|bin| bin as f64);
        let (path_m, slope) = self.cube.path_and_slope([doppler, range]);
        let mut scratch = Scratch::default();
        let mut snapshots = Vec::with_capacity(count);
        for sub_cpi in 0..count {
            let offset_m = self.offset_m(sub_cpi);
            let own_m = path_m + (slope + 0.5 * curvature * offset_m) * offset_m;
            let place = Place {
                paths_m: vec![own_m; self.lags_s.len()],
                slope: slope + curvature * offset_m,
            };
            let snapshot =
                Snapshot::tile(&self.cube, &self.tiles, sub_cpi, &place).and_then(|tile| {
                    Snapshot::at(&self.cube, tile, sub_cpi, &place, |_| (), &mut scratch)
                });
            if let Some(snapshot) = snapshot {
                snapshots.push((offset_m, own_m, snapshot));
            }
        }
        let fine_slope = self.fine_slope() / FINE;
        let slopes = (self.cube.path_and_slope([1.0, 0.0]).1
            - self.cube.path_and_slope([0.0, 0.0]).1)
            * OVERSAMPLING as f64
            / 2.0;
        let fine_curvature = self.fine_curvature();
        let steps = |half: f64, step: f64| {
            let count = (half / step).ceil() as i64;
            (-count..=count).map(move |i| i as f64 * step)
        };
        let tilts: Vec<(f64, Vec<Complex64>)> = steps(slopes, fine_slope)
            .map(|tilt| {
                let turn = |offset_m: &f64| phasor(tilt * offset_m / self.wavelength_m());
                let offsets_m = snapshots.iter().map(|(offset_m, ..)| offset_m);
                (tilt, offsets_m.map(turn).collect())
            })
            .collect();
        let most = self.settings.max_speed_m_s;
        let velocity_step = self.velocity_cell_m_s() / FINE;
        // Level, state without cross-range velocity, curvature.
        let mut found: Vec<(f64, State, f64)> = Vec::new();
        for radial_m_s in steps(most, velocity_step) {
            let state = State {
                path_m,
                slope,
                radial_m_s,
                cross_m_s: 0.0,
            };
            let Some(motion) = self.motion(&state) else {
                continue;
            };
            if self.contains(motion.position_m) != inside {
                continue;
            }
            let mut gain = 0.0;
            // The cross-range velocity has a part along the line of sight away from the middle.
            let turned = self
                .with_curvature(&state, curvature)
                .map_or(0.0, |state| state.cross_m_s)
                / motion.position_m.distance(self.middle.antenna_m());
            let terms: Vec<(f64, Complex64)> = snapshots
                .iter()
                .map(|(offset_m, own_m, snapshot)| {
                    let radial_m_s = radial_m_s + turned * offset_m;
                    let steering = self.candidate_steering(*own_m, radial_m_s, motion.position_m);
                    let steering = self.tiles.over_bins(&steering);
                    let term = snapshot.term(&steering, &mut scratch);
                    gain += term.gain;
                    (*offset_m, term.filtered)
                })
                .collect();
            if gain <= 0.0 {
                continue;
            }
            let mut best: Option<(f64, State, f64)> = None;
            for change in steps(curvatures.step, fine_curvature) {
                let bent: Vec<Complex64> = terms
                    .iter()
                    .map(|(offset_m, z)| {
                        let path_m = 0.5 * change * offset_m * offset_m;
                        z * phasor(path_m / self.wavelength_m())
                    })
                    .collect();
                for (tilt, turns) in &tilts {
                    let terms = bent.iter().zip(turns).map(|(z, turn)| z * turn);
                    let level = terms.sum::<Complex64>().norm_sqr() / gain;
                    if best.is_none_or(|(most, ..)| level > most) {
                        let tilted = State {
                            slope: slope + *tilt,
                            ..state
                        };
                        best = Some((level, tilted, curvature + change));
                    }
                }
            }
            found.extend(best);
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let with_velocity =
            |(_, state, curvature): &(f64, State, f64)| self.with_curvature(state, *curvature);
        found.iter().filter_map(with_velocity).collect()
    }

    /// Steering vector over channels of a target with this relative path, radial velocity and position.
    fn candidate_steering(
        &self,
        path_m: f64,
        radial_m_s: f64,
        position_m: DVec3,
    ) -> Vec<Complex64> {
        let element = |(channel, lag_s): (usize, &f64)| {
            phasor((2.0 * radial_m_s * lag_s - path_m) / self.wavelength_m())
                * self.calibration.factor(channel, position_m)
        };
        self.lags_s.iter().enumerate().map(element).collect()
    }
}

/// Quantile of a Gamma variable of this shape, `sigma` standard deviations of a normal one above the median (Wilson and Hilferty 1931).
fn gamma_quantile(shape: f64, sigma: f64) -> f64 {
    let part = 1.0 / (9.0 * shape);
    shape * (1.0 - part + sigma * part.sqrt()).powi(3)
}
