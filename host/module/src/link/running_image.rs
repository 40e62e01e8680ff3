//! Preview image formed while maps arrive.
//!
//! A sub-CPI is added to the image when the maps of all its patches were received. Images of sub-CPIs sum to the image of all
//! of them: each is normalised by the weights of its pulses, so it is weighted by them ([`crate::image`]).
//!
//! **Cost**: that of forming the image once, in parts; memory for the image twice and for the waiting maps of at most
//! [`MAX_WAITING`] sub-CPIs. Beyond that the oldest are left out.

use std::collections::BTreeMap;

use num_complex::Complex32;
use subaperture_core::stream::{MapHeader, Patch};

use crate::image::{MapsTask, form};
use crate::maps::{Maps, OwnedMap, Run, RunTotals};
use subaperture_focus::{BoundPolicy, FormError};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::ReadError;

/// Maximum number of incomplete sub-CPIs held.
pub const MAX_WAITING: usize = 16;

/// Preview image.
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
    /// Create an empty image for maps of `patches` patches of `run`.
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

    /// Upper bound of its memory in bytes for maps of `patches`.
    pub fn held_bytes(grid: &ImageGrid, patches: &[Patch]) -> u64 {
        let sub_cpi: u64 = patches.iter().map(OwnedMap::bytes).sum();
        let pixel_bytes = 2 * size_of::<Complex32>() as u64;
        grid.num_pixels() * pixel_bytes + MAX_WAITING as u64 * sub_cpi
    }

    /// Add a received map to its sub-CPI.
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
            > MAX_WAITING
        {
            let oldest = self.waiting.iter().find(|(_, maps)| unfinished(maps));
            if let Some(sub_cpi) = oldest.map(|(sub_cpi, _)| *sub_cpi) {
                self.waiting.remove(&sub_cpi);
            }
        }
    }

    /// Add the complete sub-CPIs. Returns the image if there are any.
    ///
    /// # Errors
    /// [`FormError`] if memory is insufficient or a map contains values that are not finite.
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
        // Equal for every patch, since every sub-CPI here has maps of all patches.
        let weights = some.headers.iter().filter(|header| header.patch_index == 0);
        let weight: f64 = weights.map(|header| f64::from(header.weight_sum)).sum();
        let (formed, _) = form(&MapsTask {
            maps: &some,
            grid: &self.grid,
            error_db: self.error_db,
            bound_policy: BoundPolicy::Allowed,
            // In addition to the sum and the returned image.
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

/// Maps of complete sub-CPIs in memory.
struct Batch<'a> {
    run: &'a Run,
    headers: Vec<MapHeader>,
    maps: Vec<OwnedMap>,
}

impl Maps for Batch<'_> {
    fn run(&self) -> &Run {
        self.run
    }

    fn closing(&self) -> Option<&RunTotals> {
        None
    }

    fn headers(&self) -> &[MapHeader] {
        &self.headers
    }

    fn read(&self, index: usize) -> Result<OwnedMap, ReadError> {
        Ok(self.maps[index].clone())
    }
}
