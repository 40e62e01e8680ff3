//! Cross-range velocity of a detected target, from its focus.
//!
//! In the image of a stationary scene a target of constant velocity has, at the place where it appears, the path rate of a stationary scatterer, and a path curvature that
//! differs by its horizontal velocity across the line of sight. The value of that place is computed over velocities ([`VelocityPlane`]) for each channel: columns
//! across the line of sight, rows along it, which correct the place by less than a cell. Clutter is removed by differences as in [`crate::detection`]: a
//! stationary scatterer appears in a frame of velocity `w` with the phase `2 pi f rate(w) tau_c / c` of channel `c`, `rate(w)` the path rate of `w`. The
//! maximum of the power over velocities is the cross-range velocity; its standard deviation follows from the curvature of the power in units of the noise.
//!
//! Acceleration `a` along the line of sight has the same effect on the path curvature as a cross-range velocity of `a R / (2 V)`, range and speed of the radar. It is
//! neglected.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_focus::moving::{VelocityPlane, velocity_resolution_m_s};
use subaperture_focus::{FormError, ImageFormer, Task};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::{Channels, InMemory, PhaseHistory, ReadError, Weights};
use subaperture_model::resolution::support::path_gradient;

use crate::alignment::Alignment;
use crate::balance::Balanced;
use crate::error::GmtiError;
use crate::gate::Gate;
use crate::images::{ChannelImages, Imaging};

/// Largest cross-range velocity that is searched, metres per second.
pub const MAX_CROSS_RANGE_M_S: f64 = 20.0;

/// Velocities per resolution cell.
const A_CELL: f64 = 3.0;

/// Margins of the searched velocities: factor on that of the extent of the target, and resolution cells.
const EXTENT_FACTOR: f64 = 1.5;
const EXTRA_CELLS: f64 = 4.0;

/// Standard deviation of the model, resolution cells: that of a place off by a tenth of a cell, and of the parabola.
const MODEL_CELLS: f64 = 0.01;

/// Velocities along the line of sight on either side of 0.
const SIGHT: usize = 4;

/// Error bound of the values over velocities, dB: clutter is removed to this level.
const ERROR_DB: f64 = -60.0;

/// Cross-range velocity of a target: horizontal and normal to the line of sight.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CrossRange {
    /// Velocity, metres per second, positive in the direction of the radar's motion.
    pub velocity_m_s: f64,
    /// Standard deviation, metres per second.
    pub deviation_m_s: f64,
    /// Gain of signal by focusing with this velocity, dB.
    pub gain_db: f64,
}

/// Target in the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appearance {
    /// Position at which it appears, metres.
    pub(crate) place_m: DVec3,
    /// Extent along the track, metres.
    pub(crate) extent_m: f64,
    /// Ratio of signal to clutter and noise after cancellation, dB.
    pub(crate) snr_db: f64,
}

/// Velocities over which a target is focused.
struct Search {
    place_m: DVec3,
    snr_db: f64,
    /// Gradient of the path at the place in the middle of the aperture.
    gradient: DVec3,
    velocities: ImageGrid,
    /// Resolution in cross-range velocity, metres per second.
    cross_cell: f64,
    /// Largest Doppler of the velocities at the ends of the aperture, relative to a stationary scatterer, hertz.
    doppler_hz: f64,
}

/// Estimator of cross-range velocities by focus.
pub(crate) struct Focus<'a> {
    pub(crate) channels: &'a Channels<'a>,
    pub(crate) imaging: &'a Imaging<'a>,
    pub(crate) alignment: &'a Alignment,
    pub(crate) images: &'a ChannelImages,
}

