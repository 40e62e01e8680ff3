//! Tracks from echoes.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};
use subaperture_model::monitor::Silent;
use subaperture_motion::targets::{Recovered, Settings, recover};

use crate::scene::{Radar, Recording, Reflector, Truth, l_band, reflector, w_band};

/// Walk along x in steps of 2.5 cm (20 m in 801 pulses), with deviations of some decimetres and headings within 5 degrees.
pub(crate) fn walk(count: usize) -> Vec<Truth> {
    let at = |n: usize| {
        let u = n as f64 / 800.0;
        let sway = |cycles: f64, phase: f64| (TAU * cycles * u + phase).sin();
        Truth {
            at_m: DVec2::new(
                20.0 * u - 10.0 + 0.3 * sway(2.3, 0.0),
                0.4 * sway(1.2, 0.5) + 0.08 * sway(5.1, 1.0),
            ),
            heading_rad: 5f64.to_radians() * (0.7 * sway(1.7, 0.3) + 0.3 * sway(4.3, 2.0)),
        }
    };
    (0..count).map(at).collect()
}

/// The straight recorded track.
pub(crate) fn straight(count: usize) -> Vec<Truth> {
    let at = |n: usize| Truth {
        at_m: DVec2::new(20.0 * n as f64 / 800.0 - 10.0, 0.0),
        heading_rad: 0.0,
    };
    (0..count).map(at).collect()
}

pub(crate) fn reflectors() -> [Reflector; 7] {
    [
        reflector(-11.0, 8.0, 1.0),
        reflector(-6.5, 13.2, 1.3),
        reflector(-1.8, 9.1, 0.9),
        reflector(2.4, 16.3, 1.6),
        reflector(5.2, 11.4, 1.1),
        reflector(9.7, 14.8, 1.4),
        reflector(12.3, 9.6, 1.0),
    ]
}

/// Recording on the track `truth` with the recorded track `recorded`, at an SNR of 30 dB over all samples of a unit reflector.
pub(crate) fn walked<'a>(
    radar: &'a Radar,
    [truth, recorded]: [&'a [Truth]; 2],
    reflectors: &'a [Reflector],
) -> Recording<'a> {
    Recording {
        radar,
        truth,
        recorded,
        reflectors,
        noise: (radar.samples as f64).sqrt() * 10f64.powf(-30.0 / 20.0),
        seed: 1,
    }
}

/// Phase centre of the antennas, metres.
fn middle_m(radar: &Radar, truth: &Truth) -> DVec2 {
    let mean = |all: &[DVec2]| all.iter().sum::<DVec2>() / all.len() as f64;
    let arm_m = 0.5 * (mean(&radar.transmitters_m) + mean(&radar.receivers_m));
    truth.at_m + DVec2::from_angle(truth.heading_rad).rotate(arm_m)
}

/// RMS errors of positions (metres) and headings (radians) after alignment with the truth by rotation and translation.
pub(crate) fn off(found: &Recovered, radar: &Radar, truth: &[Truth]) -> [f64; 2] {
    let each = found.moments.iter();
    let poses: Vec<_> = each
        .map(|moment| (moment.pulse, moment.position_m, moment.attitude))
        .collect();
    off_by(&poses, radar, truth)
}

/// [`off`] of poses given as pulse number, position and attitude.
pub(crate) fn off_by(poses: &[(usize, DVec3, DQuat)], radar: &Radar, truth: &[Truth]) -> [f64; 2] {
    let pairs: Vec<(DVec2, DVec2)> = poses
        .iter()
        .map(|(pulse, at_m, _)| (at_m.truncate(), middle_m(radar, &truth[*pulse])))
        .collect();
    let count = pairs.len() as f64;
    let mean_got = pairs.iter().map(|pair| pair.0).sum::<DVec2>() / count;
    let mean_wanted = pairs.iter().map(|pair| pair.1).sum::<DVec2>() / count;
    let (mut dot, mut cross) = (0.0, 0.0);
    for (got, wanted) in &pairs {
        dot += (*got - mean_got).dot(*wanted - mean_wanted);
        cross += (*got - mean_got).perp_dot(*wanted - mean_wanted);
    }
    let turn = DVec2::from_angle(cross.atan2(dot));
    let squares: f64 = pairs
        .iter()
        .map(|(got, wanted)| (turn.rotate(*got - mean_got) + mean_wanted).distance_squared(*wanted))
        .sum();
    let headings: f64 = poses
        .iter()
        .map(|(pulse, _, attitude)| {
            let x = *attitude * DVec3::X;
            let got = x.y.atan2(x.x) + cross.atan2(dot);
            (got - truth[*pulse].heading_rad).powi(2)
        })
        .sum();
    [(squares / count).sqrt(), (headings / count).sqrt()]
}

