//! Detection of moving targets on registered channel images.
//!
//! A pixel of channel `c` contains clutter, noise, perhaps one bright stationary scatterer of any amplitude, and perhaps one target. Stationary
//! scatterers are equal in all channels, so that they are absent from the differences
//!
//! ```text
//! y_c = x_c - x_0,   c = 1 .. C-1   (displaced phase centre antenna, DPCA),
//! ```
//!
//! and a target of radial velocity `v`, positive when approaching, has in them the steering vector
//!
//! ```text
//! s_c(v) - 1,   s_c(v) = exp(+j 4 pi v tau_c / lambda),
//! ```
//!
//! `tau_c` the lag of channel `c` ([`Alignment`]). The adaptive matched filter (AMF, [`crate::adaptive`]) of `y` is the generalised likelihood ratio of
//! a target and a stationary scatterer against a stationary scatterer alone. It has `N = C - 1` degrees of freedom. With two channels it is
//! DPCA with a cell-averaging CFAR threshold.
//!
//! The covariance is estimated from cells around the pixel, outside of guard cells. Cells are pixels at the spacing of independent samples, so
//! that the number of snapshots is that of the theory; the image is processed as interleaved images of such pixels.
//!
//! **False alarms.** A maximum over velocities exceeds a threshold more often than the statistic of one velocity. With the probability `p` of one velocity
//! and the length `L` of the curve of whitened steering vectors, `L = integral acos |u(v)^H u(v + dv)|` for unit vectors `u`, the expected number of
//! upward crossings along the curve (Rice 1945, for the envelope of a complex Gaussian process) gives
//!
//! ```text
//! P(maximum) <= p (1 + L sqrt(-ln p / pi)),
//! ```
//!
//! which is solved for `p` once per image, with the mean covariance of its pixels. With two channels `L = 0`.
//!
//! Blind velocities are those with `s(v) = 1`: 0, and with two channels the multiples of the ambiguity interval.
//!
//! **Cost** per pixel: `N^2` products, five sums of each, and the energy in closed form for `N` up to 2, else a factorisation; `M` products of `N` elements for `M` velocities where its energy exceeds the threshold.

use std::sync::OnceLock;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::image::{Image, power};

use crate::adaptive::{
    AdaptiveError, Covariance, Detector, Loading, Performance, Statistic, Whitener,
};
use crate::alignment::Alignment;
use crate::correlation::{Correlation, Spacing};
use crate::error::GmtiError;
use crate::images::ChannelImages;
use crate::interleaved::{self, Interleaved, RingRow};

/// Velocities per unambiguous interval and ratio of largest and smallest lag.
const VELOCITIES: f64 = 16.0;

/// Settings of detection: false alarms, training, number of focused targets.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Probability of false alarm per cell.
    pub false_alarm_probability: f64,
    /// Cells on each side of the tested one that are not used for training.
    pub guard_cells: usize,
    /// Cells beyond the guard cells, on each side, that are used for training.
    pub training_cells: usize,
    /// Number of targets, the strongest first, whose cross-range velocity is estimated. Each takes a pass over all pulses.
    pub focused_targets: usize,
}

impl Default for Settings {
    /// 1e-6, 10 guard cells, 8 training cells: at most 928 snapshots; 20 focused targets.
    fn default() -> Self {
        Self {
            false_alarm_probability: 1e-6,
            guard_cells: 10,
            training_cells: 8,
            focused_targets: 20,
        }
    }
}

impl Settings {
    /// Largest distance of guard cells and of training cells in an image of this size: a ring never has more cells than the image.
    pub(crate) fn reach(&self, size: [usize; 2]) -> [usize; 2] {
        let outer = self.guard_cells.saturating_add(self.training_cells);
        [self.guard_cells, outer].map(|cells| cells.min(size[0].max(size[1])))
    }

    /// Largest number of training cells in an image of this size.
    pub(crate) fn most_snapshots(&self, size: [usize; 2]) -> usize {
        let [inner, outer] = self.reach(size).map(|cells| (2 * cells + 1).pow(2));
        outer - inner
    }
}

/// Statistic of all pixels.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StatisticMap {
    /// Number of rows of the image.
    pub rows: usize,
    /// Number of columns of the image.
    pub columns: usize,
    /// Estimated ratio of signal to clutter and noise after cancellation, row-major; 0 for pixels that were not tested, and for those whose energy is below
    /// the threshold.
    pub snr: Vec<f32>,
    /// Whether a pixel exceeds its threshold.
    pub detected: Vec<bool>,
    /// Spacing of independent cells.
    pub spacing: Spacing,
    /// Number of pixels of an independent cell.
    pub cell_pixels: f64,
    /// Number of independent cells that were tested.
    pub cells: f64,
    /// Probability of false alarm of one velocity with which the maximum over velocities has the requested one.
    pub single_probability: f64,
}

