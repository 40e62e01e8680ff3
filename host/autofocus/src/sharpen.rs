//! Autofocus: a method proposes, an image by any former judges.
//!
//! ```text
//! image of the recording as corrected so far ──> method ──> a further correction ──> image ──> kept if it is sharper
//! ```
//!
//! Nothing is ever made worse: what a method proposes is kept only where the image of all pixels, formed again of the whole
//! recording, is better by the measure ([`Measure`]) than every image before it, and what is left at the end is the best that there was; the
//! recording as it is, if nothing was gained. A proposal that is worse is told to the method by its round: methods go from
//! coarse to fine, so that the next proposal is another one. Work ends after a number of rounds, after two rounds in a row that
//! gained nothing to speak of, or when the method has no more to propose ([`Stopping`]).
//!
//! Memory: three images, the histories of some points or the patches of [`Sharpness`](super::Sharpness), and what the
//! former takes.

use subaperture_focus::{FormError, ImageFormer, Remedy, Task};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_quality::statistics::{Region, Statistics};
use subaperture_signal::window::Window;

use super::correction::{Corrected, Correction, Misfit};
use super::measure::{Measure, Quiet};

/// What is to be sharpened, and by what images.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The recording.
    pub history: &'a dyn PhaseHistory,
    /// The pixels that are to be sharp, and of which points are chosen.
    pub grid: &'a ImageGrid,
    /// What forms them.
    pub former: &'a dyn ImageFormer,
    /// Windows over fast and slow time.
    pub windows: [Window; 2],
    /// What sharp means.
    pub measure: Measure,
    /// Bytes that all may take, the recording included.
    pub memory_bytes: u64,
    /// Told of progress, asked whether to go on.
    pub monitor: &'a dyn Monitor,
}

/// When work ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopping {
    /// Rounds at most.
    pub rounds: usize,
    /// Two rounds in a row that make the measure better by less than this part of it end the work, once the method has been
    /// through its first rounds.
    pub gain: f64,
}

impl Default for Stopping {
    fn default() -> Self {
        Self {
            rounds: 12,
            gain: 1e-4,
        }
    }
}

/// Why nothing was sharpened.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SharpenError {
    /// An image was not formed, or pulses not read.
    #[error(transparent)]
    Form(#[from] FormError),
    /// A correction does not fit the recording.
    #[error(transparent)]
    Misfit(#[from] Misfit),
    /// The image holds nothing that could be sharp.
    #[error("the image is dark: there is nothing to be sharpened by")]
    Dark,
    /// Too few pulses for the method.
    #[error("{method} needs {needed} pulses at the least; the recording has {pulses}")]
    TooShort {
        /// Which method.
        method: &'static str,
        /// Pulses a channel needed.
        needed: usize,
        /// Pulses a channel at hand.
        pulses: usize,
    },
    /// Too few points for the method.
    #[error(
        "{method} needs {needed} points seen under different angles; {found} range bins are within {within_db} dB of the brightest point"
    )]
    TooFewPoints {
        /// Which method.
        method: &'static str,
        /// Points needed.
        needed: usize,
        /// Points found.
        found: usize,
        /// How far below the brightest, dB.
        within_db: f64,
    },
}

/// A recording as corrected so far, and its image.
pub struct Look<'a> {
    /// What is to be sharpened; its history as it was recorded.
    pub subject: &'a Subject<'a>,
    /// The recording with the best correction so far.
    pub history: &'a dyn PhaseHistory,
    /// Its image.
    pub image: &'a Image,
    /// Rounds before this one.
    pub round: usize,
    /// Whether what the last round proposed was kept; so it is in the first.
    pub kept: bool,
}

impl Look<'_> {
    /// Weights of fast time.
    pub(crate) fn fast(&self) -> Vec<f64> {
        let [fast, slow] = self.subject.windows;
        Weights::new(self.history.collection(), fast, slow).fast
    }

    /// Bytes that are left beside recording and images.
    ///
    /// # Errors
    /// [`FormError::Memory`] if `needed_bytes` of `what` are more.
    pub(crate) fn room(&self, what: &'static str, needed_bytes: u64) -> Result<(), FormError> {
        let held = self.history.held_bytes() + 3 * 8 * self.subject.grid.num_pixels();
        let all = u128::from(held) + u128::from(needed_bytes);
        match all <= u128::from(self.subject.memory_bytes) {
            true => Ok(()),
            false => Err(FormError::Memory {
                what,
                needed_bytes: all,
                budget_bytes: self.subject.memory_bytes,
                remedies: &[Remedy::MoreMemory, Remedy::FewerPixels],
            }),
        }
    }
}

/// A way to tell from a recording and its image what is to be corrected.
pub trait Method: Send + Sync {
    /// Its name in records and on the command line.
    fn name(&self) -> &'static str;

