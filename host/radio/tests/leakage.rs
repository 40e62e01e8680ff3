//! Phase estimation with a leakage reference, against known phases. Responses are sums written out, with random phases.

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
/// Unambiguous range 18.74 m; half of it is 9.37 m.
const STEP_HZ: f64 = 8e6;
const REACH_M: f64 = 8.0;
/// Direct delays to antennas 20 cm and 30.7 cm from the transmit antenna.
const DIRECT_S: [f64; 2] = [0.2 / LIGHT_M_S, 0.307 / LIGHT_M_S];

fn turn(turns: f64) -> Complex64 {
    let (sin, cos) = (TAU * (turns - turns.round())).sin_cos();
    Complex64::new(cos, sin)
}

fn frequency_hz(n: usize) -> f64 {
    START_HZ + n as f64 * STEP_HZ
}

struct Scene {
    /// Half path lengths to both receivers, metres, and amplitudes.
    echoes: Vec<([f64; 2], Complex64)>,
    leakage: [Complex64; 2],
    noise: f64,
    missing: &'static [usize],
}

/// Four echoes with a total amplitude of `sqrt(1 + 0.49 + 0.25 + 0.16)`, leakage `over_db` above them, receivers with
/// different gains and phases, 40 dB signal-to-noise ratio.
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
    /// Echo response of receiver `i` at carrier `n`.
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
                // Complex noise of variance 1.
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

    /// Error of the estimated responses relative to the echoes in dB, phase included; both divided by the leakage of
    /// each receiver.
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

/// Five random seeds each. An SNR of 40 dB gives an error of -40 dB, and up to 12 dB more at the band edges, where the
/// covariance constrains echoes least. With every seventh carrier missing, all carriers are near an edge: another 6 dB.
#[test]
fn leakage_reference_recovers_known_echoes() {
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
                let estimated_db = 10.0 * found.over_echoes.log10();
                // The RMS of the sum of four echoes over 75 carriers differs slightly from the sum of their powers; the
                // second receiver has more leakage.
                assert!(
                    (estimated_db - over_db - 1.3).abs() < 1.0,
                    "{estimated_db} {over_db}"
                );
                assert!(found.unexplained < 2e-4, "{}", found.unexplained);
            }
            println!("{over_db} dB, {} missing: {worst_db:.1} dB", missing.len());
            let bound_db = if missing.is_empty() { -28.0 } else { -22.0 };
            assert!(worst_db < bound_db, "{over_db}: {worst_db}");
        }
    }
}

/// With the phase of receiver 0 alone, each echo has an equally strong mirror image before the leakage, and both have
/// half its amplitude. Joint estimation of phases and echoes removes the image.
#[test]
fn joint_phase_estimation_removes_mirror_image_of_single_receiver_phase() {
    let one = Scene {
        echoes: vec![([4.02, 3.98], turn(0.3) * 0.1)],
        noise: 0.0,
        ..scene(0.0)
    };
    let steps = one.steps(1);
    // Echoes divided by the leakage with the phase of receiver 0: only the magnitude of its value remains.
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
    // The echo is 0.07 of the leakage; second-order terms are about 0.3 dB.
    assert!(halves.iter().all(|db| (db + 6.02).abs() < 0.5));
    assert!(whole[0].abs() < 0.1 && whole[1] < -40.0);
}

#[test]
fn unusable_leakage_is_refused_with_reason() {
    let refused = |scene: &Scene, words: &str| {
        let error = solved(scene, 1).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(&scene(-3.0), "expected at least 3 dB for a reference");
    // An echo from 12 m, beyond the stated reach of 8 m, appears mirrored.
    let mut far = scene(20.0);
    far.echoes.push(([12.0, 12.05], Complex64::ONE));
    refused(&far, "no phases explain both receivers");
    // The direct path of one receiver is stated 20 cm too long.
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
    assert!(beyond.unwrap_err().to_string().contains("mirror images"));
}

/// An empty scene is not an error: there are no echoes to explain.
#[test]
fn empty_scene_is_accepted() {
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
    // Noise 40 dB below 1.9, leakage 30 dB above it.
    assert!((10.0 * (power / COUNT as f64).log10() + 70.0).abs() < 4.0);
}
