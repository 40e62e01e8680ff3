//! Map products other than the map itself: detections, and image chips that accumulate the maps of all sub-CPIs.

use subaperture_core::Complex32;
use subaperture_core::accumulate::{ChipKernel, add_patch_map, add_power};
use subaperture_core::cfar::{Cfar, CfarSearch, Column, Detection};
use subaperture_core::dpca::{Balance, Difference, Dpca};
use subaperture_core::link::{
    CHIP_PART_PIXELS, ChipGrid, Encoding, ImageCapacity, MAX_ACCUMULATED_BYTES, PixelEncoding,
    Refusal, write_pixels,
};
use subaperture_core::stream::{MapHeader, Patch, PatchMap, Setup};

/// Maximum number of pixels per step.
const STEP: usize = ChipGrid::STEP_PIXELS;

/// Maximum number of detections per map.
pub const DETECTIONS: usize = 32;

/// Maximum number of channels of a detection.
pub const CHANNELS: usize = 4;

/// Buffers of the map products.
#[derive(Debug)]
pub struct ProductBuffers<'a> {
    /// Pixels of all chips, or the map of channel 0 kept for the clutter cancellation. The length limits the size of both.
    pub pixels: &'a mut [Complex32],
    /// Image chips: one per patch.
    pub chips: &'a mut [Chip],
    /// Accumulated sub-CPIs: one bit each.
    pub accumulated: &'a mut [u8],
    /// Interpolation kernel of the chips.
    pub kernel: &'a ChipKernel,
    /// Column sums for CFAR: one per range bin of the widest map to be searched.
    pub columns: &'a mut [Column],
    /// Value of each channel's map at the cell of each detection.
    pub values: &'a mut ChannelValues,
}

/// Values of each channel by detection.
pub type ChannelValues = [[Complex32; CHANNELS]; DETECTIONS];

/// Initial value of a static buffer, all bytes zero.
pub const NO_VALUES: ChannelValues = [[Complex32::ZERO; CHANNELS]; DETECTIONS];

/// Image chip of a patch: its grid and its place among the pixels.
#[derive(Clone, Copy, Debug)]
pub struct Chip {
    pub(crate) grid: ChipGrid,
    first_pixel: u32,
    /// Number of contributions left out because the pixel lies outside the map.
    pub(crate) left_out: u32,
}

impl Chip {
    /// Chip without pixels; initial value of a static buffer.
    pub const EMPTY: Self = Self {
        grid: ChipGrid {
            patch: 0,
            origin_m: [0.0; 3],
            column_step_m: [0.0; 3],
            row_step_m: [0.0; 3],
            num_columns: 0,
            num_rows: 0,
        },
        first_pixel: 0,
        left_out: 0,
    };

    /// Number of parts in which the chip is sent.
    pub(crate) fn num_parts(&self) -> u16 {
        self.grid.num_pixels().div_ceil(CHIP_PART_PIXELS) as u16
    }
}

/// Map products of a configuration. With clutter cancellation the pixels hold the map of channel 0 until that of channel 1 is searched.
///
/// A sub-CPI counts as accumulated once the maps of all its patches were added to their chips. In between,
/// [`Products::is_partial`] holds, and the run must not end.
#[derive(Debug)]
pub(crate) struct Products<'a> {
    buffers: ProductBuffers<'a>,
    pub(crate) cfar: Option<Cfar>,
    dpca: Option<Dpca>,
    /// Factor from channel 1 to channel 0 of the current map.
    gain: Complex32,
    pub(crate) detections: heapless::Vec<Detection, DETECTIONS>,
    num_chips: usize,
    /// Whether the chips accumulate the power of each sub-CPI, in the real parts of their pixels.
    power: bool,
    /// Number of sub-CPIs accumulated, and the sum of their pulse weights.
    pub(crate) sub_cpis: u32,
    pub(crate) weight_sum: f32,
    is_partial: bool,
    /// Next step for the current map.
    next: Next,
}

