//! Autofocus with validation on held-out data.
//!
//! Any image becomes sharper by a correction chosen to sharpen it. The rounds (`rounds.rs`) therefore run again without each fold of the range
//! cells, and the correction is tested on the held-out fold (`held_out.rs`). It is kept only if it passes the tests.
//! A correction cannot be tested if bright points lie in too few range cells; it is then refused, unless
//! [`Stopping::keep_unjudged`] is set.
//!
//! Memory: [`HELD_IMAGES`](super::HELD_IMAGES) images, the histories of the points or the patches of
//! [`Sharpness`](super::Sharpness), and the memory of the former.

use subaperture_model::image::Image;

use super::correction::{Corrected, Correction};
use super::far::FarScene;
use super::folds::Folds;
use super::held_out::{self, HeldOut};
use super::rounds::{
    Best, Figures, Method, Round, SharpenError, Stopping, Subject, by_rounds, figures, form, merit,
};

/// Largest number of images formed in `rounds` rounds by a method for tracks or for phases: one before, those of the rounds on all range cells
/// and without each fold, and one per tested fold.
pub fn most_images(rounds: usize, track: bool) -> usize {
    let folds = if track { Folds::MOST } else { 2 };
    (folds + 1) * (rounds + 1)
}

/// Judgement of a correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// No proposed correction sharpens the image.
    NothingFound,
    /// The correction passes the tests on held-out data and is kept.
    Sharper,
    /// The correction fails a test on held-out data and is refused.
    NotSharper,
    /// Bright points lie in too few range cells for held-out data. The correction is refused, unless
    /// [`Stopping::keep_unjudged`] is set.
    Unjudged,
}

/// Correction, judgement, figures and images of [`sharpen`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Sharpened {
    /// Accepted correction; `None` if no correction sharpens the image, or if it was refused.
    pub correction: Option<Correction>,
    /// Refused correction, if any.
    pub refused: Option<Correction>,
    /// Outcome of the tests.
    pub outcome: Outcome,
    /// Figures without the correction.
    pub before: Figures,
    /// Figures with the correction on the pixels used for its estimation, which do not prove a better image: see `held_out`.
    pub after: Figures,
    /// Figures on held-out data; `None` with [`Outcome::NothingFound`] and [`Outcome::Unjudged`].
    pub held_out: Option<HeldOut>,
    /// Image without the correction.
    pub image_before: Image,
    /// Image with the correction.
    pub image_after: Image,
    /// All rounds on the whole image.
    pub rounds: Vec<Round>,
}

/// Sharpen an image by a method, with tests on held-out data.
///
/// # Errors
/// [`SharpenError`].
pub fn sharpen(
    subject: &Subject,
    method: &dyn Method,
    stopping: Stopping,
) -> Result<Sharpened, SharpenError> {
    let image_before = form(subject, subject.history)?;
    let before = figures(&image_before)?;
    let (mut best, rounds) = by_rounds(subject, method, stopping, &image_before, None)?;
    let far = FarScene::of(subject.history.collection(), subject.grid);
    if let (Some(far), Some(Correction::Track { .. })) = (&far, &best.correction) {
        best = along_sight(subject, far, best, &image_before)?;
    }
    let held_out = match &best.correction {
        None => None,
        Some(correction) => {
            let images = [&image_before, &best.image];
            held_out::judge(subject, method, stopping, images, correction, far.as_ref())?
        }
    };
    let outcome = match (&best.correction, held_out) {
        (None, _) => Outcome::NothingFound,
        (_, None) => Outcome::Unjudged,
        (_, Some(held_out)) if held_out.sharper => Outcome::Sharper,
        _ => Outcome::NotSharper,
    };
    let kept = match outcome {
        Outcome::Sharper => true,
        Outcome::Unjudged => stopping.keep_unjudged,
        Outcome::NotSharper | Outcome::NothingFound => false,
    };
    let mut refused = None;
    if !kept {
        refused = best.correction;
        best = Best {
            correction: None,
            figures: before,
            image: image_before.clone(),
        };
    }
    subject.monitor.progress(1.0);
    Ok(Sharpened {
        correction: best.correction,
        refused,
        outcome,
        before,
        after: best.figures,
        held_out,
        image_before,
        image_after: best.image,
        rounds,
    })
}

/// Best track projected on the line of sight of a far scene, with its image; no correction if that image is not sharper than the one before.
fn along_sight(
    subject: &Subject,
    far: &FarScene,
    best: Best,
    image_before: &Image,
) -> Result<Best, SharpenError> {
    let correction = best.correction.map(|track| far.along_sight(track));
    let image = match &correction {
        Some(track) => form(subject, &Corrected::new(subject.history, track)?)?,
        None => image_before.clone(),
    };
    let (figures, before) = (figures(&image)?, figures(image_before)?);
    let of = |figures, image| merit(subject.measure, figures, image);
    Ok(match of(&figures, &image) > of(&before, image_before) {
        true => Best {
            correction,
            figures,
            image,
        },
        false => Best {
            correction: None,
            figures: before,
            image: image_before.clone(),
        },
    })
}
