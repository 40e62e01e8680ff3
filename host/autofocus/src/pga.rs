//! Phase gradient autofocus, on the phase history (C 6.2).
//!
//! A phase error that is common to all of the scene shows in the histories of bright points (`echoes.rs`). A round
//!
//! 1. takes the brightest pixel of every range bin of the image, and its history;
//! 2. brings each to its centre (`centring.rs`: C's circular shift);
//! 3. keeps what turns slowly (C's window): all in the first two rounds, because an error that changes from pulse to
//!    pulse spreads a point over the whole image, then half as much in each round;
//! 4. estimates what the histories have in common ([`Estimator`]), each weighed by how much of it is its point (`echoes.rs`), where C
//!    takes all alike; and again with the points brought to their centres once the phases are known.
//!
//! **Why not on the image's spectrum.** Conventional PGA takes an azimuth transform of the image for the phase history. That
//! holds for small far scenes and formers in the frequency domain; a backprojected image on a ground grid has another
//! spectrum at every place (C 6.2.2, 6.3.3). Histories of points are the same thing where that holds, and exact where it does not: in the near
//! field, over wide angles, on any track, for images of any former on any grid.
//!
//! What it neglects: that phase errors of a moving radar depend on the direction of the point
//! ([`ModifiedPhaseGradient`](super::ModifiedPhaseGradient)), and ranges that are wrong by a cell or more.
//!
//! With a channel beside others each has histories of its own, and the phase of a turn is that of all channels.
//!
//! Cost a round: an image, and points times samples. Accuracy, measured (`tests/images`): white errors of 2 rad rms are taken away to
//! within 0.02 dB of a point's peak on 40 simulated points; put into two degrees of the GOTCHA recording, its brightest reflector comes out
//! 0.1 dB above that of the recording as it is, which has phase errors of its own. By the gradient it stays 1 dB below there: among many points of
//! little signal each, steps from pulse to pulse add their errors up.

use glam::DVec3;
use rayon::prelude::*;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

use super::centring::{Centred, centre};
use super::correction::Correction;
use super::echoes::{Echo, Points, brightest, echoes};
use super::estimator::{Estimator, Row, low_pass, phases_rad};
use super::sharpen::{Look, Method, SharpenError};

/// Pulses that it takes at the least.
const LEAST_TURNS: usize = 8;

/// Rounds without a window, and the narrowest window, in cycles over the aperture.
const OPEN_ROUNDS: usize = 2;
const LEAST_CYCLES: f64 = 6.0;

/// How far a point may lie from its pixel, in resolution cells: at first it is a pixel's neighbour; once phases are known it is
/// as far as what was brightest of its blur.
const NEAR_CELLS: f64 = 1.5;
const FAR_CELLS: f64 = 8.0;

/// Estimates with points brought to their centres anew.
const CENTRINGS: usize = 3;

/// Phase gradient autofocus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseGradient {
    /// How phases are estimated.
    pub estimator: Estimator,
    /// Which points are looked at.
    pub points: Points,
}

impl Default for PhaseGradient {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            points: Points {
                most: 64,
                within_db: 30.0,
            },
        }
    }
}

impl Method for PhaseGradient {
    fn name(&self) -> &'static str {
        "pga"
    }

    fn first_rounds(&self, turns: usize) -> usize {
        let halvings = libm::log2(turns as f64 / LEAST_CYCLES).max(0.0);
        OPEN_ROUNDS + halvings as usize
    }

    fn propose(&self, look: &Look) -> Result<Option<Correction>, SharpenError> {
        let collection = look.history.collection();
        let turns = collection.num_turns();
        let (echoes, places) = seen(look, self.name(), self.points)?;
        let width = window(look.round, turns);
        let mut phases = vec![0.0; turns];
        for centring in 0..CENTRINGS {
            let (known, reach) = match centring {
                0 => (None, NEAR_CELLS),
                _ => (Some(phases.as_slice()), FAR_CELLS),
            };
            let rows: Vec<Row> = centred(
                collection,
                look.subject.grid,
                &echoes,
                &places,
                known,
                reach,
            )
            .into_iter()
            .zip(&echoes)
            .map(|(centred, echo)| {
                let mut values = centred.values;
                low_pass(&mut values, width);
                let weight = 1.0 / echo.signal_and_rest()[1];
                Row { values, weight }
            })
            .collect();
            phases = phases_rad(self.estimator, &rows, turns);
        }
        let channels = collection.pulses.len() / turns;
        let error_rad = (0..channels).flat_map(|_| phases.iter().copied()).collect();
        Ok(Some(Correction::Phase { error_rad }))
    }
}

/// The window of a round, of all cycles a pulse.
pub(crate) fn window(round: usize, turns: usize) -> f64 {
    let halvings = (round + 1).saturating_sub(OPEN_ROUNDS) as i32;
    (0.5f64.powi(halvings)).max(LEAST_CYCLES / turns as f64)
}

/// The histories of the brightest points, and where they are.
///
/// # Errors
/// [`SharpenError`]: too few pulses, no memory, no samples.
pub(crate) fn seen(
    look: &Look,
    method: &'static str,
    points: Points,
) -> Result<(Vec<Echo>, Vec<DVec3>), SharpenError> {
    let collection = look.history.collection();
    let pulses = collection.num_turns();
    if pulses < LEAST_TURNS {
        return Err(SharpenError::TooShort {
            method,
            needed: LEAST_TURNS,
            pulses,
        });
    }
    let places = brightest(collection, look.subject.grid, look.image, points);
    if places.is_empty() {
        return Err(SharpenError::Dark);
    }
    // Of each value its history, as centred, and as a row.
    let bytes = 3 * 16 * (places.len() * collection.pulses.len()) as u64;
    look.room("the histories of points", bytes)?;
    let fast = look.fast();
    let echoes = echoes(look.history, &fast, &places, look.subject.monitor)?;
    Ok((echoes, places))
}

/// All histories at their centres.
pub(crate) fn centred(
    collection: &Collection,
    grid: &ImageGrid,
    echoes: &[Echo],
    places: &[DVec3],
    phases_rad: Option<&[f64]>,
    reach_cells: f64,
) -> Vec<Centred> {
    let each = echoes.par_iter();
    each.map(|echo| {
        let place_m = places[echo.point];
        centre(collection, grid, echo, place_m, phases_rad, reach_cells)
    })
    .collect()
}
