//! Chirp radar: pulse compression against correlation in float64, and capture, recording and replay with the simulated
//! radio.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::atomic::AtomicBool;

use num_complex::Complex64;
use subaperture_describe::Description;
use subaperture_radio::chirp::{ChirpProfile, Compressor, Plan, Replica, capture};
use subaperture_radio::profile::{Options, Ranging};
use subaperture_radio::sigmf::Recording;
use subaperture_radio::simulated::{Analogue, SimulatedRadio, Wiring};
use subaperture_radio::{Ranges, Sample};

use crate::scene::{experiment, half_path_m};

const RADIO: &str = "[radio]\nmaster_clock = \"20.48 MHz\"\nsample_rate = \"20.48 MHz\"\nbandwidth = \"20.48 MHz\"\n";

fn plan(chirp: &str) -> Result<Plan, String> {
    let text = format!("[chirp]\n{chirp}\n{RADIO}");
    Plan::describe(&Description::new("chirp.toml", text, ".")).map_err(|error| error.to_string())
}

/// Emitted profile: pulse index, index of range zero, values.
type Emitted = (u64, f64, Vec<Complex64>);

fn keep(all: &mut Vec<Emitted>) -> impl FnMut(&ChirpProfile<'_>) + '_ {
    |profile| all.push((profile.pulse, profile.zero, profile.values.to_vec()))
}

/// Counts of both channels for pulses with a chirp of 64 samples: a reference delayed by 2.3 samples, two echoes, and
/// phases that drift.
fn channels(plan: &Plan, pulses: usize) -> [Vec<Sample>; 2] {
    let (count, period) = (64.0, plan.period());
    let rate_hz = plan.radio.sample_rate_hz;
    let slope = plan.bandwidth_hz / plan.duration_s;
    let chirp = |at: f64| {
        let t = (at - 0.5 * (count - 1.0)) / rate_hz;
        match (-0.5..count - 0.5).contains(&at) {
            true => Complex64::cis(PI * slope * t * t),
            false => Complex64::ZERO,
        }
    };
    let total = plan.period() * (pulses - 1) + plan.samples();
    let paths: [&[(f64, f64, f64)]; 2] = [&[(2.3, 0.4, 0.3)], &[(9.0, 0.1, 1.1), (21.6, 0.2, 2.0)]];
    paths.map(|paths| {
        let sample = |n: usize| {
            let mut sum = Complex64::ZERO;
            for (delay, amplitude, phase) in paths {
                // This pulse and the previous one.
                for pulse in (n / period).saturating_sub(1)..=n / period {
                    let at = (n - pulse * period) as f64 - delay;
                    sum += chirp(at) * Complex64::from_polar(*amplitude, phase + 1e-3 * n as f64);
                }
            }
            Sample::new((sum.re * 3e4).round() as i16, (sum.im * 3e4).round() as i16)
        };
        (0..total).map(sample).collect()
    })
}

fn number(s: Sample) -> Complex64 {
    Complex64::new(f64::from(s.re), f64::from(s.im))
}

/// Correlation of samples with a chirp at a fractional lag: the product of their spectra, padded to 128 points, with
/// every sum written out.
fn between(samples: &[Sample], chirp: &[Complex64], at: f64) -> Complex64 {
    let mut sum = Complex64::ZERO;
    for k in -64i32..64 {
        let turn = |n: usize| Complex64::cis(-TAU * f64::from(k) * n as f64 / 128.0);
        let x: Complex64 = samples
            .iter()
            .enumerate()
            .map(|(n, s)| number(*s) * turn(n))
            .sum();
        let r: Complex64 = chirp.iter().enumerate().map(|(n, r)| r * turn(n)).sum();
        sum += x * r.conj() * Complex64::cis(TAU * f64::from(k) * at / 128.0);
    }
    sum / 128.0
}

/// Position of the peak near value `l`, by sinc interpolation of 16 values with a Hann window, on a fine grid.
fn fine_top(values: &[Complex64], l: usize) -> f64 {
    let power = |at: f64| {
        let mut sum = Complex64::ZERO;
        let first = at as usize - 7;
        for (n, value) in (first..).zip(&values[first..first + 16]) {
            let x = at - n as f64;
            let sinc = if x == 0.0 {
                1.0
            } else {
                (PI * x).sin() / (PI * x)
            };
            let window = (PI * x / 18.0).cos().powi(2);
            sum += value * sinc * window;
        }
        sum.norm_sqr()
    };
    let places = (-100..=100).map(|i| l as f64 + f64::from(i) * 0.01);
    places
        .max_by(|a, b| power(*a).total_cmp(&power(*b)))
        .unwrap()
}

/// The sums of the module's head, written out. Both are float64, so that they differ only by rounding of some hundred
/// terms: 1e-12 of the largest. With the shorter interval the farthest echo arrives after the next pulse has begun.
#[test]
fn compressed_pulse_equals_correlation_with_replica() {
    for interval in ["9.765625 us", "4.8828125 us"] {
        let text = format!(
            "bandwidth = \"16 MHz\"\nduration = \"3.125 us\"\ninterval = \"{interval}\"\nreach = \"290 m\""
        );
        let plan = plan(&text).unwrap();
        let lags = plan.lags();
        assert_eq!((plan.chirp_samples(), lags), (64, 49));
        let pulses = 5;
        let both = channels(&plan, pulses);
        let (period, chirp) = (plan.period(), plan.chirp());
        for replica in [Replica::Ideal, Replica::Reference] {
            let mut compressor = Compressor::new(&plan, replica).unwrap();
            let mut emitted: Vec<Emitted> = Vec::new();
            let mut from = 0;
            // Blocks of many sizes.
            for part in (1..).step_by(37) {
                let to = (from + part).min(both[0].len());
                let part = [&both[0][from..to], &both[1][from..to]];
                compressor.push(part, &[], &mut keep(&mut emitted));
                from = to;
                if from == both[0].len() {
                    break;
                }
            }
            assert!(emitted.len() >= pulses, "{}", emitted.len());
            for (p, (pulse, zero, values)) in emitted.iter().enumerate().take(pulses) {
                assert_eq!((*pulse, values.len()), (p as u64, lags));
                let own: Vec<Complex64> = match replica {
                    Replica::Ideal => chirp.clone(),
                    Replica::Reference => {
                        let own = &both[0][p * period..p * period + 64 + 8];
                        own.iter().map(|s| number(*s)).collect()
                    }
                };
                let sum = |c: usize, l: usize| -> Complex64 {
                    let x = &both[c][p * period + l..];
                    own.iter().zip(x).map(|(r, x)| number(*x) * r.conj()).sum()
                };
                let energy: f64 = own.iter().map(Complex64::norm_sqr).sum();
                let scale = match replica {
                    Replica::Reference => Complex64::from(energy),
                    Replica::Ideal => between(&both[0][p * period..][..64 + lags], &chirp, *zero),
                };
                // The reference is delayed by 2.3 samples. Truncation at whole samples removes up to half a sample of
                // 64 at each end.
                let near = match replica {
                    Replica::Reference => 0.0,
                    Replica::Ideal => 2.3,
                };
                assert!((zero - near).abs() < 0.05, "{zero}");
                let expected: Vec<Complex64> = (0..lags).map(|l| sum(1, l) / scale).collect();
                let most = expected.iter().map(|z| z.norm()).fold(0.0, f64::max);
                for (l, (value, expected)) in values.iter().zip(&expected).enumerate() {
                    let off = (value - expected).norm() / most;
                    assert!(off < 1e-12, "{replica:?} pulse {p}, lag {l}: {off}");
                }
            }
        }
    }
}

/// Lost samples affect only the pulses that need them.
#[test]
fn pulses_with_lost_samples_are_skipped() {
    let text = "bandwidth = \"16 MHz\"\nduration = \"3.125 us\"\ninterval = \"9.765625 us\"\nreach = \"290 m\"";
    let plan = plan(text).unwrap();
    let both = channels(&plan, 6);
    let emitted_with = |lost: &[Range<usize>]| {
        let mut compressor = Compressor::new(&plan, Replica::Reference).unwrap();
        let mut emitted: Vec<Emitted> = Vec::new();
        compressor.push([&both[0], &both[1]], lost, &mut keep(&mut emitted));
        let pulses: Vec<u64> = emitted.iter().map(|profile| profile.0).collect();
        (pulses, compressor.left_out())
    };
    let (all, none) = emitted_with(&[]);
    assert_eq!((&all[..6], none), (&[0, 1, 2, 3, 4, 5][..], 0));
    // A pulse needs the first 121 of its 200 samples.
    let (some, left_out) = emitted_with(&[110..112, 330..390, 520..521]);
    assert_eq!((&some[..4], left_out), (&[1, 3, 4, 5][..], 2), "{some:?}");
    let (some, left_out) = emitted_with(std::slice::from_ref(&(321..400)));
    assert_eq!((some, left_out), (all, 0));
}

/// C 5.4: 1.2 GHz, 20.48 MS/s. The range of a reflector is correct to a twentieth of a sample, 0.4 m. Sidelobes of the
/// others, at most -13 dB and -40 dB at eight resolutions, shift its peak by some hundredths; interpolation with 16
/// values by less; the clock's 2 ppm are negligible. Two reflectors 2.3 resolutions apart give two peaks, which shift
/// each other by at most a fifth of a sample. Compressing the recording again gives the same profiles.
#[test]
fn thesis_chirp_radar_finds_reflectors_and_replay_is_identical() {
    let plan = plan("bandwidth = \"16 MHz\"\npulses = 4\nbursts = 2\nreach = \"300 m\"").unwrap();
    plan.check(&Ranges::b210()).unwrap();
    assert!((plan.resolution_m() - 9.37).abs() < 0.005);
    assert!((plan.spacing_m() - 7.32).abs() < 0.005);
    assert_eq!((plan.chirp_samples(), plan.period()), (1024, 4096));
    let spacing_m = plan.spacing_m();
    let folder = tempfile::tempdir().unwrap();
    // Equally strong at the antenna: cross section grows as the fourth power of range.
    let far_m = 120.0 + 3.0 * spacing_m;
    let points = [
        (60.0, 8e3),
        (120.0, 1.28e5),
        (far_m, 1.28e5 * (far_m / 120.0).powi(4)),
    ];
    for (replica, name) in [(Replica::Ideal, "ideal"), (Replica::Reference, "reference")] {
        let experiment = experiment(&points, 21);
        // Loopback and antenna cables have equal delays, so that ranges are those of the scene.
        let wiring = Wiring::loopback(15e-9, 15e-9, None);
        let mut radio = SimulatedRadio::new(&experiment, wiring, Analogue::b210()).unwrap();
        let path = folder.path().join(name);
        let mut emitted: Vec<Emitted> = Vec::new();
        let mut emit = |_: u64, profile: &ChirpProfile<'_>| keep(&mut emitted)(profile);
        let stop = AtomicBool::new(false);
        let summary = capture(&mut radio, &plan, replica, Some(&path), &mut emit, &stop).unwrap();
        assert_eq!((summary.bursts, summary.pulses), (2, [8, 0]));
        assert_eq!(summary.flagged, [0; 3], "{summary:?}");
        for (pulse, zero, values) in &emitted {
            let power = |l: usize| values[l].norm_sqr();
            let strongest = (0..values.len()).map(power).fold(0.0, f64::max);
            let is_top = |l: &usize| {
                let l = *l;
                power(l) > 0.25 * strongest && power(l) > power(l - 1) && power(l) >= power(l + 1)
            };
            let tops: Vec<usize> = (1..values.len() - 1).filter(is_top).collect();
            let range_m = |l: &usize| (fine_top(values, *l) - zero) * spacing_m;
            let ranges: Vec<f64> = tops.iter().map(range_m).collect();
            println!("{name} {pulse}: {ranges:.2?}");
            assert_eq!(ranges.len(), 3, "{ranges:?}");
            for (range_m, (at_m, _)) in ranges.iter().zip(&points) {
                let off = (range_m - half_path_m(*at_m)) / spacing_m;
                // The two close reflectors shift each other's peaks by their sidelobes.
                let most = if *at_m < 100.0 { 0.05 } else { 0.3 };
                assert!(off.abs() < most, "{at_m} m: {off} samples");
            }
        }
        // The synthesisers' phases differ from burst to burst and cancel: the phase of an echo is the same in all
        // pulses.
        let first = &emitted[0].2;
        let at = (60.0 / spacing_m).round() as usize;
        for (_, _, values) in &emitted {
            let turn = (values[at] * first[at].conj()).arg();
            assert!(turn.abs() < 0.05, "{turn}");
        }
        let mut recording = Recording::open(&path).unwrap();
        assert_eq!(recording.steps().len(), 2);
        // A recording with a single carrier has no range profile across carriers.
        let error = Ranging::new(recording.setup(), Options::default()).unwrap_err();
        assert!(error.to_string().contains("single carrier"), "{error}");
        let mut again: Vec<Emitted> = Vec::new();
        let mut compressor = Compressor::new(&plan, replica).unwrap();
        let mut channels = [Vec::new(), Vec::new()];
        for index in 0..2 {
            recording.read(index, &mut channels).unwrap();
            compressor.begin();
            compressor.push([&channels[0], &channels[1]], &[], &mut keep(&mut again));
        }
        assert!(again == emitted, "equal counts give equal profiles");
    }
}

#[test]
fn invalid_chirp_plans_are_refused_with_reason() {
    let refused = |text: &str, words: &str| {
        let error = plan(text).unwrap().check(&Ranges::b210()).unwrap_err();
        assert!(error.to_string().contains(words), "{text}: {error}");
    };
    refused("bandwidth = \"25 MHz\"", "chirp bandwidth of 25000000 Hz");
    refused(
        "bandwidth = \"16 MHz\"\ninterval = \"33.3333 us\"",
        "expected a whole number",
    );
    refused(
        "bandwidth = \"16 MHz\"\nduration = \"250 us\"",
        "no longer than the interval",
    );
    refused(
        "bandwidth = \"16 MHz\"\nduration = \"0.1 us\"",
        "chirp of 2 samples",
    );
    refused(
        "bandwidth = \"16 MHz\"\nreach = \"40 km\"",
        "unambiguous range of 29979.2 m",
    );
    refused(
        "bandwidth = \"16 MHz\"\npulses = 100000",
        "Send fewer pulses",
    );
    refused(
        "bandwidth = \"16 MHz\"\ncarrier = \"9 GHz\"",
        "carrier of 9000000000 Hz",
    );
    assert!(
        plan("carrier = \"1.2 GHz\"")
            .unwrap_err()
            .contains("bandwidth")
    );
    let reference = subaperture_radio::chirp::reference();
    assert!(reference.contains("interval") && reference.contains("receive_gain"));
}
