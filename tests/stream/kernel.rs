//! Interpolation of maps between bins, and the track nodes that maps are read at.

use std::f64::consts::TAU;

use num_complex::Complex64;
use subaperture_core::Pulse;
use subaperture_core::accumulate::{ChipKernel, Kernel};
use subaperture_core::stream::{Node, nodes};

/// Worst and RMS error of interpolating `exp(j 2 pi nu x)`, `|nu| <= 1/4`, anywhere between two bins.
fn error_db<const TAPS: usize>(weights: impl Fn(f32) -> [f32; TAPS]) -> (f64, f64) {
    let (mut worst, mut sum, mut count) = (0f64, 0.0, 0.0);
    for i in 0..=300 {
        let t = f64::from(i) / 300.0;
        let weights = weights(t as f32);
        for j in 0..=100 {
            let nu = f64::from(j) / 400.0;
            let read: Complex64 = weights
                .iter()
                .enumerate()
                .map(|(i, weight)| {
                    let bin = i as f64 + 1.0 - (TAPS / 2) as f64;
                    f64::from(*weight) * Complex64::cis(TAU * nu * bin)
                })
                .sum();
            let error = (read - Complex64::cis(TAU * nu * t)).norm_sqr();
            worst = worst.max(error);
            sum += error;
            count += 1.0;
        }
    }
    (10.0 * worst.log10(), 10.0 * (sum / count).log10())
}

/// Kaiser's design formula gives ripples of `-(7.95 + 2.285 pi T)` dB. Over all spectral images of a wave at the edge of the
/// band they add up to several times that, and in the mean over the band to about that. The bounds are the figures in the
/// module's table, rounded up.
#[test]
fn kernel_errors_match_stated_figures() {
    let cases = [
        (
            6,
            error_db(|t| Kernel::<6, 128>::new().weights(t)),
            -42.3,
            -53.4,
        ),
        (
            8,
            error_db(|t| Kernel::<8, 128>::new().weights(t)),
            -57.0,
            -66.8,
        ),
        (
            10,
            error_db(|t| Kernel::<10, 128>::new().weights(t)),
            -71.2,
            -80.0,
        ),
    ];
    for (taps, (worst, rms), worst_bound, rms_bound) in cases {
        let theory = -(7.95 + 2.285 * TAU / 2.0 * f64::from(taps));
        println!("{taps} taps: worst {worst:.1} dB, RMS {rms:.1} dB, Kaiser {theory:.1} dB");
        assert!(worst < worst_bound && rms < rms_bound);
        assert!((rms - theory).abs() < 3.0);
    }
    let (worst, rms) = error_db(|t| ChipKernel::new().weights(t));
    println!("chip kernel: worst {worst:.1} dB, RMS {rms:.1} dB");
    assert!(rms < -79.7);
    let (worst, rms) = error_db(|t| [1.0 - t, t]);
    println!("bilinear, one axis: worst {worst:.1} dB, RMS {rms:.1} dB");
    // Midway between two bins cos(pi / 4) results instead of 1.
    assert!((worst - 20.0 * (1.0 - 0.5f64.sqrt()).log10()).abs() < 0.1);
    // Few phases, h = 1/8 apart: linear interpolation of a wave has the error (2 pi nu)^2 h^2 t (1 - t) / 2. The RMS of
    // nu^2 within the band is 1/16 / sqrt 5, that of t (1 - t) 1 / sqrt 30: -56.1 dB.
    let (_, coarse) = error_db(|t| Kernel::<10, 9>::new().weights(t));
    let theory = TAU * TAU / 16.0 / 5f64.sqrt() / 64.0 / 2.0 / 30f64.sqrt();
    println!("10 taps, 9 phases: RMS {coarse:.1} dB");
    assert!((coarse - 20.0 * theory.log10()).abs() < 0.3);
}