#[derive(Debug)]
enum Next {
    /// Step of the chip ([`ChipGrid::step`]).
    Chip(usize),
    /// Keep this row of the map of channel 0.
    Keep(usize),
    /// Estimate the gain between the channels.
    Balance(Balance),
    BeginSearch,
    Search(CfarSearch),
    /// Read the values at the detections.
    Values,
    Done,
}

impl<'a> Products<'a> {
    pub(crate) fn new(buffers: ProductBuffers<'a>) -> Self {
        Self {
            buffers,
            cfar: None,
            dpca: None,
            gain: Complex32::ONE,
            detections: heapless::Vec::new(),
            num_chips: 0,
            power: false,
            sub_cpis: 0,
            weight_sum: 0.0,
            is_partial: false,
            next: Next::Done,
        }
    }

    /// Maximum sizes of an image.
    pub(crate) fn capacity(&self) -> ImageCapacity {
        ImageCapacity {
            pixels: self.buffers.pixels.len() as u32,
            sub_cpis: (8 * self.buffers.accumulated.len()) as u32,
        }
    }

    /// Disable all products and discard the chips.
    pub(crate) fn clear(&mut self) {
        self.cfar = None;
        self.dpca = None;
        self.num_chips = 0;
        self.power = false;
        self.sub_cpis = 0;
        self.weight_sum = 0.0;
        self.is_partial = false;
        self.buffers.pixels.fill(Complex32::ZERO);
        self.buffers.accumulated.fill(0);
        self.begin_run();
    }

    /// Reset the products of single maps for a new run. Chips keep their sums.
    pub(crate) fn begin_run(&mut self) {
        self.detections.clear();
        self.next = Next::Done;
    }

    /// Values of each channel by detection.
    pub(crate) fn values(&self) -> &ChannelValues {
        self.buffers.values
    }

    /// Chips in the order of their patches.
    pub(crate) fn chips(&self) -> &[Chip] {
        self.buffers.chips.get(..self.num_chips).unwrap_or(&[])
    }

    /// Whether some chips contain a sub-CPI that others do not.
    pub(crate) fn is_partial(&self) -> bool {
        self.is_partial
    }

    /// Bytes of the list of accumulated sub-CPIs from `first` on, a multiple of 8.
    pub(crate) fn accumulated(&self, first: u32) -> &[u8] {
        let rest = self.buffers.accumulated.get(first as usize / 8..);
        let rest = rest.unwrap_or(&[]);
        rest.get(..MAX_ACCUMULATED_BYTES).unwrap_or(rest)
    }

    fn has(&self, sub_cpi: u32) -> bool {
        let byte = self.buffers.accumulated.get(sub_cpi as usize / 8);
        byte.is_some_and(|byte| byte >> (sub_cpi % 8) & 1 == 1)
    }

    /// Set the chip of the next patch, or the same chip again. Chips are of one channel.
    pub(crate) fn set_chip(
        &mut self,
        grid: &ChipGrid,
        sub_cpis: u32,
        channels: u16,
    ) -> Result<(), Refusal> {
        if channels > 1 {
            return Err(Refusal::Channels {
                wanted: channels,
                most: 1,
            });
        }
        let (index, capacity) = (usize::from(grid.patch), self.capacity());
        if self
            .chips()
            .get(index)
            .is_some_and(|chip| chip.grid == *grid)
        {
            return Ok(());
        }
        if index != self.num_chips || index >= self.buffers.chips.len() {
            return Err(Refusal::PatchIndex);
        }
        if sub_cpis == 0 || sub_cpis > capacity.sub_cpis {
            return Err(Refusal::SubCpis {
                wanted: sub_cpis,
                most: capacity.sub_cpis,
            });
        }
        let before: usize = self.chips().iter().map(|chip| chip.grid.num_pixels()).sum();
        let wanted = before.saturating_add(grid.num_pixels());
        if wanted == before || wanted > self.buffers.pixels.len() {
            return Err(Refusal::Chip {
                wanted: wanted as u32,
                most: capacity.pixels,
            });
        }
        let chip = Chip {
            grid: *grid,
            first_pixel: before as u32,
            left_out: 0,
        };
        if let Some(place) = self.buffers.chips.get_mut(index) {
            *place = chip;
            self.num_chips = index.saturating_add(1);
        }
        Ok(())
    }

