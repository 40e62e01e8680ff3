//! The modified phase gradient autofocus: where the radar was, from points seen under different directions (C 6.3 to 6.5).
//!
//! Near by, a displacement `d` of the radar turns the phase of every point by its own amount. For a point whose path grows by
//! `s = u_t + u_r` a metre (unit vectors away from the antennas), and which lies `p` off the place taken for it,
//!
//! ```text
//! arg h_i(n) = c_i + k s_i(n) . (d(n) - p_i)
//! ```
//!
//! for one antenna `k s . d` is `(4 pi / lambda) (dRg cos(theta) + dAz sin(theta))`, C (6.11). (C 6.4 gives the change of range as
//! `sqrt(dRg^2 + dAz^2)`, which is the length of the displacement, has no sign, and is the change of range of no point but one straight ahead:
//! to first order `|q - d| - |q| = -u . d` is the projection on the line of sight, as (6.11) then has it.)
//!
//! A round, beside what [`PhaseGradient`](super::PhaseGradient) does to get at histories of points:
//!
//! 1. **Spectrum alignment** (6.10) is not needed: histories are of the echoes, not of the image.
//! 2. **Angles of arrival** are those of the points' places, from each pulse's own antennas; **masked range bins** are those without a
//!    bright point, and what a history holds beside its point makes it count less.
//! 3. **Steps** from pulse to pulse by least squares over the points, C (6.12) to (6.15), outliers down-weighted, summed up. They cannot be
//!    lost by whole turns unless the radar moves by a quarter of a wavelength between two pulses more than recorded.
//! 4. **All at once**: steps leave errors that add up, and take points to be where the blurred image has them. So the
//!    displacements of all pulses, the places `p_i` and the phases `c_i` are then found together by least squares on the phases
//!    themselves, by Gauss and Newton. Displacements are eliminated pulse by pulse (`joint.rs`).
//! 5. What moves track and scene as one rigid body is no error, and is taken out of the displacements: the image stays where it is.
//!
//! Displacements lie in the plane of the pixels. One across every line of sight shows in no phase: it is left at zero, within
//! what noise says, by a prior of some wavelengths.
//!
//! Accuracy, measured (`tests/images/near.rs`): in C 6.6's geometry, with a track that errs by 1.5 mm rms along each axis, every reflector
//! comes within 0.05 dB of its peak on the true track, in one round; one phase for all leaves them 1 to 17 dB below. Displacements
//! differ from the truth by what the phases' noise allows (Cramér and Rao), but for some smooth motions that hardly turn the phases of points at places that are
//! found with them (`joint.rs`): images are sharp by them, surveys should not be made with them.

use glam::DVec3;

use subaperture_model::phase_history::Collection;

use subaperture_signal::phase::cis;

use super::correction::Correction;
use super::echoes::{Points, cell_path_m, wavenumber_rad_m};
use super::estimator::low_pass;
use super::joint::{Sighted, Solved, refine, steps};
use super::pga::{centred, seen, window};
use super::rigid::without_rigid_motion;
use super::sharpen::{Look, Method, SharpenError};

/// The modified phase gradient autofocus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModifiedPhaseGradient {
    /// Which points are looked at: C's mask of range bins.
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

/// Points that two components a pulse take.
const LEAST_POINTS: usize = 2;

/// How far a point may lie from its pixel, in resolution cells.
const REACH_CELLS: f64 = 1.5;

/// Prior spread of displacements, in wavelengths, and of points' places, in range cells.
const DISPLACEMENT_WAVELENGTHS: f64 = 2.0;
const PLACE_CELLS: f64 = 0.5;

impl Method for ModifiedPhaseGradient {
    fn name(&self) -> &'static str {
        "mpga-image"
    }

    fn first_rounds(&self, _turns: usize) -> usize {
        4
    }

    fn propose(&self, look: &Look) -> Result<Option<Correction>, SharpenError> {
        let collection = look.history.collection();
        let grid = look.subject.grid;
        let turns = collection.num_turns();
        let (echoes, places) = seen(look, self.name(), self.points)?;
        if places.len() < LEAST_POINTS {
            return Err(SharpenError::TooFewPoints {
                method: self.name(),
                needed: LEAST_POINTS,
                found: places.len(),
                within_db: self.points.within_db,
            });
        }
        let unknowns = (echoes.len() + 2 * places.len()) as u64;
        look.room("the joint estimate", 8 * unknowns * unknowns)?;
        let axes = [grid.x_axis, grid.y_axis];
        let centred = centred(collection, grid, &echoes, &places, None, REACH_CELLS);
        let width = window(look.round, turns);
        let rows: Vec<Sighted> = centred
            .into_iter()
            .zip(&echoes)
            .map(|(centred, echo)| {
                let mut values = centred.values;
                low_pass(&mut values, width);
                let pulses = &collection.pulses[echo.first..echo.first + turns];
                let wavenumber = |pulse| wavenumber_rad_m(collection, pulse);
                // Back to the place that all channels of the point share.
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
        let wavelength_m =
            std::f64::consts::TAU / wavenumber_rad_m(collection, &collection.pulses[0]);
        let mut solved = Solved {
            displacements: steps(&rows, axes, turns, wavelength_m / 4.0),
        };
        let priors = [
            DISPLACEMENT_WAVELENGTHS * wavelength_m,
            PLACE_CELLS * cell_path_m(collection) / 2.0,
        ];
        refine(&rows, axes, places.len(), priors, &mut solved);
        let displaced = solved
            .displacements
            .iter()
            .map(|[x, y]| axes[0] * *x + axes[1] * *y);
        let antennas: Vec<DVec3> = middles(collection).take(turns).collect();
        let displaced: Vec<DVec3> = displaced.collect();
        let displaced = without_rigid_motion(axes, &antennas, &displaced);
        let channels = collection.pulses.len() / turns;
        let displacement_m = (0..channels)
            .flat_map(|_| displaced.iter().copied())
            .collect();
        Ok(Some(Correction::Track { displacement_m }))
    }
}

/// Half way between the antennas of every pulse.
pub(crate) fn middles(collection: &Collection) -> impl Iterator<Item = DVec3> {
    let pulses = collection.pulses.iter();
    pulses.map(|pulse| 0.5 * (pulse.transmitter_m + pulse.receiver_m))
}
