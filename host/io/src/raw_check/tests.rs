//! Defects of simulated samples with known bias, imbalance and limits, and samples without defects.

use std::convert::Infallible;
use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};

use super::absent::ABSENT;
use super::balance::Correction;
use super::{Cures, Defects, Named, Raw, examine};

/// Uniform numbers in 0 to 1 (splitmix64).
struct Draw(u64);

impl Draw {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Complex Gaussian number of unit power.
    fn normal(&mut self) -> Complex64 {
        let radius = (-(1.0 - self.uniform()).ln()).sqrt();
        Complex64::from_polar(radius, TAU * self.uniform())
    }
}

const PULSES: usize = 320;
const SAMPLES: usize = 200;

fn examined(samples: &[Complex32], real: bool, integer_range: Option<[f32; 2]>) -> Defects {
    let raw = Raw {
        num_pulses: samples.len() / SAMPLES,
        num_samples: SAMPLES,
        real,
        integer_range,
    };
    let read = |pulse: usize, row: &mut [Complex32]| {
        row.copy_from_slice(&samples[pulse * SAMPLES..(pulse + 1) * SAMPLES]);
        Ok::<(), Infallible>(())
    };
    let Ok(found) = examine(&raw, read);
    found
}

fn warnings(found: &Defects, recording: &str) -> Vec<String> {
    let named = Named {
        recording,
        ..Named::default()
    };
    let report = found.report(&named, &Cures::of_description(found.real));
    assert_eq!(report.warnings.len(), report.defects.len());
    report.warnings
}

fn made(sample: impl FnMut((usize, usize)) -> Complex64) -> Vec<Complex32> {
    let places = (0..PULSES).flat_map(|n| (0..SAMPLES).map(move |k| (n, k)));
    let samples = places.map(sample);
    samples
        .map(|z| Complex32::new(z.re as f32, z.im as f32))
        .collect()
}

/// Beats of three targets that a radar passes: `cycles` over a sweep, and a parabola of `turns` over the pulses.
fn beats((n, k): (usize, usize), turns: f64) -> Complex64 {
    let along = n as f64 / PULSES as f64 - 0.5;
    let targets = [(10.3, 0.1, 1.0), (23.7, -0.2, 0.7), (41.1, 0.3, 0.5)];
    let beat = |(cycles, place, amplitude): (f64, f64, f64)| {
        let phase = cycles * k as f64 / SAMPLES as f64 + turns * (along - place) * (along - place);
        Complex64::from_polar(amplitude, TAU * phase)
    };
    targets.into_iter().map(beat).sum()
}

/// A receiver with a gain of `gain` in Q and a phase error, as its definition states: `Q = g (Q cos e + I sin e)`.
fn imbalanced(z: Complex64, gain: f64, error_rad: f64) -> Complex64 {
    let (sin, cos) = error_rad.sin_cos();
    Complex64::new(z.re, gain * (z.im * cos + z.re * sin))
}

