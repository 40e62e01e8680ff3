//! Irregular walk with an unknown track: the track is estimated from the echoes, and the image is as good as with the
//! true track.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use subaperture_model::geometry::Extent;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_model::track::{Fix, SampledTrack};
use subaperture_motion::targets::cfar::{Cfar, Level};
use subaperture_motion::targets::{Settings, recover};
use subaperture_radio::Antennas;
use subaperture_radio::history::{Capture, Placement, Track};
use subaperture_signal::window::Window;
use tempfile::TempDir;

use crate::rail::{capture, chip, form, reaching};

const MIDDLE_M: DVec3 = DVec3::new(0.0, 9.0, 0.0);
const EXTENT: Extent = Extent {
    x_m: (-6.0, 6.5),
    y_m: (4.0, 14.0),
};
/// 2.5 cm per sweep of 0.62 s: a quarter of a turn of phase for targets straight ahead.
const SPEED_M_S: f64 = 0.04;

/// Reflectors with equal received amplitude: magnitude 1 from the middle of the track.
fn reflectors() -> Vec<(DVec3, f64)> {
    let places = [
        (-4.5, 5.0),
        (-2.8, 9.5),
        (-0.5, 7.2),
        (1.5, 12.6),
        (3.4, 8.8),
        (5.2, 13.2),
        (5.6, 4.6),
    ];
    let sized = |(x, y): (f64, f64)| (DVec3::new(x, y, 0.0), ((x * x + y * y) / 42.25).powi(2));
    places.map(sized).to_vec()
}

/// 5 m along x, swaying by a decimetre sideways and in speed, with a heading that varies by 4 degrees.
fn walk() -> Vec<Fix> {
    let fix = |n: u32| {
        let time_s = 0.5 * f64::from(n) - 1.0;
        let sway = |cycles: f64, turns: f64| (TAU * (cycles * time_s / 126.0 + turns)).sin();
        Fix {
            time_s,
            position_m: DVec3::new(
                SPEED_M_S * time_s - 2.5 + 0.08 * sway(2.3, 0.0),
                0.1 * sway(1.2, 0.1) + 0.02 * sway(5.1, 0.3),
                0.0,
            ),
            attitude: Some(DQuat::from_rotation_z(
                0.05 * sway(1.7, 0.05) + 0.02 * sway(4.3, 0.4),
            )),
        }
    };
    (0..300).map(fix).collect()
}

fn track(fixes: &[Fix]) -> Track {
    Track {
        poses: Box::new(SampledTrack::new(fixes).unwrap()),
        span_s: (fixes[0].time_s, fixes[fixes.len() - 1].time_s),
        zero_s: 0.0,
    }
}

#[test]
fn image_on_estimated_track_matches_image_on_true_track() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("walk");
    capture(&path, &walk(), &reflectors(), 6.0, [150, 200], "up");
    let made = Capture::open(&path, reaching(16.5)).unwrap();
    assert!(made.left_out().is_empty(), "{:?}", made.left_out());
    // Seven reflectors within 13 m leave few training cells, and half of them may contain reflectors.
    let settings = Settings {
        ranges_m: Some((3.0, 16.0)),
        cfar: Cfar {
            guard: 2,
            training: 8,
            level: Level::Ordered(0.45),
            ..Cfar::default()
        },
        ..Settings::default()
    };
    let standing = Placement::standing(MIDDLE_M);
    let found = recover(made.channels(&standing).unwrap(), &settings, &Silent).unwrap();
    for fault in &found.seen.faults {
        println!("{fault}");
    }
    let [sum, expected] = found.chi_square;
    println!(
        "{} poses, {} targets, {:.3} m, chi-square {:.2}",
        found.moments.len(),
        found.places.len(),
        found.length_m(),
        sum / expected
    );
    let fixes: Vec<Fix> = found
        .moments
        .iter()
        .map(|moment| Fix {
            time_s: moment.time_s,
            position_m: moment.position_m,
            attitude: Some(moment.attitude),
        })
        .collect();
    let arrangement = &found.seen.arrangement;
    let own = Antennas {
        transmitter_m: arrangement.transmitters_m[0],
        receivers_m: [arrangement.receivers_m[0], arrangement.receivers_m[1]],
    };
    // The estimated track starts at the body's origin; the true track gives the position of that origin.
    let (truth, by_echoes) = (track(&walk()), track(&fixes));
    let began = truth.pose(fixes[0].time_s);
    let of = |track: &Track, antennas, middle_m: DVec3| {
        let placement = Placement {
            track: Some(track),
            antennas,
            extent: Some(EXTENT),
            ..Placement::standing(middle_m)
        };
        made.channels(&placement).unwrap().coherent_sum().unwrap()
    };
    let local = |place: DVec3| began.attitude.inverse() * (place - began.position_m);
    let (on_truth, on_found) = (
        of(&truth, None, MIDDLE_M),
        of(&by_echoes, Some(own), local(MIDDLE_M)),
    );
    let peak = |sum: &dyn PhaseHistory, about: DVec3| {
        let grid = chip(about, 0.5, 0.025);
        let peak = form(sum, &grid, Window::Hamming).peak().unwrap();
        let off_m = grid.position_m(peak.row, peak.column).distance(about);
        (20.0 * f64::from(peak.value.norm()).log10(), off_m)
    };
    for (place, _) in reflectors() {
        let (true_db, _) = peak(&on_truth, place);
        let (found_db, off_m) = peak(&on_found, local(place));
        println!(
            "{place:.1}: {true_db:.2} dB, on the track found {found_db:.2} dB, {off_m:.3} m off"
        );
        assert!(
            (found_db - true_db).abs() < 1.0,
            "{place}: {found_db} {true_db}"
        );
    }
}
