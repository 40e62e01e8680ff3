//! Phase history of a patch.

use glam::DVec3;
use num_complex::Complex32;

use super::decimations::Decimations;
use super::thinned::Stretch;
use subaperture_kernels::decimation::{Layout, decimated};
use subaperture_model::phase_history::Collection;

/// Axes of a history: decimated pulses and frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    /// Number of decimations over pulses.
    pub(super) thinning: usize,
    /// Number of decimations over samples, and factor of the next one.
    pub(super) decimations: usize,
    pub(super) factor: usize,
    pub(super) start_hz: f64,
    pub(super) step_hz: f64,
    pub(super) num_samples: usize,
}

impl Axes {
    /// Axes of the recorded samples.
    pub(super) fn recorded(collection: &Collection, decimations: &Decimations) -> Self {
        let first = &collection.pulses[0];
        Self {
            thinning: 0,
            decimations: 0,
            factor: decimations.factor(1, 0),
            start_hz: first.start_hz,
            step_hz: first.step_hz,
            num_samples: collection.num_samples,
        }
    }

    /// Axes after decimation over pulses and over samples with the given number of taps.
    pub(super) fn after(&self, [pulses, samples]: [bool; 2], taps: usize) -> Self {
        let mut after = *self;
        after.thinning += usize::from(pulses);
        if samples {
            let factor = self.factor;
            after.start_hz = self.frequency_hz(-((factor * (taps / 2 - 1)) as f64));
            after.step_hz = factor as f64 * self.step_hz;
            after.num_samples = decimated(self.num_samples, factor, taps);
            after.decimations += 1;
            after.factor = 2;
        }
        after
    }

    /// Numbers of decimations over pulses and over samples.
    pub(super) fn made(&self) -> [usize; 2] {
        [self.thinning, self.decimations]
    }

    pub(super) fn frequency_hz(&self, k: f64) -> f64 {
        self.start_hz + k * self.step_hz
    }

    pub(super) fn highest_hz(&self) -> f64 {
        let last_hz = self.frequency_hz((self.num_samples - 1) as f64);
        last_hz.abs().max(self.start_hz.abs())
    }

    pub(super) fn layout(&self) -> Layout {
        Layout::new(self.num_samples, self.factor)
    }

    /// Size of such a history, bytes.
    pub(super) fn bytes(&self, stretch: &Stretch) -> u64 {
        let pulses = stretch.thinned[self.thinning].antennas.len() as u64;
        pulses * (4 * self.layout().values() as u64 + size_of::<f64>() as u64)
    }
}

/// Samples with phases referred to a point.
pub(super) struct PatchHistory {
    pub(super) axes: Axes,
    /// Reference point of the phases, scene frame, metres.
    pub(super) centre: DVec3,
    /// Path from the antennas of each pulse to the reference point, metres.
    pub(super) data_m: Vec<f64>,
    /// Samples pulse by pulse, in the order of [`Layout`].
    pub(super) values: Vec<f32>,
}

impl PatchHistory {
    /// Make a history without samples.
    pub(super) fn empty() -> Self {
        Self {
            axes: Axes {
                thinning: 0,
                decimations: 0,
                factor: 2,
                start_hz: 0.0,
                step_hz: 0.0,
                num_samples: 0,
            },
            centre: DVec3::ZERO,
            data_m: Vec::new(),
            values: Vec::new(),
        }
    }

    pub(super) fn num_pulses(&self) -> usize {
        self.data_m.len()
    }

    /// Copy the samples of a pulse.
    pub(super) fn pulse(&self, n: usize, samples: &mut [Complex32]) {
        let layout = self.axes.layout();
        let size = layout.values();
        layout.gather(&self.values[n * size..(n + 1) * size], samples);
    }
}
