//! Cross-check of core and host maps with the defining float64 sum, for every sub-CPI.
//!
//! - The core's stream processor in float32 and in fixed point, as the firmware runs it: pulses and samples as sent over the
//!   link ([`crate::link::Job`]), 16-bit ones scaled once for the whole recording, maps in block floating point. One patch, a
//!   quarter of the way into the scene, whose map contains all power of a sub-CPI.
//! - The host's `rdbp` maps, as the former makes and interpolates them: the image of one sub-CPI, from one map per patch.
//!
//! The sums are written out in float64 (`crosscheck/plain.rs`) and share no signal code with either. The measure is the
//! relative RMS error over a map or an image.
//!
//! | | bound | neglects |
//! |---|---|---|
//! | core, float32 | [`FLOAT_DB`] | nothing |
//! | core, fixed point | [`FIXED_DB`] | rounding: of samples to 16 bits, of the maps' mantissas |
//! | `rdbp` | prediction of its plan, plus the margin of 4 dB | path curvature across a patch, interpolation kernels |
//!
//! **Float32.** On Table 4.1 the error is -123 dB with 40 pulses per sub-CPI, -114 dB with 131, and -102 dB with 520 and 1040:
//! the phasors of the Doppler transform are rotated from pulse to pulse and accumulate rounding errors.
//!
//! **Fixed point.** Samples at `-30 dB` RMS of full scale, typical for a recording scaled to its largest sample, have a rounding
//! error of -68 dB, maps of -74 to -85 dB (`tests/stream/fixed.rs`). A sub-CPI more than 38 dB RMS below the recording's largest
//! sample cannot keep -60 dB in 16 bits with any arithmetic: see [`SubCpi::sample_rounding_db`].

mod images;
mod measure;
mod plain;
mod streaming;

use std::ops::Range;

use num_complex::Complex32;
use subaperture_core::link::Encoding;
use subaperture_core::stream::{Patch, Setup};

pub use self::images::Image;
use self::streaming::Core;
use subaperture_focus::budget::Budget;
use subaperture_focus::{FormError, Remedy};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_model::resolution::survey::default_grid::scene_grid;
use subaperture_signal::window::Window;

/// Maximum relative RMS error of a map in float32, in dB.
pub const FLOAT_DB: f64 = -100.0;

/// Maximum relative RMS error of a map in fixed point, in dB.
pub const FIXED_DB: f64 = -60.0;

/// Default number of pulses per sub-CPI.
pub const SUB_CPI: usize = 40;

/// Maximum number of sub-CPIs compared, spread evenly from the first to the last.
pub const MAX_SUB_CPIS: usize = 64;

/// Result for one sub-CPI.
#[derive(Clone, Debug, PartialEq)]
pub struct SubCpi {
    /// Number of the sub-CPI.
    pub index: usize,
    /// Range of its pulses.
    pub pulses: Range<usize>,
    /// Relative RMS error of the core's map in float32, in dB; negative infinity if it is zero.
    pub float_db: f64,
    /// Relative RMS error of the core's map in fixed point, including rounding of samples to 16 bits, in dB.
    pub fixed_db: f64,
    /// Relative RMS error from rounding of samples to 16 bits alone, in dB.
    pub sample_rounding_db: f64,
    /// Result for the host's maps in the image of the sub-CPI; `None` if the recording has no grid ([`Report::no_image`]).
    pub image: Option<Image>,
}

/// Results of a cross-check.
#[derive(Clone, Debug)]
pub struct Report {
    /// Dimensions of the core's maps.
    pub setup: Setup,
    /// Patch of the maps.
    pub patch: Patch,
    /// Number of sub-CPIs in the recording.
    pub num_sub_cpis: usize,
    /// Compared sub-CPIs; at least one.
    pub sub_cpis: Vec<SubCpi>,
    /// Pixel grid of the images.
    pub grid: Option<ImageGrid>,
    /// Reason why no images were compared.
    pub no_image: Option<String>,
}

impl Report {
    /// Sub-CPI with the largest value.
    fn worst(&self, value: impl Fn(&SubCpi) -> f64) -> &SubCpi {
        self.sub_cpis
            .iter()
            .max_by(|a, b| value(a).total_cmp(&value(b)))
            .expect("there is at least one sub-CPI")
    }

    /// Sub-CPI with the largest error in float32.
    pub fn worst_float(&self) -> &SubCpi {
        self.worst(|sub_cpi| sub_cpi.float_db)
    }

    /// Sub-CPI with the largest error in fixed point.
    pub fn worst_fixed(&self) -> &SubCpi {
        self.worst(|sub_cpi| sub_cpi.fixed_db)
    }

    /// Sub-CPI whose image has the least margin to its bound, or exceeds it most.
    pub fn worst_image(&self) -> Option<(&SubCpi, Image)> {
        let over_db = |sub_cpi: &SubCpi| match sub_cpi.image {
            Some(image) => image.error_db - image.bound_db(),
            None => f64::NEG_INFINITY,
        };
        let worst = self.worst(over_db);
        worst.image.map(|image| (worst, image))
    }

    /// Whether every error is within its bound.
    pub fn passes(&self) -> bool {
        self.sub_cpis.iter().all(|sub_cpi| {
            sub_cpi.float_db <= FLOAT_DB
                && sub_cpi.fixed_db <= FIXED_DB
                && sub_cpi.image.is_none_or(|image| image.within())
        })
    }
}

