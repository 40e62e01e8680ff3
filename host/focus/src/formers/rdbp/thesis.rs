//! Thesis mode: Schone 2020, chapter 3, with the upsampling of chapter 4.
//!
//! For each sub-CPI of `M` pulses, slow time is resampled by sinc weights ([`SincKeystone`]), the Doppler
//! transform is padded to `P M` (default `P` = 16), and the range transform to `10 K`. For every pixel, the path `a` and
//! path rate `b` at the centre of the sub-CPI follow from the fitted position and velocity (4.2, (5.1)). The map is interpolated
//! bilinearly and multiplied by the conjugate of the phase in (3.15):
//!
//! ```text
//! I(p) += exp(+j 2 pi f_c a / c) exp(-j 2 pi nu (M-1)/2) map(nu = b f_c / c, a)
//! ```
//!
//! The second factor is the thesis's Doppler-dependent term. It arises because (3.11) counts pulses from
//! the start of the sub-CPI. Here slow time is rotated by `M/2` whole pulses before the transform, which
//! removes the factor from the map except for half a pulse (for even `M`). Bilinear interpolation across it
//! would quadruple the interpolation error.
//!
//! Neglected: quadratic and higher motion of a pixel within a sub-CPI, which the thesis ignores
//! after (3.13). It causes grating lobes for long sub-CPIs, which this mode reproduces. Also neglected are the
//! edges of the sub-CPI ([`SincKeystone`]) and bilinear interpolation (-48 dB at an upsampling of 10).
//!
//! Linear interpolation in Doppler weights slow time by `sinc^2(x / P)`, `x = u / M` from -1/2 to 1/2, in the mean
//! over positions between bins. The deviation from a constant, `(pi x / P)^2 / 3`, fills the nulls of the array
//! factor: lobe `k` has at least `1 / (6 P^2 k^2)`, -40 dB for the first at `P = 4` and -64 dB at 16, for any
//! sub-CPI length. On recordings compensated to the scene centre this is the only error near the centre
//! (Figure 4.11).
//!
//! Without Keystone, a point that approaches at `v` is smeared over `v M PRI` in range within a sub-CPI.
//! This is negligible for a stationary scene and destroys the focus of a fast target (S 4.3, Figure 4.14). Keystone
//! resamples data sampled once per pulse, so it needs a path rate within `lambda / 2` per pulse.
//!
//! Accuracy on Table 4.1 against [`crate::exact`]: see the tests and `subap demo`. Predicted: the phase and amplitude error of a term from resampling and
//! the linear path, evaluated at some pixels, frequencies and sub-CPIs,
//! and linear interpolation of the map in both directions, `(2 pi x)^2 / sqrt(120)` of a component at
//! `x` cycles per bin. The prediction is for the worst pixel and sub-CPI.
//!
//! Cost: see `cost`. Memory: the map, `P M * 10 K` complex float32, and weights of `K M^2` float32.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use serde_json::json;
use subaperture_fft::Fft;

use super::cost;
use super::layout::Layout;
use super::mapper::{MAPS, PIXELS};
use crate::budget::Budget;

use crate::patch::PatchSize;
use crate::pixels::for_each;
use crate::read_ahead::{BLOCKS_HELD, read_ahead};
use crate::sub_cpi::CentreState;
use crate::{
    Decision, ErrorGoal, FormError, Forming, ImageSpec, Reason, Remedy, Tile, Work, rounding,
};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::during;
use subaperture_model::phase_history::Band;
use subaperture_signal::phase::{phasor, phasor32};
use subaperture_signal::sinc_keystone::{SincKeystone, sinc};

/// Default number of pulses per sub-CPI (Figure 4.1).
pub const SUB_CPI: usize = 40;
/// Remedy for most errors of this mode.
const PRECISE: Remedy = Remedy::Word {
    option: "mode",
    word: "precise",
};
/// Largest upsampling of the Doppler axis; bilinear interpolation then reaches the rounding of float32.
const MAX_DOPPLER_PADDING: usize = 1024;

/// Parameters that the thesis varies, in addition to the sub-CPI length.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Thesis {
    /// Whether slow time is resampled by the Keystone transform before the Doppler transform.
    pub keystone: bool,
    /// Doppler bins per pulse of a sub-CPI, at least 1; increased where the transform becomes faster.
    pub doppler_padding: usize,
    /// Bound on the relative RMS error of the image, dB (negative), checked but not used for planning.
    /// Default: no bound.
    pub error_db: Option<f64>,
}

impl Default for Thesis {
    /// Parameters with Keystone and the finer of the two paddings of Figure 4.11.
    fn default() -> Self {
        Self {
            keystone: true,
            doppler_padding: 16,
            error_db: None,
        }
    }
}

/// Parameters fixed by a plan.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    sub_cpi: usize,
    keystone: bool,
    doppler_padding: usize,
}

