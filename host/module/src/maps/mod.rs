//! Patch maps as computed by a module and received over the link.
//!
//! The maps of a run ([`Maps`]) consist of settings ([`Run`]), the headers of all maps in memory, and access to the samples
//! of each map. The map is defined in [`subaperture_core::stream`]. [`crate::maps_file`] stores maps in a file,
//! [`crate::image`] forms the image.

#[cfg(test)]
pub(crate) mod example;
mod owned;

use subaperture_core::link::Encoding;
use subaperture_core::stream::{MapHeader, Setup};

use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::ReadError;

pub use owned::{OwnedMap, OwnedSamples};

/// Arithmetic of the maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    /// Complex float32.
    Float,
    /// 16-bit block floating point.
    Fixed,
}

impl Arithmetic {
    /// Encoding of pulses, maps and pixels on the link.
    pub fn encoding(self) -> Encoding {
        match self {
            Self::Float => Encoding::Complex32,
            Self::Fixed => Encoding::Sc16,
        }
    }
}

/// Properties shared by all maps of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name for titles and reports.
    pub name: String,
    /// Dimensions and frequencies.
    pub setup: Setup,
    /// Arithmetic of the maps.
    pub arithmetic: Arithmetic,
    /// Name of the fast-time window.
    pub fast_window: String,
    /// Weights of the fast-time window, one per frequency. They sum to 1.
    pub fast_weights: Vec<f32>,
    /// Position and orientation of the frame of antennas and patches.
    pub frame: SceneFrame,
    /// Provenance of the maps: a JSON object without a fixed schema.
    pub provenance: serde_json::Map<String, serde_json::Value>,
}

impl Run {
    /// Factor that the module's samples, and thus the maps, were multiplied by: `amplitude_scale` of the provenance if it is a
    /// positive number, else 1.
    pub fn amplitude_scale(&self) -> f64 {
        let scale = self.provenance.get("amplitude_scale");
        scale
            .and_then(serde_json::Value::as_f64)
            .filter(|scale| scale.is_finite() && *scale > 0.0)
            .unwrap_or(1.0)
    }
}

/// Totals at the end of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunTotals {
    /// Number of pulses sent to the module.
    pub num_pulses: u64,
    /// Sum of the slow-time weights of all pulses sent.
    pub weight_sum: f64,
    /// Counters of module and link: a JSON object without a fixed schema.
    pub counters: serde_json::Map<String, serde_json::Value>,
}

/// Random access to the maps of a run.
pub trait Maps: Sync {
    /// Properties shared by the maps.
    fn run(&self) -> &Run;

    /// Totals of the whole run; `None` if it was interrupted.
    fn closing(&self) -> Option<&RunTotals>;

    /// Headers in order of arrival. No two have the same patch and sub-CPI.
    fn headers(&self) -> &[MapHeader];

    /// Read map `index`, bit-identical to the received one.
    ///
    /// # Errors
    /// [`ReadError`] if it cannot be read or is damaged.
    ///
    /// # Panics
    /// Panics if `index` is out of range.
    fn read(&self, index: usize) -> Result<OwnedMap, ReadError>;

    /// Memory in bytes held permanently.
    fn held_bytes(&self) -> u64 {
        size_of_val(self.headers()) as u64
    }
}
