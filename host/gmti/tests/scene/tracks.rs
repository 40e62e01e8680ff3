//! Tracks of movers over dwells, in clutter with internal motion.

use subaperture_gmti::detection::Settings;
use subaperture_gmti::space_time;
use subaperture_gmti::tracker::{self, Plane, Track, Tracker};
use subaperture_gmti::{GmtiError, find_in_dwells};
use subaperture_model::geometry::ImageGrid;

use crate::recording::{Truth, imaging, moving_clutter, recorded};

const DWELLS: usize = 8;

/// Pulses of a dwell of 1.04 s.
const PULSES: usize = 1040;

/// Movers with their places at the middle of all dwells, which they leave by less than 25 m.
const MOVERS: [Truth; 5] = [
    ([-10.0, 15.0], [5.0, -2.5], 3.0),
    ([20.0, -12.0], [-5.0, 2.0], 2.0),
    ([0.0, 2.0], [3.0, 3.0], 4.0),
    ([-20.0, -20.0], [-4.0, -0.8], 5.0),
    ([10.0, -4.0], [0.0, 5.0], 3.0),
];

/// Eight dwells of 1.04 s with 26 sub-CPIs, tracked with the default settings.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn tracks_in_clutter_with_internal_motion_belong_to_movers() {
    let mut scenario = moving_clutter(21, &MOVERS, [200.0, 45.0], 4.0);
    let pulses = (DWELLS * PULSES).to_string();
    scenario.set("radar.pulses", &pulses).unwrap();
    let channels = recorded(&scenario.experiment().unwrap());
    let grid: ImageGrid = "x=-60:60:0.3,y=-30:30:0.5,z=0".parse().unwrap();
    let imaging = imaging(&grid);
    let mut tracker = Tracker::new(tracker::Settings {
        plane: Plane::of(&grid),
        ..tracker::Settings::default()
    })
    .unwrap();
    let integration = space_time::Settings::default();
    find_in_dwells::<GmtiError>(
        &channels,
        &imaging,
        &Settings::default(),
        Some(&integration),
        1.04,
        |dwell| {
            println!(
                "{:.2} s: {} targets",
                dwell.alignment.centre_s(),
                dwell.targets.len()
            );
            tracker.scan(&dwell.scan()).unwrap();
            Ok(())
        },
    )
    .unwrap();
    let middle_s = 0.0005 * (DWELLS * PULSES - 1) as f64;
    let belongs = |track: &Track, ([x, y], [vx, vy], _): &Truth| {
        let last = track.history.last().unwrap();
        let after_s = last.time_s - middle_s;
        let [px, py, ..] = last.mean;
        // An error of 0.5 m/s of the radial velocity moves a target by 20 m along the track.
        (px - x - vx * after_s).abs() < 20.0 && (py - y - vy * after_s).abs() < 8.0
    };
    let confirmed: Vec<&Track> = tracker
        .tracks()
        .iter()
        .filter(|track| track.is_confirmed())
        .collect();
    let other = confirmed
        .iter()
        .filter(|track| !MOVERS.iter().any(|mover| belongs(track, mover)))
        .count();
    let missed = MOVERS
        .iter()
        .filter(|mover| !confirmed.iter().any(|track| belongs(track, mover)))
        .count();
    let minutes = 1.04 * DWELLS as f64 / 60.0;
    println!(
        "{} confirmed tracks, {other} of no mover ({:.1} per minute), {missed} movers without a track",
        confirmed.len(),
        other as f64 / minutes
    );
    for track in &confirmed {
        println!(
            "{:?} {:.1?}",
            track.status,
            track.history.last().unwrap().mean
        );
    }
    // At most one track of no mover in 8 dwells is 7 per minute. Two movers are without a track.
    assert!(other <= 1 && missed <= 2, "{other} {missed}");
}
