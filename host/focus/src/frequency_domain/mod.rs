//! Common stages of the frequency-domain formers: from pulses on a straight track to the two-dimensional
//! spectrum, and from an image over along-track position and closest range to pixels.
//!
//! For a straight track ([`crate::straight_track`]) the sum computed by every former ([`super`]) is, for each
//! frequency, a correlation over slow time, `u = x - s_n`:
//!
//! ```text
//! I(x, r) = sum_k w_k sum_n v_n z[n][k] h_k(x - s_n; r),   h_k(u; r) = exp(+j kappa_k sqrt(r^2 + u^2)),
//! kappa_k = 4 pi f_k / c
//! ```
//!
//! with samples referred to path zero. With `Y_k(kx)` the transform of `v_n z[n][k]` over `s_n` and `H_k`
//! that of `h_k`, it is a product in `kx`. `H_k` has a closed form because the transform of `exp(j kappa R) / R` is a
//! Hankel function and differentiation by `kappa` removes the factor `1 / R`:
//!
//! ```text
//! H(kx; r) = -pi r (kappa / kr) H1(r kr),   kr = sqrt(kappa^2 - kx^2)
//!          = sqrt(2 pi j r) kappa kr^(-3/2) exp(j r kr) (1 + 3j / (8 r kr) + 15 / (128 (r kr)^2) + ...)
//! ```
//!
//! where `H1` is the Hankel function of the first kind and order 1. The factor before the bracket is the principle
//! of stationary phase (Cumming and Wong 2005, chapter 5), the bracket corrects its error: 3 / (8 r kr), -41 dB at
//! 1 m and 1 GHz, -89 dB at 1 km and 1 GHz. Its first three terms are used, at the centre of the swath
//! for each `(kappa, kx)` and for the range of the pixel with the `kr` of the carrier.
//!
//! Deviations of the track from the line are compensated in advance (`motion`).
//!
//! `kx` covers all directions in which a pixel is seen from a pulse, with a taper on either side
//! (`taper`). Pulses are zero-padded until no periodic image of the reference overlaps a pixel, so the
//! sum over slow time is linear rather than circular, and the ends of the aperture are exact. Where the directions
//! need more than `2 pi / spacing`, the spectrum is repeated periodically: azimuth ambiguities of
//! `exact` are equally present here.
//!
//! The formers differ in the transform from `(kappa, kx)` to `(r, kx)` (`RangeMethod`). Both image axes
//! are spaced at half of the Nyquist step, with carriers removed, and interpolated at the `(x,
//! r)` of every pixel with a Kaiser-Bessel kernel of 6 taps whose roll-off is divided out of the spectrum: -107 dB in
//! each axis. Any grid is supported: a pixel is its `(x, r)`, in the ground or slant plane.
//!
//! **Prediction** (`prediction`), before processing: the effective filter of the stages is evaluated for pulses,
//! frequencies and pixels throughout the grid and compared with the exact one, once for the residual of motion compensation and
//! once for the line with its ends, periodicity and the expansion of the method.
//!
//! Cost, with `N` pulses, `K` frequencies, `L` padded pulses, `Q` wavenumbers `kx`, `R` ranges: `K`
//! transforms of `L`, `R` of `2 Q`, about 40 operations per pixel, and the cost of the method (`cost`). Memory: `8 K (N + Q)`,
//! then `8 Q (K + R)` bytes, then `8 R (Q + X)` with `X` columns, whichever is the largest, and the image. With range-dependent
//! compensation the wavenumbers of the profiles replace `K`; with uneven pulse positions `L` is `2 Q`.

mod axes;
mod bounds;
mod choice;
mod cost;
mod fall;
mod method;
mod motion;
mod prediction;
mod read_out;
mod sizes;
mod spectrum;
mod stage;
mod strip;
mod taper;
mod taps;

use std::sync::{Arc, Mutex};

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::budget::Budget;
use super::read_ahead::BLOCKS_HELD;
use super::{FormError, Forming, ImageSpec, Remedy, Tile, Work};
use subaperture_model::monitor::during;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::{cis, narrow};

pub(super) use axes::{Axes, ImageAxis};
use choice::Fitted;
pub(super) use choice::{Choices, decide, sizes};
pub(super) use method::{RangeMethod, RangeStage};
use method::{stationary_phase_error, step_done};
pub use sizes::Sizes;
use spectrum::BLOCK_PULSES;
pub use stage::{Stage, StageKind};
pub(super) use strip::Strip;
pub(super) use taps::TAPS;

