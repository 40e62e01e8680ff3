//! Phases by the leakage, against phases that are known here: responses are sums written out, turned at random.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_radio::profile::leakage::{Found, Leakage, Solver};
use subaperture_radio::profile::{ProfileError, Steps, Sweep};
use subaperture_radio::tone::Mixed;

use crate::profile::WINDOW;

const LIGHT_M_S: f64 = 299_792_458.0;
const COUNT: usize = 75;
const START_HZ: f64 = 1.1e9;
/// 18.74 m are told apart, half of which are 9.37 m.
const STEP_HZ: f64 = 8e6;
const REACH_M: f64 = 8.0;
/// Of antennas 20 cm and 30.7 cm from the one that sends.
const DIRECT_S: [f64; 2] = [0.2 / LIGHT_M_S, 0.307 / LIGHT_M_S];

fn turn(turns: f64) -> Complex64 {
    let (sin, cos) = (TAU * (turns - turns.round())).sin_cos();
    Complex64::new(cos, sin)
}

fn frequency_hz(n: usize) -> f64 {
    START_HZ + n as f64 * STEP_HZ
}

struct Scene {
    /// Half of the ways to both receivers, metres, and amplitudes.
    echoes: Vec<([f64; 2], Complex64)>,
    leakage: [Complex64; 2],
    noise: f64,
    missing: &'static [usize],
}

/// Four echoes; leakage `over_db` over them together, which are `sqrt(1 + 0.49 + 0.25 + 0.16)` of 1, by receivers of different gains and phases; 40 dB over noise.
fn scene(over_db: f64) -> Scene {
    let all = 1.9f64.sqrt();
    let leakage = all * 10f64.powf(over_db / 20.0);
    Scene {
        echoes: vec![
            ([2.31, 2.35], turn(0.1)),
            ([4.02, 3.98], turn(0.7) * 0.7),
            ([5.77, 5.79], turn(0.4) * 0.5),
            ([7.11, 7.07], turn(0.9) * 0.4),
        ],
        leakage: [turn(0.2) * leakage, turn(0.66) * leakage * 1.3],
        noise: 0.01 * all,
        missing: &[],
    }
}

impl Scene {
    /// Receiver `i`'s echoes at carrier `n`.
    fn echo(&self, i: usize, n: usize) -> Complex64 {
        let one = |(half_m, amplitude): &([f64; 2], Complex64)| {
            amplitude * turn(-frequency_hz(n) * 2.0 * half_m[i] / LIGHT_M_S)
        };
        self.echoes.iter().map(one).sum()
    }

    fn steps(&self, seed: u64) -> Steps {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let mixed = (0..COUNT).map(|n| {
            let phase = turn(uniform());
            let z = [0, 1].map(|i| {
                let (a, b) = (1.0 - uniform(), uniform());
                // Both parts together of variance 1.
                let noise = turn(b) * (-a.ln()).sqrt() * self.noise;
                let direct = self.leakage[i] * turn(-frequency_hz(n) * DIRECT_S[i]);
                (direct + self.echo(i, n)) * phase + noise
            });
            (!self.missing.contains(&n)).then_some(Mixed {
                value: z[1] / z[0],
                unreferred: z[1],
                variance: 2.0 * self.noise * self.noise / z[0].norm_sqr(),
                reference: z[0].norm(),
                whole: 1.0,
                unsteady: 0.0,
            })
        });
        Steps {
            start_hz: START_HZ,
            step_hz: STEP_HZ,
            mixed: mixed.collect(),
            times_s: vec![0.0; COUNT],
        }
    }

    /// Error of what was found, dB of the echoes, phase included: of those over the leakage of each receiver.
    fn error_db(&self, sweeps: &[Sweep; 2]) -> f64 {
        let (mut error, mut power) = (0.0, 0.0);
        for (i, sweep) in sweeps.iter().enumerate() {
            for (n, value) in sweep.values.iter().enumerate() {
                let Some(value) = value else { continue };
                let expected = self.echo(i, n) / self.leakage[i];
                error += (value - expected).norm_sqr();
                power += expected.norm_sqr();
            }
        }
        10.0 * (error / power).log10()
    }
}

fn solver() -> Solver {
    let leakage = Leakage {
        delays_s: DIRECT_S,
        shapes: None,
    };
    Solver::new(leakage, STEP_HZ, COUNT, REACH_M).unwrap()
}

fn solved(scene: &Scene, seed: u64) -> Result<Found, ProfileError> {
    solver().solve(&scene.steps(seed))
}

