//! Detection performance over radial velocity: signal to interference and noise ratio (SINR), probability of detection, minimum detectable velocity (MDV).
//!
//! A point target of radar cross-section `sigma`, m^2, has the amplitude `sqrt(sigma)` in the image. With the mean covariance `R` of the channel differences,
//!
//! ```text
//! SINR(v) = sigma (s(v) - 1)^H R^-1 (s(v) - 1)
//! ```
//!
//! for a target of constant velocity that is focused by the image. The probability of detection is that of the AMF with the training cells of the settings
//! ([`Performance`]), for one velocity at the threshold of [`crate::detection`]. Cells whose power exceeds ten times the median contain targets and are left out of `R`.

use num_complex::{Complex32, Complex64};

use crate::adaptive::{Covariance, Loading, Performance, Statistic, TargetModel, Whitener};
use crate::alignment::Alignment;
use crate::correlation::Spacing;
use crate::detection::{Settings, StatisticMap, differences, steering, unambiguous_m_s};
use crate::error::GmtiError;
use crate::images::ChannelImages;
use crate::registration::median;

/// Velocities of the curve, from 0 to the largest without ambiguity.
const VELOCITIES: usize = 256;

/// Largest power of a cell of clutter, relative to the median.
const CLUTTER: f64 = 10.0;

/// Probability of detection at the minimum detectable velocity.
const DETECTABLE: f64 = 0.5;

/// Performance at a radial velocity.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct AtVelocity {
    /// Radial velocity, metres per second.
    pub velocity_m_s: f64,
    /// Signal to interference and noise ratio, dB.
    pub sinr_db: f64,
    /// Probability of detection of a fluctuating target (Swerling 1).
    pub detection_probability: f64,
}

/// Detection performance for a target of one radar cross-section.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Sensitivity {
    /// Radar cross-section of the target, m^2.
    pub cross_section_m2: f64,
    /// Performance at velocities from 0, ascending.
    pub curve: Vec<AtVelocity>,
    /// Minimum detectable velocity, metres per second: smallest one with a probability of detection of 0.5. `None` if no velocity of the curve has it.
    pub mdv_m_s: Option<f64>,
}

impl Sensitivity {
    /// Performance of detection on registered images for a target of `cross_section_m2`.
    ///
    /// # Errors
    /// [`GmtiError::Adaptive`] if the image has too few cells, or the settings too few training cells.
    pub(crate) fn of(
        images: &ChannelImages,
        alignment: &Alignment,
        map: &StatisticMap,
        settings: &Settings,
        cross_section_m2: f64,
    ) -> Result<Self, GmtiError> {
        let (lags_s, size) = (alignment.lags_s(), images.images.len() - 1);
        let (whitener, count) = covariance_of_clutter(images, map.spacing)?;
        let snapshots = settings.most_snapshots([map.rows, map.columns]);
        let performance = Performance::new(Statistic::Amf, size, snapshots)?;
        let threshold = performance.threshold(map.single_probability)?;
        let most = unambiguous_m_s(lags_s, images.centre_hz);
        let at = |i: usize| {
            let velocity_m_s = most * i as f64 / VELOCITIES as f64;
            let all = steering(lags_s, images.centre_hz, velocity_m_s);
            let target: Vec<Complex64> = all[1..].iter().map(|s| s - all[0]).collect();
            let sinr = cross_section_m2 * count * whitener.quadratic_form(&target, &target).re;
            AtVelocity {
                velocity_m_s,
                sinr_db: 10.0 * sinr.log10(),
                detection_probability: performance.detection_probability(
                    threshold,
                    sinr,
                    TargetModel::Swerling1,
                ),
            }
        };
        let curve: Vec<AtVelocity> = (0..=VELOCITIES).map(at).collect();
        let crossing = curve
            .windows(2)
            .find(|pair| pair[1].detection_probability >= DETECTABLE);
        let mdv_m_s = crossing.map(|pair| {
            let [low, high] = [pair[0], pair[1]];
            let rise = high.detection_probability - low.detection_probability;
            let part = (DETECTABLE - low.detection_probability) / rise;
            low.velocity_m_s + part.clamp(0.0, 1.0) * (high.velocity_m_s - low.velocity_m_s)
        });
        Ok(Self {
            cross_section_m2,
            curve,
            mdv_m_s,
        })
    }
}

/// Sum of the outer products of the channel differences over cells without targets, and their number.
fn covariance_of_clutter(
    images: &ChannelImages,
    spacing: Spacing,
) -> Result<(Whitener, f64), GmtiError> {
    let size = images.images.len() - 1;
    let (rows, columns) = (images.images[0].rows, images.images[0].columns);
    let mut cell = vec![Complex32::ZERO; size];
    let pixels = || {
        let rows = (0..rows).step_by(spacing.rows);
        rows.flat_map(|row| {
            (0..columns)
                .step_by(spacing.columns)
                .map(move |c| row * columns + c)
        })
    };
    let mut power = |pixel: usize| {
        differences(images, pixel, &mut cell);
        cell.iter()
            .map(|value| f64::from(value.norm_sqr()))
            .sum::<f64>()
    };
    let powers: Vec<f64> = pixels().map(&mut power).collect();
    let most = CLUTTER * median(powers.iter().copied());
    let mut covariance = Covariance::new(size);
    for (pixel, power) in pixels().zip(&powers) {
        if *power <= most {
            differences(images, pixel, &mut cell);
            covariance.add(&cell);
        }
    }
    let count = covariance.snapshots() as f64;
    Ok((covariance.factor(Loading::Off)?, count))
}
