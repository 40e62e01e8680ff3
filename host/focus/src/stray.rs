//! Upper bound on the echoes that scatterers outside the grid leave on it.
//!
//! A former multiplies the sum's terms by `1 + d`. Where `d` repeats over pulses or frequencies (an interpolation kernel, a model
//! fitted block by block), it makes paired echoes: a scatterer outside the grid appears on the grid as a focused point, weaker by up to
//! the RMS of `d`. Among dark pixels such a point can hold most of the error, and the compared pixels can miss it. The bound below
//! comes from the recorded samples. It needs no knowledge of the scene.
//!
//! **Energy of echoes.** Let the samples come from scatterers of amplitudes `a_q`. The response of a scatterer has the energy `c |a_q|^2` in
//! pixels, where `c` is the number of pixels per resolution cell ([`pixels_a_cell`]; windows increase it to `c b`, `b` their noise bandwidth). By
//! Parseval the errors of its terms, of RMS `e`, have the energy `e^2 c |a_q|^2` over the whole plane. The scatterers
//! outside the grid therefore leave on it at most
//!
//! ```text
//! e^2 S,   S >= sum over q outside of c |a_q|^2
//! ```
//!
//! Scatterers on the grid leave `e^2 G`, where `G` is the energy of the image; the planned error covers that.
//!
//! **Three bounds on `S`.** The smallest of them applies.
//!
//! 1. *Conservation.* All scatterers and noise together have the energy `U = c N K T` (`N` pulses, `K` frequencies, `T` the power of all
//!    terms as in [`super::accuracy`]). The image contains `G` of it, so `S <= U - G`. `G` is the sum over all pixels of the formed image, not
//!    an estimate from samples; its relative error is that of the image. For a former that interpolates each profile
//!    at its own range only ([`From::Swath`]), `U` is the energy at the ranges of the grid.
//! 2. *Range profiles.* A scatterer that stands out of a pulse's range profile by [`STRONG`] times the level of the rest is counted with its
//!    own energy there. The mean over pulses, `V`, is that of all such scatterers, also of those on the grid: `S <= c V`.
//!    One scatterer that stands out of no profile may add `c L`, with `L` the mean of the thresholds.
//! 3. *Peaks.* No value of the image, anywhere, exceeds the mean `A` over pulses of the profiles' peaks. [`SCATTERERS`] scatterers
//!    of this amplitude have the energy `2 c b A^2`.
//!
//! Bounds 1 and 2 are kept apart, and `G` is not subtracted from `V` or `A`: the grid's energy may be that of noise and clutter, independent
//! of the scatterers that are strong in profiles. Where the grid shows the whole scene, bound 1 goes to zero.
//!
//! **Neglected.** Echoes of many scatterers lie on many pixels, where the compared pixels meet them; bounds 2 and 3 therefore leave out
//! all but one of the scatterers below the threshold, and all but two where peaks are few times the mean of clutter.

use std::sync::Arc;

use glam::DVec2;
use num_complex::Complex32;
use serde::{Deserialize, Serialize};
use subaperture_fft::{Fft, Transforms};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::power::{self, Level};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::fast_length::fast_length;

use super::ImageSpec;

/// Number of equally strong scatterers whose echoes a grid may hold when the samples are clutter.
const SCATTERERS: f64 = 2.0;

/// Power ratio to the mean of the weaker profile values above which a value counts as a scatterer. Noise exceeds it once in 10^4.
const STRONG: f64 = 10.0;

/// Power ratio to the profile mean above which a value is excluded from the background level.
const ABOVE_MEAN: f64 = 4.0;

/// Number of pulses sampled for the extent of the spectrum.
const PULSES: usize = 256;

/// Ranges of the scatterers outside the grid whose echoes a former can focus on the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum From {
    /// Any range: rasters and decimated samples are periodic in range too.
    Anywhere,
    /// Ranges of the grid: profiles are interpolated at their own range only.
    Swath,
}

/// Margin beyond the ranges of the grid points, in cells and as a fraction of the extent, for ranges between the points.
const MARGIN_CELLS: f64 = 4.0;
const MARGIN: f64 = 0.1;

