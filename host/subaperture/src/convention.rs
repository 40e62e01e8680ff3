//! Inference of a recording's phase convention by image sharpness.
//!
//! Each candidate convention is applied to the same pulses, frequencies and pixels, and a small image is formed by backprojection.
//! The merit is the sum of squared powers of the brightest pixels. With the correct sign and reference all pulses add coherently at a
//! scatterer; otherwise its power spreads over many pixels. A candidate that only shifts or mirrors the scene is equally sharp.
//!
//! **Probe image.** At most `MAX_PULSES` pulses, over as much of the aperture and band as `MAX_PIXELS` pixels resolve. One pulse is
//! drawn from each of equal intervals, at uneven spacing, so that undersampling raises the noise floor and makes no ghost scene.
//! The patch is the declared extent. Without one it is the unambiguous extent around the origin (far field) or, with the origin at
//! the antennas, a square around them as deep as the unambiguous range.
//!
//! **Cost.** Pixels times pulses, at most 2^27 per candidate: some tenths of a second. Memory: 8 bytes per pixel and the scratch of [`bp`](crate::focus::bp).
//!
//! `tests/recordings/convention.rs` checks the choice on simulated recordings of every sign and reference in several geometries, and the refusal of noise.

use std::ops::Range;

use glam::DVec3;

use subaperture_focus::bp::Backprojection;
use subaperture_focus::{ImageFormer, Task};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, Extent, ImageGrid};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::convention::{Inference, Probe, Sharpness};
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory, Weights};
use subaperture_model::resolution::survey::Survey;
use subaperture_signal::window::Window;

/// Maximum number of pulses in the probe image.
const MAX_PULSES: usize = 256;
/// Maximum number of frequencies in the probe image.
const MAX_SAMPLES: usize = 1024;
/// Maximum number of pixels of the probe image.
const MAX_PIXELS: f64 = (1u64 << 19) as f64;
/// Minimum number of pulses, and of frequencies, for a probe image.
const LEAST: usize = 8;
/// Side of the blocks whose brightest pixel counts, pixels.
const BLOCK: usize = 16;
/// Number of brightest blocks in the merit.
const BLOCKS: usize = 32;
/// Minimum length of a near-field aperture, wavelengths. Echoes of a shorter one focus to rings.
const MIN_WAVELENGTHS: f64 = 4.0;
/// Error bound of the probe images, dB; far below the differences in sharpness that decide.
const ERROR_DB: f64 = -30.0;

/// Phase-convention inference by backprojection.
pub const INFERENCE: Inference = Inference { plan, sharpness };

/// Choose the pulses, frequencies and pixels of the probe image.
///
/// # Errors
/// The reason why no probe image is possible: no extent, no resolution, or too few pulses.
pub fn plan(collection: &Collection) -> Result<Probe, String> {
    let (count, width) = (collection.pulses.len(), collection.num_samples);
    if count < LEAST || width < LEAST {
        return Err(format!(
            "expected at least {LEAST} pulses of {LEAST} frequencies, found {count} of {width}"
        ));
    }
    let survey = Survey::of(collection).ok_or("no pulses")?;
    let (extent, near_m) = patch(collection, &survey)?;
    let widest = (MAX_SAMPLES as f64 / width as f64).min(1.0);
    let mut part = 1.0;
    for _ in 0..MAX_ROUNDS {
        let samples = middle(width, part * widest);
        let pulses = drawn(middle(count, part));
        let steps_m = steps_m(collection, (&pulses, &samples), &extent, near_m)?;
        let sides_m = [extent.x_m, extent.y_m].map(|(low, high)| high - low);
        let pixels = sides_m[0] / steps_m[0] * (sides_m[1] / steps_m[1]);
        if pixels > MAX_PIXELS {
            part *= (0.9 * (MAX_PIXELS / pixels).sqrt()).max(0.25);
            if part * (count.min(width) as f64) < LEAST as f64 {
                break;
            }
            continue;
        }
        let axis = |(low, high), step| Axis::from_range(low, high, step).map_err(|error| error.0);
        let columns = axis(extent.x_m, steps_m[0])?;
        let rows = axis(extent.y_m, steps_m[1])?;
        return Ok(Probe {
            pulses,
            samples,
            grid: ImageGrid::horizontal(columns, rows, 0.0),
        });
    }
    Err("the scene has too many pixels for a probe image".to_owned())
}

