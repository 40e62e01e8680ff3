//! Antennas of a channel to be written, as gain polynomials and axes over time.
//!
//! A frame has its X axis to the left of the boresight (`up x boresight`) and its Y axis along `up`, so that Z is the boresight and `EB` is 0.
//! With `x = DCX`, `y = DCY` and half-power widths `w`, `v` in azimuth and elevation the one-way gain in dB is
//!
//! ```text
//! Gaussian: -40 log10(e) ln 2 ((asin(x / sqrt(1 - y^2)) / w)^2 + (asin(y) / v)^2)
//! Cosine:   (10 / ln 10) (q_az (ln(1 - x^2 - y^2) - ln(1 - y^2)) + q_el ln(1 - y^2))
//! Aperture: 20 log10(sinc(h x / sin(w/2)) sinc(h y / sin(v/2))),    sinc(h) = 1 / sqrt 2
//! ```
//!
//! from `asin(x)^2 = sum (2x)^(2n) / (2 n^2 C(2n, n))`, `ln sinc(x) = -sum zeta(2n) x^(2n) / n` and `(1 - y^2)^-n`, each up to the exponent [`EXPONENT`].
//! Within 20 deg of the boresight the truncation is below 1e-4 dB for a width of 40 deg; an aperture has no side lobes.
//!
//! A pattern of samples ([`Pattern::Table`]) has no such polynomial: its antenna is not written, and neither is the other of its channel. An antenna steered
//! to a point has the axes of each pulse.
//!
//! Axes are polynomials of time, as few coefficients as suffice, at most [`TERMS`]. An antenna whose axes are further off them than 1 % of its narrowest width
//! is not written, and neither is the other of its channel.

use glam::{DQuat, DVec3};
use subaperture_signal::dense;

use subaperture_model::antenna::cosine_exponent;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::Pulse;
use subaperture_model::radar::{Antenna, MountedAntennas, Pattern};

/// Largest exponent of a direction cosine.
const EXPONENT: usize = 16;
/// Maximum number of coefficients of an axis over time.
const TERMS: usize = 6;
/// Largest error of axes that counts as exact, radians.
const EXACT_RAD: f64 = 1e-9;
/// Largest error of an axis, relative to the narrowest half-power width.
const AXIS_ERROR: f64 = 0.01;
/// Largest error of the axes of an isotropic antenna, radians.
const ANY_RAD: f64 = 0.1;
/// `zeta(2 n)`, n from 1.
const ZETA: [f64; 8] = [
    1.644_934_066_848_226_4,
    1.082_323_233_711_138_2,
    1.017_343_061_984_449,
    1.004_077_356_197_944_3,
    1.000_994_575_127_818_1,
    1.000_246_086_553_308,
    1.000_061_248_135_058_7,
    1.000_015_282_259_408_6,
];
/// Positive solution of `sin(pi x) / (pi x) = 1 / sqrt 2`.
const HALF_POWER: f64 = 0.442_946_470_689_452_3;

/// Antennas of a channel, ready to be written.
pub(super) struct Described<'a> {
    pub(super) antennas: &'a [Antenna; 2],
    pub(super) axes: [AxisPolynomials; 2],
    pub(super) freq_zero_hz: f64,
}

/// X and Y axis in ECF, each of x, y, z, coefficients over time.
pub(super) type AxisPolynomials = [[Vec<f64>; 3]; 2];

impl<'a> Described<'a> {
    /// `None` if the axes do not follow polynomials of time.
    pub(super) fn new(
        carried: &'a MountedAntennas,
        frame: &SceneFrame,
        pulses: &[Pulse],
        freq_zero_hz: f64,
    ) -> Option<Self> {
        let times_s: Vec<f64> = pulses.iter().map(|pulse| pulse.time_s).collect();
        let axes = |i: usize| {
            let antenna = &carried.antennas[i];
            if let Pattern::Table(_) = antenna.pattern {
                return None;
            }
            let narrowest_rad = antenna.narrowest_rad();
            let most_rad = narrowest_rad.map_or(ANY_RAD, |width_rad| AXIS_ERROR * width_rad);
            let axis = |which: usize| -> Option<[Vec<f64>; 3]> {
                let turned = |(attitudes, pulse): (&[DQuat; 2], &Pulse)| {
                    let from_m = [pulse.transmitter_m, pulse.receiver_m][i];
                    let axes = antenna.axes(attitudes[i], from_m);
                    frame.direction_to_ecf(axes[which].normalize_or_zero())
                };
                let axis = carried.attitudes.iter().zip(pulses).map(turned);
                fit(&times_s, &axis.collect::<Vec<_>>(), most_rad)
            };
            Some([axis(1)?, axis(2)?])
        };
        (carried.attitudes.len() == pulses.len()).then_some(())?;
        Some(Self {
            antennas: &carried.antennas,
            axes: [axes(0)?, axes(1)?],
            freq_zero_hz,
        })
    }
}

