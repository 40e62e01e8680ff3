//! Compression of the range-Doppler data to the image, and interpolation of the image at pixels.

use std::f64::consts::{FRAC_PI_4, TAU};

use num_complex::Complex32;
use rayon::prelude::*;

use super::cost::{COMPRESSION, PIXELS};
use super::{ImageAxis, RangeMethod, Strip, TAPS, stationary_phase_error, step_done};
use crate::pixels::for_each;
use crate::{FormError, Tile, Work};
use subaperture_kernels::reading::weighted;
use subaperture_model::monitor::during;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::{cis, narrow, phasor};

/// Transform `[Q][R]` to the image over range and along-track position, `[R][X]`, with both
/// carriers removed.
pub(super) fn compress<M: RangeMethod>(
    strip: &Strip<M>,
    work: &Work,
    ranges: &[Complex32],
) -> Result<Vec<Complex32>, FormError> {
    let axes = &strip.fitted.axes;
    let (num_bins, num_ranges) = (axes.num_bins, axes.range.count);
    let length = axes.along_length;
    let fft = strip.spec.numerics.transforms.inverse(length);
    let mut image = vec![Complex32::ZERO; num_ranges * axes.along.count];
    let scratch = || {
        let line = vec![Complex32::ZERO; length];
        let scratch = vec![Complex32::ZERO; fft.get_inplace_scratch_len()];
        (line, scratch, during(work.monitor, COMPRESSION))
    };
    image
        .par_chunks_exact_mut(axes.along.count)
        .enumerate()
        .for_each_init(scratch, |(line, scratch, _), (j, row)| {
            if work.monitor.cancelled() {
                return;
            }
            line.fill(Complex32::ZERO);
            for q in 0..num_bins {
                // The carrier's bin becomes bin 0 of the transform.
                let place = (q + length - num_bins / 2) % length;
                line[place] = ranges[q * num_ranges + j];
            }
            fft.process_with_scratch(line, scratch);
            for (m, value) in (axes.first_along..).zip(row) {
                *value = line[m.rem_euclid(length as i64) as usize];
            }
        });
    step_done(work, 0.8)?;
    Ok(image)
}

/// Interpolate the pixels of tiles.
pub(super) fn pixels<M: RangeMethod>(
    strip: &Strip<M>,
    work: &Work,
    image: &[Complex32],
    tiles: &mut [Tile],
) -> Result<(), FormError> {
    let axes = &strip.fitted.axes;
    let kernel = KaiserBessel::new(TAPS);
    let columns = axes.along.count;
    // Range-independent factors of the reference: sqrt(2 pi j), and 1 / period for the sum over kx.
    let constant = cis(FRAC_PI_4) * TAU.sqrt() / axes.period_m;
    let carrier = axes.range.carrier;
    let at_reference = stationary_phase_error(axes.reference_range_m() * carrier);
    for_each(
        strip.spec.grid,
        tiles,
        work.monitor,
        PIXELS,
        |point, pixel| {
            let (along_m, range_m) = strip.fitted.motion.positions.track.along_and_range_m(point);
            let (row, row_weights) = taps(&kernel, &axes.range, range_m);
            let (column, column_weights) = taps(&kernel, &axes.along, along_m);
            let sum = weighted(
                image,
                columns,
                [row, column],
                [&row_weights, &column_weights],
            );
            let turns = (range_m * carrier + along_m * axes.along.carrier) / TAU;
            let bracket = stationary_phase_error(range_m * carrier) / at_reference;
            *pixel += sum * narrow(constant * bracket * phasor(turns) * range_m.sqrt());
        },
    );
    step_done(work, 1.0)
}

/// Index of the first element around `value`, and the interpolation weights.
fn taps(kernel: &KaiserBessel, axis: &ImageAxis, value_m: f64) -> (usize, [f32; TAPS]) {
    let place = (value_m - axis.first_m) / axis.step_m;
    let whole = place.floor();
    let first = whole as usize + 1 - TAPS / 2;
    (
        first.min(axis.count - TAPS),
        kernel.weights::<TAPS>((place - whole) as f32),
    )
}
