//! How much of an image a point's measurement takes: the window that is read, the chip that is cut from it.

use num_complex::Complex32;
use subaperture_model::image::{Image, Parts, power};

use super::error::unreadable;
use super::{REACH_WIDTHS, ResponseError};

/// Least and most that a chip reaches from its middle, pixels.
const LEAST_HALF: usize = 8;
const MOST_HALF: usize = 40;

/// Most of a chip's pixels a 3 dB width: of finer images some are left out.
const MOST_A_WIDTH: f64 = MOST_HALF as f64 / REACH_WIDTHS;

/// How far around a point an image that is read part by part is taken, pixels: at least, and at most, which is 128 MiB.
const REACH_PX: (usize, usize) = (64, 2048);

/// How far a chip may reach from a pixel, by the widths of the row and the column through it.
pub(super) fn reach_px(
    image: &dyn Parts,
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

/// How far a chip reaches in its own pixels, and how many of the image's each stands for; rows and columns.
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
    // Pixels from below half the power on the one side to below it on the other, less the part of a
    // pixel by which both overshoot on average.
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
            None => (width_px / MOST_A_WIDTH).ceil() as usize,
        };
        let (width, room) = (width_px / stride as f64, pixels / stride);
        let wanted = match asked {
            Some(half) => half[axis].clamp(LEAST_HALF, MOST_HALF),
            None => ((REACH_WIDTHS * width).ceil() as usize).clamp(2 * LEAST_HALF, MOST_HALF),
        };
        // With four widths the first side lobes of any window are there.
        let needed = ((4.0 * width).ceil() as usize)
            .clamp(LEAST_HALF, MOST_HALF)
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