/// Steering vector of a radial velocity for channels with these lags.
pub fn steering(lags_s: &[f64], centre_hz: f64, velocity_m_s: f64) -> Vec<Complex64> {
    let phase_a_s = 4.0 * std::f64::consts::PI * velocity_m_s * centre_hz / SPEED_OF_LIGHT_M_S;
    let element = |lag_s: &f64| Complex64::cis(phase_a_s * lag_s);
    lags_s.iter().map(element).collect()
}

/// Largest radial velocity without ambiguity, metres per second: half a cycle of phase between the channels that are closest.
pub(crate) fn unambiguous_m_s(lags_s: &[f64], centre_hz: f64) -> f64 {
    let mut lags_s = lags_s.to_vec();
    lags_s.sort_by(f64::total_cmp);
    let spread_s = lags_s[lags_s.len() - 1] - lags_s[0];
    let gaps = lags_s.windows(2).map(|pair| pair[1] - pair[0]);
    // Channels at the same position along the track do not differ.
    let gaps = gaps.filter(|&gap| gap > 1e-3 * spread_s);
    SPEED_OF_LIGHT_M_S / centre_hz / (4.0 * gaps.fold(f64::MAX, f64::min))
}

/// Tested velocities, metres per second; 0 is not among them.
pub(crate) fn velocities_m_s(lags_s: &[f64], centre_hz: f64) -> Vec<f64> {
    let most = unambiguous_m_s(lags_s, centre_hz);
    let spread_s = lags_s
        .iter()
        .map(|lag| lag - lags_s[0])
        .fold([0f64; 2], |ends, lag| [ends[0].min(lag), ends[1].max(lag)]);
    let cycles = 4.0 * most * (spread_s[1] - spread_s[0]) * centre_hz / SPEED_OF_LIGHT_M_S;
    // An even number: 0 is not among them.
    let count = 2.0 * (VELOCITIES * cycles / 2.0).ceil();
    let place = |i: usize| most * (2.0 * (i as f64 + 0.5) / count - 1.0);
    (0..count as usize).map(place).collect()
}

/// Differences of the channels of a pixel with the first one.
pub(crate) fn differences(images: &ChannelImages, pixel: usize, out: &mut [Complex32]) {
    let first = images.images[0].pixels[pixel];
    for (out, image) in out.iter_mut().zip(&images.images[1..]) {
        *out = image.pixels[pixel] - first;
    }
}

/// Test all pixels of `images`.
///
/// # Errors
/// [`GmtiError::Unsuited`] for fewer training cells than twice the degrees of freedom; [`GmtiError::Adaptive`] for a probability out of range.
pub fn detect(
    images: &ChannelImages,
    alignment: &Alignment,
    settings: &Settings,
) -> Result<StatisticMap, GmtiError> {
    let (lags_s, size) = (alignment.lags_s(), alignment.lags_s().len() - 1);
    let (rows, columns) = (images.images[0].rows, images.images[0].columns);
    let most = settings.most_snapshots([rows, columns]);
    if most < 2 * size {
        return Err(GmtiError::Unsuited(format!(
            "expected at least {} training cells for {} channels, found {most}",
            2 * size,
            size + 1
        )));
    }
    let requested = settings.false_alarm_probability;
    if !(requested > 0.0 && requested < 1.0) {
        return Err(AdaptiveError::Probability(requested).into());
    }
    let correlation = Correlation::measure(&images.images[0]);
    let spacing = correlation.spacing();
    let steering = steering_of_differences(lags_s, images.centre_hz);
    let single = of_one_velocity(requested, curve_length(images, spacing, &steering)?);
    let thresholds = vec![OnceLock::new(); most + 1];
    let threshold = |snapshots: usize| {
        let counted = rounded_down(snapshots, most, 2 * size);
        *thresholds[counted].get_or_init(|| {
            let performance = Performance::new(Statistic::Amf, size, counted);
            let threshold = performance.and_then(|performance| performance.threshold(single));
            threshold.unwrap_or(f64::INFINITY)
        })
    };
    let detector = Detector::new(Whitener::known(size, &identity(size))?, &steering)?;
    let tester = Tester {
        images,
        interleaved: Interleaved::new([rows, columns], spacing),
        reach: settings.reach([rows, columns]),
        size,
        scale: unit_scale(&images.images[0]),
    };
    let bands = tester.interleaved.bands().into_par_iter();
    let bands: Vec<Band> = bands
        .map(|band| tester.band(&band, detector.clone(), threshold))
        .collect();
    let tested: usize = bands.iter().map(|band| band.tested).sum();
    let mut map = StatisticMap {
        rows,
        columns,
        snr: vec![0.0; rows * columns],
        detected: vec![false; rows * columns],
        spacing,
        cell_pixels: correlation.cell_pixels(),
        cells: tested as f64 / correlation.cell_pixels(),
        single_probability: single,
    };
    if map.cells == 0.0 {
        return Err(GmtiError::Unsuited(format!(
            "no pixel of the {rows} x {columns} has {} training cells around it: choose a larger grid",
            2 * size
        )));
    }
    for (pixel, snr, detected) in bands.into_iter().flat_map(|band| band.strong) {
        (map.snr[pixel], map.detected[pixel]) = (snr, detected);
    }
    Ok(map)
}

