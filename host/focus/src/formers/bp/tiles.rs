//! Backprojection of pixels in tiles, with exact paths where the tile polynomials are too inexact.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::choice::{swath, tile_pulse};
use super::cost::{PIXELS, PROFILES};
use super::{Choices, GridPoints, MAX_PARTS, PixelPaths, pulse_bytes};
use crate::budget::Budget;
use crate::patch::{PatchSize, Patches, Rectangle, Segment};
use crate::path_tile::{self, raster};
use crate::read_ahead::{blocks_of, read_ahead};
use crate::{FormError, Forming, ImageSpec, Remedy, Tile, Work, rounding};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::Points;
use subaperture_kernels::tile::{self, Pieces, TilePulse, TileScratch};
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::Pulse;
use subaperture_signal::range_profile::RangeProfiler;

/// Bytes per pixel for the sums of a device and their copy.
const DEVICE_PIXEL_BYTES: u64 = 16;

/// Side of the patches formed by one thread where each pixel has its own path, pixels.
const PATCH: usize = 64;

pub(super) struct Opened<'a> {
    pub(super) spec: ImageSpec<'a>,
    pub(super) profiler: RangeProfiler,
    pub(super) pieces: Pieces,
    pub(super) summed_pulses: usize,
    paths: PixelPaths,
    grid_points: GridPoints,
    pub(super) patches: Patches,
    pub(super) highest_hz: f64,
    instructions: Instructions,
}

/// Block of pulses that are summed together.
pub(super) struct Batch<'a> {
    pub(super) pulses: &'a [Pulse],
    pub(super) tile_pulses: Vec<TilePulse>,
    pub(super) pieces: &'a [f32],
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct Scratch {
    tile: TileScratch,
    points: Points,
    /// Positions of a moving target's points at a pulse.
    moved: Points,
    sums: Vec<Complex32>,
}

impl<'a> Opened<'a> {
    pub(super) fn new(
        spec: ImageSpec<'a>,
        profiler: RangeProfiler,
        choices: Choices,
        grid_points: GridPoints,
    ) -> Self {
        let side = match choices.paths {
            PixelPaths::Tiles { side, .. } => side,
            _ => PATCH,
        };
        let swath = swath(&spec, grid_points);
        Self {
            pieces: choices.pieces(profiler.length(), swath.as_ref()),
            summed_pulses: choices.summed_pulses,
            paths: choices.paths,
            patches: Patches::new(spec.grid, PatchSize::square(side)),
            highest_hz: rounding::highest_hz(&spec),
            instructions: Instructions::best(),
            spec,
            profiler,
            grid_points,
        }
    }

    /// Call `make` for each pulse from `first` on with its number, its profile and its `size` values of `out`, on all threads.
    pub(super) fn for_each_profile<T: Send>(
        &self,
        first: usize,
        samples: &[Complex32],
        (out, size): (&mut [T], usize),
        monitor: &dyn Monitor,
        make: impl Fn(usize, &[Complex32], &mut [T]) + Sync,
    ) {
        let num_samples = self.spec.collection.num_samples;
        let length = self.profiler.length();
        let scratch = || {
            let profile = vec![Complex32::ZERO; length + 1];
            let fft = vec![Complex32::ZERO; self.profiler.scratch_length()];
            (profile, fft, during(monitor, PROFILES))
        };
        out.par_chunks_exact_mut(size)
            .zip(samples.par_chunks_exact(num_samples))
            .enumerate()
            .for_each_init(scratch, |(profile, fft, _), (i, (out, samples))| {
                self.profiler.profile(samples, profile, fft);
                make(first + i, &profile[..length], out);
            });
    }

    /// Compute the spline intervals of pulses from `first` on.
    pub(super) fn make_pieces(
        &self,
        first: usize,
        samples: &[Complex32],
        pieces: &mut [f32],
        monitor: &dyn Monitor,
    ) {
        let out = (pieces, self.pieces.values());
        self.for_each_profile(first, samples, out, monitor, |n, profile, pieces| {
            let weight = self.spec.weights.slow[n] as f32;
            self.pieces.make(self.instructions, profile, weight, pieces);
        });
    }

