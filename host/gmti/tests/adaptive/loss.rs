//! SINR loss of estimated covariances against the known one.

use num_complex::Complex64;
use subaperture_gmti::adaptive::{Covariance, Loading, Whitener, mean_sinr_loss};

use crate::noise::{CLUTTER, random, steering};

const TRIALS: usize = 4000;

/// Reed, Mallett, Brennan 1974: mean `(K + 2 - N) / (K + 1)`, variance of `Beta(K - N + 2, N - 1)`. Loading far below the noise replaces the limit of `2 N` snapshots.
#[test]
fn sinr_loss_agrees_with_rmb() {
    for (n, k) in [
        (2, 4),
        (3, 12),
        (6, 9),
        (6, 12),
        (6, 18),
        (6, 60),
        (16, 29),
        (16, 64),
    ] {
        let known = Whitener::known(n, &CLUTTER.matrix(n)).unwrap();
        let s = steering(n, 1.5);
        let mut random = random(7, (n * 1000 + k) as u64);
        let mut cell = vec![Complex64::ZERO; n];
        let mut training = Covariance::new(n);
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..TRIALS {
            training.clear();
            for _ in 0..k {
                CLUTTER.sample(&mut random, &mut cell);
                training.add(&cell);
            }
            let estimate = training.factor(Loading::Relative(1e-10)).unwrap();
            let loss = estimate.sinr_loss(&s, &known);
            sum += loss;
            squares += loss * loss;
        }
        let trials = TRIALS as f64;
        let (p, q) = ((k + 2 - n) as f64, (n - 1) as f64);
        let expected = mean_sinr_loss(n, k);
        let variance = p * q / ((p + q).powi(2) * (p + q + 1.0));
        let mean = sum / trials;
        let sigmas = (mean - expected) / (variance / trials).sqrt();
        let ratio = (squares / trials - mean * mean) / variance;
        println!("N={n} K={k}: {mean:.4} {expected:.4} {sigmas:.2} variance {ratio:.3}");
        assert!(sigmas.abs() < 3.5, "{n} {k}: {sigmas}");
        assert!((ratio - 1.0).abs() < 0.15, "{n} {k}: {ratio}");
        if k == 2 * n - 3 {
            assert!((mean - 0.5).abs() < 0.01, "3 dB at K = 2 N - 3: {mean}");
        }
    }
}