/// Maximum number of rounds in which the aperture is shortened until the patch fits.
const MAX_ROUNDS: usize = 24;

/// Patch of the probe image and, near the antennas, the range that determines its pixel step.
fn patch(collection: &Collection, survey: &Survey) -> Result<(Extent, Option<f64>), String> {
    if let Some(extent) = collection.extent {
        return Ok((extent, None));
    }
    let centre_m = |n: usize| {
        let pulse = &collection.pulses[n];
        pulse.phase_centre_m()
    };
    let count = collection.pulses.len();
    let scene_m = DVec3::from_array(survey.scene_centre_m);
    let ranges = || (0..count).map(|n| centre_m(n).distance(scene_m));
    let mean_m = ranges().sum::<f64>() / count as f64;
    let least_m = ranges().fold(f64::INFINITY, f64::min);
    let deep_m = survey.unambiguous_slant_range_m;
    // An origin at the antennas has no line of sight.
    let far = !survey.centre_at_antennas && (mean_m > deep_m || least_m > survey.aperture_length_m);
    if let (true, Ok(extent)) = (far, survey.extent()) {
        return Ok((extent, None));
    }
    let middle_m = (0..count).map(centre_m).sum::<DVec3>() / count as f64;
    let around = |middle: f64| (middle - deep_m, middle + deep_m);
    let extent = Extent {
        x_m: around(middle_m.x),
        y_m: around(middle_m.y),
    };
    Ok((extent, Some(deep_m / 4.0)))
}

/// Pixel steps along x and y: half of the coarsest unambiguous step, or half a resolution cell.
fn steps_m(
    collection: &Collection,
    (pulses, samples): (&[usize], &Range<usize>),
    extent: &Extent,
    near_m: Option<f64>,
) -> Result<[f64; 2], String> {
    let part = Collection {
        name: collection.name.clone(),
        num_samples: samples.len(),
        pulses: (pulses.iter().map(|&n| collection.pulses[n]))
            .map(|mut pulse| {
                pulse.start_hz = pulse.frequency_hz(samples.start);
                pulse
            })
            .collect(),
        extent: Some(*extent),
        ..*collection
    };
    let survey = Survey::of(&part).ok_or("no pulses")?;
    if let Some(near_m) = near_m {
        let along_m = SPEED_OF_LIGHT_M_S / (4.0 * survey.bandwidth_hz);
        let across_m = survey.wavelength_m * near_m / (4.0 * survey.aperture_length_m);
        if survey.aperture_length_m < MIN_WAVELENGTHS * survey.wavelength_m {
            return Err(format!(
                "expected antennas that move by at least {MIN_WAVELENGTHS} wavelengths, found less"
            ));
        }
        return Ok([along_m.min(across_m); 2]);
    }
    let [x, y] = survey.nyquist_step_m;
    match (x, y) {
        (Some(x), Some(y)) => Ok([x / 2.0, y / 2.0]),
        _ => Err("the recording has no resolution along x and y".to_owned()),
    }
}

/// Central fraction of an index range.
fn middle(count: usize, part: f64) -> Range<usize> {
    let kept = ((count as f64 * part).round() as usize).clamp(LEAST.min(count), count);
    let first = (count - kept) / 2;
    first..first + kept
}