#[test]
fn two_receivers_recover_irregular_walk() {
    let (radar, truth) = (l_band(), walk(801));
    let (recorded, all) = (straight(801), reflectors());
    let recording = walked(&radar, [&truth, &recorded], &all);
    let channels = recording.channels();
    let found = recover(channels, &Settings::default(), &Silent).unwrap();
    for fault in &found.seen.faults {
        println!("{fault}");
    }
    let [place_m, heading_rad] = off(&found, &radar, &truth);
    let sigma_m = found.moments[found.moments.len() - 1].spread_m();
    let [sum, expected] = found.chi_square;
    println!(
        "{} poses, {} targets: {:.1} mm off, stated standard deviation of the last pose {:.1} mm; {:.3} deg; chi-square {:.2}",
        found.moments.len(),
        found.places.len(),
        1e3 * place_m,
        1e3 * sigma_m,
        heading_rad.to_degrees(),
        sum / expected
    );
    // Reflectors cross in range repeatedly, and each is still one target.
    assert_eq!(found.places.len(), reflectors().len());
    assert!(found.moments.len() > 780, "{}", found.moments.len());
    // The scale error, by errors of the directions of arrival, grows along the track: the last pose has the largest.
    assert!(place_m < 1.5 * sigma_m, "{place_m} {sigma_m}");
    // From a single pulse: 26 mrad per phase, times sqrt(2) for two phases, over pi cos(theta) with a cosine of 0.7 and over sqrt(5) targets: 0.4 degrees; the limit is 1.6 times that.
    assert!(heading_rad.to_degrees() < 0.65, "{heading_rad}");
    // Neighbours in range add residuals.
    assert!(sum < 1.5 * expected, "{sum} {expected}");
}

/// Four reflectors at 2 to 5 m (Chim 2018, 7.5).
fn room() -> [Reflector; 4] {
    [
        reflector(-0.8, 2.2, 1.0),
        reflector(0.3, 3.1, 1.0),
        reflector(1.6, 3.6, 1.0),
        reflector(-1.1, 4.7, 1.0),
    ]
}

/// Track on a rail along x at these positions, with an SNR of 30 dB over all samples.
fn on_rail(places_m: &[f64]) -> Recovered {
    let truth: Vec<Truth> = places_m
        .iter()
        .map(|&x| Truth {
            at_m: DVec2::new(x, 0.0),
            heading_rad: 0.0,
        })
        .collect();
    let radar = w_band();
    let recording = Recording {
        radar: &radar,
        truth: &truth,
        recorded: &truth,
        reflectors: &room(),
        noise: 16.0 * 10f64.powf(-30.0 / 20.0),
        seed: 9,
    };
    let found = recover(recording.channels(), &Settings::default(), &Silent).unwrap();
    assert_eq!(found.seen.faults, []);
    assert_eq!(found.moments.len(), places_m.len());
    found
}

/// Steps from pulse to pulse along x and y, metres.
fn steps_m(found: &Recovered) -> Vec<DVec2> {
    let pairs = found.moments.windows(2);
    pairs
        .map(|pair| (pair[1].position_m - pair[0].position_m).truncate())
        .collect()
}

/// Mean and RMS deviation from it.
fn spread(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    [mean, square.sqrt()]
}

