//! Range migration algorithm (omega-K): mapping of the two-dimensional spectrum from `(kappa, kx)` to `(kr,
//! kx)`.
//!
//! ```text
//! I(x, r) = sum over kx of exp(j kx x) sum_k F[k][kx] exp(j r kr),   kr = sqrt(kappa_k^2 - kx^2)
//! ```
//!
//! where `F` is the spectrum times the amplitude of the reference ([`crate::frequency_domain`]; Cumming and Wong 2005,
//! chapter 8; Chim 2018, 3.1.2). In Chim (3.8) to (3.10) the root has `c fx / 4`; it is `c^2 fx^2 / 4`,
//! and its sign is that of his receiver, opposite to ours.
//!
//! **Stolt mapping.** The sum over `k` has unevenly spaced `kr`. Interpolation would assume a smooth spectrum
//! and need the Jacobian. Instead each sample is gridded: it is phase-rotated to the
//! reference range at the swath centre by `exp(j r_ref (kr - kr_0))`, added to an even grid of `kr`
//! with a Kaiser-Bessel kernel of 6 taps, and the roll-off of the kernel is divided out of the image over
//! range. This evaluates the sum to -107 dB: samples count as in `exact`, including range side lobes and
//! the periodicity of a sampled band.
//!
//! **Assumptions**: a track near a straight line (compensation: [`crate::straight_track`], [`crate::frequency_domain`]) and one band for all pulses; the residual error of deviations is
//! included in the prediction ([`crate::frequency_domain`]). Squint and aperture are limited to 80 degrees off broadside, less where the
//! nearest range is a few wavelengths: the tapers of the band of directions take `8.5 / sqrt(kappa r)` in sine.
//! The swath is not limited; memory and padding grow with the farthest range times the tangent of the
//! steepest angle.
//!
//! **Neglected**: terms of the stationary-phase correction from the fourth on ([`crate::frequency_domain`]). Rounding
//! of float32 sums: about -110 dB.
//!
//! Cost in addition to the common stages: 6 complex multiply-adds and a phasor for each of `K Q` samples, `Q`
//! transforms of `2 R`.
//!
//! Accuracy, against [`crate::exact`] without windows (`tests/formers/frequency_domain.rs`):
//!
//! | scene | error, dB |
//! |---|---|
//! | strip map, 5 GHz, 100 MHz, 240 m of track at 3 km, 110 x 120 m | -104 |
//! | Table 4.1 of Schone 2020, 80 x 80 m | -104 |
//! | one scatterer alone in a corner of that | -105 |
//! | the same strip map with 3 m from pulse to pulse, its ambiguities inside the scene | -106 |
//! | 40 degrees ahead, X band, 200 MHz, 2 km off the track | -109 |
//! | rail of 1.6 m, 1.1 to 1.3 GHz, 6.5 to 11.5 m off | -89 |
//!
//! Point positions are accurate to 1e-5 of the resolution; widths agree with `exact` to 2e-5 and
//! side lobes to 0.002 dB.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::Entry;
use super::error_bound::error_bound;
use super::frequency_domain::{FrequencyDomain, observable};
use super::options::ERROR_DB;
use crate::cost::transform;
use crate::frequency_domain::{Axes, ImageAxis, RangeMethod, RangeStage, Sizes, Stage, TAPS};
use crate::{FormError, Formed, Reason, Remedy, Task, TimeModel};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Former by the range migration algorithm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OmegaK {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

error_bound!(OmegaK {});

impl FrequencyDomain for OmegaK {
    const ENTRY: Entry =
        Entry::new::<Self>("omega-k", "omega-k: nearly straight tracks", &[ERROR_DB]);

    type Method = Stolt;

    fn method(&self, _: &Collection) -> Result<Stolt, FormError> {
        Ok(Stolt)
    }

    fn limit(&self) -> Reason {
        Reason::new(
            "pixels are seen at such steep angles, or from so few wavelengths away, that the edges of the angular spectrum ring",
        )
        .helped_by(&[Remedy::OtherFormer(&["rdbp", "bp"]), Remedy::FartherGrid])
    }
}

observable!(OmegaK);

/// Exact range wavenumber of a sample.
pub(crate) struct Stolt;

impl RangeMethod for Stolt {
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64 {
        (kappa * kappa - kx * kx).sqrt()
    }

    fn phase_rad(&self, kappa: f64, kx: f64, range_m: f64, _reference_m: f64) -> f64 {
        range_m * self.range_wavenumber(kappa, kx)
    }

    /// Each sample is gridded onto 6 cells with weights and a phasor; transforms of `2 R`.
    fn operations(&self, samples: usize, sizes: &Sizes) -> f64 {
        let wavenumbers = sizes.along_wavenumbers as f64;
        wavenumbers * (transform(2.0 * sizes.ranges as f64) + 44.0 * samples as f64)
    }

    fn time_ns(&self, model: &TimeModel, samples: usize, sizes: &Sizes) -> f64 {
        let spreading = model.raster_tap_ns * (TAPS * samples) as f64;
        let line = model.transform(2.0 * sizes.ranges as f64) + spreading;
        sizes.along_wavenumbers as f64 * line
    }

    fn stage(&self, axes: &Axes, transforms: Transforms) -> Box<dyn RangeStage> {
        Box::new(Spreader::new(axes, transforms))
    }
}

/// Gridding of samples onto evenly spaced range wavenumbers.
struct Spreader {
    wavenumbers: Vec<f64>,
    range: ImageAxis,
    /// Step of the grid, rad/m.
    step: f64,
    kernel: KaiserBessel,
    /// Inverse roll-off `1 / Phi` of each range bin.
    roll_off: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
}

impl Spreader {
    fn new(axes: &Axes, transforms: Transforms) -> Self {
        let kernel = KaiserBessel::new(TAPS);
        let count = axes.range.count;
        let length = fast_length(2 * count);
        Self {
            wavenumbers: axes.wavenumbers.clone(),
            range: axes.range,
            step: TAU / (length as f64 * axes.range.step_m),
            roll_off: kernel.emphasis(count, length),
            kernel,
            fft: transforms.inverse(length),
        }
    }
}

impl RangeStage for Spreader {
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64 {
        Stolt.range_wavenumber(kappa, kx)
    }

    fn phase_rad(&self, kappa: f64, kx: f64) -> f64 {
        let middle_m = self.range.at(self.range.count / 2);
        middle_m * (Stolt.range_wavenumber(kappa, kx) - self.range.carrier)
    }

    fn scratch_length(&self) -> usize {
        self.fft.len() + self.fft.get_inplace_scratch_len()
    }

    fn ranges(
        &self,
        kx: f64,
        samples: &[Complex32],
        out: &mut [Complex32],
        scratch: &mut [Complex32],
    ) {
        let length = self.fft.len();
        let (grid, scratch) = scratch.split_at_mut(length);
        grid.fill(Complex32::ZERO);
        for (sample, &kappa) in samples.iter().zip(&self.wavenumbers) {
            // Directions that do not propagate have no weight.
            if *sample == Complex32::ZERO {
                continue;
            }
            let kr = Stolt.range_wavenumber(kappa, kx);
            let place = (kr - self.range.carrier) / self.step;
            let whole = place.floor();
            let weights = self.kernel.weights::<TAPS>((place - whole) as f32);
            for (i, weight) in (whole as i64 + 1 - TAPS as i64 / 2..).zip(weights) {
                grid[i.rem_euclid(length as i64) as usize] += sample * weight;
            }
        }
        self.fft.process_with_scratch(grid, scratch);
        let half = out.len() / 2;
        for (j, (value, roll_off)) in out.iter_mut().zip(&self.roll_off).enumerate() {
            *value = grid[(j + length - half) % length] * roll_off;
        }
    }
}