/// Least pivot of a covariance, relative to its diagonal element, with which sums of float32 products are used. Their rounding error is some 1e-8 of the
/// diagonal.
const SOUND: f64 = 1e-6;

/// The same for energies of float32 products, and the relative margin of such an energy from the threshold.
const QUICK: f64 = 1e-3;

/// Test of the pixels of an image.
struct Tester<'a> {
    images: &'a ChannelImages,
    interleaved: Interleaved,
    reach: [usize; 2],
    size: usize,
    /// Factor of the pixels, a power of two, so that products do not leave the range of float32.
    scale: f32,
}

/// Result of a band.
struct Band {
    tested: usize,
    /// Pixel, SNR, and whether it exceeds its threshold, for pixels whose energy exceeds the threshold.
    strong: Vec<(usize, f32, bool)>,
}

impl Tester<'_> {
    /// Test the pixels of a band. `threshold` depends on the number of snapshots.
    fn band(
        &self,
        band: &interleaved::Band,
        mut detector: Detector,
        threshold: impl Fn(usize) -> f64,
    ) -> Band {
        let columns = self.images.images[0].columns;
        let within = |axis: usize| {
            self.reach
                .map(|reach| self.interleaved.cells_within(axis, reach))
        };
        let [down, across] = [0, 1].map(within);
        let mut covariance = Covariance::new(self.size);
        // Number of snapshots and threshold of each column; infinite where too few.
        let mut limits = vec![(0, f64::INFINITY); columns];
        let mut last = None;
        let (mut tested, mut strong) = (0, Vec::new());
        let rows = |row: usize, line: &mut [Vec<Complex32>]| self.row(row, line);
        let visit = |ring: &RingRow| {
            let own = [0, 1].map(|i| down[i][ring.row]);
            if last.replace(own) != Some(own) {
                for (column, limit) in limits.iter_mut().enumerate() {
                    let [inner, outer] = [0, 1].map(|i| own[i] * across[i][column]);
                    let snapshots = outer - inner;
                    let is_enough = snapshots >= 2 * self.size;
                    let value = if is_enough {
                        threshold(snapshots)
                    } else {
                        f64::INFINITY
                    };
                    *limit = (snapshots, value);
                }
            }
            for (column, &(snapshots, threshold)) in limits.iter().enumerate() {
                if snapshots < 2 * self.size {
                    continue;
                }
                match self.is_weak(ring, column, threshold) {
                    Some(true) => {
                        tested += 1;
                        continue;
                    }
                    Some(false) => {}
                    None => continue,
                }
                let pixel = ring.row * columns + column;
                covariance.set(snapshots, ring.sums.iter().map(|element| element[column]));
                let is_sound = detector.train(&covariance, Loading::Off).is_ok()
                    && detector.least_pivot(&covariance) > SOUND;
                if !is_sound {
                    self.sum_exactly(pixel, &mut covariance);
                    if detector.train(&covariance, Loading::Off).is_err() {
                        continue;
                    }
                }
                tested += 1;
                let mut cell = vec![Complex32::ZERO; self.size];
                self.cell(pixel, &mut cell);
                // Most cells are below the threshold for any steering vector.
                if detector.energy(&cell) > threshold {
                    let amf = detector.evaluate(Statistic::Amf, &cell).value;
                    strong.push((pixel, (amf * snapshots as f64) as f32, amf > threshold));
                }
            }
        };
        self.interleaved
            .for_each_row(band, self.reach, self.size, rows, visit);
        Band { tested, strong }
    }

    /// Whether the energy of a pixel is certainly below the threshold; `None` if the ring has no power or is not finite, so that it cannot be tested.
    ///
    /// With `S` the sum over the ring, the energy is `x^H adj(S) x / det(S)`: no factorisation and no division.
    fn is_weak(&self, ring: &RingRow, column: usize, threshold: f64) -> Option<bool> {
        let sum = |e: usize| ring.sums[e][column];
        let own = |e: usize| f64::from(ring.own[e][column]);
        match self.size {
            1 => {
                let power = sum(0);
                // The comparison is false for NaN as well.
                let is_sound = power > 0.0 && power.is_finite();
                is_sound.then(|| (1.0 + QUICK) * own(0) < threshold * power)
            }
            2 => {
                let [first, re, im, second] = [0, 1, 2, 3].map(sum);
                let diagonal = first * second;
                let determinant = diagonal - re * re - im * im;
                if determinant > QUICK * diagonal && first > 0.0 && diagonal.is_finite() {
                    let energy =
                        second * own(0) + first * own(3) - 2.0 * (re * own(1) + im * own(2));
                    return Some((1.0 + QUICK) * energy < threshold * determinant);
                }
                (diagonal.is_finite() && diagonal != 0.0).then_some(false)
            }
            _ => Some(false),
        }
    }

    /// Scaled differences of a row, element by element.
    fn row(&self, row: usize, out: &mut [Vec<Complex32>]) {
        let line = |image: &Image| row * image.columns..(row + 1) * image.columns;
        let [first, others @ ..] = &self.images.images[..] else {
            return;
        };
        for (out, image) in out.iter_mut().zip(others) {
            let pairs = image.pixels[line(image)]
                .iter()
                .zip(&first.pixels[line(first)]);
            for (out, (own, first)) in out.iter_mut().zip(pairs) {
                *out = (own - first) * self.scale;
            }
        }
    }

    /// Scaled differences of a pixel.
    fn cell(&self, pixel: usize, out: &mut [Complex32]) {
        differences(self.images, pixel, out);
        out.iter_mut().for_each(|value| *value *= self.scale);
    }

    /// Sum over the ring of a pixel in float64.
    fn sum_exactly(&self, pixel: usize, covariance: &mut Covariance) {
        let mut cell = vec![Complex32::ZERO; self.size];
        covariance.clear();
        for training in self.interleaved.ring(pixel, self.reach) {
            self.cell(training, &mut cell);
            covariance.add(&cell);
        }
    }
}

