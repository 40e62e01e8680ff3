//! A real recording with errors put into it.

use std::path::Path;

use glam::DVec3;
use subaperture_autofocus::{
    Corrected, Correction, Estimator, Goal, PhaseGradient, Sharpness, Unknown,
};
use subaperture_model::geometry::ImageGrid;
use subaperture_io::open::{Options, open_all};
use subaperture_model::phase_history::{Joined, PhaseHistory};

use super::{Random, form, sharpened};

fn gotcha() -> Option<Joined> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/gotcha");
    let paths = [1, 2].map(|i| folder.join(format!("data_3dsar_pass1_az00{i}_HH.mat")));
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        println!("skipped: {} not found", missing.display());
        return None;
    }
    Some(open_all(&paths, &Options::default()).unwrap())
}

const GRID: &str = "x=-40:40:0.2,y=-40:50:0.2,z=0";

#[test]
fn white_errors_of_two_radians_are_taken_away() {
    let Some(history) = gotcha() else { return };
    let grid: ImageGrid = GRID.parse().unwrap();
    let mut random = Random(11);
    let error_rad = (0..history.collection().pulses.len()).map(|_| 2.0 * random.gauss()).collect();
    let disturbed = Corrected::new(&history, &Correction::Phase { error_rad }).unwrap();
    let perfect = form(&history, &grid);
    let best_db = 10.0 * f64::from(perfect.peak().unwrap().value.norm_sqr()).log10();
    let own = sharpened(&history, &grid, &PhaseGradient::default());
    println!("undisturbed {best_db:.3} dB, sharpened itself {:.3} dB", own.after.peak_db);
    for estimator in [Estimator::Eigenvector, Estimator::Gradient] {
        let method = PhaseGradient { estimator, ..PhaseGradient::default() };
        let found = sharpened(&disturbed, &grid, &method);
        println!("{estimator}: before {:.3}, after {:.3}", found.before.peak_db, found.after.peak_db);
    }
}

#[test]
fn a_random_walk_of_the_track_is_recovered() {
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
    let rms = Correction::Track { displacement_m: walk.clone() }.rms_displacement_m().unwrap();
    let displacement_m: Vec<DVec3> = walk.iter().map(|d| *d * (0.02 / rms)).collect();
    let disturbed = Corrected::new(&history, &Correction::Track { displacement_m }).unwrap();
    let perfect = form(&history, &grid);
    let best_db = 10.0 * f64::from(perfect.peak().unwrap().value.norm_sqr()).log10();
    for unknown in [Unknown::Track, Unknown::Phase] {
        for goal in [Goal::Sharpness, Goal::Entropy] {
            let method = Sharpness { unknown, goal, ..Sharpness::default() };
            let found = sharpened(&disturbed, &grid, &method);
            println!("{unknown} {goal:?}: undisturbed {best_db:.3} before {:.3}, after {:.3}", found.before.peak_db, found.after.peak_db);
        }
    }
}
