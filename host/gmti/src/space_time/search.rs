//! Search for moving targets, coarse to fine.
//!
//! 1. The energies of cells, without the part of stationary scatterers, are summed over sub-CPIs along paths of constant curvature: a non-coherent statistic for every range, Doppler and
//!    curvature. Its maxima above a threshold are candidates.
//! 2. For each candidate and each radial velocity whose place lies within the grid, the outputs of the matched filter are summed coherently over corrections of Doppler and curvature.
//! 3. The coherent statistic of the best motion is maximised over path, Doppler, radial and cross-range velocity, with the exact path of every sub-CPI and channel. Its curvature at the
//!    maximum gives the Cramer-Rao bound of the motion's errors.
//!
//! A strong candidate without a place in the grid is sought outside: its echo is removed, so that its Doppler ambiguities are not detected, and it is not reported.
//!
//! The motion is horizontal, of constant velocity; a path curvature beyond that of the largest speed is taken for an acceleration along the line of sight. A sub-CPI in which a target may be the main lobe or a side lobe of a stronger one, in any
//! fold of Doppler, does not count for it.
//!
//! **False alarms.** A resolution cell is tested for `H` independent hypotheses of curvature and radial velocity. The threshold is that of the probability `Pfa / H`
//! of one (Bonferroni), for a statistic that is exponential of mean 1, raised by `(K / (K - N))^2` for the covariance of `N` degrees of freedom from `K` snapshots.
//! Around the remains of a target near a blind velocity, whose amplitude is unknown, the statistic has a larger mean. After its removal a target is dropped if it does not exceed the threshold times
//! that mean at its own motion in neighbouring places.
//!
//! **Covariance.** Errors exceed the Cramer-Rao bound of the trained covariance, by its few snapshots and where clutter is correlated over sub-CPIs: with internal motion by 30 % above 36 dB.
//! After the last pass each target is added again in 36 neighbouring places, and the RMS of the resulting errors scales the standard deviation of each parameter, where it exceeds the bound.

use num_complex::Complex64;
use rayon::prelude::*;
use subaperture_focus::FormError;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Channels;

use super::calibration::Calibration;
use super::candidates::{Candidate, GROUP};
use super::clean::Echo;
use super::cube::OVERSAMPLING;
use super::geometry::{Motion, Place};
use super::maps::SpaceTime;
use super::maximum::Mover;
use super::settings::Settings;
use super::state::State;
use super::statistic::{Integrated, Scratch, Term};
use crate::alignment::Alignment;
use crate::error::GmtiError;

/// Radial velocities of a candidate from which a maximum is sought.
const STARTS: usize = 4;

/// Largest level of a response in the main lobe of a target, relative to its own, and after it was removed.
const MAIN_LOBE: f64 = 2.0;
const REMOVED: f64 = 0.03;

/// Largest level of side lobes on the range and Doppler line of a target, relative to its own.
const SIDE_LOBE: f64 = 2e-3;

/// Relative change of the statistic at which an estimate has settled.
const SETTLED: f64 = 0.01;

/// Smallest ratio of the coherent statistic of a motion to the energy of its candidate.
const EXPLAINED: f64 = 0.5;

/// Largest level of a Doppler ambiguity of a target, relative to its own.
const AMBIGUITY: f64 = 3e-3;

/// Half the width of a main lobe, resolution cells.
const LOBE_CELLS: f64 = 2.5;

/// Smallest number of channels: with two the position of a target in clutter is not observed.
const MIN_CHANNELS: usize = 3;

/// Largest number of passes over the recording by [`find`].
const MAX_PASSES: usize = 8;

/// Largest number of estimates of all targets, each without the others, in a pass.
const MAX_REFINEMENTS: usize = 2;

