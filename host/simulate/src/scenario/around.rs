//! Surroundings of a scene on which its content depends.

use std::path::Path;

use subaperture_model::geometry::SceneFrame;
use subaperture_model::radar::Radar;
use subaperture_model::track::Trajectory;

/// Radar, track, frame, seed and folder of a scenario.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) radar: &'a Radar,
    pub(super) track: &'a dyn Trajectory,
    pub(super) frame: &'a SceneFrame,
    pub(super) seed: u64,
    /// Folder of relative paths.
    pub(super) folder: &'a Path,
}
