//! Every stage of the core by itself against an analytic answer.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_core::keystone::{KeystoneTable, chirp_z, sinc};
use subaperture_core::window::WindowError;
use subaperture_core::{
    Axes, LengthError, Map, ParamError, Params, Plan, Shape, Tables, Turns, Window, fft, range,
};

fn weights(window: Window<'_>, n: usize) -> Vec<f64> {
    let mut weights = vec![0.0; n];
    window.fill(&mut weights).unwrap();
    weights.into_iter().map(f64::from).collect()
}

/// `|sum_i w_i exp(-j 2 pi nu i)|`
fn spectrum(weights: &[f64], cycles_per_sample: f64) -> f64 {
    weights
        .iter()
        .enumerate()
        .map(|(i, w)| w * Complex64::cis(-TAU * cycles_per_sample * i as f64))
        .sum::<Complex64>()
        .norm()
}

#[test]
fn window_sidelobes_match_theory() {
    // Highest sidelobe beyond the first minimum. Rectangular: 13.26 dB of the Dirichlet kernel.
    // Hamming: 42.7 dB. Taylor: the design level, within 0.5 dB because n_bar is finite.
    let psl_db = |window| {
        let weights = weights(window, 256);
        let lobes: Vec<f64> = (0..256 * 32 / 2)
            .map(|i| spectrum(&weights, f64::from(i) / (256.0 * 32.0)))
            .collect();
        assert!((lobes[0] - 1.0).abs() < 1e-6, "weights sum to 1");
        let null = lobes.windows(2).position(|p| p[1] > p[0]).unwrap();
        -20.0 * lobes[null..].iter().fold(0.0f64, |a, &b| a.max(b)).log10()
    };
    assert!((psl_db(Window::Rectangular) - 13.26).abs() < 0.02);
    assert!((psl_db(Window::Hamming) - 42.7).abs() < 0.5);
    for side_lobe_db in [25.0, 35.0, 50.0, 80.0] {
        let psl_db = psl_db(Window::Taylor { side_lobe_db });
        assert!((psl_db - side_lobe_db).abs() < 0.5, "{psl_db}");
    }
}

/// The host samples its windows at the same points; scaled to sum 1 they agree up to float32 rounding.
#[test]
fn windows_agree_with_the_host() {
    use subaperture::signal::window::Window as Host;
    let pairs = [
        (Window::Rectangular, Host::None),
        (Window::Hamming, Host::Hamming),
        (
            Window::Taylor { side_lobe_db: 35.0 },
            Host::Taylor { side_lobe_db: 35.0 },
        ),
        (
            Window::Taylor { side_lobe_db: 99.0 },
            Host::Taylor { side_lobe_db: 99.0 },
        ),
    ];
    for (core, host) in pairs {
        for n in [1, 2, 39, 424] {
            let host = host.weights(n);
            let sum: f64 = host.iter().sum();
            for (a, b) in weights(core, n).iter().zip(&host) {
                assert!((a - b / sum).abs() <= 1e-7 * (b / sum).abs() + 1e-12);
            }
        }
    }
}

#[test]
fn invalid_windows_are_rejected() {
    let refused = |window: Window<'_>| window.fill(&mut [0.0; 3]).unwrap_err();
    assert_eq!(
        refused(Window::Taylor { side_lobe_db: 10.0 }),
        WindowError::SideLobe(10.0)
    );
    assert!(matches!(
        refused(Window::Taylor {
            side_lobe_db: f64::NAN
        }),
        WindowError::SideLobe(_)
    ));
    assert_eq!(
        refused(Window::Weights(&[1.0; 2])),
        WindowError::Length {
            expected: 3,
            got: 2
        }
    );
    assert_eq!(
        refused(Window::Weights(&[1.0, 0.0, -1.0])),
        WindowError::Sum(0.0)
    );
    assert!(matches!(
        refused(Window::Weights(&[1.0, f32::NAN, 0.0])),
        WindowError::Sum(_)
    ));
}

