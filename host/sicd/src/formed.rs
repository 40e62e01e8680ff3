//! Geometry and processing of an image, from its record.

use serde_json::Value;

use subaperture_io::product::{Antennas, frame_of};
use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture_model::resolution::support::RecordedLooks;
use subaperture_signal::window::Window;

use crate::SicdError;

/// Properties of an image that SICD and SIDD describe.
#[derive(Clone, Debug)]
pub struct Formed {
    /// Name of the collection.
    pub name: String,
    /// Pixel grid.
    pub grid: ImageGrid,
    /// Frame of the grid.
    pub frame: SceneFrame,
    /// Antenna times and positions.
    pub antennas: Antennas,
    /// Decimated antenna positions and bands (support of the image).
    pub looks: RecordedLooks,
    /// Windows over fast time and slow time.
    pub windows: [Window; 2],
    /// Name of the image former.
    pub former: String,
    /// Transmit and receive polarisation, such as `V`; `None` if unknown.
    pub polarizations: [Option<String>; 2],
}

/// Position, time and speed for recordings that do not contain them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Georeference {
    /// Position of the frame's origin, x axis east and y axis north; replaces that of the recording. Default: none.
    pub origin: Option<Geodetic>,
    /// Time 0, nanoseconds since 1970 (UTC). Default: that of the recording.
    pub start_ns: Option<i64>,
    /// Radar speed for pulses without times, metres per second. Default: 100.
    pub speed_m_s: f64,
}

impl Default for Georeference {
    /// No position, no time, 100 m/s.
    fn default() -> Self {
        Self {
            origin: None,
            start_ns: None,
            speed_m_s: 100.0,
        }
    }
}

impl Formed {
    /// Read an image's record (`image.json`); `grid` is its grid.
    ///
    /// # Errors
    /// [`SicdError::Record`] if something is missing.
    pub fn of_record(grid: &ImageGrid, record: &Value) -> Result<Self, SicdError> {
        let settings = &record["settings"];
        let window = |name: &str| match settings[name].as_str() {
            // Absent: no window.
            None => Some(Window::None),
            Some(text) => text.parse().ok(),
        };
        let windows = [window("window"), window("slow_window")];
        let [Some(fast), Some(slow)] = windows else {
            return Err(SicdError::Record("known window names"));
        };
        let first = &record["collection"]["channels"][0];
        let polarization = |name: &str| first[name].as_str().map(str::to_owned);
        Ok(Self {
            name: record["collection"]["name"]
                .as_str()
                .unwrap_or("image")
                .to_owned(),
            grid: grid.clone(),
            frame: frame_of(record).map_err(|_| SicdError::Record("the scene frame"))?,
            antennas: Antennas::of_json(&record["antennas"])
                .ok_or(SicdError::Record("antenna times and positions"))?,
            looks: serde_json::from_value(record["support"].clone())
                .map_err(|_| SicdError::Record("the image's support"))?,
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
