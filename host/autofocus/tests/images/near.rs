//! The room of C 6.6: a radar of 77 GHz on a rail of 1 m, reflectors at 2 to 6 m under wide angles, a track that is not known.
//! The thesis gives two of the four reflectors' places in its text, (0.6, 3) and (0.1, 4), and no figure of what was gained
//! but pictures: "little sign of improvement ... even worse in some areas" of stock PGA, sharp reflectors of the modified one after
//! some three rounds. Here all is measured against the image on the true track.

use glam::DVec3;
use subaperture_autofocus::{ModifiedPhaseGradient, PhaseGradient};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::PhaseHistory;

use super::{Radar, Random, corrected, entropy, form, peak_db, sharpened};

const REFLECTORS_M: [DVec3; 4] = [
    DVec3::new(0.6, 3.0, 0.0),
    DVec3::new(0.1, 4.0, 0.0),
    DVec3::new(-0.9, 2.2, 0.0),
    DVec3::new(1.6, 5.6, 0.0),
];

/// 77 to 80 GHz; 800 pulses over 1 m along x. The track errs smoothly along both axes, `rms_m` each.
fn radar(rms_m: f64, random: &mut Random) -> Radar {
    let count = 800;
    let recorded_m: Vec<DVec3> = (0..count)
        .map(|n| DVec3::new(f64::from(n) / f64::from(count - 1), 0.0, 0.0))
        .collect();
    // Five waves of random phase, 1 to 5 over the aperture, alike in power.
    let mut smooth = || -> Vec<f64> {
        let phases: Vec<f64> = (0..5)
            .map(|_| std::f64::consts::TAU * random.uniform())
            .collect();
        let at = |n: i32| -> f64 {
            let u = std::f64::consts::TAU * f64::from(n) / f64::from(count);
            let waves = phases.iter().zip(1..);
            waves
                .map(|(phase, w)| (f64::from(w) * u + phase).sin())
                .sum::<f64>()
                * (2.0f64 / 5.0).sqrt()
        };
        (0..count).map(at).collect()
    };
    let (along, across) = (smooth(), smooth());
    let errors = along.iter().zip(&across);
    let true_m = recorded_m
        .iter()
        .zip(errors)
        .map(|(&at_m, (x, y))| at_m + rms_m * DVec3::new(*x, *y, 0.0))
        .collect();
    Radar {
        start_hz: 77e9,
        step_hz: 3e9 / 256.0,
        samples: 256,
        phases_rad: vec![0.0; recorded_m.len()],
        recorded_m,
        true_m,
        noise: 1.0,
    }
}

#[test]
fn the_modified_one_sharpens_what_one_phase_for_all_does_not() {
    let points: Vec<(DVec3, f64)> = REFLECTORS_M.iter().map(|&p| (p, 1.0)).collect();
    let grid: ImageGrid = "x=-1.2:1.9:0.006,y=1.9:5.9:0.03".parse().unwrap();
    let radar = radar(1.5e-3, &mut Random(5));
    let history = radar.echoes(&points, &mut Random(1));
    let known = Radar {
        recorded_m: radar.true_m.clone(),
        ..radar
    };
    let known = known.echoes(&points, &mut Random(1));
    let stock = sharpened(&history, &grid, &PhaseGradient::default(), 3);
    let modified = sharpened(&history, &grid, &ModifiedPhaseGradient::default(), 2);
    let [by_stock, by_modified] = [&stock, &modified].map(|found| corrected(&history, found));
    let perfect_entropy = entropy(&form(&known, &grid));
    println!(
        "entropy: true track {perfect_entropy:.3}, before {:.3}, stock {:.3}, modified {:.3}",
        stock.before.entropy, stock.after.entropy, modified.after.entropy
    );
    let all: [&dyn PhaseHistory; 4] = [&known, &history, &by_stock, &by_modified];
    let mut losses = Vec::new();
    for place_m in REFLECTORS_M {
        let [best, before, stock, modified] =
            all.map(|history| peak_db(history, place_m, 0.12, [0.001, 0.005]));
        println!(
            "{place_m}: true track {best:.2} dB, before {before:.2}, stock {stock:.2}, modified {modified:.2}"
        );
        // Each reflector is as on the true track, and better than by one phase for all.
        assert!(modified > best - 0.5 && modified > stock, "{place_m}");
        losses.push(best - stock);
    }
    // One phase for all suits one direction, and leaves the others blurred.
    assert!(losses.iter().any(|&loss| loss > 6.0), "{losses:?}");
    assert!(modified.after.entropy < stock.after.entropy - 0.5);
    assert!(
        modified.after.entropy < perfect_entropy + 0.1,
        "{perfect_entropy}"
    );
}
