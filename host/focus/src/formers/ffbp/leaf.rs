//! The image of a patch that is not cut further: backprojection of its own history.

use std::collections::BTreeMap;

use num_complex::Complex32;

use super::patch_history::PatchHistory;
use super::target::Target;
use crate::patch::Rectangle;
use subaperture_kernels::backprojection::{self, Scale};
use subaperture_kernels::paths::{Antennas, Points};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::range_profile::RangeProfiler;

/// What imaging a small patch needs, for one thread.
#[derive(Default)]
pub(super) struct Leaf {
    profilers: BTreeMap<usize, RangeProfiler>,
    profile: Vec<Complex32>,
    fft: Vec<Complex32>,
    points: Points,
    sums: Vec<Complex32>,
}

impl Leaf {
    /// Adds the image of `rectangle`, by range profiles that err by `profile_error`.
    pub(super) fn image(
        &mut self,
        grid: &ImageGrid,
        profile_error: f64,
        history: &PatchHistory,
        rectangle: Rectangle,
        target: &mut Target,
    ) {
        let Self {
            profilers,
            profile,
            fft,
            points,
            sums,
        } = self;
        let profiler = profilers
            .entry(history.num_samples)
            .or_insert_with_key(|&count| {
                let oversampling = RangeProfiler::oversampling_for(20.0 * profile_error.log10());
                RangeProfiler::new(&vec![1.0; count], oversampling)
            });
        let length = profiler.length();
        profile.resize(length + 1, Complex32::ZERO);
        fft.resize(profiler.scratch_length(), Complex32::ZERO);
        points.clear();
        target.each(rectangle, |row, column, _| {
            points.push(grid.position_m(row, column).to_array());
        });
        sums.clear();
        sums.resize(points.len(), Complex32::ZERO);
        #[cfg(test)]
        super::counted::imaged(history.num_pulses(), length, sums.len());
        let centre_hz = history.frequency_hz((history.num_samples / 2) as f64);
        let scale = Scale {
            cycles_m: centre_hz / SPEED_OF_LIGHT_M_S,
            bins_m: history.step_hz / SPEED_OF_LIGHT_M_S,
            // Samples are weighted.
            weight: 1.0,
        };
        let rows = history.samples.chunks_exact(history.num_samples);
        for (antennas, row) in history.antennas.iter().zip(rows) {
            profiler.profile(row, profile, fft);
            let antennas = Antennas {
                transmitter_m: antennas.transmitter_m.to_array(),
                receiver_m: antennas.receiver_m.to_array(),
                datum_m: antennas.datum_m,
            };
            backprojection::add_pulse(profile, &scale, &antennas, points, sums);
        }
        let mut sums = sums.iter();
        target.each(rectangle, |_, _, pixel| {
            *pixel += sums.next().expect("as many as points");
        });
    }
}
