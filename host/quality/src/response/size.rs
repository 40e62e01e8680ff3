//! Size of the window that is read, and of the chip cut from it.

use num_complex::Complex32;
use subaperture_model::image::{Image, ImageSource, power};

use super::error::unreadable;
use super::{REACH_WIDTHS, ResponseError};

/// Smallest and largest half-size of a chip, pixels.
const MIN_HALF: usize = 8;
const MAX_HALF: usize = 40;

/// Largest number of chip pixels per 3 dB width; finer images are decimated.
const MAX_A_WIDTH: f64 = MAX_HALF as f64 / REACH_WIDTHS;

/// Smallest and largest half-size of the window read, pixels; the largest is 128 MiB.
const REACH_PX: (usize, usize) = (64, 2048);

/// Half-size of the window about a pixel, from the widths of its row and column.
pub(super) fn reach_px(
    image: &dyn ImageSource,
    (row, column): (usize, usize),
) -> Result<usize, ResponseError> {
    let (rows, columns) = image.size();
    let around =
        |at: usize, count: usize| at.saturating_sub(REACH_PX.1)..(at + REACH_PX.1 + 1).min(count);
    let lines = [
        ([row..row + 1, around(column, columns)], column),
        ([around(row, rows), column..column + 1], row),
    ];
    let mut widest = 1;
    for (i, (place, at)) in lines.into_iter().enumerate() {
        let line = image.window(&place).map_err(unreadable)?.pixels;
        let at = at - place[1 - i].start;
        let half = power(line[at]) / 2.0;
        let falls = |z: &Complex32| power(*z) < half;
        let left = line[..at].iter().rev().position(falls).unwrap_or(at);
        let right = line[at + 1..].iter().position(falls);
        let right = right.unwrap_or(line.len() - at - 1);
        widest = widest.max(left + right + 1);
    }
    let reach = ((REACH_WIDTHS + 1.0) * widest as f64).ceil() as usize;
    Ok(reach.clamp(REACH_PX.0, REACH_PX.1))
}

/// Half-size of a chip in its own pixels, and its decimation; rows and columns.
pub(super) struct Size {
    pub(super) half: [usize; 2],
    pub(super) stride: [usize; 2],
}

pub(super) fn chip_size(
    image: &Image,
    (row, column): (usize, usize),
    asked: Option<[usize; 2]>,
) -> Result<Size, ResponseError> {
    let here = power(image.pixels[row * image.columns + column]);
    // Pixels between the samples below half power on both sides, minus their average
    // overshoot.
    let width = |stride: usize, back: usize, ahead: usize| {
        let at = row * image.columns + column;
        let falls = |i: usize| power(image.pixels[i]) < here / 2.0;
        let left = (1..=back).find(|k| falls(at - k * stride));
        let right = (1..=ahead).find(|k| falls(at + k * stride));
        let (left, right) = (left.unwrap_or(back), right.unwrap_or(ahead));
        ((left + right) as f64 - 1.0).max(1.0)
    };
    let size = |axis: usize, to_next, at: usize, count: usize| {
        let pixels = at.min(count - 1 - at);
        let width_px = width(to_next, at, count - 1 - at);
        let stride = match asked {
            Some(_) => 1,
            None => (width_px / MAX_A_WIDTH).ceil() as usize,
        };
        let (width, room) = (width_px / stride as f64, pixels / stride);
        let wanted = match asked {
            Some(half) => half[axis].clamp(MIN_HALF, MAX_HALF),
            None => ((REACH_WIDTHS * width).ceil() as usize).clamp(2 * MIN_HALF, MAX_HALF),
        };
        // Four widths contain the first sidelobes of any window.
        let needed = ((4.0 * width).ceil() as usize)
            .clamp(MIN_HALF, MAX_HALF)
            .min(wanted);
        match room < needed {
            true => Err(ResponseError::Border {
                row,
                column,
                room: pixels,
                needed: needed * stride,
            }),
            false => Ok((wanted.min(room), stride)),
        }
    };
    let (rows, columns) = (
        size(0, image.columns, row, image.rows)?,
        size(1, 1, column, image.columns)?,
    );
    Ok(Size {
        half: [rows.0, columns.0],
        stride: [rows.1, columns.1],
    })
}