/// Detect moving targets by integration over sub-CPIs, the strongest first. Each pass detects the targets within 10 dB of the strongest that is left, and the next one removes them
/// from the samples.
///
/// # Errors
/// [`GmtiError::Unsuited`] for two channels, which do not locate targets within clutter; those of [`SpaceTime::form`]; [`GmtiError::Form`] if `monitor` cancels.
pub fn find(
    channels: &Channels,
    alignment: &Alignment,
    calibration: &Calibration,
    grid: &ImageGrid,
    settings: &Settings,
    monitor: &dyn Monitor,
) -> Result<Vec<Mover>, GmtiError> {
    if channels.len() < MIN_CHANNELS {
        return Err(GmtiError::Unsuited(format!(
            "integration over sub-CPIs: expected at least {MIN_CHANNELS} channels to locate targets within clutter, found {}: detect in the image",
            channels.len()
        )));
    }
    let mut found = Found::default();
    for pass in 0..=MAX_PASSES {
        monitor.progress(pass as f64 / MAX_PASSES as f64);
        let left = |found: &Found| {
            let motions = found.motions();
            SpaceTime::without(channels, alignment, calibration, grid, &motions, settings)
        };
        for _ in 0..MAX_REFINEMENTS {
            if found.is_empty() || !left(&found)?.refine(&mut found) {
                break;
            }
        }
        let rest = left(&found)?;
        // Targets of the last pass are estimated again, too.
        if pass == MAX_PASSES || rest.search(&mut found, monitor)? == 0 {
            rest.measure_errors(&mut found);
            break;
        }
    }
    Ok(found.into_movers())
}

/// Target of an earlier pass.
struct Target {
    state: State,
    /// Whether it lies within the grid.
    inside: bool,
    responses: Vec<Response>,
    mover: Mover,
}

/// Response to a motion in one sub-CPI.
struct Response {
    bins: [f64; 2],
    term: Term,
}

/// Targets of all passes.
#[derive(Default)]
struct Found {
    targets: Vec<Target>,
}

impl Found {
    fn is_empty(&self) -> bool {
        self.targets.is_empty()
    }

    /// Motions and amplitudes of all targets.
    fn motions(&self) -> Vec<(Motion, Complex64)> {
        let movers = self.targets.iter().map(|target| &target.mover);
        movers
            .map(|mover| (mover.motion, mover.integrated.amplitude))
            .collect()
    }

    /// Targets within the grid, the strongest first.
    fn into_movers(self) -> Vec<Mover> {
        let targets = self.targets.into_iter().filter(|target| target.inside);
        let mut movers: Vec<Mover> = targets.map(|target| target.mover).collect();
        movers.sort_by(|a, b| b.integrated.coherent.total_cmp(&a.integrated.coherent));
        movers
    }
}

