//! Backprojection of tiles by a device ([`crate::device`]): profiles and path polynomials are made here, and tiles that a block of pulses does not suit are
//! added here.

use num_complex::Complex32;
use rayon::prelude::*;

use super::choice::{arithmetic_share, margin, tile_pulse};
use super::cost::PIXELS;
use super::tiles::{Batch, Opened, Scratch};
use crate::budget::Budget;
use crate::device::{Device, Expansion, ProfileBlock, rounding};
use crate::patch::{Rectangle, Segment};
use crate::path_tile::{raster, rms_phase};
use crate::read_ahead::{BLOCKS_HELD, blocks_of, read_ahead};
use crate::{FormError, Remedy, Tile, Work};
use subaperture_kernels::tile::{Raster, TilePulse};
use subaperture_model::monitor::{Monitor, during};

/// Most memory for path polynomials of some tiles, with their copies for the device, bytes.
const PATH_BYTES: u64 = 24 << 20;
/// Size of a polynomial with its copies.
const EACH_PATH: usize = size_of::<Expansion>() + 3 * 64;

impl Opened<'_> {
    /// Form tiles whose polynomials may have an RMS phase error of `phase_rad`.
    pub(super) fn form_on_device(
        &self,
        device: &dyn Device,
        side: usize,
        phase_rad: f64,
        work: &Work,
        tiles: &mut [Tile],
    ) -> Result<(), FormError> {
        let collection = self.spec.collection;
        let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
        let length = self.profiler.length();
        let margin = margin(&self.spec, side, length);
        let summed = self.summed_pulses.min(num_pulses);
        let places = tiles.iter().map(|tile| tile.place);
        let mut budget = Budget::new(work.memory_bytes);
        let account = self.patches.account_bytes(places);
        budget.take("patches", account.into(), &[Remedy::MoreMemory])?;
        let row = length + 2 * margin;
        // Profiles, their copy on the way to the device, and intervals of the pulses that the device does not suit.
        let pulse_bytes = 8 * (BLOCKS_HELD * num_samples + 2 * row) + 4 * self.pieces.values();
        let purpose = "range profiles of some pulses";
        budget.take(
            purpose,
            (summed * pulse_bytes) as u128,
            &[Remedy::MoreMemory],
        )?;
        let of_tile = summed * EACH_PATH;
        let path_bytes = (budget.left_bytes() / 2)
            .min(PATH_BYTES)
            .max(of_tile as u64);
        budget.take(
            "paths of some tiles",
            path_bytes.into(),
            &[Remedy::MoreMemory],
        )?;
        let at_a_time = path_bytes as usize / of_tile;

        let mut patches = self.patches.split(tiles);
        let rasters: Vec<Raster> = patches
            .iter()
            .map(|(rectangle, _)| raster(self.spec.grid, rectangle))
            .collect();
        let size = |raster: &Raster| [raster.rows, raster.columns];
        let sizes: Vec<[usize; 2]> = rasters.iter().map(size).collect();
        let mut sums = device.start(&sizes)?;
        let mut profiles = vec![Complex32::ZERO; summed * row];
        let (blocks, mut done) = (num_pulses.div_ceil(summed), 0.0);
        read_ahead(
            work.history,
            blocks_of(num_pulses, summed),
            |pulses, samples| {
                let profiles = &mut profiles[..pulses.len() * row];
                self.make_rows(pulses.start, samples, margin, profiles, work.monitor);
                let of = &collection.pulses[pulses.clone()];
                let tile_pulses: Vec<TilePulse> = of
                    .iter()
                    .map(|p| tile_pulse(&self.spec, p, length))
                    .collect();
                let carriers: Vec<f64> = tile_pulses.iter().map(|p| p.cycles_a_bin).collect();
                sums.load(&ProfileBlock {
                    degree: self.pieces.degree(),
                    length,
                    margin,
                    profiles,
                    carriers: &carriers,
                })?;
                let mut left = Vec::new();
                for first in (0..patches.len()).step_by(at_a_time) {
                    if work.monitor.cancelled() {
                        return Err(FormError::Cancelled);
                    }
                    let _forming = during(work.monitor, PIXELS);
                    let some = &rasters[first..patches.len().min(first + at_a_time)];
                    let of_tile = |raster: &Raster| self.paths(raster, &tile_pulses, phase_rad);
                    let paths: Vec<_> = some.par_iter().map(of_tile).collect();
                    let suited =
                        |(i, paths): (usize, &Option<_>)| paths.is_some().then_some(first + i);
                    let suited: Vec<usize> = paths.iter().enumerate().filter_map(suited).collect();
                    let others =
                        (first..first + some.len()).filter(|i| suited.binary_search(i).is_err());
                    left.extend(others);
                    let paths: Vec<Expansion> = paths.into_iter().flatten().flatten().collect();
                    sums.add(&suited, &paths)?;
                    done += some.len() as f64 / (rasters.len() * blocks) as f64;
                    work.monitor.progress(done);
                }
                if !left.is_empty() {
                    let mut pieces = vec![0.0; pulses.len() * self.pieces.values()];
                    self.make_pieces(pulses.start, samples, &mut pieces, work.monitor);
                    let batch = Batch {
                        pulses: of,
                        tile_pulses,
                        pieces: &pieces,
                    };
                    self.add_left(&batch, &left, &mut patches, work.monitor);
                }
                match work.monitor.cancelled() {
                    true => Err(FormError::Cancelled),
                    false => Ok(()),
                }
            },
        )?;
        let _forming = during(work.monitor, PIXELS);
        let sums = sums.take()?;
        let mut first = 0;
        for (rectangle, segments) in &mut patches {
            let count = rectangle.size.rows * rectangle.size.columns;
            for segment in segments {
                segment.add(rectangle, &sums[first..first + count]);
            }
            first += count;
        }
        Ok(())
    }

    /// Path polynomials of pulses over a tile, in bins; `None` if one of them, or float32 arithmetic with it, exceeds its share of the error.
    fn paths(
        &self,
        raster: &Raster,
        pulses: &[TilePulse],
        phase_rad: f64,
    ) -> Option<Vec<Expansion>> {
        let num_samples = self.spec.collection.num_samples;
        let length = self.profiler.length() as f64;
        let half = [raster.columns, raster.rows].map(|count| 0.5 * (count as f64 - 1.0));
        let radius_m = raster.radius_m();
        let of_pulse = |pulse: &TilePulse| {
            let path = Expansion::new(&pulse.antennas, raster, pulse.turns_m * length);
            let bend = path.bend_bound(half);
            let position = 1.0 + path.linear_bound(half) + bend;
            let rounding = rounding(
                position,
                length / num_samples as f64,
                (pulse.cycles_a_bin * bend).abs(),
            );
            let truncation = rms_phase(self.highest_hz, path.truncation_m(radius_m));
            // NaN positions cannot be expanded.
            let fits = truncation <= phase_rad && rounding <= arithmetic_share(phase_rad);
            fits.then_some(path)
        };
        pulses.iter().map(of_pulse).collect()
    }

    /// Compute weighted profiles of pulses from `first` on, continued by `margin` values on both sides.
    fn make_rows(
        &self,
        first: usize,
        samples: &[Complex32],
        margin: usize,
        rows: &mut [Complex32],
        monitor: &dyn Monitor,
    ) {
        let length = self.profiler.length();
        // The first value of a row is `margin` bins before bin 0.
        let from = (length - margin % length) % length;
        let out = (rows, length + 2 * margin);
        self.for_each_profile(first, samples, out, monitor, |n, profile, row| {
            let weight = self.spec.weights.slow[n] as f32;
            let values = profile.iter().cycle().skip(from);
            for (to, z) in row.iter_mut().zip(values) {
                *to = z * weight;
            }
        });
    }

    /// Add a block of pulses to the patches of the given indices on the processor.
    fn add_left(
        &self,
        batch: &Batch,
        left: &[usize],
        patches: &mut [(Rectangle, Vec<Segment>)],
        monitor: &dyn Monitor,
    ) {
        let patches = patches.par_iter_mut().enumerate();
        let left = patches.filter(|(i, _)| left.binary_search(i).is_ok());
        left.for_each_init(Scratch::default, |scratch, (_, (rectangle, segments))| {
            let _forming = during(monitor, PIXELS);
            if !monitor.cancelled() {
                self.add(batch, rectangle, segments, scratch);
            }
        });
    }
}
