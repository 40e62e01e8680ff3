//! Range-Doppler maps of all channels in each sub-CPI.
//!
//! The pulses of a sub-CPI are compensated to the centre of the scene with the antenna positions of their channel, and transformed over the along-track
//! position `s` of their phase centres and over frequency,
//!
//! ```text
//! x_c(a, nu) = sum_n w_c[n] sum_k w[k] z_c[n][k] exp(+j 2 pi (f_k / f_c) nu u_c[n]) exp(+j 2 pi (k - K/2) step a / c),   u_c[n] = (s_c[n] - s_m) / spacing
//! ```
//!
//! with the Keystone factor `f_k / f_c` in the Doppler kernel, or 1 without Keystone. A target of the path `a_h` and the path rate `b_h` per pulse spacing, both
//! relative to the centre of the scene, has the value `A exp(-j 2 pi f_c a_h,c / c)` at `a = a_h`, `nu = f_c b_h / c`. Stationary scatterers are equal in all channels, because `u_c` is a
//! position and not a time.
//!
//! The Doppler axis extends beyond half a cycle per pulse where the largest speed does. Its parts beyond are the same spectrum with the Keystone factor of another fold, so that a target
//! is focused in its own fold.

use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use subaperture_fft::Fft;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Band, Channels, PhaseHistory};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::phase::{narrow, phasor};
use subaperture_signal::scaled_dft::{ScaledDft, Shape};
use subaperture_signal::windowed_sinc::WindowedSinc;

use super::clean::{Cleaned, Echo};
use super::geometry::{Place, SubCpiGeometry};
use super::settings::Settings;
use crate::alignment::Alignment;
use crate::balance::{Balanced, ChannelBalance, read_at, shared_band};
use crate::error::GmtiError;

/// Samples of a map per resolution cell, along both axes.
pub(super) const OVERSAMPLING: usize = 2;

/// Taps of the interpolation along each axis: -67 dB.
pub(super) const TAPS: usize = 8;

/// Largest deviation of pulses from even spacing in a sub-CPI, pulse spacings.
const UNEVEN: f64 = 0.02;

/// Axes of the maps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    /// Path of a range bin, metres.
    pub(super) path_step_m: f64,
    /// Index of the first range bin, from that of the centre of the scene.
    pub(super) first_range: i64,
    pub(super) ranges: usize,
    /// Cycles per pulse spacing of a Doppler bin.
    pub(super) doppler_step: f64,
    /// Index of the bin of zero Doppler.
    pub(super) zero_doppler: usize,
    pub(super) dopplers: usize,
}

/// Maps of all sub-CPIs and channels.
pub(super) struct Cube {
    pub(super) axes: Axes,
    pub(super) band: Band,
    /// Mean pulse spacing, metres.
    pub(super) spacing_m: f64,
    pub(super) sub_cpis: Vec<SubCpiGeometry>,
    channels: usize,
    /// Memory of the maps and of forming them, bytes.
    pub(super) bytes: u64,
    /// Maps of each sub-CPI, `[channel][doppler][range]`.
    maps: Vec<Vec<Complex32>>,
    kernel: WindowedSinc,
}

/// Transforms of the maps.
struct Transform {
    doppler: ScaledDft,
    range: Arc<dyn Fft<f32>>,
    fast: Vec<f32>,
}

