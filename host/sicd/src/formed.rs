//! What is known of an image: read from its record.

use serde_json::Value;

use subaperture_io::product::{Antennas, frame_of};
use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture_resolution::support::RecordedLooks;
use subaperture_signal::window::Window;

use crate::SicdError;

/// Of an image what a SICD tells.
#[derive(Clone, Debug)]
pub struct Formed {
    /// The collection's name.
    pub name: String,
    /// Where the pixels are.
    pub grid: ImageGrid,
    /// Where the scene is.
    pub frame: SceneFrame,
    /// When and where the antennas were.
    pub antennas: Antennas,
    /// Pulses that stand for all, with their bands.
    pub looks: RecordedLooks,
    /// Windows over fast and slow time.
    pub windows: [Window; 2],
    /// Who formed it.
    pub former: String,
    /// Polarisation transmitted and received, such as `V`.
    pub polarizations: [Option<String>; 2],
}

/// What is said of a recording that does not say it itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placing {
    /// Where the frame's origin is, in place of what the recording says; its x axis is east and its y axis north.
    pub origin: Option<Geodetic>,
    /// When time 0 was, nanoseconds since the beginning of 1970.
    pub start_ns: Option<i64>,
    /// How fast a radar moves whose pulses have no times, metres a second.
    pub speed_m_s: f64,
}

impl Default for Placing {
    /// Nowhere; an aircraft of 100 m/s.
    fn default() -> Self {
        Self {
            origin: None,
            start_ns: None,
            speed_m_s: 100.0,
        }
    }
}

impl Formed {
    /// Of an image's record, `image.json`, and its grid.
    ///
    /// # Errors
    /// [`SicdError::Record`] if something is missing.
    pub fn of_record(grid: &ImageGrid, record: &Value) -> Result<Self, SicdError> {
        let settings = &record["settings"];
        let window = |name: &str| match settings[name].as_str() {
            // Where none is recorded there was none.
            None => Some(Window::None),
            Some(text) => text.parse().ok(),
        };
        let windows = [window("window"), window("slow_window")];
        let [Some(fast), Some(slow)] = windows else {
            return Err(SicdError::Record("windows that are known"));
        };
        let first = &record["collection"]["channels"][0];
        let polarization = |name: &str| first[name].as_str().map(str::to_owned);
        Ok(Self {
            name: record["collection"]["name"]
                .as_str()
                .unwrap_or("image")
                .to_owned(),
            grid: grid.clone(),
            frame: frame_of(record).map_err(|_| SicdError::Record("where the scene is"))?,
            antennas: Antennas::of_json(&record["antennas"])
                .ok_or(SicdError::Record("when and where the antennas were"))?,
            looks: serde_json::from_value(record["support"].clone())
                .map_err(|_| SicdError::Record("pulses that stand for the recording's"))?,
            windows: [fast, slow],
            former: settings["algorithm"]
                .as_str()
                .unwrap_or("unknown")
                .to_owned(),
            polarizations: [
                polarization("tx_polarization"),
                polarization("rcv_polarization"),
            ],
        })
    }
}
