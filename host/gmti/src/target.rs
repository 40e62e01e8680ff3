//! Detected targets: radial velocity and position with covariance.
//!
//! Detected pixels form groups, one for each target ([`crate::groups`]). The radial velocity has the largest likelihood ([`crate::radial`]). The place in the image is the mean over pixels, weighted by the excess of
//! their powers over a tenth of the largest. Its error along the path is that of the maximum of a response in noise, at the signal to noise ratio of all these pixels, with the spectrum of the window.
//!
//! The image shows a target of path rate `rho = -2 v` where a stationary scatterer has its path and its total path rate. Its position at
//! the middle of the aperture has the same path, and the path rate of the radar alone:
//!
//! ```text
//! path(p) = path(image place),   d path(p) / dt = d path(image place) / dt - rho
//! ```
//!
//! Range and Doppler side lobes of a strong target exceed the threshold as well. Groups of pixels on its Doppler or range line are left out and counted if they are weaker by
//! the side lobe ratio (PSLR) of the window over frequency or slow time, less a margin of 8 dB, and by 1.5 dB more per octave of the distance beyond 5 cells.
//!
//! Neglected: height above the grid's plane, acceleration, and the motion along the track, which defocus or move the image place less.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::phase_history::Collection;
use subaperture_model::resolution::theory::expected;
use subaperture_signal::window::Window;

use crate::alignment::Alignment;
use crate::detection::{Settings, StatisticMap, unambiguous_m_s};
use crate::error::GmtiError;
use crate::groups::groups;
use crate::images::ChannelImages;
use crate::moments::moments;
use crate::motion::{CrossRange, axes};
use crate::radial::{Radial, radial, region};
use crate::space_time::{Motion, Mover};

/// Level below the strongest pixel of a target, dB, from which its pixels are used.
const USED_DB: f64 = 10.0;

/// Margin of the side lobes of a target over those of the windows, dB: a defocused target is lower, and its side lobes add to noise.
const SIDE_LOBE_MARGIN_DB: f64 = 8.0;

/// Distance from which side lobes fall by 1.5 dB per octave or more, resolution cells.
const LEVEL_CELLS: f64 = 5.0;

/// Half-width of the lines of side lobes, resolution cells.
const LINE_CELLS: f64 = 3.0;

/// Smallest cosine of the grazing angle with which a radial velocity gives a horizontal one.
const MIN_LEVEL: f64 = 0.05;

/// Standard deviation of the mean over pixels without noise, range cells, with two pixels or more in a cell: measured on 500 targets (`tests/scene`).
const PLACE_CELLS: f64 = 0.004;

/// Standard deviation of the place of a target in the image along the track, as a fraction of its extent: measured on 240 targets (`tests/scene`).
const EXTENT_DEVIATION: f64 = 0.045;

/// Detected moving target at the middle of the aperture.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Target {
    /// Time from the collection's start, seconds.
    pub time_s: f64,
    /// Row and column in the image, where the target appears.
    pub image_pixel: [f64; 2],
    /// Scene position at which the target appears, metres.
    pub image_position_m: [f64; 3],
    /// Position of the target, metres. `None` where no point of the plane has its path and path rate.
    pub position_m: Option<[f64; 3]>,
    /// Covariance of the position along x and y of the grid, square metres.
    pub covariance_m2: Option<[[f64; 2]; 2]>,
    /// Covariance of the position along x and y of the grid with the radial velocity, m * m/s.
    pub position_velocity_covariance: Option<[f64; 2]>,
    /// Velocity along the line of sight, metres per second, positive when approaching.
    pub radial_velocity_m_s: f64,
    /// Standard deviation of the radial velocity, metres per second.
    pub velocity_deviation_m_s: f64,
    /// Interval of radial velocities without ambiguity: other velocities differ by multiples of it, metres per second.
    pub velocity_ambiguity_m_s: f64,
    /// Cross-range velocity from the target's focus, for a target without acceleration. `None` if it was not estimated.
    pub cross_range: Option<CrossRange>,
    /// Horizontal velocity in the scene frame, metres per second, from radial and cross-range velocity.
    pub velocity_m_s: Option<[f64; 3]>,
    /// Acceleration in the scene frame, metres per second squared; `None` if it was not sought. Its target is assumed to have no cross-range velocity.
    pub acceleration_m_s2: Option<[f64; 3]>,
    /// Horizontal speed towards the radar, if the motion is horizontal and radial, metres per second.
    pub ground_speed_m_s: f64,
    /// Ratio of signal to clutter and noise after cancellation, dB.
    pub snr_db: f64,
    /// Extent along the track of its pixels within 10 dB of the strongest, metres: resolution and defocus.
    pub extent_m: f64,
    /// Number of pixels above the threshold.
    pub num_pixels: usize,
}

