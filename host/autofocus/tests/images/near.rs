//! The room of C 6.6: a radar at 77 GHz on a rail of 1 m, reflectors at 2 to 6 m over wide angles, and an unknown track.
//! The thesis gives the positions of two of the four reflectors in its text, (0.6, 3) and (0.1, 4), and its results as pictures only: "little sign of improvement ... even worse in some areas" for stock PGA, and sharp reflectors for
//! the modified one after about three rounds. Here results are compared with the image on the true track.

use glam::DVec3;
use subaperture_autofocus::{Correction, ModifiedPhaseGradient, Outcome, PhaseGradient, Sharpened};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::PhaseHistory;

use super::{Radar, Random, corrected, entropy, form, peak_db, sharpened};

const REFLECTORS_M: [DVec3; 4] = [
    DVec3::new(0.6, 3.0, 0.0),
    DVec3::new(0.1, 4.0, 0.0),
    DVec3::new(-0.9, 2.2, 0.0),
    DVec3::new(1.6, 5.6, 0.0),
];

/// Radar at 77 to 80 GHz with 800 pulses over 1 m along x, and smooth track errors of `rms_m` along both axes.
fn radar(rms_m: f64, random: &mut Random) -> Radar {
    let count = 800;
    let recorded_m: Vec<DVec3> = (0..count)
        .map(|n| DVec3::new(f64::from(n) / f64::from(count - 1), 0.0, 0.0))
        .collect();
    // Five sinusoids of random phase and equal power, with 1 to 5 periods over the aperture.
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
fn modified_pga_focuses_reflectors_that_pga_leaves_blurred() {
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
        // Each reflector equals that on the true track, and is better than with one phase for all.
        assert!(modified > best - 0.5 && modified > stock, "{place_m}");
        losses.push(best - stock);
    }
    // One phase for all focuses one direction only.
    assert!(losses.iter().any(|&loss| loss > 6.0), "{losses:?}");
    assert!(modified.after.entropy < stock.after.entropy - 0.5);
    assert!(
        modified.after.entropy < perfect_entropy + 0.1,
        "{perfect_entropy}"
    );
}

/// Rms error of the estimated track, metres, without its rigid motion.
pub(crate) fn left_m(recorded_m: &[DVec3], true_m: &[DVec3], found: &[DVec3]) -> f64 {
    let count = recorded_m.len() as f64;
    let mean = |all: &[DVec3]| all.iter().sum::<DVec3>() / count;
    let at: Vec<DVec3> = recorded_m.iter().zip(found).map(|(a, b)| *a + *b).collect();
    let (middle, true_middle) = (mean(&at), mean(true_m));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (a, b) in at.iter().zip(true_m) {
        let (a, b) = (*a - middle, *b - true_middle);
        dot += a.x * b.x + a.y * b.y;
        cross += a.x * b.y - a.y * b.x;
    }
    let (sin, cos) = cross.atan2(dot).sin_cos();
    let squares = at.iter().zip(true_m).map(|(a, b)| {
        let (a, b) = (*a - middle, *b - true_middle);
        DVec3::new(cos * a.x - sin * a.y, sin * a.x + cos * a.y, 0.0).distance_squared(b)
    });
    (squares.sum::<f64>() / count).sqrt()
}

/// Rms errors of the track before and after, metres, for points and clutter at 24 GHz with a track error of 4.4 mm rms; and the result.
fn by_modified(points: usize, clutter: usize, seed: u64) -> ([f64; 2], Sharpened) {
    let mut random = Random(seed);
    for _ in 0..9 {
        random.uniform();
    }
    let place = |random: &mut Random| {
        DVec3::new(
            3.0 * random.uniform() - 1.2,
            2.0 + 3.5 * random.uniform(),
            0.0,
        )
    };
    let mut scene: Vec<(DVec3, f64)> = (0..points).map(|_| (place(&mut random), 1.0)).collect();
    scene.extend((0..clutter).map(|_| (place(&mut random), 0.1 * random.gauss())));
    let mut radar = radar(4.4e-3 / 2f64.sqrt(), &mut random);
    radar.recorded_m = radar.recorded_m.into_iter().step_by(4).collect();
    radar.true_m = radar.true_m.into_iter().step_by(4).collect();
    radar.phases_rad.truncate(radar.true_m.len());
    radar.start_hz = 24e9;
    radar.noise = match points {
        0 => 0.1,
        _ => 1.0,
    };
    let history = radar.echoes(&scene, &mut random);
    let grid: ImageGrid = "x=-1.2:1.9:0.02,y=1.9:5.6:0.03".parse().unwrap();
    let found = sharpened(&history, &grid, &ModifiedPhaseGradient::default(), 4);
    let none = vec![DVec3::ZERO; radar.true_m.len()];
    let displaced = match &found.correction {
        Some(Correction::Track { displacement_m }) => displacement_m,
        _ => &none,
    };
    let left = [&none, displaced].map(|moved| left_m(&radar.recorded_m, &radar.true_m, moved));
    println!(
        "{points} points, {clutter} of clutter: {:.2} mm -> {:.2} mm, {:?}",
        1e3 * left[0],
        1e3 * left[1],
        found.held_out
    );
    (left, found)
}

#[test]
fn modified_pga_recovers_track_from_points() {
    let ([before_m, after_m], found) = by_modified(4, 0, 19);
    assert!(before_m > 4e-3);
    // A tenth of the wavelength of 12.5 mm; the positions of the points are estimated too.
    assert!(after_m < 1.25e-3, "{after_m}");
    assert!(found.held_out.is_some_and(|held_out| held_out.sharper));
}

#[test]
fn modified_pga_leaves_track_over_clutter_unchanged() {
    let ([before_m, after_m], found) = by_modified(0, 1500, 21);
    // A round may change the track by 11 mm; tracks.rs asserts that such tracks are refused.
    assert!(found.held_out.is_none_or(|held_out| !held_out.sharper));
    assert_ne!(found.outcome, Outcome::Sharper);
    assert!(found.correction.is_none());
    assert_eq!(before_m, after_m);
}