    /// Rounds that differ by more than what was gained before: from coarse to fine.
    fn first_rounds(&self, _turns: usize) -> usize {
        1
    }

    /// What is to be corrected further, an entry a pulse; `None` if there is no more to say.
    ///
    /// # Errors
    /// [`SharpenError`].
    fn propose(&self, look: &Look) -> Result<Option<Correction>, SharpenError>;
}

/// Figures of an image before or after.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Entropy of power, nats; less is sharper.
    pub entropy: f64,
    /// Contrast of amplitude.
    pub contrast: f64,
    /// Power of the brightest pixel, dB.
    pub peak_db: f64,
}

/// What a round came to.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Round {
    /// Of the image with what was proposed.
    pub figures: Figures,
    /// Whether it was kept.
    pub kept: bool,
    /// Rms of what was proposed further, radians; of phases.
    pub phase_rad: Option<f64>,
    /// Rms of what was proposed further, metres; of displacements.
    pub displacement_m: Option<f64>,
}

/// What came of it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Sharpened {
    /// The correction; `None` if the recording is best as it is.
    pub correction: Option<Correction>,
    /// Figures without it.
    pub before: Figures,
    /// Figures with it.
    pub after: Figures,
    /// The image without it.
    pub image_before: Image,
    /// The image with it.
    pub image_after: Image,
    /// All rounds.
    pub rounds: Vec<Round>,
}

/// Sharpens by a method.
///
/// # Errors
/// [`SharpenError`].
pub fn sharpen(
    subject: &Subject,
    method: &dyn Method,
    stopping: Stopping,
) -> Result<Sharpened, SharpenError> {
    let first_rounds = method.first_rounds(subject.history.collection().num_turns());
    let image_before = form(subject, subject.history)?;
    let before = figures(&image_before)?;
    let mut best = Best {
        correction: None,
        figures: before,
        image: image_before.clone(),
    };
    let mut rounds = Vec::new();
    let mut idle = 0;
    for round in 0..stopping.rounds {
        if subject.monitor.cancelled() {
            return Err(FormError::Cancelled.into());
        }
        subject
            .monitor
            .progress(round as f64 / stopping.rounds as f64);
        let corrected = match &best.correction {
            None => None,
            Some(correction) => Some(Corrected::new(subject.history, correction)?),
        };
        let look = Look {
            subject,
            history: corrected.as_ref().map_or(subject.history, |c| c),
            image: &best.image,
            round,
            kept: rounds.last().is_none_or(|round: &Round| round.kept),
        };
        let Some(more) = method.propose(&look)? else {
            break;
        };
        let tried = match &best.correction {
            None => more.clone(),
            Some(correction) => correction.clone().and(&more),
        };
        let image = form(subject, &Corrected::new(subject.history, &tried)?)?;
        let figures = figures(&image)?;
        let gain = merit(subject.measure, &figures, &image)
            - merit(subject.measure, &best.figures, &best.image);
        let kept = gain > 0.0;
        rounds.push(Round {
            figures,
            kept,
            phase_rad: more.rms_phase_rad(),
            displacement_m: more.rms_displacement_m(),
        });
        let scale = merit(subject.measure, &best.figures, &best.image).abs();
        if kept {
            best = Best {
                correction: Some(tried),
                figures,
                image,
            };
        }
        idle = match gain > stopping.gain * scale {
            true => 0,
            false => idle + 1,
        };
        if idle >= 2 && round + 1 >= first_rounds {
            break;
        }
    }
    subject.monitor.progress(1.0);
    Ok(Sharpened {
        correction: best.correction,
        before,
        after: best.figures,
        image_before,
        image_after: best.image,
        rounds,
    })
}

struct Best {
    correction: Option<Correction>,
    figures: Figures,
    image: Image,
}

/// The image of a recording.
pub(crate) fn form(subject: &Subject, history: &dyn PhaseHistory) -> Result<Image, FormError> {
    let [fast, slow] = subject.windows;
    // The images before and the best are held meanwhile.
    let held_bytes = 2 * 8 * subject.grid.num_pixels();
    let left_bytes = subject
        .memory_bytes
        .checked_sub(held_bytes)
        .ok_or(FormError::Memory {
            what: "autofocus",
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
        means: Default::default(),
    };
    Ok(subject.former.form_planned(&task)?.image)
}

fn figures(image: &Image) -> Result<Figures, SharpenError> {
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

/// The measure, larger is better.
fn merit(measure: Measure, figures: &Figures, image: &Image) -> f64 {
    match measure {
        Measure::Entropy => -figures.entropy,
        Measure::Contrast => figures.contrast,
        Measure::Peak => figures.peak_db,
        Measure::Sharpness => Statistics::of(image, &Region::whole(image))
            .sharpness
            .unwrap_or(0.0),
    }
}
