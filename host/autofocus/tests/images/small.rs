//! Small phase errors on scenes of points without noise, such as the example of Table 4.1.

use glam::DVec3;
use subaperture_autofocus::{Correction, PhaseGradient};
use subaperture_model::phase_history::PhaseHistory;

use super::{Radar, Random, sharpened};

const PULSES: usize = 520;

/// Table 4.1 with half of the pulses: 200 MHz at 10 GHz, 130 m of track at 5 km, 41 unit scatterers over 80 x 80 m.
fn table(error_rad: impl Fn(f64) -> f64) -> (impl PhaseHistory, Vec<f64>) {
    let at = |n: usize| 2.0 * n as f64 / (PULSES - 1) as f64 - 1.0;
    let track_m: Vec<DVec3> = (0..PULSES)
        .map(|n| DVec3::new(65.0 * at(n), -5000.0, 0.0))
        .collect();
    let phases_rad: Vec<f64> = (0..PULSES).map(|n| error_rad(at(n))).collect();
    let radar = Radar {
        start_hz: 9.9e9,
        step_hz: 200e6 / 256.0,
        samples: 256,
        recorded_m: track_m.clone(),
        true_m: track_m,
        phases_rad: phases_rad.clone(),
        noise: 0.0,
    };
    let mut random = Random(41);
    let mut points = vec![(DVec3::ZERO, 1.0)];
    points.extend((0..40).map(|_| {
        let mut side_m = || 80.0 * random.uniform() - 40.0;
        (DVec3::new(side_m(), side_m(), 0.0), 1.0)
    }));
    (radar.echoes(&points, &mut random), phases_rad)
}

/// Rms of the difference of two phases without its constant and linear part, radians.
fn residual_rad(found: &[f64], error: &[f64]) -> f64 {
    let count = found.len() as f64;
    let left: Vec<f64> = found.iter().zip(error).map(|(a, b)| a - b).collect();
    let at = |n: usize| n as f64 - (count - 1.0) / 2.0;
    let mean = left.iter().sum::<f64>() / count;
    let square: f64 = (0..left.len()).map(|n| at(n).powi(2)).sum();
    let slope = left.iter().enumerate().map(|(n, v)| at(n) * v).sum::<f64>() / square;
    let rest = left
        .iter()
        .enumerate()
        .map(|(n, v)| v - mean - slope * at(n));
    (rest.map(|v| v * v).sum::<f64>() / count).sqrt()
}

/// Few rows of tiles have the points, so that the mean gain is uncertain; the ranks of the gains are not.
#[test]
fn pga_removes_small_quadratic_errors_of_few_points() {
    let grid = "x=-45:45:0.25,y=-45:45:0.35,z=0".parse().unwrap();
    for (edge_rad, most_rad) in [(1.0, 0.1), (3.0, 0.2)] {
        let (history, error_rad) =
            table(|u| edge_rad * ((u * u - 1.0 / 3.0) + (u.powi(3) - 0.6 * u) / 3.0));
        let found = sharpened(&history, &grid, &PhaseGradient::default(), 4);
        let Some(Correction::Phase { error_rad: found }) = &found.correction else {
            panic!("{edge_rad}: {:?}", found.outcome);
        };
        // The quadratic is 0.3 and 0.9 rad rms, the cubic, which may remain, 0.05 and 0.15 rad. Errors of 0.1 and 0.2 rad lower a point by 0.04 and 0.17 dB.
        let left_rad = residual_rad(found, &error_rad);
        assert!(left_rad < most_rad, "{edge_rad}: {left_rad}");
    }
}

#[test]
fn pga_proposes_no_correction_without_errors() {
    let grid = "x=-45:45:0.25,y=-45:45:0.35,z=0".parse().unwrap();
    let (history, _) = table(|_| 0.0);
    let found = sharpened(&history, &grid, &PhaseGradient::default(), 4);
    assert!(found.correction.is_none() && found.rounds.is_empty());
}