impl SpaceTime {
    /// Add the moving targets within 10 dB of the strongest to `found`, whose targets have been removed, and return their number.
    ///
    /// # Errors
    /// [`GmtiError::SubCpiMemory`] if the search needs more memory than allowed; [`GmtiError::Form`] if `monitor` cancels.
    fn search(&self, found: &mut Found, monitor: &dyn Monitor) -> Result<usize, GmtiError> {
        let curvatures = self.curvatures();
        let cells = self.cube.axes.dopplers * self.cube.axes.ranges;
        let sums = self.cube.sub_cpis.len() + curvatures.count;
        let needed_bytes = self.cube.bytes.saturating_add(4 * (cells * sums) as u64);
        if needed_bytes > self.settings.memory_bytes {
            return Err(GmtiError::SubCpiMemory {
                sub_cpis: self.cube.sub_cpis.len(),
                needed_bytes,
                allowed_bytes: self.settings.memory_bytes,
            });
        }
        let threshold = self.threshold();
        let candidates = self.candidates(&curvatures);
        let best = |candidate: &Candidate, inside: bool| {
            if monitor.cancelled() {
                return None;
            }
            let states = self.focused(candidate, &curvatures, inside);
            let maxima = states.iter().take(STARTS);
            let mut maxima = maxima.filter_map(|&state| self.maximised(state, None));
            let (state, integrated) = maxima.next()?;
            (integrated.coherent > threshold).then_some((inside, state, integrated))
        };
        let within = candidates.par_iter();
        let within = within.filter_map(|candidate| best(candidate, true));
        let mut maxima: Vec<(bool, State, Integrated)> = within.collect();
        let levels = maxima.iter().map(|(_, _, integrated)| integrated.coherent);
        let level = levels.fold(threshold / AMBIGUITY, f64::max);
        // Energy above that of all targets within the grid has another place.
        let unexplained = |candidate: &&Candidate| EXPLAINED * self.excess(candidate) > level;
        let elsewhere = candidates.par_iter().filter(unexplained);
        let elsewhere = elsewhere.filter_map(|candidate| best(candidate, false));
        let elsewhere: Vec<(bool, State, Integrated)> = elsewhere.collect();
        maxima.extend(
            elsewhere
                .into_iter()
                .filter(|own| EXPLAINED * own.2.coherent > level),
        );
        if monitor.cancelled() {
            return Err(FormError::Cancelled.into());
        }
        maxima.sort_by(|a, b| b.2.coherent.total_cmp(&a.2.coherent));
        let removed = found.targets.len();
        let mut strongest = None;
        for (inside, state, integrated) in maxima {
            if integrated.coherent < GROUP * strongest.unwrap_or(0.0) {
                break;
            }
            let Some(motion) = self.motion(&state) else {
                continue;
            };
            let responses = self.responses(&motion, None);
            let masked = |m: usize| {
                let mut targets = found.targets.iter().enumerate();
                targets
                    .any(|(i, other)| self.masks(&other.responses[m], &responses[m], i < removed))
            };
            let free = (0..responses.len()).filter(|&m| !masked(m));
            let free = Integrated::of(free.map(|m| responses[m].term));
            if free.coherent > threshold
                && let Some(mover) = self.mover(&state, integrated, (None, [1.0; 4]))
            {
                strongest = strongest.or(Some(integrated.coherent));
                found.targets.push(Target {
                    state,
                    inside,
                    responses,
                    mover,
                });
            }
        }
        Ok(found.targets.len() - removed)
    }

    /// Estimate the motions of `found`, whose targets have been removed, again: each without the others. Returns whether one has changed by more than [`SETTLED`].
    fn refine(&self, found: &mut Found) -> bool {
        let threshold = self.threshold();
        let refined = |target: Target| {
            let before = target.mover.integrated.coherent;
            let echo = Echo {
                motion: target.mover.motion,
                amplitude: target.mover.integrated.amplitude,
            };
            let maximum = self.maximised(target.state, Some(&echo));
            let (state, integrated) = maximum.filter(|(_, i)| i.coherent > threshold)?;
            let level = self.clutter_level(&state);
            if integrated.coherent <= level * threshold {
                return None;
            }
            if !self.near(&state, &target.state) {
                return Some((0.0, target));
            }
            let Some(mover) = self.mover(&state, integrated, (Some(&echo), [level.sqrt(); 4]))
            else {
                return Some((0.0, target));
            };
            let responses = self.responses(&mover.motion, Some(&echo));
            let change = (integrated.coherent / before - 1.0).abs();
            Some((
                change,
                Target {
                    state,
                    inside: target.inside,
                    responses,
                    mover,
                },
            ))
        };
        let targets = std::mem::take(&mut found.targets);
        let count = targets.len();
        let (changes, targets): (Vec<f64>, Vec<Target>) =
            targets.into_par_iter().filter_map(refined).unzip();
        found.targets = targets;
        found.targets.len() < count || changes.iter().any(|&change| change > SETTLED)
    }