/// Power of two that scales an image to a mean power of about 1.
fn unit_scale(image: &Image) -> f32 {
    let powers = image.pixels.iter().map(|&pixel| power(pixel));
    let mean = powers.sum::<f64>() / image.pixels.len() as f64;
    match mean.is_normal() {
        true => (-libm::log2(mean) / 2.0).round().clamp(-60.0, 60.0).exp2() as f32,
        false => 1.0,
    }
}

/// Steering vectors of the channel differences; with two channels all velocities have the same one.
pub(crate) fn steering_of_differences(lags_s: &[f64], centre_hz: f64) -> Vec<Complex64> {
    if lags_s.len() == 2 {
        return vec![Complex64::ONE];
    }
    let of_velocity = |v: f64| {
        let all = steering(lags_s, centre_hz, v);
        let differences: Vec<Complex64> = all[1..].iter().map(|s| s - all[0]).collect();
        differences
    };
    let velocities = velocities_m_s(lags_s, centre_hz);
    velocities.into_iter().flat_map(of_velocity).collect()
}

/// Length of the curve of steering vectors, whitened by the mean covariance of the image, radians.
pub(crate) fn curve_length(
    images: &ChannelImages,
    spacing: Spacing,
    steering: &[Complex64],
) -> Result<f64, GmtiError> {
    let size = images.images.len() - 1;
    if size == 1 {
        return Ok(0.0);
    }
    let mut covariance = Covariance::new(size);
    let mut cell = vec![Complex32::ZERO; size];
    let (rows, columns) = (images.images[0].rows, images.images[0].columns);
    for row in (0..rows).step_by(spacing.rows) {
        for column in (0..columns).step_by(spacing.columns) {
            differences(images, row * columns + column, &mut cell);
            let power: f32 = cell.iter().map(Complex32::norm_sqr).sum();
            if power.is_normal() {
                // Pixels of equal weight, so that targets do not determine the covariance.
                let scale = power.sqrt().recip();
                cell.iter_mut().for_each(|value| *value *= scale);
                covariance.add(&cell);
            }
        }
    }
    let whitener = covariance.factor(Loading::Off)?;
    let vectors: Vec<&[Complex64]> = steering.chunks_exact(size).collect();
    let angle = |pair: &[&[Complex64]]| {
        let form = |a: &[Complex64], b: &[Complex64]| whitener.quadratic_form(a, b);
        let (cross, a, b) = (
            form(pair[0], pair[1]),
            form(pair[0], pair[0]),
            form(pair[1], pair[1]),
        );
        libm::acos((cross.norm() / (a.re * b.re).sqrt()).min(1.0))
    };
    Ok(vectors.windows(2).map(angle).sum())
}

