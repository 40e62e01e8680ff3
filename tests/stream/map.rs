//! Map of the core's plan against a float64 evaluation of its defining sums, written from the definitions alone: no code of the
//! core is used except the code under test.

use std::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};
use subaperture_core::keystone::KeystoneTable;
use subaperture_core::{Params, Plan, Shape, Tables, Window};

/// Single precision reaches about -125 dB; an error of the method would not.
const BOUND_DB: f64 = -100.0;

#[derive(Clone, Copy)]
enum Form {
    Sinc,
    ChirpZ,
}

struct Case {
    shape: Shape,
    start_hz: f64,
    step_hz: f64,
    fast: Vec<f32>,
    slow: Vec<f32>,
    /// `[pulse][frequency]`
    samples: Vec<Vec<Complex32>>,
}

/// Uniform in [-1, 1): Marsaglia's xorshift64.
fn uniform(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl Case {
    /// Noise samples and uneven weights: no symmetry that could hide an error.
    fn noise(m: usize, f: usize, r: usize, d: usize, start_hz: f64, step_hz: f64) -> Self {
        let mut state = (m * 1_000_003 + f * 1009 + r + d) as u64;
        let mut weights = |n| -> Vec<f32> {
            (0..n)
                .map(|_| (1.0 + 0.5 * uniform(&mut state)) as f32)
                .collect()
        };
        let (fast, slow) = (weights(f), weights(m));
        let mut sample = || Complex64::new(uniform(&mut state), uniform(&mut state));
        let samples = (0..m)
            .map(|_| {
                (0..f)
                    .map(|_| sample())
                    .map(|z| Complex32::new(z.re as f32, z.im as f32))
                    .collect()
            })
            .collect();
        let shape = Shape {
            num_pulses: m,
            num_frequencies: f,
            num_range_bins: r,
            num_doppler_bins: d,
        };
        Self {
            shape,
            start_hz,
            step_hz,
            fast,
            slow,
            samples,
        }
    }

    fn core_map(&self, form: Form) -> Vec<Complex32> {
        self.core_map_in(form, Complex32::ZERO)
    }

    /// Map formed in buffers that contain `before` everywhere.
    fn core_map_in(&self, form: Form, before: Complex32) -> Vec<Complex32> {
        let shape = self.shape;
        let params = Params {
            start_hz: self.start_hz,
            step_hz: self.step_hz,
            fast_window: Window::Weights(&self.fast),
            slow_window: Window::Weights(&self.slow),
        };
        let mut matrix = vec![0.0; shape.sinc_len()];
        let (mut fast, mut slow) = (
            vec![0.0; shape.num_frequencies],
            vec![0.0; shape.num_pulses],
        );
        let keystone = match form {
            Form::Sinc => KeystoneTable::Sinc(&mut matrix),
            Form::ChirpZ => KeystoneTable::ChirpZ {
                length: shape.chirp_length(),
            },
        };
        let tables = Tables {
            fast_weights: &mut fast,
            slow_weights: &mut slow,
            keystone,
        };
        let plan = Plan::new(shape, &params, tables).unwrap();
        let mut history = vec![before; shape.history_len()];
        let mut scratch = vec![before; plan.scratch_len()];
        let mut map = vec![before; shape.map_len()];
        for (m, pulse) in self.samples.iter().enumerate() {
            plan.window(m, pulse, &mut history).unwrap();
        }
        plan.process(&history, &mut scratch, &mut map).unwrap();
        map
    }

    /// Defining sum: Doppler first, frequency by frequency, then range, in the order of fewer terms, each term evaluated
    /// separately.
    fn oracle(&self, form: Form) -> Vec<Complex64> {
        let Shape {
            num_pulses,
            num_frequencies,
            num_range_bins,
            num_doppler_bins,
        } = self.shape;
        let centred = |i: usize, n: usize| i as f64 - (n / 2) as f64;
        let reference_hz = self.start_hz + (num_frequencies / 2) as f64 * self.step_hz;
        let sum = |w: &[f32]| w.iter().map(|&x| f64::from(x)).sum::<f64>();
        let scale = 1.0 / (sum(&self.fast) * sum(&self.slow));
        let mut map = vec![Complex64::ZERO; num_doppler_bins * num_range_bins];
        for k in 0..num_frequencies {
            let ratio = (self.start_hz + k as f64 * self.step_hz) / reference_hz;
            let windowed = |m: usize| {
                let z = self.samples[m][k];
                Complex64::new(z.re.into(), z.im.into())
                    * f64::from(self.fast[k])
                    * f64::from(self.slow[m])
            };
            // Slow-time samples and the scale of their phase.
            let (pulses, scaled): (Vec<Complex64>, f64) = match form {
                Form::ChirpZ => ((0..num_pulses).map(windowed).collect(), ratio),
                Form::Sinc => {
                    let at = |i: usize| -> Complex64 {
                        let t = centred(i, num_pulses) / ratio + (num_pulses / 2) as f64;
                        (0..num_pulses)
                            .map(|m| windowed(m) * sinc(t - m as f64))
                            .sum()
                    };
                    ((0..num_pulses).map(at).collect(), 1.0)
                }
            };
            for d in 0..num_doppler_bins {
                let doppler = centred(d, num_doppler_bins) / num_doppler_bins as f64 * scaled;
                let value: Complex64 = pulses
                    .iter()
                    .enumerate()
                    .map(|(m, z)| z * Complex64::cis(-TAU * centred(m, num_pulses) * doppler))
                    .sum();
                for r in 0..num_range_bins {
                    let turns = centred(k, num_frequencies) * centred(r, num_range_bins)
                        / num_range_bins as f64;
                    map[d * num_range_bins + r] += value * scale * Complex64::cis(TAU * turns);
                }
            }
        }
        map
    }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

/// Relative RMS error in dB, phase included.
fn error_db<T: Copy + Into<Complex64>>(map: &[T], reference: &[Complex64]) -> f64 {
    assert_eq!(map.len(), reference.len());
    let error: f64 = map
        .iter()
        .zip(reference)
        .map(|(&a, b)| (a.into() - b).norm_sqr())
        .sum();
    let power: f64 = reference.iter().map(Complex64::norm_sqr).sum();
    10.0 * (error / power).log10()
}

fn widen(map: &[Complex32]) -> Vec<Complex64> {
    map.iter()
        .map(|z| Complex64::new(z.re.into(), z.im.into()))
        .collect()
}

/// Odd and even sizes, exact fits, degenerate cases, a 40 % band, and the sizes of GOTCHA.
fn cases() -> Vec<Case> {
    vec![
        Case::noise(32, 64, 128, 64, 9.9e9, 3.125e6),
        Case::noise(31, 63, 64, 32, 9.9e9, 3.125e6),
        Case::noise(13, 7, 64, 128, 1.0e9, 60.0e6),
        Case::noise(16, 16, 16, 16, 77.0e9, 100.0e6),
        Case::noise(1, 5, 8, 4, 1.0e9, 1.0e6),
        Case::noise(4, 1, 2, 4, 1.0e9, 1.0e6),
        Case::noise(2, 2, 2, 2, 1.0e6, 0.9e6),
        Case::noise(130, 20, 32, 512, 9.9e9, 10.0e6),
        Case::noise(39, 424, 1024, 128, 9.288e9, 1.471e6),
    ]
}

#[test]
fn chirp_z_keystone_map_matches_defining_sum() {
    for case in cases() {
        let error = error_db(
            &widen(&case.core_map(Form::ChirpZ)),
            &case.oracle(Form::ChirpZ),
        );
        println!("chirp-z {:?}: {error:.1} dB", case.shape);
        assert!(error <= BOUND_DB, "{:?}: {error} dB", case.shape);
    }
}

#[test]
fn sinc_keystone_map_matches_its_defining_sum() {
    for case in cases() {
        let reference = case.oracle(Form::Sinc);
        let error = error_db(&widen(&case.core_map(Form::Sinc)), &reference);
        println!("sinc {:?}: {error:.1} dB", case.shape);
        assert!(error <= BOUND_DB, "{:?}: {error} dB", case.shape);
    }
}

/// A map does not depend on the previous contents of its buffers, not even on NaN.
#[test]
fn map_is_independent_of_buffer_contents() {
    let bits = |map: Vec<Complex32>| -> Vec<[u32; 2]> {
        map.iter()
            .map(|z| [z.re.to_bits(), z.im.to_bits()])
            .collect()
    };
    let spoilt = Complex32::new(f32::NAN, f32::INFINITY);
    for case in [
        Case::noise(5, 6, 8, 8, 1.0e9, 1.0e6),
        Case::noise(31, 63, 64, 32, 9.9e9, 3.125e6),
    ] {
        for form in [Form::Sinc, Form::ChirpZ] {
            let clean = bits(case.core_map(form));
            assert!(bits(case.core_map_in(form, spoilt)) == clean);
        }
    }
}

/// Difference between the sinc and the exact keystone on scatterers as observed by a radar (Doppler within a quarter of the
/// PRF), as stated in the module documentation. 200 MHz at 10 GHz, with a Hamming window in slow time or
/// none.
#[test]
fn sinc_keystone_differs_from_exact_at_edges_as_documented() {
    for (hamming, low_db, high_db) in [(false, -45.0, -25.0), (true, -70.0, -40.0)] {
        let mut case = Case::noise(32, 64, 64, 64, 9.9e9, 3.125e6);
        let (m_count, f_count) = (32, 64);
        case.fast = vec![1.0; f_count];
        case.slow = (0..m_count)
            .map(|i| {
                let u = (i as f64 + 0.5) / m_count as f64 - 0.5;
                let taper = 0.46 * f64::from(u8::from(hamming));
                (1.0 - taper + taper * (TAU * u).cos()) as f32
            })
            .collect();
        let scatterers = [(3.3, 0.21), (-11.7, -0.13), (0.4, 0.05), (17.9, -0.24)];
        for m in 0..m_count {
            for k in 0..f_count {
                let f = 9.9e9 + k as f64 * 3.125e6;
                let z: Complex64 = scatterers
                    .iter()
                    .map(|(bins, doppler)| {
                        let range = -(k as f64 - 32.0) * bins / 64.0;
                        Complex64::cis(TAU * (range + f / 10.0e9 * doppler * (m as f64 - 16.0)))
                    })
                    .sum();
                case.samples[m][k] = Complex32::new(z.re as f32, z.im as f32);
            }
        }
        let exact = case.oracle(Form::ChirpZ);
        let error = error_db(&case.oracle(Form::Sinc), &exact);
        let core = error_db(&widen(&case.core_map(Form::Sinc)), &exact);
        println!("sinc form against the exact map, Hamming {hamming}: {error:.2} dB");
        assert!((error - core).abs() < 0.01, "{core} dB, by float64 {error}");
        assert!((low_db..high_db).contains(&error), "{error} dB");
    }
}

/// A unit scatterer on a bin has the value 1: (r, d) from path and Doppler by the formulas of the axes.
#[test]
fn unit_scatterer_on_bin_has_value_one() {
    let mut case = Case::noise(20, 24, 32, 32, 9.9e9, 5.0e6);
    let (range_bin, doppler_bin) = (21, 5);
    for m in 0..20 {
        for k in 0..24 {
            // Path (r - R/2) c / (R step): phase -2 pi (k - F/2)(r - R/2)/R relative to f_ref.
            let f = (9.9e9 + k as f64 * 5.0e6) / (9.9e9 + 12.0 * 5.0e6);
            let range = -(k as f64 - 12.0) * (range_bin as f64 - 16.0) / 32.0;
            let doppler = f * (m as f64 - 10.0) * (doppler_bin as f64 - 16.0) / 32.0;
            let z = Complex64::cis(TAU * (range + doppler));
            case.samples[m][k] = Complex32::new(z.re as f32, z.im as f32);
        }
    }
    let map = case.core_map(Form::ChirpZ);
    // 480 unit terms, each rounded in about ten float32 operations of 2^-24: below 1e-6 of 1.
    assert!((map[doppler_bin * 32 + range_bin] - 1.0).norm() < 1e-6);
}