    /// Add a batch of pulses to the requested pixels of a patch.
    pub(super) fn add(
        &self,
        batch: &Batch,
        rectangle: &Rectangle,
        segments: &mut [Segment],
        scratch: &mut Scratch,
    ) {
        if let PixelPaths::Tiles { phase_rad, .. } = self.paths {
            let raster = raster(self.spec.grid, rectangle);
            let (tile, length, pulses) =
                (&mut scratch.tile, self.pieces.length(), &batch.tile_pulses);
            if path_tile::fits(tile, length, pulses, &raster, self.highest_hz, phase_rad) {
                let size = rectangle.size;
                let sums = &mut scratch.sums;
                sums.clear();
                sums.resize(size.rows * size.columns, Complex32::ZERO);
                tile.add(self.instructions, &self.pieces, pulses, batch.pieces, sums);
                for segment in segments {
                    segment.add(rectangle, sums);
                }
                return;
            }
        }
        for segment in segments {
            self.add_points(batch, segment, scratch);
        }
    }

    /// Add a batch of pulses to pixels of a row with exact paths.
    fn add_points(&self, batch: &Batch, segment: &mut Segment, scratch: &mut Scratch) {
        let Scratch {
            points,
            moved,
            sums,
            ..
        } = scratch;
        points.clear();
        for column in (segment.column..).take(segment.pixels.len()) {
            points.push(self.spec.grid.position_m(segment.row, column).to_array());
        }
        sums.clear();
        sums.resize(points.len(), Complex32::ZERO);
        let pieces = batch.pieces.chunks_exact(self.pieces.values());
        for ((pulse, tile_pulse), pieces) in batch.pulses.iter().zip(&batch.tile_pulses).zip(pieces)
        {
            let points = match self.grid_points {
                GridPoints::Positions => &*points,
                GridPoints::Velocities { .. } => {
                    moved.clear();
                    for point in points.iter().map(DVec3::from) {
                        moved.push(self.grid_points.target(pulse, point).0.to_array());
                    }
                    &*moved
                }
            };
            tile::add_points(
                self.instructions,
                &self.pieces,
                tile_pulse,
                pieces,
                points,
                sums,
            );
        }
        for (pixel, sum) in segment.pixels.iter_mut().zip(sums) {
            *pixel += *sum;
        }
    }
}

impl Forming for Opened<'_> {
    fn pixel_bytes(&self) -> u64 {
        match self.spec.numerics.device {
            Some(_) => DEVICE_PIXEL_BYTES,
            None => 0,
        }
    }

    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        if let (Some(device), PixelPaths::Tiles { side, phase_rad }) =
            (self.spec.numerics.device, self.paths)
        {
            return self.form_on_device(device, side, phase_rad, work, tiles);
        }
        let collection = self.spec.collection;
        let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
        let (length, summed) = (self.profiler.length(), self.summed_pulses);
        let mut budget = Budget::new(work.memory_bytes);
        let account = self
            .patches
            .account_bytes(tiles.iter().map(|tile| tile.place));
        budget.take("patches", account.into(), &[Remedy::MoreMemory])?;
        let parts = budget.take_block(
            "range profiles of some pulses",
            pulse_bytes(num_samples, self.pieces.values()) * summed.min(num_pulses) as u64,
            num_pulses.div_ceil(summed).min(MAX_PARTS),
            &[Remedy::MoreMemory],
        )?;
        let block = (parts * summed).min(num_pulses);
        let mut pieces = vec![0.0; block * self.pieces.values()];
        let mut patches = self.patches.split(tiles);
        let blocks = num_pulses.div_ceil(block);
        let done = AtomicUsize::new(0);
        let parts = (blocks * patches.len()) as f64;
        read_ahead(
            work.history,
            blocks_of(num_pulses, block),
            |pulses, samples| {
                let pieces = &mut pieces[..pulses.len() * self.pieces.values()];
                self.make_pieces(pulses.start, samples, pieces, work.monitor);
                let pulses = collection.pulses[pulses].chunks(summed);
                let batches: Vec<Batch> = pulses
                    .zip(pieces.chunks(summed * self.pieces.values()))
                    .map(|(pulses, pieces)| Batch {
                        tile_pulses: pulses
                            .iter()
                            .map(|p| tile_pulse(&self.spec, p, length))
                            .collect(),
                        pulses,
                        pieces,
                    })
                    .collect();
                let each = patches.par_iter_mut();
                each.for_each_init(Scratch::default, |scratch, (rectangle, segments)| {
                    let _forming = during(work.monitor, PIXELS);
                    for batch in &batches {
                        if work.monitor.cancelled() {
                            return;
                        }
                        self.add(batch, rectangle, segments, scratch);
                    }
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    work.monitor.progress(done as f64 / parts);
                });
                match work.monitor.cancelled() {
                    true => Err(FormError::Cancelled),
                    false => Ok(()),
                }
            },
        )
    }
}