/// Argument known to 2^-33 turns and rounded twice near pi/4 (0.785 * 2 * 2^-24 = 0.94e-7), sine and cosine rounded once
/// (at most 0.6e-7): below 1.6e-7 in total.
#[test]
fn phasors_are_accurate_to_single_precision() {
    for i in 0..100_003u64 {
        let turns = Turns(i.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let phasor = turns.phasor();
        let exact = Complex64::cis(TAU * (turns.0 as f64 / 2f64.powi(64)));
        let error = Complex64::new(phasor.re.into(), phasor.im.into()) - exact;
        assert!(error.re.abs() < 1.6e-7 && error.im.abs() < 1.6e-7, "{i}");
    }
    for (turns, exact) in [
        (0.0, Complex32::new(1.0, 0.0)),
        (0.25, Complex32::new(0.0, 1.0)),
        (0.5, Complex32::new(-1.0, 0.0)),
        (-0.25, Complex32::new(0.0, -1.0)),
        (1e6, Complex32::new(1.0, 0.0)),
    ] {
        assert_eq!(Turns::from_f64(turns).phasor(), exact, "{turns}");
    }
    assert!((Turns::from_f64(-1e-30).phasor() - 1.0).norm() < 1e-9);
}

/// A quadratic phase by recurrence equals the product for any rate: integers wrap like phase.
#[test]
fn quadratic_phase_recurrence_is_exact() {
    let rate = Turns(0x0123_4567_89ab_cdef);
    let (mut phase, mut step) = (Turns(0), rate);
    for n in 0..5000i64 {
        assert_eq!(phase, rate.times(n * n));
        phase = phase.plus(step);
        step = step.plus(rate.times(2));
    }
}

/// Impulse at p: `exp(-j 2 pi p q / N)`, every length; microfft's error is a few 1e-7 of the peak.
#[test]
fn fft_of_an_impulse_is_a_phasor() {
    for length in (1..=12).map(|bits| 1usize << bits) {
        assert!(fft::supports(length));
        let p = length / 2 + usize::from(length > 2);
        let mut buffer = vec![Complex32::ZERO; length];
        buffer[p] = Complex32::ONE;
        fft::forward(&mut buffer);
        for (q, value) in buffer.iter().enumerate() {
            let turns = ((p * q) % length) as f64 / length as f64;
            let exact = Complex64::cis(-TAU * turns);
            let error = Complex64::new(value.re.into(), value.im.into()) - exact;
            assert!(error.norm() < 1e-6, "{length}: bin {q}");
        }
    }
    for length in [0, 1, 3, 100, 8192] {
        assert!(!fft::supports(length));
    }
}

/// A scatterer `x` bins off gives the Dirichlet kernel `sum_k exp(j 2 pi (k - F/2)(r - R/2 - x) / R)`: F at the peak, for
/// even and odd F, with and without padding. Previous contents of the padding have no effect.
#[test]
fn range_compression_of_a_scatterer_is_the_dirichlet_kernel() {
    for (frequencies, bins) in [(1, 2), (2, 2), (5, 8), (8, 8), (12, 32), (424, 1024)] {
        for x in [0.0, 1.0, -0.37] {
            let offset = |i: usize, n: usize| i as f64 - (n / 2) as f64;
            let mut row = vec![Complex32::new(9.0, 9.0); bins];
            for k in 0..frequencies {
                let z = Complex64::cis(-TAU * offset(k, frequencies) * x / bins as f64);
                row[range::column(k, frequencies, bins)] =
                    Complex32::new(z.re as f32, z.im as f32) * range::sign(k, frequencies);
            }
            range::compress(&mut row, frequencies);
            for (r, value) in row.iter().enumerate() {
                let exact: Complex64 = (0..frequencies)
                    .map(|k| {
                        let turns = offset(k, frequencies) * (offset(r, bins) - x);
                        Complex64::cis(TAU * turns / bins as f64)
                    })
                    .sum();
                let error = Complex64::new(value.re.into(), value.im.into()) - exact;
                assert!(error.norm() < 1e-6 * frequencies as f64 + 1e-6);
            }
        }
    }
}

/// A constant of M pulses: at Doppler bin d the Dirichlet kernel of the *scaled* Doppler `a (d - D/2) / D`.
#[test]
fn chirp_z_of_a_constant_is_the_scaled_dirichlet_kernel() {
    for (pulses, bins, length) in [
        (1, 2, 2),
        (1, 4, 4),
        (3, 4, 8),
        (5, 2048, 4096),
        (17, 64, 128),
    ] {
        for ratio in [1.0, 0.93, 1.9, 0.013] {
            let mut out = vec![Complex32::ZERO; bins];
            let mut scratch = vec![Complex32::new(7.0, 7.0); 3 * length];
            chirp_z::transform(
                chirp_z::rate(ratio, bins),
                &vec![Complex32::ONE; pulses],
                bins,
                &mut scratch,
                out.iter_mut(),
            );
            for (d, value) in out.iter().enumerate() {
                let doppler = ratio * (d as f64 - (bins / 2) as f64) / bins as f64;
                let exact: Complex64 = (0..pulses)
                    .map(|m| Complex64::cis(-TAU * doppler * (m as f64 - (pulses / 2) as f64)))
                    .sum();
                let value = *value / length as f32;
                let error = Complex64::new(value.re.into(), value.im.into()) - exact;
                assert!(error.norm() < 1e-6 * pulses as f64, "{pulses} {bins} {d}");
            }
        }
    }
}

/// At the reference frequency, and wherever a position coincides with a pulse, resampling is the identity. With ratio 1/2,
/// output pulse i is input pulse 2 (i - M/2) + M/2, or zero beyond the ends.
#[test]
fn sinc_matrix_is_identity_on_pulse_positions() {
    for pulses in [4usize, 5] {
        let mut matrix = vec![9.0; pulses * pulses];
        for ratio in [1.0, 0.5] {
            sinc::fill_matrix(ratio, pulses, &mut matrix);
            for i in 0..pulses {
                let centre = (pulses / 2) as i64;
                let meets = (i as i64 - centre) * (1.0 / ratio) as i64 + centre;
                for m in 0..pulses {
                    let exact = f32::from(u8::from(m as i64 == meets));
                    assert_eq!(matrix[i * pulses + m], exact, "{ratio} {i} {m}");
                }
            }
        }
    }
    // Ratio 2 samples midway: sinc(1/2) = 2/pi, sinc(3/2) = -2/(3 pi).
    let mut matrix = [0.0; 9];
    sinc::fill_matrix(2.0, 3, &mut matrix);
    let exact = [0.5, 0.5, -1.0 / 6.0].map(|x| x * 4.0 / std::f64::consts::PI);
    for (weight, exact) in matrix.iter().zip(exact) {
        assert!((f64::from(*weight) - exact).abs() < 1e-7);
    }
}

#[test]
fn buffer_lengths_follow_shape() {
    let shape = Shape {
        num_pulses: 32,
        num_frequencies: 64,
        num_range_bins: 128,
        num_doppler_bins: 64,
    };
    assert_eq!((shape.history_len(), shape.map_len()), (2048, 8192));
    assert_eq!(shape.sinc_len(), 64 * 32 * 32);
    assert_eq!(shape.chirp_length(), 128); // 32 + 64 - 1 = 95
    assert!(shape.is_valid());
    let endless = Shape {
        num_pulses: usize::MAX,
        ..shape
    };
    assert!(!endless.is_valid());
    assert_eq!(endless.history_len(), usize::MAX);
    assert_eq!(endless.chirp_length(), usize::MAX);
}

/// Pulses outside the sub-CPI and a wrong number of samples have no effect.
#[test]
fn window_rejects_invalid_pulse_index_and_length() {
    let shape = Shape {
        num_pulses: 3,
        num_frequencies: 4,
        num_range_bins: 4,
        num_doppler_bins: 4,
    };
    let params = Params {
        start_hz: 1.0e9,
        step_hz: 1.0e6,
        fast_window: Window::Rectangular,
        slow_window: Window::Rectangular,
    };
    let (mut fast, mut slow) = ([0.0; 4], [0.0; 3]);
    let mut matrix = [0.0; 36];
    let tables = Tables {
        fast_weights: &mut fast,
        slow_weights: &mut slow,
        keystone: KeystoneTable::Sinc(&mut matrix),
    };
    let plan = Plan::new(shape, &params, tables).unwrap();
    let marked = Complex32::new(5.0, 6.0);
    let windowed = |m: usize, samples: usize, history: usize| {
        let mut history = vec![marked; history];
        let result = plan.window(m, &vec![Complex32::ONE; samples], &mut history);
        (result, history)
    };
    for (m, samples, history, what, expected, got) in [
        (1, 2, 12, "samples of a pulse", 4, 2),
        (0, 9, 12, "samples of a pulse", 4, 9),
        (1, 4, 8, "history", 12, 8),
        (0, 4, 0, "history", 12, 0),
        (3, 4, 12, "pulses of a sub-CPI", 4, 3),
        (usize::MAX, 4, 12, "pulses of a sub-CPI", usize::MAX, 3),
    ] {
        let (result, history) = windowed(m, samples, history);
        let error = LengthError {
            what,
            expected,
            got,
        };
        assert_eq!(result, Err(error));
        assert!(history.iter().all(|sample| *sample == marked), "{m}");
    }
    let (result, history) = windowed(1, 4, 12);
    assert_eq!(result, Ok(()));
    for (i, sample) in history.iter().enumerate() {
        let (k, at) = (i / 3, i % 3);
        // The signs that centre the range axis, over 12 samples.
        let value = if k % 2 == 0 { 1.0 } else { -1.0 } / 12.0;
        match at {
            1 => assert!((sample - value).norm() < 1e-7, "{k}: {sample}"),
            _ => assert_eq!(*sample, marked, "{k}"),
        }
    }
}

#[test]
fn invalid_plans_are_rejected_with_reason() {
    let good = Params {
        start_hz: 1.0e9,
        step_hz: 1.0e6,
        fast_window: Window::Rectangular,
        slow_window: Window::Rectangular,
    };
    let shape = |num_pulses| Shape {
        num_pulses,
        num_frequencies: 4,
        num_range_bins: 4,
        num_doppler_bins: 4,
    };
    let planned = |params: Params<'_>| {
        let (mut fast, mut slow) = ([0.0; 4], [0.0; 4]);
        let tables = Tables {
            fast_weights: &mut fast,
            slow_weights: &mut slow,
            keystone: KeystoneTable::ChirpZ { length: 8 },
        };
        Plan::new(shape(4), &params, tables).map(|_| ())
    };
    let refused = |params: Params<'_>| planned(params).unwrap_err();
    for (start_hz, step_hz) in [
        (0.0, 1.0),
        (-1.0, 1.0),
        (f64::NAN, 1.0),
        (1.0, 0.0),
        (1.0, f64::INFINITY),
    ] {
        let error = refused(Params {
            start_hz,
            step_hz,
            ..good
        });
        assert!(error.to_string().contains("positive finite"), "{error}");
    }
    let error = refused(Params {
        slow_window: Window::Weights(&[1.0]),
        ..good
    });
    assert_eq!(
        error.to_string(),
        "slow-time window: window weights: expected one per sample (4), found 1"
    );
    assert_eq!(
        Axes::new(shape(5), 1.0, 1.0).unwrap_err(),
        ParamError::Shape(shape(5))
    );
    assert_eq!(planned(good), Ok(()));
}

