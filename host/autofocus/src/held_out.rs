//! Judgement of a correction on range cells that were not used to estimate it.
//!
//! The method runs again without each fold of the range cells (`folds.rs`), from the uncorrected recording. Up to four tests follow; a correction must
//! pass all that apply.
//!
//! **Gain.** The gain of the measure on the held-out cells has to be at least a quarter of the gain on the cells used. Applies to phases and tracks.
//!
//! **Sharpness.** Each segment of held-out range cells with a scatterer gives one number: the gain of the measure within the segment by
//! the correction estimated without it. Segments share neither speckle nor noise, so the gains are independent given the
//! correction. Student's one-sided t test at a significance of [`SIGNIFICANCE`] tests whether their mean exceeds zero. Applies to tracks; for phases the
//! probability is only reported.
//!
//! **Track.** A sharper image does not prove a better track: displacements that hardly change the phases of the points are unobservable and follow the
//! noise. The jackknife (`track_error.rs`) must show, at the same significance, that the track is better than the recorded one. It compares tracks estimated
//! without each group of points, if the method provides them ([`Method::without_points`]), else the tracks of the folds. Applies to tracks of near scenes.
//!
//! **Slips.** The two-way phase of the displacements must change by less than a limit between neighbouring pulses (`slips.rs`, in far scenes `far.rs`):
//! half-wavelength slips are invisible in images. Applies to tracks.
//!
//! In a far scene (`far.rs`) a track is one phase per pulse common to all points, and no displacement is unobservable: an image that is sharper on held-out
//! cells proves better phases, except for whole turns. The tests of sharpness and slips therefore decide, with the folds of phases. The track and those of the
//! folds are first projected on the line of sight.
//!
//! Not covered: errors common to all points, such as an error of the whole geometry.

use subaperture_model::image::{Image, power};

use super::chance::student_above;
use super::correction::{Corrected, Correction};
use super::far::{FarScene, max_step_rad};
use super::folds::{Folds, SCATTERER};
use super::rounds::{
    Figures, Method, RoundInput, SharpenError, Stopping, Subject, by_rounds, figures, form, merit,
};
use super::slips::{MAX_STEP_RAD, largest_step_rad};
use super::split::Split;
use super::track_error::TrackError;

/// Probability of keeping a track that is no better than the recorded one.
pub const SIGNIFICANCE: f64 = 0.01;

/// Smallest accepted gain on held-out cells, relative to the gain on the cells used.
const HELD_PART: f64 = 0.25;

/// Figures on held-out range cells, the mean over all folds. Each fold is corrected by the estimate made without it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct HeldOut {
    /// Figures without the correction.
    pub before: Figures,
    /// Figures with the correction.
    pub after: Figures,
    /// Number of independent segments of range cells with scatterers.
    pub segments: usize,
    /// Probability of at least this mean gain over the segments under the null hypothesis of no gain (one-sided t test).
    pub p_value: f64,
    /// Whether a track was judged as one of a far scene: along the line of sight, without the jackknife.
    pub far: bool,
    /// Jackknife estimate of the rms error of the track, metres; `None` for phases and far scenes, and if a jackknife replicate gives no track.
    pub track_error_m: Option<f64>,
    /// Probability of at most this estimate under the null hypothesis that the track is no better than the recorded one; `None` as for
    /// `track_error_m`.
    pub track_p_value: Option<f64>,
    /// Largest change between neighbouring pulses of the two-way phase of the displacements, radians; `None` for phases.
    pub largest_step_rad: Option<f64>,
    /// Limit of `largest_step_rad`, above which half-wavelength slips are possible; `None` for phases.
    pub max_step_rad: Option<f64>,
    /// Whether the correction passes all tests.
    pub sharper: bool,
}

