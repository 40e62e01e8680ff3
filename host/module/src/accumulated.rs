//! Image that a module accumulates from its maps ([`crate::link::Session::accumulate`]).
//!
//! Every patch has a chip: the rectangle of the grid's pixels that belong to it. The module sums the maps of each patch over
//! all sub-CPIs at the pixels of its chip (`subaperture_core::accumulate`, the range-Doppler backprojection of Schone 2020,
//! chapter 3), or the power of each sub-CPI ([`ImageSum::Power`]), and sends each chip once. The bytes from the module are those
//! of the pixels, however many pulses there are.
//!
//! **Error**: that of the plan for [`ModuleProduct::Image`](crate::plan::ModuleProduct::Image). **Tests**: `tests/link/image.rs`,
//! `tests/firmware/gotcha.rs`.

use num_complex::Complex32;
use subaperture_core::accumulate::{ChipKernel, add_patch_map, add_power};
use subaperture_core::link::{CHIP_PART_PIXELS, ChipGrid, PixelEncoding, Row, write_pixels};

use crate::link::{AccumulatedImage, HostCore, ImageRequest, ImageSum};
use crate::plan::ModulePlan;
use subaperture_focus::patch::{Rectangle, rectangles};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::phase_history::ReadError;

/// Reason why the image of a plan exceeds the capacity of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unsuited {
    /// More pixels than the module has memory for.
    #[error(
        "pixels: expected at most {most} for this module, found {pixels}: use a smaller or coarser grid"
    )]
    Pixels {
        /// Pixels of the grid.
        pixels: u64,
        /// Pixels that the module has memory for.
        most: u32,
    },
    /// More sub-CPIs than the module counts.
    #[error(
        "sub-CPIs: expected at most {most} for this module, found {sub_cpis}: link the recordings one by one"
    )]
    SubCpis {
        /// Sub-CPIs of the plan.
        sub_cpis: usize,
        /// Sub-CPIs that the module counts.
        most: u32,
    },
}

/// Chips of the patches of a plan, in their order.
pub fn chips(plan: &ModulePlan, grid: &ImageGrid) -> Vec<ChipGrid> {
    let places = rectangles(grid, plan.patch_pixels);
    let chips = places.iter().zip(0..).map(|(place, patch)| ChipGrid {
        patch,
        origin_m: grid.position_m(place.row, place.column).to_array(),
        column_step_m: (grid.x_axis * grid.columns.step).to_array(),
        row_step_m: (grid.y_axis * grid.rows.step).to_array(),
        num_columns: place.size.columns as u16,
        num_rows: place.size.rows as u16,
    });
    chips.collect()
}

/// Image of the chips on the grid; pixels of missing chips are zero. A pixel of power is its root, the amplitude. Samples were
/// multiplied by `amplitude_scale`.
pub fn assemble(
    plan: &ModulePlan,
    grid: &ImageGrid,
    received: &AccumulatedImage,
    sum: ImageSum,
    amplitude_scale: f32,
) -> Image {
    let columns = grid.columns.count;
    let mut pixels = vec![Complex32::ZERO; grid.rows.count * columns];
    let places = rectangles(grid, plan.patch_pixels);
    for (place, chip) in places.iter().zip(&received.chips) {
        let Rectangle { row, column, size } = *place;
        let Some(chip) = chip else { continue };
        for (i, line) in chip.chunks(size.columns).enumerate() {
            let first = (row + i) * columns + column;
            for (pixel, value) in pixels[first..].iter_mut().zip(line) {
                let value = match sum {
                    ImageSum::Coherent => *value,
                    ImageSum::Power => Complex32::from(value.re.sqrt()),
                };
                *pixel = value / amplitude_scale;
            }
        }
    }
    Image {
        rows: grid.rows.count,
        columns,
        pixels,
    }
}

/// The same image by the core on this computer: the sum of the same sub-CPIs in the same order. If the module computes as this
/// computer does, the pixels are bit-identical.
///
/// # Errors
/// [`ReadError`] if the recording cannot be read.
pub fn by_host_core(
    core: &mut HostCore<'_>,
    request: ImageRequest<'_>,
    sub_cpis: &[u32],
) -> Result<AccumulatedImage, ReadError> {
    let kernel = ChipKernel::new();
    let ImageRequest { chips, sum, .. } = request;
    let mut sums: Vec<Vec<Complex32>> = chips
        .iter()
        .map(|chip| vec![Complex32::ZERO; chip.num_pixels()])
        .collect();
    let mut image = AccumulatedImage {
        sub_cpis: sub_cpis.to_vec(),
        ..AccumulatedImage::default()
    };
    for &sub_cpi in sub_cpis {
        let setup = *core.setup();
        for (map, (grid, pixels)) in core
            .owned_maps(sub_cpi)?
            .iter()
            .zip(chips.iter().zip(&mut sums))
        {
            let map = map.view();
            if grid.patch == 0 {
                image.weight_sum += map.header.weight_sum;
            }
            let weight = f32::from(map.header.num_pulses);
            for (range, part) in (0..).map_while(|step| grid.step(step)) {
                let pixels = &mut pixels[range];
                let add = |pixels: &mut [Complex32], weight| {
                    add_patch_map(pixels, &part, &setup, &map, &kernel, weight)
                        .expect("as many pixels as the grid has")
                };
                let inside = match sum {
                    ImageSum::Coherent => add(pixels, weight),
                    ImageSum::Power => {
                        let mut look = vec![Complex32::ZERO; pixels.len()];
                        let inside = add(&mut look, weight / map.header.weight_sum);
                        add_power(pixels.iter_mut().map(|pixel| &mut pixel.re), &look)
                            .expect("as many pixels as the look has");
                        inside
                    }
                };
                image.left_out += (pixels.len() - inside) as u64;
            }
        }
    }
    let (scale, encoding) = match sum {
        ImageSum::Coherent => (1.0 / image.weight_sum, core.encoding().into()),
        ImageSum::Power => (1.0 / sub_cpis.len() as f32, PixelEncoding::Power),
    };
    let mut bytes = [0; 8 * CHIP_PART_PIXELS];
    let mut received = |pixels: &[Complex32]| -> Vec<Complex32> {
        let parts = pixels.chunks(CHIP_PART_PIXELS).flat_map(|part| {
            let bytes = write_pixels(encoding, part, scale, &mut bytes);
            let row = bytes.and_then(|bytes| Row::of_pixels(encoding, part.len(), bytes));
            let row = row.expect("the buffer holds a part");
            row.values().collect::<Vec<_>>()
        });
        parts.collect()
    };
    image.chips = sums.iter().map(|pixels| Some(received(pixels))).collect();
    Ok(image)
}
