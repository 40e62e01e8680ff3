//! Track of the body that carries the antennas, on the device's clock.

use std::path::Path;

use subaperture_io::track_csv;
use subaperture_model::track::{Fix, Pose, SampledTrack, Trajectory};

use super::HistoryError;

/// Track of the body that carries the antennas.
#[derive(Debug)]
pub struct Track {
    /// Poses as a function of track time.
    pub poses: Box<dyn Trajectory>,
    /// First and last track times, seconds.
    pub span_s: (f64, f64),
    /// Device time of track time 0, seconds.
    pub zero_s: f64,
}

impl Track {
    /// Read a track file of comma-separated values ([`track_csv`]); `zero_s` is the device time of track time 0.
    ///
    /// # Errors
    /// If the file cannot be read or is not a valid track.
    pub fn read(path: &Path, zero_s: f64) -> Result<Self, HistoryError> {
        let fixes =
            track_csv::read(path).map_err(|error| HistoryError::Track(error.to_string()))?;
        let poses = SampledTrack::new(&fixes)
            .map_err(|error| HistoryError::Track(format!("{}: {error}", path.display())))?;
        let at = |fix: Option<&Fix>| fix.map_or(0.0, |fix| fix.time_s);
        Ok(Self {
            poses: Box::new(poses),
            span_s: (at(fixes.first()), at(fixes.last())),
            zero_s,
        })
    }

    /// Pose at a device time.
    pub fn pose(&self, device_s: f64) -> Pose {
        self.poses.pose(device_s - self.zero_s)
    }

    /// Whether a device time lies within the track.
    pub(super) fn is_valid_at(&self, device_s: f64) -> bool {
        // Times in track files are rounded to about a microsecond.
        let slack_s = 1e-5;
        let at_s = device_s - self.zero_s;
        self.span_s.0 - slack_s <= at_s && at_s <= self.span_s.1 + slack_s
    }
}
