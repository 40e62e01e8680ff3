//! A real recording with added errors.

use std::path::Path;

use glam::DVec3;
use subaperture_autofocus::{Corrected, Correction, PhaseGradient, Sharpness, Unknown};
use subaperture_io::open::{Options, open_all};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Joined, PhaseHistory};

use super::{Random, corrected, peak_db, sharpened};

fn gotcha() -> Option<Joined> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/gotcha");
    let paths = [1, 2].map(|i| folder.join(format!("data_3dsar_pass1_az00{i}_HH.mat")));
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        println!("skipped: {} not found", missing.display());
        return None;
    }
    Some(open_all(&paths, &Options::default()).unwrap())
}

const GRID: &str = "x=-40:20:0.25,y=0:50:0.25,z=0";

/// Position of the brightest reflector, metres.
const REFLECTOR_M: DVec3 = DVec3::new(-15.6, 21.6, 0.0);

fn reflector_db(history: &dyn PhaseHistory) -> f64 {
    peak_db(history, REFLECTOR_M, 1.0, [0.05, 0.05])
}

#[test]
fn white_errors_of_two_radians_are_removed_from_gotcha() {
    let Some(history) = gotcha() else { return };
    let grid: ImageGrid = GRID.parse().unwrap();
    let mut random = Random(11);
    let error_rad = (0..history.collection().pulses.len())
        .map(|_| 2.0 * random.gauss())
        .collect();
    let disturbed = Corrected::new(&history, &Correction::Phase { error_rad }).unwrap();
    let found = sharpened(&disturbed, &grid, &PhaseGradient::default(), 2);
    let [best_db, before_db, after_db] = [
        reflector_db(&history),
        reflector_db(&disturbed),
        reflector_db(&corrected(&disturbed, &found)),
    ];
    println!("reflector: undisturbed {best_db:.3} dB, before {before_db:.3}, after {after_db:.3}");
    assert!(before_db < best_db - 8.0);
    assert!(after_db > best_db - 0.1, "{after_db} {best_db}");
}

#[test]
fn random_walk_of_gotcha_track_is_corrected() {
    let Some(history) = gotcha() else { return };
    let grid: ImageGrid = GRID.parse().unwrap();
    let mut random = Random(3);
    let mut at_m = DVec3::ZERO;
    let walk: Vec<DVec3> = (0..history.collection().pulses.len())
        .map(|_| {
            at_m += DVec3::new(random.gauss(), random.gauss(), random.gauss());
            at_m
        })
        .collect();
    let mean = walk.iter().sum::<DVec3>() / walk.len() as f64;
    let squares: f64 = walk.iter().map(|d| d.distance_squared(mean)).sum();
    let scale = 0.02 / (squares / walk.len() as f64).sqrt();
    // 2 cm rms: 1.3 wavelengths of path.
    let displacement_m = walk.iter().map(|d| *d * scale).collect();
    let disturbed = Corrected::new(&history, &Correction::Track { displacement_m }).unwrap();
    let method = Sharpness {
        unknown: Unknown::Track,
        ..Sharpness::default()
    };
    let found = sharpened(&disturbed, &grid, &method, 6);
    let [best_db, before_db, after_db] = [
        reflector_db(&history),
        reflector_db(&disturbed),
        reflector_db(&corrected(&disturbed, &found)),
    ];
    println!("reflector: undisturbed {best_db:.3} dB, before {before_db:.3}, after {after_db:.3}");
    assert!(before_db < best_db - 6.0);
    assert!(after_db > best_db - 0.3, "{after_db} {best_db}");
}