/// Least-squares quadratic by the normal equations in `m`, at `u = -u_g` and `u_g`.
fn quadratic_at_nodes(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mut equations = [[0.0f64; 4]; 3];
    for (m, value) in values.iter().enumerate() {
        let x = m as f64 / n;
        let powers = [1.0, x, x * x];
        for (equation, p) in equations.iter_mut().zip(powers) {
            for (sum, q) in equation.iter_mut().zip([1.0, x, x * x, *value]) {
                *sum += p * q;
            }
        }
    }
    for i in 0..3 {
        let pivot = equations[i];
        for (j, equation) in equations.iter_mut().enumerate() {
            if i != j {
                let factor = equation[i] / pivot[i];
                for (a, b) in equation.iter_mut().zip(pivot) {
                    *a -= factor * b;
                }
            }
        }
    }
    let c = [0, 1, 2].map(|i| equations[i][3] / equations[i][i]);
    let offset = ((n * n - 1.0) / 12.0).sqrt();
    [-offset, offset].map(|u| {
        let x = ((n - 1.0) / 2.0 + u) / n;
        c[0] + c[1] * x + c[2] * x * x
    })
}

/// Any track, not only quadratic ones, against the normal equations, whose condition of about 1e3 leaves 1e-12 of metres; and
/// far from the origin, where a position itself is rounded to half of 9e-10 m and so is the result.
#[test]
fn track_nodes_lie_on_fitted_quadratic() {
    for count in [3, 4, 5, 12, 31] {
        let near = |m: usize| {
            let t = m as f64;
            [
                (3.0 * t).sin() + 0.2 * t,
                (0.1 * t).exp(),
                -0.3 * t * t + (7.0 * t).cos(),
            ]
        };
        let track = |far_m: f64| -> Vec<Pulse> {
            (0..count)
                .map(|m| Pulse {
                    transmitter_m: near(m).map(|x| x + far_m),
                    receiver_m: near(m + 50).map(|x| 2.0 * x - far_m),
                    ..Pulse::EMPTY
                })
                .collect()
        };
        for axis in 0..3 {
            let axis_of = |m: usize| near(m)[axis];
            let transmitter: Vec<f64> = (0..count).map(axis_of).collect();
            let receiver: Vec<f64> = (50..50 + count).map(|m| 2.0 * axis_of(m)).collect();
            let scale = receiver.iter().fold(1f64, |most, x| most.max(x.abs()));
            for (far_m, tolerance) in [(0.0, 1e-11 * scale), (7e6, 4e-9)] {
                let found = nodes(&track(far_m));
                let t = quadratic_at_nodes(&transmitter);
                let r = quadratic_at_nodes(&receiver);
                for i in 0..2 {
                    let t_error = found[i].transmitter_m[axis] - far_m - t[i];
                    let r_error = found[i].receiver_m[axis] + far_m - r[i];
                    assert!(t_error.abs() < tolerance, "{count}, {far_m}: {t_error:e}");
                    assert!(r_error.abs() < tolerance, "{count}, {far_m}: {r_error:e}");
                }
            }
        }
    }
}

#[test]
fn track_nodes_of_one_and_two_pulses() {
    assert_eq!(nodes(&[]), [Node::default(); 2]);
    let at = |x: f64| Pulse {
        transmitter_m: [x, 1.0, 2.0],
        receiver_m: [-x, 1e7, 0.0],
        ..Pulse::EMPTY
    };
    let one = Node {
        transmitter_m: [4.0, 1.0, 2.0],
        receiver_m: [-4.0, 1e7, 0.0],
    };
    assert_eq!(nodes(&[at(4.0)]), [one; 2]);
    // Two pulses: u_g = 1/2, so the nodes are the pulses.
    let [early, late] = nodes(&[at(4.0), at(7.0)]);
    assert_eq!(
        (early.transmitter_m, late.receiver_m),
        ([4.0, 1.0, 2.0], [-7.0, 1e7, 0.0])
    );
    // NaN stays NaN and does not affect the rest.
    let bad = nodes(&[at(f64::NAN), at(1.0), at(f64::INFINITY)]);
    assert!(bad[0].transmitter_m[0].is_nan() && bad[0].transmitter_m[1] == 1.0);
}