    pub(crate) fn set_cfar(&mut self, cfar: &Cfar) -> Result<(), Refusal> {
        cfar.check().map_err(|_| Refusal::Detect)?;
        self.cfar = Some(*cfar);
        Ok(())
    }

    /// Detect on the difference of two channels.
    pub(crate) fn set_dpca(&mut self, dpca: &Dpca, setup: Option<&Setup>) -> Result<(), Refusal> {
        let setup = setup.ok_or(Refusal::NotConfigured)?;
        dpca.check(setup).map_err(Refusal::Dpca)?;
        self.dpca = Some(*dpca);
        Ok(())
    }

    /// Check that the maps of these patches can be kept if the clutter is cancelled.
    pub(crate) fn check_patches(&self, patches: &[Patch]) -> Result<(), Refusal> {
        if self.dpca.is_none() {
            return Ok(());
        }
        let most = self.buffers.pixels.len();
        let mut all = patches.iter();
        all.try_for_each(|patch| Dpca::check_patch(patch, most))
            .map_err(Refusal::Dpca)
    }

    /// Accumulate power in place of the coherent sum. Refused once the chips contain a sub-CPI.
    pub(crate) fn set_power(&mut self) -> Result<(), Refusal> {
        if self.sub_cpis > 0 && !self.power {
            return Err(Refusal::NotConfigured);
        }
        self.power = true;
        Ok(())
    }

    /// Encoding of the chips, given that of maps.
    pub(crate) fn chip_encoding(&self, maps: Encoding) -> PixelEncoding {
        if self.power {
            PixelEncoding::Power
        } else {
            maps.into()
        }
    }

    /// Start the products of a map. Targets are detected on the map of channel 0, or on the difference once that of channel 1 is formed.
    pub(crate) fn begin_map(&mut self, map: &PatchMap<'_>) {
        if map.header.channel > 0 {
            self.next = match self.dpca {
                Some(_) => Next::Balance(Balance::new()),
                None => Next::Values,
            };
            return;
        }
        self.detections.clear();
        if self.dpca.is_some() {
            self.next = Next::Keep(0);
            return;
        }
        let accumulate = self.num_chips > 0 && !self.has(map.header.sub_cpi);
        self.is_partial |= accumulate;
        self.next = if accumulate {
            Next::Chip(0)
        } else {
            Next::BeginSearch
        };
    }

    /// End the products of a map. The last patch completes its sub-CPI.
    pub(crate) fn end_map(&mut self, header: &MapHeader) {
        let last = usize::from(header.patch_index).saturating_add(1) == self.num_chips;
        if !(self.is_partial && last) {
            return;
        }
        let place = self
            .buffers
            .accumulated
            .get_mut(header.sub_cpi as usize / 8);
        if let Some(byte) = place {
            *byte |= 1 << (header.sub_cpi % 8);
        }
        self.is_partial = false;
        self.sub_cpis = self.sub_cpis.saturating_add(1);
        self.weight_sum += header.weight_sum;
    }

