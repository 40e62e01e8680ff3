//! Echoes of point targets, and blocks of numbers.

use std::f64::consts::TAU;

const C_M_S: f64 = 299_792_458.0;

/// Point target at rest.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Position of the target, metres.
    pub place_m: [f64; 3],
    /// Magnitude of its echo.
    pub amplitude: f64,
}

/// Targets, and antennas that an operator moves.
pub struct Scene {
    /// Targets of the scene.
    pub targets: Vec<Target>,
    /// Number of the stop at which the antennas are.
    pub stop: Box<dyn Fn() -> usize + Send>,
    /// Positions of the antennas of ports 1 and 2 at a stop, metres.
    pub antennas_m: fn(usize) -> [[f64; 3]; 2],
}

/// Scattering parameter between antennas at a frequency: its real and imaginary part.
pub fn echo(targets: &[Target], [from_m, to_m]: [[f64; 3]; 2], hz: f64) -> [f64; 2] {
    let distance_m = |a: [f64; 3], b: [f64; 3]| {
        let squares: f64 = (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum();
        squares.sqrt()
    };
    targets.iter().fold([0.0; 2], |[re, im], target| {
        let path_m = distance_m(target.place_m, from_m) + distance_m(target.place_m, to_m);
        let turns = hz * path_m / C_M_S;
        let (sine, cosine) = (TAU * turns.fract()).sin_cos();
        [re + target.amplitude * cosine, im - target.amplitude * sine]
    })
}

/// Numbers as bytes, the least significant first or last.
pub(super) fn bytes(numbers: &[f64], least_first: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in numbers {
        let mut eight = number.to_bits().to_be_bytes();
        if least_first {
            eight.reverse();
        }
        bytes.extend(eight);
    }
    bytes
}

/// Block with a stated length, and the end of the answer.
pub(super) fn block(data: &[u8], stated: i64) -> Vec<u8> {
    let digits = format!("{stated:06}");
    let mut block = format!("#{}{digits}", digits.len()).into_bytes();
    block.extend(data);
    block.push(b'\n');
    block
}
