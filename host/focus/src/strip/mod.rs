//! What the frequency-domain formers share: from pulses on a straight track to the two-dimensional
//! spectrum, and from an image over place along the track and closest range to pixels.
//!
//! For a straight track ([`crate::straight_track`]) the sum that every former computes ([`super`]) is, for each
//! frequency, a correlation over slow time, `u = x - s_n`:
//!
//! ```text
//! I(x, r) = sum_k w_k sum_n v_n z[n][k] h_k(x - s_n; r),   h_k(u; r) = exp(+j kappa_k sqrt(r^2 + u^2)),
//! kappa_k = 4 pi f_k / c
//! ```
//!
//! with samples referred to path zero. With `Y_k(kx)` the transform of `v_n z[n][k]` over `s_n` and `H_k`
//! that of `h_k`, it is a product in `kx`. `H_k` has a closed form, for `exp(j kappa R) / R` has (a
//! Hankel function), and differentiation by `kappa` takes the `1 / R` away:
//!
//! ```text
//! H(kx; r) = -pi r (kappa / kr) H1(r kr),   kr = sqrt(kappa^2 - kx^2)
//!          = sqrt(2 pi j r) kappa kr^(-3/2) exp(j r kr) (1 + 3j / (8 r kr) + 15 / (128 (r kr)^2) + ...)
//! ```
//!
//! `H1` the Hankel function of the first kind and order 1. The factor before the bracket is the principle
//! of stationary phase (Cumming and Wong 2005, chapter 5), the bracket its error: 3 / (8 r kr), -41 dB at
//! 1 m and 1 GHz, -89 dB at 1 km and 1 GHz. Its first three terms are used, at the middle of the swath
//! for each `(kappa, kx)` and for the range of the pixel with the carrier's `kr`.
//!
//! A track that strays from the line is compensated to it before (`motion`).
//!
//! `kx` runs over all directions in which a pixel is seen from a pulse, with smooth ends outside of them
//! (`taper`), and pulses are padded with zeros until no repetition of the reference reaches a pixel: the
//! sum over slow time is not circular, and ends of the aperture are where they are. Where the directions
//! need more than `2 pi / spacing`, the spectrum is repeated, as that of samples is: what is ambiguous in
//! `exact` is just as ambiguous here.
//!
//! What the formers differ in is the way from `(kappa, kx)` to `(r, kx)` (`RangeMethod`). Both image axes
//! are spaced at half of Nyquist's step, brought down by their carriers, and read at every pixel's `(x,
//! r)` with a Kaiser-Bessel kernel of 6 taps whose roll-off is divided out of the spectrum: -107 dB in
//! each axis. Any grid will do: a pixel is its `(x, r)`, in the ground or slant plane alike.
//!
//! **Prediction** (`prediction`), before anything heavy: the formula that the stages come to is evaluated for pulses,
//! frequencies and pixels all over the grid and compared with the exact one, once for what the recorded track leaves and
//! once for the line, its ends, repetitions and the method's expansion.
//!
//! Cost, with `N` pulses, `K` frequencies, `L` padded pulses, `Q` wavenumbers `kx`, `R` ranges: `K`
//! transforms of `L`, `R` of `2 Q`, about 40 operations a pixel, and the method's (`cost`). Memory: `8 K (N + Q)`,
//! then `8 Q (K + R)` bytes, then `8 R (Q + X)` with `X` columns, whichever is the most, and the image. Where profiles are
//! compensated by range their wavenumbers stand for `K`; where pulses have their own places `L` is `2 Q`.

mod axes;
mod bounds;
mod choice;
mod cost;
mod fall;
mod motion;
mod prediction;
mod read_out;
mod spectrum;
mod stage;
mod taper;

use std::sync::{Arc, Mutex};

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_fft::Transforms;

use super::budget::Budget;
use super::read_ahead::BLOCKS_HELD;
use super::{Aim, FormError, Forming, Remedy, Tile, TimeModel, Work};
use subaperture_model::monitor::during;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::{cis, narrow};

pub(super) use axes::{Axes, ImageAxis, TAPS};
use choice::Fitted;
pub(super) use choice::{decide, sizes};
use spectrum::BLOCK_PULSES;
pub use stage::{Stage, StageKind};

/// How large the arrays of a frequency-domain former are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Length of the transform over slow time: pulses with padding, or the cells that uneven ones are spread over.
    pub padded_pulses: usize,
    /// Wavenumbers along the track that are kept.
    pub along_wavenumbers: usize,
    /// Range bins.
    pub ranges: usize,
    /// Length of the transform back to the track.
    pub along_length: usize,
    /// Places along the track that are kept.
    pub columns: usize,
}

impl Sizes {
    fn of(axes: &Axes) -> Self {
        Self {
            padded_pulses: axes.slow_length,
            along_wavenumbers: axes.num_bins,
            ranges: axes.range.count,
            along_length: axes.along_length,
            columns: axes.along.count,
        }
    }
}

/// The way from frequency to closest range, for one wavenumber along the track at a time.
pub(super) trait RangeMethod: Sync {
    /// The wavenumber over range that a sample at `kappa`, `kx` (rad/m) is given; not finite where the
    /// method has none.
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64;

    /// Phase that a sample at `kappa`, `kx` ends up with at a range, all turns on the way together, with
    /// `reference_m` the middle of the swath; `range_m kr` if the method is exact. Radians.
    fn phase_rad(&self, kappa: f64, kx: f64, range_m: f64, reference_m: f64) -> f64;

    /// Operations on that way, for all wavenumbers along the track, of so many samples a pulse.
    fn operations(&self, samples: usize, sizes: &Sizes) -> f64;