    /// Replace the covariances of `found`, whose targets have been removed, by those of errors in the clutter around them.
    fn measure_errors(&self, found: &mut Found) {
        found.targets.par_iter_mut().for_each(|target| {
            let mover = &target.mover;
            let echo = Echo {
                motion: mover.motion,
                amplitude: mover.integrated.amplitude,
            };
            let ratios = self.error_ratios(&target.state, &echo);
            let measured =
                ratios.and_then(|r| self.mover(&target.state, mover.integrated, (Some(&echo), r)));
            if let Some(mover) = measured {
                target.mover = mover;
            }
        });
    }

    /// Threshold of the coherent statistic.
    fn threshold(&self) -> f64 {
        let cell_slope = self.fine_slope();
        let [low, high] = self.curvature_limits();
        let curvatures = (high - low) / (2.0 * cell_slope / self.section_m());
        // Velocities of a cell: those of places within the grid.
        let extent_m = {
            let [first, last] = [0, self.grid.columns.count - 1]
                .map(|column| self.grid.position_m(self.grid.rows.count / 2, column));
            (last - first).dot(self.along).abs()
        };
        let range_m = self.centre_m.distance(self.middle.antenna_m());
        let span_m_s = (extent_m * self.speed_m_s / range_m).min(2.0 * self.settings.max_speed_m_s);
        let velocities = 1.0 + span_m_s / (2.0 * self.velocity_cell_m_s());
        let hypotheses = (1.0 + curvatures) * velocities;
        let one = -libm::log(self.settings.false_alarm_probability / hypotheses);
        one * self.estimation_loss()
    }

    /// Probability that clutter alone exceeds a coherent statistic of one hypothesis.
    pub(crate) fn exceedance(&self, coherent: f64) -> f64 {
        libm::exp(-coherent / self.estimation_loss())
    }

    /// Factor of a threshold for the estimated covariance, `(K / (K - N))^2`.
    fn estimation_loss(&self) -> f64 {
        let (count, size) = (self.snapshots(), self.tiles.degrees_of_freedom() as f64);
        (count / (count - size)).powi(2)
    }

    /// Training snapshots of a tile away from the edges.
    pub(crate) fn snapshots(&self) -> f64 {
        let middle = [self.cube.axes.dopplers / 2, self.cube.axes.ranges / 2];
        let tile = self
            .tiles
            .tile(&self.cube, self.cube.sub_cpis.len() / 2, middle);
        let size = self.tiles.degrees_of_freedom();
        tile.map_or(2 * size, |tile| tile.snapshots) as f64
    }

    /// Response to a motion in each sub-CPI.
    fn responses(&self, motion: &Motion, echo: Option<&Echo>) -> Vec<Response> {
        let mut scratch = Scratch::default();
        let mut place = Place::default();
        let of = |sub_cpi: usize| {
            let position_m = |time_s: f64| motion.at(time_s);
            self.cube.sub_cpis[sub_cpi].place(position_m, &mut place);
            let bins = self.cube.bins(&place);
            let (_, term) = self.snapshot_term(sub_cpi, position_m, (None, echo), &mut scratch);
            Response { bins, term }
        };
        (0..self.cube.sub_cpis.len()).map(of).collect()
    }

    /// Whether a response may be the main lobe or a side lobe of a stronger one in any fold of the Doppler axis, or its residue if it was `removed`.
    fn masks(&self, stronger: &Response, own: &Response, removed: bool) -> bool {
        let fold = 1.0 / self.cube.axes.doppler_step;
        let apart = (own.bins[0] - stronger.bins[0]).abs();
        let doppler = (apart - (apart / fold).round() * fold).abs() / OVERSAMPLING as f64;
        let range = (own.bins[1] - stronger.bins[1]).abs() / OVERSAMPLING as f64;
        let level = match (doppler < LOBE_CELLS, range < LOBE_CELLS) {
            (true, true) if removed => REMOVED,
            (true, true) => MAIN_LOBE,
            (false, false) => 0.0,
            _ if removed => 0.0,
            _ => SIDE_LOBE,
        };
        own.term.level() <= level * stronger.term.level()
    }
}