/// Estimator of the targets of one tested image.
pub(crate) struct Estimator<'a> {
    /// Registered images of all channels.
    pub(crate) images: &'a ChannelImages,
    /// Alignment of the channels.
    pub(crate) alignment: &'a Alignment,
    /// Geometry of channel 0.
    pub(crate) collection: &'a Collection,
    /// Pixel grid of the images.
    pub(crate) grid: &'a ImageGrid,
    /// Settings with which the image was tested.
    pub(crate) settings: &'a Settings,
    /// Windows over frequency and slow time.
    pub(crate) windows: [Window; 2],
}

/// Ratio of power from which a weaker group of pixels may be a side lobe of a window.
fn side_lobe_ratio(window: Window) -> f32 {
    let response = expected(&window.weights(128), 16.0, 3.0);
    let ratio_db = response
        .and_then(|response| response.null_rule.pslr_db)
        .unwrap_or(0.0);
    let ratio_db = (-ratio_db - SIDE_LOBE_MARGIN_DB).max(0.0);
    10f64.powf(ratio_db / 10.0) as f32
}

impl Estimator<'_> {
    /// Estimate the targets of a tested image, strongest first, and count the side lobes that were left out.
    ///
    /// # Errors
    /// [`GmtiError::Adaptive`] if training fails.
    pub(crate) fn targets(&self, map: &StatisticMap) -> Result<(Vec<Target>, usize), GmtiError> {
        let track = SubCpi::new(self.collection, self.alignment.middle_pulses());
        let path_cell_m = 2.0 * self.range_cell_m();
        let rate_cell = SPEED_OF_LIGHT_M_S / self.images.centre_hz / self.alignment.duration_s()
            * self.alignment.interval_s();
        let mut lines: Vec<Lines> = Vec::new();
        let mut kept = Vec::new();
        let mut side_lobes = 0;
        let ratios = self.windows.map(side_lobe_ratio);
        for (peak, pixels) in groups(map) {
            let of = |pixel: usize| track.path_and_rate(self.pixel_m(pixel));
            let ((path_m, rate), snr) = (of(peak), map.snr[peak]);
            let masks = |stronger: &Lines| stronger.mask((path_m, rate), snr, ratios);
            if lines.iter().any(masks) {
                side_lobes += 1;
                continue;
            }
            lines.push(Lines::around(
                pixels.iter().map(|&pixel| of(pixel)),
                [path_cell_m, rate_cell],
                snr,
            ));
            kept.push((peak, pixels));
        }
        let targets = kept.par_iter();
        let targets = targets.map(|(peak, pixels)| self.target(map, &track, (*peak, pixels)));
        let targets: Vec<Result<Target, GmtiError>> = targets.collect();
        // The first error in the order of the targets.
        let targets = targets.into_iter().collect::<Result<_, GmtiError>>()?;
        Ok((targets, side_lobes))
    }

    fn target(
        &self,
        map: &StatisticMap,
        track: &SubCpi,
        (peak, pixels): (usize, &[usize]),
    ) -> Result<Target, GmtiError> {
        let snr = |pixel: usize| f64::from(map.snr[pixel]);
        let weakest = snr(peak) * 10f64.powf(-USED_DB / 10.0);
        let used: Vec<usize> = pixels
            .iter()
            .copied()
            .filter(|&pixel| snr(pixel) >= weakest)
            .collect();
        let region = region(map, &used, pixels);
        let Radial {
            velocity_m_s: velocity,
            deviation_m_s: deviation,
            ambiguity_m_s: ambiguity,
            powers,
        } = radial(
            self.images,
            self.alignment,
            self.settings,
            map,
            (peak, &used, &region),
        )?;
        // Weights that fall to 0 at the edge of the target: a step would draw the mean to the pixels.
        let strongest = powers.iter().copied().fold(0.0, f64::max);
        let least = strongest * 10f64.powf(-USED_DB / 10.0);
        let weights = powers.iter().map(|&power| (power - least).max(0.0));
        let weights: Vec<f64> = weights.collect();
        let total: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(usize) -> usize| {
            let pixels = region.iter().zip(&weights);
            let terms = pixels.map(|(&pixel, weight)| weight * of(pixel) as f64);
            terms.sum::<f64>() / total
        };
        let [row, column] = [
            mean(&|pixel| pixel / map.columns),
            mean(&|pixel| pixel % map.columns),
        ];
        let along = self.images.view.along();
        let places = used.iter().map(|&pixel| self.pixel_m(pixel).dot(along));
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        let [start_m, end_m] = places.fold(ends, |[low, high], s| [low.min(s), high.max(s)]);
        let extent_m = end_m - start_m;
        let image_m = self.place_m(row, column);
        let sight = (image_m - self.images.view.antenna_m()).normalize_or_zero();
        let level = libm::hypot(sight.x, sight.y);
        let interval_s = self.alignment.interval_s();
        let (path_m, rate) = track.path_and_rate(image_m);
        let place = |velocity_m_s: f64, path_m: f64| {
            let rate = rate + 2.0 * velocity_m_s * interval_s;
            track.locate(image_m, [self.grid.x_axis, self.grid.y_axis], path_m, rate)
        };
        let position = place(velocity, path_m);
        // Resolution and SNR determine the error of the path; the errors of the velocity and of the place in the image move the position along the track.
        let cell_m = self.range_cell_m();
        let above = powers.iter().filter(|&&power| power > least);
        let energy = above.sum::<f64>() / map.cell_pixels;
        let noise = self.range_deviation() / energy.max(strongest).sqrt();
        let path_error_m = 2.0 * cell_m * libm::hypot(noise, PLACE_CELLS);
        let covariances = position.and_then(|position| {
            let ends = [
                place(velocity + deviation, path_m)?,
                place(velocity, path_m + path_error_m)?,
            ];
            let [velocity_m, path_m] = ends.map(|end| end - position);
            let image_m = along * (EXTENT_DEVIATION * (extent_m + self.azimuth_cell_m(image_m)));
            let errors = [velocity_m, path_m, image_m]
                .map(|moved| [moved.dot(self.grid.x_axis), moved.dot(self.grid.y_axis)]);
            let sum = |i: usize, j: usize| errors.iter().map(|e| e[i] * e[j]).sum();
            let matrix = [[sum(0, 0), sum(0, 1)], [sum(1, 0), sum(1, 1)]];
            Some((matrix, errors[0].map(|e| e * deviation)))
        });
        Ok(Target {
            time_s: self.alignment.centre_s(),
            image_pixel: [row, column],
            image_position_m: image_m.to_array(),
            position_m: position.map(|position| position.to_array()),
            covariance_m2: covariances.map(|(position, _)| position),
            position_velocity_covariance: covariances.map(|(_, velocity)| velocity),
            radial_velocity_m_s: velocity,
            velocity_deviation_m_s: deviation,
            velocity_ambiguity_m_s: ambiguity,
            cross_range: None,
            velocity_m_s: None,
            acceleration_m_s2: None,
            ground_speed_m_s: velocity / level,
            snr_db: 10.0 * snr(peak).log10(),
            extent_m,
            num_pixels: pixels.len(),
        })
    }

    /// Target detected by integration over sub-CPIs.
    pub(crate) fn of_mover(&self, mover: &Mover) -> Target {
        let Motion {
            epoch_s,
            position_m,
            velocity_m_s,
            acceleration_m_s2,
        } = mover.motion;
        let image_m = mover.image_position_m.unwrap_or(position_m);
        let [row, column] = self.grid.coordinates(image_m);
        let pixel = |axis: &Axis, value: f64| (value - axis.start) / axis.step;
        let sight = (position_m - self.images.view.antenna_m()).normalize_or_zero();
        let plane = [self.grid.x_axis, self.grid.y_axis].map(|axis| -sight.dot(axis));
        let errors = &mover.covariance;
        let [velocity_deviation_m_s, cross_deviation_m_s] = mover.velocity_deviations_m_s;
        let radial = |i: usize| errors[i][2] * plane[0] + errors[i][3] * plane[1];
        Target {
            time_s: epoch_s,
            image_pixel: [
                pixel(&self.grid.rows, row),
                pixel(&self.grid.columns, column),
            ],
            image_position_m: image_m.to_array(),
            position_m: Some(position_m.to_array()),
            covariance_m2: Some([0, 1].map(|i| [errors[i][0], errors[i][1]])),
            position_velocity_covariance: Some([0, 1].map(radial)),
            radial_velocity_m_s: mover.radial_velocity_m_s,
            velocity_deviation_m_s,
            velocity_ambiguity_m_s: 2.0
                * unambiguous_m_s(self.alignment.lags_s(), self.images.centre_hz),
            cross_range: Some(CrossRange {
                velocity_m_s: mover.cross_range_velocity_m_s,
                deviation_m_s: cross_deviation_m_s,
                gain_db: 0.0,
            }),
            velocity_m_s: Some(velocity_m_s.to_array()),
            acceleration_m_s2: Some(acceleration_m_s2.to_array()),
            ground_speed_m_s: mover.radial_velocity_m_s / libm::hypot(sight.x, sight.y),
            snr_db: 10.0 * mover.integrated.coherent.log10(),
            extent_m: self.azimuth_cell_m(image_m),
            num_pixels: 1,
        }
    }

    /// Horizontal velocity of a target with a cross-range velocity.
    pub(crate) fn velocity_m_s(&self, target: &Target) -> Option<[f64; 3]> {
        let across_m_s = target.cross_range?.velocity_m_s;
        let sight = DVec3::from(target.position_m?) - self.images.view.antenna_m();
        let [x_axis, y_axis] = axes(sight, self.images.view.along())?;
        let level = y_axis.dot(sight.normalize_or_zero());
        let velocity = x_axis * across_m_s - y_axis * (target.radial_velocity_m_s / level);
        // A target below the radar has no horizontal velocity along the line of sight.
        (level > MIN_LEVEL).then(|| velocity.to_array())
    }

    /// Scene position of the pixel with this index.
    fn pixel_m(&self, pixel: usize) -> DVec3 {
        let columns = self.grid.columns.count;
        self.grid.position_m(pixel / columns, pixel % columns)
    }

    /// Scene position at fractional pixels.
    fn place_m(&self, row: f64, column: f64) -> DVec3 {
        let (r, c) = (row.floor() as usize, column.floor() as usize);
        let near = self.grid.position_m(r, c);
        let next = |r: usize, c: usize| {
            self.grid.position_m(
                r.min(self.grid.rows.count - 1),
                c.min(self.grid.columns.count - 1),
            ) - near
        };
        near + next(r + 1, c) * row.fract() + next(r, c + 1) * column.fract()
    }

    /// Resolution along the track at a position, metres: `lambda R / (2 V T)`.
    fn azimuth_cell_m(&self, position_m: DVec3) -> f64 {
        let wavelength_m = SPEED_OF_LIGHT_M_S / self.images.centre_hz;
        let length_m = self.alignment.speed_m_s() * self.alignment.duration_s();
        wavelength_m * position_m.distance(self.images.view.antenna_m()) / (2.0 * length_m)
    }

    /// Slant range resolution, metres.
    fn range_cell_m(&self) -> f64 {
        let step_hz = self.collection.pulses[0].step_hz;
        let bandwidth_hz = self.collection.num_samples as f64 * step_hz;
        SPEED_OF_LIGHT_M_S / (2.0 * bandwidth_hz)
    }

    /// Standard deviation of a range, in resolution cells at an SNR of 1.
    fn range_deviation(&self) -> f64 {
        let fast = &self.images.weights[0].fast;
        let [own, squared] = moments(fast, |k| TAU * k as f64 / fast.len() as f64);
        (squared / 2.0).sqrt() / own
    }
}

