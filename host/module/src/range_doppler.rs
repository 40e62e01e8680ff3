//! Range-Doppler map of a sub-CPI, computed with the host's transforms.
//!
//! The same sum as in the documentation of `subaperture_core`, for `M` pulses of `K`
//! frequencies, `R` range bins and `D` Doppler bins, with `f_c` the frequency of sample `K/2`:
//!
//! ```text
//! map[d][r] = 1 / (sum w_fast  sum w_slow)  sum_k sum_m  w_fast[k] w_slow[m] z[m][k]
//!             exp(+j 2 pi (k - K/2)(r - R/2) / R)
//!             exp(-j 2 pi (f_k / f_c)(m - M/2)(d - D/2) / D)
//! ```
//!
//! Memory: the tables of [`ScaledDft`], the map and one row. Error: about -130 dB (float32).

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex32;
use subaperture_fft as fft;
use subaperture_fft::Fft;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Band, PhaseHistory, ReadError};
use subaperture_signal::scaled_dft::{ScaledDft, Shape};
use subaperture_signal::window::Window;

/// Range-Doppler mapper for one set of dimensions.
pub struct RangeDopplerMapper {
    fast: Vec<f32>,
    dft: ScaledDft,
    range_fft: Arc<dyn Fft<f32>>,
    slow: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl RangeDopplerMapper {
    /// Create a mapper for pulses over `band` with `slow.len()` pulses per sub-CPI and the windows `fast` and `slow`.
    pub fn new(
        band: &Band,
        fast: &[f64],
        slow: &[f64],
        range_bins: usize,
        doppler_bins: usize,
    ) -> Self {
        let num_pulses = slow.len();
        let scales = band.scales();
        let shape = Shape {
            inputs: num_pulses,
            input_centre: (num_pulses / 2) as f64,
            input_drift: 0.0,
            outputs: doppler_bins,
            output_centre: (doppler_bins / 2) as f64,
            spacing: -1.0 / doppler_bins as f64,
        };
        let dft = ScaledDft::new(fft::Transforms::Fastest, &scales, shape, |_, m| slow[m]);
        let range_fft = fft::inverse(range_bins);
        let norm = 1.0 / (fast.iter().sum::<f64>() * slow.iter().sum::<f64>());
        let scratch = dft
            .scratch_length()
            .max(range_fft.get_inplace_scratch_len());
        Self {
            fast: fast.iter().map(|w| (w * norm) as f32).collect(),
            slow: vec![Complex32::ZERO; num_pulses],
            scratch: vec![Complex32::ZERO; scratch],
            dft,
            range_fft,
        }
    }

    /// Compute the map (`[doppler][range]`) of `samples` (pulses outermost) into `map`.
    ///
    /// # Panics
    /// Panics if a length is wrong.
    pub fn map(&mut self, samples: &[Complex32], map: &mut [Complex32]) {
        let (num_samples, range_bins) = (self.fast.len(), self.range_fft.len());
        assert_eq!(samples.len(), num_samples * self.slow.len());
        assert_eq!(map.len(), range_bins * self.dft.shape().outputs);
        map.fill(Complex32::ZERO);
        for (k, &weight) in self.fast.iter().enumerate() {
            for (value, pulse) in self.slow.iter_mut().zip(samples.chunks_exact(num_samples)) {
                *value = pulse[k] * weight;
            }
            let place = (k + range_bins - num_samples / 2) % range_bins;
            self.dft
                .transform(k, &self.slow, &mut self.scratch, |d, value| {
                    map[d * range_bins + place] = value;
                });
        }
        for row in map.chunks_exact_mut(range_bins) {
            self.range_fft.process_with_scratch(row, &mut self.scratch);
            // Bin 0 of the transform is path 0, which is placed in the middle.
            row.rotate_right(range_bins / 2);
        }
    }
}

/// Range-Doppler map of a sub-CPI around a point, for display.
#[derive(Clone, Debug)]
pub struct MapAbout {
    /// Samples `[doppler][range]`, range contiguous. The point is bin 0 of both axes.
    pub values: Vec<Complex32>,
    /// Half-widths in bins: Doppler, range.
    pub reaches: [usize; 2],
    /// Bin spacings: Doppler in cycles per pulse, range in metres (half of the two-way path).
    pub steps: [f64; 2],
}

/// Maximum half-width of the map around the point in bins.
const MAX_REACH: usize = 128;

/// Maximum number of samples of a sub-CPI that are read for display: 128 MiB.
const MAX_SAMPLES: usize = 1 << 24;

/// Range-Doppler map of `pulses` of a recording, motion-compensated to `centre_m`, with Hamming windows in both axes. It has
/// twice as many Doppler bins as pulses and two to four times as many range bins as frequencies, up to 128 on each side of
/// the point. A scatterer of unit amplitude at the point has the value 1.
///
/// # Errors
/// [`ReadError`] if the pulses cannot be read, do not share one frequency band, or have too many samples.
///
/// # Panics
/// Panics if `pulses` is empty or outside the recording.
pub fn map_about(
    history: &dyn PhaseHistory,
    pulses: Range<usize>,
    centre_m: DVec3,
) -> Result<MapAbout, ReadError> {
    let collection = history.collection();
    let unsuited = |what: &str| ReadError::Mismatch(what.to_owned());
    let band = collection
        .band()
        .ok_or_else(|| unsuited("frequency axis changes from pulse to pulse: expected one band"))?;
    let count = pulses.len() * band.count;
    if count > MAX_SAMPLES {
        return Err(unsuited(
            "too many samples in the sub-CPI for display: choose fewer pulses",
        ));
    }
    let mut samples = vec![Complex32::ZERO; count];
    history.read(pulses.clone(), &mut samples)?;
    let lines = samples.chunks_exact_mut(band.count);
    for (pulse, line) in collection.pulses[pulses.clone()].iter().zip(lines) {
        for (k, z) in line.iter_mut().enumerate() {
            let after = k as f64 - (band.count / 2) as f64;
            let path_m = pulse.relative_path_after_m(centre_m, after);
            let turns = pulse.frequency_hz(k) * path_m / SPEED_OF_LIGHT_M_S;
            let (sin, cos) = (TAU * (turns - turns.round())).sin_cos();
            *z *= Complex32::new(cos as f32, sin as f32);
        }
    }
    let weights = |count| Window::Hamming.weights(count);
    let range_bins = (2 * band.count).next_power_of_two();
    let doppler_bins = (2 * pulses.len()).max(3);
    let (fast, slow) = (weights(band.count), weights(pulses.len()));
    let mut mapper = RangeDopplerMapper::new(&band, &fast, &slow, range_bins, doppler_bins);
    let mut map = vec![Complex32::ZERO; range_bins * doppler_bins];
    mapper.map(&samples, &mut map);
    let reaches = [doppler_bins, range_bins].map(|bins| ((bins - 1) / 2).min(MAX_REACH));
    let kept = |bins: usize, reach: usize| bins / 2 - reach..bins / 2 + reach + 1;
    let across = kept(range_bins, reaches[1]);
    let values =
        kept(doppler_bins, reaches[0]).flat_map(|d| &map[d * range_bins..][across.clone()]);
    Ok(MapAbout {
        values: values.copied().collect(),
        reaches,
        steps: [
            1.0 / doppler_bins as f64,
            SPEED_OF_LIGHT_M_S / (2.0 * range_bins as f64 * band.step_hz),
        ],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::{Collection, InMemory, Pulse, Sweep};

    /// Noise in odd and even sizes, windowed, against the defining sum in float64. The transforms are float32: about -130 dB.
    #[test]
    fn range_doppler_map_matches_defining_sum() {
        for (pulses, count, range_bins, doppler_bins) in [(7, 12, 32, 16), (8, 13, 16, 9)] {
            let band = Band {
                start_hz: 1e9,
                step_hz: 3e7,
                count,
            };
            let weights = |n: usize| -> Vec<f64> {
                (0..n).map(|i| 1.0 + 0.5 * (i as f64 * 0.9).sin()).collect()
            };
            let (fast, slow) = (weights(count), weights(pulses));
            let mut state = 1u64;
            let mut number = || {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 40) as f32 / 16_777_216.0 - 0.5
            };
            let samples: Vec<Complex32> = (0..pulses * count)
                .map(|_| Complex32::new(number(), number()))
                .collect();
            let mut map = vec![Complex32::ZERO; range_bins * doppler_bins];
            RangeDopplerMapper::new(&band, &fast, &slow, range_bins, doppler_bins)
                .map(&samples, &mut map);
            let norm = fast.iter().sum::<f64>() * slow.iter().sum::<f64>();
            let from = |i: usize, n: usize| i as f64 - (n / 2) as f64;
            let (mut error, mut power) = (0.0, 0.0);
            for (i, z) in map.iter().enumerate() {
                let (d, r) = (i / range_bins, i % range_bins);
                let (mut re, mut im) = (0.0, 0.0);
                for (j, sample) in samples.iter().enumerate() {
                    let (m, k) = (j / count, j % count);
                    let scale = (1e9 + k as f64 * 3e7) / (1e9 + (count / 2) as f64 * 3e7);
                    let turns = from(k, count) * from(r, range_bins) / range_bins as f64
                        - scale * from(m, pulses) * from(d, doppler_bins) / doppler_bins as f64;
                    let (sin, cos) = (TAU * turns.fract()).sin_cos();
                    let weight = fast[k] * slow[m] / norm;
                    let (a, b) = (f64::from(sample.re), f64::from(sample.im));
                    re += weight * (a * cos - b * sin);
                    im += weight * (a * sin + b * cos);
                }
                error += (f64::from(z.re) - re).powi(2) + (f64::from(z.im) - im).powi(2);
                power += re * re + im * im;
            }
            let error_db = 10.0 * (error / power).log10();
            println!("{pulses} x {count}: {error_db:.1} dB");
            assert!(error_db < -120.0, "{error_db}");
        }
    }

    /// A radar on a straight line observes a point whose path relative to the map centre is `a + b u`, `u` in pulses from pulse
    /// `M/2`. By the equation it lies at the range `a / 2` and at `-b f / c` cycles per pulse with the value 1, minus the straddle
    /// loss of a Hamming window at half a bin (with twice as many bins: a quarter of a bin of the transform, 0.4 dB per axis).
    #[test]
    fn point_lies_at_range_and_doppler_of_its_path() {
        let (count, frequencies) = (33, 64);
        let (start_hz, step_hz) = (9.6e9, 2e6);
        let (centre, point) = (DVec3::new(3.0, 4.0, 0.0), DVec3::new(12.0, 9.5, 0.0));
        let pulses: Vec<Pulse> = (0..count)
            .map(|n| {
                let antenna_m = DVec3::new(f64::from(n) - 16.0, -2000.0, 1000.0);
                let mut pulse = Pulse {
                    time_s: f64::from(n) * 1e-3,
                    transmitter_m: antenna_m,
                    receiver_m: antenna_m,
                    reference_m: DVec3::ZERO,
                    reference_path_m: 0.0,
                    start_hz,
                    step_hz,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
                };
                pulse.reference_path_m = pulse.path_m(DVec3::ZERO);
                pulse
            })
            .collect();
        let sample = |pulse: &Pulse, k: usize| {
            let turns = -pulse.frequency_hz(k) * pulse.relative_path_m(point) / SPEED_OF_LIGHT_M_S;
            let (sin, cos) = (TAU * turns.fract()).sin_cos();
            Complex32::new(cos as f32, sin as f32)
        };
        let samples = pulses
            .iter()
            .flat_map(|pulse| (0..frequencies).map(move |k| sample(pulse, k)));
        let samples = samples.collect();
        let path = |n: usize| pulses[n].path_m(point) - pulses[n].path_m(centre);
        let (a, b) = (path(16), (path(32) - path(0)) / 32.0);
        let band = Band {
            start_hz,
            step_hz,
            count: frequencies,
        };
        let expected = [-b * band.centre_hz() / SPEED_OF_LIGHT_M_S, a / 2.0];
        let collection = Collection {
            name: "one".to_owned(),
            pulses,
            num_samples: frequencies,
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let history = InMemory::new(collection, samples).unwrap();
        let map = map_about(&history, 0..33, centre).unwrap();
        let width = 2 * map.reaches[1] + 1;
        assert_eq!(map.values.len(), (2 * map.reaches[0] + 1) * width);
        let peak = (0..map.values.len())
            .max_by(|&i, &j| map.values[i].norm().total_cmp(&map.values[j].norm()));
        let peak = peak.unwrap();
        let bins = [peak / width, peak % width];
        for i in 0..2 {
            let found = (bins[i] as f64 - map.reaches[i] as f64) * map.steps[i];
            assert!(
                (found - expected[i]).abs() <= 0.51 * map.steps[i],
                "{i}: {found} {expected:?}"
            );
        }
        let level_db = 20.0 * map.values[peak].norm().log10();
        assert!((-0.9..0.1).contains(&level_db), "{level_db}");
    }
}
