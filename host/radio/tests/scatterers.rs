//! Joint estimation of point scatterers, against written-out responses.

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use subaperture_radio::profile::Sweep;
use subaperture_signal::window::Window;

const COUNT: usize = 50;
const START_HZ: f64 = 1.1e9;
const STEP_HZ: f64 = 4e6;
const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// Response of points, each with range and amplitude, with white noise of variance `noise`.
fn response(points: &[(f64, f64)], noise: f64, seed: u64) -> Sweep {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let values = (0..COUNT).map(|n| {
        let frequency_hz = START_HZ + n as f64 * STEP_HZ;
        let echoes: Complex64 = (points.iter())
            .map(|(range_m, amplitude)| {
                let turn =
                    -4.0 * std::f64::consts::PI * frequency_hz * range_m / SPEED_OF_LIGHT_M_S;
                Complex64::from_polar(*amplitude, turn)
            })
            .sum();
        Some(echoes + Complex64::new(normal(), normal()) * (noise / 2.0).sqrt())
    });
    Sweep {
        start_hz: START_HZ,
        step_hz: STEP_HZ,
        values: values.collect(),
        times_s: vec![0.0; COUNT],
    }
}

/// The objects of Chim 2018, 5.6, with the amplitudes of Fig. 5.12: the peak of the second is displaced by the side lobes of the others.
const THESIS: [(f64, f64); 3] = [(1.0, 8.0), (6.3, 1.9), (16.0, 1.0)];

#[test]
fn joint_estimate_has_no_bias_by_side_lobes() {
    let sweep = response(&THESIS, 0.0, 1);
    let peaks = sweep.profile(Window::None, 16, 30.0).unwrap().peaks(1.0);
    let nearest = peaks.iter().map(|peak| (peak.range_m - 6.3).abs());
    let displaced_m = nearest.fold(f64::INFINITY, f64::min);
    println!("peak displaced by {displaced_m:.3} m");
    assert!(displaced_m > 0.02);
    let found = sweep.scatterers(40.0, 30.0).unwrap();
    assert_eq!(found.len(), 3, "{found:?}");
    for (one, (range_m, amplitude)) in found.iter().zip(THESIS) {
        // The sum is exact to 1e-15 of the largest amplitude; the adjustment converges to a billionth of a cell.
        assert!((one.range_m - range_m).abs() < 1e-8, "{one:?}");
        assert!(
            (one.amplitude - amplitude).norm() < 1e-6 * amplitude,
            "{one:?}"
        );
    }
}

/// Errors of 400 sweeps at random noise: RMS within the Cramer-Rao bound and its sampling error, and 95 % within the stated
/// interval. The bound of one echo is `c / (4 pi) sqrt(s^2 / (2 a^2 sum (f_n - f_c)^2))`; the echoes are many cells apart.
#[test]
fn errors_agree_with_the_stated_deviations() {
    const SWEEPS: u64 = 400;
    let noise = 0.05;
    let mut squares = [0.0; 3];
    let mut inside = 0;
    for seed in 0..SWEEPS {
        let found = response(&THESIS, noise, seed)
            .scatterers(30.0, 30.0)
            .unwrap();
        assert_eq!(found.len(), 3, "{found:?}");
        for ((one, (range_m, _)), square) in found.iter().zip(THESIS).zip(&mut squares) {
            let off_m = one.range_m - range_m;
            *square += off_m * off_m / SWEEPS as f64;
            inside += u32::from(off_m.abs() <= 1.96 * one.sigma_m);
        }
    }
    let middle = (COUNT as f64 - 1.0) / 2.0;
    let spread: f64 = (0..COUNT)
        .map(|n| ((n as f64 - middle) * STEP_HZ).powi(2))
        .sum();
    for (square, (range_m, amplitude)) in squares.iter().zip(THESIS) {
        let bound_m = SPEED_OF_LIGHT_M_S / (4.0 * std::f64::consts::PI)
            * (noise / (2.0 * amplitude * amplitude * spread)).sqrt();
        let ratio = square.sqrt() / bound_m;
        println!(
            "{range_m} m: {:.2} mm, {ratio:.3} of the bound",
            1e3 * square.sqrt()
        );
        // The deviation of 400 samples has a standard deviation of 3.5 %; the other echoes raise the bound by a few per cent.
        assert!((0.88..1.16).contains(&ratio));
    }
    let share = f64::from(inside) / (3 * SWEEPS) as f64;
    println!("{share:.3} within 1.96 standard deviations");
    // Three standard deviations of 1200 outcomes: 1.9 %; Student's t of 47 degrees of freedom: 0.4 %.
    assert!((0.925..0.97).contains(&share));
}

/// 1000 sweeps of noise: a false scatterer in 0.1 % of them; more than 7 have a probability below 1e-4 (Poisson).
#[test]
fn noise_has_no_scatterers() {
    let has_any = |seed: &u64| {
        !response(&[], 1.0, 1000 + seed)
            .scatterers(60.0, 37.0)
            .unwrap()
            .is_empty()
    };
    let count = (0..1000).filter(has_any).count();
    println!("{count} of 1000");
    assert!(count <= 7);
}

/// Carriers that were skipped leave the estimate exact.
#[test]
fn missing_carriers_cause_no_bias() {
    let mut sweep = response(&THESIS, 0.0, 2);
    for n in [3, 4, 5, 17, 30, 31, 48] {
        sweep.values[n] = None;
    }
    let found = sweep.scatterers(40.0, 30.0).unwrap();
    assert_eq!(found.len(), 3, "{found:?}");
    for (one, (range_m, _)) in found.iter().zip(THESIS) {
        assert!((one.range_m - range_m).abs() < 1e-8, "{one:?}");
    }
}

/// An echo that arrives before the reference, and one beyond the reach: both are stated before range zero.
#[test]
fn echoes_beyond_the_reach_have_negative_ranges() {
    let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * STEP_HZ);
    let sweep = response(&[(-2.0, 1.0), (6.3, 0.5), (31.0, 0.4)], 0.0, 3);
    let found = sweep.scatterers(40.0, 30.0).unwrap();
    let expected = [(31.0 - unambiguous_m, 0.4), (-2.0, 1.0), (6.3, 0.5)];
    assert_eq!(found.len(), 3, "{found:?}");
    for (one, (range_m, amplitude)) in found.iter().zip(expected) {
        assert!((one.range_m - range_m).abs() < 1e-8, "{one:?}");
        assert!((one.amplitude.norm() - amplitude).abs() < 1e-6, "{one:?}");
    }
    assert!((found[1].amplitude - 1.0).norm() < 1e-6, "{found:?}");
}
