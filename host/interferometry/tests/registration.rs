//! Registration of speckle images, shifted in the spectrum by the test.

mod speckle;

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use speckle::{Random, filtered, image_of, pair};
use subaperture_interferometry::registration::{
    TOLERANCE_PIXELS, register, shifted, trusted_offset,
};
use subaperture_interferometry::{InterferometryError, interferogram};
use subaperture_model::image::Image;

const SIDE: usize = 256;
/// Band, cycles per pixel, and its centre on rows and columns.
const BAND: f64 = 0.6;
const CENTRE: [f64; 2] = [0.45, -0.3];

/// Pair of band-limited speckle; the image is moved so that it shows at `p + by` the point that the reference shows at `p`.
fn moved(coherence: f64, by: [f64; 2]) -> [Image; 2] {
    let [image, reference] = pair(&mut Random(3), SIDE * SIDE, coherence);
    // Frequencies about the carrier, without a jump within the band.
    let about = |f: f64, centre: f64| centre + (f - centre) - (f - centre).round();
    let amplitude = |by: [f64; 2]| {
        move |f: f64, g: f64| {
            let at = [about(f, CENTRE[0]), about(g, CENTRE[1])];
            let inside = (0..2).all(|i| (at[i] - CENTRE[i]).abs() < BAND / 2.0);
            match inside {
                true => Complex64::cis(-TAU * (at[0] * by[0] + at[1] * by[1])),
                false => Complex64::ZERO,
            }
        }
    };
    [
        image_of([SIDE; 2], &filtered(&image, SIDE, amplitude(by))),
        image_of([SIDE; 2], &filtered(&reference, SIDE, amplitude([0.0; 2]))),
    ]
}

fn mean_coherence([image, reference]: [&Image; 2]) -> f64 {
    let formed = interferogram(image, reference, [15, 15]).unwrap();
    formed.magnitude().mean().unwrap()
}

/// Bamler and Eineder 2005: the standard deviation of the offset of speckle of coherence D over n cells is sqrt(3 / (2 n)) sqrt(1 - D^2) / (pi D) cells for the
/// coherent estimate, 3e-3 pixels here. Magnitudes have up to twice as much; four standard deviations are allowed.
#[test]
fn known_shift_is_estimated_and_removed() {
    let [unmoved, reference] = moved(0.8, [0.0; 2]);
    let within = register(&unmoved, &reference).unwrap();
    assert!(!within.corrected && within.image == unmoved);
    for by in [[0.37, -1.2], [-2.0, 3.0], [0.0, 0.5]] {
        let [image, reference] = moved(0.8, by);
        let registered = register(&image, &reference).unwrap();
        let found = registered.offset;
        assert!(registered.corrected && found.correlation > 0.5, "{found:?}");
        for (found, by) in [found.rows, found.columns].into_iter().zip(by) {
            assert!((found - by).abs() < 0.024, "{found} {by}");
        }
        let loss = mean_coherence([&unmoved, &reference])
            - mean_coherence([&registered.image, &reference]);
        assert!(loss.abs() < 2e-3, "{loss}");
    }
}

/// The mean over windows of 15 x 15 pixels, 80 looks, is biased by less than 1 / (4 L D) = 0.004 above a coherence of 0.7.
#[test]
fn offset_lowers_coherence_by_sinc() {
    for by in [0.3, 0.6] {
        let [image, reference] = moved(0.99, [by, 0.0]);
        let x = PI * BAND * by;
        let found = mean_coherence([&image, &reference]);
        assert!((found - 0.99 * x.sin() / x).abs() < 0.006, "{by}: {found}");
    }
    let x = PI * TOLERANCE_PIXELS;
    assert!((1.0 - x.sin() / x - 1e-3).abs() < 1e-5);
}

#[test]
fn registration_of_unrelated_images_is_refused() {
    for seed in 10..14 {
        let [_, reference] = moved(0.8, [0.0; 2]);
        let [other, _] = pair(&mut Random(seed), SIDE * SIDE, 0.0);
        let other = image_of([SIDE; 2], &other);
        let refused = trusted_offset(&other, &reference);
        assert!(
            matches!(refused, Err(InterferometryError::Uncorrelated { .. })),
            "{refused:?}"
        );
    }
}

#[test]
fn shift_by_whole_pixels_moves_them() {
    let pixels: Vec<Complex64> = (0..48).map(|i| Complex64::new(f64::from(i), 1.0)).collect();
    let image = image_of([6, 8], &pixels);
    let moved = shifted(&image, [2.0, -1.0]);
    for row in 0..6 {
        for column in 0..8 {
            let z = moved.pixels[row * 8 + column];
            match row + 2 < 6 && column >= 1 {
                true => {
                    let from = image.pixels[(row + 2) * 8 + column - 1];
                    // The phase of an unknown whole number of cycles of the carrier is constant.
                    assert!((z.norm() - from.norm()).abs() < 1e-4, "{row} {column}");
                }
                false => assert!(z.is_nan()),
            }
        }
    }
}