/// Energy of the recorded samples at given ranges, in resolution cells of amplitude 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordedEnergy {
    /// Total energy, `U / c`.
    pub all: f64,
    /// Upper bound on the energy of few scatterers: the smaller of bounds 2 and 3, over `c`.
    pub strong: f64,
}

/// Sums over the range profile of one pulse, or over pulses.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// Total energy, energy above the threshold, and threshold; sums over pulses use squared slow-time weights.
    all: f64,
    strong: f64,
    threshold: f64,
    /// Peak amplitudes; sums over pulses use slow-time weights.
    peaks: f64,
}

impl Sums {
    /// Add the sums of a pulse with the given slow-time weight.
    pub(super) fn add(&mut self, pulse: &Self, weight: f64) {
        let squared = weight * weight;
        self.all += squared * pulse.all;
        self.strong += squared * pulse.strong;
        self.threshold += squared * pulse.threshold;
        self.peaks += weight.abs() * pulse.peaks;
    }

    /// Energy of pulses with the given weights.
    pub(super) fn energy(&self, fast: &[f64], slow: &[f64]) -> RecordedEnergy {
        let norm = 1.0 / (fast.iter().sum::<f64>() * slow.iter().sum::<f64>());
        let cells = slow.len() as f64 * norm * norm;
        let peak = SCALLOPING * self.peaks * norm;
        let bandwidth = noise_bandwidth(slow) * noise_bandwidth(fast);
        let by_peaks = SCATTERERS * bandwidth * peak * peak;
        RecordedEnergy {
            all: cells * self.all,
            strong: by_peaks.min(cells * (self.strong + self.threshold)),
        }
    }
}

/// Noise bandwidth of a window: response energy relative to no window at equal peaks.
fn noise_bandwidth(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    weights.len() as f64 * squares / (sum * sum)
}

/// Range profiles of pulses with one value per resolution cell.
pub(super) struct Profiles {
    fft: Arc<dyn Fft<f32>>,
    length: usize,
    /// Resolution cells per value.
    cells: f64,
}

/// Scratch buffers of one thread.
#[derive(Default)]
pub(super) struct Buffers {
    line: Vec<Complex32>,
    scratch: Vec<Complex32>,
    powers: Vec<f64>,
}

/// Upper bound on the ratio of a peak to the largest sample at a spacing of one cell: `sin(pi / 2) / (pi / 2)` is 0.637.
const SCALLOPING: f64 = 1.0 / 0.636;

impl Profiles {
    /// Prepare the transform for pulses of `num_samples` samples.
    pub(super) fn new(num_samples: usize, transforms: Transforms) -> Self {
        let length = fast_length(num_samples.max(1));
        Self {
            fft: transforms.inverse(length),
            cells: num_samples as f64 / length as f64,
            length,
        }
    }

    /// Profile sums of a pulse weighted by `fast`, at all ranges and within the interval `turns` (delay times
    /// frequency step).
    pub(super) fn of(
        &self,
        row: &[Complex32],
        fast: &[f32],
        turns: [f64; 2],
        buffers: &mut Buffers,
    ) -> [Sums; 2] {
        let Buffers {
            line,
            scratch,
            powers,
        } = buffers;
        line.clear();
        line.extend(row.iter().zip(fast).map(|(&z, &w)| z * w));
        line.resize(self.length, Complex32::ZERO);
        scratch.resize(self.fft.get_inplace_scratch_len(), Complex32::ZERO);
        self.fft.process_with_scratch(line, scratch);
        let instructions = Instructions::best();
        powers.resize(line.len(), 0.0);
        power::powers(instructions, line, powers);
        let mean = Level::of(instructions, powers, f64::INFINITY).mean();
        let threshold = STRONG * Level::of(instructions, powers, ABOVE_MEAN * mean).mean();
        let sums = |level: Level| Sums {
            all: self.cells * level.all,
            strong: self.cells * (level.all - level.weak),
            threshold,
            peaks: level.peak.sqrt(),
        };
        let all = sums(Level::of(instructions, powers, threshold));
        let length = self.length as f64;
        let margin = MARGIN * (turns[1] - turns[0]) * length + MARGIN_CELLS;
        let [first, last] = [turns[0] * length - margin, turns[1] * length + margin];
        let count = last.ceil() - first.floor() + 1.0;
        if count.is_nan() || count >= length {
            return [all; 2];
        }
        let first = first.floor().rem_euclid(length) as usize % self.length;
        let end = first + count as usize;
        let mut level = Level::of(
            instructions,
            &powers[first..end.min(self.length)],
            threshold,
        );
        level.add(&Level::of(
            instructions,
            &powers[..end.saturating_sub(self.length)],
            threshold,
        ));
        [all, sums(level)]
    }
}

