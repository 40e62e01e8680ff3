//! Settings of space-time processing.

use subaperture_fft::Transforms;
use subaperture_signal::window::Window;

use crate::error::GmtiError;

/// Choice of training cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub enum Training {
    /// All cells around the tile.
    #[default]
    All,
    /// The half of the cells with the most power (power-selected training): deeper nulls in clutter of varying power. The threshold is then conservative where
    /// the clutter is homogeneous.
    Strongest,
}

/// Settings of space-time processing.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Settings {
    /// Number of sub-CPIs, at least 3.
    pub sub_cpis: usize,
    /// Whether the Doppler transform corrects range walk in a sub-CPI (Keystone).
    pub keystone: bool,
    /// Adjacent Doppler bins of a snapshot: 1, 3 or 5.
    pub bins: usize,
    /// Windows over frequency and over slow time in each sub-CPI.
    #[serde(skip)]
    pub windows: [Window; 2],
    /// Largest speed of a target along the line of sight and across it, metres per second.
    pub max_speed_m_s: f64,
    /// Largest acceleration of a target along the line of sight, metres per second squared. An acceleration with the path curvature of a cross-range velocity up to the largest speed is taken for it.
    pub max_acceleration_m_s2: f64,
    /// Probability of a false alarm per resolution cell of range and Doppler.
    pub false_alarm_probability: f64,
    /// Resolution cells on each side of a tile that do not train its covariance.
    pub guard_cells: usize,
    /// Resolution cells beyond the guard cells, on each side, that train the covariance.
    pub training_cells: usize,
    /// Choice of training cells.
    pub training: Training,
    /// Fourier transforms: portable ones give the same bits on every machine.
    #[serde(skip)]
    pub transforms: Transforms,
    /// Memory limit of the maps, bytes.
    #[serde(skip)]
    pub memory_bytes: u64,
}

impl Default for Settings {
    /// 26 sub-CPIs with Keystone, one bin, Taylor windows, 30 m/s, no acceleration, false alarms of 1e-6, 3 guard cells, 6 training cells, 1 GiB.
    fn default() -> Self {
        Self {
            sub_cpis: 26,
            keystone: true,
            bins: 1,
            windows: [Window::default(); 2],
            max_speed_m_s: 30.0,
            max_acceleration_m_s2: 0.0,
            false_alarm_probability: 1e-6,
            guard_cells: 3,
            training_cells: 6,
            training: Training::All,
            transforms: Transforms::Fastest,
            memory_bytes: 1 << 30,
        }
    }
}

impl Settings {
    /// Check the ranges of all settings.
    pub(super) fn check(&self) -> Result<(), GmtiError> {
        let fault = match self {
            Self { bins, .. } if ![1, 3, 5].contains(bins) => {
                format!("expected 1, 3 or 5 adjacent Doppler bins, found {bins}")
            }
            Self { sub_cpis, .. } if *sub_cpis < 3 => {
                format!("expected at least 3 sub-CPIs, found {sub_cpis}")
            }
            Self { max_speed_m_s, .. } if !(*max_speed_m_s > 0.0 && *max_speed_m_s < 1000.0) => {
                format!(
                    "expected a largest speed above 0 and below 1000 m/s, found {max_speed_m_s} m/s"
                )
            }
            Self {
                max_acceleration_m_s2: most,
                ..
            } if !(*most >= 0.0 && *most < 100.0) => {
                format!(
                    "expected a largest acceleration of 0 or more and below 100 m/s^2, found {most} m/s^2"
                )
            }
            Self {
                false_alarm_probability: p,
                ..
            } if !(*p > 0.0 && *p < 1.0) => {
                format!("expected a probability of false alarm above 0 and below 1, found {p}")
            }
            _ => return Ok(()),
        };
        Err(GmtiError::Unsuited(fault))
    }
}
