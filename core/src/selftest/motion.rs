//! Self-test of motion increments: a radar passes four targets.

use super::{Fnv1a, Lcg};
use crate::motion::{Antennas, Echo, MotionError, Pairwise};

/// Number of targets of the synthetic scene.
const TARGETS: usize = 4;
/// Number of channels: two transmitters, three receivers.
const CHANNELS: usize = 6;
/// Number of pulses of the motion self-test.
pub const MOTION_PULSES: usize = 40;

const WAVELENGTH_M: f64 = 0.004;
const ANTENNAS: Antennas<'static> = Antennas {
    transmitters_m: &[[-0.02, 0.0], [-0.014, 0.001]],
    receivers_m: &[[0.0, 0.0], [0.002, 0.0], [0.004, 0.0]],
    wavelength_m: WAVELENGTH_M,
};
const PLACES_M: [[f64; 2]; TARGETS] = [[-0.8, 2.2], [0.3, 3.1], [1.6, 3.6], [-1.1, 4.7]];

/// Self-test of [`Pairwise`]: [`MOTION_PULSES`] pulses with rotation and targets that appear and disappear.
#[derive(Clone, Debug)]
pub struct MotionSelfTest {
    pairwise: Pairwise<TARGETS, CHANNELS>,
}

impl MotionSelfTest {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create the test.
    ///
    /// # Errors
    /// None in a correct build.
    pub fn new() -> Result<Self, MotionError> {
        let pairwise = Pairwise::new(&ANTENNAS)?;
        Ok(Self { pairwise })
    }

    /// Run the test and return the checksum of all increments.
    ///
    /// # Errors
    /// None in a correct build.
    pub fn run(&mut self) -> Result<u32, MotionError> {
        let mut checksum = Fnv1a::new();
        let mut noise = Lcg(77);
        for n in 0..MOTION_PULSES {
            let echoes = echoes(n, &mut noise);
            // The first target is missing in every seventh pulse.
            let seen = echoes.get(usize::from(n % 7 == 6)..).unwrap_or(&[]);
            if let Some(moved) = self.pairwise.push(seen)? {
                let [x, y] = moved.increment.moved_m;
                for value in [x, y, moved.increment.turn_rad] {
                    checksum.add_bytes(&value.to_bits().to_le_bytes());
                }
                checksum.add_bytes(&[moved.targets as u8, moved.doubtful as u8]);
            }
        }
        Ok(checksum.0)
    }
}

/// Echoes of pulse `n`: moved one millimetre per pulse, rotated by noise.
fn echoes(n: usize, noise: &mut Lcg) -> [Echo<CHANNELS>; TARGETS] {
    let x_m = n as f64 * 0.001;
    let turn_rad = f64::from(noise.next()) * 0.001;
    let mut echoes = [Echo {
        target: 0,
        range_m: 1.0,
        phases_rad: [0.0; CHANNELS],
        phase_sigma_rad: 0.03,
    }; TARGETS];
    for ((i, echo), place_m) in echoes.iter_mut().enumerate().zip(PLACES_M) {
        let leg_m = |antenna: &[f64; 2]| {
            let across = place_m[0] - x_m - antenna[0] + turn_rad * antenna[1];
            let ahead = place_m[1] - antenna[1] - turn_rad * antenna[0];
            libm::sqrt(across * across + ahead * ahead)
        };
        let transmitters = ANTENNAS.transmitters_m.iter();
        let receivers = ANTENNAS.receivers_m;
        let paths_m = transmitters.flat_map(|t| receivers.iter().map(move |r| leg_m(t) + leg_m(r)));
        let mut sum_m = 0.0;
        for (phase, path_m) in echo.phases_rad.iter_mut().zip(paths_m) {
            let error = f64::from(noise.next()) * 0.05;
            *phase = error - core::f64::consts::TAU * path_m / WAVELENGTH_M;
            sum_m += path_m;
        }
        echo.target = i as u16;
        echo.range_m = 0.5 * sum_m / CHANNELS as f64;
    }
    echoes
}
