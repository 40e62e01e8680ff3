//! Backprojection: every pulse's range profile read at every pixel's range.
//!
//! ```text
//! I(p) = sum_n w_slow[n] exp(+j 2 pi f_c r_n(p) / c) profile_n(r_n(p)),   r_n(p) = path_n(p) - reference_path_n
//! ```
//!
//! (Schone 2020, chapter 2 and 5.1), with `f_c` the frequency of sample `K/2`. Profiles are upsampled
//! by zero padding, emphasised to be read as splines ([`RangeProfiler`]), in float32. Degree and upsampling are chosen together, the
//! cheapest that keep the bound (`choice`).
//!
//! Pixels of a Cartesian grid are formed by tiles ([`subaperture_kernels::tile`]), in which paths are polynomials of third degree:
//! as large as these keep a tenth of the error's power. Where antennas are so near that a tile's do not, and where pixels lie otherwise, on polar grids
//! and on surfaces, each has its own path, in float64.
//!
//! Neglected: interpolation, whose error the upsampling is chosen for (`error_db`), and what tiles' polynomials leave out, which is bounded
//! for each tile and batch of pulses. Each pulse's own positions and frequencies are used, so any track will do.
//!
//! **Motion from sample to sample** ([`subaperture_model::phase_history::Sweep`], whose terms these are) shifts a pixel's range
//! profile by `f_c r' / step`, which is added to the range that is read, and blurs it by the phase
//! `2 pi q d^2`, `q = (step r' + f_c r'' / 2) / c` turns, `d = k - K/2`. Profiles are made for even steps of `q` and read
//! linearly between the two nearest: the error of a sample at the band's edge is `h^2 / sqrt(120)`, `h` the step
//! there in radians. The term in `d^3` is neglected and predicted.
//!
//! Cost: some 35 operations a pixel and pulse, on as many numbers at once as the processor takes; one transform a
//! pulse; with motion from sample to sample several times as much, and a transform for each step of `q` (`cost`). Memory: a
//! block of upsampled profiles beside the image.
//!
//! Accuracy: the bound asked for, against [`crate::exact`], on the simulated and the recorded scenes of
//! the tests.

mod blurs;
mod choice;
mod cost;
mod sweeping;
mod tiles;

use std::ops::Range;

use glam::DVec3;
use serde_json::json;

use self::blurs::Blurs;
use self::choice::Shares;
use super::options::ERROR_DB;
use super::{Entry, of};
use crate::former::{chosen, misfit};
use crate::patch::{PatchSize, Patches};
use crate::read_ahead::BLOCKS_HELD;
use crate::{
    Aim, Asked, DEFAULT_ERROR_DB, Decision, FormError, Forming, ImageFormer, MARGIN_DB, Reason,
    Remedy, rounding,
};
use subaperture_kernels::tile::{self, MOST_DEGREE, Pieces};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Pulse;
use subaperture_signal::range_profile::RangeProfiler;

/// Pulses whose terms of a pixel are summed before they are added to it, if scratch has room for their profiles: a choice of
/// the plan, so that memory is no matter of bits.
const SUMMED_PULSES: usize = 64;
/// The same with motion from sample to sample, which takes many profiles a pulse.
const SUMMED_BLURRED: usize = 16;
/// Finest upsampling: float32 leaves no less than some -130 dB.
const MOST_OVERSAMPLING: f64 = 4096.0;
/// Pieces beyond a profile's ends, at most.
const MOST_MARGIN: usize = 1 << 18;
/// Of these sums, as many as are made at a time.
const MOST_PARTS: usize = 4;

/// Backprojection with upsampled range profiles.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Backprojection {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

/// What the points of a grid are.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Meaning {
    /// Places of what rests.
    Places,
    /// Velocities of what is at a place at a moment: metres a second where images have metres.
    Velocities { position_m: DVec3, epoch_s: f64 },
}

impl Meaning {
    /// Place and velocity at the moment of a pulse, metres and metres a second, for a point of the grid.
    fn target(&self, pulse: &Pulse, point: DVec3) -> (DVec3, DVec3) {
        match *self {
            Self::Places => (point, DVec3::ZERO),
            Self::Velocities {
                position_m,
                epoch_s,
            } => (position_m + point * (pulse.time_s - epoch_s), point),
        }
    }
}

impl Default for Backprojection {
    fn default() -> Self {
        Self {
            error_db: DEFAULT_ERROR_DB,
        }
    }
}

impl Backprojection {
    /// With this bound on the relative RMS error of the image, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db }
    }
}

/// In the list of formers.
pub(super) const ENTRY: Entry = Entry {
    name: "bp",
    summary: "backprojection: every pulse's range profile read at every pixel",
    options: &[ERROR_DB],
    of: of::<Backprojection>,
};

impl ImageFormer for Backprojection {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!(self)
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn follows_relief(&self) -> bool {
        true
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self { error_db }))
    }

    fn decide(&self, aim: &Aim, asked: &Asked, _: &dyn Monitor) -> Result<Decision, FormError> {
        decide(aim, self.error_db, asked, Meaning::Places)
    }

    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        open(aim, chosen(ENTRY.name, choices)?, Meaning::Places)
    }
}

/// What a plan fixes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    /// Of the splines that profiles are read as.
    degree: usize,
    /// Upsampling of range profiles.
    oversampling: f64,
    /// Pieces beyond a profile's ends.
    margin: usize,
    /// Pulses whose terms of a pixel are summed before they are added to it.
    summed_pulses: usize,
    way: Way,
}

