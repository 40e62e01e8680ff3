//! Interpolation of missing carriers: point scatterers by CLEAN, then least squares for the residual.
//!
//! Echoes are assumed between range 0 and a maximum range `R`. The part of the response that a few points explain is
//! attributed to them (`points`, a CLEAN); a point is known at every carrier. The residual is modelled as echoes of
//! equal mean power at all ranges with random phases. Its covariance between two frequencies `d` apart is
//!
//! ```text
//! C(d) = (1 / R) integral_0^R exp(-j 2 pi d 2 r / c) dr = exp(-j 2 pi d R / c) sinc(2 d R / c)
//! ```
//!
//! The minimum mean square error estimate of the missing values (`m`) from the known ones (`k`) is `C_mk (C_kk + e
//! I)^-1 z_k`, with `e` the ratio of noise to that power. `e` is chosen from 1e-4 to 10 in decades by maximum
//! likelihood of the known carriers:
//!
//! ```text
//! K ln(z^H (C_kk + e I)^-1 z / K) + ln det(C_kk + e I)   minimum
//! ```
//!
//! **Why both.** Least squares interpolates as far as there is redundancy: a gap of `g` carriers needs `g` below about
//! `1 / (R / R_u)`, where `R_u` is the unambiguous range. In the middle of a wider gap the estimate tends to 0. Points
//! fill any gap if they are few. **Why `e` is not fixed.** With a value too small, the estimate in the middle of a wide
//! gap is wrong by many times the signal. The table has the errors relative to the power of the missing carriers in dB,
//! as medians of 15 random scenes (last test below), for 8 adjacent carriers missing of 50 and `R` half of `R_u`; in
//! parentheses, least squares alone with a fixed `e` of 1e-4:
//!
//! | echoes | noise -45 dB | -20 dB | -5 dB |
//! |---|---|---|---|
//! | 3 | -39 (-11) | -21 (+8) | -8 (+24) |
//! | 8 | -15 (-6) | -10 (+8) | -2 (+23) |
//! | 20 | -6 (-7) | -3 (+7) | -1 (+23) |
//! | 100 | -5 (-6) | -2 (+7) | 0 (+23) |
//!
//! An error of 0 dB is that of leaving the gap at zero. For single missing carriers both methods have errors little
//! above the noise.
//!
//! Cost: per point, an FFT of eight times the number of carriers; `k^3 / 6` products for each `e` tried, usually two;
//! `k` is at most 1024.

mod points;

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::dense::Factor;
use subaperture_signal::phase::phasor;

/// Maximum number of carriers with gaps.
pub const MAX_CARRIERS: usize = 1024;
/// Ratios of noise to carrier power that are tried.
const NOISE: [f64; 6] = [1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0];

/// Fill the gaps of a response with carriers `step_hz` apart, for echoes up to `reach_m`. The error is a message.
///
/// # Errors
/// If `reach_m` is not above 0 and at most the unambiguous range, or if there are gaps among more than 1024 carriers.
pub fn fill(
    values: &[Option<Complex64>],
    step_hz: f64,
    reach_m: f64,
) -> Result<Vec<Complex64>, String> {
    let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * step_hz);
    if !(reach_m > 0.0 && reach_m <= unambiguous_m * (1.0 + 1e-9)) {
        return Err(format!(
            "reach of {reach_m} m: expected a value above 0 and at most the unambiguous range of {unambiguous_m:.2} m"
        ));
    }
    let known: Vec<usize> = (0..values.len()).filter(|&n| values[n].is_some()).collect();
    if known.len() == values.len() {
        return Ok(values.iter().flatten().copied().collect());
    }
    if values.len() > MAX_CARRIERS {
        return Err(format!(
            "gaps in {} carriers: expected at most {MAX_CARRIERS}",
            values.len()
        ));
    }
    let share = reach_m / unambiguous_m;
    let mut left: Vec<Complex64> = values
        .iter()
        .map(|value| value.unwrap_or_default())
        .collect();
    let points = points::extract(&mut left, &known, share);
    let rest = rest(&left, &known, share)?;
    let all = values.iter().zip(points.iter().zip(rest));
    Ok(all
        .map(|(value, (point, rest))| value.unwrap_or(point + rest))
        .collect())
}

