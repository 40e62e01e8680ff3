//! Forming of tiles: gridding of the pulses, transforms, pixels.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::cost::{BLOCK_PULSES, PIXELS};
use super::layout::Layout;
use super::plane::{Extent, Plane};
use super::raster::{Raster, RasterSize, Readable, SPREADING, Track};
use crate::budget::Budget;
use crate::patch::{Rectangle, Segment};
use crate::pixels::for_each;
use crate::read_ahead::{BLOCKS_HELD, blocks_of, read_ahead};
use crate::{FormError, Forming, ImageSpec, Reason, Remedy, Tile, Work};
use subaperture_kernels::compensation::{self, Ramp};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::during;
use subaperture_signal::phase::phasor32;

/// Share of the work at the end of gridding, and of the transforms.
const GRIDDED: f64 = 0.6;
const TRANSFORMED: f64 = 0.8;

/// Plan opened for forming. The transform of an undivided grid, which all tiles share, is computed with the first tile and kept.
pub(super) struct Opened<'a, const W: usize> {
    spec: ImageSpec<'a>,
    layout: Layout,
    norm: f64,
    kept: Mutex<Option<Arc<Transformed<'a, W>>>>,
}

/// Patch and sub-aperture with the spectrum of its pulses.
struct Gridded<'a, const W: usize> {
    plane: Plane<'a>,
    extent: Extent,
    raster: Raster<W>,
}

/// Patch and sub-aperture with its image.
struct Transformed<'a, const W: usize> {
    plane: Plane<'a>,
    extent: Extent,
    image: Readable<W>,
}

impl<'a, const W: usize> Opened<'a, W> {
    pub(super) fn new(spec: ImageSpec<'a>, layout: Layout) -> Self {
        Self {
            norm: spec.weights.normalisation(),
            spec,
            layout,
            kept: Mutex::new(None),
        }
    }