/// Coefficients over time of unit vectors, the fewest that are within [`EXACT_RAD`], or else the most.
fn fit(times_s: &[f64], vectors: &[DVec3], most_rad: f64) -> Option<[Vec<f64>; 3]> {
    let (first_s, last_s) = (*times_s.first()?, *times_s.last()?);
    let (middle_s, half_s) = (
        0.5 * (first_s + last_s),
        (0.5 * (last_s - first_s)).max(1e-9),
    );
    let mut best = None;
    for terms in 1..=TERMS.min(times_s.len()) {
        let Some(scaled) = least_squares(times_s, vectors, (middle_s, half_s), terms) else {
            break;
        };
        let coefficients = scaled.map(|line| shifted(&line, middle_s, half_s));
        let error_rad = times_s.iter().zip(vectors).map(|(&time_s, vector)| {
            let [x, y, z] = coefficients
                .each_ref()
                .map(|line| line.iter().rev().fold(0.0, |sum, c| sum * time_s + c));
            DVec3::new(x, y, z).distance(*vector)
        });
        let error_rad = error_rad.fold(0.0, f64::max);
        if best.as_ref().is_none_or(|(_, least)| error_rad < *least) {
            best = Some((coefficients, error_rad));
        }
        if error_rad <= EXACT_RAD {
            break;
        }
    }
    best.filter(|(_, error_rad)| *error_rad <= most_rad)
        .map(|(coefficients, _)| coefficients)
}

/// Coefficients over `(t - middle) / half`.
fn least_squares(
    times_s: &[f64],
    vectors: &[DVec3],
    (middle_s, half_s): (f64, f64),
    terms: usize,
) -> Option<[Vec<f64>; 3]> {
    let mut matrix = vec![0.0; terms * terms];
    let mut right = [(); 3].map(|()| vec![0.0; terms]);
    for (time_s, vector) in times_s.iter().zip(vectors) {
        let u = (time_s - middle_s) / half_s;
        let powers: Vec<f64> = (0..terms).map(|n| u.powi(n as i32)).collect();
        for m in 0..terms {
            for n in 0..terms {
                matrix[m * terms + n] += powers[m] * powers[n];
            }
            for (right, part) in right.iter_mut().zip(vector.to_array()) {
                right[m] += powers[m] * part;
            }
        }
    }
    let [x, y, z] = right.map(|right| dense::solve(&matrix, &right));
    Some([x?, y?, z?])
}

/// Coefficients over `t` of a polynomial of `(t - middle) / half`, by Horner's scheme.
fn shifted(scaled: &[f64], middle_s: f64, half_s: f64) -> Vec<f64> {
    let mut line = vec![0.0; scaled.len()];
    for coefficient in scaled.iter().rev() {
        for n in (0..line.len()).rev() {
            let lower = if n > 0 { line[n - 1] } else { 0.0 };
            line[n] = (lower - middle_s * line[n]) / half_s;
        }
        line[0] += coefficient;
    }
    line
}

