//! Delay between the receivers from phases over carriers, and spread of phases over retunes.

use std::f64::consts::TAU;

use num_complex::Complex64;
use subaperture_signal::phase::phasor;

use crate::tone::Mixed;

/// Delay of receiver 1 relative to receiver 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Delay {
    /// Delay of receiver 1 minus that of receiver 0, seconds.
    pub(super) delay_s: f64,
    /// Standard deviation of the delay, seconds.
    pub(super) deviation_s: f64,
    /// RMS deviation of the phases from a line, radians.
    pub(super) residual_rad: f64,
    /// Delays beyond this are ambiguous, seconds.
    pub(super) unambiguous_s: f64,
    /// Number of carriers of the fit.
    pub(super) carriers: usize,
}

fn argument(z: Complex64) -> f64 {
    libm::atan2(z.im, z.re)
}

/// Fit a delay to quotients by frequency in hertz, ascending. The phase steps between neighbours of the smallest
/// spacing give a delay without unwrapping; a line through the remaining phases refines it. `None` for fewer than four
/// carriers.
pub(super) fn fit(quotients: &[(f64, Complex64)]) -> Option<Delay> {
    let count = quotients.len();
    if count < 4 {
        return None;
    }
    let spacings = quotients.windows(2).map(|pair| pair[1].0 - pair[0].0);
    let spacing_hz = spacings.fold(f64::INFINITY, f64::min);
    let near = |pair: &&[(f64, Complex64)]| pair[1].0 - pair[0].0 < 1.5 * spacing_hz;
    let steps = quotients.windows(2).filter(near);
    let turn: Complex64 = steps.map(|pair| pair[1].1 * pair[0].1.conj()).sum();
    let coarse_s = -argument(turn) / (TAU * spacing_hz);
    let at = |(hz, z): &(f64, Complex64)| z / z.norm() * phasor(hz * coarse_s);
    let mean: Complex64 = quotients.iter().map(at).sum();
    let left = quotients.iter().map(|one| argument(at(one) * mean.conj()));
    let left: Vec<f64> = left.collect();
    let n = count as f64;
    let centre_hz = quotients.iter().map(|one| one.0).sum::<f64>() / n;
    let centre_rad = left.iter().sum::<f64>() / n;
    let (mut spread, mut cross) = (0.0, 0.0);
    for ((hz, _), phase) in quotients.iter().zip(&left) {
        spread += (hz - centre_hz) * (hz - centre_hz);
        cross += (hz - centre_hz) * (phase - centre_rad);
    }
    let slope = cross / spread;
    let square = |((hz, _), phase): (&(f64, Complex64), &f64)| {
        let off = phase - centre_rad - slope * (hz - centre_hz);
        off * off
    };
    let squares: f64 = quotients.iter().zip(&left).map(square).sum();
    let residual_rad = (squares / (n - 2.0)).sqrt();
    Some(Delay {
        delay_s: coarse_s - slope / TAU,
        deviation_s: residual_rad / spread.sqrt() / TAU,
        residual_rad,
        unambiguous_s: 0.5 / spacing_hz,
        carriers: count,
    })
}

/// RMS deviation in radians of the phases of each carrier from their mean; `None` without a carrier of two bursts.
pub(super) fn repeatability_rad(
    repeats: &[Vec<Mixed>],
    of: impl Fn(&Mixed) -> Complex64,
) -> Option<f64> {
    let (mut squares, mut free) = (0.0, 0.0);
    for bursts in repeats.iter().filter(|bursts| bursts.len() > 1) {
        let unit = |mixed: &Mixed| {
            let z = of(mixed);
            z / z.norm()
        };
        let mean: Complex64 = bursts.iter().map(unit).sum();
        for mixed in bursts {
            let off = argument(unit(mixed) * mean.conj());
            squares += off * off;
        }
        free += bursts.len() as f64 - 1.0;
    }
    (free > 0.0).then(|| (squares / free).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exact delay from unwrapped phases of 50 carriers, one left out; alternating phases of 0.01 rad are the
    /// residual.
    #[test]
    fn delay_of_exact_phases_is_exact() {
        for delay_s in [-100e-9, -14.5e-9, 0.0, 3e-9, 120e-9] {
            let off = |n: i32| if n % 2 == 0 { 0.01 } else { -0.01 } / TAU;
            let one = |n: i32| {
                let hz = 1.1e9 + 4e6 * f64::from(n);
                (hz, phasor(0.3 - hz * delay_s + off(n)) * 0.2)
            };
            let all: Vec<_> = (0..50).filter(|&n| n != 17).map(one).collect();
            let found = fit(&all).unwrap();
            assert!(
                (found.delay_s - delay_s).abs() < 4.0 * found.deviation_s,
                "{found:?}"
            );
            assert!((found.residual_rad - 0.01).abs() < 5e-4, "{found:?}");
            // 0.01 rad over 49 carriers, whose RMS distance from the middle is 57.6 MHz.
            let expected_s = 0.01 / TAU / 57.6e6 / 7.0;
            assert!((found.deviation_s / expected_s - 1.0).abs() < 0.05);
            assert_eq!((found.carriers, found.unambiguous_s), (49, 125e-9));
        }
        assert_eq!(fit(&[(1.0, Complex64::ONE); 3]), None);
    }
}
