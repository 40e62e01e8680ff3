//! False alarms counted in homogeneous clutter, each cell with its own training.

use std::time::Instant;

use num_complex::Complex64;
use rayon::prelude::*;
use subaperture_gmti::adaptive::{Covariance, Detector, Loading, Performance, Statistic, Whitener};

use crate::noise::{CLUTTER, random, steering};

/// Cells of one generator stream.
const BLOCK: u64 = 1 << 14;

const ADAPTIVE: [Statistic; 3] = [Statistic::Amf, Statistic::Kelly, Statistic::Ace];

/// Counts of the values of each statistic above each of its thresholds, over `blocks` blocks of cells.
fn counts<const S: usize, const T: usize>(
    (n, k): (usize, usize),
    statistics: [Statistic; S],
    probabilities: [f64; T],
    blocks: u64,
) -> [[u64; T]; S] {
    let thresholds = statistics.map(|statistic| {
        let law = Performance::new(statistic, n, k).unwrap();
        probabilities.map(|probability| law.threshold(probability).unwrap())
    });
    let known = Whitener::known(n, &CLUTTER.matrix(n)).unwrap();
    let detector = Detector::new(known, &steering(n, 1.5)).unwrap();
    let block = |block: u64| {
        let mut random = random((n * 1000 + k) as u64, block);
        let mut detector = detector.clone();
        let mut training = Covariance::new(n);
        let mut cell = vec![Complex64::ZERO; n];
        let mut counts = [[0; T]; S];
        for _ in 0..BLOCK {
            training.clear();
            for _ in 0..k {
                CLUTTER.sample(&mut random, &mut cell);
                training.add(&cell);
            }
            detector.train(&training, Loading::Off).unwrap();
            CLUTTER.sample(&mut random, &mut cell);
            for (statistic, (thresholds, counts)) in
                statistics.iter().zip(thresholds.iter().zip(&mut counts))
            {
                let value = detector.evaluate(*statistic, &cell).value;
                for (threshold, count) in thresholds.iter().zip(counts) {
                    *count += u64::from(value > *threshold);
                }
            }
        }
        counts
    };
    let sum = |mut a: [[u64; T]; S], b: [[u64; T]; S]| {
        let pairs = a.as_flattened_mut().iter_mut().zip(b.as_flattened());
        pairs.for_each(|(a, b)| *a += b);
        a
    };
    (0..blocks)
        .into_par_iter()
        .map(block)
        .reduce(|| [[0; T]; S], sum)
}

#[test]
fn counted_false_alarms_agree_with_thresholds() {
    let probabilities = [1e-2, 1e-3];
    for training in [(2, 8), (3, 12), (6, 18)] {
        let blocks = 20;
        let counted = counts(training, ADAPTIVE, probabilities, blocks);
        let cells = (blocks * BLOCK) as f64;
        for (statistic, counted) in ADAPTIVE.iter().zip(counted) {
            for (probability, count) in probabilities.iter().zip(counted) {
                let deviation = (cells * probability * (1.0 - probability)).sqrt();
                let sigmas = (count as f64 - cells * probability) / deviation;
                println!("{statistic:?} {training:?} {probability:e}: {count} {sigmas:.2}");
                assert!(sigmas.abs() < 4.0, "{statistic:?} {training:?}: {sigmas}");
            }
        }
    }
}

/// AMF at low false-alarm probabilities. The environment variable `SUBAPERTURE_CELLS` sets the number of cells, for example 1e8.
#[test]
fn counted_rare_false_alarms_agree_with_thresholds() {
    let cells: f64 = match std::env::var("SUBAPERTURE_CELLS") {
        Ok(text) => text
            .parse()
            .expect("SUBAPERTURE_CELLS: expected a number of cells"),
        Err(_) => 1e6,
    };
    let blocks = (cells / BLOCK as f64).ceil() as u64;
    let cells = (blocks * BLOCK) as f64;
    let probabilities = [1e-4, 1e-6];
    let start = Instant::now();
    let [counted] = counts((2, 8), [Statistic::Amf], probabilities, blocks);
    println!("{cells} cells in {:.1} s", start.elapsed().as_secs_f64());
    for (probability, count) in probabilities.into_iter().zip(counted) {
        let [low, high] = interval(count as f64).map(|count| count / cells);
        let measured = count as f64 / cells;
        println!(
            "Pfa {probability:e}: {count} false alarms, {measured:.3e}, 95 % {low:.3e} to {high:.3e}"
        );
        let expected = cells * probability;
        let sigmas = (count as f64 - expected) / expected.sqrt();
        // Few expected events are Poisson: 6 and more of one have a probability of 6e-4.
        let bound = if expected > 20.0 { 4.0 } else { 5.0 };
        assert!(sigmas.abs() < bound, "{probability:e}: {count} of {cells}");
    }
}

/// Interval of 95 % confidence for the mean of a Poisson count (Byar's approximation).
fn interval(count: f64) -> [f64; 2] {
    let bound = |count: f64, sign: f64| {
        let root = 1.0 - 1.0 / (9.0 * count) + sign * 1.96 / (3.0 * count.sqrt());
        count * root.powi(3)
    };
    [
        if count > 0.0 { bound(count, -1.0) } else { 0.0 },
        bound(count + 1.0, 1.0),
    ]
}