impl<'a, M: RangeMethod> Strip<'a, M> {
    /// Choose axes for `method` according to stored choices.
    ///
    /// # Errors
    /// [`FormError::Unsuited`], as for [`decide`].
    pub(super) fn new(spec: ImageSpec<'a>, method: M, choices: Choices) -> Result<Self, FormError> {
        let fitted = choice::chosen(&spec, &method, choices)?;
        Ok(Self {
            spec,
            method,
            fitted,
            image: Mutex::new(None),
        })
    }

    /// Form tiles as [`Forming::form`], and pass every intermediate array to `observe`.
    pub(super) fn form_observed(
        &self,
        work: &Work,
        tiles: &mut [Tile],
        observe: &mut dyn FnMut(&Stage),
    ) -> Result<(), FormError> {
        let mut kept = self.image.lock().unwrap_or_else(|held| held.into_inner());
        let image = match &*kept {
            Some(image) => image.clone(),
            None => {
                let image = Arc::new(self.focus(work, observe)?);
                kept.insert(image).clone()
            }
        };
        drop(kept);
        read_out::pixels(self, work, &image, tiles)
    }

    /// Compute the image over range and along-track position.
    fn focus(
        &self,
        work: &Work,
        observe: &mut dyn FnMut(&Stage),
    ) -> Result<Vec<Complex32>, FormError> {
        let Fitted { axes, motion, .. } = &self.fitted;
        let bytes = |rows: usize, columns: usize| 8 * rows as u128 * columns as u128;
        let (samples, ranges) = (axes.wavenumbers.len(), axes.range.count);
        let spectrum_bytes = bytes(samples, axes.num_bins);
        let range_bytes = bytes(axes.num_bins, ranges);
        let num_pulses = motion.positions.track.num_pulses;
        let steps = [
            bytes(samples, num_pulses) + spectrum_bytes,
            spectrum_bytes + range_bytes,
            range_bytes + bytes(ranges, axes.along.count),
        ];
        let remedies = &[
            Remedy::SmallerGrid,
            Remedy::OtherFormer(&["bp"]),
            Remedy::MoreMemory,
        ];
        let most = steps.into_iter().max().unwrap_or(0);
        let mut budget = Budget::new(work.memory_bytes);
        budget.take("the two-dimensional spectrum", most, remedies)?;
        let aside = motion.bytes() + self.reading_bytes();
        budget.take("motion compensation", aside, remedies)?;
        let stage = self.method.stage(axes, self.spec.numerics.transforms);
        let lengths = [
            3 * axes.slow_length,
            3 * axes.along_length,
            motion.scratch_length(self.fitted.wavenumbers.len()),
            samples + stage.scratch_length(),
        ];
        let longest = lengths.into_iter().max().unwrap_or(0);
        let threads = rayon::current_num_threads();
        budget.take("transforms", bytes(threads, longest), remedies)?;

        let spectrum = spectrum::along_track(self, work)?;
        observe(&Stage::new(axes, StageKind::Spectrum, &spectrum));
        let ranges = self.ranges(work, stage.as_ref(), &spectrum)?;
        drop(spectrum);
        observe(&Stage::new(axes, StageKind::RangeDoppler, &ranges));
        let image = read_out::compress(self, work, &ranges)?;
        observe(&Stage::new(axes, StageKind::Image, &image));
        Ok(image)
    }

    /// Memory of the pulse blocks, bytes, where samples are not read to their final location.
    fn reading_bytes(&self) -> u128 {
        match self.fitted.motion.profiles() {
            Some(_) => {
                let pulses =
                    BLOCKS_HELD * BLOCK_PULSES.min(self.fitted.motion.positions.track.num_pulses);
                8 * (pulses * self.spec.collection.num_samples) as u128
            }
            None => 0,
        }
    }