impl Cube {
    /// Form the maps of `channels` with `balances` and the echoes of `targets` of each channel removed, for the scene of these `corners_m` about `centre_m`.
    pub(super) fn form(
        channels: &Channels,
        alignment: &Alignment,
        balances: &[ChannelBalance],
        targets: &[Vec<Echo>],
        (centre_m, corners_m): (DVec3, &[DVec3]),
        settings: &Settings,
    ) -> Result<Self, GmtiError> {
        let band = shared_band(channels)?;
        let [start_m, end_m] = alignment.section_m();
        let own = alignment.along_m(0);
        let spacing_m = (own[own.len() - 1] - own[0]) / (own.len() - 1) as f64;
        let length_m = (end_m - start_m) / settings.sub_cpis as f64;
        let pulses = (length_m / spacing_m).ceil() as usize + 1;
        if length_m < 4.0 * spacing_m {
            return Err(GmtiError::Unsuited(format!(
                "expected sub-CPIs of at least 4 pulses, found {:.1}: choose fewer than {} sub-CPIs",
                length_m / spacing_m,
                settings.sub_cpis
            )));
        }
        let geometry = |i: usize| {
            let at = |i: usize| start_m + length_m * i as f64;
            SubCpiGeometry::new(channels, alignment, [at(i), at(i + 1)], centre_m)
        };
        let sub_cpis: Vec<SubCpiGeometry> = (0..settings.sub_cpis).map(geometry).collect();
        let axes = axes(&band, &sub_cpis, corners_m, spacing_m, alignment, settings);
        let size = channels.len() * axes.dopplers * axes.ranges;
        let length = fast_length(OVERSAMPLING * band.count);
        let needed_bytes = 8 * (settings.sub_cpis * size) as u64
            + ScaledDft::table_bytes(band.count, pulses, axes.dopplers)
            + 8 * (rayon::current_num_threads() * (pulses + axes.dopplers) * length) as u64;
        if needed_bytes > settings.memory_bytes {
            return Err(GmtiError::SubCpiMemory {
                sub_cpis: settings.sub_cpis,
                needed_bytes,
                allowed_bytes: settings.memory_bytes,
            });
        }
        let scales = match settings.keystone {
            true => band.scales(),
            false => vec![1.0; band.count],
        };
        let shape = Shape {
            inputs: pulses,
            input_centre: (pulses - 1) as f64 / 2.0,
            input_drift: 0.0,
            outputs: axes.dopplers,
            output_centre: axes.zero_doppler as f64,
            spacing: axes.doppler_step,
        };
        let [fast, slow] = settings.windows;
        let weights = fast.weights(band.count);
        let norm = 1.0 / weights.iter().sum::<f64>();
        let transforms = settings.transforms;
        let transform = Transform {
            doppler: ScaledDft::new(transforms, &scales, shape, |_, _| 1.0),
            range: transforms.inverse(length),
            fast: weights
                .iter()
                .map(|weight| (weight * norm) as f32)
                .collect(),
        };
        let form = |geometry: &SubCpiGeometry| {
            let mut maps = Vec::with_capacity(size);
            for (c, balance) in balances.iter().enumerate() {
                let balanced = Balanced::new(channels.channel(c), balance);
                let history = Cleaned::new(&balanced, &targets[c]);
                let weights = alignment.slow_weights(c, geometry.section_m, slow);
                let along_m = alignment.along_m(c);
                let first = centred(along_m, geometry.section_m, spacing_m, pulses);
                let offset = offset(along_m, geometry.section_m, spacing_m, first, pulses)?;
                let samples = samples(&history, &weights, first, pulses, centre_m)?;
                transform.map(&axes, &scales, offset, samples, &mut maps);
            }
            Ok(maps)
        };
        let maps: Result<Vec<_>, GmtiError> = sub_cpis.par_iter().map(form).collect();
        Ok(Self {
            axes,
            band,
            spacing_m,
            sub_cpis,
            channels: channels.len(),
            bytes: needed_bytes,
            maps: maps?,
            kernel: WindowedSinc::new(TAPS, 0.5 / OVERSAMPLING as f64),
        })
    }

    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// Value of each channel in a cell of a sub-CPI.
    pub(super) fn cell(&self, sub_cpi: usize, [doppler, range]: [usize; 2], out: &mut [Complex32]) {
        let size = self.axes.dopplers * self.axes.ranges;
        let place = doppler * self.axes.ranges + range;
        for (c, out) in out.iter_mut().enumerate() {
            *out = self.maps[sub_cpi][c * size + place];
        }
    }

    /// Fractional Doppler bin of a slope, metres of path per metre of track.
    pub(super) fn doppler_bin(&self, slope: f64) -> f64 {
        let cycles = self.band.centre_hz() / SPEED_OF_LIGHT_M_S * slope * self.spacing_m;
        cycles / self.axes.doppler_step + self.axes.zero_doppler as f64
    }

    /// Fractional Doppler and range bin of a place.
    pub(super) fn bins(&self, place: &Place) -> [f64; 2] {
        let range = place.path_m() / self.axes.path_step_m - self.axes.first_range as f64;
        [self.doppler_bin(place.slope), range]
    }

