//! Positions of detections on the maps of a module.
//!
//! A detection at the range bin `r` and the Doppler bin `d` of a patch has, relative to the patch centre, the path and the path
//! rate in the middle of the sub-CPI
//!
//! ```text
//! a = r c / (R step_hz)  metres,   b = -d c / (D f_ref)  metres per pulse
//! ```
//!
//! `f_ref` is the centre frequency. A target at rest lies where the path has this offset and this rate: two equations for the
//! two coordinates in the grid's plane, solved by Newton's method from the patch centre. A moving target lies at another
//! position of the same path, since its own path rate adds to that of the radar.
//!
//! **Channels.** The map of channel `c` is compensated to the patch centre with the antennas of `c`. A target at rest at the
//! position `p` has the phase `-2 pi f_ref a_c(p) / c` there, `a_c` the path in channel `c` relative to the patch centre. This
//! phase is removed, so that the phases of all channels are equal for a target at rest, apart from clutter, noise, and gain and
//! phase of the receivers. They differ for a moving target, which is at another position than `p` (along-track interferometry).

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use subaperture_core::cfar::Detection;

use crate::link::ChannelDetection;
use crate::plan::ModulePlan;
use subaperture_focus::sub_cpi::{self, SubCpi};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

/// Value of one channel's map at the cell of a detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelValue {
    /// Power.
    pub power: f32,
    /// Phase in radians, without that of a target at rest at the position of the detection. `None` without a position.
    pub phase_rad: Option<f64>,
}

/// Detection with its position.
#[derive(Clone, Debug, PartialEq)]
pub struct LocatedDetection {
    /// Sub-CPI of the map.
    pub sub_cpi: u32,
    /// Patch of the map.
    pub patch: u16,
    /// Mean time of the first and the last pulse in seconds.
    pub time_s: f64,
    /// Bins, power and noise.
    pub detection: Detection,
    /// Values by channel, in the nearest cell.
    pub channels: Vec<ChannelValue>,
    /// Two-way path of channel 0 in the middle of the sub-CPI in metres.
    pub path_m: f64,
    /// Path rate in metres per second, that of the moving radar included. `None` for pulses without times.
    pub path_rate_m_s: Option<f64>,
    /// Position of a target at rest in metres. `None` if no point of the grid's plane near the patch has this path and rate.
    pub position_m: Option<[f64; 3]>,
}

/// Locator of the detections on the maps of a plan.
pub struct Locator<'a> {
    channels: Vec<&'a Collection>,
    plan: &'a ModulePlan,
    sub_cpis: Vec<Range<usize>>,
    axes: [DVec3; 2],
}

impl<'a> Locator<'a> {
    /// Create a locator for the maps of `plan`, made for these channels and this grid.
    pub fn new(channels: &[&'a Collection], grid: &ImageGrid, plan: &'a ModulePlan) -> Self {
        Self {
            channels: channels.to_vec(),
            plan,
            sub_cpis: sub_cpi::cut(plan.num_pulses, &[], plan.setup.num_pulses.into()),
            axes: [grid.x_axis, grid.y_axis],
        }
    }

    /// Locate the detections on a map. Empty if the plan has no such map.
    pub fn locate(
        &self,
        sub_cpi: u32,
        patch: u16,
        list: &[ChannelDetection],
    ) -> Vec<LocatedDetection> {
        let setup = &self.plan.setup;
        let pulses = self.sub_cpis.get(sub_cpi as usize);
        let (Some(pulses), Some(place), Some(collection)) = (
            pulses,
            self.plan.patches.get(usize::from(patch)),
            self.channels.first(),
        ) else {
            return Vec::new();
        };
        let times = &collection.pulses[pulses.clone()];
        let [first_s, last_s] = [times[0].time_s, times[times.len() - 1].time_s];
        let interval_s = (last_s - first_s) / (times.len().max(2) - 1) as f64;
        let timed = collection.timed && interval_s > 0.0;
        let tracks: Vec<SubCpi> = self
            .channels
            .iter()
            .map(|channel| SubCpi::new(channel, pulses.clone()))
            .collect();
        let track = &tracks[0];
        let centre_m = DVec3::from(place.centre_m);
        let (centre_path_m, centre_rate_m) = track.path_and_rate(centre_m);
        let range_m = SPEED_OF_LIGHT_M_S / (f64::from(setup.range_length) * setup.step_hz);
        let rate_m = SPEED_OF_LIGHT_M_S / (f64::from(setup.doppler_length) * setup.centre_hz());
        let located = list.iter().map(|ChannelDetection { detection, values }| {
            let wanted = (
                f64::from(detection.range_bin) * range_m,
                -f64::from(detection.doppler_bin) * rate_m,
            );
            let (path_m, rate) = (centre_path_m + wanted.0, centre_rate_m + wanted.1);
            let position_m = track.locate(centre_m, self.axes, path_m, rate);
            let channels = values
                .iter()
                .zip(&tracks)
                .map(|(value, track)| ChannelValue {
                    power: value.norm_sqr(),
                    phase_rad: position_m.map(|position_m| {
                        let (a, _) = track.line(&track.datum(centre_m), position_m);
                        let rest_rad = -TAU * (a * setup.centre_hz() / SPEED_OF_LIGHT_M_S);
                        wrapped(f64::from(value.arg()) - rest_rad)
                    }),
                });
            LocatedDetection {
                sub_cpi,
                patch,
                time_s: (first_s + last_s) / 2.0,
                detection: *detection,
                channels: channels.collect(),
                path_m,
                path_rate_m_s: timed.then(|| rate / interval_s),
                position_m: position_m.map(|position_m| position_m.to_array()),
            }
        });
        located.collect()
    }
}

/// Phase within half a cycle of zero, in radians.
fn wrapped(phase_rad: f64) -> f64 {
    let cycles = phase_rad / TAU;
    TAU * (cycles - cycles.round())
}
