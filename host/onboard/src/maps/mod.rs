//! Maps of patches, as a module on the platform computes them and a link brings them.
//!
//! A run's maps ([`Maps`]) are what its settings say ([`Run`]), a header of every map, held in memory,
//! and a way to read any map's samples. What a map is, is defined in
//! [`subaperture_core::stream`]. [`crate::maps_file`] keeps them in a file, [`crate::image`] forms
//! the image.

#[cfg(test)]
pub(crate) mod example;
mod owned;

use subaperture_core::stream::{MapHeader, Setup};

use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::ReadError;

pub use owned::{OwnedMap, OwnedSamples};

/// The arithmetic that maps were computed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    /// Float32.
    Float,
    /// 16-bit samples, blocks of a common exponent.
    Fixed,
}

/// What all maps of a run share.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// A name for titles and reports.
    pub name: String,
    /// Sizes and frequencies.
    pub setup: Setup,
    /// How maps were computed.
    pub arithmetic: Arithmetic,
    /// Name of the fast-time window.
    pub fast_window: String,
    /// Its weights, one a frequency; they sum to 1.
    pub fast_weights: Vec<f32>,
    /// Where the antennas' and patches' frame lies.
    pub frame: SceneFrame,
    /// Where the maps come from, free in form: a JSON object.
    pub provenance: serde_json::Map<String, serde_json::Value>,
}

impl Run {
    /// What the module's samples were multiplied by, and maps are too large by: `amplitude_scale` of the
    /// provenance, a positive number; 1 where there is none.
    pub fn amplitude_scale(&self) -> f64 {
        let scale = self.provenance.get("amplitude_scale");
        scale
            .and_then(serde_json::Value::as_f64)
            .filter(|scale| scale.is_finite() && *scale > 0.0)
            .unwrap_or(1.0)
    }
}

/// What is known when a run is over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Closing {
    /// Pulses sent to the module.
    pub num_pulses: u64,
    /// Sum of the slow-time weights of all of them.
    pub weight_sum: f64,
    /// Counters of module and link, free in form: a JSON object.
    pub counters: serde_json::Map<String, serde_json::Value>,
}

/// The maps of a run, readable one by one.
pub trait Maps: Sync {
    /// What they share.
    fn run(&self) -> &Run;

    /// What is known of the whole run; `None` if it broke off.
    fn closing(&self) -> Option<&Closing>;

    /// What every map is of, in the order of arrival. No two are of the same patch and sub-CPI.
    fn headers(&self) -> &[MapHeader];

    /// Map `index`, bit by bit as it came.
    ///
    /// # Errors
    /// [`ReadError`] if it cannot be read or is damaged.
    ///
    /// # Panics
    /// If there is no such map.
    fn read(&self, index: usize) -> Result<OwnedMap, ReadError>;

    /// Bytes held in memory for as long as this lives.
    fn held_bytes(&self) -> u64 {
        size_of_val(self.headers()) as u64
    }
}