    /// Relative path, metres, and slope, metres per metre of track, of a Doppler and range bin.
    pub(super) fn path_and_slope(&self, [doppler, range]: [f64; 2]) -> (f64, f64) {
        let cycles = (doppler - self.axes.zero_doppler as f64) * self.axes.doppler_step;
        let slope = cycles * SPEED_OF_LIGHT_M_S / self.band.centre_hz() / self.spacing_m;
        let bins = range + self.axes.first_range as f64;
        (bins * self.axes.path_step_m, slope)
    }

    /// Interpolate all channels at fractional bins. `false` outside of the maps.
    pub(super) fn interpolate(
        &self,
        sub_cpi: usize,
        [doppler, range]: [f64; 2],
        out: &mut [Complex32],
    ) -> bool {
        let Axes {
            ranges, dopplers, ..
        } = self.axes;
        let half = (TAPS / 2) as f64;
        let inside = |at: f64, count: usize| at >= half - 1.0 && at < count as f64 - half;
        if !(inside(doppler, dopplers) && inside(range, ranges)) {
            return false;
        }
        let weights = |at: f64| self.kernel.weights::<TAPS>((at - at.floor()) as f32);
        let (rows, columns) = (weights(doppler), weights(range));
        let first = |at: f64| at as usize + 1 - TAPS / 2;
        let (row, column) = (first(doppler), first(range));
        let maps = self.maps[sub_cpi].chunks_exact(dopplers * ranges);
        for (out, map) in out.iter_mut().zip(maps) {
            let mut sum = Complex32::ZERO;
            for (i, weight) in rows.iter().enumerate() {
                let line = &map[(row + i) * ranges + column..][..TAPS];
                let terms = line.iter().zip(&columns);
                let line_sum = terms.fold(Complex32::ZERO, |sum, (z, w)| sum + z * w);
                sum += line_sum * weight;
            }
            *out = sum;
        }
        true
    }
}

/// Extent of the maps: all places of the scene, and targets of the largest speed.
fn axes(
    band: &Band,
    sub_cpis: &[SubCpiGeometry],
    corners_m: &[DVec3],
    spacing_m: f64,
    alignment: &Alignment,
    settings: &Settings,
) -> Axes {
    let length = fast_length(OVERSAMPLING * band.count);
    let path_step_m = SPEED_OF_LIGHT_M_S / (length as f64 * band.step_hz);
    let length_m = sub_cpis[0].section_m[1] - sub_cpis[0].section_m[0];
    let doppler_step = spacing_m / length_m / OVERSAMPLING as f64;
    let mut place = Place::default();
    let (mut paths_m, mut slopes) = ([f64::MAX, f64::MIN], [f64::MAX, f64::MIN]);
    let widen = |ends: &mut [f64; 2], value: f64| {
        *ends = [ends[0].min(value), ends[1].max(value)];
    };
    for sub_cpi in sub_cpis {
        for &corner_m in corners_m {
            sub_cpi.place(|_| corner_m, &mut place);
            widen(&mut paths_m, place.paths_m[0]);
            widen(&mut slopes, place.slope);
        }
    }
    let moved_m = settings.max_speed_m_s * alignment.duration_s();
    let own_slope = 2.0 * settings.max_speed_m_s / alignment.speed_m_s();
    let bins_a_slope = band.centre_hz() / SPEED_OF_LIGHT_M_S * spacing_m / doppler_step;
    let margin = TAPS as f64;
    let zero_doppler = ((own_slope - slopes[0].min(0.0)) * bins_a_slope + margin).ceil() as usize;
    let above = ((own_slope + slopes[1].max(0.0)) * bins_a_slope + margin).ceil() as usize;
    let first = ((paths_m[0] - moved_m) / path_step_m - margin).floor() as i64;
    let last = ((paths_m[1] + moved_m) / path_step_m + margin).ceil() as i64;
    let all = length as i64;
    let (first, ranges) = match last - first + 1 < all {
        true => (first, last - first + 1),
        false => (-all / 2, all),
    };
    Axes {
        path_step_m,
        first_range: first,
        ranges: ranges as usize,
        doppler_step,
        zero_doppler,
        dopplers: zero_doppler + above + 1,
    }
}

