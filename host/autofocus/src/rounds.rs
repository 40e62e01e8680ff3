//! Rounds of autofocus: a method proposes a correction, and the sharpness of the image decides.
//!
//! ```text
//! image of the corrected recording ──> method ──> further correction ──> image ──> kept if it is sharper
//! ```
//!
//! A round is kept only if the image of all pixels, formed again from the whole recording, has a better measure ([`Measure`]) than
//! every earlier image. In its next round the method is informed whether its proposal was kept; methods proceed from coarse to fine, so that
//! the next proposal differs. The rounds end after a given number, after two idle rounds in a row, or when the method
//! has no further proposal ([`Stopping`]).

use glam::DVec3;

use subaperture_focus::{FormError, ImageFormer, Remedy, Task};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_quality::statistics::{Region, Statistics};
use subaperture_signal::window::Window;

use super::correction::{Corrected, Correction, Misfit};
use super::folds::Folds;
use super::measure::{Measure, Quiet};
use super::split::bin_of;

/// Recording, grid and image former for autofocus.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// Recording to be focused.
    pub history: &'a dyn PhaseHistory,
    /// Grid of the images, from which the methods choose points.
    pub grid: &'a ImageGrid,
    /// Former of every image.
    pub former: &'a dyn ImageFormer,
    /// Windows over fast and slow time.
    pub windows: [Window; 2],
    /// Sharpness measure that accepts or rejects a round.
    pub measure: Measure,
    /// Memory budget, bytes, the recording included.
    pub memory_bytes: u64,
    /// Receives progress and can cancel.
    pub monitor: &'a dyn Monitor,
}

/// Stopping rule of the rounds, and the policy for corrections that cannot be judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopping {
    /// Largest number of rounds.
    pub rounds: usize,
    /// Relative gain of the measure below which a round counts as idle. Two idle rounds in a row end the work, once the method's
    /// [first rounds](Method::first_rounds) are done.
    pub gain: f64,
    /// Keep a correction that no held-out data can judge. Default: false, the correction is refused.
    pub keep_unjudged: bool,
}

impl Default for Stopping {
    fn default() -> Self {
        Self {
            rounds: 12,
            gain: 1e-4,
            keep_unjudged: false,
        }
    }
}

/// Error of sharpening an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SharpenError {
    /// An image was not formed, or pulses not read.
    #[error(transparent)]
    Form(#[from] FormError),
    /// A correction does not fit the recording.
    #[error(transparent)]
    Misfit(#[from] Misfit),
    /// The image has no power to sharpen.
    #[error("the image is zero everywhere: autofocus needs echoes within the grid")]
    Dark,
    /// Too few pulses for the method.
    #[error("{method} needs at least {needed} pulses, the recording has {pulses}")]
    TooShort {
        /// Name of the requested method.
        method: &'static str,
        /// Least number of pulses per channel.
        needed: usize,
        /// Number of pulses per channel of the recording.
        pulses: usize,
    },
    /// Too few points for the method.
    #[error(
        "{method} needs at least {needed} points at different angles, found {found} range bins within {within_db} dB of the brightest point"
    )]
    TooFewPoints {
        /// Method that needs more points.
        method: &'static str,
        /// Minimum number of points.
        needed: usize,
        /// Number of points detected.
        found: usize,
        /// Largest level below the brightest point, dB.
        within_db: f64,
    },
}

/// Input of a round: the recording with the correction so far, and its image.
pub struct RoundInput<'a> {
    /// Recording without any correction, grid and former.
    pub subject: &'a Subject<'a>,
    /// Recording with the best correction so far.
    pub history: &'a dyn PhaseHistory,
    /// Image of `history` on the grid.
    pub image: &'a Image,
    /// Number of rounds before this one.
    pub round: usize,
    /// Whether the proposal of the last round was kept; true in the first round.
    pub kept: bool,
    /// Folds of the range cells and the fold that is held out; `None` if all cells may be used. The image is dark in the held-out cells.
    pub(crate) held_out: Option<(&'a Folds, usize)>,
}