    /// Nanoseconds of one core that this takes.
    fn time_ns(&self, model: &TimeModel, samples: usize, sizes: &Sizes) -> f64;

    /// Prepares for these axes.
    fn stage(&self, axes: &Axes, transforms: Transforms) -> Box<dyn RangeStage>;
}

/// A [`RangeMethod`] ready to work.
pub(super) trait RangeStage: Sync {
    /// As [`RangeMethod::range_wavenumber`].
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64;

    /// Phase to turn a sample by beforehand, radians.
    fn phase_rad(&self, kappa: f64, kx: f64) -> f64;

    /// Complex values of scratch that [`Self::ranges`] needs.
    fn scratch_length(&self) -> usize;

    /// `out[j] = sum_k samples[k] exp(j r_j (kr_k - carrier))` for the wavenumber `kx`, where the
    /// phase of [`Self::phase_rad`] is in the samples already.
    fn ranges(
        &self,
        kx: f64,
        samples: &[Complex32],
        out: &mut [Complex32],
        scratch: &mut [Complex32],
    );
}

/// Ready to form by a method. What tiles share, the image over range and place along the track, is made with the first
/// and kept.
pub(super) struct Strip<'a, M> {
    aim: Aim<'a>,
    method: M,
    fitted: Fitted,
    image: Mutex<Option<Arc<Vec<Complex32>>>>,
}

impl<'a, M: RangeMethod> Strip<'a, M> {
    /// Lays out axes for `method`, as was decided.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] as [`decide`]; [`FormError::Choices`] of `choices` that are none of a strip's.
    pub(super) fn new(
        former: &'static str,
        aim: Aim<'a>,
        method: M,
        choices: &serde_json::Value,
    ) -> Result<Self, FormError> {
        let fitted = choice::chosen(former, &aim, &method, choices)?;
        Ok(Self {
            aim,
            method,
            fitted,
            image: Mutex::new(None),
        })
    }

    /// As [`Forming::form`]; `observe` sees every array on the way.
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

    /// The image over range and place along the track.
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
        let num_pulses = motion.track.num_pulses;
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
        let stage = self.method.stage(axes, self.aim.means.transforms);
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

    /// Bytes of blocks of pulses, where they are not read to where their samples stay.
    fn reading_bytes(&self) -> u128 {
        match self.fitted.motion.profiles() {
            Some(_) => {
                let pulses = BLOCKS_HELD * BLOCK_PULSES.min(self.fitted.motion.track.num_pulses);
                8 * (pulses * self.aim.collection.num_samples) as u128
            }
            None => 0,
        }
    }

    /// The spectrum `[K][Q]` weighted, and taken from frequency to range: `[Q][R]`.
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
                for (k, (sample, &kappa)) in samples.iter_mut().zip(&axes.wavenumbers).enumerate() {
                    let weight = self.filter(stage, &kernel, kappa, kx);
                    *sample = spectrum[k * axes.num_bins + q] * narrow(weight);
                }
                stage.ranges(kx, samples, out, scratch);
            });
        step_done(work, 0.6)?;
        Ok(ranges)
    }

    /// What a sample of the spectrum is multiplied by, window apart: the reference's amplitude, the
    /// stage's phase, and the roll-off of the kernels that will read the image.
    fn filter(
        &self,
        stage: &dyn RangeStage,
        kernel: &KaiserBessel,
        kappa: f64,
        kx: f64,
    ) -> Complex64 {
        let axes = &self.fitted.axes;
        let taper = axes.taper.at(kx / kappa);
        if taper == 0.0 {
            return Complex64::ZERO;
        }
        let kr = (kappa * kappa - kx * kx).sqrt();
        let amplitude = taper * kappa / (kr * kr.sqrt());
        let given = stage.range_wavenumber(kappa, kx);
        let roll_off = |axis: &ImageAxis, wavenumber: f64| {
            kernel.spectrum((wavenumber - axis.carrier) * axis.step_m / std::f64::consts::TAU)
        };
        let roll_off = roll_off(&axes.along, kx) * roll_off(&axes.range, given);
        // Slow time is transformed from its first place on, which lies before the aperture's centre.
        let [start_m, _] = self.fitted.motion.span_m();
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

/// Tells that a part of the work is done.
fn step_done(work: &Work, fraction: f64) -> Result<(), FormError> {
    if work.monitor.cancelled() {
        return Err(FormError::Cancelled);
    }
    work.monitor.progress(fraction);
    Ok(())
}

/// `H1(z)` over its leading term, for `z` of more than about 5: what the principle of stationary phase
/// leaves out.
fn stationary_phase_error(z: f64) -> Complex64 {
    Complex64::new(1.0 + 15.0 / (128.0 * z * z), 3.0 / (8.0 * z))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_2_PI, PI};

    use super::*;

    /// `J1 + j Y1` by Bessel's and Heine's integrals (DLMF 10.9.1 and 10.9.7), trapezoids: the first
    /// integrands are periodic together, the last falls off doubly exponentially.
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
    fn the_bracket_is_what_stationary_phase_leaves_out() {
        for z in [6.0, 20.0, 100.0] {
            let leading = Complex64::cis(z - 0.75 * PI) * (FRAC_2_PI / z).sqrt();
            let error = (hankel1(z) / leading - stationary_phase_error(z)).norm();
            // The next term of Hankel's expansion is (3 5 21) / (3! 8^3 z^3), and bounds the rest; the
            // trapezoids' ends leave 1e-8 or so.
            let next = 315.0 / 3072.0 / z.powi(3);
            assert!(error < 1.05 * next + 1e-7, "{z}: {error:e} {next:e}");
            assert!(
                (hankel1(z) / leading - 1.0).norm() > 100.0 * error / z,
                "{z}"
            );
        }
    }
}
