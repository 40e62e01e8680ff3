//! Detections counted against SNR.

use num_complex::Complex64;
use rayon::prelude::*;
use subaperture_gmti::adaptive::{
    Covariance, Detector, Loading, Performance, Statistic, TargetModel, Whitener,
};

use crate::noise::{CLUTTER, gaussian, random, steering};

const CELLS: usize = 20_000;
const STATISTICS: [Statistic; 4] = [
    Statistic::MatchedFilter,
    Statistic::Amf,
    Statistic::Kelly,
    Statistic::Ace,
];

/// Fraction of the cells with a target in which each statistic exceeds its threshold.
fn detected(
    (n, k): (usize, usize),
    thresholds: [f64; 4],
    snr: f64,
    target: TargetModel,
) -> [f64; 4] {
    let s = steering(n, 1.5);
    let amplitude = (snr / CLUTTER.snr(&s)).sqrt();
    let mut random = random((n * 1000 + k) as u64, snr.to_bits());
    let mut optimum = Detector::new(Whitener::known(n, &CLUTTER.matrix(n)).unwrap(), &s).unwrap();
    let mut adaptive = optimum.clone();
    let mut training = Covariance::new(n);
    let mut cell = vec![Complex64::ZERO; n];
    let mut counts = [0; 4];
    for _ in 0..CELLS {
        training.clear();
        for _ in 0..k {
            CLUTTER.sample(&mut random, &mut cell);
            training.add(&cell);
        }
        adaptive.train(&training, Loading::Off).unwrap();
        CLUTTER.sample(&mut random, &mut cell);
        let amplitude = amplitude
            * match target {
                TargetModel::Swerling0 => Complex64::ONE,
                TargetModel::Swerling1 => gaussian(&mut random),
            };
        cell.iter_mut()
            .zip(&s)
            .for_each(|(cell, s)| *cell += amplitude * s);
        for (i, statistic) in STATISTICS.into_iter().enumerate() {
            let detector = match statistic {
                Statistic::MatchedFilter => &mut optimum,
                _ => &mut adaptive,
            };
            counts[i] += u32::from(detector.evaluate(statistic, &cell).value > thresholds[i]);
        }
    }
    counts.map(|count| f64::from(count) / CELLS as f64)
}

/// The counted fraction lies within 4 standard deviations of the computed probability, and between those of 0.3 dB less and more SNR where the probability is between 0.2 and 0.9.
#[test]
fn counted_detections_agree_with_probabilities_within_0_3_db() {
    let mut cases = Vec::new();
    for training in [(2, 8), (3, 12), (6, 18)] {
        for target in [TargetModel::Swerling0, TargetModel::Swerling1] {
            cases.extend([6.0, 10.0, 14.0, 18.0, 22.0].map(|snr_db| (training, target, snr_db)));
        }
    }
    cases.par_iter().for_each(|&((n, k), target, snr_db)| {
        let laws = STATISTICS.map(|statistic| Performance::new(statistic, n, k).unwrap());
        let thresholds = laws.map(|law| law.threshold(1e-3).unwrap());
        let snr = |offset_db: f64| 10f64.powf((snr_db + offset_db) / 10.0);
        let counted = detected((n, k), thresholds, snr(0.0), target);
        for i in 0..4 {
            let at =
                |offset_db| laws[i].detection_probability(thresholds[i], snr(offset_db), target);
            let expected = at(0.0);
            let deviation = (expected * (1.0 - expected) / CELLS as f64).sqrt();
            let sigmas = (counted[i] - expected) / deviation.max(1.0 / CELLS as f64);
            let name = format!("{:?} N={n} K={k} {target:?} {snr_db} dB", STATISTICS[i]);
            println!("{name}: {:.4} {expected:.4} {sigmas:.2}", counted[i]);
            assert!(sigmas.abs() < 4.0, "{name}: {} {expected}", counted[i]);
            if (0.2..0.9).contains(&expected) {
                assert!((at(-0.3)..at(0.3)).contains(&counted[i]), "{name}");
            }
        }
    });
}
