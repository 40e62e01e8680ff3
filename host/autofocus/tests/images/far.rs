//! A small scene far away, where phase errors are alike for all of it.

use glam::DVec3;
use subaperture_autofocus::{Estimator, PhaseGradient};
use subaperture_model::geometry::ImageGrid;

use super::{Radar, Random, form, peak_db, sharpened};

/// 10 GHz, 300 MHz, 512 pulses over 300 m at 10 km: cells of 0.5 m either way.
fn radar() -> Radar {
    let track: Vec<DVec3> = (0..512)
        .map(|n| DVec3::new(-150.0 + 300.0 * f64::from(n) / 511.0, -9_000.0, 4_000.0))
        .collect();
    Radar {
        start_hz: 9.85e9,
        step_hz: 300e6 / 256.0,
        samples: 256,
        recorded_m: track.clone(),
        phases_rad: vec![0.0; track.len()],
        true_m: track,
        noise: 1.0,
    }
}

fn scene(random: &mut Random) -> Vec<(DVec3, f64)> {
    (0..40)
        .map(|_| {
            let place_m = DVec3::new(60.0 * random.uniform() - 30.0, 60.0 * random.uniform() - 30.0, 0.0);
            (place_m, 0.2 + random.uniform())
        })
        .collect()
}

#[test]
fn white_errors_of_two_radians_are_taken_away() {
    let mut random = Random(7);
    let points = scene(&mut random);
    let grid: ImageGrid = "x=-35:35:0.2,y=-35:35:0.2,z=0".parse().unwrap();
    let perfect = form(&radar().echoes(&points, &mut Random(1)), &grid);
    let mut disturbed = radar();
    disturbed.phases_rad.iter_mut().for_each(|phase| *phase = 2.0 * random.gauss());
    let history = disturbed.echoes(&points, &mut Random(1));
    let best_db = peak_db(&perfect, &grid, DVec3::ZERO, 60.0);
    for estimator in [Estimator::Eigenvector, Estimator::Gradient] {
        let method = PhaseGradient { estimator, ..PhaseGradient::default() };
        let found = sharpened(&history, &grid, &method);
        println!("{estimator}: perfect {best_db:.3} dB, before {:.3}, after {:.3}", found.before.peak_db, found.after.peak_db);
    }
}