/// Noise of 64000 samples: the estimates have standard errors of about 1 / sqrt(64000) = 0.004, in gain and in radians.
#[test]
fn bias_and_imbalance_of_noise_are_measured_and_corrected() {
    let mut draw = Draw(3);
    let pure = made(|_| draw.normal());
    let bias = Complex64::new(0.05, -0.12);
    let (gain, error_rad) = (1.1, 0.06);
    let recorded: Vec<Complex32> = pure
        .iter()
        .map(|z| {
            let z = Complex64::new(z.re.into(), z.im.into());
            let z = imbalanced(z, gain, error_rad) + bias;
            Complex32::new(z.re as f32, z.im as f32)
        })
        .collect();
    let found = examined(&recorded, false, None);
    let measured = found.balance.bias.expect("a bias");
    assert!((measured - bias).norm() < 4.0 * 0.004, "{measured}");
    let imbalance = found.balance.imbalance.expect("an imbalance");
    assert!((imbalance.gain - gain).abs() < 4.0 * 0.004, "{imbalance:?}");
    assert!(
        (imbalance.sine - error_rad.sin()).abs() < 4.0 * 0.004,
        "{imbalance:?}"
    );
    // Image of a signal a s + b conj(s): a = (1 + g exp(-j e)) / 2, b = (1 - g exp(+j e)) / 2.
    let turned = Complex64::from_polar(gain, error_rad);
    let image = ((1.0 - turned) / (1.0 + turned.conj())).norm();
    assert!(
        (imbalance.image - image).abs() < 0.005,
        "{imbalance:?} {image}"
    );
    let correction = Correction::of(&found.balance).unwrap().unwrap();
    let worst = pure.iter().zip(&recorded).map(|(z, r)| {
        // The error of a sample is proportional to it.
        (correction.apply(*r) - z).norm() / (1.0 + z.norm())
    });
    assert!(worst.fold(0.0, f32::max) < 0.03);
    let text = warnings(&found, "yard").join("\n");
    for part in [
        "yard: I/Q bias of 0.0",
        "background = \"mean\" or iq = \"correct\"",
        "yard: I/Q imbalance, Q has a gain of +0.8",
        "iq = \"correct\"",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn samples_without_defects_have_no_report() {
    let mut draw = Draw(11);
    let noise = made(|_| draw.normal());
    // Echoes that rotate by many turns, by less than one turn, and that stand still.
    let moving = [40.0, 0.4, 0.0].map(|turns| made(|place| beats(place, turns)));
    // A chirp, whose square is a chirp too, at rest and rotating.
    let chirp = |turns: f64| {
        made(|(n, k)| {
            let u = k as f64 / SAMPLES as f64 - 0.5;
            let along = n as f64 / PULSES as f64 - 0.5;
            Complex64::from_polar(1.0, TAU * (40.0 * u * u + turns * along * along))
        })
    };
    let integers = made(|place| {
        let z = 1000.5 * beats(place, 40.0);
        Complex64::new(z.re.round(), z.im.round())
    });
    let sinusoid = made(|(n, k)| {
        let turns = 0.1234 * k as f64 + 3.21 * n as f64;
        let z = Complex64::from_polar(100.5, TAU * turns);
        Complex64::new(z.re.round(), z.im.round())
    });
    for (i, samples) in moving
        .into_iter()
        .chain([
            noise,
            chirp(0.0),
            chirp(0.3),
            chirp(30.0),
            integers,
            sinusoid,
        ])
        .enumerate()
    {
        let found = examined(&samples, false, Some([-32768.0, 32767.0]));
        let texts = warnings(&found, "clean");
        assert!(texts.is_empty(), "{i}: {texts:?}");
        let real: Vec<Complex32> = samples.iter().map(|z| Complex32::new(z.re, 0.0)).collect();
        let texts = warnings(&examined(&real, true, None), "clean");
        assert!(texts.is_empty(), "{i}: {texts:?}");
    }
}

/// Imbalance of 1 dB with echoes of few targets: `rho` is that of the receiver and not of the scene.
#[test]
fn imbalance_is_measured_in_beats_of_few_targets() {
    let gain = 10f64.powf(1.0 / 20.0);
    let recorded = made(|place| imbalanced(beats(place, 40.0), gain, -0.05));
    let imbalance = examined(&recorded, false, None)
        .balance
        .imbalance
        .expect("an imbalance");
    assert!((imbalance.gain / gain - 1.0).abs() < 0.01, "{imbalance:?}");
    assert!((imbalance.sine + 0.05).abs() < 0.01, "{imbalance:?}");
}

/// Real Gaussian samples limited to 2 standard deviations: 4.55 % are beyond (a deviation of one is 0.2 % / sqrt(64000)).
#[test]
fn clipped_values_are_counted() {
    let mut draw = Draw(5);
    let limited = made(|_| {
        let value = draw.normal().re * 2f64.sqrt() * 100.0;
        Complex64::new(value.clamp(-200.0, 200.0), 0.0)
    });
    let clipped = examined(&limited, true, None)
        .clipping
        .clipped()
        .expect("clipped");
    let expected = libm::erfc(2.0 / 2f64.sqrt());
    let deviation = (expected * (1.0 - expected) / (PULSES * SAMPLES) as f64).sqrt();
    assert!(
        (clipped.share - expected).abs() < 4.0 * deviation,
        "{clipped:?}"
    );
    assert_eq!(clipped.range, [-200.0, 200.0]);
    // Few values at the limits of a type count, and do not without a type.
    let mut few = made(|_| 100.0 * draw.normal());
    few.iter_mut()
        .for_each(|z| *z = Complex32::new(z.re.round(), z.im.round()));
    for n in 0..40 {
        few[n * 900].re = 32767.0;
    }
    let at_limit = examined(&few, false, Some([-32768.0, 32767.0]));
    let share = at_limit.clipping.clipped().expect("at the limit").share;
    assert!((share - 40.0 / (2 * PULSES * SAMPLES) as f64).abs() < 1e-12);
    assert!(warnings(&at_limit, "x")[0].contains("clipped"));
}

/// Samples with gaps of absent places, some of them moving with the pulse, and with whole pulses absent: the estimates are those of the
/// recorded samples. Standard errors for 64000 samples less a third: 1 / sqrt(42000) = 0.005.
#[test]
fn absent_samples_do_not_dilute_the_estimates() {
    let mut draw = Draw(29);
    let bias = Complex64::new(0.3, -0.2);
    let gain = 1.1;
    let mut recorded = made(|_| imbalanced(draw.normal(), gain, 0.0) + bias);
    let mut count = 0;
    for n in 0..PULSES {
        for k in 0..SAMPLES {
            let is_gap = (60..90).contains(&k) || k % 20 == n % 20 || n % 8 == 3;
            if is_gap {
                recorded[n * SAMPLES + k] = ABSENT;
                count += 1;
            }
        }
    }
    assert!((0.25..0.35).contains(&(f64::from(count) / recorded.len() as f64)));
    let found = examined(&recorded, false, None);
    let measured = found.balance.bias.expect("a bias");
    assert!((measured - bias).norm() < 4.0 * 0.005, "{measured}");
    let imbalance = found.balance.imbalance.expect("an imbalance");
    assert!((imbalance.gain - gain).abs() < 4.0 * 0.005, "{imbalance:?}");
    // I has half of the power of 1, and Q has g^2 / 2.
    let [i, q] = found.balance.deviations;
    assert!((i - 0.5f64.sqrt()).abs() < 4.0 * 0.005, "{i}");
    assert!((q - gain * 0.5f64.sqrt()).abs() < 4.0 * 0.005, "{q}");
}