/// Gain in dB: exponents of DCX and DCY, coefficient.
pub(super) fn gain_db(pattern: &Pattern) -> Vec<(usize, usize, f64)> {
    let db = 10.0 / std::f64::consts::LN_10;
    let mut terms = vec![(0, 0, 0.0)];
    match *pattern {
        Pattern::Isotropic => {}
        Pattern::Gaussian {
            azimuth_rad,
            elevation_rad,
        } => {
            let scale =
                |width_rad: f64| -4.0 * std::f64::consts::LN_2 * db / (width_rad * width_rad);
            // (2 x)^(2n) / (2 n^2 C(2n, n)).
            let mut of_square = 1.0;
            for n in 1..=EXPONENT / 2 {
                if n > 1 {
                    let m = (n - 1) as f64;
                    of_square *= 4.0 * m * m / ((2.0 * m + 1.0) * (2.0 * m + 2.0));
                }
                terms.push((0, 2 * n, scale(elevation_rad) * of_square));
                // (1 - y^2)^-n = sum C(n + m - 1, m) y^(2m).
                let mut binomial = 1.0;
                for m in 0..=(EXPONENT / 2 - n) {
                    if m > 0 {
                        binomial *= (n + m - 1) as f64 / m as f64;
                    }
                    terms.push((2 * n, 2 * m, scale(azimuth_rad) * of_square * binomial));
                }
            }
        }
        Pattern::Cosine {
            azimuth_rad,
            elevation_rad,
        } => {
            let [azimuth, elevation] = [azimuth_rad, elevation_rad].map(cosine_exponent);
            // ln(1 - u) = -sum u^n / n, and (x^2 + y^2)^n = sum C(n, m) x^(2 (n - m)) y^(2 m).
            for n in 1..=EXPONENT / 2 {
                let term = -db / n as f64;
                let mut binomial = 1.0;
                for m in 0..n {
                    terms.push((2 * (n - m), 2 * m, azimuth * term * binomial));
                    binomial *= (n - m) as f64 / (m + 1) as f64;
                }
                // That of y^(2 n) has azimuth - azimuth + elevation.
                terms.push((0, 2 * n, elevation * term));
            }
        }
        // Described::new refuses tables.
        Pattern::Table(_) => {}
        Pattern::Aperture {
            azimuth_rad,
            elevation_rad,
        } => {
            for (n, zeta) in (1..=EXPONENT / 2).zip(ZETA) {
                let term = |width_rad: f64| {
                    let scale = HALF_POWER / libm::sin(0.5 * width_rad);
                    -2.0 * db * zeta / n as f64 * libm::pow(scale, 2.0 * n as f64)
                };
                terms.push((2 * n, 0, term(azimuth_rad)));
                terms.push((0, 2 * n, term(elevation_rad)));
            }
        }
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(terms: &[(usize, usize, f64)], x: f64, y: f64) -> f64 {
        let term = |&(m, n, c): &(usize, usize, f64)| c * x.powi(m as i32) * y.powi(n as i32);
        terms.iter().map(term).sum()
    }

    /// The polynomials against `Antenna::amplitude`, which evaluates another formula.
    #[test]
    fn gain_polynomials_match_patterns_within_main_lobe() {
        let (azimuth_rad, elevation_rad) = (40f64.to_radians(), 60f64.to_radians());
        for pattern in [
            Pattern::Gaussian {
                azimuth_rad,
                elevation_rad,
            },
            Pattern::Cosine {
                azimuth_rad,
                elevation_rad,
            },
            Pattern::Aperture {
                azimuth_rad,
                elevation_rad,
            },
        ] {
            let antenna = Antenna {
                name: "a".to_owned(),
                offset_m: DVec3::ZERO,
                boresight: DVec3::Y,
                up: DVec3::Z,
                pattern: pattern.clone(),
                aim_m: None,
            };
            let terms = gain_db(&pattern);
            for az_deg in [-20.0, -7.0, 0.0, 13.0, 20.0f64] {
                for el_deg in [-20.0, 0.0, 11.0f64] {
                    let (az, el) = (az_deg.to_radians(), el_deg.to_radians());
                    // Left of a boresight along y with z up is -x.
                    let (x, y) = (az.sin() * el.cos(), el.sin());
                    let towards = DVec3::new(-x, az.cos() * el.cos(), y);
                    let expected = 20.0 * antenna.amplitude(DQuat::IDENTITY, towards).log10();
                    let error = (value(&terms, x, y) - expected).abs();
                    assert!(error < 1e-3, "{pattern:?} {az_deg} {el_deg}: {error}");
                }
            }
        }
    }

    #[test]
    fn axes_are_fitted_with_fewest_sufficient_coefficients() {
        let times_s: Vec<f64> = (0..50).map(|n| 1000.0 + 0.1 * n as f64).collect();
        let still = vec![DVec3::X; 50];
        assert_eq!(fit(&times_s, &still, 1e-3).unwrap()[0].len(), 1);
        let turning = |rate: f64| -> Vec<DVec3> {
            let at = |t: &f64| {
                DVec3::new(
                    (rate * (t - 1000.0)).cos(),
                    (rate * (t - 1000.0)).sin(),
                    0.0,
                )
            };
            times_s.iter().map(at).collect()
        };
        // A quarter turn; and three turns, which five orders do not follow.
        let axis = fit(&times_s, &turning(0.3), 1e-3).unwrap();
        let at = |line: &[f64]| line.iter().rev().fold(0.0, |sum, c| sum * 1002.5 + c);
        assert!((at(&axis[0]) - 0.75f64.cos()).abs() < 1e-3);
        assert!(fit(&times_s, &turning(3.8), 1e-3).is_none());
    }
}
