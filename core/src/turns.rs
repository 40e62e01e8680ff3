//! Phase as a fixed-point fraction of a turn.

use num_complex::Complex32;

/// Phase modulo one turn: `Turns(t)` is `2 pi t / 2^64` radians.
///
/// Integer addition and multiplication wrap exactly where phase does. Sums of any length and quadratics
/// `rate * n * n` therefore carry no rounding and are bit-identical on every machine.
///
/// ```
/// use subaperture_core::Turns;
/// // Five quarter turns are one quarter turn.
/// let quarter = Turns::from_f64(0.25);
/// assert_eq!(quarter.times(5), quarter);
/// assert_eq!(quarter.phasor(), num_complex::Complex32::new(0.0, 1.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turns(pub u64);

impl Turns {
    /// Fractional part of `turns`, exact to `2^-64` turns apart from the resolution of the argument.
    pub fn from_f64(turns: f64) -> Self {
        // A negative value closer to 0 than 2^-53 rounds up to 1.0; the cast saturates to the
        // largest fraction, which is off by 2^-64.
        Self(((turns - libm::floor(turns)) * TWO_POW_64) as u64)
    }

    /// Sum modulo one turn.
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }

    /// Product with an integer, modulo one turn.
    pub const fn times(self, factor: i64) -> Self {
        Self(self.0.wrapping_mul(factor as u64))
    }

    /// Phasor `exp(+j 2 pi t)`.
    ///
    /// Integer arithmetic reduces the phase to the nearest quarter turn. The argument of sine and cosine is then within
    /// `pi/4` and known to `2^-33` turns, where short polynomials suffice (S. L. Moshier's, of the Cephes library).
    /// The error of each part is at most 1.6e-7 (`tests/stream/stages.rs`); quarter turns are exact.
    pub fn phasor(self) -> Complex32 {
        let quadrant = self.0.wrapping_add(1 << 61) >> 62;
        let residue = self.0.wrapping_sub(quadrant << 62) as i64; // within 2^61 of zero
        let angle_rad = ((residue + (1 << 31)) >> 32) as i32 as f32 * RADIANS_PER_TURN_2_32;
        let square = angle_rad * angle_rad;
        let sin = ((-1.951_529_6e-4 * square + 8.332_161e-3) * square - 1.666_665_5e-1)
            * square
            * angle_rad
            + angle_rad;
        let cos = ((2.443_315_7e-5 * square - 1.388_731_6e-3) * square + 4.166_664_6e-2)
            * square
            * square
            - 0.5 * square
            + 1.0;
        match quadrant {
            0 => Complex32::new(cos, sin),
            1 => Complex32::new(-sin, cos),
            2 => Complex32::new(-cos, -sin),
            _ => Complex32::new(sin, -cos),
        }
    }
}

const TWO_POW_64: f64 = 18_446_744_073_709_551_616.0;
const RADIANS_PER_TURN_2_32: f32 = (core::f64::consts::TAU / 4_294_967_296.0) as f32;
