//! Backprojection: interpolation of every pulse's range profile at the range of every pixel.
//!
//! ```text
//! I(p) = sum_n w_slow[n] exp(+j 2 pi f_c r_n(p) / c) profile_n(r_n(p)),   r_n(p) = path_n(p) - reference_path_n
//! ```
//!
//! (Schone 2020, chapter 2 and 5.1), where `f_c` is the frequency of sample `K/2`. Profiles are upsampled
//! by zero padding, pre-emphasised for spline interpolation ([`RangeProfiler`]), and stored in float32. Degree and upsampling are chosen together as the
//! fastest combination that keeps the bound (`choice`).
//!
//! Pixels of a Cartesian grid are formed in tiles ([`subaperture_kernels::tile`]) with paths approximated by cubic polynomials.
//! Tiles are as large as a tenth of the error power allows. Each pixel has its own path in float64 where antennas are too close for a tile, on polar grids,
//! and on surfaces.
//!
//! Neglected: interpolation error, which the upsampling limits (`error_db`), and the error of path polynomials, which is bounded
//! for each tile and batch of pulses. Positions and frequencies are those of each pulse, so any track is supported.
//!
//! **Intra-pulse motion** (terms as in [`subaperture_model::phase_history::Sweep`]) shifts the range profile of a pixel
//! by `f_c r' / step`, which is added to the interpolated range, and smears it by the phase
//! `2 pi q d^2` with `q = (step r' + f_c r'' / 2) / c` turns and `d = k - K/2`. Profiles are computed for even steps of `q` and interpolated
//! linearly between the two nearest: the error of a sample at the band edge is `h^2 / sqrt(120)`, where `h` is the step
//! there in radians. The term in `d^3` is replaced by its regression on `d`; pulses are divided into parts where the rest would exceed the bound
//! (`parts`), and it is included in the prediction.
//!
//! Cost: about 35 operations per pixel and pulse, vectorised; one transform per
//! pulse. Intra-pulse motion takes several times as much, and a transform for each step of `q` (`cost`). Memory: a
//! block of upsampled profiles in addition to the image.
//!
//! Accuracy: the requested bound, against [`crate::exact`], on the simulated and recorded scenes of
//! the tests.

mod blurs;
mod choice;
mod choices;
mod cost;
mod on_device;
mod parts;
mod sweeping;
mod tiles;

use std::ops::Range;

use serde_json::json;

use self::choice::Shares;
use self::parts::PulseParts;
use super::Entry;
use super::algorithm::Algorithm;
use super::error_bound::error_bound;
use super::options::ERROR_DB;
use crate::compared::SWATH;
use crate::former_choices::misfit;
use crate::patch::{PatchSize, Patches};
use crate::{
    Decision, ErrorGoal, FormError, Forming, GridPoints, ImageSpec, MARGIN_DB, Reason, Remedy,
    rounding,
};
use subaperture_kernels::tile::{self, MAX_DEGREE, Pieces};
use subaperture_model::monitor::Monitor;
use subaperture_signal::range_profile::RangeProfiler;

pub(crate) use choices::Choices;
use choices::{
    MAX_MARGIN, MAX_OVERSAMPLING, MAX_PARTS, PixelPaths, SUMMED_BLURRED, SUMMED_PULSES, pulse_bytes,
};

/// Backprojection with upsampled range profiles.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Backprojection {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

error_bound!(Backprojection {});

impl Algorithm for Backprojection {
    const ENTRY: Entry = Entry::new::<Self>(
        "bp",
        "backprojection: every pulse's range profile interpolated at every pixel",
        &[ERROR_DB],
    );

    const FOLLOWS_RELIEF: bool = true;

    type Choices = Choices;

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision<Choices>, FormError> {
        decide(spec, self.error_db, goal, GridPoints::Positions)
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        open(spec, choices, GridPoints::Positions)
    }
}

