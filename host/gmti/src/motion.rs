//! Cross-range velocity of a detected target, from its focus.
//!
//! In the image of a stationary scene a target of constant velocity has, at the place where it appears, the path rate of a stationary scatterer, and a path curvature that
//! differs by its horizontal velocity across the line of sight. The value of that place is computed over velocities ([`VelocityPlane`]) for each channel: columns
//! across the line of sight, rows along it, which correct the place by up to 1.3 cells, and by up to 4 where the maximum is beyond. Clutter is removed by differences as in [`crate::detection`]: a
//! stationary scatterer appears in a frame of velocity `w` with the phase `2 pi f rate(w) tau_c / c` of channel `c`, `rate(w)` the path rate of `w`. The
//! maximum over velocities of the power `P` of the differences, whitened by their covariance around the target, is the cross-range velocity. With `P` in units of the noise its variance is
//!
//! ```text
//! sigma_v^2 = rho / -P''(v),    rho = <(h - <h>_w)^2>_{w^2} / <(h - <h>_w)^2>_w
//! ```
//!
//! `h` the square of the along-track position from the middle of the section, to which the phase by a cross-range velocity is proportional, and means with the weights `w` of the pulses and their squares: a window
//! reduces the slope of noise more than the curvature of the peak.
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
use subaperture_model::image::Image;
use subaperture_model::phase_history::{
    Channels, Collection, InMemory, PhaseHistory, ReadError, Weights,
};
use subaperture_model::resolution::support::path_gradient;

use crate::adaptive::{Loading, Whitener};
use crate::alignment::Alignment;
use crate::balance::Balanced;
use crate::detection::{self, Settings, StatisticMap, train};
use crate::error::GmtiError;
use crate::gate::{Gate, with_pulses};
use crate::images::{ChannelImages, Imaging};
use crate::moments::moments;

/// Largest cross-range velocity that is searched, metres per second.
pub const MAX_CROSS_RANGE_M_S: f64 = 20.0;

/// Velocities per resolution cell.
const A_CELL: f64 = 3.0;

/// Margins of the searched velocities: factor on that of the extent of the target, and resolution cells.
const EXTENT_FACTOR: f64 = 1.5;
const EXTRA_CELLS: f64 = 4.0;

/// Standard deviation of the maximum of a parabola through three powers, resolution cells: measured on 240 targets (`tests/scene`).
const MODEL_CELLS: f64 = 0.003;

/// Velocities along the line of sight on either side of 0, and for places that are off by more.
const SIGHT: usize = 4;
const WIDE_SIGHT: usize = 12;

/// Largest number of pulses that determine the resolution in velocity.
const MOST_PULSES: usize = 512;

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
    /// Pixel of that position.
    pub(crate) pixel: usize,
}

/// Velocities over which a target is focused.
struct Search {
    place_m: DVec3,
    /// Covariance of the channel differences of clutter and noise, a sum over `snapshots`.
    whitener: Whitener,
    snapshots: usize,
    /// Gradient of the path at the place in the middle of the aperture.
    gradient: DVec3,
    velocities: ImageGrid,
    /// Resolution in cross-range velocity, metres per second.
    cross_cell: f64,
    /// Largest Doppler of the velocities at the ends of the aperture, relative to a stationary scatterer, hertz.
    doppler_hz: f64,
}

/// Cross-range velocity at the maximum of the power over velocities.
#[derive(Clone, Copy)]
struct Focused {
    cross_range: CrossRange,
    /// Whether it is at an end of the velocities along the line of sight.
    is_at_edge: bool,
}

/// Estimator of cross-range velocities by focus.
pub(crate) struct Focus<'a> {
    pub(crate) channels: &'a Channels<'a>,
    pub(crate) imaging: &'a Imaging<'a>,
    pub(crate) alignment: &'a Alignment,
    pub(crate) images: &'a ChannelImages,
    pub(crate) settings: &'a Settings,
    pub(crate) map: &'a StatisticMap,
}