impl Choices {
    pub(super) fn new(sub_cpi: usize, options: &Thesis) -> Result<Self, FormError> {
        let choices = Self {
            sub_cpi,
            keystone: options.keystone,
            doppler_padding: options.doppler_padding,
        };
        choices.check()?;
        Ok(choices)
    }

    fn check(&self) -> Result<(), FormError> {
        if self.sub_cpi == 0 {
            return Err(FormError::unsuited(
                "expected at least one pulse per sub-CPI".to_owned(),
            ));
        }
        let doppler_padding = self.doppler_padding;
        if !(1..=MAX_DOPPLER_PADDING).contains(&doppler_padding) {
            return Err(FormError::unsuited(format!(
                "Doppler padding of {doppler_padding}: expected 1 to {MAX_DOPPLER_PADDING}"
            )));
        }
        Ok(())
    }

    /// Map layout of these parameters for `spec`.
    fn layout(&self, spec: &ImageSpec) -> Result<Layout, FormError> {
        self.check()?;
        Layout::new(spec, self.sub_cpi, self.doppler_padding)
    }

    /// Predict the error of these parameters for `spec`.
    pub(super) fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
    ) -> Result<Decision<Self>, FormError> {
        let layout = self.layout(spec)?;
        let (num_samples, longest) = (layout.band.count, layout.longest);
        let linear = |cycles_a_bin: f64| (TAU * cycles_a_bin).powi(2) / 120f64.sqrt();
        let planned_db = rounding::total_db(&[
            Reading {
                spec,
                band: &layout.band,
                keystone: self.keystone,
            }
            .worst(&layout.sub_cpis),
            // The band edge has the largest error; slow time is evenly filled, and the mean of x^4 over it is a fifth.
            linear(num_samples as f64 / 2.0 / layout.range_length as f64),
            linear(longest as f64 / 2.0 / layout.doppler_length as f64) / 5f64.sqrt(),
        ]);
        goal.check(planned_db, || {
            Reason::new("the thesis's range-Doppler approximation with sub-CPIs of this length")
                .helped_by(&[Remedy::Smaller(&["sub_cpi"]), PRECISE])
        })?;
        Ok(Decision {
            choices: *self,
            settings: json!({
                "mode": "thesis",
                "keystone": self.keystone,
                "doppler_padding": self.doppler_padding,
                "sub_cpi_pulses": longest,
                "sub_cpis": layout.sub_cpis.len(),
                "doppler_length": layout.doppler_length,
                "range_length": layout.range_length,
            }),
            planned_db,
            grain: PatchSize::PIXEL,
            cost: cost::thesis(spec, &layout, self.keystone),
        })
    }
}

/// Plan opened for forming.
pub(super) struct Opened<'a> {
    spec: ImageSpec<'a>,
    choices: Choices,
    band: Band,
    sub_cpis: Vec<Range<usize>>,
    /// Pulses of the longest sub-CPI.
    longest: usize,
    doppler_length: usize,
    range_length: usize,
    /// Normalised window over fast time.
    fast: Vec<f32>,
    norm: f64,
    doppler_fft: Arc<dyn Fft<f32>>,
    range_fft: Arc<dyn Fft<f32>>,
}

/// Samples, Doppler spectra and map of a sub-CPI.
struct Buffers {
    doppler: Vec<Complex32>,
    map: Vec<Complex32>,
}

impl<'a> Opened<'a> {
    pub(super) fn new(spec: ImageSpec<'a>, choices: Choices) -> Result<Self, FormError> {
        let Layout {
            band,
            sub_cpis,
            longest,
            doppler_length,
            range_length,
        } = choices.layout(&spec)?;
        Ok(Self {
            sub_cpis,
            longest,
            doppler_length,
            range_length,
            fast: spec.weights.fast.iter().map(|&w| w as f32).collect(),
            norm: spec.weights.normalisation(),
            doppler_fft: spec.numerics.transforms.inverse(doppler_length),
            range_fft: spec.numerics.transforms.inverse(range_length),
            band,
            spec,
            choices,
        })
    }

    fn buffers(&self, memory_bytes: u64) -> Result<Buffers, FormError> {
        let (num_samples, longest) = (self.band.count, self.longest);
        let mut budget = Budget::new(memory_bytes);
        let remedies = &[Remedy::Smaller(&["sub_cpi"]), PRECISE, Remedy::MoreMemory];
        let map_values = self.doppler_length as u128 * (self.range_length + num_samples) as u128;
        budget.take("a range-Doppler map", map_values * 8, remedies)?;
        if self.choices.keystone {
            let weight_bytes = 2 * u128::from(SincKeystone::bytes(num_samples, longest));
            budget.take("Keystone weights", weight_bytes, remedies)?;
        }
        let held = (longest * num_samples * BLOCKS_HELD) as u128;
        budget.take("a sub-CPI", held * 8, remedies)?;
        let zeros = |count: usize| vec![Complex32::ZERO; count];
        Ok(Buffers {
            doppler: zeros(num_samples * self.doppler_length),
            map: zeros(self.doppler_length * self.range_length),
        })
    }