/// Pulses of a range, one drawn from each of equal intervals.
fn drawn(range: Range<usize>) -> Vec<usize> {
    if range.len() <= MAX_PULSES {
        return range.collect();
    }
    // Weyl sequence of the golden ratio: uniform over the interval and aperiodic.
    let within = |i: usize| (i as f64 * 0.618_033_988_749_895).fract();
    let interval = range.len() as f64 / MAX_PULSES as f64;
    let pulse = |i: usize| range.start + ((i as f64 + within(i)) * interval) as usize;
    let mut pulses: Vec<usize> = (0..MAX_PULSES).map(pulse).collect();
    pulses.dedup();
    pulses
}

/// Sharpness: root of the sum of squared powers of the brightest blocks of the probe image.
///
/// # Errors
/// The reason why no image is formed, including lack of memory.
pub fn sharpness(probe: &Probe, part: &InMemory, memory_bytes: u64) -> Result<Sharpness, String> {
    let weights = Weights::new(part.collection(), Window::None, Window::None);
    let task = Task {
        memory_bytes,
        ..Task::new(part, &probe.grid, &weights)
    };
    let former = Backprojection { error_db: ERROR_DB };
    let formed = former
        .form_planned(&task)
        .map_err(|error| error.to_string())?;
    Ok(Sharpness {
        power: brightness(&formed.image),
        has_point: has_point(&formed.image),
    })
}

/// Natural logarithm of the false-alarm probability: 10^-4.
const LN_CHANCE: f64 = -9.21;

/// Whether the brightest pixel exceeds the maximum of noise. Noise power is exponentially distributed: the largest of `n` independent
/// values exceeds `t` times the mean with probability `n exp(-t)`.
fn has_point(image: &Image) -> bool {
    let powers = || image.pixels.iter().map(|&pixel| power(pixel));
    let count = image.pixels.len().max(1) as f64;
    let mean = powers().sum::<f64>() / count;
    let most = powers().fold(0.0, f64::max);
    most > mean * (libm::log(count) - LN_CHANCE)
}

/// Root of the sum of squared powers over the brightest block peaks.
fn brightness(image: &Image) -> f64 {
    let across = image.columns.div_ceil(BLOCK);
    let mut most = vec![(0.0f64, 0usize); across * image.rows.div_ceil(BLOCK)];
    for (index, &pixel) in image.pixels.iter().enumerate() {
        let (row, column) = (index / image.columns, index % image.columns);
        let block = &mut most[row / BLOCK * across + column / BLOCK];
        if power(pixel) > block.0 {
            *block = (power(pixel), index);
        }
    }
    most.sort_by(|a, b| b.0.total_cmp(&a.0));
    let brightest = most.iter().take(BLOCKS).filter(|(power, _)| *power > 0.0);
    let powers = brightest.map(|&(_, index)| peak_power(image, index));
    powers.map(|q| q * q).sum::<f64>().sqrt()
}

/// Peak power near a pixel, by a parabola through magnitudes along each axis. For a point halfway between pixels spaced half a
/// resolution cell the loss is 0.2 dB an axis, instead of 0.9 dB.
fn peak_power(image: &Image, index: usize) -> f64 {
    let magnitude = |index: usize| power(image.pixels[index]).sqrt();
    let (row, column) = (index / image.columns, index % image.columns);
    let here = magnitude(index);
    let rise = |place: usize, count: usize, stride: usize| {
        if place == 0 || place + 1 == count {
            return 1.0;
        }
        let (before, after) = (magnitude(index - stride), magnitude(index + stride));
        let bend = before - 2.0 * here + after;
        // The brightest pixel of a block may adjoin a brighter one of the next block.
        let is_peak = here >= before && here >= after && bend < 0.0;
        match is_peak {
            true => 1.0 - (after - before).powi(2) / (8.0 * bend * here),
            false => 1.0,
        }
    };
    let rises = rise(column, image.columns, 1) * rise(row, image.rows, image.columns);
    (here * rises).powi(2)
}
