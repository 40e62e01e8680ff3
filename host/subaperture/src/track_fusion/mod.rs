//! Fusion of a recording's echo-based motion estimate with its navigation into one track.
//!
//! ```text
//! Recovered::steps ── increments, as independent ──┐
//! Navigation::of_recording, of_logs ── positions,  ├─> navigation::fusion ──> FusedTrack: fixes, and the agreement of the two
//!                       inertial samples ──────────┘
//! ```
//!
//! **Frame**: the recording's scene, z up; the radar must move in a horizontal plane. **Times**: the recording's.
//!
//! **Trust.** Echoes are trusted if they fit their own track and no array moves backwards ([`Recovered::seen`]'s faults). Navigation that
//! contradicts them beyond its stated errors is then down-weighted to its actual errors, and this is reported. If the echoes do not fit their own track and also
//! disagree with navigation, neither is trusted: [`TrackFusionError::Neither`]. Navigation within the recording states no errors; size and correlation
//! time of its errors are estimated from its deviation from the echo-based track.
//!
//! **Cost**: that of [`crate::navigation::fusion::fuse`].

mod navigation;

pub use navigation::{About, Navigation, Source, UnusableLog};

use glam::{DMat3, DVec3};
use subaperture_model::monitor::Monitor;
use subaperture_model::track::Fix;
use subaperture_motion::targets::{Fault, Recovered};
use subaperture_navigation::fusion::{
    Assumed, Fused, FusionError, Increment, Inputs, Measured, Model, Sample, fuse,
};

/// Ratio of squared residuals to stated variances above which two sources disagree.
const MAX_AGREEING_RATIO: f64 = 2.0;
/// Maximum navigation error for a focused image, wavelengths.
const MAX_FOCUSED_WAVELENGTHS: f64 = 0.125;

/// Fused track, with the contribution of each source.
pub struct FusedTrack {
    /// Track, with estimated clocks, scale and other parameters.
    pub fused: Fused,
    /// Number of poses estimated from echoes, and the time between the first and the last, seconds.
    pub radar: (usize, f64),
    /// Contribution of each navigation source, by file.
    pub sources: Vec<Source>,
    /// RMS distance of the positions from the track in its plane, metres, estimated from the median to exclude outliers; `None` without positions.
    pub positions_off_m: Option<f64>,
    /// Number of increments, positions and inertial epochs that were rejected or weighted by less than half.
    pub left_out: [usize; 3],
    /// Factor by which stated navigation errors were increased; `None` if they are consistent.
    pub widened: Option<f64>,
}

/// Error of fusing echoes and navigation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackFusionError {
    /// Echoes and navigation disagree, and neither is consistent by itself.
    #[error(
        "echoes and navigation are both inconsistent: residuals of the echo track are {echoes:.1} times their noise, and navigation deviates from the echoes by {navigation}"
    )]
    Neither {
        /// Square root of chi-square divided by its expectation.
        echoes: f64,
        /// Description of the navigation's deviation.
        navigation: String,
    },
    /// The echoes are consistent, but no track fits them and the navigation.
    #[error(
        "echoes and navigation contradict each other ({0}): check the start time, lever arm and axes of the navigation"
    )]
    Contradict(FusionError),
    /// Invalid values in a log or the echoes, or no absolute position.
    #[error("no track can be computed: {0}")]
    Unfit(FusionError),
    /// The radar does not move in a horizontal plane.
    #[error(
        "expected an array that moves in a horizontal plane, found a tilted one: echoes and navigation cannot be fused"
    )]
    Tilted,
    /// The computation was cancelled.
    #[error("cancelled")]
    Cancelled,
}

/// Mounting of the navigation sensors on the radar.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mounting {
    /// Lever arm from the centre of the radar's antennas to the navigation antenna, in the radar's axes, metres.
    pub arm_m: DVec3,
}

