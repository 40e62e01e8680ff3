//! False-alarm rate of the CFAR detector, and detection among other targets.

use num_complex::Complex64;
use subaperture_motion::targets::cfar::{Cfar, Detector, Level};

use crate::scene::{gaussian, random};

/// Powers of noise under a window, summed over channels, with `stride` bins per cell, by a direct DFT.
fn noise_power(window: &[f64], channels: usize, stride: usize, seed: u64) -> Vec<f64> {
    let mut random = random(seed);
    let (count, length) = (window.len(), window.len() * stride);
    let turn = |i: usize| Complex64::cis(std::f64::consts::TAU * i as f64 / length as f64);
    let phasors: Vec<Complex64> = (0..length).map(turn).collect();
    let mut power = vec![0.0; length];
    for _ in 0..channels {
        let mut sample =
            |w: &f64| Complex64::new(gaussian(&mut random), gaussian(&mut random)) * *w;
        let samples: Vec<Complex64> = window.iter().map(&mut sample).collect();
        for (bin, power) in power.iter_mut().enumerate() {
            let each = (0..count).map(|k| samples[k] * phasors[k * bin % length]);
            *power += each.sum::<Complex64>().norm_sqr();
        }
    }
    power
}

fn hamming(count: usize) -> Vec<f64> {
    let u = |i: usize| (i as f64 + 0.5) / count as f64 - 0.5;
    (0..count)
        .map(|i| 0.54 + 0.46 * (std::f64::consts::TAU * u(i)).cos())
        .collect()
}

/// False-alarm rate over the requested probability, in `profiles` profiles.
fn ratio(level: Level, channels: usize, window: &[f64], profiles: u64) -> f64 {
    let probability = 1e-2;
    let cfar = Cfar {
        guard: 3,
        training: 10,
        false_alarm_probability: probability,
        level,
    };
    let stride = 2;
    let detector = Detector::new(cfar, channels, stride, window).unwrap();
    let (mut tested, mut above) = (0, 0);
    for seed in 0..profiles {
        let power = noise_power(window, channels, stride, seed);
        let search = detector.search(&power, 0.0);
        tested += search.tested;
        above += search.above;
    }
    above as f64 / tested as f64 / probability
}

/// 128 x 2 bins of 200 profiles: 512 false alarms are expected among 51200 bins. Pairs of neighbouring bins are correlated, so that their number scatters by 6 % RMS. The limit is three times that, plus
/// 10 % for the correlation of cells by a window.
#[test]
fn false_alarm_rate_equals_requested_probability() {
    let (flat, hamming) = (vec![1.0; 128], hamming(128));
    for (level, channels) in [
        (Level::Mean, 1),
        (Level::Mean, 2),
        (Level::Mean, 4),
        (Level::Ordered(0.75), 1),
        (Level::Ordered(0.6), 2),
        (Level::Ordered(0.6), 4),
    ] {
        let flat = ratio(level, channels, &flat, 200);
        let windowed = ratio(level, channels, &hamming, 200);
        println!(
            "{level:?}, {channels} channels: {flat:.3} of the requested rate, with a Hamming window {windowed:.3}"
        );
        assert!((flat - 1.0).abs() < 0.18, "{flat}");
        assert!((windowed - 1.0).abs() < 0.28, "{windowed}");
    }
}

/// Eight strong targets among the training cells mask a target in cell averaging, but not with an order statistic.
#[test]
fn order_statistic_detects_target_among_strong_neighbours() {
    let mut power = noise_power(&[1.0; 128], 2, 1, 7);
    let level = power.iter().sum::<f64>() / power.len() as f64;
    for i in 1..=4 {
        power[60 + 3 * i + 3] = 1e4 * level;
        power[60 - 3 * i - 3] = 1e4 * level;
    }
    power[60] = 40.0 * level;
    let found = |level: Level| {
        let cfar = Cfar {
            level,
            ..Cfar::default()
        };
        let detector = Detector::new(cfar, 2, 1, &[1.0; 128]).unwrap();
        let peaks = detector.search(&power, 0.0).peaks;
        peaks.iter().any(|peak| peak.bin == 60)
    };
    assert!(found(Level::Ordered(0.6)));
    assert!(!found(Level::Mean));
}
