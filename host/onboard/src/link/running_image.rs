//! The image so far, while maps still come.
//!
//! Sub-CPIs of which every patch's map has come are formed and added up; of the others nothing shows
//! yet. Images of sub-CPIs add up to the image of them all: each is normalised by the weights of its
//! pulses, so it counts by these ([`crate::image`]).
//!
//! **Cost**: that of forming the image once, in parts; memory of the image twice, and of the maps that
//! wait: at most [`MOST_WAITING`] sub-CPIs, of which the oldest are then left out.

use std::collections::BTreeMap;

use num_complex::Complex32;
use subaperture_core::stream::{MapHeader, Patch};

use crate::image::{MapsTask, form};
use crate::maps::{Closing, Maps, OwnedMap, Run};
use subaperture_focus::{FormError, Misses};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::ReadError;

/// Most sub-CPIs that wait to become complete.
pub const MOST_WAITING: usize = 16;

/// The image so far.
pub struct RunningImage {
    run: Run,
    grid: ImageGrid,
    patches: usize,
    error_db: f64,
    memory_bytes: u64,
    waiting: BTreeMap<u32, Vec<OwnedMap>>,
    sum: Vec<Complex32>,
    weight_sum: f64,
}

impl RunningImage {
    /// Nothing yet: for maps of `patches` patches of `run`.
    pub fn new(
        run: &Run,
        grid: &ImageGrid,
        patches: usize,
        error_db: f64,
        memory_bytes: u64,
    ) -> Self {
        Self {
            run: run.clone(),
            grid: grid.clone(),
            patches,
            error_db,
            memory_bytes,
            waiting: BTreeMap::new(),
            sum: vec![Complex32::ZERO; grid.num_pixels() as usize],
            weight_sum: 0.0,
        }
    }

    /// Bytes that it may take for maps of `patches`.
    pub fn held_bytes(grid: &ImageGrid, patches: &[Patch]) -> u64 {
        let sub_cpi: u64 = patches.iter().map(OwnedMap::bytes).sum();
        let pixel_bytes = 2 * size_of::<Complex32>() as u64;
        grid.num_pixels() * pixel_bytes + MOST_WAITING as u64 * sub_cpi
    }

    /// Takes a map.
    pub fn take(&mut self, map: OwnedMap) {
        self.waiting
            .entry(map.header.sub_cpi)
            .or_default()
            .push(map);
        let unfinished = |maps: &Vec<OwnedMap>| maps.len() < self.patches;
        if self
            .waiting
            .values()
            .filter(|maps| unfinished(maps))
            .count()
            > MOST_WAITING
        {
            let oldest = self.waiting.iter().find(|(_, maps)| unfinished(maps));
            if let Some(sub_cpi) = oldest.map(|(sub_cpi, _)| *sub_cpi) {
                self.waiting.remove(&sub_cpi);
            }
        }
    }

    /// Adds what is complete; the image, if that is anything.
    ///
    /// # Errors
    /// [`FormError`] if there is not enough memory or a map holds what is no number.
    pub fn form(&mut self) -> Result<Option<Image>, FormError> {
        let complete: Vec<u32> = self
            .waiting
            .iter()
            .filter(|(_, maps)| maps.len() >= self.patches)
            .map(|(sub_cpi, _)| *sub_cpi)
            .collect();
        let mut maps = Vec::new();
        for sub_cpi in complete {
            maps.append(&mut self.waiting.remove(&sub_cpi).unwrap_or_default());
        }
        if maps.is_empty() {
            return Ok(None);
        }
        let some = Batch {
            run: &self.run,
            headers: maps.iter().map(|map| map.header).collect(),
            maps,
        };
        // Alike for every patch: every sub-CPI here has all of them.
        let weights = some.headers.iter().filter(|header| header.patch_index == 0);
        let weight: f64 = weights.map(|header| f64::from(header.weight_sum)).sum();
        let (formed, _) = form(&MapsTask {
            maps: &some,
            grid: &self.grid,
            error_db: self.error_db,
            misses: Misses::Allowed,
            // Beside the sum, and the image that is handed out.
            memory_bytes: self
                .memory_bytes
                .saturating_sub(2 * size_of_val(self.sum.as_slice()) as u64),
            monitor: &Silent,
        })?;
        for (sum, pixel) in self.sum.iter_mut().zip(&formed.image.pixels) {
            *sum += pixel * weight as f32;
        }
        self.weight_sum += weight;
        let norm = (1.0 / self.weight_sum) as f32;
        Ok(Some(Image {
            pixels: self.sum.iter().map(|sum| sum * norm).collect(),
            ..formed.image
        }))
    }
}

/// Maps in memory.
struct Batch<'a> {
    run: &'a Run,
    headers: Vec<MapHeader>,
    maps: Vec<OwnedMap>,
}

impl Maps for Batch<'_> {
    fn run(&self) -> &Run {
        self.run
    }

    fn closing(&self) -> Option<&Closing> {
        None
    }

    fn headers(&self) -> &[MapHeader] {
        &self.headers
    }

    fn read(&self, index: usize) -> Result<OwnedMap, ReadError> {
        Ok(self.maps[index].clone())
    }
}