impl FusedTrack {
    /// Fuse a recording's echoes with its navigation.
    ///
    /// # Errors
    /// [`TrackFusionError`].
    pub fn new(
        found: &Recovered,
        navigation: &Navigation,
        mounting: &Mounting,
        monitor: &dyn Monitor,
    ) -> Result<Self, TrackFusionError> {
        let up = found.seen.arrangement.attitude * DVec3::Z;
        if up.distance(DVec3::Z) > 1e-3 {
            return Err(TrackFusionError::Tilted);
        }
        let increments = increments(found);
        let model = model(found, navigation, mounting);
        let fits = fits(found);
        let [sum, expected] = found.chi_square;
        let echoes = (sum / expected.max(1.0)).sqrt();
        let fused = |navigation: &Navigation| {
            let inputs = Inputs {
                increments: &increments,
                positions: navigation.absolute(),
                inertial: &navigation.inertial,
            };
            fuse(&inputs, &model, monitor)
        };
        let contradicted = |error: FusionError| match (error, fits) {
            (FusionError::Cancelled, _) => TrackFusionError::Cancelled,
            (
                error @ (FusionError::Input { .. }
                | FusionError::Model { .. }
                | FusionError::NoPosition),
                _,
            ) => TrackFusionError::Unfit(error),
            (error, true) => TrackFusionError::Contradict(error),
            (error, false) => TrackFusionError::Neither {
                echoes,
                navigation: format!("more than any track explains: {error}"),
            },
        };
        let mut fused_track = fused(navigation).map_err(contradicted)?;
        let mut widened = None;
        let [sum, expected] = fused_track.chi_square;
        let mut off = navigation.off(&fused_track, mounting.arm_m);
        let ratio = (sum / expected.max(1.0)).max(off.map_or(0.0, |off| off.square));
        let most_m = MAX_FOCUSED_WAVELENGTHS * found.seen.array.wavelength_m;
        match (fits, navigation.stated_m) {
            (false, None) if ratio > MAX_AGREEING_RATIO => {
                return Err(TrackFusionError::Neither {
                    echoes,
                    navigation: format!("{:.1} times its stated standard deviations", ratio.sqrt()),
                });
            }
            (false, Some(shown_m)) if shown_m > most_m => {
                return Err(TrackFusionError::Neither {
                    echoes,
                    navigation: format!("{shown_m:.3} m, too much for a focused image"),
                });
            }
            (true, None) if ratio > MAX_AGREEING_RATIO => {
                widened = Some(ratio.sqrt());
                fused_track = fused(&navigation.widened(ratio.sqrt())).map_err(contradicted)?;
                off = navigation.off(&fused_track, mounting.arm_m);
            }
            _ => {}
        }
        let of = |kinds: &[Measured]| {
            let outliers = fused_track.outliers.iter();
            outliers.filter(|one| kinds.contains(&one.of)).count()
        };
        Ok(Self {
            radar: (found.moments.len(), span_s(found)),
            sources: navigation.sources.clone(),
            positions_off_m: off.map(|off| off.rms_m),
            left_out: [
                of(&[Measured::Increments]),
                of(&[Measured::Position, Measured::Velocity]),
                of(&[
                    Measured::InertialPosition,
                    Measured::InertialVelocity,
                    Measured::InertialHeading,
                ]),
            ],
            widened,
            fused: fused_track,
        })
    }

    /// Chi-square divided by its expectation: about 1 if both sources are consistent with their stated errors.
    pub fn agreement(&self) -> f64 {
        let [sum, expected] = self.fused.chi_square;
        sum / expected.max(1.0)
    }

    /// Fixes of the track within an interval, with one fix on either side if available.
    pub fn fixes(&self, [from_s, to_s]: [f64; 2]) -> Vec<Fix> {
        let all = self.fused.fixes();
        let first = all.partition_point(|fix| fix.time_s < from_s);
        let end = all.partition_point(|fix| fix.time_s <= to_s);
        all[first.saturating_sub(1)..(end + 1).min(all.len())].to_vec()
    }

