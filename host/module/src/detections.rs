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
//!
//! **Clutter cancellation** ([`Locator::aligned`]). The values of both channels are aligned to channel 0 by the module, gain included
//! ([`subaperture_core::dpca`]). The phase of channel 0 is removed from both, and their difference `phi` is `4 pi v_r tau / lambda`, `v_r` the radial
//! velocity of the target, positive when it approaches, and `tau` the lag of channel 1. Velocities beyond `+-lambda / (4 tau)` are ambiguous. The
//! phase of a target weaker than the clutter in its cell is pulled toward 0, and so is the velocity.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use subaperture_core::cfar::Detection;
use subaperture_core::dpca::{Dpca, DpcaError};

use crate::link::ChannelDetection;
use crate::plan::ModulePlan;
use subaperture_focus::sub_cpi::{self, SubCpi};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

/// Lag of the second channel in pulses: the displacement of its phase centre behind that of the first over that of the radar per pulse, in
/// least squares over all pulses. Negative if the second channel is ahead.
///
/// # Errors
/// [`DpcaError`] if there are not two channels, the radar does not move, or the phase centres coincide along the track.
pub fn lag_pulses(channels: &[&Collection]) -> Result<f64, DpcaError> {
    let [first, second] = channels else {
        return Err(DpcaError::Channels {
            found: channels.len().min(usize::from(u16::MAX)) as u16,
        });
    };
    let centres_m = |collection: &Collection| -> Vec<DVec3> {
        let centres_m = collection.pulses.iter().map(|pulse| pulse.phase_centre_m());
        centres_m.collect()
    };
    let (first_m, second_m) = (centres_m(first), centres_m(second));
    let (mut product, mut square) = (0.0, 0.0);
    for (pair, second_m) in first_m.windows(2).zip(second_m.windows(2)) {
        let step_m = pair[1] - pair[0];
        product += (second_m[0] - pair[0]).dot(step_m);
        square += step_m.length_squared();
    }
    let lag = -product / square;
    match lag {
        _ if !lag.is_finite() => Err(DpcaError::NotFinite),
        0.0 => Err(DpcaError::NoLag),
        _ => Ok(lag),
    }
}

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
    /// Radial velocity in metres per second by the phase between both channels, positive when the target approaches. `None` without clutter
    /// cancellation, for pulses without times, and without a position.
    pub radial_velocity_m_s: Option<f64>,
    /// Position of a target at rest in metres. `None` if no point of the grid's plane near the patch has this path and rate.
    pub position_m: Option<[f64; 3]>,
}

/// Locator of the detections on the maps of a plan.
pub struct Locator<'a> {
    channels: Vec<&'a Collection>,
    plan: &'a ModulePlan,
    sub_cpis: Vec<Range<usize>>,
    axes: [DVec3; 2],
    dpca: Option<Dpca>,
}

impl<'a> Locator<'a> {
    /// Create a locator for the maps of `plan`, made for these channels and this grid.
    pub fn new(channels: &[&'a Collection], grid: &ImageGrid, plan: &'a ModulePlan) -> Self {
        Self {
            channels: channels.to_vec(),
            plan,
            sub_cpis: sub_cpi::cut(plan.num_pulses, &[], plan.setup.num_pulses.into()),
            axes: [grid.x_axis, grid.y_axis],
            dpca: None,
        }
    }

    /// Locate detections after this clutter cancellation, whose values are aligned to channel 0.
    #[must_use]
    pub fn aligned(self, dpca: Option<Dpca>) -> Self {
        Self { dpca, ..self }
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
            let own = tracks.iter().map(|own| match self.dpca {
                Some(_) => track,
                None => own,
            });
            let channels = values.iter().zip(own).map(|(value, track)| ChannelValue {
                power: value.norm_sqr(),
                phase_rad: position_m.map(|position_m| {
                    let (a, _) = track.line(&track.datum(centre_m), position_m);
                    let rest_rad = -TAU * (a * setup.centre_hz() / SPEED_OF_LIGHT_M_S);
                    wrapped(f64::from(value.arg()) - rest_rad)
                }),
            });
            let channels: Vec<ChannelValue> = channels.collect();
            let phases = (channels.first(), channels.get(1));
            let radial_velocity_m_s = match (self.dpca, phases) {
                (Some(dpca), (Some(first), Some(second))) if timed => {
                    let phases = second.phase_rad.zip(first.phase_rad);
                    let lag_s = dpca.lag_pulses * interval_s;
                    let wavelength_m = SPEED_OF_LIGHT_M_S / setup.centre_hz();
                    phases.map(|(second, first)| {
                        wrapped(second - first) * wavelength_m / (2.0 * TAU * lag_s)
                    })
                }
                _ => None,
            };
            LocatedDetection {
                sub_cpi,
                patch,
                time_s: (first_s + last_s) / 2.0,
                detection: *detection,
                channels,
                path_m,
                path_rate_m_s: timed.then(|| rate / interval_s),
                radial_velocity_m_s,
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
