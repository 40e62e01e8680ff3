//! Image comparison against hand-derived values.

use num_complex::Complex32;
use subaperture::image::{Comparison, ComparisonError, Image};

fn row(pixels: &[(f32, f32)]) -> Image {
    Image {
        rows: 1,
        columns: pixels.len(),
        pixels: pixels
            .iter()
            .map(|&(re, im)| Complex32::new(re, im))
            .collect(),
    }
}

#[track_caller]
fn near(value: Option<f64>, expected: f64, tolerance: f64) {
    let value = value.expect("defined");
    assert!(
        (value - expected).abs() < tolerance,
        "{value}, not {expected}"
    );
}

#[test]
fn compare_estimates_and_removes_complex_factor() {
    // a = b / 2 rotated by -30 deg. Then ||a - b||^2 / ||b||^2 = 1 + 1/4 - cos 30, the best s is 2 at +30 deg, and the remainder is float32
    // rounding of a: at most 2^-24 of each part, -144 dB.
    let b = row(&[(3.0, -1.0), (0.5, 2.0), (-7.0, 0.25), (0.01, 0.0)]);
    let half = Complex32::from_polar(0.5, -30f32.to_radians());
    let a = Image {
        pixels: b.pixels.iter().map(|z| z * half).collect(),
        ..b.clone()
    };
    let c = Comparison::between(&a, &b).unwrap();
    let expected = 10.0 * (1.25 - 0.75f64.sqrt()).log10();
    near(c.error_db, expected, 1e-5);
    assert!(c.scaled_error_db.unwrap() < -140.0, "{c:?}");
    // Phase and magnitude of a float32 factor: 1e-7 relative is 6e-6 deg and 9e-7 dB.
    near(c.scale_db, 20.0 * 2f64.log10(), 2e-6);
    near(c.scale_deg, 30.0, 1e-5);
    near(c.peak_phase_error_deg, 30.0, 1e-5);
    near(c.correlation, 1.0, 1e-12);
}

#[test]
fn compare_reports_known_error_in_decibels() {
    // b = (3, 4j), a - b = (0, 1/16): error 1/80. <a, b> = 25 + j/4 with ||a||^2 = 25 + 1/256, so
    // 1 - rho^2 = 1 - (625 + 1/16) / (25 (25 + 1/256)).
    let (b, a) = (
        row(&[(3.0, 0.0), (0.0, 4.0)]),
        row(&[(3.0, 0.0), (0.0625, 4.0)]),
    );
    let c = Comparison::between(&a, &b).unwrap();
    near(c.error_db, -20.0 * 80f64.log10(), 1e-9);
    let rho2 = 625.0625 / (25.0 * 25.00390625);
    near(c.scaled_error_db, 10.0 * (1.0f64 - rho2).log10(), 1e-6);
    near(c.correlation, rho2.sqrt(), 1e-12);
    near(
        c.peak_phase_error_deg,
        (0.0625f64 / 4.0).atan().to_degrees(),
        1e-9,
    );
    // s = <a, b> / ||a||^2.
    near(c.scale_deg, (0.25f64 / 25.0).atan().to_degrees(), 1e-9);
}

#[test]
fn phase_error_uses_pixels_within_20_db_of_peak() {
    // The second pixel is 90 degrees off. With a peak of 1, an amplitude of 0.1 is 20 dB down.
    for (amplitude, expected) in [(0.1001, 90.0), (0.0999, 0.0)] {
        let b = row(&[(1.0, 0.0), (amplitude, 0.0)]);
        let a = row(&[(1.0, 0.0), (0.0, -amplitude)]);
        let c = Comparison::between(&a, &b).unwrap();
        near(c.peak_phase_error_deg, expected, 1e-9);
    }
    let c = Comparison::between(&row(&[(0.0, 0.0)]), &row(&[(1.0, 0.0)])).unwrap();
    near(c.peak_phase_error_deg, 180.0, 1e-12);
}

#[test]
fn comparison_of_zero_images_is_undefined_and_never_nan() {
    let (zero, one) = (row(&[(0.0, 0.0); 2]), row(&[(1.0, 0.0), (0.0, 0.0)]));
    let c = Comparison::between(&zero, &one).unwrap();
    near(c.error_db, 0.0, 1e-12);
    assert_eq!(
        (c.scaled_error_db, c.scale_db, c.correlation),
        (None, None, None)
    );
    let c = Comparison::between(&one, &zero).unwrap();
    assert_eq!(
        (c.error_db, c.peak_phase_error_deg, c.correlation),
        (None, None, None)
    );
    let text = Comparison::between(&zero, &zero).unwrap().to_string();
    assert!(
        text.contains("undefined") && !text.contains("NaN"),
        "{text}"
    );
    // Orthogonal images have no best scale.
    let other = row(&[(0.0, 0.0), (1.0, 0.0)]);
    let c = Comparison::between(&other, &one).unwrap();
    near(c.error_db, 20.0 * 2f64.sqrt().log10(), 1e-9);
    near(c.scaled_error_db, 0.0, 1e-12);
    near(c.correlation, 0.0, 1e-12);
    assert_eq!(c.scale_db, None);
    // Identical images, and images without pixels.
    let c = Comparison::between(&one, &one).unwrap();
    assert_eq!(c.error_db, Some(f64::NEG_INFINITY));
    assert!(c.to_string().contains("error   none"), "{c}");
    assert_eq!(
        Comparison::between(&row(&[]), &row(&[])).unwrap().error_db,
        None
    );
}

#[test]
fn comparison_is_independent_of_extreme_scale() {
    // 1e-30 squared is below float32, 1e30 squared above it.
    for unit in [1e-30, 1e30] {
        let c = Comparison::between(&row(&[(1.5 * unit, 0.0)]), &row(&[(unit, 0.0)])).unwrap();
        near(c.error_db, 20.0 * 0.5f64.log10(), 1e-5);
        assert_eq!(row(&[(0.0, 0.0), (unit, 0.0)]).peak().unwrap().column, 1);
    }
}

#[test]
fn compare_rejects_size_mismatch_and_non_finite_pixels() {
    let a = row(&[(1.0, 0.0); 6]);
    let b = Image {
        rows: 2,
        columns: 3,
        ..a.clone()
    };
    let error = Comparison::between(&a, &b).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("1 rows x 6 columns and 2 x 3"), "{text}");
    let mut broken = b.clone();
    broken.pixels[4].im = f32::NAN;
    let expected = |which| ComparisonError::NotFinite {
        which,
        row: 1,
        column: 1,
    };
    assert_eq!(
        Comparison::between(&broken, &b).unwrap_err(),
        expected("image")
    );
    assert_eq!(
        Comparison::between(&b, &broken).unwrap_err(),
        expected("reference")
    );
}

#[test]
fn peak_is_first_brightest_finite_pixel() {
    let mut image = Image {
        rows: 3,
        columns: 4,
        pixels: vec![Complex32::new(0.5, 0.5); 12],
    };
    assert_eq!(image.peak().map(|p| (p.row, p.column)), Some((0, 0)));
    image.pixels[2].re = f32::NAN;
    image.pixels[7] = Complex32::new(-3.0, 4.0);
    image.pixels[9] = Complex32::new(5.0, 0.0);
    let peak = image.peak().unwrap();
    assert_eq!((peak.row, peak.column), (1, 3));
    assert_eq!(peak.value, Complex32::new(-3.0, 4.0));
    assert_eq!(row(&[]).peak(), None);
    assert_eq!(row(&[(f32::NAN, 0.0)]).peak(), None);
}
