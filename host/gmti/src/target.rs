//! Detected targets: radial velocity and position with covariance.
//!
//! Detected pixels form groups, one for each target ([`crate::groups`]). The radial velocity has the largest likelihood ([`crate::radial`]). The place in the image is a mean over pixels ([`crate::place`]).
//!
//! The image shows a target of path rate `rho = -2 v` where a stationary scatterer has its path and its total path rate. Its position at
//! the middle of the aperture has the same path, and the path rate of the radar alone:
//!
//! ```text
//! path(p) = path(image place),   d path(p) / dt = d path(image place) / dt - rho
//! ```
//!
//! The covariance of the position is the sum of that by the radial velocity, which moves it along the track, and that by the place in the image: noise, and the distance of pixels. Errors of the radial velocity are independent of those of the place in first order: noise in the direction of the whitened steering vector moves the place, noise normal to it the radial velocity.
//!
//! Range and Doppler side lobes of a strong target exceed the threshold as well. Groups of pixels on its Doppler or range line are left out and counted if they are weaker by
//! the side lobe ratio (PSLR) of the window over frequency or slow time, less a margin of 8 dB, and by 1.5 dB more per octave of the distance beyond 5 cells. The powers of both are compared in units of the same covariance, that around the weaker group: the SNR of the map
//! is lower by some 20 dB for targets with another strong target in their training cells.
//!
//! Neglected: height above the grid's plane, acceleration, and the motion along the track, which defocus or move the image place less.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::phase_history::Collection;
use subaperture_model::resolution::theory::expected;
use subaperture_signal::window::Window;

use crate::adaptive::{AdaptiveError, Loading, Whitener, power};
use crate::alignment::Alignment;
use crate::detection::{Settings, StatisticMap, Vector, differences, train, unambiguous_m_s};
use crate::error::GmtiError;
use crate::groups::groups;
use crate::images::ChannelImages;
use crate::motion::{CrossRange, axes};
use crate::noise::{Echo, NoiseSpectrum};
use crate::place::{Place, USED};
use crate::radial::{Radial, radial, region};
use crate::space_time::{Motion, Mover};

/// Margin of the side lobes of a target over those of the windows, dB: a defocused target is lower, and its side lobes add to noise.
const SIDE_LOBE_MARGIN_DB: f64 = 8.0;

/// Distance from which side lobes fall by 1.5 dB per octave or more, resolution cells.
const LEVEL_CELLS: f64 = 5.0;

/// Half-width of the lines of side lobes, resolution cells.
const LINE_CELLS: f64 = 3.0;

/// Smallest cosine of the grazing angle with which a radial velocity gives a horizontal one.
const MIN_LEVEL: f64 = 0.05;

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
fn side_lobe_ratio(window: Window) -> f64 {
    let response = expected(&window.weights(128), 16.0, 3.0);
    let ratio_db = response
        .and_then(|response| response.null_rule.pslr_db)
        .unwrap_or(0.0);
    let ratio_db = (-ratio_db - SIDE_LOBE_MARGIN_DB).max(0.0);
    10f64.powf(ratio_db / 10.0)
}