impl RoundInput<'_> {
    /// Whether the range cell of a position is used for estimation, and not held out for validation.
    pub fn uses(&self, place_m: DVec3) -> bool {
        match self.held_out {
            Some((folds, fold)) => {
                folds.estimates(fold, bin_of(self.history.collection(), place_m))
            }
            None => true,
        }
    }

    /// Whether some range cells are held out in this round.
    pub fn holds_out(&self) -> bool {
        self.held_out.is_some()
    }

    /// Weights over fast time.
    pub(crate) fn fast(&self) -> Vec<f64> {
        let [fast, slow] = self.subject.windows;
        Weights::new(self.history.collection(), fast, slow).fast
    }

    /// Check `needed_bytes` for `what` against the memory left by the recording and the images.
    ///
    /// # Errors
    /// [`FormError::Memory`] if they do not fit.
    pub(crate) fn room(&self, purpose: &'static str, needed_bytes: u64) -> Result<(), FormError> {
        let held = self.history.held_bytes() + HELD_IMAGES * 8 * self.subject.grid.num_pixels();
        let all = u128::from(held) + u128::from(needed_bytes);
        match all <= u128::from(self.subject.memory_bytes) {
            true => Ok(()),
            false => Err(FormError::Memory {
                purpose,
                needed_bytes: all,
                budget_bytes: self.subject.memory_bytes,
                remedies: &[Remedy::MoreMemory, Remedy::FewerPixels],
            }),
        }
    }
}

/// An autofocus method: estimates a correction from a recording and its image.
pub trait Method: Send + Sync {
    /// Name in image records and on the command line.
    fn name(&self) -> &'static str;

    /// Number of rounds from coarse to fine that run even without gain.
    fn first_rounds(&self, _turns: usize) -> usize {
        1
    }

    /// Further correction with one entry per pulse; `None` if the method has no further proposal.
    ///
    /// # Errors
    /// [`SharpenError`].
    fn propose(&self, look: &RoundInput) -> Result<Option<Correction>, SharpenError>;

    /// Track estimates without each group of points, for the jackknife; `look` holds the image corrected by `correction`. `None` if
    /// the method estimates no track, has no such estimate or has too few points: the tracks of the folds are compared instead.
    ///
    /// # Errors
    /// [`SharpenError`].
    fn without_points(
        &self,
        _look: &RoundInput,
        _correction: &Correction,
    ) -> Result<Option<Vec<Correction>>, SharpenError> {
        Ok(None)
    }
}

/// Sharpness figures of an image.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Entropy of power, nats; less is sharper.
    pub entropy: f64,
    /// Contrast of the amplitude image.
    pub contrast: f64,
    /// Power of the brightest pixel, dB.
    pub peak_db: f64,
}

/// Result of a round.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Round {
    /// Figures of the image with the proposed correction.
    pub figures: Figures,
    /// Whether the proposal was kept.
    pub kept: bool,
    /// Rms of the proposed phases, radians; `None` for a track.
    pub phase_rad: Option<f64>,
    /// Rms of the proposed displacements, metres; `None` for phases.
    pub displacement_m: Option<f64>,
}

/// Number of images in memory: the one before, the best, the best and a new one without the held-out fold, and a copy of the new one.
pub const HELD_IMAGES: u64 = 5;