/// Bursts of ten chirps with pauses of three more periods, at 0.1 mm per chirp (Chim 2018, figure 7.12).
#[test]
fn pauses_between_bursts_give_larger_steps() {
    const STEP_M: f64 = 1e-4;
    let mut places_m = Vec::new();
    let mut at_m = 0.0;
    for n in 0..300 {
        places_m.push(at_m);
        at_m += STEP_M * if n % 10 == 9 { 4.0 } else { 1.0 };
    }
    let found = on_rail(&places_m);
    let steps = steps_m(&found);
    let (mut bursts, mut pauses) = (Vec::new(), Vec::new());
    for (n, step) in steps.iter().enumerate() {
        if n % 10 == 9 {
            &mut pauses
        } else {
            &mut bursts
        }
        .push(step.x);
    }
    let ([burst, scatter], [pause, pause_scatter]) = (spread(&bursts), spread(&pauses));
    let across = spread(&steps.iter().map(|step| step.y).collect::<Vec<_>>());
    println!(
        "steps within bursts {:.4} mm, scattered by {:.4}; over pauses {:.4} mm, scattered by {:.4}; across {:.5} mm, {:.4}",
        1e3 * burst,
        1e3 * scatter,
        1e3 * pause,
        1e3 * pause_scatter,
        1e3 * across[0],
        1e3 * across[1]
    );
    // Noise of a step: 26 mrad of phase with this window are 16 um of path, 8 um of range. Eight phases of four targets, with a spread of 0.35 in the sine of the
    // direction, determine motion along the array to 8 / (0.35 sqrt(8)) um; a step is the difference of two: 12 um.
    assert!(
        scatter < 20e-6 && pause_scatter < 20e-6,
        "{scatter} {pause_scatter}"
    );
    // Noise of the mean of 270 and of 29 steps, plus a scale error of 2 % by the directions of arrival of a track of only 4 cm.
    assert!((burst / STEP_M - 1.0).abs() < 0.03, "{burst}");
    assert!((pause / (4.0 * STEP_M) - 1.0).abs() < 0.04, "{pause}");
    // Every step over a pause exceeds every step within a burst.
    let most = bursts.iter().fold(0.0, |most: f64, step| most.max(*step));
    let least = pauses.iter().fold(1.0, |least: f64, step| least.min(*step));
    assert!(least > 1.5 * most, "{least} {most}");
    assert!(across[0].abs() < 2e-6, "{across:?}");
}

/// A motor that starts and reaches 0.1 mm per chirp after 400 chirps (Chim 2018, figure 7.13).
#[test]
fn ramp_of_starting_motor_is_recovered() {
    const FULL_M: f64 = 1e-4;
    const RAMP: usize = 400;
    let mut places_m = Vec::new();
    let mut at_m = 0.0;
    for n in 0..600 {
        places_m.push(at_m);
        at_m += FULL_M * (n as f64 / RAMP as f64).min(1.0);
    }
    let steps = steps_m(&on_rail(&places_m));
    // A line through the ramp's steps, by least squares.
    let ramp: Vec<(f64, f64)> = (0..RAMP).map(|n| (n as f64, steps[n].x)).collect();
    let count = RAMP as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| ramp.iter().map(of).sum::<f64>() / count;
    let (mean_n, mean_step) = (mean(|p| p.0), mean(|p| p.1));
    let slope = ramp
        .iter()
        .map(|(n, step)| (n - mean_n) * (step - mean_step))
        .sum::<f64>()
        / ramp.iter().map(|(n, _)| (n - mean_n).powi(2)).sum::<f64>();
    let start = mean_step - slope * mean_n;
    let [full, scatter] = spread(&steps[RAMP..].iter().map(|step| step.x).collect::<Vec<_>>());
    println!(
        "slope {:.4} of {:.4} um a chirp squared, from {:.3} um on; then {:.3} um, scattered by {:.3}",
        1e6 * slope,
        1e6 * FULL_M / count,
        1e6 * start,
        1e6 * full,
        1e6 * scatter
    );
    // 12 um per step over 400 steps: the slope has a standard deviation of 12 sqrt(12 / 400^3) um, 2 %, and a scale error of 3 %.
    assert!((slope / (FULL_M / count) - 1.0).abs() < 0.08, "{slope}");
    assert!(start.abs() < 4e-6, "{start}");
    assert!((full / FULL_M - 1.0).abs() < 0.04, "{full}");
}
