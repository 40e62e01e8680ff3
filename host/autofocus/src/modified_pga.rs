//! Modified phase gradient autofocus: antenna displacements from points in different directions (C 6.3 to 6.5).
//!
//! At near range, a displacement `d` of the radar changes the phase of each point by a different amount. For a point with the path gradient
//! `s = u_t + u_r` (unit vectors away from the antennas) at the distance `p` from its assumed position,
//!
//! ```text
//! arg h_i(n) = c_i + k s_i(n) . (d(n) - p_i)
//! ```
//!
//! For one antenna, `k s . d` is `(4 pi / lambda) (dRg cos(theta) + dAz sin(theta))`, C (6.11). (C 6.4 gives the change of range as
//! `sqrt(dRg^2 + dAz^2)`, the length of the displacement. That has no sign and holds only for a point straight ahead:
//! to first order the change is the projection on the line of sight, `|q - d| - |q| = -u . d`, as in (6.11).)
//!
//! Histories of points are computed as by [`PhaseGradient`](super::PhaseGradient). Further steps of a round:
//!
//! 1. **Spectrum alignment** (6.10) is not needed: histories come from the echoes, not from the image.
//! 2. **Angles of arrival** are those of the points' positions from the antennas of each pulse; **masked range bins** are those without a
//!    bright point, and the weight of a history decreases with the power of other scatterers and noise in it.
//! 3. **Steps** from pulse to pulse by least squares over the points, C (6.12) to (6.15), with outliers down-weighted, accumulated. Turns are
//!    lost only if the motion between two pulses differs from the recorded one by more than a quarter of a wavelength.
//! 4. **Joint estimate**: errors of steps accumulate, and steps assume the points at their positions in the blurred image. The
//!    displacements of all pulses, the positions `p_i` and the phases `c_i` are therefore estimated together by least squares on the phases
//!    (Gauss-Newton). Displacements are eliminated pulse by pulse (`joint.rs`).
//! 5. A rigid motion of track and scene is unobservable and is removed from the displacements: the image is not shifted.
//!
//! Displacements lie in the plane of the pixels. A displacement across every line of sight changes no phase: a prior
//! keeps it near zero.
//!
//! Measured accuracy (`tests/images/near.rs`): in C 6.6's geometry, with track errors of 1.5 mm rms along each axis, every reflector
//! reaches its peak on the true track within 0.05 dB in one round; one phase for all leaves them 1 to 17 dB below. Displacements
//! reach the Cramér-Rao bound, except for some smooth motions that hardly change the phases when positions are estimated too
//! (`joint.rs`): images are sharp, but positions are not survey-grade.

use glam::DVec3;

use subaperture_model::phase_history::Collection;

use subaperture_signal::phase::cis;

use super::correction::Correction;
use super::echoes::{Points, cell_path_m, wavenumber_rad_m};
use super::estimator::low_pass;
use super::joint::{PLACE_CELLS, Sighted, Solved, refine, steps};
use super::pga::{centred, seen, window};
use super::rigid::without_rigid_motion;
use super::rounds::{Method, RoundInput, SharpenError};

/// Modified phase gradient autofocus: two displacement components per pulse from points in different directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModifiedPhaseGradient {
    /// Selection of points: C's mask of range bins.
    pub points: Points,
}

impl Default for ModifiedPhaseGradient {
    fn default() -> Self {
        Self {
            points: Points {
                most: 48,
                within_db: 25.0,
            },
        }
    }
}

/// Least number of points for two components per pulse.
const MIN_POINTS: usize = 2;

/// Groups of points that the jackknife leaves out, one at a time.
const GROUPS: usize = 8;

/// Largest distance of a point from its pixel, resolution cells.
const REACH_CELLS: f64 = 1.5;

/// Prior standard deviations of displacements, in wavelengths. With a wide prior, displacements that hardly change the phases follow the noise.
const SPREADS: [f64; 6] = [1.0 / 128.0, 1.0 / 32.0, 1.0 / 8.0, 0.5, 1.0, 2.0];

/// Accepted loss of the points' peaks for a narrower prior, as a factor of the smallest loss and as an addition to it: 0.004 dB.
const WORSE_PART: f64 = 1.1;
const WORSE: f64 = 1e-3;

