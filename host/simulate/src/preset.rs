//! Simulated collections of Schone 2020, Tables 2.1 and 4.1.

use std::f64::consts::TAU;
use std::str::FromStr;

use glam::DVec3;
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{Noise, PointTargetHistory, Scatterer};
use crate::random;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::{Collection, Pulse, Sweep};

/// Collection of a table of Schone 2020. Text forms: `table-2-1`, `table-4-1`.
///
/// In both, samples are referenced to a fixed range `R_0` from the moving radar, as from a receiver with one range
/// gate: the reference point moves with the platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Range migration: one target receding at 10 m/s, 400 MHz, 1024 pulses of 0.5 ms at 5 km. The table states no
    /// carrier; 10 GHz is used, as in Table 4.1. The radar recedes instead of the target (S 2.3: only relative motion
    /// counts). The CPI lasts 0.512 s: the 5.12 s in the thesis's text is an error, its range migration of 5.12 m is
    /// correct.
    Table21,
    /// Imaging: 10 GHz, 200 MHz, 1040 pulses of 1 ms at 5 km and 125 m/s on a straight line along x, looking along y in
    /// one plane. 41 unit scatterers over 80 x 80 m, one of them at the centre.
    Table41,
}

/// Variations of a preset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variation {
    /// Thermal noise; default: none.
    pub noise: Option<Noise>,
    /// RMS deviation of the track from a straight line in each axis, metres; default 0. The deviation is smooth
    /// (periods of a fifth of the aperture and longer) and is contained in the recorded track.
    pub perturbation_m: f64,
    /// Seed of the deviation.
    pub seed: u64,
}

/// Frequencies per pulse in both presets: unambiguous range 96 m and 192 m.
const NUM_SAMPLES: usize = 256;
/// Carrier of both presets, hertz.
const CARRIER_HZ: f64 = 10e9;
/// `R_0` of both presets, metres.
const RANGE_M: f64 = 5000.0;

impl Preset {
    /// Make the collection of this table.
    pub fn simulate(self, variation: &Variation) -> PointTargetHistory {
        let (bandwidth_hz, num_pulses, pri_s, velocity_m_s, extent_m) = match self {
            Self::Table21 => (400e6, 1024, 0.5e-3, DVec3::new(0.0, -10.0, 0.0), 20.0),
            Self::Table41 => (200e6, 1040, 1e-3, DVec3::new(125.0, 0.0, 0.0), 45.0),
        };
        let step_hz = bandwidth_hz / NUM_SAMPLES as f64;
        let sway = Sway::new(variation, num_pulses);
        let pulses = (0..num_pulses)
            .map(|n| {
                let index = n as f64 - (num_pulses as f64 - 1.0) / 2.0;
                let along = velocity_m_s * (index * pri_s);
                let radar_m = DVec3::new(0.0, -RANGE_M, 0.0) + along + sway.at(n);
                Pulse {
                    time_s: n as f64 * pri_s,
                    transmitter_m: radar_m,
                    receiver_m: radar_m,
                    reference_m: radar_m + DVec3::new(0.0, RANGE_M, 0.0),
                    reference_path_m: 2.0 * RANGE_M,
                    start_hz: CARRIER_HZ - (NUM_SAMPLES / 2) as f64 * step_hz,
                    step_hz,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
                }
            })
            .collect();
        let collection = Collection {
            name: self.name().to_owned(),
            num_samples: NUM_SAMPLES,
            pulses,
            // East, north, up where the equator meets the prime meridian.
            frame: SceneFrame::Earth {
                origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
                x_axis_ecf: DVec3::Y,
                y_axis_ecf: DVec3::Z,
            },
            extent: Some(Extent {
                x_m: (-extent_m, extent_m),
                y_m: (-extent_m, extent_m),
            }),
            timed: true,
        };
        PointTargetHistory::new(collection, self.scatterers(), variation.noise)
    }

    fn scatterers(self) -> Vec<Scatterer> {
        let unit = |position_m| Scatterer {
            position_m,
            amplitude: Complex64::ONE,
        };
        let mut scatterers = vec![unit(DVec3::ZERO)];
        if self == Self::Table41 {
            let mut stream = ChaCha8Rng::seed_from_u64(41);
            let mut side_m = || 80.0 * random::unit(&mut stream) - 40.0;
            scatterers.extend((0..40).map(|_| {
                let (x, y) = (side_m(), side_m());
                unit(DVec3::new(x, y, 0.0))
            }));
        }
        scatterers
    }

    /// Text form of the preset.
    pub fn name(self) -> &'static str {
        match self {
            Self::Table21 => "table-2-1",
            Self::Table41 => "table-4-1",
        }
    }
}

/// Unknown name of a preset.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown preset '{0}': expected table-2-1 (range migration) or table-4-1 (imaging)")]
pub struct PresetError(String);

impl FromStr for Preset {
    type Err = PresetError;

    fn from_str(text: &str) -> Result<Self, PresetError> {
        [Self::Table21, Self::Table41]
            .into_iter()
            .find(|preset| preset.name() == text)
            .ok_or_else(|| PresetError(text.to_owned()))
    }
}

/// Smooth displacement: five harmonics of the aperture in each axis, with random phases and equal power.
struct Sway {
    rms_m: f64,
    num_pulses: f64,
    phases: [[f64; 3]; 5],
}

impl Sway {
    fn new(variation: &Variation, num_pulses: usize) -> Self {
        let mut stream = ChaCha8Rng::seed_from_u64(variation.seed);
        Self {
            rms_m: variation.perturbation_m,
            num_pulses: num_pulses as f64,
            phases: std::array::from_fn(|_| {
                std::array::from_fn(|_| TAU * random::unit(&mut stream))
            }),
        }
    }

    fn at(&self, n: usize) -> DVec3 {
        let turn = TAU * n as f64 / self.num_pulses;
        // Each of five harmonics has power a^2 / 2: a = rms sqrt(2 / 5).
        let amplitude = self.rms_m * (2.0f64 / 5.0).sqrt();
        let mut sum = DVec3::ZERO;
        for (phases, harmonic) in self.phases.iter().zip(1..) {
            let angle = turn * f64::from(harmonic);
            sum += DVec3::from_array(phases.map(|phase| libm::sin(angle + phase)));
        }
        sum * amplitude
    }
}
