//! Methods of summation over scatterers: time per scatterer and pulse, and error, in one run.
//!
//! `cargo bench --bench simulate`. Methods alternate, so that a change of the machine's speed affects all; ratios are medians. One thread;
//! pulses are independent, so cores add up.

use std::time::Instant;

use glam::{DQuat, DVec3};
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::radar::{Antenna, Motion, Pattern};
use subaperture::simulate::Scatterer;
use subaperture::simulate::engine::{Engine, Method, Scratch, Sweep, View};
use subaperture::simulate::scene::Scene;
use subaperture::track::{Pose, Trajectory};

const TURNS: usize = 5;
const PULSES: usize = 8;
const SAMPLES: usize = 512;

#[derive(Debug)]
struct Straight;

impl Trajectory for Straight {
    fn pose(&self, time_s: f64) -> Pose {
        Pose {
            position_m: DVec3::new(125.0 * (time_s - 0.5), -5000.0, 1000.0),
            attitude: DQuat::IDENTITY,
        }
    }
}

fn main() {
    let uniform = |random: &mut ChaCha8Rng| random.next_u32() as f64 / 2f64.powi(32) - 0.5;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let side = 1000;
    // A lattice along the track with the radar's motion per pulse, 0.125 m.
    let points = (0..side * side)
        .map(|i| Scatterer {
            position_m: DVec3::new((i % side) as f64 * 0.125, (i / side) as f64 * 0.15, 0.0),
            amplitude: Complex64::new(uniform(&mut random), uniform(&mut random)),
        })
        .collect();
    let scene = Scene {
        points,
        ..Scene::default()
    };
    let antenna = Antenna {
        name: "antenna".into(),
        offset_m: DVec3::ZERO,
        boresight: DVec3::Y,
        up: DVec3::Z,
        pattern: Pattern::Isotropic,
        aim_m: None,
    };
    let view = |n: usize, motion| View {
        body: &Straight,
        transmitter: &antenna,
        receiver: &antenna,
        time_s: n as f64 * 1e-3,
        sweep: Sweep {
            start_hz: 9.9e9,
            step_hz: 200e6 / SAMPLES as f64,
            count: SAMPLES,
            start_s: 0.0,
            step_s: 0.8e-3 / SAMPLES as f64,
            residual_hz_s: 0.0,
        },
        reference_s: 2.0 * 5100.0 / 299_792_458.0,
        motion,
        spreading_from_m: None,
    };
    let sum = Engine::new(&scene, Method::Sum);
    let fast = Engine::new(&scene, Method::Fast);
    let views: Vec<View> = (0..10_000).map(|n| view(n, Motion::StopAndGo)).collect();
    let start = Instant::now();
    let recycled = Engine::for_track(&scene, Method::Fast, &views, 1 << 30);
    println!(
        "tables for 10,000 pulses: {:.2} s, recycles: {}",
        start.elapsed().as_secs_f64(),
        recycled.recycles()
    );
    let methods: [(&str, &Engine, Motion, usize); 4] = [
        ("sum", &sum, Motion::StopAndGo, 1),
        ("fast", &fast, Motion::StopAndGo, PULSES),
        ("recycled", &recycled, Motion::StopAndGo, PULSES),
        ("fast, true motion", &fast, Motion::True, PULSES),
    ];
    let mut seconds = vec![Vec::new(); methods.len()];
    let mut outs = vec![vec![Complex64::ZERO; SAMPLES]; methods.len()];
    let mut scratch = Scratch::default();
    for turn in 0..TURNS {
        for (i, (_, engine, motion, pulses)) in methods.iter().enumerate() {
            if i == 0 && turn > 0 {
                // The slowest method is measured once.
                let first = seconds[0][0];
                seconds[0].push(first);
                continue;
            }
            let start = Instant::now();
            for n in (0..*pulses).rev() {
                engine.pulse(&view(n, *motion), &mut scratch, &mut outs[i]);
            }
            seconds[i].push(start.elapsed().as_secs_f64() / *pulses as f64);
        }
    }
    println!(
        "method              ns per scatterer and pulse  ratio to sum   error dB   1e6 x 10,000, 2 cores"
    );
    for (i, (name, _, motion, _)) in methods.iter().enumerate() {
        let ratio = median(seconds[0].iter().zip(&seconds[i]).map(|(a, b)| a / b));
        let time = median(seconds[i].iter().copied());
        let error = error_db(&outs[i], &outs[0]);
        let error = if *motion == Motion::True {
            f64::NAN
        } else {
            error
        };
        println!(
            "{name:<20} {:>10.2} {ratio:>12.1} {error:>10.1} {:>10.0} s",
            time / scene.points.len() as f64 * 1e9,
            time * 10_000.0 / 2.0
        );
    }
}

fn error_db(z: &[Complex64], reference: &[Complex64]) -> f64 {
    let power = |z: &mut dyn Iterator<Item = Complex64>| z.map(|z| z.norm_sqr()).sum::<f64>();
    let error = power(&mut z.iter().zip(reference).map(|(a, b)| a - b));
    10.0 * (error / power(&mut reference.iter().copied())).log10()
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