    /// Do one step: add a few pixels to the chip, or search a few cells of the map. Returns false after the last one.
    pub(crate) fn work(&mut self, setup: &Setup, map: &PatchMap<'_>) -> bool {
        match &mut self.next {
            Next::Chip(step) => {
                let step = *step;
                self.next = match self.add_to_chip(step, setup, map) {
                    Some(()) => Next::Chip(step.wrapping_add(1)),
                    None => Next::BeginSearch,
                };
            }
            Next::Keep(row) => {
                let row = *row;
                let pixels = &mut *self.buffers.pixels;
                let dpca = self.dpca.as_ref();
                let kept = dpca.is_some_and(|dpca| dpca.keep_row(setup, map, row, pixels));
                self.next = match kept {
                    true => Next::Keep(row.wrapping_add(1)),
                    false => Next::Done,
                };
            }
            Next::Balance(balance) => {
                if !balance.step(map, self.buffers.pixels) {
                    self.gain = balance.gain();
                    self.next = Next::BeginSearch;
                }
            }
            Next::BeginSearch => {
                self.next = match self.cfar.map(|cfar| cfar.begin()) {
                    Some(Ok(search)) => Next::Search(search),
                    _ => Next::Done,
                };
            }
            Next::Search(search) => {
                let bins = map.header.patch.num_range_bins();
                // A map that is too wide gets no columns and thus no detections.
                let columns = self.buffers.columns.get_mut(..bins).unwrap_or(&mut []);
                let found = &mut self.detections;
                // Two instances of the search: one that chooses at every cell takes a third more instructions.
                let more = match &self.dpca {
                    None => search.step_in_map(map, columns, found),
                    Some(dpca) => {
                        let difference = Difference {
                            dpca,
                            setup,
                            map,
                            kept: self.buffers.pixels,
                            gain: self.gain,
                        };
                        let power = |row, column| difference.power(row, column);
                        search.step_in_cells(difference.shape(), power, columns, found)
                    }
                };
                if more != Ok(true) {
                    self.next = Next::Values;
                }
            }
            Next::Values => {
                if let Some(dpca) = &self.dpca {
                    let difference = Difference {
                        dpca,
                        setup,
                        map,
                        kept: self.buffers.pixels,
                        gain: self.gain,
                    };
                    let all = self.detections.iter().zip(self.buffers.values.iter_mut());
                    for (detection, values) in all {
                        let aligned = difference.values(detection.cell());
                        for (value, aligned) in values.iter_mut().zip(aligned) {
                            *value = aligned;
                        }
                    }
                    self.next = Next::Done;
                    return true;
                }
                let channel = usize::from(map.header.channel);
                let all = self.detections.iter().zip(self.buffers.values.iter_mut());
                for (detection, values) in all {
                    let (doppler_bin, range_bin) = detection.cell();
                    if let Some(value) = values.get_mut(channel) {
                        *value = map.at(doppler_bin, range_bin);
                    }
                }
                self.next = Next::Done;
            }
            Next::Done => return false,
        }
        true
    }

    /// Do a step of adding the map to the chip of its patch. `None` after the last step.
    fn add_to_chip(&mut self, step: usize, setup: &Setup, map: &PatchMap<'_>) -> Option<()> {
        let chips = self.buffers.chips.get_mut(..self.num_chips)?;
        let chip = chips.get_mut(usize::from(map.header.patch_index))?;
        let (range, grid) = chip.grid.step(step)?;
        let pixels = self.buffers.pixels.get_mut(chip.first_pixel as usize..)?;
        let pixels = pixels.get_mut(range)?;
        let mut look = [Complex32::ZERO; STEP];
        let look = look.get_mut(..pixels.len())?;
        // The map is normalised by its number of pulses; the chip will be by the sum of all weights, a look by those of its map.
        let pulses = f32::from(map.header.num_pulses);
        let (sums, weight) = if self.power {
            (&mut *look, pulses / map.header.weight_sum)
        } else {
            (&mut *pixels, pulses)
        };
        // Cannot fail: the pixels have the length of the grid.
        let inside = add_patch_map(sums, &grid, setup, map, self.buffers.kernel, weight).ok()?;
        if self.power {
            add_power(pixels.iter_mut().map(|pixel| &mut pixel.re), look).ok()?;
        }
        let left_out = pixels.len().saturating_sub(inside) as u32;
        chip.left_out = chip.left_out.saturating_add(left_out);
        Some(())
    }

    /// Encode a part of a chip into `out`, normalised by the weights, or the power by the number of sub-CPIs.
    pub(crate) fn chip_part<'b>(
        &self,
        chip: &Chip,
        part: u16,
        encoding: PixelEncoding,
        out: &'b mut [u8],
    ) -> Option<&'b [u8]> {
        let first = chip.first_pixel as usize;
        let pixels = self.buffers.pixels.get(first..)?;
        let pixels = pixels.get(..chip.grid.num_pixels())?;
        let pixels = pixels.chunks(CHIP_PART_PIXELS).nth(part.into())?;
        let sum = if self.power {
            self.sub_cpis as f32
        } else {
            self.weight_sum
        };
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        write_pixels(encoding, pixels, scale, out)
    }
}
