//! Along-track interferometry (ATI): detection and radial velocity of a target from the interferogram of two registered channels.
//!
//! `u` and `w` are the values of a pixel in two channels, divided by the root mean square of the clutter and with the mean phase of the clutter removed. Clutter of coherence `rho` has the
//! density
//!
//! ```text
//! p(eta, psi) = 2 eta / (pi (1 - rho^2)) exp(2 eta rho cos psi / (1 - rho^2)) K_0(2 eta / (1 - rho^2)),   w u* = eta exp(j psi)
//! ```
//!
//! of the magnitude and phase of the single-look interferogram (Lee et al. 1994; Gierull 2004). Up to the slowly varying factor `eta^(1/2)`, its contours are those of the statistic
//!
//! ```text
//! T = 2 eta (1 - rho cos psi) / (1 - rho^2),
//! ```
//!
//! whose false-alarm probability is computed by quadrature. A phase threshold alone has false alarms at weak pixels, whose phase is random.
//!
//! The statistic depends on the amplitudes by their product only, so that it detects the part of a target in quadrature to the clutter. The difference of both channels
//! (DPCA) contains the other part too.
//!
//! A target without clutter has the phase `psi = 4 pi v tau / lambda` for the radial velocity `v` and the lag `tau` of the second channel. Velocities `lambda / (2 tau)` apart have the same phase.
//! Clutter in the pixel pulls the phase towards zero.
//!
//! **Sources.** Lee, Hoppel, Mango, Miller, "Intensity and phase statistics of multilook polarimetric and interferometric SAR imagery", IEEE Trans. GRS-32, 1994; Gierull, "Statistical analysis of
//! multilook SAR interferograms for CFAR detection of ground moving targets", IEEE Trans. GRS-42, 2004.

use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

use num_complex::Complex64;

/// Intervals of the quadrature over each variable.
const INTERVALS: usize = 64;

/// Statistics of the interferogram of two channels in clutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interferogram {
    /// Mean powers of the clutter in both channels.
    powers: [f64; 2],
    /// Complex coherence of the second channel with the first.
    coherence: Complex64,
}

impl Interferogram {
    /// Estimate powers and coherence from pixels of clutter, the values of both channels. `None` if a channel has no power.
    pub fn estimate(clutter: impl Iterator<Item = [Complex64; 2]>) -> Option<Self> {
        let (mut cross, mut powers, mut count) = (Complex64::ZERO, [0.0; 2], 0.0);
        for [u, w] in clutter {
            cross += w * u.conj();
            powers = [powers[0] + u.norm_sqr(), powers[1] + w.norm_sqr()];
            count += 1.0;
        }
        let norm = (powers[0] * powers[1]).sqrt();
        (norm > 0.0).then(|| Self {
            powers: powers.map(|power| power / count),
            coherence: cross / norm,
        })
    }

    /// Statistic `T` of a pixel, the values of both channels.
    pub fn statistic(&self, [u, w]: [Complex64; 2]) -> f64 {
        let rho = self.coherence.norm();
        let scale = (self.powers[0] * self.powers[1]).sqrt();
        let cross = w * u.conj() / scale;
        let in_phase = (cross * self.coherence.conj()).re;
        2.0 * (cross.norm() - in_phase) / (1.0 - rho * rho)
    }

    /// Probability that clutter alone exceeds a value of the statistic. The error of the estimated coherence is neglected.
    ///
    /// With `K_0(a) = integral_0^inf exp(-a cosh s) ds`, `d = 1 - rho cos psi` and `q^2 = (cosh s - 1) / d` the integral over the magnitude is elementary:
    ///
    /// ```text
    /// P(T > t) = (1 - rho^2) / (pi sqrt 2) integral dpsi d^(-3/2) integral_0^inf dq exp(-t (1 + q^2)) (t / (1 + q^2) + 1 / (1 + q^2)^2) / sqrt(1 + d q^2 / 2)
    /// ```
    ///
    /// and `tan(psi / 2) = sqrt((1 - rho) / (1 + rho)) tan theta` removes the peak at zero phase.
    pub fn false_alarm_probability(&self, statistic: f64) -> f64 {
        let t = statistic.max(0.0);
        let rho = self.coherence.norm();
        let ratio = (1.0 - rho) / (1.0 + rho);
        let over_phase = |theta: f64| {
            let (sin, cos) = (libm::sin(theta), libm::cos(theta));
            // cos(theta) / cos(psi / 2), with tan(psi / 2)^2 = ratio tan(theta)^2.
            let cosines = (cos * cos + ratio * sin * sin).sqrt();
            let d = (1.0 - rho) / (cosines * cosines).max(1e-300);
            // q = tan(x): the range of q is finite in x.
            let over_q = |x: f64| {
                let cos = libm::cos(x).max(1e-12);
                let square = 1.0 / (cos * cos);
                let q_square = square - 1.0;
                let inner = (t + 1.0 / square) / (1.0 + d * q_square / 2.0).sqrt();
                // dq = (1 + q^2) dx cancels one factor.
                libm::exp(-t * square) * inner
            };
            cosines * simpson(FRAC_PI_2, over_q)
        };
        2.0 * SQRT_2 / PI * (1.0 + rho).sqrt() * simpson(FRAC_PI_2, over_phase)
    }

    /// Phase of a pixel relative to the clutter, radians.
    pub fn phase_rad(&self, [u, w]: [Complex64; 2]) -> f64 {
        (w * u.conj() * self.coherence.conj()).arg()
    }
}

/// Radial velocity of an interferometric phase, metres per second, positive when approaching, for the lag of the second channel in seconds, and the interval of velocities without ambiguity.
pub fn radial_velocity_m_s(phase_rad: f64, lag_s: f64, wavelength_m: f64) -> (f64, f64) {
    let ambiguity_m_s = wavelength_m / (2.0 * lag_s);
    (phase_rad / (2.0 * PI) * ambiguity_m_s, ambiguity_m_s.abs())
}

/// Integral from 0 to `end` by Simpson's rule.
fn simpson(end: f64, function: impl Fn(f64) -> f64) -> f64 {
    let step = end / INTERVALS as f64;
    let weight = |i: usize| match i {
        0 | INTERVALS => 1.0,
        _ if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let terms = (0..=INTERVALS).map(|i| weight(i) * function(i as f64 * step));
    terms.sum::<f64>() * step / 3.0
}
