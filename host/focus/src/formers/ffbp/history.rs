//! A patch's own phase history.

use glam::DVec3;
use num_complex::Complex32;

use super::thinned::Stretch;
use subaperture_kernels::halving::{Layout, halved};
use subaperture_model::phase_history::Collection;

/// What a history is of: pulses after some halvings, and frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    /// Halvings over pulses.
    pub(super) thinning: usize,
    pub(super) start_hz: f64,
    pub(super) step_hz: f64,
    pub(super) num_samples: usize,
}

impl Axes {
    /// As recorded.
    pub(super) fn recorded(collection: &Collection) -> Self {
        let first = &collection.pulses[0];
        Self {
            thinning: 0,
            start_hz: first.start_hz,
            step_hz: first.step_hz,
            num_samples: collection.num_samples,
        }
    }

    /// Halved over pulses, over samples, by so many taps.
    pub(super) fn after(&self, [pulses, samples]: [bool; 2], taps: usize) -> Self {
        let mut after = *self;
        after.thinning += usize::from(pulses);
        if samples {
            after.start_hz = self.frequency_hz(-((taps - 2) as f64));
            after.step_hz = 2.0 * self.step_hz;
            after.num_samples = halved(self.num_samples, taps);
        }
        after
    }

    pub(super) fn frequency_hz(&self, k: f64) -> f64 {
        self.start_hz + k * self.step_hz
    }

    pub(super) fn highest_hz(&self) -> f64 {
        let last_hz = self.frequency_hz((self.num_samples - 1) as f64);
        last_hz.abs().max(self.start_hz.abs())
    }

    pub(super) fn layout(&self) -> Layout {
        Layout::new(self.num_samples)
    }

    /// Bytes of such a history.
    pub(super) fn bytes(&self, stretch: &Stretch) -> u64 {
        let pulses = stretch.thinned[self.thinning].antennas.len() as u64;
        pulses * (4 * self.layout().values() as u64 + size_of::<f64>() as u64)
    }
}

/// Samples of some pulses and frequencies, their phases referred to a point.
pub(super) struct PatchHistory {
    pub(super) axes: Axes,
    /// The point.
    pub(super) centre: DVec3,
    /// The path from each pulse's antennas to it, metres.
    pub(super) data_m: Vec<f64>,
    /// Pulse by pulse, as [`Layout`] says.
    pub(super) values: Vec<f32>,
}

impl PatchHistory {
    /// With room for nothing yet.
    pub(super) fn empty() -> Self {
        Self {
            axes: Axes {
                thinning: 0,
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

    /// The samples of a pulse.
    pub(super) fn pulse(&self, n: usize, samples: &mut [Complex32]) {
        let layout = self.axes.layout();
        let size = layout.values();
        layout.gather(&self.values[n * size..(n + 1) * size], samples);
    }
}
