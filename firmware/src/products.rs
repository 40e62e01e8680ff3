//! Map products other than the map itself: detections and an image chip.

use subaperture_core::Complex32;
use subaperture_core::accumulate::{Kernel, PixelGrid, add_patch_map};
use subaperture_core::cfar::{Cfar, Column, Detection};
use subaperture_core::link::{ChipGrid, Refusal};
use subaperture_core::stream::{PatchMap, Setup};

/// Maximum number of detections per map.
pub const DETECTIONS: usize = 32;

/// Interpolation kernel for image chips: 8 taps.
pub type ChipKernel = Kernel<8, 64>;

/// Buffers of the map products.
#[derive(Debug)]
pub struct ProductBuffers<'a> {
    /// Pixels of the chip. The length limits the size of a chip.
    pub chip: &'a mut [Complex32],
    /// Interpolation kernel of the chip.
    pub kernel: &'a ChipKernel,
    /// Column sums for CFAR: one per range bin of the widest map to be searched.
    pub columns: &'a mut [Column],
}

/// Map products of a run.
#[derive(Debug)]
pub(crate) struct Products<'a> {
    buffers: ProductBuffers<'a>,
    pub(crate) cfar: Option<Cfar>,
    pub(crate) detections: heapless::Vec<Detection, DETECTIONS>,
    pub(crate) chip: Option<Chip>,
    /// Next step for the current map.
    next: Next,
}

/// Image chip being accumulated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chip {
    pub(crate) grid: ChipGrid,
    /// Number of maps added so far, and the sum of their pulse weights.
    pub(crate) maps: u32,
    pub(crate) weight_sum: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    ChipRow(u16),
    Search,
    Nothing,
}

impl<'a> Products<'a> {
    pub(crate) fn new(buffers: ProductBuffers<'a>) -> Self {
        Self {
            buffers,
            cfar: None,
            detections: heapless::Vec::new(),
            chip: None,
            next: Next::Nothing,
        }
    }

    /// Disable all products.
    pub(crate) fn clear(&mut self) {
        self.cfar = None;
        self.chip = None;
        self.begin_run();
    }

    /// Reset the products for a new run.
    pub(crate) fn begin_run(&mut self) {
        self.detections.clear();
        self.next = Next::Nothing;
        self.buffers.chip.fill(Complex32::ZERO);
        if let Some(chip) = &mut self.chip {
            chip.maps = 0;
            chip.weight_sum = 0.0;
        }
    }

    /// Enable an image chip. Rows of more than `most_columns` pixels could not be sent.
    pub(crate) fn set_chip(&mut self, grid: &ChipGrid, most_columns: usize) -> Result<(), Refusal> {
        let wanted = u32::from(grid.num_columns) * u32::from(grid.num_rows);
        let most = self.buffers.chip.len() as u32;
        if wanted == 0 || wanted > most {
            return Err(Refusal::Chip { wanted, most });
        }
        if usize::from(grid.num_columns) > most_columns {
            return Err(Refusal::Chip {
                wanted: grid.num_columns.into(),
                most: most_columns as u32,
            });
        }
        self.chip = Some(Chip {
            grid: *grid,
            maps: 0,
            weight_sum: 0.0,
        });
        Ok(())
    }

    pub(crate) fn set_cfar(&mut self, cfar: &Cfar) -> Result<(), Refusal> {
        cfar.check().map_err(|_| Refusal::Detect)?;
        self.cfar = Some(*cfar);
        Ok(())
    }

    /// Start the products of a map.
    pub(crate) fn begin_map(&mut self, map: &PatchMap<'_>) {
        self.detections.clear();
        let wanted = self
            .chip
            .as_mut()
            .filter(|chip| chip.grid.patch == map.header.patch_index);
        self.next = match wanted {
            Some(chip) => {
                chip.maps = chip.maps.saturating_add(1);
                chip.weight_sum += map.header.weight_sum;
                Next::ChipRow(0)
            }
            None => Next::Search,
        };
    }

    /// Do one step: add one row to the chip, or search the map. Returns false if nothing is left.
    pub(crate) fn work(&mut self, setup: &Setup, map: &PatchMap<'_>) -> bool {
        match self.next {
            Next::ChipRow(row) => {
                self.next = match self.chip {
                    Some(chip) if row < chip.grid.num_rows => {
                        self.add_chip_row(&chip.grid, row, setup, map);
                        Next::ChipRow(row.wrapping_add(1))
                    }
                    _ => Next::Search,
                };
                true
            }
            Next::Search => {
                if let Some(cfar) = &self.cfar {
                    let bins = map.header.patch.num_range_bins();
                    let columns = self.buffers.columns.get_mut(..bins).unwrap_or(&mut []);
                    // A map that is too wide gets no columns and thus no detections.
                    if cfar
                        .detect_in_map(map, columns, &mut self.detections)
                        .is_err()
                    {
                        self.detections.clear();
                    }
                }
                self.next = Next::Nothing;
                true
            }
            Next::Nothing => false,
        }
    }

    fn add_chip_row(&mut self, grid: &ChipGrid, row: u16, setup: &Setup, map: &PatchMap<'_>) {
        let columns = usize::from(grid.num_columns);
        let first = usize::from(row) * columns;
        let pixels = self.buffers.chip.get_mut(first..).unwrap_or(&mut []);
        let pixels = pixels.get_mut(..columns).unwrap_or(&mut []);
        let mut origin_m = grid.origin_m;
        for (place, step) in origin_m.iter_mut().zip(grid.row_step_m) {
            *place += f64::from(row) * step;
        }
        let line = PixelGrid {
            origin_m,
            column_step_m: grid.column_step_m,
            row_step_m: [0.0; 3],
            num_columns: columns,
            num_rows: 1,
        };
        // The map is normalised by its number of pulses; the chip will be by the sum of all weights.
        let weight = f32::from(map.header.num_pulses);
        // Cannot fail: the pixels have the length of the row.
        let _ = add_patch_map(pixels, &line, setup, map, self.buffers.kernel, weight);
    }

    /// Encode a row of the chip into `out`, normalised by the weights.
    pub(crate) fn chip_row<'b>(
        &self,
        chip: &Chip,
        row: u16,
        out: &'b mut [u8],
    ) -> Option<&'b [u8]> {
        let columns = usize::from(chip.grid.num_columns);
        let first = usize::from(row) * columns;
        let pixels = self.buffers.chip.get(first..first + columns)?;
        let scale = if chip.weight_sum > 0.0 {
            1.0 / chip.weight_sum
        } else {
            0.0
        };
        let places = out.get_mut(..8 * columns)?;
        for (place, pixel) in places.as_chunks_mut().0.iter_mut().zip(pixels) {
            let ([a, b, c, d], [e, f, g, h]) = (
                (pixel.re * scale).to_le_bytes(),
                (pixel.im * scale).to_le_bytes(),
            );
            *place = [a, b, c, d, e, f, g, h];
        }
        Some(places)
    }
}
