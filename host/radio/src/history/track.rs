//! A body's track on the device's clock.

use std::path::Path;

use subaperture_io::track_csv;
use subaperture_model::track::{Fix, Pose, SampledTrack, Trajectory};

use super::HistoryError;

/// How the body that carries the antennas moved.
#[derive(Debug)]
pub struct Track {
    /// Its poses by the track's own time.
    pub poses: Box<dyn Trajectory>,
    /// From when to when it is known, seconds of its own time.
    pub span_s: (f64, f64),
    /// The device's time at the track's time 0, seconds.
    pub zero_s: f64,
}

impl Track {
    /// A track as comma-separated values ([`track_csv`]); `zero_s` is the device's time at its time 0.
    ///
    /// # Errors
    /// If it cannot be read, or is none.
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

    /// The pose at a time of the device.
    pub fn pose(&self, device_s: f64) -> Pose {
        self.poses.pose(device_s - self.zero_s)
    }

    /// Whether a time of the device is within what is known.
    pub(super) fn knows(&self, device_s: f64) -> bool {
        // A fix is told to a microsecond or so.
        let slack_s = 1e-5;
        let at_s = device_s - self.zero_s;
        self.span_s.0 - slack_s <= at_s && at_s <= self.span_s.1 + slack_s
    }
}
