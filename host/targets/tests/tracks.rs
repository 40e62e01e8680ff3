//! Tracks from echoes.

use std::f64::consts::TAU;

use glam::DVec2;
use subaperture_model::monitor::Silent;
use subaperture_targets::{Recovered, Settings, recover};

use crate::scene::{Recording, Reflector, Truth, l_band, reflector, w_band};

/// 20 m along x in steps of 2.5 cm, off it by decimetres, the heading wandering by 5 degrees.
pub fn walk(count: usize) -> Vec<Truth> {
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

/// The straight way that the recording tells.
pub fn straight(count: usize) -> Vec<Truth> {
    let at = |n: usize| Truth {
        at_m: DVec2::new(20.0 * n as f64 / 800.0 - 10.0, 0.0),
        heading_rad: 0.0,
    };
    (0..count).map(at).collect()
}

pub fn reflectors() -> [Reflector; 7] {
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

/// How far the poses are from the truth when laid upon it by turn and shift: RMS of place, metres, and of heading, radians.
pub fn off(found: &Recovered, truth: &[Truth]) -> [f64; 2] {
    let pairs: Vec<(DVec2, DVec2)> = found
        .moments
        .iter()
        .map(|moment| (moment.position_m.truncate(), truth[moment.pulse].at_m))
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
        .map(|(got, wanted)| {
            (turn.rotate(*got - mean_got) + mean_wanted).distance_squared(*wanted)
        })
        .sum();
    let headings: f64 = found
        .moments
        .iter()
        .map(|moment| {
            let x = moment.attitude * glam::DVec3::X;
            let got = x.y.atan2(x.x) + cross.atan2(dot);
            (got - truth[moment.pulse].heading_rad).powi(2)
        })
        .sum();
    [(squares / count).sqrt(), (headings / count).sqrt()]
}

#[test]
fn an_irregular_walk_is_found_from_two_receivers() {
    let (truth, told) = (walk(801), straight(801));
    let radar = l_band();
    let recording = Recording {
        radar: &radar,
        truth: &truth,
        told: &told,
        reflectors: &reflectors(),
        // 30 dB over all samples of a unit reflector.
        noise: 151f64.sqrt() * 10f64.powf(-30.0 / 20.0),
        seed: 1,
    };
    let start = std::time::Instant::now();
    let channels = recording.channels();
    println!("simulated in {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let found = recover(channels, &Settings::default(), &Silent).unwrap();
    println!("found in {:?}", start.elapsed());
    for event in &found.seen.events {
        println!("{event:?}");
    }
    for fault in &found.seen.faults {
        println!("{fault}");
    }
    println!("{:?}", found.places);
    let [place, heading] = off(&found, &truth);
    println!(
        "{} poses, {} targets: {:.1} mm, {:.3} deg, chi-square {:?}, length {:.3} m",
        found.moments.len(),
        found.places.len(),
        1e3 * place,
        heading.to_degrees(),
        found.chi_square,
        found.length_m()
    );
    assert!(place < 0.01);
}

#[test]
fn dummy() {
    let _ = w_band();
}
