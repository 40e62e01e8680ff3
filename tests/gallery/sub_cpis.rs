//! Effect of sub-CPIs on the image of a point in the middle of Schone 2020, Table 4.1, by a plain sum.
//!
//! Within a sub-CPI the thesis approximates the range of a pixel as linear. Only this approximation is made here: the sum over pulses and
//! frequencies of the point's phase against that of piecewise linear ranges of the pixel, without maps, transforms and interpolation. An
//! exact implementation of the method gives this image.

use std::f64::consts::PI;
use std::ops::Range;

use num_complex::Complex64;

pub(crate) const LIGHT_M_S: f64 = 299_792_458.0;
/// Middle of the band.
pub(crate) const CENTRE_HZ: f64 = 10e9;
pub(crate) const BANDWIDTH_HZ: f64 = 200e6;
pub(crate) const RANGE_M: f64 = 5000.0;
/// Distance between pulses, 125 m/s for 1 ms.
pub(crate) const SPACING_M: f64 = 0.125;
pub(crate) const NUM_PULSES: usize = 1040;
/// Number of frequencies in place of 256, enough for points 20 m off.
const NUM_FREQUENCIES: usize = 32;
/// Step of the search for a lobe: a thirtieth of its width.
const STEP_M: f64 = 0.02;

/// The image at `(x, 0)` from `pulses` in sub-CPIs of `length`; an incomplete last one is left out. A focused point is 1.
pub(crate) fn image(x_m: f64, pulses: Range<usize>, length: usize) -> Complex64 {
    let place_m = |n: f64| (n - (NUM_PULSES as f64 - 1.0) / 2.0) * SPACING_M;
    let step_hz = BANDWIDTH_HZ / NUM_FREQUENCIES as f64;
    let mut sum = Complex64::ZERO;
    let mut count = 0.0;
    for first in pulses.clone().step_by(length) {
        if first + length > pulses.end {
            break;
        }
        let middle_m = place_m(first as f64 + (length as f64 - 1.0) / 2.0);
        let range_m = (x_m - middle_m).hypot(RANGE_M);
        let slope = -(x_m - middle_m) / range_m;
        for n in first..first + length {
            let at_m = place_m(n as f64);
            let taken_m = range_m + slope * (at_m - middle_m);
            let off_m = taken_m - at_m.hypot(RANGE_M);
            for k in 0..NUM_FREQUENCIES {
                let offset_hz = (k as f64 + 0.5) * step_hz - BANDWIDTH_HZ / 2.0;
                let turns = 2.0 * (CENTRE_HZ + offset_hz) / LIGHT_M_S * off_m;
                sum += Complex64::cis(2.0 * PI * turns.fract());
                count += 1.0;
            }
        }
    }
    sum / count
}

/// Position of the grating lobe of an order: `k lambda R / (2 D)` for sub-CPIs of length `D`.
pub(crate) fn lobe_m(length: usize, order: usize) -> f64 {
    let spacing_m = length as f64 * SPACING_M;
    order as f64 * LIGHT_M_S / CENTRE_HZ * RANGE_M / (2.0 * spacing_m)
}

/// Largest level within half a metre of `x_m` on either side relative to the point, dB. Sub-CPIs of one pulse give backprojection.
pub(crate) fn level_db(x_m: f64, length: usize) -> f64 {
    let steps = (0.5 / STEP_M) as i32;
    let largest = (-steps..=steps)
        .map(|i| x_m + f64::from(i) * STEP_M)
        .flat_map(|x| [-x, x])
        .map(|x| image(x, 0..NUM_PULSES, length).norm())
        .fold(0.0, f64::max);
    decibels(largest / image(0.0, 0..NUM_PULSES, length).norm())
}

/// The sub-CPI in the middle of the track.
pub(crate) fn middle(length: usize) -> Range<usize> {
    let first = NUM_PULSES / 2 - length / 2;
    first..first + length
}

/// Peak of the middle sub-CPI's image, dB.
pub(crate) fn peak_of_one_db(length: usize) -> f64 {
    decibels(image(0.0, middle(length), length).norm())
}

/// Half-power width in x of the middle sub-CPI's image.
pub(crate) fn width_of_one_m(length: usize) -> f64 {
    let norm = |x| image(x, middle(length), length).norm();
    let half = norm(0.0) / 2f64.sqrt();
    // Symmetrical, like the track and the range.
    let steps = (0..).take_while(|&i| norm(f64::from(i) * STEP_M) > half);
    2.0 * STEP_M * (steps.count() as f64 - 0.5)
}

/// Level of an amplitude.
pub(crate) fn decibels(amplitude: f64) -> f64 {
    20.0 * amplitude.log10()
}

/// `sin(pi x) / (pi x)`.
pub(crate) fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}