    /// Empty raster of the patch at `place` for `pulses`.
    fn start(&self, pulses: Range<usize>, place: &Rectangle) -> Result<Gridded<'a, W>, FormError> {
        let collection = self.spec.collection;
        let (plane, extent) = self
            .layout
            .cell(&collection.pulses[pulses], self.spec.grid, place);
        let raster = Raster::new(plane.spectrum(collection.num_samples), extent)?;
        Ok(Gridded {
            plane,
            extent,
            raster,
        })
    }

    /// Bytes of the largest raster of the patch at `place`.
    fn raster_bytes(&self, place: &Rectangle) -> Result<u128, FormError> {
        let collection = self.spec.collection;
        let sub_apertures = self.layout.sub_apertures(collection.pulses.len());
        let each = sub_apertures.map(|pulses| {
            let pulses = &collection.pulses[pulses];
            let (plane, extent) = self.layout.cell(pulses, self.spec.grid, place);
            let size = RasterSize::new(plane.spectrum(collection.num_samples), extent, W)?;
            Ok(size.bytes())
        });
        each.reduce(larger).unwrap_or(Ok(0))
    }

    /// Grid `pulses` onto the raster of each patch, at most `block` pulses at a time; `progress` is called with the number of those done.
    fn grid(
        &self,
        work: &Work,
        pulses: Range<usize>,
        block: usize,
        patches: &mut [Gridded<W>],
        progress: impl Fn(usize) + Sync + Send,
    ) -> Result<(), FormError> {
        let first = pulses.start;
        let moved = |range: Range<usize>| range.start + first..range.end + first;
        let blocks = blocks_of(pulses.len(), block).map(moved);
        read_ahead(work.history, blocks, |pulses, samples| {
            match &mut *patches {
                [patch] => self.add(work, pulses.clone(), samples, patch),
                patches => {
                    let samples = &*samples;
                    patches
                        .par_iter_mut()
                        .for_each_init(Vec::new, |copy, patch| {
                            copy.clear();
                            copy.extend_from_slice(samples);
                            self.add(work, pulses.clone(), copy, patch);
                        });
                }
            }
            progress(pulses.end - first);
            match work.monitor.cancelled() {
                true => Err(FormError::Cancelled),
                false => Ok(()),
            }
        })
    }

    /// Grid the samples of `pulses`, which are overwritten, onto the raster of a patch.
    fn add(
        &self,
        work: &Work,
        pulses: Range<usize>,
        samples: &mut [Complex32],
        patch: &mut Gridded<W>,
    ) {
        let tracks: Vec<Track> = samples
            .par_chunks_exact_mut(self.spec.collection.num_samples)
            .zip(pulses)
            .map(|(row, n)| {
                let _spreading = during(work.monitor, SPREADING);
                self.refer(n, row, &patch.plane, &patch.extent)
            })
            .collect();
        patch.raster.spread(&tracks, samples, work.monitor);
    }

    /// Refer the weighted samples of pulse `n` to the centre of the extent; return their spatial frequencies.
    fn refer(&self, n: usize, row: &mut [Complex32], plane: &Plane, extent: &Extent) -> Track {
        let ImageSpec {
            collection,
            weights,
            ..
        } = self.spec;
        let pulse = &collection.pulses[n];
        let gradient = plane.gradient(pulse);
        let path_m = pulse.relative_path_m(plane.centre_m) + gradient.dot(extent.centre_m);
        let delay_s = path_m / SPEED_OF_LIGHT_M_S;
        let weight = weights.slow[n] * self.norm;
        let ramp = Ramp::new(pulse.start_hz * delay_s, pulse.step_hz * delay_s, weight);
        compensation::refer(row, &weights.fast, ramp);
        let cycles = gradient / SPEED_OF_LIGHT_M_S;
        Track {
            start: cycles * pulse.start_hz,
            step: cycles * pulse.step_hz,
        }
    }

    fn transform(&self, work: &Work, patch: Gridded<'a, W>) -> Transformed<'a, W> {
        let transforms = self.spec.numerics.transforms;
        Transformed {
            plane: patch.plane,
            extent: patch.extent,
            image: patch.raster.transform(transforms, work.monitor),
        }
    }

    /// Number of pulses in memory at a time, with copies for `workers` patches.
    fn block(&self, budget: &mut Budget, workers: usize) -> Result<usize, FormError> {
        let pulse_bytes = 8 * self.spec.collection.num_samples;
        budget.take_block(
            "a pulse",
            (pulse_bytes * (BLOCKS_HELD + workers)) as u64,
            self.spec.collection.pulses.len().min(BLOCK_PULSES),
            &[Remedy::MoreMemory],
        )
    }

    /// Image of the undivided grid.
    fn whole(&self, work: &Work) -> Result<Transformed<'a, W>, FormError> {
        let place = Tile::place_of(self.spec.grid);
        let mut budget = Budget::new(work.memory_bytes);
        take_raster(&mut budget, self.raster_bytes(&place)?)?;
        let count = self.spec.collection.pulses.len();
        let mut patch = self.start(0..count, &place)?;
        let block = self.block(&mut budget, 0)?;
        let done = |pulses| {
            work.monitor
                .progress(GRIDDED * pulses as f64 / count as f64);
        };
        self.grid(
            work,
            0..count,
            block,
            std::slice::from_mut(&mut patch),
            done,
        )?;
        let transformed = self.transform(work, patch);
        work.monitor.progress(TRANSFORMED);
        Ok(transformed)
    }

    /// Form patches one group at a time, as many as fit in memory, and all of their sub-apertures.
    fn patches(
        &self,
        work: &Work,
        tiles: &mut [Tile],
        beyond: &AtomicBool,
    ) -> Result<(), FormError> {
        let patches = self.layout.patches(self.spec.grid);
        let mut budget = Budget::new(work.memory_bytes);
        budget.take(
            "patches",
            patches
                .account_bytes(tiles.iter().map(|tile| tile.place))
                .into(),
            &[Remedy::MoreMemory],
        )?;
        let mut patches = patches.split(tiles);
        let bytes = patches
            .par_iter()
            .map(|(place, _)| self.raster_bytes(place));
        let bytes = bytes.reduce(|| Ok(0), larger)?;
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
        let group = budget.take_block("a patch", bytes, patches.len(), RASTER_REMEDIES)?;
        let threads = rayon::current_num_threads();
        let block = self.block(&mut budget, group.min(threads))?;
        let count = self.spec.collection.pulses.len();
        let total = (patches.len().div_ceil(group) * count) as f64;
        for (index, patches) in patches.chunks_mut(group).enumerate() {
            for pulses in self.layout.sub_apertures(count) {
                let before = index * count + pulses.start;
                let start = |(place, _): &(Rectangle, _)| self.start(pulses.clone(), place);
                let cells: Result<Vec<Gridded<W>>, FormError> =
                    patches.par_iter().map(start).collect();
                let mut cells = cells?;
                self.grid(work, pulses.clone(), block, &mut cells, |done| {
                    work.monitor.progress((before + done) as f64 / total);
                })?;
                cells
                    .into_par_iter()
                    .zip(&mut *patches)
                    .for_each(|(cell, (_, segments))| {
                        let cell = self.transform(work, cell);
                        segments
                            .par_iter_mut()
                            .for_each(|segment| self.read(work, &cell, segment, beyond));
                    });
                if work.monitor.cancelled() {
                    return Err(FormError::Cancelled);
                }
            }
        }
        Ok(())
    }

    /// Add the image of a patch and sub-aperture to contiguous pixels.
    fn read(&self, work: &Work, cell: &Transformed<W>, segment: &mut Segment, beyond: &AtomicBool) {
        let _forming = during(work.monitor, PIXELS);
        for (column, pixel) in (segment.column..).zip(segment.pixels.iter_mut()) {
            let point = self.spec.grid.position_m(segment.row, column);
            *pixel += cell.at(point, beyond);
        }
    }
}