    /// Move poses and targets of the echo track onto this track, with its covariances.
    pub fn lay(&self, found: &mut Recovered) {
        let Some(before) = found.moments.get(found.moments.len() / 2).cloned() else {
            return;
        };
        for moment in &mut found.moments {
            if let Some(sample) = self.nearest(moment.time_s) {
                let c = &sample.covariance;
                moment.position_m = sample.position_m;
                moment.attitude = sample.attitude;
                // Components x, y and heading.
                let column = |k: usize| [c[k][0], c[k][1], c[k][3]];
                moment.covariance = DMat3::from_cols_array_2d(&[column(0), column(1), column(3)]);
            }
        }
        // Relative to the middle of the track.
        let after = &found.moments[found.moments.len() / 2];
        let turn = after.attitude * before.attitude.inverse();
        for place in &mut found.places {
            place.position_m = after.position_m + turn * (place.position_m - before.position_m);
        }
    }

    /// State of the fusion nearest to a time.
    pub fn nearest(&self, time_s: f64) -> Option<&Sample> {
        let all = &self.fused.samples;
        let after = all.partition_point(|sample| sample.time_s < time_s);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let away = |sample: &&Sample| (sample.time_s - time_s).abs();
        let near = near.filter_map(|n| all.get(n));
        near.min_by(|a, b| away(a).total_cmp(&away(b)))
    }
}

/// Whether the echo-based track is consistent by itself.
fn fits(found: &Recovered) -> bool {
    let wrong = |fault: &Fault| matches!(fault, Fault::Misfit { .. } | Fault::Reversed);
    found.converged && !found.seen.faults.iter().any(wrong)
}

fn span_s(found: &Recovered) -> f64 {
    match (found.moments.first(), found.moments.last()) {
        (Some(first), Some(last)) => last.time_s - first.time_s,
        _ => 0.0,
    }
}

/// Echo-based motion between successive poses.
fn increments(found: &Recovered) -> Vec<Increment> {
    let pairs = found.moments.windows(2).zip(&found.steps);
    pairs
        .filter(|(pair, _)| pair[1].time_s > pair[0].time_s)
        .map(|(pair, (step, covariance))| Increment {
            from_s: pair[0].time_s,
            to_s: pair[1].time_s,
            moved_m: step.moved_m.to_array(),
            turned_rad: step.turn_rad,
            covariance: *covariance,
        })
        .collect()
}

/// Standard deviation of the relative scale error of the echo track, `None` for a track without extent: that which explains the whole
/// covariance of its shape. An error of scale displaces a pose in proportion to its distance from the middle of the track:
///
/// ```text
/// scale^2 = sum of variances / sum of squared distances from the middle
/// ```
///
/// The joint estimate contains the information of ranges and directions on the scale; without it (increments alone) the error is that of
/// [`Model::default`].
fn scale(found: &Recovered) -> Option<f64> {
    let moments = &found.moments;
    let sum: DVec3 = moments.iter().map(|moment| moment.position_m).sum();
    let middle_m = sum / moments.len().max(1) as f64;
    let (mut variances_m2, mut squares_m2) = (0.0, 0.0);
    for moment in moments {
        variances_m2 += moment.covariance.x_axis.x + moment.covariance.y_axis.y;
        squares_m2 += moment.position_m.distance_squared(middle_m);
    }
    let scale = (variances_m2 / squares_m2).sqrt();
    (scale > 0.0 && scale.is_finite()).then_some(scale)
}

/// Assumptions of the fusion: all sensors on one rigid body and one clock, and increments that were estimated jointly.
fn model(found: &Recovered, navigation: &Navigation, mounting: &Mounting) -> Model {
    let arm_m = Assumed {
        value: mounting.arm_m,
        sigma: DVec3::ZERO,
    };
    let model = Model::default();
    Model {
        // Jointly estimated increments are noisy individually but accurate in sum.
        outlier_sigmas: None,
        // Covariances of a track that does not fit its own echoes do not describe its errors.
        scale: scale(found)
            .filter(|_| fits(found))
            .map_or(model.scale, |own| own.min(model.scale)),
        receiver_arm_m: arm_m,
        inertial_arm_m: arm_m,
        inertial_velocity: [
            model.inertial_velocity[0],
            navigation
                .velocity_walk
                .map_or(model.inertial_velocity[1], |walk| {
                    walk.max(model.inertial_velocity[1])
                }),
        ],
        squint_rad: Assumed {
            value: navigation.squint_rad(found).unwrap_or(0.0),
            ..model.squint_rad
        },
        ..model
    }
}