/// Upper bound `S` on the energy, in pixels, of scatterers outside the grid of `spec`. `recorded` is the energy at the ranges from which their
/// echoes can come, `shown` the energy of the image.
pub(super) fn outside(spec: &ImageSpec, recorded: RecordedEnergy, shown: f64) -> f64 {
    let pixels = pixels_a_cell(spec);
    (pixels * recorded.strong)
        .min(pixels * recorded.all - shown)
        .max(0.0)
}

/// Spectrum of a grid at its centre: second moments, cycles per pixel squared (rows, mixed, columns), and area swept pulse by pulse.
struct Spectrum {
    moments: [f64; 3],
    swept: f64,
}

impl Spectrum {
    fn of(spec: &ImageSpec) -> Self {
        let (collection, grid) = (spec.collection, spec.grid);
        let counts = [grid.rows.count, grid.columns.count];
        let [row, column] = counts.map(|count| (count / 2).min(count.saturating_sub(2)));
        let middle = grid.position_m(row, column);
        let step = |counts: [usize; 2], axis: usize| match counts[axis] > 1 {
            true => grid.position_m(row + (1 - axis), column + axis) - middle,
            false => glam::DVec3::ZERO,
        };
        let steps = [step(counts, 0), step(counts, 1)];
        let every = collection.pulses.len().div_ceil(PULSES).max(1);
        let last = collection.num_samples.saturating_sub(1);
        let (mut count, mut mean, mut squares) = (0.0, DVec2::ZERO, [0.0; 3]);
        let (mut before, mut swept) = (None::<DVec2>, 0.0);
        for pulse in collection.pulses.iter().step_by(every) {
            let look = (middle - pulse.transmitter_m).normalize_or_zero()
                + (middle - pulse.receiver_m).normalize_or_zero();
            let cycles = DVec2::new(look.dot(steps[0]), look.dot(steps[1])) / SPEED_OF_LIGHT_M_S;
            // Two points with the mean and variance of evenly spaced frequencies.
            let half_hz = (pulse.frequency_hz(last) - pulse.frequency_hz(0)) / 12f64.sqrt();
            let middle_hz = (pulse.frequency_hz(last) + pulse.frequency_hz(0)) / 2.0;
            for hz in [middle_hz - half_hz, middle_hz + half_hz] {
                let place = cycles * hz;
                count += 1.0;
                mean += place;
                squares[0] += place.x * place.x;
                squares[1] += place.x * place.y;
                squares[2] += place.y * place.y;
            }
            // Area of a sector between the first and the last frequency.
            let band =
                (pulse.frequency_hz(last).powi(2) - pulse.frequency_hz(0).powi(2)).abs() / 2.0;
            swept += before.map_or(0.0, |before| before.perp_dot(cycles).abs() * band);
            before = Some(cycles);
        }
        let mean = mean / count;
        Self {
            moments: [
                squares[0] / count - mean.x * mean.x,
                squares[1] / count - mean.x * mean.y,
                squares[2] / count - mean.y * mean.y,
            ],
            swept,
        }
    }
}

/// Side of a rectangle with this second moment.
fn side(moment: f64) -> f64 {
    (12.0 * moment.max(0.0)).sqrt()
}