/// How pixels' paths are come by.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum Way {
    /// Each by itself.
    Points,
    /// By polynomials over tiles of so many pixels a side, where they turn terms by no more than this RMS phase.
    Tiles { side: usize, phase_rad: f64 },
    /// Each by itself, with its rate: samples are taken one after another in motion.
    Blurs(Blurs),
}

/// Bytes of a pulse, as often as it is held, and of so many numbers made of it.
fn pulse_bytes(num_samples: usize, values: usize) -> u64 {
    (8 * BLOCKS_HELD * num_samples + 4 * values) as u64
}

/// Decides for a grid of this meaning.
pub(crate) fn decide(
    aim: &Aim,
    error_db: f64,
    asked: &Asked,
    meaning: Meaning,
) -> Result<Decision, FormError> {
    let collection = aim.collection;
    let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
    let shares = Shares::of(error_db);
    let swath = choice::swath(aim, meaning);
    let (choices, pixel_ns, way_error) = match collection.sweeps() {
        true => {
            let (choices, error) = sweeping::choose(aim, error_db - MARGIN_DB, meaning);
            (choices, aim.means.model.blurred_point_ns, error)
        }
        false => {
            let (choices, pixel_ns) = choice::choose(aim, &shares, swath.as_ref());
            (choices, pixel_ns, shares.of_way(aim, &choices))
        }
    };
    let profiler = RangeProfiler::new(
        choices.degree,
        &aim.weights.fast,
        choices.oversampling,
        aim.means.transforms,
    );
    let summed_pulses = choices.summed_pulses;
    let planned_db = rounding::total_db(&[
        profiler.error(),
        way_error,
        profiler.rounding(),
        // Sums over some pulses, and over these sums.
        rounding::sum(summed_pulses),
        rounding::sum(num_pulses.div_ceil(summed_pulses)),
        rounding::path_phase_rad(aim.collection, aim.grid),
    ]);
    asked.check(planned_db, || {
        Reason::new("float32 sums and profiles leave no less")
            .helped_by(&[Remedy::OtherFormer(&["exact"])])
    })?;
    let length = profiler.length();
    let pieces = choices.pieces(length, swath.as_ref());
    let (each, pulse_bytes) = match choices.way {
        Way::Blurs(blurs) => (
            blurs.count,
            sweeping::pulse_bytes(num_samples, &blurs, length),
        ),
        _ => (1, pulse_bytes(num_samples, pieces.values())),
    };
    let side = match choices.way {
        Way::Tiles { side, .. } => side,
        _ => 1,
    };
    Ok(Decision {
        choices: json!(choices),
        settings: json!({
            "profile_length": length,
            "oversampling": length as f64 / num_samples as f64,
            "spline_degree": choices.degree,
            "profiles_each": each,
            "pulses_a_sum": summed_pulses,
            "tile_pixels": side,
        }),
        planned_db,
        grain: Patches::new(aim.grid, PatchSize::square(side)).size(),
        cost: cost::cost(aim, &choices, &pieces, pixel_ns, pulse_bytes),
    })
}

/// Ready to form by `choices`.
pub(crate) fn open<'a>(
    aim: Aim<'a>,
    choices: Choices,
    meaning: Meaning,
) -> Result<Box<dyn Forming + 'a>, FormError> {
    choices.check(&aim)?;
    // Normalised here, before the transform sums: large samples stay within float32.
    let norm = aim.weights.normalisation();
    let window: Vec<f64> = aim.weights.fast.iter().map(|w| w * norm).collect();
    let profiler = RangeProfiler::new(
        choices.degree,
        &window,
        choices.oversampling,
        aim.means.transforms,
    );
    Ok(match choices.way {
        Way::Blurs(blurs) => Box::new(sweeping::Opened {
            profiler,
            aim,
            summed_pulses: choices.summed_pulses,
            blurs,
            meaning,
        }),
        _ => Box::new(tiles::Opened::new(aim, profiler, choices, meaning)),
    })
}

impl Choices {
    /// Refuses what no decision came to.
    fn check(&self, aim: &Aim) -> Result<(), FormError> {
        let num_samples = aim.collection.num_samples;
        let profiles = (1.0..=MOST_OVERSAMPLING).contains(&self.oversampling)
            && (1..=MOST_DEGREE).contains(&self.degree)
            && (1..=MOST_MARGIN).contains(&self.margin);
        let way = match self.way {
            _ if !profiles => false,
            Way::Points => true,
            Way::Tiles {
                side, phase_rad, ..
            } => {
                let length = RangeProfiler::length_for(num_samples, self.oversampling);
                aim.grid.is_raster()
                    && tile::DEGREES.contains(&self.degree)
                    && (1..=1024).contains(&side)
                    && phase_rad.is_finite()
                    && self.margin >= choice::margin(aim, side, length)
            }
            Way::Blurs(blurs) => self.degree == 1 && blurs.suit(num_samples),
        };
        let sums = (1..=SUMMED_PULSES).contains(&self.summed_pulses);
        match way && sums {
            true => Ok(()),
            false => Err(misfit(
                ENTRY.name,
                "its range profiles, tiles or sums are none",
            )),
        }
    }

    /// How the polynomials of profiles of `length` bins are laid out, for paths within a swath, if it is known.
    fn pieces(&self, length: usize, swath: Option<&Range<f64>>) -> Pieces {
        choice::pieces(self.degree, length, self.margin, swath)
    }
}
