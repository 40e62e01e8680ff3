//! Transform of a patch's samples from slow time to Doppler: motion compensation to the centre, then Keystone and Doppler in one step.
//!
//! Two algorithms compute the same transform; the faster by the timing model ([`super::times`]) is used: a matrix product
//! ([`subaperture_kernels::doppler`]) for few bins, the usual case, and chirp-z ([`subaperture_signal::scaled_dft`]) for many pulses and bins.
//! Both process blocks of frequencies, whose samples of all pulses stay in cache.

use glam::DVec3;
use num_complex::Complex32;

use super::times;
use crate::TimeModel;
use crate::sub_cpi::SubCpi;
use subaperture_fft::Transforms;
use subaperture_kernels::compensation::{GroupRamp, Ramp, refer_to_planes};
use subaperture_kernels::doppler::{BLOCK, DopplerProduct, MapRows};
use subaperture_kernels::lanes::Instructions;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Collection;
use subaperture_signal::phase::{narrow, phasor};
use subaperture_signal::scaled_dft::{ScaledDft, Shape};

/// Doppler transform of sub-CPIs of one length.
pub(super) enum Doppler {
    Product(DopplerProduct),
    Chirp(ScaledDft),
}

/// Compensation and weighting of every sample before the transform.
pub(super) struct Compensation<'a> {
    pub(super) collection: &'a Collection,
    /// Weights of the frequency samples, including the pre-emphasis for range interpolation.
    pub(super) fast: &'a [f32],
    /// Slow-time weights of the pulses.
    pub(super) slow: &'a [f64],
    /// Common factor of all weights.
    pub(super) norm: f64,
    pub(super) instructions: Instructions,
}

/// Buffer size per pulse of the longest sub-CPI for one thread, bytes: a block of its samples, and its phase ramp.
pub(super) const PULSE_BYTES: usize = 8 * BLOCK + size_of::<GroupRamp>();

/// Scratch buffers of one thread.
pub(super) struct DopplerScratch {
    /// Compensated samples of a block, `[pulse][real, imaginary][BLOCK]`.
    planes: Vec<f32>,
    ramps: Vec<GroupRamp>,
    sums: Vec<f32>,
    /// Slow-time samples of one frequency, and scratch of its transform.
    row: Vec<Complex32>,
    chirp: Vec<Complex32>,
}

impl Doppler {
    pub(super) fn new(
        model: &TimeModel,
        transforms: Transforms,
        scales: &[f64],
        shape: Shape,
        weight: impl Fn(usize, usize) -> f64,
    ) -> Self {
        match times::by_product(model, &shape) {
            true => Self::Product(DopplerProduct::new(scales, &shape, weight)),
            false => Self::Chirp(ScaledDft::new(transforms, scales, shape, weight)),
        }
    }

    /// Number of Doppler bins.
    pub(super) fn outputs(&self) -> usize {
        match self {
            Self::Product(product) => product.outputs(),
            Self::Chirp(dft) => dft.shape().outputs,
        }
    }

    /// Compensate the samples of a sub-CPI to `centre`, pulse by pulse, and write their spectra to the rows of the map.
    pub(super) fn map(
        &self,
        compensation: &Compensation,
        sub_cpi: &SubCpi,
        centre: DVec3,
        samples: &[Complex32],
        scratch: &mut DopplerScratch,
        map: &mut MapRows,
    ) {
        let num_samples = compensation.fast.len();
        compensation.begin(sub_cpi, centre, scratch);
        for block in 0..num_samples.div_ceil(BLOCK) {
            compensation.block(sub_cpi, centre, samples, block, scratch);
            let instructions = compensation.instructions;
            let planes = &scratch.planes[..2 * BLOCK * sub_cpi.num_pulses()];
            match self {
                Self::Product(product) => {
                    product.transform(instructions, block, planes, &mut scratch.sums, map);
                }
                Self::Chirp(dft) => {
                    let row = &mut scratch.row[..sub_cpi.num_pulses()];
                    for k in block * BLOCK..num_samples.min((block + 1) * BLOCK) {
                        for (z, pulse) in row.iter_mut().zip(planes.chunks_exact(2 * BLOCK)) {
                            *z = Complex32::new(pulse[k % BLOCK], pulse[BLOCK + k % BLOCK]);
                        }
                        let place = (map.first + k) % map.length;
                        dft.transform(k, row, &mut scratch.chirp, |d, value| {
                            let row = &mut map.values[2 * d * map.row_length..];
                            (row[place], row[map.row_length + place]) = (value.re, value.im);
                        });
                    }
                }
            }
        }
    }
}

