//! Phases as turns: reduced in float64, then turned into a phasor.

use num_complex::{Complex32, Complex64};

/// `exp(j 2 pi turns)` in float64. Reducing first keeps the error at `|turns| * 1e-16` turns.
#[inline]
pub fn phasor(turns: f64) -> Complex64 {
    Complex64::cis(std::f64::consts::TAU * (turns - turns.round()))
}

/// [`phasor`] in float32, error 2e-7.
#[inline]
pub fn phasor32(turns: f64) -> Complex32 {
    Complex32::cis(std::f32::consts::TAU * (turns - turns.round()) as f32)
}

/// Both parts rounded to float32.
#[inline]
pub fn narrow(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}

/// Both parts as float64.
#[inline]
pub fn widen(z: Complex32) -> Complex64 {
    Complex64::new(f64::from(z.re), f64::from(z.im))
}
