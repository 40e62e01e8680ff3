//! Range-Doppler algorithm for straight tracks.
//!
//! The range wavenumber `kr = sqrt(kappa^2 - kx^2)` of a sample ([`crate::frequency_domain`]) is expanded about the
//! carrier `kappa_c` (that of sample `K/2`), with `D = sqrt(1 - kx^2 / kappa_c^2)` the cosine of the
//! angle off broadside:
//!
//! ```text
//! kr = kappa_c D + (kappa - kappa_c) / D - kx^2 (kappa - kappa_c)^2 / (2 kappa_c^3 D^3) + ...
//! I(x, r) = sum over kx of exp(j kx x) exp(j r kappa_c D) g(r / D; kx)
//! g(rho; kx) = sum_k F[k][kx] exp(j rho (kappa_k - kappa_c))
//! ```
//!
//! (Cumming and Wong 2005, chapter 6.) In that order: slow-time transform, secondary
//! range compression, transform over frequency (range compression), interpolation at `r /
//! D` (range cell migration correction, hyperbolic), azimuth filter `exp(j r kappa_c
//! D)` at the range of each sample, and inverse transform. Chim 2018 3.1.1 replaces `1 /
//! D` by the parabola `1 + (lambda fx)^2 / 8`; his (3.5) gives that as phase with the wrong signs: `D = 1 - (lambda
//! fx)^2 / 8 - (lambda fx)^4 / 128 - ...`, and `fx` there is `2 x / (lambda R_0)`.
//!
//! **Secondary range compression** multiplies the two-dimensional spectrum by `exp(j r_ref (kr - kappa_c
//! D - (kappa - kappa_c) / D))`: all terms from the second order on, exact at the centre of the swath. Without
//! it the second-order term defocuses range by about `2 r (kx / kappa_c)^2 (pi B / c)^2 / kappa_c` radians at
//! the band edges, which grows with the square of squint and bandwidth. With it, `r - r_ref` replaces
//! `r`.
//!
//! **Neglected**: these terms multiplied by `(r - r_ref)`. They are included in the prediction ([`crate::frequency_domain`]), at
//! the ends of the swath and between. All other steps are those of [`crate::omega_k`] with the same accuracy: amplitudes, the
//! ends of the aperture, interpolation (-107 dB).
//!
//! **Assumptions**: a track near a straight line (compensation: [`crate::straight_track`], [`crate::frequency_domain`]), one band for all pulses, and a band narrow enough that
//! all directions propagate at `kappa_c`.
//!
//! Cost in addition to the common stages: `Q` transforms of `2 K`, 6 multiply-adds and a phasor for each of `Q R`
//! range bins.
//!
//! Accuracy, against [`crate::exact`] without windows (`tests/formers/frequency_domain.rs`), dB:
//!
//! | scene | with secondary compression (predicted) | without (predicted) |
//! |---|---|---|
//! | strip map, 5 GHz, 100 MHz, 240 m of track at 3 km, 110 x 120 m | -79 (-68) | -38 (-34) |
//! | Table 4.1 of Schone 2020, 80 x 80 m | -91 (-83) | not measured |
//! | rail of 1.6 m, 1.1 to 1.3 GHz, 6.5 to 11.5 m off | -50 (-32) | not measured |
//! | 40 degrees ahead, X band, 200 MHz, 2 km off the track, 32 x 32 m | -23 (-16) | +2 (+5): no image |
//!
//! Point positions of the first and third scene are accurate to 4e-5 of the resolution; widths agree with
//! `exact` to 2e-5, side lobes to 0.004 dB. For squint, use [`crate::omega_k`] at the same cost.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex32;
use serde_json::json;
use subaperture_fft::{Fft, Transforms};

use super::Entry;
use super::error_bound::error_bound;
use super::frequency_domain::{FrequencyDomain, observable};
use super::options::{ERROR_DB, FormerOption, OptionType};
use crate::cost::transform;
use crate::frequency_domain::{Axes, ImageAxis, RangeMethod, RangeStage, Sizes, Stage, TAPS};
use crate::sub_cpi::shared_band;
use crate::{FormError, Formed, Reason, Remedy, Task, TimeModel};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Band, Collection};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::phasor32;

/// Former by the range-Doppler algorithm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RangeDopplerAlgorithm {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Whether secondary range compression is applied.
    pub secondary_compression: bool,
}

error_bound!(RangeDopplerAlgorithm {
    secondary_compression: true
});

impl RangeDopplerAlgorithm {
    /// Enable or disable secondary range compression.
    #[must_use]
    pub fn secondary_compression(self, secondary_compression: bool) -> Self {
        Self {
            secondary_compression,
            ..self
        }
    }
}

const NO_SRC: FormerOption = FormerOption {
    name: "no_src",
    summary: "Leave out secondary range compression",
    takes: OptionType::Switch(false),
    default: "",
    at: &["secondary_compression"],
    with: None,
};

impl FrequencyDomain for RangeDopplerAlgorithm {
    const ENTRY: Entry = Entry::new::<Self>(
        "rda",
        "range-Doppler algorithm: nearly straight tracks, little migration",
        &[ERROR_DB, NO_SRC],
    );

    type Method = Expansion;

    fn method(&self, collection: &Collection) -> Result<Expansion, FormError> {
        Ok(Expansion {
            centre: centre_wavenumber(&shared_band(collection)?),
            secondary_compression: self.secondary_compression,
        })
    }