/// Judge `correction`, which gave `image_after`. `None` if bright points lie in too few range cells.
pub(crate) fn judge(
    subject: &Subject,
    method: &dyn Method,
    stopping: Stopping,
    [image_before, image_after]: [&Image; 2],
    correction: &Correction,
    far: Option<&FarScene>,
) -> Result<Option<HeldOut>, SharpenError> {
    let collection = subject.history.collection();
    let grid = subject.grid;
    let settled = |found: Correction| match far {
        Some(far) => far.along_sight(found),
        None => found,
    };
    let is_track = matches!(correction, Correction::Track { .. });
    let is_near_track = is_track && far.is_none();
    let tracks = match is_near_track {
        true => without_points(subject, method, image_after, correction)?,
        false => None,
    };
    let folds = match is_near_track {
        true => Folds::of_scatterers(collection, grid, image_before),
        false => Split::of(collection, grid, image_before).map(|split| Folds::halves(&split)),
    };
    let Some(folds) = folds else {
        return Ok(None);
    };
    let (mut before, mut after) = (Vec::new(), Vec::new());
    let (mut gain, mut gain_on_used) = (0.0, 0.0);
    let mut segments = Vec::new();
    let mut corrections = Vec::new();
    for fold in 0..folds.count {
        let held_out = Some((&folds, fold));
        let best = match by_rounds(subject, method, stopping, image_before, held_out) {
            Ok((best, _)) => best,
            Err(
                SharpenError::Dark
                | SharpenError::TooFewPoints { .. }
                | SharpenError::TooShort { .. },
            ) => return Ok(None),
            Err(error) => return Err(error),
        };
        let used = folds.estimating(fold, collection, grid, image_before);
        gain_on_used += merit(subject.measure, &best.figures, &best.image)
            - merit(subject.measure, &figures(&used)?, &used);
        let judging = |image: &Image| folds.judging(fold, collection, grid, image);
        let Ok(figures_before) = figures(&judging(image_before)) else {
            // The fold has guard cells only.
            continue;
        };
        let found = best.correction.map(settled);
        let image = match &found {
            None => image_before.clone(),
            Some(found) => form(subject, &Corrected::new(subject.history, found)?)?,
        };
        let judged = [judging(image_before), judging(&image)];
        let figures_after = figures(&judged[1])?;
        gain += merit(subject.measure, &figures_after, &judged[1])
            - merit(subject.measure, &figures_before, &judged[0]);
        before.push(figures_before);
        after.push(figures_after);
        for pixels in folds.segments(fold, collection, grid, image_before) {
            segments.push(Segment::of(subject, &pixels, [image_before, &image])?);
        }
        corrections.push(found);
    }
    if before.is_empty() {
        return Ok(None);
    }
    let most = segments
        .iter()
        .fold(0.0, |most: f64, segment| most.max(segment.peak));
    let gains: Vec<f64> = segments
        .iter()
        .filter(|segment| segment.peak >= SCATTERER * most)
        .map(|segment| segment.gain)
        .collect();
    let Some(p_value) = no_gain(&gains) else {
        return Ok(None);
    };
    let track = match is_near_track {
        true => TrackError::of(correction, tracks.as_deref().unwrap_or(&corrections)),
        false => None,
    };
    let (largest_step_rad, limit_rad) = match correction {
        Correction::Track { displacement_m } => {
            let limit_rad = match far {
                Some(_) => max_step_rad(collection.num_turns()),
                None => MAX_STEP_RAD,
            };
            let largest_rad = largest_step_rad(collection, grid, displacement_m);
            (Some(largest_rad), Some(limit_rad))
        }
        Correction::Phase { .. } => (None, None),
    };
    let better = !is_near_track || track.is_some_and(|track| track.p_value < SIGNIFICANCE);
    let track_holds = !is_track || p_value < SIGNIFICANCE && better && largest_step_rad < limit_rad;
    Ok(Some(HeldOut {
        before: mean(&before),
        after: mean(&after),
        segments: gains.len(),
        p_value,
        far: is_track && far.is_some(),
        track_error_m: track.map(|track| track.error_m),
        track_p_value: track.map(|track| track.p_value),
        largest_step_rad,
        max_step_rad: limit_rad,
        sharper: gain > 0.0 && gain > HELD_PART * gain_on_used && track_holds,
    }))
}

/// Tracks estimated without each group of points, if the method provides them.
fn without_points(
    subject: &Subject,
    method: &dyn Method,
    image_after: &Image,
    correction: &Correction,
) -> Result<Option<Vec<Option<Correction>>>, SharpenError> {
    let corrected = Corrected::new(subject.history, correction)?;
    let look = RoundInput {
        subject,
        history: &corrected,
        image: image_after,
        round: 0,
        kept: true,
        held_out: None,
    };
    let tracks = method.without_points(&look, correction)?;
    Ok(tracks.map(|tracks| tracks.into_iter().map(Some).collect()))
}

/// Segment of held-out range cells.
struct Segment {
    /// Power of the brightest pixel before.
    peak: f64,
    /// Gain of the measure within the segment.
    gain: f64,
}

impl Segment {
    fn of(subject: &Subject, pixels: &[usize], images: [&Image; 2]) -> Result<Self, SharpenError> {
        let [before, after] = images.map(|image| Image {
            rows: 1,
            columns: pixels.len(),
            pixels: pixels.iter().map(|&i| image.pixels[i]).collect(),
        });
        let peak = |image: &Image| {
            let powers = image.pixels.iter().map(|&pixel| power(pixel));
            powers.fold(0.0, f64::max)
        };
        // A dark segment has zero gain.
        let merit =
            |image: &Image| figures(image).map(|figures| merit(subject.measure, &figures, image));
        let gain = match (merit(&before), merit(&after)) {
            (Ok(before), Ok(after)) => after - before,
            _ => 0.0,
        };
        Ok(Self {
            peak: peak(&before),
            gain,
        })
    }
}

fn mean(figures: &[Figures]) -> Figures {
    let of = |value: &dyn Fn(&Figures) -> f64| {
        figures.iter().map(value).sum::<f64>() / figures.len() as f64
    };
    Figures {
        entropy: of(&|f| f.entropy),
        contrast: of(&|f| f.contrast),
        peak_db: of(&|f| f.peak_db),
    }
}

/// Probability of at least this mean of `gains` for a true mean of zero; `None` for fewer than two gains.
fn no_gain(gains: &[f64]) -> Option<f64> {
    let count = gains.len() as f64;
    if gains.len() < 2 {
        return None;
    }
    let mean = gains.iter().sum::<f64>() / count;
    let squares: f64 = gains.iter().map(|gain| (gain - mean).powi(2)).sum();
    let error = (squares / (count - 1.0) / count).sqrt();
    if error == 0.0 {
        // Equal gains: zero if no fold was corrected.
        return Some(if mean > 0.0 { 0.0 } else { 1.0 });
    }
    Some(student_above(mean / error, count - 1.0))
}
