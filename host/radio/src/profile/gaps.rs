//! Carriers that are missing, by least squares.
//!
//! The rule: echoes lie between 0 and a reach `R`, alike strong on the mean at any range, with random phases. The responses at two
//! frequencies `d` apart then have the covariance
//!
//! ```text
//! C(d) = (1 / R) integral_0^R exp(-j 2 pi d 2 r / c) dr = exp(-j 2 pi d R / c) sinc(2 d R / c)
//! ```
//!
//! and the estimate of least mean square error of what is missing (`m`) by what is there (`k`) is `C_mk (C_kk + e I)^-1 z_k`, with `e`, 1e-4,
//! what noise there is taken to be. It is as good as there is redundancy: with `R` half the unambiguous range, every other
//! carrier would do; with all of it the carriers know nothing of each other, and what is missing becomes 0. A range profile of the values that are
//! there alone, at that: no worse.
//!
//! Cost: `k^3 / 6` products; `k` is 1024 at the most. Accuracy: the tests below.

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::dense::Factor;
use subaperture_signal::phase::phasor;

/// Most carriers that gaps are filled for.
pub const MOST_CARRIERS: usize = 1024;
/// Noise, of the power of a carrier.
const NOISE: f64 = 1e-4;

/// All carriers, `step_hz` apart, of those that are there. The text of an error says what is wrong.
///
/// # Errors
/// If `reach_m` is not above 0 and at most the unambiguous range; if there are gaps among more than 1024 carriers.
pub fn fill(
    values: &[Option<Complex64>],
    step_hz: f64,
    reach_m: f64,
) -> Result<Vec<Complex64>, String> {
    let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * step_hz);
    if !(reach_m > 0.0 && reach_m <= unambiguous_m * (1.0 + 1e-9)) {
        return Err(format!(
            "a reach of {reach_m} m; it is above 0 and no more than the unambiguous {unambiguous_m:.2} m"
        ));
    }
    let known: Vec<usize> = (0..values.len()).filter(|&n| values[n].is_some()).collect();
    let there: Vec<Complex64> = values.iter().flatten().copied().collect();
    if known.len() == values.len() {
        return Ok(there);
    }
    if values.len() > MOST_CARRIERS {
        return Err(format!(
            "gaps in {} carriers; they are filled among {MOST_CARRIERS} at the most",
            values.len()
        ));
    }
    // Turned by half the reach the covariance is real, and real and imaginary parts are two right sides.
    let half = |n: usize| phasor(0.5 * n as f64 * step_hz * 2.0 * reach_m / SPEED_OF_LIGHT_M_S);
    let covariance = covariance(values.len(), 2.0 * step_hz * reach_m / SPEED_OF_LIGHT_M_S);
    let of = |a: usize, b: usize| covariance[a.abs_diff(b)];
    let k = known.len();
    let mut matrix = vec![0.0; k * k];
    for (i, &a) in known.iter().enumerate() {
        for (j, &b) in known.iter().enumerate() {
            matrix[i * k + j] = of(a, b);
        }
        matrix[i * k + i] += NOISE;
    }
    let factor = Factor::new(k, &matrix, 0.0).ok_or("carriers that determine nothing")?;
    let turned = || known.iter().zip(&there).map(|(&n, z)| z * half(n));
    let [mut re, mut im]: [Vec<f64>; 2] = [
        turned().map(|z| z.re).collect(),
        turned().map(|z| z.im).collect(),
    ];
    factor.solve(&mut re);
    factor.solve(&mut im);
    let value = |n: usize| {
        values[n].unwrap_or_else(|| {
            let weights = re.iter().zip(&im);
            let each = known.iter().zip(weights);
            let sum: Complex64 = each
                .map(|(&b, (&re, &im))| Complex64::new(re, im) * of(n, b))
                .sum();
            sum * half(n).conj()
        })
    };
    Ok((0..values.len()).map(value).collect())
}

/// The covariance of carriers 0, 1, 2, ... steps apart where delays are within `share` of what can be told apart, evenly about 0.
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

    const STEP_HZ: f64 = 4e6;

    /// Three echoes off any grid, within 18 of 37.5 m.
    fn response(n: usize) -> Complex64 {
        let echoes = [(1.03, 1.0, 0.1), (6.31, 0.7, 0.5), (16.2, 0.9, 0.3)];
        let one = |(range_m, amplitude, turns): (f64, f64, f64)| {
            let frequency_hz = 1.1e9 + n as f64 * STEP_HZ;
            phasor(turns - frequency_hz * 2.0 * range_m / SPEED_OF_LIGHT_M_S) * amplitude
        };
        echoes.into_iter().map(one).sum()
    }

    /// Nine of fifty missing, two side by side, none at an edge; about twice sampled. The ridge alone, 1e-4 of a carrier's power, lets an error of
    /// its root through, 0.01 a unit of amplitude, for a gap of one, more for wider ones; measured is 0.0052 at the most. Bound: 0.05; not filled, a
    /// carrier would be off by its own magnitude, some 1.
    #[test]
    fn missing_carriers_come_back_where_echoes_lie_within_the_reach() {
        let missing = [4, 9, 14, 20, 21, 27, 33, 38, 44];
        let values: Vec<_> = (0..50)
            .map(|n| (!missing.contains(&n)).then(|| response(n)))
            .collect();
        let filled = fill(&values, STEP_HZ, 20.0).unwrap();
        for (n, value) in filled.iter().enumerate() {
            let error = (value - response(n)).norm();
            let bound = if missing.contains(&n) { 0.05 } else { 0.0 };
            println!("{n}: {error:.4}");
            assert!(error <= bound, "{n}: {error}");
        }
        // Carriers that know nothing of each other: nothing is made up.
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * STEP_HZ);
        let filled = fill(&values, STEP_HZ, unambiguous_m).unwrap();
        assert!(missing.iter().all(|&n| filled[n].norm() < 1e-9));
        assert!(
            fill(&values, STEP_HZ, 40.0)
                .unwrap_err()
                .contains("37.47 m")
        );
        assert!(fill(&values, STEP_HZ, f64::NAN).is_err());
    }
}