    /// Filter the spectrum `[K][Q]` and transform it from frequency to range: `[Q][R]`.
    fn ranges(
        &self,
        work: &Work,
        stage: &dyn RangeStage,
        spectrum: &[Complex32],
    ) -> Result<Vec<Complex32>, FormError> {
        let axes = &self.fitted.axes;
        let mut ranges = vec![Complex32::ZERO; axes.num_bins * axes.range.count];
        let kernel = KaiserBessel::new(TAPS);
        let num_samples = axes.wavenumbers.len();
        let scratch = || {
            let samples = vec![Complex32::ZERO; num_samples];
            let scratch = vec![Complex32::ZERO; stage.scratch_length()];
            (samples, scratch, during(work.monitor, cost::RANGES))
        };
        ranges
            .par_chunks_exact_mut(axes.range.count)
            .enumerate()
            .for_each_init(scratch, |(samples, scratch, _), (q, out)| {
                if work.monitor.cancelled() {
                    return;
                }
                let kx = axes.along_wavenumber(q);
                let along = roll_off(&kernel, &axes.along, kx);
                for (k, (sample, &kappa)) in samples.iter_mut().zip(&axes.wavenumbers).enumerate() {
                    let weight = self.filter(stage, &kernel, along, [kappa, kx]);
                    *sample = spectrum[k * axes.num_bins + q] * narrow(weight);
                }
                stage.ranges(kx, samples, out, scratch);
            });
        step_done(work, 0.6)?;
        Ok(ranges)
    }

    /// Filter for a sample of the spectrum, without the window: amplitude of the reference, phase of the
    /// stage, and roll-off of the interpolation kernels; `along` is the roll-off along the track.
    fn filter(
        &self,
        stage: &dyn RangeStage,
        kernel: &KaiserBessel,
        along: f64,
        [kappa, kx]: [f64; 2],
    ) -> Complex64 {
        let axes = &self.fitted.axes;
        let taper = axes.taper.at(kx / kappa);
        if taper == 0.0 {
            return Complex64::ZERO;
        }
        let kr = (kappa * kappa - kx * kx).sqrt();
        let amplitude = taper * kappa / (kr * kr.sqrt());
        let given = stage.range_wavenumber(kappa, kx);
        let roll_off = along * roll_off(kernel, &axes.range, given);
        // The slow-time transform starts at the first pulse position, before the aperture centre.
        let [start_m, _] = self.fitted.motion.positions.span_m();
        let phase_rad = stage.phase_rad(kappa, kx) - kx * start_m;
        cis(phase_rad)
            * stationary_phase_error(axes.reference_range_m() * kr)
            * (amplitude / roll_off)
    }
}

impl<M: RangeMethod> Forming for Strip<'_, M> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        self.form_observed(work, tiles, &mut |_| ())
    }
}

/// Roll-off of the interpolation kernel of an image axis.
fn roll_off(kernel: &KaiserBessel, axis: &ImageAxis, wavenumber: f64) -> f64 {
    kernel.spectrum((wavenumber - axis.carrier) * axis.step_m / std::f64::consts::TAU)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_2_PI, PI};

    use super::*;

    /// `J1 + j Y1` by the integrals of Bessel and Heine (DLMF 10.9.1 and 10.9.7) with the trapezoidal rule. The first
    /// integrands together are periodic, the last decays doubly exponentially.
    fn hankel1(z: f64) -> Complex64 {
        const STEPS: i32 = 40_000;
        let step = PI / f64::from(STEPS);
        let (mut j, mut y) = (0.0, 0.0);
        for i in 0..=STEPS {
            let angle = f64::from(i) * step;
            let end = if i == 0 || i == STEPS { 0.5 } else { 1.0 };
            j += end * (angle - z * angle.sin()).cos();
            y += end * (z * angle.sin() - angle).sin();
            let t = 3.0 * angle / PI;
            let tail = (t.exp() - (-t).exp()) * (-z * t.sinh()).exp();
            y -= end * tail * 3.0 / PI;
        }
        Complex64::new(j, y) * step / PI
    }

    #[test]
    fn bracket_equals_error_of_stationary_phase() {
        for z in [6.0, 20.0, 100.0] {
            let leading = Complex64::cis(z - 0.75 * PI) * (FRAC_2_PI / z).sqrt();
            let error = (hankel1(z) / leading - stationary_phase_error(z)).norm();
            // The next term of Hankel's expansion is (3 5 21) / (3! 8^3 z^3) and bounds the remainder; truncation of the
            // trapezoidal rule contributes about 1e-8.
            let next = 315.0 / 3072.0 / z.powi(3);
            assert!(error < 1.05 * next + 1e-7, "{z}: {error:e} {next:e}");
            assert!(
                (hankel1(z) / leading - 1.0).norm() > 100.0 * error / z,
                "{z}"
            );
        }
    }
}