/// Rounds of a method, on all range cells or without a held-out fold: the best correction, and the result of each round.
pub(crate) fn by_rounds(
    subject: &Subject,
    method: &dyn Method,
    stopping: Stopping,
    image_before: &Image,
    held_out: Option<(&Folds, usize)>,
) -> Result<(Best, Vec<Round>), SharpenError> {
    let collection = subject.history.collection();
    let first_rounds = method.first_rounds(collection.num_turns());
    let seen = |image: Image| match held_out {
        None => image,
        Some((folds, fold)) => folds.estimating(fold, collection, subject.grid, &image),
    };
    let image = seen(image_before.clone());
    let mut best = Best {
        correction: None,
        figures: figures(&image)?,
        image,
    };
    let mut rounds = Vec::new();
    let mut idle = 0;
    for round in 0..stopping.rounds {
        if subject.monitor.cancelled() {
            return Err(FormError::Cancelled.into());
        }
        if held_out.is_none() {
            subject
                .monitor
                .progress(round as f64 / stopping.rounds as f64);
        }
        let corrected = match &best.correction {
            None => None,
            Some(correction) => Some(Corrected::new(subject.history, correction)?),
        };
        let look = RoundInput {
            subject,
            history: corrected.as_ref().map_or(subject.history, |c| c),
            image: &best.image,
            round,
            kept: rounds.last().is_none_or(|round: &Round| round.kept),
            held_out,
        };
        let Some(more) = method.propose(&look)? else {
            break;
        };
        let tried = match &best.correction {
            None => more.clone(),
            Some(correction) => correction.clone().and(&more),
        };
        let image = seen(form(subject, &Corrected::new(subject.history, &tried)?)?);
        let figures = figures(&image)?;
        let scale = merit(subject.measure, &best.figures, &best.image);
        let gain = merit(subject.measure, &figures, &image) - scale;
        let kept = gain > 0.0;
        rounds.push(Round {
            figures,
            kept,
            phase_rad: more.rms_phase_rad(),
            displacement_m: more.rms_displacement_m(),
        });
        if kept {
            best = Best {
                correction: Some(tried),
                figures,
                image,
            };
        }
        idle = match gain > stopping.gain * scale.abs() {
            true => 0,
            false => idle + 1,
        };
        if idle >= 2 && round + 1 >= first_rounds {
            break;
        }
    }
    Ok((best, rounds))
}

/// Best correction so far, with its image.
pub(crate) struct Best {
    pub(crate) correction: Option<Correction>,
    pub(crate) figures: Figures,
    pub(crate) image: Image,
}

/// Form the image of a recording.
pub(crate) fn form(subject: &Subject, history: &dyn PhaseHistory) -> Result<Image, FormError> {
    let [fast, slow] = subject.windows;
    let held_bytes = (HELD_IMAGES - 1) * 8 * subject.grid.num_pixels();
    let left_bytes = subject
        .memory_bytes
        .checked_sub(held_bytes)
        .ok_or(FormError::Memory {
            purpose: "autofocus",
            needed_bytes: held_bytes.into(),
            budget_bytes: subject.memory_bytes,
            remedies: &[Remedy::MoreMemory, Remedy::FewerPixels],
        })?;
    let task = Task {
        history,
        grid: subject.grid,
        weights: &Weights::new(history.collection(), fast, slow),
        memory_bytes: left_bytes,
        monitor: &Quiet(subject.monitor),
        numerics: Default::default(),
    };
    Ok(subject.former.form_planned(&task)?.image)
}

/// Figures of a whole image.
///
/// # Errors
/// [`SharpenError::Dark`].
pub(crate) fn figures(image: &Image) -> Result<Figures, SharpenError> {
    let statistics = Statistics::of(image, &Region::whole(image));
    let figures = (
        statistics.entropy,
        statistics.amplitude_contrast,
        statistics.peak_level_db,
    );
    match figures {
        (Some(entropy), Some(contrast), Some(peak_db)) if entropy.is_finite() => Ok(Figures {
            entropy,
            contrast,
            peak_db,
        }),
        _ => Err(SharpenError::Dark),
    }
}

/// Value of the measure; larger is better.
pub(crate) fn merit(measure: Measure, figures: &Figures, image: &Image) -> f64 {
    match measure {
        Measure::Entropy => -figures.entropy,
        Measure::Contrast => figures.contrast,
        Measure::Peak => figures.peak_db,
        Measure::Sharpness => Statistics::of(image, &Region::whole(image))
            .sharpness
            .unwrap_or(0.0),
    }
}
