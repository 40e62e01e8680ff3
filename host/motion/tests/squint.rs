//! Squint of an array on a rail (C 7.5.1), and errors by heights out of the plane of motion.

use super::scene::{Reflector, seen, still};
use super::*;
use subaperture_motion::squint::{Leg, SquintError, increments, squint, travelled};
use subaperture_motion::{Heading, Pairwise, Robust, chain};

const SQUINT_RAD: f64 = 0.06;

/// Track of 0.5 m along the rail with the squint as heading.
fn rail() -> Vec<Pose> {
    let pose = |n: usize| Pose {
        at_m: DVec2::new(1e-3 * n as f64, 0.0),
        heading_rad: SQUINT_RAD,
    };
    (0..500).map(pose).collect()
}

#[test]
fn squint_is_estimated_from_direction_of_travel() {
    let (poses, array, noise) = (rail(), array(4), Noise::of_snr(30.0));
    let mut worst: f64 = 0.0;
    for seed in 0..3 {
        let pulses = seen(&array, &poses, |_| 0.0, &still(&PLACES_M), &noise, seed);
        let mut a = Pairwise::new(array.clone(), Heading::Estimated).unwrap();
        let mut b = Robust::new(array.clone(), Heading::Known, 100).unwrap();
        let (mut thesis, mut robust) = (Vec::new(), Vec::new());
        for pulse in &pulses {
            thesis.extend(a.push(pulse).unwrap().map(|moved| moved.increment));
            robust.extend(b.push(pulse).unwrap().map(|found| found.increment));
        }
        let joint = track(&array, &pulses, WINDOW).unwrap();
        // Drift in range as in the thesis.
        let end_m = chain(robust.clone())[499].at_m;
        assert!((end_m.y + 0.499 * SQUINT_RAD.sin()).abs() < 2e-3, "{end_m}");
        for (method, poses) in [
            ("a", chain(thesis)),
            ("b", chain(robust)),
            ("c", joint.poses),
        ] {
            // The heading of one pulse is known to about a degree, the mean over all pulses to 0.1 deg at 30 dB with 4 receivers: the direction of each leg, a tenth
            // of the track, is off by at most half a degree.
            let legs: Vec<Leg> = poses
                .chunks(50)
                .map(|some| {
                    let estimated_m = travelled(increments(some));
                    Leg::along_axis(estimated_m, 0.5f64.to_radians() * estimated_m.length())
                })
                .collect();
            let found = squint(&legs).unwrap();
            let off = (found.squint_rad - SQUINT_RAD).abs();
            worst = worst.max(off);
            assert!(off < 4.0 * found.sigma_rad, "{method}: {found:?}");
            let [sum, free] = found.chi_square;
            assert!(sum < 2.0 * free, "{method}: {found:?}");
            // After correction the body moves along its own axis, within the error of the squint.
            let body = found.of_body(&poses);
            let last = body[body.len() - 1];
            assert!(
                last.at_m.y.abs() < 4.0 * found.sigma_rad * 0.499 + 2e-3,
                "{method}: {last:?}"
            );
            assert!(body[0] == Pose::default());
        }
    }
    println!("squint within {worst:.5} rad of {SQUINT_RAD}");
}

#[test]
fn short_motion_gives_no_squint() {
    let leg = |x: f64| Leg::along_axis(DVec2::new(x, 0.0), 1e-3);
    let refused = squint(&[leg(2e-3)]).unwrap_err();
    assert!(
        matches!(refused, SquintError::TooLittle { .. }),
        "{refused}"
    );
    assert!(
        refused.to_string().contains("needs more motion"),
        "{refused}"
    );
    assert!(matches!(squint(&[]), Err(SquintError::TooLittle { .. })));
    assert!(squint(&[leg(0.1)]).is_ok());
    assert_eq!(squint(&[leg(0.1), leg(f64::NAN)]), Err(SquintError::Leg(1)));
    // Forward and back.
    let there = Leg {
        estimated_m: DVec2::new(0.1, 0.0),
        reference_m: DVec2::new(0.1, 0.01),
        sigma_m: 1e-3,
    };
    let back = Leg {
        estimated_m: -there.estimated_m,
        reference_m: -there.reference_m,
        ..there
    };
    let found = squint(&[there, back]).unwrap();
    assert!((found.squint_rad - 0.1f64.atan()).abs() < 1e-12);
    // 1 mm over 0.1 m, averaged over two legs.
    assert!((found.sigma_rad - 0.01 / 2f64.sqrt()).abs() < 1e-4);
}

/// Heave of 5 mm, two periods.
fn heave_m(n: usize) -> f64 {
    5e-3 * (TAU * 2.0 * n as f64 / 999.0).sin()
}

fn raised(heights_m: [f64; 4]) -> Vec<Reflector> {
    let both = still(&PLACES_M).into_iter().zip(heights_m);
    both.map(|(reflector, height_m)| Reflector {
        height_m,
        ..reflector
    })
    .collect()
}

