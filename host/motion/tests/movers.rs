//! Tracks among moving targets, at 1000 pulses per second.

use super::scene::{Reflector, seen, still};
use super::*;
use subaperture_motion::movers::{Doubt, NoScene, Scene, classify, track_among_movers};
use subaperture_motion::{Heading, Robust, chain};

pub(super) const RATE_HZ: f64 = 1000.0;
/// Pulses of a segment of the classification.
pub(super) const SEGMENT: usize = 32;

pub(super) fn moving(at_m: [f64; 2], velocity_m_s: [f64; 2]) -> Reflector {
    Reflector {
        at_m,
        step_m: velocity_m_s.map(|v| v / RATE_HZ),
        height_m: 0.0,
    }
}

fn times_s(pulses: usize) -> Vec<f64> {
    (0..pulses).map(|n| n as f64 / RATE_HZ).collect()
}

fn scene(array: &Array, pulses: &[Vec<Sighting>]) -> Scene {
    track_among_movers(array, pulses, &times_s(pulses.len()), SEGMENT, WINDOW).unwrap()
}

pub(super) fn flat(_: usize) -> f64 {
    0.0
}

/// RMS errors over seeds of the last pose's distance from the first, `[without, with]` the movers, by methods (c) and (b). Asserts velocities within 5 %.
fn with_and_without(
    receivers: usize,
    snr_db: f64,
    movers: &[([f64; 2], [f64; 2])],
    seeds: u64,
) -> [[f64; 2]; 2] {
    let (poses, array, noise) = (poses(1000), array(receivers), Noise::of_snr(snr_db));
    let truth_m = poses[999].at_m.length();
    let still = still(&PLACES_M);
    let mut all = still.clone();
    all.extend(
        movers
            .iter()
            .map(|(at_m, velocity)| moving(*at_m, *velocity)),
    );
    let mut squares = [[0.0; 2]; 2];
    let mut worst: f64 = 0.0;
    for seed in 0..seeds {
        for (i, reflectors) in [&still, &all].into_iter().enumerate() {
            let pulses = seen(&array, &poses, flat, reflectors, &noise, seed);
            let found = scene(&array, &pulses);
            let names: Vec<usize> = (4..reflectors.len()).collect();
            assert_eq!(found.classes.moving, names, "{seed}");
            assert_eq!(found.classes.standing, [0, 1, 2, 3], "{seed}");
            // The frame is rotated by the error of the first direction of the first target.
            let first_m = DVec2::from_array(PLACES_M[0]);
            let turned = first_m.angle_to(found.track.targets[0].1.at_m);
            for (mover, (_, velocity)) in found.movers.iter().zip(movers) {
                let truth = DVec2::from_angle(turned).rotate(DVec2::from_array(*velocity));
                worst = worst.max(mover.velocity_m_s.distance(truth) / truth.length());
            }
            assert_eq!(found.movers.len(), names.len());
            let off_m = found.track.poses[999].at_m.length() - truth_m;
            squares[0][i] += off_m * off_m / seeds as f64;
            let mut robust = Robust::new(array.clone(), Heading::Estimated, 100).unwrap();
            let increments = pulses
                .iter()
                .filter_map(|pulse| robust.push(pulse).unwrap())
                .map(|found| found.increment);
            let off_m = chain(increments)[999].at_m.length() - truth_m;
            squares[1][i] += off_m * off_m / seeds as f64;
        }
    }
    let rms_m = squares.map(|both| both.map(f64::sqrt));
    println!(
        "{receivers} receivers, {snr_db} dB, {} movers: (c) {:.4} mm without, {:.4} mm with; (b) {:.3} mm, {:.3} mm; velocity within {:.2} %",
        movers.len(),
        1e3 * rms_m[0][0],
        1e3 * rms_m[0][1],
        1e3 * rms_m[1][0],
        1e3 * rms_m[1][1],
        1e2 * worst
    );
    assert!(worst < 0.05, "{worst}");
    rms_m
}

/// Position in metres and velocity in m/s of a mover among four standing targets: 0.5 m/s.
pub(super) const MOVER: ([f64; 2], [f64; 2]) = ([0.6, 4.1], [-0.3, -0.4]);

#[test]
fn mover_does_not_increase_track_error() {
    for (receivers, snr_db) in [(2, 30.0), (4, 20.0)] {
        let rms_m = with_and_without(receivers, snr_db, &[MOVER], 6);
        for [without, with] in rms_m {
            assert!(with < 1.5 * without, "{rms_m:?}");
        }
    }
}

