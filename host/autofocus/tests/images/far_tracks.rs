//! Tracks of far scenes: projected on the line of sight, with a t test on held-out data and a test against slips.
//!
//! In a far scene a displacement along the line of sight is a phase common to all points. The phases of `scenes.rs` are converted to such displacements.

use glam::DVec3;
use subaperture_autofocus::{
    Correction, Method, ModifiedPhaseGradient, Outcome, Sharpened, Sharpness, Unknown,
};

use super::scenes::{Case, HZ, KINDS, Kind, SCENES, Scene, disturbed};

/// Rms error of a track, millimetres, for `found` displacements: along the line of sight (y), constant and slope removed, and across it (x), constant
/// removed. The true displacements are the phases in metres of one-way path.
fn error_mm(phases_rad: &[f64], found_m: &[DVec3]) -> f64 {
    let count = phases_rad.len() as f64;
    let metres_a_radian = super::C_M_S / (4.0 * std::f64::consts::PI * HZ);
    let mut along: Vec<f64> = phases_rad
        .iter()
        .zip(found_m)
        .map(|(phase, at)| metres_a_radian * phase - at.y)
        .collect();
    super::textbook::without_trend(&mut along);
    let mean = found_m.iter().map(|at| at.x).sum::<f64>() / count;
    let across = found_m.iter().map(|at| (at.x - mean).powi(2));
    let squares: f64 = along.iter().map(|y| y * y).sum::<f64>() + across.sum::<f64>();
    1e3 * (squares / count).sqrt()
}

/// Track errors of a case, millimetres: before, after, and by a refused correction.
fn track(case: Case, method: &dyn Method, rounds: usize) -> ([f64; 3], Sharpened) {
    let disturbed = disturbed(case);
    let found = disturbed.sharpened(method, rounds);
    let none = vec![DVec3::ZERO; disturbed.error_rad.len()];
    let moved = |correction: &Option<Correction>| match correction {
        Some(Correction::Track { displacement_m }) => Some(displacement_m.clone()),
        _ => None,
    };
    let kept = moved(&found.correction).unwrap_or(none.clone());
    let refused = moved(&found.refused).unwrap_or(kept.clone());
    let errors = [&none, &kept, &refused].map(|found| error_mm(&disturbed.error_rad, found));
    println!(
        "| {:?} | {:?} | {:.1} | {:.0} | {} | {} | {:.2} | {:.2} | {:.2} | {:?} | {:.4?} |",
        case.scene,
        case.kind,
        case.rms_rad,
        case.snr_db,
        case.seed,
        method.name(),
        errors[0],
        errors[1],
        errors[2],
        found.outcome,
        found
            .held_out
            .map(|h| (h.p_value, h.segments, h.largest_step_rad))
    );
    (errors, found)
}

fn by_sharpness() -> Sharpness {
    Sharpness {
        unknown: Unknown::Track,
        ..Sharpness::default()
    }
}

fn small(scene: Scene, kind: Kind) -> Case {
    Case {
        pulses: 64,
        cells: 48,
        ..Case::new(scene, kind)
    }
}

#[test]
fn far_tracks_from_points_are_accepted_and_reduce_error() {
    let case = small(Scene::Points, Kind::Quadratic);
    for method in [
        &by_sharpness() as &dyn Method,
        &ModifiedPhaseGradient::default(),
    ] {
        let ([before, after, _], found) = track(case, method, 6);
        assert_eq!(found.outcome, Outcome::Sharper);
        // A fortieth of the wavelength of 30 mm, from an error of 7 mm.
        assert!(before > 7.0 && after < 0.75, "{before} {after}");
        let held_out = found.held_out.unwrap();
        assert!(held_out.far && held_out.p_value < 0.01);
        assert!(held_out.largest_step_rad < held_out.max_step_rad);
        // The line of sight is the y axis within 0.03 rad.
        let Some(Correction::Track { displacement_m }) = &found.correction else {
            panic!("no track");
        };
        let across = displacement_m
            .iter()
            .map(|at| at.x.abs())
            .fold(0.0, f64::max);
        assert!(across < 0.05e-3 * before, "{across}");
    }
}

#[test]
fn far_track_with_half_wavelength_slips_is_refused() {
    // The phase changes by more than half a turn between pulses at the aperture's ends.
    let case = small(Scene::Points, Kind::Polynomial);
    let steps = disturbed(case).error_rad;
    let largest = steps
        .windows(2)
        .map(|pair| (pair[1] - pair[0]).abs())
        .fold(0.0, f64::max);
    assert!(largest > std::f64::consts::PI, "{largest}");
    let ([before, after, _], found) = track(case, &ModifiedPhaseGradient::default(), 6);
    // Held-out range cells are sharper: phases are correct except for whole turns.
    let held_out = found.held_out.unwrap();
    assert!(held_out.after.entropy < held_out.before.entropy - 0.5);
    assert!(held_out.largest_step_rad > held_out.max_step_rad);
    assert_eq!(found.outcome, Outcome::NotSharper);
    assert_eq!(before, after);
}

#[test]
fn far_track_of_partly_focused_image_is_refused() {
    // The image is sharper in the cells used for estimation, and a turn is lost.
    let case = Case {
        seed: 2,
        ..small(Scene::Points, Kind::Walk)
    };
    for method in [
        &by_sharpness() as &dyn Method,
        &ModifiedPhaseGradient::default(),
    ] {
        let ([before, after, refused], found) = track(case, method, 6);
        assert!(found.rounds.iter().any(|round| round.kept));
        assert!(refused > before, "{before} {refused}");
        assert_eq!(found.outcome, Outcome::NotSharper);
        assert_eq!(before, after);
    }
}

#[test]
fn far_track_from_noise_is_refused() {
    let case = Case {
        snr_db: -40.0,
        ..small(Scene::Speckle, Kind::Quadratic)
    };
    for method in [
        &by_sharpness() as &dyn Method,
        &ModifiedPhaseGradient::default(),
    ] {
        let ([before, after, _], found) = track(case, method, 4);
        assert!(found.correction.is_none(), "{}", method.name());
        assert_eq!(before, after);
    }
}

/// All scenes, errors and methods, with `SUBAPERTURE_SEEDS` seeds from `SUBAPERTURE_FIRST`. Prints a Markdown table.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn table_of_far_tracks() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |value| value.parse().unwrap())
    };
    let first = number("SUBAPERTURE_FIRST", 1);
    let seeds = number("SUBAPERTURE_SEEDS", 2);
    println!(
        "| scene | error | rad | SNR, dB | seed | method | before, mm | after, mm | refused, mm | | p |"
    );
    let mut grown = Vec::new();
    let (mut kept, mut refused_good, mut all) = (0, 0, 0);
    for scene in SCENES {
        for kind in KINDS {
            for seed in first..first + seeds {
                for (rms_rad, snr_db) in [(3.0, 20.0), (0.3, 3.0)] {
                    let case = Case {
                        rms_rad,
                        snr_db,
                        seed,
                        ..small(scene, kind)
                    };
                    for method in [
                        &by_sharpness() as &dyn Method,
                        &ModifiedPhaseGradient::default(),
                    ] {
                        let ([before, after, refused], found) = track(case, method, 6);
                        all += 1;
                        kept += usize::from(found.correction.is_some());
                        refused_good +=
                            usize::from(found.refused.is_some() && refused < before / 2.0);
                        if after > before {
                            grown.push((case, method.name(), before, after));
                        }
                    }
                }
            }
        }
    }
    println!("{kept} of {all} kept; {refused_good} refused that halve the error");
    assert!(grown.is_empty(), "{grown:#?}");
}
