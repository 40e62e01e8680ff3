//! Online tracks among moving targets, at 1000 pulses per second.

use super::movers::{MOVER, RATE_HZ, SEGMENT, flat, moving};
use super::scene::{Reflector, seen, still};
use super::*;
use subaperture_motion::Live;
use subaperture_motion::live::Look;

/// Online estimator after all pulses, its final poses, and each dropped target with the pulse at which it was dropped.
struct Followed {
    live: Live,
    poses: Vec<Pose>,
    dropped: Vec<(usize, usize)>,
}

fn follow(array: &Array, pulses: &[Vec<Sighting>]) -> Followed {
    let mut live = Live::new(array.clone(), WINDOW, SEGMENT).unwrap();
    let (mut poses, mut dropped) = (Vec::new(), Vec::new());
    for (n, pulse) in pulses.iter().enumerate() {
        let look: Look = live.push(n as f64 / RATE_HZ, pulse).unwrap();
        poses.push(look.step.pose);
        let first = poses.len() - look.repeated.len();
        poses.splice(first.., look.repeated);
        dropped.extend(look.dropped.into_iter().map(|target| (target, n)));
    }
    Followed {
        live,
        poses,
        dropped,
    }
}

/// Relative error of the mover's velocity. The frame is rotated by the error of the first direction of the first target.
fn off(followed: &Followed, truth: [f64; 2]) -> f64 {
    let [(_, first), ..] = followed.live.tracker().targets().collect::<Vec<_>>()[..] else {
        panic!("no target")
    };
    let turned = DVec2::from_array(PLACES_M[0]).angle_to(first.at_m);
    let truth = DVec2::from_angle(turned).rotate(DVec2::from_array(truth));
    let [mover] = &followed.live.movers()[..] else {
        panic!("not one mover")
    };
    mover.velocity_m_s.distance(truth) / truth.length()
}

#[test]
fn mover_does_not_increase_error_of_online_track() {
    const SEEDS: u64 = 6;
    for (receivers, snr_db) in [(2, 30.0), (4, 20.0)] {
        let (poses, array, noise) = (poses(1000), array(receivers), Noise::of_snr(snr_db));
        let truth_m = poses[999].at_m.length();
        let still = still(&PLACES_M);
        let mut all = still.clone();
        all.push(moving(MOVER.0, MOVER.1));
        let (mut squares, mut worst) = ([0.0; 2], 0f64);
        for seed in 0..SEEDS {
            for (i, reflectors) in [&still, &all].into_iter().enumerate() {
                let pulses = seen(&array, &poses, flat, reflectors, &noise, seed);
                let followed = follow(&array, &pulses);
                let expected = [(4, SEGMENT - 1)];
                assert_eq!(followed.dropped, expected[..i], "{seed}");
                squares[i] += (followed.poses[999].at_m.length() - truth_m).powi(2);
                if i == 1 {
                    worst = worst.max(off(&followed, MOVER.1));
                }
            }
        }
        let rms_m = squares.map(|sum| (sum / SEEDS as f64).sqrt());
        println!(
            "{receivers} receivers, {snr_db} dB: {:.4} mm without, {:.4} mm with; velocity within {:.2} %",
            1e3 * rms_m[0],
            1e3 * rms_m[1],
            1e2 * worst
        );
        assert!(rms_m[1] < 1.5 * rms_m[0], "{rms_m:?}");
        assert!(worst < 0.05, "{worst}");
    }
}

/// A mover that appears in pulse 100, in the first quarter of the fourth segment, is dropped at the end of that segment and never used. A target that starts to move is dropped within two segments.
#[test]
fn late_mover_is_never_used_and_starting_mover_is_dropped() {
    let (poses, array, noise) = (poses(1000)[..400].to_vec(), array(2), Noise::of_snr(30.0));
    let mut all = still(&PLACES_M);
    all.push(moving(MOVER.0, MOVER.1));
    let pulses = seen(&array, &poses, flat, &all, &noise, 3);
    let mut late = pulses.clone();
    for pulse in &mut late[..100] {
        pulse.truncate(4);
    }
    let followed = follow(&array, &late);
    assert_eq!(followed.dropped, [(4, 4 * SEGMENT - 1)]);
    assert!(off(&followed, MOVER.1) < 0.05);
    // Bit-identical to the track without the mover.
    let mut without = pulses.clone();
    without.iter_mut().for_each(|pulse| pulse.truncate(4));
    let alone = follow(&array, &without);
    assert_eq!(followed.poses, alone.poses);
    // The fifth target stands still up to pulse 150.
    let mut stood = all.clone();
    stood[4] = Reflector {
        step_m: [0.0; 2],
        ..all[4]
    };
    let mut begins = seen(&array, &poses, flat, &stood, &noise, 3);
    let place = |n: usize| [0, 1].map(|k| all[4].at_m[k] + all[4].step_m[k] * n as f64);
    for (n, pulse) in begins.iter_mut().enumerate().skip(150) {
        let here = Reflector {
            at_m: place(n - 150),
            ..stood[4]
        };
        let now = seen(
            &array,
            &poses[n..=n],
            flat,
            &[here],
            &Noise {
                phase_rad: 0.0,
                range_m: 1e-9,
            },
            3,
        );
        let first = &mut pulse[4];
        // Its phase continues from the standing target's: add the difference of the noise-free phases.
        let clean = seen(
            &array,
            &poses[n..=n],
            flat,
            &[stood[4]],
            &Noise {
                phase_rad: 0.0,
                range_m: 1e-9,
            },
            3,
        );
        for (phase, (a, b)) in first
            .phases_rad
            .iter_mut()
            .zip(now[0][0].phases_rad.iter().zip(&clean[0][0].phases_rad))
        {
            *phase += a - b;
        }
        first.range_m += now[0][0].range_m - clean[0][0].range_m;
    }
    let followed = follow(&array, &begins);
    let [(4, pulse)] = followed.dropped[..] else {
        panic!("{:?}", followed.dropped)
    };
    assert!((150..150 + 2 * SEGMENT).contains(&pulse), "{pulse}");
    // Its influence before it was dropped moves the track by less than 1 mm.
    let off_m = followed.poses[399].at_m.distance(alone.poses[399].at_m);
    println!(
        "began to move, dropped in pulse {pulse}; {:.3} mm off the track without it",
        1e3 * off_m
    );
    assert!(off_m < 1e-3, "{off_m}");
}

#[test]
fn two_targets_are_in_doubt_and_time_must_ascend() {
    let (poses, array, noise) = (poses(1000)[..40].to_vec(), array(2), Noise::of_snr(30.0));
    let pulses = seen(&array, &poses, flat, &still(&PLACES_M[..2]), &noise, 1);
    let mut live = Live::new(array.clone(), WINDOW, SEGMENT).unwrap();
    for (n, pulse) in pulses.iter().enumerate() {
        let look = live.push(n as f64, pulse).unwrap();
        assert_eq!(look.doubt.is_some(), n == SEGMENT - 1, "{n}");
    }
    let refused = live.push(39.0, &pulses[0]).unwrap_err();
    assert!(matches!(refused, MotionError::Time { .. }), "{refused}");
    assert!(live.push(f64::NAN, &pulses[0]).is_err() && live.movers().is_empty());
}