/// Decide on a plan for a grid of positions or velocities.
pub(crate) fn decide(
    spec: &ImageSpec,
    error_db: f64,
    goal: &ErrorGoal,
    grid_points: GridPoints,
) -> Result<Decision<Choices>, FormError> {
    let collection = spec.collection;
    let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
    let shares = Shares::of(error_db);
    let swath = choice::swath(spec, grid_points);
    let mut motion_error = 0.0;
    let (choices, pixel_ns, path_error) = match collection.sweeps() {
        true => {
            let (choices, errors) = sweeping::choose(spec, error_db - MARGIN_DB, grid_points);
            motion_error = errors[1];
            let pixel_ns = spec.numerics.model.blurred_point_ns * choices.num_parts() as f64;
            (choices, pixel_ns, libm::hypot(errors[0], errors[1]))
        }
        false => {
            let (choices, pixel_ns) = choice::choose(spec, &shares, swath.as_ref());
            (choices, pixel_ns, shares.of_paths(spec, &choices))
        }
    };
    let parts = PulseParts::new(&spec.weights.fast, choices.num_parts());
    // All parts have profiles of the same length.
    let profiler = RangeProfiler::new(
        choices.degree,
        parts.window(0),
        choices.oversampling,
        spec.numerics.transforms,
    );
    let summed_pulses = choices.summed_pulses;
    let planned_db = rounding::total_db(&[
        profiler.error(),
        path_error,
        profiler.rounding(),
        // Sums over blocks of pulses, and over these sums.
        rounding::sum(summed_pulses * choices.num_parts()),
        rounding::sum(num_pulses.div_ceil(summed_pulses)),
        rounding::path_phase_rad(spec.collection, spec.grid),
    ]);
    goal.check(planned_db, || {
        let motion = 20.0 * libm::log10(motion_error) > planned_db - 3.0;
        Reason::new(match motion {
            true => "the antennas accelerate too much within a pulse",
            false => "the rounding of float32 sums and profiles limits the error",
        })
        .helped_by(&[Remedy::OtherFormer(&["exact"])])
    })?;
    let length = profiler.length();
    let pieces = choices.pieces(length, swath.as_ref());
    let (each, pulse_bytes) = match choices.paths {
        PixelPaths::Blurs(blurs) => (
            blurs.count * blurs.parts,
            sweeping::pulse_bytes(num_samples, &blurs, length),
        ),
        _ => (1, pulse_bytes(num_samples, pieces.values())),
    };
    let side = match choices.paths {
        PixelPaths::Tiles { side, .. } => side,
        _ => 1,
    };
    let mut settings = json!({
            "profile_length": length,
            "oversampling": length as f64 / parts.width() as f64,
            "spline_degree": choices.degree,
            "profiles_each": each,
            "pulses_a_sum": summed_pulses,
            "tile_pixels": side,
            "stray_from": SWATH,
    });
    if let PixelPaths::Blurs(blurs) = choices.paths {
        settings["pulse_parts"] = blurs.parts.into();
    }
    let mut pixel_ns = pixel_ns;
    if let (Some(device), PixelPaths::Tiles { .. }) = (spec.numerics.device, choices.paths) {
        settings["device"] = device.name().into();
        // Costs are times of one core of the processor.
        pixel_ns = device.pixel_ns() * rayon::current_num_threads() as f64;
    }
    Ok(Decision {
        choices,
        settings,
        planned_db,
        grain: Patches::new(spec.grid, PatchSize::square(side)).size(),
        cost: cost::cost(spec, &choices, &pieces, pixel_ns, pulse_bytes),
    })
}

/// Open a plan for forming.
pub(crate) fn open<'a>(
    spec: ImageSpec<'a>,
    choices: Choices,
    grid_points: GridPoints,
) -> Result<Box<dyn Forming + 'a>, FormError> {
    choices.check(&spec)?;
    // Normalise before the transform sums, so that large samples stay within float32.
    let norm = spec.weights.normalisation();
    let window: Vec<f64> = spec.weights.fast.iter().map(|w| w * norm).collect();
    if let PixelPaths::Blurs(blurs) = choices.paths {
        let opened = sweeping::Opened::new(spec, &choices, blurs, &window, grid_points);
        return Ok(Box::new(opened));
    }
    let profiler = RangeProfiler::new(
        choices.degree,
        &window,
        choices.oversampling,
        spec.numerics.transforms,
    );
    Ok(Box::new(tiles::Opened::new(
        spec,
        profiler,
        choices,
        grid_points,
    )))
}

impl Choices {
    /// Parts of a pulse.
    fn num_parts(&self) -> usize {
        match self.paths {
            PixelPaths::Blurs(blurs) => blurs.parts,
            _ => 1,
        }
    }

    /// Refuse choices that no decision can have made.
    fn check(&self, spec: &ImageSpec) -> Result<(), FormError> {
        let num_samples = spec.collection.num_samples;
        let profiles = (1.0..=MAX_OVERSAMPLING).contains(&self.oversampling)
            && (1..=MAX_DEGREE).contains(&self.degree)
            && (1..=MAX_MARGIN).contains(&self.margin);
        let valid_paths = match self.paths {
            _ if !profiles => false,
            PixelPaths::Points => true,
            PixelPaths::Tiles {
                side, phase_rad, ..
            } => {
                let length = RangeProfiler::length_for(num_samples, self.oversampling);
                spec.grid.is_raster()
                    && tile::DEGREES.contains(&self.degree)
                    && (1..=1024).contains(&side)
                    && phase_rad.is_finite()
                    && self.margin >= choice::margin(spec, side, length)
            }
            PixelPaths::Blurs(blurs) => self.degree == 1 && blurs.suit(num_samples),
        };
        let sums = (1..=SUMMED_PULSES).contains(&self.summed_pulses);
        match valid_paths && sums {
            true => Ok(()),
            false => Err(misfit(
                Backprojection::ENTRY.name,
                "expected sizes of range profiles, tiles and sums within their limits",
            )),
        }
    }

    /// Layout of the spline intervals of profiles of `length` bins, for paths within an optional swath.
    fn pieces(&self, length: usize, swath: Option<&Range<f64>>) -> Pieces {
        choice::pieces(self.degree, length, self.margin, swath)
    }
}