/// Functions on borrowed slices check every length before they write anything.
#[test]
fn borrowed_buffers_of_wrong_length_are_rejected() {
    let shape = Shape {
        num_pulses: 3,
        num_frequencies: 4,
        num_range_bins: 8,
        num_doppler_bins: 4,
    };
    let params = Params {
        start_hz: 1.0e9,
        step_hz: 1.0e6,
        fast_window: Window::Rectangular,
        slow_window: Window::Hamming,
    };
    let plan = |fast: usize, slow: usize, matrix: Option<usize>, length: usize| {
        let leak = |n: usize| vec![0.0f32; n].leak();
        let tables = Tables {
            fast_weights: leak(fast),
            slow_weights: leak(slow),
            keystone: match matrix {
                Some(n) => KeystoneTable::Sinc(leak(n)),
                None => KeystoneTable::ChirpZ { length },
            },
        };
        Plan::new(shape, &params, tables)
    };
    let wrong = |what, expected, got| {
        ParamError::Table(LengthError {
            what,
            expected,
            got,
        })
    };
    assert_eq!(
        plan(5, 3, None, 8).unwrap_err(),
        wrong("fast weights", 4, 5)
    );
    assert_eq!(
        plan(4, 2, None, 8).unwrap_err(),
        wrong("slow weights", 3, 2)
    );
    assert_eq!(
        plan(4, 3, Some(35), 0).unwrap_err(),
        wrong("sinc matrix", 36, 35)
    );
    for got in [4, 12, 8192] {
        let error = plan(4, 3, None, got).unwrap_err();
        assert_eq!(error, ParamError::ChirpLength { least: 8, got });
        assert!(error.to_string().contains("a power of two from 8 to 4096"));
    }
    let too_long = ParamError::ChirpLength {
        least: 8192,
        got: 8192,
    };
    assert!(too_long.to_string().contains("reduce them"), "{too_long}");

    for (plan, scratch_len) in [
        (plan(4, 3, Some(36), 0).unwrap(), 4),
        (plan(4, 3, None, 16).unwrap(), 48),
    ] {
        assert_eq!(plan.scratch_len(), scratch_len);
        let marked = Complex32::new(5.0, 6.0);
        for (what, lengths) in [
            ("history", [11, scratch_len, 32]),
            ("scratch", [12, scratch_len + 1, 32]),
            ("map", [12, scratch_len, 31]),
        ] {
            let [history, mut scratch, mut map] = lengths.map(|n| vec![marked; n]);
            let error = plan.process(&history, &mut scratch, &mut map).unwrap_err();
            assert_eq!(error.what, what);
            let untouched = |buffer: &[Complex32]| buffer.iter().all(|&z| z == marked);
            assert!(untouched(&scratch) && untouched(&map));
        }
    }
}

