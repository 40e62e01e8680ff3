//! The image of a patch that is not cut further: backprojection of its own history, by tiles where paths allow it.

use std::collections::BTreeMap;

use num_complex::Complex32;

use super::patch_history::PatchHistory;
use super::shares::{DEGREE, Shares};
use super::target::Target;
use crate::patch::Rectangle;
use crate::path_tile::{self, raster};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::{Antennas, Points};
use subaperture_kernels::tile::{self, Pieces, TilePulse, TileScratch};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::range_profile::RangeProfiler;

/// Pulses whose terms are summed before they are added to a pixel.
const SUMMED_PULSES: usize = 64;

/// What imaging a small patch needs, for one thread.
#[derive(Default)]
pub(super) struct Leaf {
    profilers: BTreeMap<usize, RangeProfiler>,
    profile: Vec<Complex32>,
    fft: Vec<Complex32>,
    pulses: Vec<TilePulse>,
    pieces: Vec<f32>,
    points: Points,
    tile: TileScratch,
    sums: Vec<Complex32>,
}

impl Leaf {
    /// Adds the image of `rectangle`.
    pub(super) fn image(
        &mut self,
        grid: &ImageGrid,
        shares: &Shares,
        history: &PatchHistory,
        rectangle: Rectangle,
        target: &mut Target,
    ) {
        let Self {
            profilers,
            profile,
            fft,
            pulses,
            pieces,
            points,
            tile,
            sums,
        } = self;
        let instructions = Instructions::best();
        let count = history.num_samples;
        let profiler = profilers.entry(count).or_insert_with_key(|&count| {
            // Samples are weighted.
            RangeProfiler::new(DEGREE, &vec![1.0; count], shares.oversampling())
        });
        let length = profiler.length();
        profile.resize(length + 1, Complex32::ZERO);
        fft.resize(profiler.scratch_length(), Complex32::ZERO);
        let turns_m = history.step_hz / SPEED_OF_LIGHT_M_S;
        let cycles_a_bin =
            history.frequency_hz((count / 2) as f64) / (history.step_hz * length as f64);
        let raster = raster(grid, &rectangle);
        let bins_m = (turns_m * length as f64).abs();
        let margin = Pieces::margin_for(&raster, bins_m);
        let highest_hz = history.highest_hz();
        let by_tiles = !grid.polar
            && margin <= 2 * length + 500
            && path_tile::arithmetic(highest_hz, bins_m, false) <= shares.arithmetic;
        let layout = Pieces::new(DEGREE, length, if by_tiles { margin } else { 1 });
        let values = layout.values();
        pieces.resize(SUMMED_PULSES.min(history.num_pulses()) * values, 0.0);
        #[cfg(test)]
        super::counted::imaged(history.num_pulses(), length, raster.rows * raster.columns);
        // Places are for those pulses only that no tile will do for.
        points.clear();
        let rows = history.samples.chunks(SUMMED_PULSES * count);
        for (antennas, rows) in history.antennas.chunks(SUMMED_PULSES).zip(rows) {
            pulses.clear();
            pulses.extend(antennas.iter().map(|antennas| TilePulse {
                antennas: Antennas {
                    transmitter_m: antennas.transmitter_m.to_array(),
                    receiver_m: antennas.receiver_m.to_array(),
                    datum_m: antennas.datum_m,
                },
                turns_m,
                cycles_a_bin,
            }));
            let pieces = &mut pieces[..pulses.len() * values];
            for (row, pieces) in rows
                .chunks_exact(count)
                .zip(pieces.chunks_exact_mut(values))
            {
                profiler.profile(row, profile, fft);
                // Samples are weighted.
                layout.make(instructions, &profile[..length], cycles_a_bin, 1.0, pieces);
            }
            sums.clear();
            if by_tiles && path_tile::fits(tile, length, pulses, &raster, highest_hz, shares.tiles)
            {
                sums.resize(raster.rows * raster.columns, Complex32::ZERO);
                tile.add(instructions, &layout, false, pulses, pieces, sums);
                target.each(rectangle, |row, column, pixel| {
                    let place = (row - rectangle.row) * raster.columns + column - rectangle.column;
                    *pixel += sums[place];
                });
            } else {
                if points.is_empty() {
                    target.each(rectangle, |row, column, _| {
                        points.push(grid.position_m(row, column).to_array());
                    });
                }
                sums.resize(points.len(), Complex32::ZERO);
                for (pulse, pieces) in pulses.iter().zip(pieces.chunks_exact(values)) {
                    tile::add_points(instructions, &layout, pulse, pieces, points, sums);
                }
                let mut sums = sums.iter();
                target.each(rectangle, |_, _, pixel| {
                    *pixel += sums.next().expect("as many as points");
                });
            }
        }
    }
}