impl Focus<'_> {
    /// Cross-range velocities of targets that appear at `places`, each with its extent along the track and its SNR. `None` if the geometry does not resolve it, or the maximum is at the end
    /// of the searched velocities.
    pub(crate) fn cross_ranges(
        &self,
        places: &[Appearance],
    ) -> Result<Vec<Option<CrossRange>>, GmtiError> {
        let searches: Vec<Option<Search>> =
            places.par_iter().map(|place| self.search(place)).collect();
        let collection = self.channels.channel(0).collection();
        let doppler_hz = searches.iter().flatten().map(|search| search.doppler_hz);
        let Some(gate) = Gate::of(collection, doppler_hz.fold(0.0, f64::max)) else {
            let channels = 0..self.channels.len();
            let histories: Vec<Balanced> = channels.map(|c| self.balanced(c)).collect();
            let found = searches.iter().map(|search| {
                let histories = histories.iter().map(|own| own as &dyn PhaseHistory);
                self.cross_range(histories, &self.images.weights, search.as_ref())
            });
            return found.collect();
        };
        let at_once = self.imaging.memory_bytes / 4 / (gate.bytes() * self.channels.len() as u64);
        let own = self.images.weights.iter();
        let weights: Vec<Weights> = own.map(|own| gate.weights(own)).collect();
        let mut found = Vec::with_capacity(places.len());
        for searches in searches.chunks((at_once as usize).max(1)) {
            let places_m = searches.iter().flatten().map(|search| search.place_m);
            let places_m: Vec<DVec3> = places_m.collect();
            let own = self.images.weights.iter().enumerate();
            let gated = own.map(|(c, own)| gate.read(&self.balanced(c), own, &places_m));
            let gated: Vec<Vec<InMemory>> = gated.collect::<Result<_, ReadError>>()?;
            let mut place = 0;
            for search in searches {
                let histories = gated.iter().filter_map(|channel| channel.get(place));
                let histories = histories.map(|own| own as &dyn PhaseHistory);
                found.push(self.cross_range(histories, &weights, search.as_ref())?);
                place += usize::from(search.is_some());
            }
        }
        Ok(found)
    }

    fn balanced(&self, channel: usize) -> Balanced<'_> {
        Balanced::new(
            self.channels.channel(channel),
            &self.images.balances[channel],
        )
    }

    /// Searched velocities of a target. `None` if the geometry does not resolve them.
    fn search(
        &self,
        &Appearance {
            place_m,
            extent_m,
            snr_db,
        }: &Appearance,
    ) -> Option<Search> {
        let collection = self.channels.channel(0).collection();
        let epoch_s = self.alignment.centre_s();
        let gradient = {
            let pulses = self.alignment.middle_pulses();
            let pulse = &collection.pulses[pulses.start + pulses.len() / 2];
            path_gradient(pulse.transmitter_m, pulse.receiver_m, place_m)
        };
        let [x_axis, y_axis] = axes(gradient, self.images.view.along())?;
        let cell = |direction| velocity_resolution_m_s(collection, place_m, epoch_s, direction);
        let (cross_cell, sight_cell) = (cell(x_axis), cell(y_axis));
        if !(cross_cell.is_finite() && sight_cell.is_finite()) {
            return None;
        }
        let axis = |step: f64, half: usize| Axis {
            start: -(half as f64) * step,
            step,
            count: 2 * half + 1,
        };
        // A cross-range velocity `v` moves the place by `v T` during the aperture.
        let duration_s = self.alignment.duration_s();
        let of_extent = EXTENT_FACTOR * extent_m / duration_s;
        let searched = (of_extent + EXTRA_CELLS * cross_cell).min(MAX_CROSS_RANGE_M_S);
        let steps = (searched * A_CELL / cross_cell).ceil().clamp(4.0, 1000.0) as usize;
        let velocities = ImageGrid {
            origin_m: DVec3::ZERO,
            x_axis,
            y_axis,
            columns: axis(searched / steps as f64, steps),
            rows: axis(sight_cell / A_CELL, SIGHT),
            polar: false,
            relief: None,
        };
        // At the ends of the aperture the line of sight has turned by half of `V T / R`.
        let turned = self.alignment.speed_m_s() * duration_s
            / (2.0 * place_m.distance(self.images.view.antenna_m()));
        let radial_m_s = searched * turned + SIGHT as f64 * velocities.rows.step;
        Some(Search {
            place_m,
            snr_db,
            gradient,
            cross_cell,
            doppler_hz: 2.0 * radial_m_s * self.images.centre_hz / SPEED_OF_LIGHT_M_S,
            velocities,
        })
    }

    /// Cross-range velocity of a target from the `histories` of all channels.
    fn cross_range<'h>(
        &self,
        histories: impl Iterator<Item = &'h dyn PhaseHistory>,
        weights: &[Weights],
        search: Option<&Search>,
    ) -> Result<Option<CrossRange>, GmtiError> {
        let Some(search) = search else {
            return Ok(None);
        };
        let velocities = &search.velocities;
        let former = VelocityPlane {
            position_m: search.place_m,
            epoch_s: self.alignment.centre_s(),
            error_db: ERROR_DB,
        };
        let mut planes = Vec::with_capacity(self.channels.len());
        for (history, weights) in histories.zip(weights) {
            let task = Task {
                memory_bytes: self.imaging.memory_bytes,
                monitor: self.imaging.monitor,
                numerics: self.imaging.numerics,
                ..Task::new(history, velocities, weights)
            };
            match former.form(&task) {
                Ok(formed) => planes.push(formed.image),
                // At every velocity the target leaves the recorded delays.
                Err(FormError::Unsuited(_)) => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
        let powers = self.powers(&planes, search);
        let found = maximum(&powers, velocities, search.snr_db);
        Ok(found.map(|found| CrossRange {
            deviation_m_s: libm::hypot(found.deviation_m_s, MODEL_CELLS * search.cross_cell),
            ..found
        }))
    }

    /// Power of the channel differences over velocities.
    fn powers(&self, planes: &[Image], search: &Search) -> Vec<f64> {
        let velocities = &search.velocities;
        let columns = velocities.columns.count;
        let power_at = |i: usize| {
            let velocity = velocities.position_m(i / columns, i % columns);
            let rate = search.gradient.dot(velocity);
            let first = planes[0].pixels[i];
            let others = planes
                .iter()
                .zip(self.alignment.lags_s())
                .enumerate()
                .skip(1);
            let terms = others.map(|(c, (plane, lag_s))| {
                let model = &self.images.models[c - 1];
                let cycles = self.images.centre_hz * rate * lag_s / SPEED_OF_LIGHT_M_S;
                let phase = std::f64::consts::TAU * cycles
                    + self.images.view.phase_rad(model, search.place_m);
                let factor = Complex64::from_polar(1.0 / model.gain, -phase);
                let factor = Complex32::new(factor.re as f32, factor.im as f32);
                power(plane.pixels[i] * factor - first)
            });
            terms.sum()
        };
        (0..planes[0].pixels.len()).map(power_at).collect()
    }
}

/// Horizontal directions across the line of sight, positive along the track, and along it, positive away from the radar. `None` for a vertical line of sight.
pub(crate) fn axes(sight: DVec3, along: DVec3) -> Option<[DVec3; 2]> {
    let y_axis = DVec3::new(sight.x, sight.y, 0.0).try_normalize()?;
    let x_axis = y_axis.cross(DVec3::Z);
    Some([
        if x_axis.dot(along) < 0.0 {
            -x_axis
        } else {
            x_axis
        },
        y_axis,
    ])
}

/// Maximum over velocities by a parabola through the powers over cross-range velocity.
fn maximum(powers: &[f64], velocities: &ImageGrid, snr_db: f64) -> Option<CrossRange> {
    let columns = velocities.columns.count;
    let over_rows = |column: usize| {
        let values = powers.iter().skip(column).step_by(columns);
        values.copied().fold(0.0, f64::max)
    };
    let best: Vec<f64> = (0..columns).map(over_rows).collect();
    let peak = (0..columns).max_by(|&a, &b| best[a].total_cmp(&best[b]))?;
    if peak == 0 || peak + 1 == columns {
        return None;
    }
    let [before, at, after] = [peak - 1, peak, peak + 1].map(|i| best[i]);
    let curvature = 2.0 * at - before - after;
    if !(curvature > 0.0 && at > 0.0) {
        return None;
    }
    let step = velocities.columns.step;
    let offset = 0.5 * (after - before) / curvature;
    let stationary = best[columns / 2];
    // Power in units of the noise: the unfocused peak has the SNR of the target.
    let gain = at / stationary;
    let snr = 10f64.powf(snr_db / 10.0) * gain;
    Some(CrossRange {
        velocity_m_s: velocities.columns.at(peak) + offset * step,
        deviation_m_s: step / (snr * curvature / at).sqrt(),
        gain_db: 10.0 * gain.log10(),
    })
}