#[test]
#[ignore = "minutes: cargo xtask long"]
fn mover_of_fifty_seeds_does_not_increase_track_error() {
    for receivers in [2, 4] {
        for snr_db in [30.0, 20.0, 15.0, 40.0] {
            let [joint_m, robust_m] = with_and_without(receivers, snr_db, &[MOVER], 50);
            assert!(joint_m[1] < 1.5 * joint_m[0], "{joint_m:?}");
            // At lower SNR, method (b) cannot separate a mover from noise within two pulses.
            assert!(
                snr_db < 30.0 || robust_m[1] < 1.5 * robust_m[0],
                "{robust_m:?}"
            );
        }
    }
}

#[test]
fn several_movers_are_separated() {
    let movers = [
        MOVER,
        // Across the line of sight, and away.
        ([-0.2, 2.5], [0.5, 0.05]),
        ([1.5, 2.2], [0.1, 0.3]),
    ];
    let [[without, with], _] = with_and_without(4, 30.0, &movers, 2);
    // Two seeds determine the ratio of RMS errors only within a factor of 2.5.
    assert!(with < 2.5 * without, "{with} {without}");
}

#[test]
fn targets_that_all_move_have_no_common_motion() {
    let (poses, array, noise) = (poses(1000)[..200].to_vec(), array(2), Noise::of_snr(30.0));
    let velocities = [
        [0.3, 0.1],
        [-0.2, 0.35],
        [0.05, -0.4],
        [-0.4, -0.15],
        [0.2, 0.3],
    ];
    let places = [[-0.8, 2.2], [0.3, 3.1], [1.6, 3.6], [-1.1, 4.7], [0.9, 2.0]];
    let reflectors: Vec<Reflector> = places
        .into_iter()
        .zip(velocities)
        .map(|(at_m, velocity)| moving(at_m, velocity))
        .collect();
    let pulses = seen(&array, &poses, flat, &reflectors, &noise, 1);
    let result = track_among_movers(&array, &pulses, &times_s(200), SEGMENT, WINDOW);
    let refused = result.map(|found| found.classes).unwrap_err();
    let doubt = NoScene::Doubt(Doubt::Disagree {
        targets: 5,
        first: 0,
        last: 199,
    });
    assert_eq!(refused, doubt);
    assert!(refused.to_string().contains("are reliable"), "{refused}");
}

#[test]
fn groups_of_equal_size_are_ambiguous() {
    let (poses, array, noise) = (poses(1000)[..100].to_vec(), array(2), Noise::of_snr(30.0));
    let mut reflectors = still(&[[-0.8, 2.2], [0.3, 3.1], [1.6, 3.6]]);
    let convoy = [[-1.1, 4.7], [0.9, 2.0], [0.0, 5.0]];
    reflectors.extend(convoy.map(|at_m| moving(at_m, [0.3, 0.2])));
    let pulses = seen(&array, &poses, flat, &reflectors, &noise, 1);
    let classes = classify(&array, &pulses, SEGMENT).unwrap();
    let Doubt::Divided { some, others, .. } = &classes.doubts[0] else {
        panic!("{:?}", classes.doubts);
    };
    let mut groups = [some.clone(), others.clone()];
    groups.sort();
    assert_eq!(groups, [vec![0, 1, 2], vec![3, 4, 5]]);
    // A fourth standing target decides.
    reflectors.extend(still(&[[1.0, 4.5]]));
    let pulses = seen(&array, &poses, flat, &reflectors, &noise, 1);
    let classes = classify(&array, &pulses, SEGMENT).unwrap();
    assert_eq!(
        (classes.standing, classes.moving),
        (vec![0, 1, 2, 6], vec![3, 4, 5])
    );
}

#[test]
fn two_targets_and_missing_times_are_refused() {
    let (poses, array, noise) = (poses(1000)[..100].to_vec(), array(2), Noise::of_snr(30.0));
    let pulses = seen(&array, &poses, flat, &still(&PLACES_M[..2]), &noise, 1);
    let refused = track_among_movers(&array, &pulses, &times_s(100), SEGMENT, WINDOW).unwrap_err();
    assert!(
        matches!(refused, NoScene::Doubt(Doubt::Few { targets: 2, .. })),
        "{refused}"
    );
    let refused = track_among_movers(&array, &pulses, &times_s(99), SEGMENT, WINDOW).unwrap_err();
    assert!(
        matches!(
            refused,
            NoScene::Times {
                times: 99,
                pulses: 100
            }
        ),
        "{refused}"
    );
}