    /// Weight the samples of `pulses`.
    fn weight(&self, pulses: &Range<usize>, samples: &mut [Complex32]) {
        for (n, row) in pulses
            .clone()
            .zip(samples.chunks_exact_mut(self.band.count))
        {
            let slow = (self.spec.weights.slow[n] * self.norm) as f32;
            row.iter_mut()
                .zip(&self.fast)
                .for_each(|(z, w)| *z *= w * slow);
        }
    }

    /// Transform from slow time to Doppler, frequency by frequency.
    fn to_doppler(
        &self,
        work: &Work,
        samples: &[Complex32],
        m: usize,
        resampler: Option<&SincKeystone>,
        doppler: &mut [Complex32],
    ) {
        let (length, fft) = (self.doppler_length, &self.doppler_fft);
        let scratch = || {
            let buffer = vec![Complex32::ZERO; fft.get_inplace_scratch_len().max(2 * m)];
            (buffer, during(work.monitor, MAPS))
        };
        doppler
            .par_chunks_exact_mut(length)
            .enumerate()
            .for_each_init(scratch, |(scratch, _), (k, row)| {
                let (slow, resampled) = scratch.split_at_mut(m);
                for (z, pulse) in slow.iter_mut().zip(samples.chunks_exact(self.band.count)) {
                    *z = pulse[k];
                }
                match resampler {
                    Some(resampler) => resampler.resample(k, slow, resampled),
                    None => resampled[..m].copy_from_slice(slow),
                }
                row.fill(Complex32::ZERO);
                for (i, z) in resampled[..m].iter().enumerate() {
                    row[(i + length - m / 2) % length] = *z;
                }
                fft.process_with_scratch(row, scratch);
            });
    }

    /// Transform from frequency to range, Doppler bin by Doppler bin.
    fn to_range(&self, work: &Work, doppler: &[Complex32], map: &mut [Complex32]) {
        let (length, fft) = (self.range_length, &self.range_fft);
        let scratch = || {
            let buffer = vec![Complex32::ZERO; fft.get_inplace_scratch_len()];
            (buffer, during(work.monitor, MAPS))
        };
        map.par_chunks_exact_mut(length).enumerate().for_each_init(
            scratch,
            |(scratch, _), (d, row)| {
                row.fill(Complex32::ZERO);
                for (k, values) in doppler.chunks_exact(self.doppler_length).enumerate() {
                    row[(k + length - self.band.count / 2) % length] = values[d];
                }
                fft.process_with_scratch(row, scratch);
            },
        );
    }

    /// Add the map of a sub-CPI to every pixel.
    fn add(&self, work: &Work, pulses: &Range<usize>, map: &[Complex32], tiles: &mut [Tile]) {
        let cycles_m = self.band.centre_hz() / SPEED_OF_LIGHT_M_S;
        let range_bins_m = self.range_length as f64 * self.band.step_hz / SPEED_OF_LIGHT_M_S;
        let lengths = [self.doppler_length, self.range_length];
        let state = CentreState::new(self.spec.collection, pulses.clone());
        let m = pulses.len();
        // Slow time was rotated by whole pulses; for even M half a pulse remains.
        let left_over = (m as f64 - 1.0) / 2.0 - (m / 2) as f64;
        for_each(
            self.spec.grid,
            tiles,
            work.monitor,
            PIXELS,
            |point, pixel| {
                let (path_m, rate_m) = state.path_and_rate(point);
                let nu = rate_m * cycles_m;
                let place = [nu * lengths[0] as f64, path_m * range_bins_m];
                let value = bilinear(map, lengths, place);
                *pixel += value * phasor32(path_m * cycles_m - nu * left_over);
            },
        );
    }
}

impl Forming for Opened<'_> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let mut buffers = self.buffers(work.memory_bytes)?;
        let mut resampler: Option<(usize, SincKeystone)> = None;
        let mut done = 0;
        read_ahead(
            work.history,
            self.sub_cpis.iter().cloned(),
            |pulses, samples| {
                let m = pulses.len();
                self.weight(&pulses, samples);
                if work.monitor.cancelled() {
                    return Err(FormError::Cancelled);
                }
                if self.choices.keystone
                    && resampler.as_ref().is_none_or(|(length, _)| *length != m)
                {
                    resampler = Some((m, SincKeystone::new(&self.band.scales(), m)));
                }
                let resampler = resampler.as_ref().map(|(_, resampler)| resampler);
                self.to_doppler(work, samples, m, resampler, &mut buffers.doppler);
                self.to_range(work, &buffers.doppler, &mut buffers.map);
                self.add(work, &pulses, &buffers.map, tiles);
                if work.monitor.cancelled() {
                    return Err(FormError::Cancelled);
                }
                done += 1;
                work.monitor
                    .progress(f64::from(done) / self.sub_cpis.len() as f64);
                Ok(())
            },
        )
    }
}

