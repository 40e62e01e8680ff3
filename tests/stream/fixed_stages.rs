//! Integer sine and FFT.

use std::f64::consts::TAU;

use num_complex::{Complex, Complex64};
use subaperture_core::Turns;
use subaperture_core::fixed_point::{fft, sine};

use crate::fixed_scene::{Random, signal_to_error_db};

/// Bound in the module documentation: 2 units of `2^-30`.
#[test]
fn phasor_error_is_below_two_units() {
    let one = f64::from(sine::ONE);
    let mut worst = 0f64;
    for i in 0..1_000_003u64 {
        let turns = Turns(i.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let phasor = sine::phasor(turns);
        // At most half a turn, so that float64 resolves the argument to 2^-53 turns.
        let exact = Complex64::cis(TAU * (turns.0 as i64 as f64 / 2f64.powi(64)));
        let error = (f64::from(phasor.re) - one * exact.re)
            .abs()
            .max((f64::from(phasor.im) - one * exact.im).abs());
        worst = worst.max(error);
    }
    println!("worst part of a million phasors: {worst:.2} units of 2^-30");
    assert!(worst < 2.0);
    for index in 0..sine::POINTS {
        let point = sine::unit(index);
        let exact = Complex64::cis(TAU * index as f64 / sine::POINTS as f64) * one;
        // Rounded to nearest; float64 is correct to 2^-22 of a unit.
        assert!((f64::from(point.re) - exact.re).abs() < 0.500_001);
        assert!((f64::from(point.im) - exact.im).abs() < 0.500_001);
        assert_eq!(sine::phasor(Turns((index as u64) << 52)), point);
        assert_eq!(sine::unit(index + sine::POINTS), point);
    }
}

/// Transform of `input`, unscaled, and the same sum in float64.
fn transformed(input: &[Complex<i32>]) -> (Vec<Complex64>, Vec<Complex64>) {
    let length = input.len();
    let mut buffer = vec![Complex::new(0, 0); length];
    for (p, value) in input.iter().enumerate() {
        buffer[fft::place(p, length)] = *value;
    }
    let scale = 2f64.powi(fft::inverse(&mut buffer) as i32);
    let wide = |z: &Complex<i32>| Complex64::new(z.re.into(), z.im.into());
    let turns: Vec<_> = (0..length)
        .map(|i| Complex64::cis(TAU * i as f64 / length as f64))
        .collect();
    let exact = |q: usize| {
        let terms = input.iter().enumerate();
        terms.map(|(p, z)| wide(z) * turns[p * q % length]).sum()
    };
    (
        buffer.iter().map(|z| wide(z) * scale).collect(),
        (0..length).map(exact).collect(),
    )
}

/// White input of amplitude `2^31`: a stage rounds its input by shifts, and its products, by a unit RMS or less, while parts
/// are `2^25` RMS or more and below `2^28`: 150 dB per stage, at most 8 dB less for six. Amplitude `2^20`, RMS `2^19`,
/// before any stage needs to shift: 114 dB for the first stage with products; later ones, on larger parts, add less than
/// half of that in total.
/// products; later ones, on larger parts, add less than half of that between them.
#[test]
fn integer_fft_matches_dft_sum() {
    for log in 1..=12 {
        let length = 1usize << log;
        for (amplitude, least_db) in [(2147483647.0, 140.0), (1048576.0, 112.0)] {
            let mut random = Random(log);
            let mut part = || (random.uniform() * amplitude) as i32;
            let input: Vec<_> = (0..length).map(|_| Complex::new(part(), part())).collect();
            let (values, exact) = transformed(&input);
            let ratio_db = signal_to_error_db(&values, &exact);
            println!("{length} points, noise of {amplitude}: {ratio_db:.1} dB");
            assert!(ratio_db > least_db);
        }
        // The largest possible coherent sums, from either end of the range.
        for sign in [1.0, -1.0] {
            for turn in [0, 1, length / 3] {
                let corner = |p: usize| {
                    let angle_rad = -TAU * (p * turn) as f64 / length as f64 + 0.1;
                    let z = Complex64::cis(angle_rad) * sign;
                    let rail = |x: f64| if x < 0.0 { i32::MIN } else { i32::MAX };
                    Complex::new(rail(z.re), rail(z.im))
                };
                let input: Vec<_> = (0..length).map(corner).collect();
                let (values, exact) = transformed(&input);
                assert!(signal_to_error_db(&values, &exact) > 135.0);
            }
        }
    }
    for length in [0, 1, 3, 8192] {
        let mut buffer = vec![Complex::new(1, 2); length];
        assert_eq!(fft::inverse(&mut buffer), 0);
        assert!(buffer.iter().all(|z| *z == Complex::new(1, 2)));
    }
}