/// Range and Doppler lines of a target: intervals of its paths and path rates, and its SNR.
struct Lines {
    paths_m: [f64; 2],
    rates: [f64; 2],
    cells: [f64; 2],
    snr: f32,
}

impl Lines {
    /// Lines of pixels with these paths and rates. `cells` are the resolution cells of both.
    fn around(pixels: impl Iterator<Item = (f64, f64)>, cells: [f64; 2], snr: f32) -> Self {
        let empty = [f64::INFINITY, f64::NEG_INFINITY];
        let wider = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        let (paths_m, rates) = pixels.fold((empty, empty), |(paths_m, rates), (path_m, rate)| {
            (wider(paths_m, path_m), wider(rates, rate))
        });
        Self {
            paths_m,
            rates,
            cells,
            snr,
        }
    }

    /// Whether a pixel of this SNR may be a side lobe: on the Doppler line by the window over frequency, or on the range line by that over slow time.
    fn mask(&self, (path_m, rate): (f64, f64), snr: f32, [fast, slow]: [f32; 2]) -> bool {
        let outside = |[low, high]: [f64; 2], value: f64| (low - value).max(value - high).max(0.0);
        let range = outside(self.paths_m, path_m) / self.cells[0];
        let doppler = outside(self.rates, rate) / self.cells[1];
        let level = |cells: f64| (cells / LEVEL_CELLS).max(1.0).sqrt() as f32;
        (doppler <= LINE_CELLS && self.snr >= fast * level(range) * snr)
            || (range <= LINE_CELLS && self.snr >= slow * level(doppler) * snr)
    }
}