impl Focus<'_> {
    /// Cross-range velocities of targets that appear at `places`, each with its extent along the track and its SNR. `None` if the geometry does not resolve it, or the maximum is at the end
    /// of the searched velocities.
    pub(crate) fn cross_ranges(
        &self,
        places: &[Appearance],
    ) -> Result<Vec<Option<CrossRange>>, GmtiError> {
        let mut found = self.focused(places, SIGHT)?;
        let is_beyond = |i: &usize| found[*i].is_some_and(|own| own.is_at_edge);
        let beyond: Vec<usize> = (0..places.len()).filter(is_beyond).collect();
        let wide: Vec<Appearance> = beyond.iter().map(|&i| places[i]).collect();
        let again = self.focused(&wide, WIDE_SIGHT)?;
        for (i, own) in beyond.into_iter().zip(again) {
            found[i] = own.filter(|own| !own.is_at_edge);
        }
        let cross_ranges = found.into_iter().map(|own| Some(own?.cross_range));
        Ok(cross_ranges.collect())
    }

    /// Cross-range velocities with `sight` velocities along the line of sight on either side of 0.
    fn focused(
        &self,
        places: &[Appearance],
        sight: usize,
    ) -> Result<Vec<Option<Focused>>, GmtiError> {
        let few = self.few_pulses();
        let searches = places.par_iter();
        let searches = searches.map(|place| self.search(&few, place, sight));
        let searches: Vec<Option<Search>> = searches.collect();
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
            let mut places = 0..places_m.len();
            let of_place: Vec<(&Option<Search>, Option<usize>)> = searches
                .iter()
                .map(|search| (search, search.as_ref().and_then(|_| places.next())))
                .collect();
            let cross_range = |&(search, place): &(&Option<Search>, Option<usize>)| {
                let place = place.unwrap_or_default();
                let histories = gated.iter().filter_map(|channel| channel.get(place));
                let histories = histories.map(|own| own as &dyn PhaseHistory);
                self.cross_range(histories, &weights, search.as_ref())
            };
            let own = of_place.par_iter().map(cross_range);
            let own: Vec<Result<Option<Focused>, GmtiError>> = own.collect();
            for own in own {
                found.push(own?);
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

    /// Geometry of at most [`MOST_PULSES`] pulses of channel 0 at equal distances: enough for resolutions.
    fn few_pulses(&self) -> Collection {
        let collection = self.channels.channel(0).collection();
        let step = collection.pulses.len().div_ceil(MOST_PULSES).max(1);
        let pulses = collection.pulses.iter().step_by(step).copied();
        with_pulses(collection, pulses.collect(), collection.num_samples)
    }

    /// Searched velocities of a target. `None` if the geometry does not resolve them.
    fn search(
        &self,
        few_pulses: &Collection,
        &Appearance {
            place_m,
            extent_m,
            pixel,
        }: &Appearance,
        sight: usize,
    ) -> Option<Search> {
        let collection = self.channels.channel(0).collection();
        let epoch_s = self.alignment.centre_s();
        let gradient = {
            let pulses = self.alignment.middle_pulses();
            let pulse = &collection.pulses[pulses.start + pulses.len() / 2];
            path_gradient(pulse.transmitter_m, pulse.receiver_m, place_m)
        };
        let [x_axis, y_axis] = axes(gradient, self.images.view.along())?;
        let cell = |direction| velocity_resolution_m_s(few_pulses, place_m, epoch_s, direction);
        let (cross_cell, sight_cell) = (cell(x_axis), cell(y_axis));
        if !(cross_cell.is_finite() && sight_cell.is_finite()) {
            return None;
        }
        let size = self.channels.len() - 1;
        let covariance = train(
            self.images,
            self.map,
            self.settings,
            pixel,
            (size, detection::differences),
        );
        let whitener = covariance.factor(Loading::Off).ok()?;
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
            rows: axis(sight_cell / A_CELL, sight),
            polar: false,
            relief: None,
        };
        // At the ends of the aperture the line of sight has turned by half of `V T / R`.
        let turned = self.alignment.speed_m_s() * duration_s
            / (2.0 * place_m.distance(self.images.view.antenna_m()));
        let radial_m_s = searched * turned + sight as f64 * velocities.rows.step;
        Some(Search {
            place_m,
            whitener,
            snapshots: covariance.snapshots(),
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
    ) -> Result<Option<Focused>, GmtiError> {
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
        let found = maximum(&powers, velocities);
        Ok(found.map(|(found, pixel)| {
            let row = pixel / velocities.columns.count;
            let deviation_m_s = found.deviation_m_s * self.noise_ratio().sqrt();
            Focused {
                cross_range: CrossRange {
                    deviation_m_s: libm::hypot(deviation_m_s, MODEL_CELLS * search.cross_cell),
                    ..found
                },
                is_at_edge: row == 0 || row + 1 == velocities.rows.count,
            }
        }))
    }

    /// Ratio of the variance of the curvature of the path in noise to that of noise of the spectrum of a point target: the weights act on both.
    fn noise_ratio(&self) -> f64 {
        let along_m = self.alignment.along_m(0);
        let [start_m, end_m] = self.alignment.section_m();
        let middle_m = 0.5 * (start_m + end_m);
        let [own, squared] = moments(&self.images.weights[0].slow, |n| {
            (along_m[n] - middle_m).powi(2)
        });
        squared / own
    }

    /// Power of the whitened differences of the channels from the first one at each velocity, in units of the noise.
    fn powers(&self, planes: &[Image], search: &Search) -> Vec<f64> {
        let velocities = &search.velocities;
        let columns = velocities.columns.count;
        let at = |i: usize| {
            let velocity = velocities.position_m(i / columns, i % columns);
            let rate = search.gradient.dot(velocity);
            let first = planes[0].pixels[i];
            let others = planes
                .iter()
                .zip(self.alignment.lags_s())
                .enumerate()
                .skip(1);
            let differences = others.map(|(c, (plane, lag_s))| {
                let model = &self.images.models[c - 1];
                let cycles = self.images.centre_hz * rate * lag_s / SPEED_OF_LIGHT_M_S;
                let phase = std::f64::consts::TAU * cycles
                    + self.images.view.phase_rad(model, search.place_m);
                let factor = Complex64::from_polar(1.0 / model.gain, -phase);
                let factor = Complex32::new(factor.re as f32, factor.im as f32);
                plane.pixels[i] * factor - first
            });
            let differences: Vec<Complex32> = differences.collect();
            let mut white = vec![Complex64::ZERO; differences.len()];
            search.whitener.whiten(&differences, &mut white);
            white.iter().map(Complex64::norm_sqr).sum::<f64>() * search.snapshots as f64
        };
        (0..planes[0].pixels.len()).map(at).collect()
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

/// Maximum over velocities by a parabola through the logarithms of the powers over cross-range velocity, and its pixel.
fn maximum(powers: &[f64], velocities: &ImageGrid) -> Option<(CrossRange, usize)> {
    let columns = velocities.columns.count;
    let over_rows = |column: usize| {
        let pixels = (column..powers.len()).step_by(columns);
        pixels.max_by(|&a, &b| powers[a].total_cmp(&powers[b]))
    };
    let pixels: Vec<usize> = (0..columns).filter_map(over_rows).collect();
    let best: Vec<f64> = pixels.iter().map(|&pixel| powers[pixel]).collect();
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
    // The logarithm of a peak is closer to a parabola.
    let [left, middle, right] = [before, at, after].map(libm::log);
    let offset = 0.5 * (right - left) / (2.0 * middle - left - right);
    let stationary = best[columns / 2];
    let found = CrossRange {
        velocity_m_s: velocities.columns.at(peak) + offset * step,
        deviation_m_s: step / curvature.sqrt(),
        gain_db: 10.0 * (at / stationary).log10(),
    };
    Some((found, pixels[peak]))
}