/// A plane is reproduced exactly by bilinear interpolation up to the last bins; there is no value beyond.
#[test]
fn bilinear_interpolation_is_exact_on_planes_and_none_outside() {
    let shape = Shape {
        num_pulses: 2,
        num_frequencies: 2,
        num_range_bins: 8,
        num_doppler_bins: 4,
    };
    let axes = Axes::new(shape, 1.0e9, 1.0e6).unwrap();
    let plane = |d: f32, r: f32| Complex32::new(3.0 * d - r, 0.5 * r + d);
    let samples: Vec<Complex32> = (0..32)
        .map(|i| plane((i / 8) as f32, (i % 8) as f32))
        .collect();
    let map = Map::new(axes, &samples).unwrap();
    for (d, r) in [
        (0.0, 0.0),
        (0.25, 6.5),
        (3.0, 7.0),
        (2.999, 0.125),
        (3.0, 3.5),
    ] {
        let value = map.bilinear(d, r).unwrap();
        assert!((value - plane(d as f32, r as f32)).norm() < 1e-5, "{d} {r}");
    }
    for (d, r) in [
        (-1e-9, 0.0),
        (3.0000001, 0.0),
        (0.0, 7.001),
        (0.0, -0.5),
        (f64::NAN, 0.0),
        (0.0, f64::INFINITY),
    ] {
        assert_eq!(map.bilinear(d, r), None, "{d} {r}");
    }
    assert_eq!(
        Map::new(axes, &samples[1..]).unwrap_err(),
        LengthError {
            what: "map",
            expected: 32,
            got: 31
        }
    );
}
