//! Consistency of errors and covariances over Monte Carlo runs of one target.

use subaperture_gmti::tracker::{Detection, Settings, Status, Tracker};

use crate::world::{Random, Truth, closing_m_s, quadratic, scan, sensor};

const RUNS: u64 = 200;
const SCANS: usize = 40;
const DENSITY: f64 = 0.3;

/// Measurement of a state as a vector.
fn measured(state: &Truth, sensor: [f64; 3]) -> [f64; 3] {
    [state[0], state[1], closing_m_s(state, sensor)]
}

/// NIS of a detection one second after an estimate: element by element, with central differences of the measurement.
fn nis(mean: &Truth, p: &[[f64; 4]; 4], detection: &Detection, sensor: [f64; 3]) -> f64 {
    let predicted = [mean[0] + mean[2], mean[1] + mean[3], mean[2], mean[3]];
    // Covariance of (x + vx, y + vy, vx, vy), with white acceleration over 1 s.
    let half = |i: usize, j: usize| match i < 2 {
        true => p[i][j] + p[i + 2][j],
        false => p[i][j],
    };
    let mut moved = [[0.0; 4]; 4];
    for (i, row) in moved.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value = match j < 2 {
                true => half(i, j) + half(i, j + 2),
                false => half(i, j),
            };
            *value += match (i % 2 == j % 2, i < 2, j < 2) {
                (false, _, _) => 0.0,
                (true, true, true) => DENSITY / 3.0,
                (true, false, false) => DENSITY,
                _ => DENSITY / 2.0,
            };
        }
    }
    let mut slopes = [[0.0; 4]; 3];
    for i in 0..4 {
        let (mut above, mut below) = (predicted, predicted);
        above[i] += 1e-3;
        below[i] -= 1e-3;
        let (above, below) = (measured(&above, sensor), measured(&below, sensor));
        for row in 0..3 {
            slopes[row][i] = (above[row] - below[row]) / 2e-3;
        }
    }
    let mut spread = detection.covariance;
    for (a, row) in spread.iter_mut().enumerate() {
        for (b, value) in row.iter_mut().enumerate() {
            for (i, variances) in moved.iter().enumerate() {
                for (j, variance) in variances.iter().enumerate() {
                    *value += slopes[a][i] * variance * slopes[b][j];
                }
            }
        }
    }
    let expected = measured(&predicted, sensor);
    let at = detection.position_m;
    let found = [at.x, at.y, detection.radial_velocity_m_s];
    quadratic(spread, std::array::from_fn(|i| found[i] - expected[i]))
}

/// 200 runs of 40 scans at 1 s. Radial speed uniform within 15 m/s, tangential speed of the prior, white acceleration of 0.3 m^2/s^3.
#[test]
fn estimation_errors_agree_with_covariances() {
    let settings = Settings {
        acceleration_density_m2_s3: DENSITY,
        gate_probability: 1.0 - 1e-9,
        false_alarm_density: 1e-15,
        new_target_density: 1e-15,
        ..Settings::default()
    };
    let mut nees = [0.0; SCANS];
    let (mut nis_sum, mut nis_count) = (0.0, 0.0);
    for run in 0..RUNS {
        let mut random = Random::new(run);
        let mut truth = [
            random.uniform(-300.0, 300.0),
            random.uniform(-300.0, 300.0),
            0.0,
            0.0,
        ];
        let from = sensor(0.0);
        let (x, y) = (truth[0] - from[0], truth[1] - from[1]);
        let level_m = (x * x + y * y).sqrt();
        let (radial, tangential) = (random.uniform(-15.0, 15.0), 10.0 * random.normal());
        truth[2] = (radial * x - tangential * y) / level_m;
        truth[3] = (radial * y + tangential * x) / level_m;
        let mut tracker = Tracker::new(settings).unwrap();
        for (i, nees) in nees.iter_mut().enumerate() {
            let time_s = i as f64;
            if i > 0 {
                random.moved(&mut truth, 1.0, DENSITY);
            }
            let detection = random.detection(&truth, sensor(time_s));
            tracker.scan(&scan(time_s, vec![detection])).unwrap();
            let [track] = tracker.tracks() else {
                panic!("one target has one track: {:?}", tracker.tracks());
            };
            assert_eq!(track.history.len(), i + 1);
            let now = track.history[i];
            *nees += quadratic(
                now.covariance,
                std::array::from_fn(|k| now.mean[k] - truth[k]),
            );
            if i > 0 {
                let last = track.history[i - 1];
                nis_sum += nis(&last.mean, &last.covariance, &detection, sensor(time_s));
                nis_count += 1.0;
            }
        }
        assert!(matches!(
            tracker.tracks()[0].status,
            Status::Confirmed { .. }
        ));
    }
    // Mean of 200 chi-squares of 4 degrees of freedom: standard deviation sqrt(2 * 4 / 200).
    let nees = nees.map(|sum| sum / RUNS as f64);
    let bound = 1.96 * (8.0 / RUNS as f64).sqrt();
    let inside = nees.iter().filter(|mean| (*mean - 4.0).abs() < bound);
    let inside = inside.count();
    let mean = nees.iter().sum::<f64>() / SCANS as f64;
    let nis = nis_sum / nis_count;
    let nis_bound = 1.96 * (6.0 / nis_count).sqrt();
    eprintln!(
        "NEES {mean:.3}, {inside} of {SCANS} scans within {bound:.3}; NIS {nis:.4} +- {nis_bound:.4}"
    );
    eprintln!("NEES by scan {nees:.2?}");
    // Innovations are white.
    assert!((nis - 3.0).abs() < nis_bound, "{nis}");
    // 38 are expected inside. Errors of neighbouring scans are correlated, therefore 36 are asked.
    assert!(inside >= 36, "{nees:?}");
    assert!((mean - 4.0).abs() < bound, "{mean}");
}
