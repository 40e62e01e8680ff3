//! Phasors from phases in turns, reduced in float64. Sines are computed by libm, so that results are bit-identical on
//! every machine.

use num_complex::{Complex, Complex32, Complex64};

/// Phasor `exp(j 2 pi turns)` in float64. Reduction to one turn keeps the error at `|turns| * 1e-16` turns.
#[inline]
pub fn phasor(turns: f64) -> Complex64 {
    let (quarter, left) = nearest_quarter(turns);
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * left);
    rotate_quarters(quarter, Complex64::new(cos, sin))
}

/// Phasor `exp(j 2 pi turns)` in float32, with an error of 2e-7.
#[inline]
pub fn phasor32(turns: f64) -> Complex32 {
    let (quarter, left) = nearest_quarter(turns);
    let (sin, cos) = libm::sincosf(std::f32::consts::TAU * left as f32);
    rotate_quarters(quarter, Complex32::new(cos, sin))
}

/// Phasor `exp(j rad)` in float64.
#[inline]
pub fn cis(rad: f64) -> Complex64 {
    let (sin, cos) = libm::sincos(rad);
    Complex64::new(cos, sin)
}

/// Nearest quarter turn, 0 to 3, and the remainder in turns: at most an eighth, for which sines are fastest.
#[inline]
fn nearest_quarter(turns: f64) -> (i64, f64) {
    let left = turns - turns.round();
    let quarter = (4.0 * left).round();
    (quarter as i64 & 3, left - 0.25 * quarter)
}

/// Multiply by `j^quarter`.
#[inline]
fn rotate_quarters<T: Copy + std::ops::Neg<Output = T>>(quarter: i64, z: Complex<T>) -> Complex<T> {
    match quarter {
        0 => z,
        1 => Complex::new(-z.im, z.re),
        2 => Complex::new(-z.re, -z.im),
        _ => Complex::new(z.im, -z.re),
    }
}

/// Round both parts to float32.
#[inline]
pub fn narrow(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}

/// Convert both parts to float64.
#[inline]
pub fn widen(z: Complex32) -> Complex64 {
    Complex64::new(f64::from(z.re), f64::from(z.im))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The phase of some turns is rounded to 1e-16 of each turn, its sine to 1e-16; in float32 both to 1e-7.
    #[test]
    fn phasors_match_platform_sines_within_rounding() {
        for i in -4000..4000 {
            let turns = f64::from(i) / 1024.0;
            let expected = Complex64::cis(std::f64::consts::TAU * turns);
            assert!((phasor(turns) - expected).norm() < 5e-15, "{turns}");
            assert!((widen(phasor32(turns)) - expected).norm() < 2e-7, "{turns}");
            assert!(
                (cis(turns) - Complex64::cis(turns)).norm() < 1e-15,
                "{turns}"
            );
        }
        let quarters = [0.0, 0.25, -0.5, 7.75].map(phasor);
        let exact = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
        assert_eq!(quarters, exact.map(|(re, im)| Complex64::new(re, im)));
    }
}
