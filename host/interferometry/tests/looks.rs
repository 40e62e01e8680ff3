//! Effective number of looks of oversampled and weighted speckle, against counted variances and false alarms.

mod speckle;

use num_complex::Complex64;
use speckle::{Random, filtered, image_of, pair, taylor};
use subaperture_interferometry::{
    Autocorrelation, CoherenceDistribution, InterferometryError, interferogram,
};

const SIDE: usize = 1024;

/// Speckle pair of this coherence, with `oversampling` pixels per resolution cell and a carrier of 0.3 and -0.2 cycles per pixel.
fn oversampled(
    oversampling: f64,
    weight: fn(f64) -> f64,
    coherence: f64,
    seed: u64,
) -> [Vec<Complex64>; 2] {
    let centred = move |f: f64| weight(2.0 * oversampling * (f - f.round()));
    pair(&mut Random(seed), SIDE * SIDE, coherence).map(|white| {
        filtered(&white, SIDE, |f, g| {
            (centred(f - 0.3) * centred(g + 0.2)).into()
        })
    })
}

fn uniform(x: f64) -> f64 {
    if x.abs() <= 1.0 { 1.0 } else { 0.0 }
}

/// Looks counted as mean squared over variance of the mean power of windows that overlap by half.
fn counted(pixels: &[Complex64], [rows, columns]: [usize; 2]) -> f64 {
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for r in (0..SIDE - rows).step_by(rows.div_ceil(2)) {
        for c in (0..SIDE - columns).step_by(columns.div_ceil(2)) {
            let power: f64 = (r..r + rows)
                .flat_map(|r| &pixels[r * SIDE + c..][..columns])
                .map(Complex64::norm_sqr)
                .sum();
            sum += power;
            squares += power * power;
            count += 1.0;
        }
    }
    let mean = sum / count;
    mean * mean / (squares / count - mean * mean)
}

/// With W windows, the counted variance has a relative standard deviation of about sqrt((2 + 6 / L) / W): 1 % for 3 x 10^4 windows, half of them independent.
#[test]
fn predicted_and_estimated_looks_are_those_counted() {
    for (oversampling, weight, window) in [
        (1.7, taylor as fn(f64) -> f64, [9, 9]),
        (1.7, uniform, [9, 5]),
        (1.3, taylor, [7, 11]),
        (1.0, uniform, [5, 5]),
    ] {
        let [image, _] = oversampled(oversampling, weight, 0.0, 5);
        let counted = counted(&image, window);
        let power: Vec<f64> = (0..256)
            .map(|k| {
                let f = f64::from(k) / 256.0;
                weight(2.0 * oversampling * (f - f.round())).powi(2)
            })
            .collect();
        let predicted = Autocorrelation::of_spectrum(&power, &power).looks(window);
        let estimated = Autocorrelation::estimate(&image_of([SIDE; 2], &image), window)
            .unwrap()
            .looks(window);
        println!(
            "{oversampling}, {window:?}: counted {counted:.2}, predicted / counted {:.3}, estimated / counted {:.3}",
            predicted / counted,
            estimated / counted
        );
        for looks in [predicted, estimated] {
            assert!((looks / counted - 1.0).abs() < 0.04, "{looks} {counted}");
        }
    }
}

/// Two moments do not fix the tail: the probability of false alarm is held within the stated 15 %.
#[test]
fn false_alarms_of_correlated_pixels_follow_effective_looks() {
    for (oversampling, weight, coherence, window) in [
        (1.7, taylor as fn(f64) -> f64, 0.8, [9, 9]),
        (1.3, taylor, 0.5, [7, 7]),
        (1.7, uniform, 0.95, [7, 7]),
    ] {
        let images = oversampled(oversampling, weight, coherence, 7);
        let [image, reference] = images.map(|pixels| image_of([SIDE; 2], &pixels));
        let looks = Autocorrelation::estimate(&image, window)
            .unwrap()
            .looks(window);
        let threshold = |looks: f64| {
            let distribution = CoherenceDistribution::new(coherence, looks).unwrap();
            distribution.threshold(1e-2).unwrap()
        };
        let formed = interferogram(&image, &reference, window).unwrap();
        let values = formed.magnitude().values;
        let alarms = |threshold: f64| {
            let tested = values.iter().filter(|d| d.is_finite());
            let below = tested.clone().filter(|&&d| f64::from(d) < threshold);
            below.count() as f64 / tested.count() as f64
        };
        let ratio = alarms(threshold(looks)) / 1e-2;
        // Pixels counted as if independent: the threshold is far too high.
        let naive = alarms(threshold((window[0] * window[1]) as f64)) / 1e-2;
        println!(
            "{oversampling}, {coherence}, {window:?}: looks {looks:.1}, ratio {ratio:.3}, naive {naive:.2}"
        );
        assert!((ratio - 1.0).abs() < 0.15, "{ratio}");
        assert!(naive > 2.0, "{naive}");
    }
}

#[test]
fn unsuited_windows_and_images_are_refused() {
    let image = image_of([20, 20], &[Complex64::ZERO; 400]);
    for window in [
        [1, 1],
        [4, 5],
        [5, 4],
        [11, 3],
        [3, 11],
        [0, 3],
        [usize::MAX, 3],
    ] {
        let refused = Autocorrelation::estimate(&image, window);
        assert!(
            matches!(refused, Err(InterferometryError::Window { .. })),
            "{window:?}"
        );
    }
    let refused = Autocorrelation::estimate(&image, [3, 3]);
    assert!(matches!(refused, Err(InterferometryError::Empty(400))));
    let empty = image_of([0, 0], &[]);
    assert!(Autocorrelation::estimate(&empty, [3, 3]).is_err());
}