impl Method for ModifiedPhaseGradient {
    fn name(&self) -> &'static str {
        "mpga-image"
    }

    fn first_rounds(&self, _turns: usize) -> usize {
        4
    }

    fn propose(&self, look: &RoundInput) -> Result<Option<Correction>, SharpenError> {
        let collection = look.history.collection();
        let turns = collection.num_turns();
        let (rows, places) = self.sighted(look, window(look.round, turns))?;
        let axes = axes(look);
        let wavelength_m = wavelength_m(collection);
        let started = steps(&rows, axes, turns, wavelength_m / 4.0);
        let tried: Vec<(f64, Solved)> = SPREADS
            .iter()
            .map(|spread| {
                let mut solved = Solved {
                    displacements: started.clone(),
                    expected: Vec::new(),
                };
                let priors = [spread * wavelength_m, place_m(collection)];
                let left = refine(&rows, axes, places.len(), priors, &mut solved);
                (left, solved)
            })
            .collect();
        let least = tried
            .iter()
            .fold(f64::INFINITY, |least, tried| least.min(tried.0));
        let seen = WORSE_PART * least + WORSE;
        let solved = tried.into_iter().find(|tried| tried.0 <= seen);
        Ok(solved.map(|(_, solved)| track(collection, axes, solved.displacements.into_iter())))
    }

    fn without_points(
        &self,
        look: &RoundInput,
        correction: &Correction,
    ) -> Result<Option<Vec<Correction>>, SharpenError> {
        let Correction::Track { displacement_m } = correction else {
            return Ok(None);
        };
        let collection = look.history.collection();
        let turns = collection.num_turns();
        let (rows, places) = self.sighted(look, 1.0)?;
        let groups = places.len().min(GROUPS);
        if groups <= MIN_POINTS {
            return Ok(None);
        }
        let axes = axes(look);
        let found: Vec<[f64; 2]> = displacement_m[..turns]
            .iter()
            .map(|moved_m| axes.map(|axis| moved_m.dot(axis)))
            .collect();
        let squares: f64 = found.iter().map(|[x, y]| x * x + y * y).sum();
        let spread_m = (squares / (2 * turns) as f64).sqrt();
        if spread_m == 0.0 {
            return Ok(None);
        }
        let started = Solved {
            displacements: vec![[0.0; 2]; turns],
            expected: found.iter().map(|[x, y]| [-x, -y]).collect(),
        };
        let priors = [spread_m, place_m(collection)];
        let without = |group: usize| {
            let kept = |point: usize| point % groups != group;
            // Renumber the remaining points.
            let numbers: Vec<usize> = (0..places.len()).filter(|&point| kept(point)).collect();
            let rows: Vec<Sighted> = rows
                .iter()
                .filter(|row| kept(row.point))
                .map(|row| Sighted {
                    point: numbers.partition_point(|&point| point < row.point),
                    ..row.clone()
                })
                .collect();
            let mut solved = started.clone();
            refine(&rows, axes, numbers.len(), priors, &mut solved);
            let moved = solved.displacements.iter().zip(&found);
            let moved = moved.map(|(d, f)| [d[0] + f[0], d[1] + f[1]]);
            // The rigid motion refers to the recorded track.
            track(look.subject.history.collection(), axes, moved)
        };
        Ok(Some((0..groups).map(without).collect()))
    }
}

impl ModifiedPhaseGradient {
    /// Histories of the points in the image, low-pass filtered to `width` cycles per pulse, and the positions of the points.
    fn sighted<'a>(
        &self,
        look: &'a RoundInput,
        width: f64,
    ) -> Result<(Vec<Sighted<'a>>, Vec<DVec3>), SharpenError> {
        let collection = look.history.collection();
        let grid = look.subject.grid;
        let turns = collection.num_turns();
        let (echoes, places) = seen(look, self.name(), self.points)?;
        if places.len() < MIN_POINTS {
            return Err(SharpenError::TooFewPoints {
                method: self.name(),
                needed: MIN_POINTS,
                found: places.len(),
                within_db: self.points.within_db,
            });
        }
        let unknowns = (echoes.len() + 2 * places.len()) as u64;
        look.room("the joint estimate", 8 * unknowns * unknowns)?;
        let centred = centred(collection, grid, &echoes, &places, None, REACH_CELLS);
        let rows = centred
            .into_iter()
            .zip(&echoes)
            .map(|(centred, echo)| {
                let mut values = centred.values;
                low_pass(&mut values, width);
                let pulses = &collection.pulses[echo.first..echo.first + turns];
                let wavenumber = |pulse| wavenumber_rad_m(collection, pulse);
                // Refer the history to the position common to all channels of the point.
                let place_m = places[echo.point];
                for (value, pulse) in values.iter_mut().zip(pulses) {
                    let path_m = pulse.path_m(centred.place_m) - pulse.path_m(place_m);
                    *value *= cis(-wavenumber(pulse) * path_m);
                }
                Sighted {
                    point: echo.point,
                    place_m,
                    pulses,
                    wavenumbers: pulses.iter().map(wavenumber).collect(),
                    rest: echo.signal_and_rest()[1],
                    values,
                }
            })
            .collect();
        Ok((rows, places))
    }
}

/// Axes of the plane of the pixels.
fn axes(look: &RoundInput) -> [DVec3; 2] {
    [look.subject.grid.x_axis, look.subject.grid.y_axis]
}

/// Wavelength of the first pulse's centre frequency, metres.
fn wavelength_m(collection: &Collection) -> f64 {
    std::f64::consts::TAU / wavenumber_rad_m(collection, &collection.pulses[0])
}

/// Prior standard deviation of the points' positions, metres.
fn place_m(collection: &Collection) -> f64 {
    PLACE_CELLS * cell_path_m(collection) / 2.0
}

/// Displacements without their rigid motion, repeated for every channel.
fn track(
    collection: &Collection,
    axes: [DVec3; 2],
    moved: impl Iterator<Item = [f64; 2]>,
) -> Correction {
    let turns = collection.num_turns();
    let moved: Vec<DVec3> = moved.map(|[x, y]| axes[0] * x + axes[1] * y).collect();
    let antennas: Vec<DVec3> = middles(collection).take(turns).collect();
    let moved = without_rigid_motion(axes, &antennas, &moved);
    let channels = collection.pulses.len() / turns;
    let displacement_m = (0..channels).flat_map(|_| moved.iter().copied()).collect();
    Correction::Track { displacement_m }
}

/// Midpoint of the antennas of every pulse.
pub(crate) fn middles(collection: &Collection) -> impl Iterator<Item = DVec3> {
    let pulses = collection.pulses.iter();
    pulses.map(|pulse| pulse.phase_centre_m())
}
