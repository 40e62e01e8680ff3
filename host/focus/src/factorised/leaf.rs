//! Image of a leaf patch: backprojection of its history, in tiles where paths permit.

use std::collections::BTreeMap;

use num_complex::Complex32;

use super::history::PatchHistory;
use super::shares::{DEGREE, Shares};
use super::thinned::Antennas;
use crate::patch::{Rectangle, Segment};
use crate::path_tile::{self, raster};
use subaperture_fft::Transforms;
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::{self, Points};
use subaperture_kernels::tile::{self, Pieces, TilePulse, TileScratch};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::range_profile::RangeProfiler;

/// Stage name.
pub(super) const LEAVES: &str = "leaves";

/// Pulses summed before they are added to a pixel.
pub(super) const SUMMED_PULSES: usize = 64;

/// Largest extent of a tile past profiles of `length` bins; on coarse grids a longer margin would be mostly repetition.
fn furthest(length: usize) -> usize {
    2 * length + 500
}

/// Profile intervals read by a tile with a margin of `margin` bins, relative to its own centre or to the profile;
/// `None` if the margin is too long.
pub(super) fn tile_layout(length: usize, own: bool, margin: usize) -> Option<Pieces> {
    let layout = match own {
        true => Pieces::around,
        false => Pieces::new,
    };
    (margin <= furthest(length)).then(|| layout(DEGREE, length, margin))
}

/// Profile intervals for points at any position.
pub(super) fn points_layout(length: usize) -> Pieces {
    Pieces::new(DEGREE, length, 1)
}

/// Buffers of one thread for imaging a leaf.
#[derive(Default)]
pub(super) struct Leaf {
    transforms: Transforms,
    profilers: BTreeMap<usize, RangeProfiler>,
    samples: Vec<Complex32>,
    profile: Vec<Complex32>,
    fft: Vec<Complex32>,
    pulses: Vec<TilePulse>,
    pieces: Vec<f32>,
    points: Points,
    tile: TileScratch,
    sums: Vec<Complex32>,
}

impl Leaf {
    /// Prepare with the given transforms.
    pub(super) fn new(transforms: Transforms) -> Self {
        Self {
            transforms,
            ..Self::default()
        }
    }

    /// Add the image of `rectangle` to its requested pixels.
    pub(super) fn image(
        &mut self,
        grid: &ImageGrid,
        shares: &Shares,
        history: &PatchHistory,
        antennas: &[Antennas],
        rectangle: Rectangle,
        segments: &mut [Segment],
    ) {
        let Self {
            transforms,
            profilers,
            samples,
            profile,
            fft,
            pulses,
            pieces,
            points,
            tile,
            sums,
        } = self;
        let instructions = Instructions::best();
        let axes = &history.axes;
        let count = axes.num_samples;
        let profiler = profilers.entry(count).or_insert_with_key(|&count| {
            // Samples are already weighted.
            RangeProfiler::new(
                DEGREE,
                &vec![1.0; count],
                shares.oversampling(),
                *transforms,
            )
        });
        let length = profiler.length();
        samples.resize(count, Complex32::ZERO);
        profile.resize(length + 1, Complex32::ZERO);
        fft.resize(profiler.scratch_length(), Complex32::ZERO);
        let turns_m = axes.step_hz / SPEED_OF_LIGHT_M_S;
        let cycles_a_bin = axes.frequency_hz((count / 2) as f64) / (axes.step_hz * length as f64);
        let raster = raster(grid, &rectangle);
        let bins_m = (turns_m * length as f64).abs();
        let highest_hz = axes.highest_hz();
        let by_tiles =
            grid.is_raster() && path_tile::arithmetic(highest_hz, bins_m) <= shares.arithmetic;
        let own = history.centre == rectangle.centre_m(grid);
        // Points are needed only for pulses that no tile can use.
        points.clear();
        for (batch, antennas) in antennas.chunks(SUMMED_PULSES).enumerate() {
            let first = batch * SUMMED_PULSES;
            pulses.clear();
            let data_m = &history.data_m[first..];
            pulses.extend(
                antennas
                    .iter()
                    .zip(data_m)
                    .map(|(antennas, &datum_m)| TilePulse {
                        antennas: paths::Antennas {
                            transmitter_m: antennas[0].to_array(),
                            receiver_m: antennas[1].to_array(),
                            datum_m,
                        },
                        turns_m,
                        cycles_a_bin,
                    }),
            );
            let smooth = by_tiles
                && path_tile::fits(tile, length, pulses, &raster, highest_hz, shares.tiles);
            let margin = smooth.then(|| match own {
                true => tile.reach(),
                false => Pieces::margin_for(&raster, bins_m),
            });
            let tile_layout = margin.and_then(|margin| tile_layout(length, own, margin));
            let by_tile = tile_layout.is_some();
            let layout = tile_layout.unwrap_or_else(|| points_layout(length));
            let values = layout.values();
            #[cfg(test)]
            super::counted::imaged(
                pulses.len(),
                length,
                layout.row(),
                raster.rows * raster.columns,
            );
            pieces.resize(pulses.len() * values, 0.0);
            for (n, pieces) in (first..).zip(pieces.chunks_exact_mut(values)) {
                history.pulse(n, samples);
                profiler.profile(samples, profile, fft);
                // Samples are already weighted.
                layout.make(instructions, &profile[..length], 1.0, pieces);
            }
            sums.clear();
            if by_tile {
                sums.resize(raster.rows * raster.columns, Complex32::ZERO);
                tile.add(instructions, &layout, pulses, pieces, sums);
                for segment in segments.iter_mut() {
                    segment.add(&rectangle, sums);
                }
            } else {
                if points.is_empty() {
                    for segment in segments.iter() {
                        for column in (segment.column..).take(segment.pixels.len()) {
                            points.push(grid.position_m(segment.row, column).to_array());
                        }
                    }
                }
                sums.resize(points.len(), Complex32::ZERO);
                for (pulse, pieces) in pulses.iter().zip(pieces.chunks_exact(values)) {
                    tile::add_points(instructions, &layout, pulse, pieces, points, sums);
                }
                let pixels = segments
                    .iter_mut()
                    .flat_map(|segment| segment.pixels.iter_mut());
                for (pixel, sum) in pixels.zip(&*sums) {
                    *pixel += sum;
                }
            }
        }
    }
}