impl Compensation<'_> {
    fn slow_weight(&self, n: usize) -> f64 {
        self.slow[n] * self.norm
    }

    /// Initialise the phase ramps of a sub-CPI's pulses; not used with intra-pulse motion.
    fn begin(&self, sub_cpi: &SubCpi, centre: DVec3, scratch: &mut DopplerScratch) {
        scratch.ramps.clear();
        let pulses = &self.collection.pulses[sub_cpi.pulses.clone()];
        if pulses.iter().any(|pulse| !pulse.sweep.is_at_once()) {
            return;
        }
        for (n, pulse) in sub_cpi.pulses.clone().zip(pulses) {
            let delay_s = pulse.relative_path_m(centre) / SPEED_OF_LIGHT_M_S;
            let turns = [pulse.start_hz * delay_s, pulse.step_hz * delay_s];
            let ramp = Ramp::new(turns[0], turns[1], self.slow_weight(n));
            scratch.ramps.push(GroupRamp::new(ramp));
        }
    }

    /// Compensate and weight every sample of the next block with the phase referred to the patch centre.
    fn block(
        &self,
        sub_cpi: &SubCpi,
        centre: DVec3,
        samples: &[Complex32],
        block: usize,
        scratch: &mut DopplerScratch,
    ) {
        let num_samples = self.fast.len();
        let own = block * BLOCK..num_samples.min((block + 1) * BLOCK);
        let weights = &self.fast[own.clone()];
        if !scratch.ramps.is_empty() {
            refer_to_planes(
                self.instructions,
                &samples[own.start..],
                num_samples,
                weights,
                &mut scratch.ramps,
                &mut scratch.planes,
                BLOCK,
            );
            return;
        }
        let rows = samples.chunks_exact(num_samples);
        let planes = scratch.planes.chunks_exact_mut(2 * BLOCK);
        for ((n, row), planes) in sub_cpi.pulses.clone().zip(rows).zip(planes) {
            let pulse = &self.collection.pulses[n];
            let (real, imaginary) = planes.split_at_mut(BLOCK);
            let parts = real.iter_mut().zip(imaginary);
            let slow_weight = self.slow_weight(n);
            for (((k, z), w), (re, im)) in
                own.clone().zip(&row[own.clone()]).zip(weights).zip(parts)
            {
                let after = k as f64 - (num_samples / 2) as f64;
                let path_m = pulse.relative_path_after_m(centre, after);
                let turns = pulse.frequency_hz(k) * (path_m / SPEED_OF_LIGHT_M_S);
                let value = z * narrow(phasor(turns) * slow_weight) * w;
                (*re, *im) = (value.re, value.im);
            }
        }
    }
}

impl DopplerScratch {
    /// Allocate buffers for any of the transforms and sub-CPIs of at most `pulses`.
    pub(super) fn new<'a>(all: impl Iterator<Item = &'a Doppler>, pulses: usize) -> Self {
        let [sums, row, chirp] = Self::lengths(all, pulses);
        Self {
            planes: vec![0.0; 2 * BLOCK * pulses],
            ramps: Vec::with_capacity(pulses),
            sums: vec![0.0; sums],
            row: vec![Complex32::ZERO; row],
            chirp: vec![Complex32::ZERO; chirp],
        }
    }

    /// Size of these buffers, bytes.
    pub(super) fn bytes<'a>(all: impl Iterator<Item = &'a Doppler>, pulses: usize) -> u64 {
        let [sums, row, chirp] = Self::lengths(all, pulses);
        (PULSE_BYTES * pulses + 4 * sums + 8 * (row + chirp)) as u64
    }

    fn lengths<'a>(all: impl Iterator<Item = &'a Doppler>, pulses: usize) -> [usize; 3] {
        let mut lengths = [0; 3];
        for doppler in all {
            let own = match doppler {
                Doppler::Product(product) => [product.scratch_length(), 0, 0],
                Doppler::Chirp(dft) => [0, pulses, dft.scratch_length()],
            };
            for (length, own) in lengths.iter_mut().zip(own) {
                *length = own.max(*length);
            }
        }
        lengths
    }
}