/// First pulse of the `pulses` about the middle of a section; negative before the recording.
fn centred(along_m: &[f64], [start_m, end_m]: [f64; 2], spacing_m: f64, pulses: usize) -> i64 {
    let middle_m = (start_m + end_m) / 2.0;
    let after = along_m
        .partition_point(|&s| s < middle_m)
        .min(along_m.len() - 1);
    let index = after as f64 - (along_m[after] - middle_m) / spacing_m;
    (index - (pulses - 1) as f64 / 2.0).round() as i64
}

/// Mean position of pulses relative to the middle of the section, pulse spacings, for an even spacing.
fn offset(
    along_m: &[f64],
    [start_m, end_m]: [f64; 2],
    spacing_m: f64,
    first: i64,
    pulses: usize,
) -> Result<f64, GmtiError> {
    let middle_m = (start_m + end_m) / 2.0;
    let own =
        first.max(0) as usize..(first + pulses as i64).clamp(0, along_m.len() as i64) as usize;
    let deviation = |n: usize| (along_m[n] - middle_m) / spacing_m - (n as i64 - first) as f64;
    let mean = own.clone().map(deviation).sum::<f64>() / own.len() as f64;
    let most = own.map(|n| (deviation(n) - mean).abs()).fold(0.0, f64::max);
    match most <= UNEVEN * pulses as f64 {
        true => Ok(mean + (pulses - 1) as f64 / 2.0),
        false => Err(GmtiError::Track(
            "expected an even pulse spacing in each sub-CPI: choose shorter sub-CPIs or detect on whole images",
        )),
    }
}

/// Compensated and weighted samples of the pulses from `first`; zeros outside of the recording.
fn samples(
    history: &dyn PhaseHistory,
    weights: &[f64],
    first: i64,
    pulses: usize,
    centre_m: DVec3,
) -> Result<Vec<Complex32>, GmtiError> {
    let count = history.collection().num_samples;
    let end = (first + pulses as i64).clamp(0, weights.len() as i64) as usize;
    let own = first.max(0) as usize..end;
    let mut read = Vec::new();
    read_at(history, own.clone(), centre_m, &mut read)?;
    let norm = 1.0 / weights[own.clone()].iter().sum::<f64>();
    for (line, weight) in read.chunks_exact_mut(count).zip(&weights[own.clone()]) {
        let factor = (weight * norm) as f32;
        line.iter_mut().for_each(|z| *z *= factor);
    }
    let mut all = vec![Complex32::ZERO; pulses * count];
    let place = (own.start as i64 - first) as usize * count;
    all[place..place + read.len()].copy_from_slice(&read);
    Ok(all)
}

impl Transform {
    /// Append the map of a channel to `maps`. `offset` is the position of the middle pulse, pulse spacings.
    fn map(
        &self,
        axes: &Axes,
        scales: &[f64],
        offset: f64,
        samples: Vec<Complex32>,
        maps: &mut Vec<Complex32>,
    ) {
        let count = self.fast.len();
        let length = self.range.len();
        let inputs = self.doppler.shape().inputs;
        let mut rows = vec![Complex32::ZERO; axes.dopplers * length];
        let mut scratch = vec![Complex32::ZERO; self.doppler.scratch_length()];
        let mut pulse = vec![Complex32::ZERO; inputs];
        for (k, &fast) in self.fast.iter().enumerate() {
            for (n, z) in pulse.iter_mut().enumerate() {
                *z = samples[n * count + k] * fast;
            }
            // Sample K/2 has no phase over range.
            let column = (k + length - count / 2) % length;
            let cycles = scales[k] * axes.doppler_step * offset;
            self.doppler.transform(k, &pulse, &mut scratch, |d, value| {
                let turn = cycles * (d as f64 - axes.zero_doppler as f64);
                rows[d * length + column] = value * narrow(phasor(turn));
            });
        }
        scratch.resize(self.range.get_inplace_scratch_len(), Complex32::ZERO);
        for row in rows.chunks_exact_mut(length) {
            self.range.process_with_scratch(row, &mut scratch);
            let bin = |i: usize| (axes.first_range + i as i64).rem_euclid(length as i64) as usize;
            maps.extend((0..axes.ranges).map(|i| row[bin(i)]));
        }
    }
}