/// Of ten noises and phases: 40 dB over noise leave -40 dB, and up to 12 dB more at the edges of the band, where covariances bound echoes least. With every seventh
/// carrier missing, edges are everywhere: another 6 dB.
#[test]
fn echoes_are_those_of_phases_that_are_known() {
    for over_db in [30.0, 10.0, 4.0] {
        for missing in [
            &[] as &[usize],
            &[3, 10, 17, 24, 31, 38, 45, 52, 59, 66, 73],
        ] {
            let mut worst_db = f64::NEG_INFINITY;
            for seed in 0..5 {
                let scene = Scene {
                    missing,
                    ..scene(over_db)
                };
                let found = solved(&scene, seed).unwrap();
                worst_db = worst_db.max(scene.error_db(&found.sweeps));
                let told_db = 10.0 * found.over_echoes.log10();
                // RMS of four echoes' sum over 75 carriers is not quite that of their powers; the second receiver hears more.
                assert!((told_db - over_db - 1.3).abs() < 1.0, "{told_db} {over_db}");
                assert!(found.unexplained < 2e-4, "{}", found.unexplained);
            }
            println!("{over_db} dB, {} missing: {worst_db:.1} dB", missing.len());
            let bound_db = if missing.is_empty() { -28.0 } else { -22.0 };
            assert!(worst_db < bound_db, "{over_db}: {worst_db}");
        }
    }
}

/// By the phase of receiver 0 alone each echo has an image as strong before the leakage, and both are half of it; by phases found with the echoes the image is gone.
#[test]
fn the_phase_of_one_receiver_mirrors_the_scene_and_phases_found_with_it_do_not() {
    let one = Scene {
        echoes: vec![([4.02, 3.98], turn(0.3) * 0.1)],
        noise: 0.0,
        ..scene(0.0)
    };
    let steps = one.steps(1);
    // Echoes over the leakage by the phase of receiver 0: the magnitude alone is left of it.
    let mean = steps
        .mixed
        .iter()
        .flatten()
        .map(|it| it.reference)
        .sum::<f64>()
        / COUNT as f64;
    let by_phase = Sweep {
        start_hz: START_HZ,
        step_hz: STEP_HZ,
        values: steps
            .mixed
            .iter()
            .enumerate()
            .map(|(n, it)| {
                it.map(|it| (it.reference / mean - 1.0) * turn(-frequency_hz(n) * DIRECT_S[0]))
            })
            .collect(),
        times_s: vec![0.0; COUNT],
    };
    let found = solver().solve(&steps).unwrap();
    let direct_m = 0.1;
    let unambiguous_m = 0.5 * LIGHT_M_S / STEP_HZ;
    let expected = (one.echoes[0].1 / one.leakage[0]).norm();
    let read = |sweep: &Sweep, range_m: f64| {
        let profile = sweep.profile(WINDOW, 24, unambiguous_m).unwrap();
        let place = (range_m / profile.spacing_m).round() as usize;
        20.0 * (profile.values[place].norm() / expected).log10()
    };
    let mirrored_m = unambiguous_m + 2.0 * direct_m - 4.02;
    let halves = [4.02, mirrored_m].map(|range_m| read(&by_phase, range_m));
    let whole = [4.02, mirrored_m].map(|range_m| read(&found.sweeps[0], range_m));
    println!("by one receiver's phase {halves:.2?} dB, found {whole:.2?} dB");
    // 0.07 of the leakage: of second order are some 0.3 dB.
    assert!(halves.iter().all(|db| (db + 6.02).abs() < 0.5));
    assert!(whole[0].abs() < 0.1 && whole[1] < -40.0);
}

#[test]
fn what_is_no_reference_is_refused_with_the_reason() {
    let refused = |scene: &Scene, words: &str| {
        let error = solved(scene, 1).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(&scene(-3.0), "takes 3 dB to be a reference");
    // An echo from 12 m, of 8 that were told: it looks mirrored.
    let mut far = scene(20.0);
    far.echoes.push(([12.0, 12.05], Complex64::ONE));
    refused(&far, "no phases explain both receivers");
    // Antennas that are told 20 cm too near in one receiver.
    let leakage = Leakage {
        delays_s: [DIRECT_S[0], DIRECT_S[1] + 0.2 / LIGHT_M_S],
        shapes: None,
    };
    let mut wrong = Solver::new(leakage, STEP_HZ, COUNT, REACH_M).unwrap();
    let error = wrong.solve(&scene(20.0).steps(1)).unwrap_err().to_string();
    assert!(error.contains("calibrate"), "{error}");
    let few = Scene {
        missing: &[
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23,
            24, 25,
        ],
        ..scene(20.0)
    };
    refused(&few, "49 of 75 steps");
    let beyond = Solver::new(
        Leakage {
            delays_s: DIRECT_S,
            shapes: None,
        },
        STEP_HZ,
        COUNT,
        9.4,
    );
    assert!(beyond.unwrap_err().to_string().contains("look as mirrored"));
}

/// Nothing but noise to see is no fault: an empty scene has no echoes.
#[test]
fn a_scene_of_nothing_is_one() {
    let nothing = Scene {
        echoes: vec![],
        ..scene(30.0)
    };
    let found = solved(&nothing, 3).unwrap();
    let power: f64 = found.sweeps[0]
        .values
        .iter()
        .flatten()
        .map(|z| z.norm_sqr())
        .sum();
    // Noise of 40 dB below 1.9, leakage of 30 dB above that.
    assert!((10.0 * (power / COUNT as f64).log10() + 70.0).abs() < 4.0);
}