const RASTER_REMEDIES: &[Remedy] = &[
    Remedy::SmallerGrid,
    Remedy::OtherFormer(&["rdbp"]),
    Remedy::MoreMemory,
];

fn take_raster(budget: &mut Budget, bytes: u128) -> Result<(), FormError> {
    budget.take("the raster of the scene's spectrum", bytes, RASTER_REMEDIES)
}

fn larger(a: Result<u128, FormError>, b: Result<u128, FormError>) -> Result<u128, FormError> {
    Ok(a?.max(b?))
}

impl<const W: usize> Transformed<'_, W> {
    /// Value at a scene point; `beyond` is set if it lies outside the extent.
    fn at(&self, point: DVec3, beyond: &AtomicBool) -> Complex32 {
        let place_m = self.plane.place(point) - self.extent.centre_m;
        if !place_m.abs().cmple(self.extent.half_m).all() {
            beyond.store(true, Ordering::Relaxed);
        }
        self.image.at(place_m) * phasor32(self.image.carrier.dot(place_m))
    }
}

impl<const W: usize> Forming for Opened<'_, W> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let beyond = AtomicBool::new(false);
        if self.layout.is_whole(self.spec.grid) {
            let mut kept = self.kept.lock().unwrap_or_else(|held| held.into_inner());
            let whole = match &*kept {
                Some(whole) => whole.clone(),
                None => kept.insert(Arc::new(self.whole(work)?)).clone(),
            };
            drop(kept);
            let grid = self.spec.grid;
            for_each(grid, tiles, work.monitor, PIXELS, |point, pixel| {
                *pixel += whole.at(point, &beyond);
            });
        } else {
            self.patches(work, tiles, &beyond)?;
        }
        if work.monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        // The extent comes from sampled pixels. It contains all pixels where paths are approximately linear; near an antenna they have
        // a cusp.
        if beyond.into_inner() {
            let why = "the linear approximation of paths fails: the grid lies around an antenna";
            let remedies = [Remedy::GridWithout, Remedy::OtherFormer(&["bp"])];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        work.monitor.progress(1.0);
        Ok(())
    }
}