/// Error of a pose by heave, from the least squares of ranges in the plane.
fn expected_m(pose: &Pose, reflectors: &[Reflector], heave_m: f64) -> DVec2 {
    let (mut xx, mut xy, mut yy, mut x, mut y) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for reflector in reflectors {
        let from = DVec2::from_array(reflector.at_m) - pose.at_m;
        let range_m = from.length().hypot(reflector.height_m);
        let a = from.x / range_m;
        let b = (1.0 - a * a).sqrt();
        let nearer_m = heave_m * reflector.height_m / range_m;
        (xx, xy, yy) = (xx + a * a, xy + a * b, yy + b * b);
        (x, y) = (x + a * nearer_m, y + b * nearer_m);
    }
    DVec2::new(yy * x - xy * y, xx * y - xy * x) / (xx * yy - xy * xy)
}

#[test]
fn heave_error_agrees_with_its_derivation() {
    let (poses, array, noise) = (poses(1000), array(4), Noise::of_snr(30.0));
    let level = |_: usize| 0.0;
    let sights = |height_m: &dyn Fn(usize) -> f64, reflectors: &[Reflector]| {
        seen(&array, &poses, height_m, reflectors, &noise, 5)
    };
    let by_pairs = |pulses: &[Vec<Sighting>]| {
        let mut robust = Robust::new(array.clone(), Heading::Estimated, 100).unwrap();
        let found = pulses
            .iter()
            .filter_map(|pulse| robust.push(pulse).unwrap());
        chain(found.map(|found| found.increment))
    };
    let jointly = |pulses: &[Vec<Sighting>]| track(&array, pulses, WINDOW).unwrap();
    // Crests and troughs.
    let extremes = [125, 375, 624, 874];
    let worst_m = |some: &[Pose], others: &[Pose]| {
        let apart_m = extremes.map(|n| some[n].at_m.distance(others[n].at_m));
        apart_m.into_iter().fold(0.0, f64::max)
    };
    // (5 mm)^2 / (2 range) is 3 to 6 um of range. Its difference between targets, 3 um, is enlarged fivefold by directions only half a radian apart.
    let flat = raised([0.0; 4]);
    let [still, heaving] = [sights(&level, &flat), sights(&heave_m, &flat)];
    let pairs_m = worst_m(&by_pairs(&still), &by_pairs(&heaving));
    let joint_m = worst_m(&jointly(&still).poses, &jointly(&heaving).poses);
    println!(
        "targets in the plane: {:.1} um, jointly {:.1} um",
        1e6 * pairs_m,
        1e6 * joint_m
    );
    assert!(pairs_m < 30e-6 && joint_m < 30e-6, "{pairs_m} {joint_m}");

    let high = raised([0.5, 0.2, 0.8, 0.3]);
    let [still, heaving] = [sights(&level, &high), sights(&heave_m, &high)];
    let [before, after] = [by_pairs(&still), by_pairs(&heaving)];
    for n in extremes {
        let off_m = after[n].at_m - before[n].at_m;
        let expected_m = expected_m(&poses[n], &high, heave_m(n));
        println!(
            "raised, pulse {n}: {:.3} mm, expected {:.3}",
            1e3 * off_m,
            1e3 * expected_m
        );
        // Estimated turns absorb a part, and directions change along the track.
        assert!(
            off_m.distance(expected_m) < 0.3 * expected_m.length() && expected_m.length() > 2e-4
        );
    }
    // Joint estimate: heights cause residuals beyond noise, and chi-square shows them. Distances from the first pose are independent of the frame's rotation.
    for (name, pulses) in [("still", still), ("heaving", heaving)] {
        let found = jointly(&pulses);
        let off_m = extremes.map(|n| found.poses[n].at_m.length() - poses[n].at_m.length());
        let [sum, free] = found.chi_square;
        println!(
            "jointly, {name}: {off_m:.6?} m, {:.1} times the squares of noise",
            sum / free
        );
        assert!(sum > 2.0 * free, "{sum} {free}");
    }
}

/// A raised target counts as a farther one in the plane: motion along the array is unbiased, motion along boresight is short by the cosine of the elevation.
#[test]
fn elevation_error_agrees_with_its_derivation() {
    let (array, noise) = (array(4), Noise::of_snr(40.0));
    // Elevations of 0.2 rad.
    let heights = PLACES_M.map(|place| 0.2f64.tan() * DVec2::from_array(place).length());
    let reflectors = raised(heights);
    for (step_m, share) in [
        (DVec2::new(1e-3, 0.0), 1.0),
        (DVec2::new(0.0, 0.5e-3), 0.2f64.cos()),
    ] {
        let pose = |n: usize| Pose {
            at_m: step_m * n as f64,
            heading_rad: 0.0,
        };
        let poses: Vec<Pose> = (0..300).map(pose).collect();
        let pulses = seen(&array, &poses, |_| 0.0, &reflectors, &noise, 2);
        let mut robust = Robust::new(array.clone(), Heading::Known, 100).unwrap();
        let found = pulses
            .iter()
            .filter_map(|pulse| robust.push(pulse).unwrap());
        let last = chain(found.map(|found| found.increment))[299];
        let got = last.at_m.length() / poses[299].at_m.length();
        println!("{step_m}: {got:.5}, expected {share:.5}");
        // Within a quarter of the 2 % loss, as elevations grow while ranges shrink, plus 0.05 % of noise.
        assert!(
            (got - share).abs() < 0.25 * (1.0 - share) + 5e-4,
            "{step_m} {got}"
        );
    }
}