/// Spacing of the pixels at the grid centre along rows and columns, resolution cells: extent of the spectrum, cycles per pixel. 0 along
/// an axis of one pixel.
pub(super) fn spacings_cells(spec: &ImageSpec) -> [f64; 2] {
    let [rows, _, columns] = Spectrum::of(spec).moments;
    [rows, columns].map(side)
}

/// Pixels per resolution cell at the grid centre, `c`, between one and all pixels. It is the inverse of the spectrum's area in cycles per
/// pixel: the smaller of the rectangle with the spectrum's second moments and the area swept pulse by pulse, which is smaller for
/// circular tracks.
pub(super) fn pixels_a_cell(spec: &ImageSpec) -> f64 {
    let grid = spec.grid;
    let counts = [grid.rows.count, grid.columns.count];
    let Spectrum {
        moments: [a, b, d],
        swept,
    } = Spectrum::of(spec);
    let root = libm::hypot((a - d) / 2.0, b);
    let moments = [(a + d) / 2.0 + root, (a + d) / 2.0 - root];
    let pixels = grid.num_pixels() as f64;
    // A line of pixels has no second side.
    let longest = counts[0].max(counts[1]) as f64;
    let sides = moments.map(|moment| side(moment).max(1.0 / longest));
    let cell = match counts.contains(&1) {
        true => 1.0 / sides[0],
        // For looks along one line the second side is unchanged.
        false if swept > 1e-9 * sides[0] * sides[1] => 1.0 / (sides[0] * sides[1]).min(swept),
        false => 1.0 / (sides[0] * sides[1]),
    };
    cell.clamp(1.0, pixels)
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;

    const NUM_SAMPLES: usize = 40;

    fn tone(amplitude: f64, turns: f64) -> Vec<Complex32> {
        let value =
            |k: usize| Complex64::from_polar(amplitude, std::f64::consts::TAU * turns * k as f64);
        let narrow = |z: Complex64| Complex32::new(z.re as f32, z.im as f32);
        (0..NUM_SAMPLES).map(|k| narrow(value(k))).collect()
    }

    fn energy(row: &[Complex32], turns: f64) -> [RecordedEnergy; 2] {
        let profiles = Profiles::new(row.len(), Transforms::default());
        let fast = vec![1.0f32; row.len()];
        let swath = [turns, turns + 0.01];
        let of_pulse = profiles.of(row, &fast, swath, &mut Buffers::default());
        of_pulse.map(|own| {
            let mut sums = Sums::default();
            sums.add(&own, 1.0);
            sums.energy(&vec![1.0; row.len()], &[1.0])
        })
    }

    /// A tone of amplitude 2 has the energy 4 at any frequency. Between two cells the two largest values hold 81 % of it, 3.24; side
    /// lobes below the threshold are excluded, and the threshold is counted.
    #[test]
    fn profiles_count_the_energy_of_a_scatterer_at_its_range() {
        for i in 0..100 {
            let turns = 0.01 * f64::from(i) + 0.0007;
            let row = tone(2.0, turns);
            // The transform has positive sign: the profile peak lies at minus the tone.
            for own in energy(&row, -turns) {
                assert!((3.6..=4.001).contains(&own.all), "{turns}: {own:?}");
                assert!((3.2..5.2).contains(&own.strong), "{turns}: {own:?}");
            }
            let [all, away] = energy(&row, 0.4 - turns);
            assert!((all.all - 4.0).abs() < 1e-4, "{turns}: {all:?}");
            assert!(away.all < 0.1 && away.strong < 1.0, "{turns}: {away:?}");
        }
    }

    /// Two scatterers of equal strength count twice, and a third one as well; peaks alone would count two.
    #[test]
    fn profiles_count_every_strong_scatterer() {
        let rows = [0.1, 0.35, 0.8].map(|turns| tone(1.0, turns));
        let row: Vec<Complex32> = (0..NUM_SAMPLES)
            .map(|k| rows.iter().map(|row| row[k]).sum())
            .collect();
        let [all, _] = energy(&row, 0.0);
        assert!((all.all - 3.0).abs() < 1e-4, "{all:?}");
        assert!((2.9..3.6).contains(&all.strong), "{all:?}");
    }
}