    fn limit(&self) -> Reason {
        Reason::new("range cell migration is corrected to the first order in frequency only")
            .helped_by(&[Remedy::OtherFormer(&["omega-k"]), Remedy::SmallerGrid])
    }

    fn summary(&self) -> serde_json::Value {
        json!({ "secondary_range_compression": self.secondary_compression })
    }
}

observable!(RangeDopplerAlgorithm);

fn centre_wavenumber(band: &Band) -> f64 {
    2.0 * TAU * band.centre_hz() / SPEED_OF_LIGHT_M_S
}

/// Range wavenumber to first order in frequency.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expansion {
    /// Carrier wavenumber `kappa_c`, rad/m.
    centre: f64,
    secondary_compression: bool,
}

impl Expansion {
    /// Cosine `D` of the angle off broadside.
    fn cosine(&self, kx: f64) -> f64 {
        (1.0 - (kx / self.centre).powi(2)).sqrt()
    }

    /// Terms from the second order on, rad/m.
    fn higher_terms(&self, kappa: f64, kx: f64) -> f64 {
        (kappa * kappa - kx * kx).sqrt() - self.range_wavenumber(kappa, kx)
    }
}

impl RangeMethod for Expansion {
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64 {
        let cosine = self.cosine(kx);
        self.centre * cosine + (kappa - self.centre) / cosine
    }

    fn phase_rad(&self, kappa: f64, kx: f64, range_m: f64, reference_m: f64) -> f64 {
        let compressed_rad = match self.secondary_compression {
            true => reference_m * self.higher_terms(kappa, kx),
            false => 0.0,
        };
        range_m * self.range_wavenumber(kappa, kx) + compressed_rad
    }

    /// Range compression by transforms of `2 K`; migration correction and azimuth filter of each bin: 6 taps, weights and a phasor.
    fn operations(&self, samples: usize, sizes: &Sizes) -> f64 {
        let wavenumbers = sizes.along_wavenumbers as f64;
        wavenumbers * (transform(2.0 * samples as f64) + 44.0 * sizes.ranges as f64)
    }

    fn time_ns(&self, model: &TimeModel, samples: usize, sizes: &Sizes) -> f64 {
        let bin = model.phasor_ns + model.raster_tap_ns * TAPS as f64;
        let line = model.transform(2.0 * samples as f64) + bin * sizes.ranges as f64;
        sizes.along_wavenumbers as f64 * line
    }

    fn stage(&self, axes: &Axes, transforms: Transforms) -> Box<dyn RangeStage> {
        Box::new(RangeDopplerStage::new(*self, axes, transforms))
    }
}

/// Range compression, migration correction and azimuth filter for one along-track wavenumber.
struct RangeDopplerStage {
    expansion: Expansion,
    reference_range_m: f64,
    range: ImageAxis,
    /// Step of `kappa`, rad/m, which determines the period of the profiles in two-way range.
    step: f64,
    kernel: KaiserBessel,
    /// Inverse roll-off `1 / Phi` of each frequency.
    roll_off: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
}

impl RangeDopplerStage {
    fn new(expansion: Expansion, axes: &Axes, transforms: Transforms) -> Self {
        let kernel = KaiserBessel::new(TAPS);
        let count = axes.wavenumbers.len();
        let length = fast_length((2 * count).max(TAPS));
        let step = match axes.wavenumbers[..] {
            [first, .., last] => (last - first) / (count as f64 - 1.0),
            _ => 0.0,
        };
        Self {
            expansion,
            reference_range_m: axes.reference_range_m(),
            range: axes.range,
            step,
            roll_off: kernel.emphasis(count, length),
            kernel,
            fft: transforms.inverse(length),
        }
    }
}

impl RangeStage for RangeDopplerStage {
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64 {
        self.expansion.range_wavenumber(kappa, kx)
    }

    fn phase_rad(&self, kappa: f64, kx: f64) -> f64 {
        if self.expansion.secondary_compression {
            self.reference_range_m * self.expansion.higher_terms(kappa, kx)
        } else {
            0.0
        }
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
        let (profile, scratch) = scratch.split_at_mut(length);
        profile.fill(Complex32::ZERO);
        let half = samples.len() / 2;
        for (k, (sample, roll_off)) in samples.iter().zip(&self.roll_off).enumerate() {
            profile[(k + length - half) % length] = sample * roll_off;
        }
        self.fft.process_with_scratch(profile, scratch);

        let cosine = self.expansion.cosine(kx);
        if cosine.is_nan() {
            // No recorded frequency propagates in that direction: the samples have no weight.
            out.fill(Complex32::ZERO);
            return;
        }
        let azimuth = self.expansion.centre * cosine - self.range.carrier;
        for (j, value) in out.iter_mut().enumerate() {
            let range_m = self.range.at(j);
            let turns = range_m / cosine * self.step / TAU;
            let place = (turns - turns.floor()) * length as f64;
            let whole = place.floor();
            let weights = self.kernel.weights::<TAPS>((place - whole) as f32);
            let first = whole as usize + length + 1 - TAPS / 2;
            let read = weights.into_iter().enumerate();
            let sum: Complex32 = read.map(|(i, w)| profile[(first + i) % length] * w).sum();
            *value = phasor32(range_m * azimuth / TAU) * sum;
        }
    }
}