/// Compare sub-CPIs of `sub_cpi` pulses; the last one has the remainder.
///
/// # Errors
/// [`FormError::Unsuited`] if the pulses do not share one frequency band or exceed the core's maximum sizes;
/// [`FormError::Memory`]; [`FormError::Read`]; [`FormError::Cancelled`].
pub fn crosscheck(
    history: &dyn PhaseHistory,
    sub_cpi: usize,
    memory_bytes: u64,
    monitor: &dyn Monitor,
) -> Result<Report, FormError> {
    let collection = history.collection();
    let band = collection.band().ok_or_else(|| {
        FormError::unsuited(
            "frequency axis changes from pulse to pulse: expected one band".to_owned(),
        )
    })?;
    let total = collection.pulses.len();
    let num_pulses = sub_cpi.min(total);
    if num_pulses == 0 || band.count == 0 {
        return Err(FormError::unsuited(
            "sub-CPI length: expected at least one pulse with one sample".to_owned(),
        ));
    }
    let (grid, no_image) = match scene_grid(history) {
        Ok(grid) => (Some(grid), None),
        Err(none) => (None, Some(none.to_string())),
    };
    // Away from the middle, which phases may already be referenced to.
    let centre_m = grid.as_ref().map_or([0.0; 3], |grid| {
        let quarter = [grid.rows.count / 4, grid.columns.count / 4];
        grid.position_m(quarter[0], quarter[1]).to_array()
    });
    let grid = grid.as_ref().map(images::middle);
    let (setup, patch) = streaming::sizes(&band, num_pulses, centre_m)?;
    let image_bytes = take_memory(history, (&setup, &patch), grid.as_ref(), memory_bytes)?;

    let weights = Weights::new(collection, Window::Hamming, Window::Hamming);
    let sum: f64 = weights.fast.iter().sum();
    let fast: Vec<f32> = weights.fast.iter().map(|w| (w / sum) as f32).collect();
    // The core's weights after rounding to float32.
    let plain_fast: Vec<f64> = fast.iter().map(|&w| f64::from(w)).collect();
    let plain_slow: Vec<f64> = weights.slow.iter().map(|&w| f64::from(w as f32)).collect();
    let core = |encoding| {
        let weights = (&fast[..], &weights.slow[..]);
        Core::new(history, (&setup, &patch), weights, encoding)
    };
    let (mut float, mut fixed) = (core(Encoding::Complex32)?, core(Encoding::Sc16)?);

    let num_sub_cpis = total.div_ceil(num_pulses);
    let chosen = num_sub_cpis.min(MAX_SUB_CPIS);
    let mut sub_cpis = Vec::with_capacity(chosen);
    let mut samples = Vec::new();
    for i in 0..chosen {
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        let index = match chosen {
            1 => 0,
            _ => i * (num_sub_cpis - 1) / (chosen - 1),
        };
        let pulses = index * num_pulses..total.min((index + 1) * num_pulses);
        samples.clear();
        samples.resize(pulses.len() * band.count, Complex32::ZERO);
        history.read(pulses.clone(), &mut samples)?;
        let expected = plain::map(
            &setup,
            &patch,
            (&plain_fast, &plain_slow[pulses.clone()]),
            &collection.pulses[pulses.clone()],
            &samples,
        );
        let number = index as u32;
        let image = match &grid {
            None => None,
            Some(grid) => {
                let pulses = pulses.clone();
                let of = images::compare(history, pulses, &samples, grid, &weights, image_bytes);
                Some(of?)
            }
        };
        sub_cpis.push(SubCpi {
            index,
            pulses,
            float_db: float.error_db(number, &expected)?,
            fixed_db: fixed.error_db(number, &expected)?,
            sample_rounding_db: fixed.rounding_db(&samples),
            image,
        });
        monitor.progress((i + 1) as f64 / chosen as f64);
    }
    Ok(Report {
        setup,
        patch,
        num_sub_cpis,
        sub_cpis,
        grid,
        no_image,
    })
}

/// Check that the memory limit is sufficient for the recording, the core in both arithmetics and the sums. Returns the part for
/// the recording and an image.
fn take_memory(
    history: &dyn PhaseHistory,
    (setup, patch): (&Setup, &Patch),
    grid: Option<&ImageGrid>,
    memory_bytes: u64,
) -> Result<u64, FormError> {
    let mut budget = Budget::new(memory_bytes);
    let held_bytes = u128::from(history.held_bytes());
    budget.take("the recording", held_bytes, &[Remedy::MoreMemory])?;
    let remedies = &[Remedy::Smaller(&["sub_cpi"]), Remedy::MoreMemory];
    let frequencies = u128::from(setup.num_frequencies);
    // Bytes per cell: the core's map buffer, link encoding and complex numbers, in float32 (8 each) and fixed point (5, 5 and 8),
    // both in float64 (16), and the sum (16 plus one row).
    let cells =
        patch.num_doppler_bins() as u128 * patch.num_range_bins().max(frequencies as usize) as u128;
    // Bytes per sample: two stores, as read and compensated, in 32 and 16 bits; two blocks of 64 pulses.
    let samples = u128::from(setup.num_pulses) * frequencies;
    let needed = 80 * cells + 48 * samples + 2 * 64 * 16 * frequencies;
    budget.take("a sub-CPI's maps", needed, remedies)?;
    // Sort order of the pixels.
    let pixels = grid.map_or(0, ImageGrid::num_pixels);
    budget.take("the pixels' order", 16 * u128::from(pixels), remedies)?;
    Ok(budget.left_bytes() + history.held_bytes())
}

#[cfg(test)]
mod tests;