/// Least-squares estimate, at all carriers, of the residual of the known carriers.
fn rest(left: &[Complex64], known: &[usize], share: f64) -> Result<Vec<Complex64>, String> {
    // After a phase rotation by half the reach the covariance is real, so that real and imaginary parts are two
    // right-hand sides.
    let half = |n: usize| phasor(0.5 * n as f64 * share);
    let covariance = covariance(left.len(), share);
    let k = known.len();
    let mut matrix = vec![0.0; k * k];
    for (row, &a) in matrix.chunks_exact_mut(k).zip(known) {
        for (value, &b) in row.iter_mut().zip(known) {
            *value = covariance[a.abs_diff(b)];
        }
    }
    let turned: Vec<Complex64> = known.iter().map(|&n| left[n] * half(n)).collect();
    if turned.iter().all(|z| *z == Complex64::ZERO) {
        return Ok(vec![Complex64::ZERO; left.len()]);
    }
    let parts: [Vec<f64>; 2] = [
        turned.iter().map(|z| z.re).collect(),
        turned.iter().map(|z| z.im).collect(),
    ];
    let (mut best, mut least) = (None, f64::INFINITY);
    for noise in NOISE {
        let mut with = matrix.clone();
        (0..k).for_each(|i| with[i * k + i] += noise);
        let Some(factor) = Factor::new(k, &with, 0.0) else {
            continue;
        };
        let solved = parts.each_ref().map(|part| {
            let mut part = part.clone();
            factor.solve(&mut part);
            part
        });
        let products = parts.iter().flatten().zip(solved.iter().flatten());
        let square: f64 = products.map(|(z, weighed)| z * weighed).sum();
        let unlikely = k as f64 * libm::log(square / k as f64) + factor.log_determinant();
        // The likelihood has a single minimum in practice.
        if unlikely > least {
            break;
        }
        (best, least) = (Some(solved), unlikely);
    }
    let [re, im] =
        best.ok_or("singular covariance: the carriers do not determine the missing ones")?;
    let value = |n: usize| {
        let weights = known.iter().zip(re.iter().zip(&im));
        let sum: Complex64 = weights
            .map(|(&b, (&re, &im))| Complex64::new(re, im) * covariance[n.abs_diff(b)])
            .sum();
        sum * half(n).conj()
    };
    Ok((0..left.len()).map(value).collect())
}