/// Interpolate `map` (rows of `lengths[1]`, both axes periodic) bilinearly at a fractional index.
fn bilinear(map: &[Complex32], lengths: [usize; 2], place: [f64; 2]) -> Complex32 {
    let split = |x: f64, length: usize| {
        let whole = x.floor();
        let first = (whole as i64).rem_euclid(length as i64) as usize;
        (first, (first + 1) % length, (x - whole) as f32)
    };
    let (d0, d1, d) = split(place[0], lengths[0]);
    let (r0, r1, r) = split(place[1], lengths[1]);
    let line = |row: usize| {
        let values = &map[row * lengths[1]..(row + 1) * lengths[1]];
        values[r0] + (values[r1] - values[r0]) * r
    };
    let (low, high) = (line(d0), line(d1));
    low + (high - low) * d
}

/// Largest number of sub-CPIs sampled for the prediction.
const PROBED_SUB_CPIS: usize = 8;

/// Effective weights of the samples for a pixel.
struct Reading<'a> {
    spec: &'a ImageSpec<'a>,
    band: &'a Band,
    keystone: bool,
}

impl Reading<'_> {
    /// Relative RMS error of the terms of the worst sampled pixel in some of `sub_cpis`, with exact interpolation of
    /// the maps.
    fn worst(&self, sub_cpis: &[Range<usize>]) -> f64 {
        let step = sub_cpis.len().div_ceil(PROBED_SUB_CPIS).max(1);
        let some: Vec<&Range<usize>> = sub_cpis
            .iter()
            .step_by(step)
            .chain(sub_cpis.last())
            .collect();
        let last = self.band.count - 1;
        let mut frequencies = vec![0, last / 4, last / 2, last - last / 4, last];
        frequencies.dedup();
        some.par_iter()
            .map(|pulses| self.error(pulses, &frequencies))
            .reduce(|| 0.0, f64::max)
    }

    /// Error of one sub-CPI: the factor `sum_i W[i][m] exp(j 2 pi nu u_i)` applied to sample `m`, compared with the
    /// exact factor.
    fn error(&self, pulses: &Range<usize>, frequencies: &[usize]) -> f64 {
        let collection = self.spec.collection;
        let m = pulses.len();
        let centre = (m as f64 - 1.0) / 2.0;
        let state = CentreState::new(collection, pulses.clone());
        let cycles_m = self.band.centre_hz() / SPEED_OF_LIGHT_M_S;
        let grid = self.spec.grid;
        let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
        let mut points: Vec<_> = [0, rows / 2, rows]
            .into_iter()
            .flat_map(|row| [0, columns / 2, columns].map(|column| (row, column)))
            .collect();
        points.dedup();
        let mut sums = vec![0.0; points.len()];
        let mut row = vec![0.0; m];
        for &k in frequencies {
            let frequency_hz = self.band.frequency_hz(k);
            let scale = frequency_hz / self.band.centre_hz();
            let states: Vec<_> = points
                .iter()
                .map(|&(row, column)| {
                    let point = grid.position_m(row, column);
                    (point, state.path_and_rate(point))
                })
                .collect();
            let mut taken = vec![Complex64::ZERO; m * points.len()];
            for i in 0..m {
                for (place, weight) in row.iter_mut().enumerate() {
                    *weight = if self.keystone {
                        sinc((i as f64 - centre) / scale + centre - place as f64)
                    } else {
                        f64::from(u8::from(i == place))
                    };
                }
                for (taken, (_, (_, rate_m))) in taken.chunks_exact_mut(m).zip(&states) {
                    let turn = phasor(rate_m * cycles_m * (i as f64 - centre));
                    for (taken, weight) in taken.iter_mut().zip(&row) {
                        *taken += turn * weight;
                    }
                }
            }
            for ((sum, taken), (point, (path_m, _))) in
                sums.iter_mut().zip(taken.chunks_exact(m)).zip(&states)
            {
                for (n, taken) in pulses.clone().zip(taken) {
                    let left_m = path_m - collection.pulses[n].relative_path_m(*point);
                    let turn = phasor(left_m * frequency_hz / SPEED_OF_LIGHT_M_S);
                    *sum += (taken * turn - 1.0).norm_sqr();
                }
            }
        }
        let count = (m * frequencies.len()) as f64;
        (sums.into_iter().fold(0.0, f64::max) / count).sqrt()
    }
}
