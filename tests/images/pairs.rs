//! Measures of image pairs against known values: differences, coherence, shifts.

use num_complex::{Complex32, Complex64};
use subaperture::image::Image;
use subaperture::quality::PairError;
use subaperture::quality::coherence::coherence;
use subaperture::quality::difference::percent_difference;
use subaperture::quality::registration::offset;
use subaperture::signal::window::Window;

use crate::made::{Made, noise};

#[test]
fn percent_difference_agrees_with_hand_calculation() {
    let row = |values: &[f32]| Image {
        rows: 1,
        columns: values.len(),
        pixels: values.iter().map(|&v| Complex32::new(0.0, v)).collect(),
    };
    // Peak 10; the floor of 20 dB is at 1. Magnitudes only: the sign of -8 has no effect.
    let b = row(&[10.0, 4.0, 2.0, 0.5, 0.0, f32::NAN]);
    let a = row(&[-8.0, 5.0, 6.0, 9.0, 1.0, 1.0]);
    let d = percent_difference(&a, &b, 20.0).unwrap();
    for (value, wanted) in d.map.values.iter().zip([20.0, 25.0, 200.0]) {
        assert!((value - wanted).abs() < 1e-4, "{value}");
    }
    assert!(d.map.values[3..].iter().all(|v| v.is_nan()));
    let s = d.summary;
    assert_eq!((s.num_pixels, s.num_excluded), (3, 3));
    assert!((s.median.unwrap() - 25.0).abs() < 1e-9);
    assert!((s.largest.unwrap() - 200.0).abs() < 1e-9);
    assert!((s.mean.unwrap() - 245.0 / 3.0).abs() < 1e-9);
    let error = percent_difference(&a, &row(&[1.0]), 20.0).unwrap_err();
    assert!(matches!(error, PairError::Size { .. }));
}

#[test]
fn coherence_estimates_known_decorrelation() {
    // b = rho a + sqrt(1 - rho^2) n with independent a and n of power 1 has coherence rho. A window of n^2 pixels estimates it with a bias
    // of about (1 - rho^2)^2 / (4 n^2 rho), and the mean over 120^2 pixels scatters by less than 1 / (n sqrt(2 * 120^2 / n^2)) = 0.006.
    let (a, other) = (noise(120, 5), noise(120, 6));
    for rho in [0.95, 0.6] {
        let pixels = a
            .pixels
            .iter()
            .zip(&other.pixels)
            .map(|(&u, &v)| u * rho as f32 + v * f64::sqrt(1.0 - rho * rho) as f32);
        let b = Image {
            pixels: pixels.collect(),
            ..a.clone()
        };
        let map = coherence(&a, &b, 11).unwrap();
        let bias = (1.0 - rho * rho).powi(2) / (4.0 * 121.0 * rho);
        let mean = map.mean().unwrap();
        println!("rho {rho}: mean {mean:.4}");
        assert!((mean - rho - bias).abs() < 0.01, "{mean}");
    }
    // Against the definition at a corner, at an edge and inside.
    let map = coherence(&a, &other, 5).unwrap();
    for (row, column) in [(0usize, 0usize), (0, 60), (119, 119), (70, 33), (3, 118)] {
        let (mut cross, mut p, mut q) = (Complex64::ZERO, 0.0, 0.0);
        for i in row.saturating_sub(2)..=(row + 2).min(119) {
            for j in column.saturating_sub(2)..=(column + 2).min(119) {
                let wide = |z: Complex32| Complex64::new(z.re.into(), z.im.into());
                let (u, v) = (wide(a.pixels[i * 120 + j]), wide(other.pixels[i * 120 + j]));
                cross += u * v.conj();
                p += u.norm_sqr();
                q += v.norm_sqr();
            }
        }
        let wanted = cross.norm() / (p * q).sqrt();
        let value = f64::from(map.values[row * 120 + column]);
        assert!(
            (value - wanted).abs() < 1e-6,
            "{row} {column}: {value} {wanted}"
        );
    }
    // A complex factor changes no value; a non-finite pixel affects all windows that contain it.
    let mut turned = Image {
        pixels: a
            .pixels
            .iter()
            .map(|z| z * Complex32::new(0.0, -3.0))
            .collect(),
        ..a.clone()
    };
    turned.pixels[60 * 120 + 60].re = f32::NAN;
    let map = coherence(&a, &turned, 3).unwrap();
    for (i, value) in map.values.iter().enumerate() {
        let felt = (i / 120).abs_diff(60) <= 1 && (i % 120).abs_diff(60) <= 1;
        assert!(
            if felt {
                value.is_nan()
            } else {
                (value - 1.0).abs() < 1e-6
            },
            "{i}: {value}"
        );
    }
    assert!(
        coherence(&a, &turned, 4)
            .unwrap_err()
            .to_string()
            .contains("odd")
    );
}

#[test]
fn registration_estimates_known_shift() {
    // Points with a band sampled at half its cell, and the same points shifted by a fraction of a pixel.
    let scene = |rows: f64, columns: f64| {
        let mut image = Image {
            rows: 101,
            columns: 101,
            pixels: vec![Complex32::ZERO; 101 * 101],
        };
        for (row, column, phase) in [(40.3, 31.2, 0.1), (62.8, 70.9, 2.0), (25.0, 66.4, -1.3)] {
            let made = Made {
                window: Window::Taylor { side_lobe_db: 35.0 },
                cell: 2.0,
                row: row + rows,
                column: column + columns,
                turn: [1.0, -2.0],
                amplitude: Complex64::cis(phase),
            };
            for (sum, z) in image.pixels.iter_mut().zip(made.image(101).pixels) {
                *sum += z;
            }
        }
        image
    };
    let b = scene(0.0, 0.0);
    for (rows, columns) in [(0.0, 0.0), (0.37, -1.61), (-7.25, 4.5)] {
        let found = offset(&scene(rows, columns), &b).unwrap();
        println!("{rows} {columns}: {found:?}");
        assert!((found.rows - rows).abs() < 0.01, "{found:?}");
        assert!((found.columns - columns).abs() < 0.01, "{found:?}");
        assert!(found.correlation > 0.99, "{found:?}");
    }
    let flat = Image {
        pixels: vec![Complex32::ONE; 101 * 101],
        ..b.clone()
    };
    assert!(
        offset(&flat, &b)
            .unwrap_err()
            .to_string()
            .contains("contrast")
    );
}