/// Probability of false alarm of the maximum over a curve, for the probability of one velocity.
pub(crate) fn of_maximum(one: f64, curve_length: f64) -> f64 {
    let log = -libm::log(one.max(f64::MIN_POSITIVE));
    one * (1.0 + curve_length * (log / std::f64::consts::PI).sqrt())
}

/// Probability of false alarm of one velocity with which the maximum over a curve has the requested one.
pub(crate) fn of_one_velocity(requested: f64, curve_length: f64) -> f64 {
    let [mut low, mut high] = [0.0, requested];
    for _ in 0..100 {
        let middle = (low + high) / 2.0;
        match of_maximum(middle, curve_length) > requested {
            true => high = middle,
            false => low = middle,
        }
    }
    low.max(f64::MIN_POSITIVE)
}

/// Number of snapshots whose threshold is used for a ring at the edge of the image, with fewer cells than `most`: rounded down to a sixteenth of an
/// octave, which raises the threshold by less than 0.1 dB and saves its computation for every number. At least `least`.
fn rounded_down(snapshots: usize, most: usize, least: usize) -> usize {
    if snapshots >= most || snapshots <= least {
        return snapshots;
    }
    let step = (1 << snapshots.ilog2()) / 16;
    (snapshots - snapshots % step.max(1)).max(least)
}

fn identity(size: usize) -> Vec<Complex64> {
    let element = |i: usize| match i % (size + 1) {
        0 => Complex64::ONE,
        _ => Complex64::ZERO,
    };
    (0..size * size).map(element).collect()
}

/// Function that reads the vector of a pixel.
pub(crate) type Vector = fn(&ChannelImages, usize, &mut [Complex32]);

/// Vector of a pixel over all channels.
pub(crate) fn channels(images: &ChannelImages, pixel: usize, out: &mut [Complex32]) {
    for (out, image) in out.iter_mut().zip(&images.images) {
        *out = image.pixels[pixel];
    }
}

/// Covariance of the vectors of `degrees` elements around a pixel: [`channels`] or [`differences`]. Pixels of detected targets are left out while enough are left.
pub(crate) fn train(
    images: &ChannelImages,
    map: &StatisticMap,
    settings: &Settings,
    pixel: usize,
    (degrees, vector): (usize, Vector),
) -> Covariance {
    let size = [map.rows, map.columns];
    let interleaved = Interleaved::new(size, map.spacing);
    let mut cell = vec![Complex32::ZERO; degrees];
    let mut trained = |is_used: &dyn Fn(&usize) -> bool| {
        let mut covariance = Covariance::new(degrees);
        let ring = interleaved.ring(pixel, settings.reach(size));
        for training in ring.filter(is_used) {
            vector(images, training, &mut cell);
            covariance.add(&cell);
        }
        covariance
    };
    let covariance = trained(&|&training| !map.detected[training]);
    match covariance.snapshots() < 2 * degrees {
        true => trained(&|_| true),
        false => covariance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn training_ring_is_limited_by_the_image() {
        let settings = Settings {
            training_cells: usize::MAX,
            ..Settings::default()
        };
        assert_eq!(settings.reach([30, 200]), [10, 200]);
        assert_eq!(settings.most_snapshots([30, 200]), 401 * 401 - 21 * 21);
        assert_eq!(Settings::default().most_snapshots([500, 500]), 928);
    }

    #[test]
    fn tested_velocities_are_symmetric_without_zero() {
        for middle in 1..40 {
            let lags_s = [0.0, 1e-4 * f64::from(middle), 4e-3];
            let velocities = velocities_m_s(&lags_s, 10e9);
            assert!(velocities.len().is_multiple_of(2), "{middle}");
            let pairs = velocities.iter().zip(velocities.iter().rev());
            for (low, high) in pairs {
                assert!((low + high).abs() < 1e-9 && *low != 0.0, "{low} {high}");
            }
        }
    }
}