/// Covariance of carriers 0, 1, 2, ... steps apart, for delays uniformly distributed about 0 over `share` of the
/// unambiguous interval.
pub(super) fn covariance(count: usize, share: f64) -> Vec<f64> {
    let of = |apart: usize| {
        let x = std::f64::consts::PI * apart as f64 * share;
        if x == 0.0 { 1.0 } else { libm::sin(x) / x }
    };
    (0..count).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use subaperture_simulate::random::unit;

    const STEP_HZ: f64 = 4e6;
    const UNAMBIGUOUS_M: f64 = SPEED_OF_LIGHT_M_S / (2.0 * STEP_HZ);

    /// Response of echoes, each given by range (metres), amplitude and phase (turns).
    fn response(echoes: &[(f64, f64, f64)], n: usize) -> Complex64 {
        let one = |&(range_m, amplitude, turns): &(f64, f64, f64)| {
            let frequency_hz = 1.1e9 + n as f64 * STEP_HZ;
            phasor(turns - frequency_hz * 2.0 * range_m / SPEED_OF_LIGHT_M_S) * amplitude
        };
        echoes.iter().map(one).sum()
    }

    /// Three echoes off any grid, within 18 m of the unambiguous 37.5 m.
    const THREE: [(f64, f64, f64); 3] = [(1.03, 1.0, 0.1), (6.31, 0.7, 0.5), (16.2, 0.9, 0.3)];

    /// Nine of fifty carriers are missing, two of them adjacent, none at an edge; the reach is about half the
    /// unambiguous range. The smallest noise tried, 1e-4 of a carrier's power, allows an amplitude error of its square
    /// root, 0.01, in a gap of one carrier, and more in wider gaps. Bound: 0.05. An unfilled carrier would be in error
    /// by its own magnitude, about 1.
    #[test]
    fn missing_carriers_are_recovered_for_echoes_within_reach() {
        let missing = [4, 9, 14, 20, 21, 27, 33, 38, 44];
        let values: Vec<_> = (0..50)
            .map(|n| (!missing.contains(&n)).then(|| response(&THREE, n)))
            .collect();
        // Points are recovered even with a reach equal to the unambiguous range.
        for reach_m in [20.0, UNAMBIGUOUS_M] {
            let filled = fill(&values, STEP_HZ, reach_m).unwrap();
            for (n, value) in filled.iter().enumerate() {
                let error = (value - response(&THREE, n)).norm();
                let bound = if missing.contains(&n) { 0.05 } else { 0.0 };
                println!("{reach_m} {n}: {error:.4}");
                assert!(error <= bound, "{n}: {error}");
            }
        }
        let refused = fill(&values, STEP_HZ, 40.0).unwrap_err();
        assert!(refused.contains("37.47 m"), "{refused}");
        assert!(fill(&values, STEP_HZ, f64::NAN).is_err());
    }

    /// Error of 8 missing carriers relative to their mean power, in dB, for random scenes of `echoes` within 18 m and
    /// with noise: median of 15.
    fn wide_gap_db(echoes: usize, noise_db: f64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(echoes as u64);
        let mut unit = || unit(&mut random);
        let noise = libm::exp10(noise_db / 20.0) * (echoes as f64).sqrt();
        let mut errors: Vec<f64> = (0..15)
            .map(|_| {
                let scene: Vec<_> = (0..echoes)
                    .map(|_| (0.8 + 16.0 * unit(), 0.5 + 0.5 * unit(), unit()))
                    .collect();
                let all: Vec<Complex64> = (0..50).map(|n| response(&scene, n)).collect();
                let power = all.iter().map(Complex64::norm_sqr).sum::<f64>() / 50.0;
                let values: Vec<_> = (0..50)
                    .map(|n| {
                        // Noise of unit power: real and imaginary parts uniform with a full width of 2 sqrt(3 / 2).
                        let [a, b] = [unit(), unit()].map(|u| (u - 0.5) * 6f64.sqrt());
                        let there = !(16..24).contains(&n);
                        there.then(|| all[n] + Complex64::new(a, b) * noise)
                    })
                    .collect();
                let filled = fill(&values, STEP_HZ, 18.0).unwrap();
                let error: f64 = (16..24).map(|n| (filled[n] - all[n]).norm_sqr()).sum();
                10.0 * libm::log10(error / (8.0 * power))
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        println!("{echoes} echoes, noise {noise_db} dB: {:.1} dB", errors[7]);
        errors[7]
    }

    /// A gap of 8 of 50 carriers is four times as wide as a reach of half the unambiguous range can bridge. A few
    /// points are recovered to about the noise. With many echoes the error does not exceed that of an empty gap, 0 dB,
    /// by more than the scatter of a median of 15, and noise does not become echoes.
    #[test]
    fn wide_gap_is_filled_by_points_and_never_by_noise() {
        for (echoes, bounds_db) in [
            (3, [-30.0, -12.0, -3.0]),
            (8, [-8.0, -5.0, 1.0]),
            (20, [1.0; 3]),
            (100, [1.0; 3]),
        ] {
            for (noise_db, bound_db) in [-45.0, -20.0, -5.0].into_iter().zip(bounds_db) {
                let error_db = wide_gap_db(echoes, noise_db);
                assert!(error_db < bound_db, "{echoes} {noise_db}: {error_db}");
            }
        }
    }
}
