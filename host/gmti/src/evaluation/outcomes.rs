//! Statistics of all methods for given motions in one recording.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::phase_history::{Channels, Collection};

use super::method::Method;
use crate::adaptive::{Covariance, Loading, Performance, Statistic, TargetModel, widen};
use crate::alignment::Alignment;
use crate::ati::Interferogram;
use crate::correlation::{Correlation, Spacing};
use crate::detection::{self, of_maximum, of_one_velocity, steering_of_differences};
use crate::error::GmtiError;
use crate::images::{ChannelImages, Imaging};
use crate::interleaved::Interleaved;
use crate::space_time::{self, Calibration, Filtered, Motion, SpaceTime};

/// Adjacent Doppler bins that are compared.
const BINS: [usize; 3] = [1, 3, 5];

/// Settings of all methods.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// Settings of the channel images.
    pub imaging: Imaging<'a>,
    /// Training of the images, and the probability of false alarm of all methods.
    pub detection: detection::Settings,
    /// Settings of sub-CPIs; the bins are not used.
    pub integration: space_time::Settings,
    /// Mean radar cross-section of a target, m^2.
    pub cross_section_m2: f64,
}

/// Result of a method for one motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outcome {
    /// Probability that clutter alone exceeds the statistic.
    pub(super) probability: f64,
    /// Ratio of signal to clutter and noise of a target of the mean radar cross-section, and its probability of detection. `None` where theory does not give them.
    pub(super) predicted: Option<Predicted>,
}

/// Prediction from the estimated covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Predicted {
    pub(super) sinr: f64,
    pub(super) probability: f64,
}

/// Results of a method for each motion.
pub(super) type Outcomes = (Method, Vec<Option<Outcome>>);

/// Results of every method for each motion. `None` outside of the image or maps.
pub(super) fn outcomes(
    channels: &Channels,
    setup: &Setup,
    motions: &[Motion],
) -> Result<Vec<Outcomes>, GmtiError> {
    let histories = channels.iter().map(|(_, history)| history.collection());
    let collections: Vec<&Collection> = histories.collect();
    let alignment = Alignment::new(&collections)?;
    let images = setup.imaging.form(channels, &alignment)?;
    let calibration = Calibration::of(&images);
    let tested = TestedImages::new(setup, collections[0], &alignment, &images)?;
    let mut results = Vec::new();
    let mut add =
        |method: Method, of: &(dyn Fn(&Motion) -> Result<Option<Outcome>, GmtiError> + Sync)| {
            let all: Result<Vec<Option<Outcome>>, GmtiError> = motions.par_iter().map(of).collect();
            results.push((method, all?));
            Ok::<(), GmtiError>(())
        };
    let grid = setup.imaging.grid;
    let mut maps = SpaceTime::form(channels, &alignment, &calibration, grid, &setup.integration)?;
    let middle = setup.integration.sub_cpis / 2;
    add(Method::ExoClutter, &|motion| {
        let filtered = maps.in_first_channel(middle, |time_s| motion.at(time_s));
        of_filtered(setup, 1, filtered)
    })?;
    add(Method::Ati, &|motion| Ok(tested.ati(motion)))?;
    add(Method::Dpca, &|motion| tested.amf(motion, 2))?;
    if channels.len() > 2 {
        add(Method::Image, &|motion| tested.amf(motion, channels.len()))?;
    }
    for bins in BINS {
        maps = maps.with_bins(bins);
        let size = bins * channels.len();
        add(Method::Efa { bins }, &|motion| {
            of_filtered(
                setup,
                size,
                maps.in_sub_cpi(middle, |time_s| motion.at(time_s)),
            )
        })?;
        add(Method::Integrated { bins }, &|motion| {
            of_integrated(setup, size, &maps, motion)
        })?;
    }
    Ok(results)
}

impl Setup<'_> {
    /// Prediction of a fluctuating target whose amplitude 1 has the SNR `gain`.
    fn predicted(
        &self,
        performance: Performance,
        gain: f64,
        one: f64,
    ) -> Result<Predicted, GmtiError> {
        let sinr = self.cross_section_m2 * gain;
        let threshold = performance.threshold(one)?;
        let probability =
            performance.detection_probability(threshold, sinr, TargetModel::Swerling1);
        Ok(Predicted { sinr, probability })
    }
}

/// Outcome of a value in one sub-CPI.
fn of_filtered(
    setup: &Setup,
    size: usize,
    filtered: Option<Filtered>,
) -> Result<Option<Outcome>, GmtiError> {
    let Some(filtered) = filtered.filter(|filtered| filtered.gain > 0.0) else {
        return Ok(None);
    };
    let performance = Performance::new(Statistic::Amf, size, filtered.snapshots)?;
    let amf = filtered.output.norm_sqr() / filtered.gain / filtered.snapshots as f64;
    let one = setup.detection.false_alarm_probability;
    Ok(Some(Outcome {
        probability: performance.false_alarm_probability(amf),
        predicted: Some(setup.predicted(performance, filtered.gain, one)?),
    }))
}

/// Outcome of the sum over all sub-CPIs, with the threshold of [`space_time::find`] for one hypothesis.
fn of_integrated(
    setup: &Setup,
    size: usize,
    maps: &SpaceTime,
    motion: &Motion,
) -> Result<Option<Outcome>, GmtiError> {
    let integrated = maps.integrate(motion);
    if integrated.gain.is_nan() || integrated.gain <= 0.0 {
        return Ok(None);
    }
    let one = setup.detection.false_alarm_probability;
    let performance = Performance::new(Statistic::Amf, size, maps.snapshots() as usize)?;
    Ok(Some(Outcome {
        probability: maps.exceedance(integrated.coherent),
        predicted: Some(setup.predicted(performance, integrated.gain, one)?),
    }))
}