impl Estimator<'_> {
    /// Estimate the targets of a tested image, strongest first, and count the side lobes that were left out.
    ///
    /// # Errors
    /// [`GmtiError::Adaptive`] if training fails.
    pub(crate) fn targets(&self, map: &StatisticMap) -> Result<(Vec<Target>, usize), GmtiError> {
        let track = SubCpi::new(self.collection, self.alignment.middle_pulses());
        let noise = NoiseSpectrum {
            windows: self.windows,
            track: &track,
            grid: self.grid,
            cells: [
                2.0 * self.range_cell_m(),
                SPEED_OF_LIGHT_M_S / self.images.centre_hz / self.alignment.duration_s()
                    * self.alignment.interval_s(),
            ],
            centre_hz: self.images.centre_hz,
        };
        let all = groups(map);
        let kept = self.main_lobes(map, &noise, &all)?;
        let side_lobes = all.len() - kept.len();
        // The main lobe of a response is narrower than twice the distance of independent cells.
        let reach = [map.spacing.rows, map.spacing.columns].map(|spacing| 2 * spacing);
        let sampling = match kept.is_empty() {
            true => [0.0; 2],
            false => noise.sampling_deviation(reach),
        };
        let targets = kept.par_iter();
        let targets =
            targets.map(|(peak, pixels)| self.target(map, &noise, sampling, (*peak, pixels)));
        let targets: Vec<Result<Target, GmtiError>> = targets.collect();
        // The first error in the order of the targets.
        let targets = targets.into_iter().collect::<Result<_, GmtiError>>()?;
        Ok((targets, side_lobes))
    }

    /// Groups without side lobes of stronger ones, in their order.
    fn main_lobes<'g>(
        &self,
        map: &StatisticMap,
        noise: &NoiseSpectrum,
        all: &'g [(usize, Vec<usize>)],
    ) -> Result<Vec<&'g (usize, Vec<usize>)>, GmtiError> {
        let size = self.images.images.len() - 1;
        let vector = |peak: usize| {
            let mut vector = vec![Complex32::ZERO; size];
            differences(self.images, peak, &mut vector);
            vector
        };
        let trained = all.par_iter().map(|(peak, _)| {
            let vectors = (size, differences as Vector);
            let covariance = train(self.images, map, self.settings, *peak, vectors);
            let whitener = covariance.factor(Loading::Off)?;
            Ok((whitener, covariance.snapshots() as f64))
        });
        let trained: Vec<Result<(Whitener, f64), AdaptiveError>> = trained.collect();
        let trained = trained.into_iter().collect::<Result<Vec<_>, _>>()?;
        // Power of the peak of group `other` in units of the covariance around group `own`.
        let power = |own: usize, other: usize| {
            let (whitener, snapshots) = &trained[own];
            let mut white = vec![Complex64::ZERO; size];
            whitener.whiten(&vector(all[other].0), &mut white);
            snapshots * power(&white)
        };
        let lines: Vec<Lines> = all
            .par_iter()
            .map(|(_, pixels)| {
                let places = pixels.iter();
                Lines::around(
                    places.map(|&pixel| noise.track.path_and_rate(self.pixel_m(pixel))),
                    noise.cells,
                )
            })
            .collect();
        let ratios = self.windows.map(side_lobe_ratio);
        // Strongest first, each in units of the covariance around it: a side lobe comes after its target.
        let own_powers: Vec<f64> = (0..all.len()).map(|own| power(own, own)).collect();
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_by(|&a, &b| own_powers[b].total_cmp(&own_powers[a]));
        let mut kept: Vec<usize> = Vec::new();
        for own in order {
            let place = noise.track.path_and_rate(self.pixel_m(all[own].0));
            let masks = |&other: &usize| {
                let least = lines[other].least_ratio(place, ratios);
                least.is_some_and(|least| power(own, other) >= least * own_powers[own])
            };
            if !kept.iter().any(masks) {
                kept.push(own);
            }
        }
        kept.sort_unstable();
        Ok(kept.into_iter().map(|own| &all[own]).collect())
    }

    /// Estimate the target of a group of pixels. `sampling` is the error of its place by the distance of pixels.
    fn target(
        &self,
        map: &StatisticMap,
        noise: &NoiseSpectrum,
        sampling: [f64; 2],
        (peak, pixels): (usize, &[usize]),
    ) -> Result<Target, GmtiError> {
        let snr = |pixel: usize| f64::from(map.snr[pixel]);
        let weakest = snr(peak) * USED;
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
            echoes,
        } = radial(
            self.images,
            self.alignment,
            self.settings,
            map,
            noise,
            (peak, &used, &region),
        )?;
        let powers: Vec<f64> = echoes.iter().map(Echo::power).collect();
        let places = region
            .iter()
            .map(|&pixel| [pixel / map.columns, pixel % map.columns].map(|at| at as f64));
        let places: Vec<[f64; 2]> = places.collect();
        let Place {
            mean: [row, column],
            factors,
        } = Place::of(&places, &powers);
        let along = self.images.view.along();
        let places = used.iter().map(|&pixel| self.pixel_m(pixel).dot(along));
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        let [start_m, end_m] = places.fold(ends, |[low, high], s| [low.min(s), high.max(s)]);
        let extent_m = end_m - start_m;
        let image_m = self.place_m(row, column);
        let sight = (image_m - self.images.view.antenna_m()).normalize_or_zero();
        let level = libm::hypot(sight.x, sight.y);
        let interval_s = self.alignment.interval_s();
        let axes = [self.grid.x_axis, self.grid.y_axis];
        let place = |image_m: DVec3, velocity_m_s: f64| {
            let (path_m, rate) = noise.track.path_and_rate(image_m);
            let rate = rate + 2.0 * velocity_m_s * interval_s;
            noise.track.locate(image_m, axes, path_m, rate)
        };
        let position = place(image_m, velocity);
        let mut in_image = noise.covariance(&echoes, |p| factors[p]);
        for axis in [0, 1] {
            in_image[axis][axis] += sampling[axis].powi(2);
        }
        let covariances = position.and_then(|position| {
            let moved = |place: DVec3| axes.map(|axis| (place - position).dot(axis));
            let of_velocity = moved(place(image_m, velocity + deviation)?);
            let pixels_m = self.pixel_steps_m(row, column);
            let of_pixel = [
                moved(place(image_m + pixels_m[0], velocity)?),
                moved(place(image_m + pixels_m[1], velocity)?),
            ];
            let sum = |i: usize, j: usize| {
                let terms = [[0, 0], [0, 1], [1, 0], [1, 1]];
                let terms = terms.map(|[a, b]| of_pixel[a][i] * in_image[a][b] * of_pixel[b][j]);
                of_velocity[i] * of_velocity[j] + terms.iter().sum::<f64>()
            };
            let matrix = [[sum(0, 0), sum(0, 1)], [sum(1, 0), sum(1, 1)]];
            Some((matrix, of_velocity.map(|moved_m| moved_m * deviation)))
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

    /// Distances of the pixels at fractional pixels, along a column and along a row.
    fn pixel_steps_m(&self, row: f64, column: f64) -> [DVec3; 2] {
        let (r, c) = (row as usize, column as usize);
        let near = self.grid.position_m(r, c);
        [[r + 1, c], [r, c + 1]].map(|[r, c]| self.grid.position_m(r, c) - near)
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
}

/// Range and Doppler lines of a target: intervals of its paths and path rates.
struct Lines {
    paths_m: [f64; 2],
    rates: [f64; 2],
    cells: [f64; 2],
}

impl Lines {
    /// Lines of pixels with these paths and rates. `cells` are the resolution cells of both.
    fn around(pixels: impl Iterator<Item = (f64, f64)>, cells: [f64; 2]) -> Self {
        let empty = [f64::INFINITY, f64::NEG_INFINITY];
        let wider = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        let (paths_m, rates) = pixels.fold((empty, empty), |(paths_m, rates), (path_m, rate)| {
            (wider(paths_m, path_m), wider(rates, rate))
        });
        Self {
            paths_m,
            rates,
            cells,
        }
    }

    /// Least ratio of the target's power to that of its side lobe at this path and rate: by the window over frequency on the Doppler line, and by that over slow time on the range line. `None` on neither.
    fn least_ratio(&self, (path_m, rate): (f64, f64), [fast, slow]: [f64; 2]) -> Option<f64> {
        let outside = |[low, high]: [f64; 2], value: f64| (low - value).max(value - high).max(0.0);
        let range = outside(self.paths_m, path_m) / self.cells[0];
        let doppler = outside(self.rates, rate) / self.cells[1];
        let level = |cells: f64| (cells / LEVEL_CELLS).max(1.0).sqrt();
        let of_range = (doppler <= LINE_CELLS).then(|| fast * level(range));
        let of_doppler = (range <= LINE_CELLS).then(|| slow * level(doppler));
        [of_range, of_doppler]
            .into_iter()
            .flatten()
            .reduce(f64::min)
    }
}
