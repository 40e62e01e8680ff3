//! Change maps of scenes with a changed rectangle and a shadow.

mod speckle;

use num_complex::Complex64;
use speckle::{Random, image_of, pair};
use subaperture_interferometry::{
    InterferometryError, Settings, coherence_of_median, detect_changes,
};
use subaperture_model::image::Image;

const SIDE: usize = 400;

/// Scene of coherence 0.9, with a changed square of 60 x 60 pixels and a shadow 30 dB darker of 40 x 40.
fn scene() -> [Image; 2] {
    let [mut image, mut reference] = pair(&mut Random(21), SIDE * SIDE, 0.9);
    let mut random = Random(22);
    for row in 100..160 {
        for column in 200..260 {
            image[row * SIDE + column] = random.normal();
        }
    }
    for row in 300..340 {
        for column in 50..90 {
            for side in [&mut image, &mut reference] {
                side[row * SIDE + column] = random.normal() * 0.0316;
            }
        }
    }
    [image, reference].map(|pixels| image_of([SIDE; 2], &pixels))
}

#[test]
fn changed_square_is_detected_and_shadow_is_masked() {
    let [image, reference] = scene();
    let settings = Settings {
        window: [5, 5],
        false_alarm_probability: 1e-3,
        ..Settings::default()
    };
    let changes = detect_changes(&image, &reference, &settings).unwrap();
    assert!((changes.looks - 25.0).abs() < 0.5, "{}", changes.looks);
    assert!(
        (changes.coherence - 0.9).abs() < 5e-3,
        "{}",
        changes.coherence
    );
    // Windows entirely within the square, the shadow, or outside both.
    let fraction = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        let count = (rows.len() * columns.len()) as f64;
        let at = rows.flat_map(|row| columns.clone().map(move |column| row * SIDE + column));
        let values: Vec<f32> = at.map(|i| changes.map.values[i]).collect();
        [1.0, 0.0].map(|wanted: f32| values.iter().filter(|v| **v == wanted).count() as f64 / count)
    };
    let [changed, _] = fraction(102..158, 202..258);
    let predicted = changes.detection_probability(0.0).unwrap();
    assert!(
        predicted > 0.999 && changed > 0.995,
        "{changed} {predicted}"
    );
    assert_eq!(fraction(302..338, 52..88), [0.0; 2]);
    // 3.9e4 pixels, 1.6e3 independent windows, 39 expected alarms in clusters of about 6: standard deviation 40 %.
    let [alarms, _] = fraction(2..98, 2..398);
    assert!(alarms > 1e-4 && alarms < 2.6e-3, "{alarms}");
    let counts = changes.counts;
    assert_eq!(counts.undefined, SIDE * SIDE - 396 * 396);
    assert!((36 * 36..=44 * 44).contains(&counts.masked), "{counts:?}");
    assert_eq!(
        counts.changed + counts.unchanged + counts.masked + counts.undefined,
        SIDE * SIDE
    );
    // Given values are used in place of estimates.
    let given = Settings {
        coherence: Some(0.7),
        looks: Some(20.0),
        ..settings
    };
    let given = detect_changes(&image, &reference, &given).unwrap();
    assert_eq!([given.coherence, given.looks], [0.7, 20.0]);
    assert!(given.threshold < changes.threshold);
}

#[test]
fn images_without_testable_pixels_are_refused() {
    let zeros = image_of([20, 20], &[Complex64::ZERO; 400]);
    let refused = detect_changes(
        &zeros,
        &zeros,
        &Settings {
            looks: Some(9.0),
            ..Settings::default()
        },
    );
    assert!(
        matches!(refused, Err(InterferometryError::Empty(400))),
        "{refused:?}"
    );
    let [image, reference] = scene();
    let other = image_of([20, 20], &[Complex64::ONE; 400]);
    assert!(matches!(
        detect_changes(&image, &other, &Settings::default()),
        Err(InterferometryError::Pair(_))
    ));
    let wrong = Settings {
        false_alarm_probability: 0.0,
        ..Settings::default()
    };
    assert!(matches!(
        detect_changes(&image, &reference, &wrong),
        Err(InterferometryError::Probability(_))
    ));
    assert!(coherence_of_median(0.5, 0.5).is_err());
}