/// Registered images with the quantities that all pixels share.
struct TestedImages<'a> {
    setup: &'a Setup<'a>,
    images: &'a ChannelImages,
    alignment: &'a Alignment,
    spacing: Spacing,
    /// Length of the curve of steering vectors of all channels.
    curve_length: f64,
    track: SubCpi,
}

impl<'a> TestedImages<'a> {
    fn new(
        setup: &'a Setup<'a>,
        collection: &Collection,
        alignment: &'a Alignment,
        images: &'a ChannelImages,
    ) -> Result<Self, GmtiError> {
        let spacing = Correlation::measure(&images.images[0]).spacing();
        let steering = steering_of_differences(alignment.lags_s(), images.centre_hz);
        Ok(Self {
            setup,
            images,
            alignment,
            spacing,
            curve_length: detection::curve_length(images, spacing, &steering)?,
            track: SubCpi::new(collection, alignment.middle_pulses()),
        })
    }

    /// Pixel nearest to the place where the image shows a target.
    fn pixel(&self, motion: &Motion) -> Option<usize> {
        let grid = self.setup.imaging.grid;
        let position_m = motion.at(self.alignment.centre_s());
        let (path_m, rate) = self.track.path_and_rate(position_m);
        let sight = (position_m - self.images.view.antenna_m()).normalize_or_zero();
        // A pulse interval changes the path by twice the radial displacement.
        let own_rate = 2.0 * sight.dot(motion.velocity_m_s) * self.alignment.interval_s();
        let axes = [grid.x_axis, grid.y_axis];
        let image_m = self
            .track
            .locate(position_m, axes, path_m, rate + own_rate)?;
        let [row, column] = grid.coordinates(image_m);
        let nearest = |axis: &subaperture_model::geometry::Axis, value: f64| {
            let index = ((value - axis.start) / axis.step).round();
            (0.0..axis.count as f64)
                .contains(&index)
                .then_some(index as usize)
        };
        Some(nearest(&grid.rows, row)? * grid.columns.count + nearest(&grid.columns, column)?)
    }

    /// Training pixels around a pixel.
    fn ring(&self, pixel: usize) -> Vec<usize> {
        let size = [self.images.images[0].rows, self.images.images[0].columns];
        let interleaved = Interleaved::new(size, self.spacing);
        interleaved
            .ring(pixel, self.setup.detection.reach(size))
            .collect()
    }

    fn ati(&self, motion: &Motion) -> Option<Outcome> {
        let pixel = self.pixel(motion)?;
        let pair = |pixel: usize| [0, 1].map(|c| widen(self.images.images[c].pixels[pixel]));
        let interferogram = Interferogram::estimate(self.ring(pixel).into_iter().map(pair))?;
        Some(Outcome {
            probability: interferogram
                .false_alarm_probability(interferogram.statistic(pair(pixel))),
            predicted: None,
        })
    }

    /// Adaptive matched filter of the differences of the first `channels`, the maximum over radial velocities.
    fn amf(&self, motion: &Motion, channels: usize) -> Result<Option<Outcome>, GmtiError> {
        let Some(pixel) = self.pixel(motion) else {
            return Ok(None);
        };
        let size = channels - 1;
        let differences = |pixel: usize| {
            let value = |c: usize| self.images.images[c].pixels[pixel];
            (1..channels)
                .map(|c| value(c) - value(0))
                .collect::<Vec<Complex32>>()
        };
        let mut covariance = Covariance::new(size);
        let ring = self.ring(pixel);
        ring.iter()
            .for_each(|&training| covariance.add(&differences(training)));
        let snapshots = covariance.snapshots();
        if snapshots < 2 * size {
            return Ok(None);
        }
        let whitener = covariance.factor(Loading::Off)?;
        let (lags_s, centre_hz) = (&self.alignment.lags_s()[..channels], self.images.centre_hz);
        let cell = differences(pixel);
        let cell: Vec<Complex64> = cell.into_iter().map(widen).collect();
        let statistic = |steering: &[Complex64]| {
            let gain = whitener.quadratic_form(steering, steering).re;
            whitener.quadratic_form(steering, &cell).norm_sqr() / gain
        };
        let steering = steering_of_differences(lags_s, centre_hz);
        let amf = steering
            .chunks_exact(size)
            .map(statistic)
            .fold(0.0, f64::max);
        let curve_length = match channels {
            2 => 0.0,
            _ => self.curve_length,
        };
        let performance = Performance::new(Statistic::Amf, size, snapshots)?;
        let velocity_m_s = self.radial_velocity_m_s(motion);
        let all = detection::steering(lags_s, centre_hz, velocity_m_s);
        let own: Vec<Complex64> = all[1..].iter().map(|s| s - all[0]).collect();
        let gain = whitener.quadratic_form(&own, &own).re * snapshots as f64;
        let requested = self.setup.detection.false_alarm_probability;
        let one = of_one_velocity(requested, curve_length);
        Ok(Some(Outcome {
            probability: of_maximum(performance.false_alarm_probability(amf), curve_length)
                .min(1.0),
            predicted: Some(self.setup.predicted(performance, gain, one)?),
        }))
    }

    fn radial_velocity_m_s(&self, motion: &Motion) -> f64 {
        let position_m: DVec3 = motion.at(self.alignment.centre_s());
        let sight = (position_m - self.images.view.antenna_m()).normalize_or_zero();
        -sight.dot(motion.velocity_m_s)
    }
}
