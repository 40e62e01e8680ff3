//! Autofocus with a judgement on held-out data.
//!
//! Any image is sharper by a correction that was chosen to sharpen it. So the rounds (`rounds.rs`) run again without each fold of the range
//! cells, and the fold that was held out judges (`held_out.rs`). A correction is kept only if it passes the tests.
//! A scene whose bright points lie in too few range cells cannot be judged; its correction is refused too, unless
//! [`Stopping::keep_unjudged`] is set.
//!
//! Memory: [`HELD_IMAGES`](super::HELD_IMAGES) images, the histories of some points or the patches of
//! [`Sharpness`](super::Sharpness), and the memory of the former.

use subaperture_model::image::Image;

use super::correction::{Corrected, Correction};
use super::far::FarScene;
use super::folds::Folds;
use super::held_out::{self, HeldOut};
use super::rounds::{
    Best, Figures, Method, Round, SharpenError, Stopping, Subject, by_rounds, figures, form, merit,
};

/// Largest number of images formed in so many rounds by a method for tracks or for phases: one before, those of the rounds on all range cells
/// and without each fold, and one a fold that is judged.
pub fn most_images(rounds: usize, track: bool) -> usize {
    let folds = if track { Folds::MOST } else { 2 };
    (folds + 1) * (rounds + 1)
}

/// Judgement of a correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// No correction that was tried sharpens the image.
    NothingFound,
    /// The correction passes the tests on held-out data and is kept.
    Sharper,
    /// The correction fails a test on held-out data and is refused.
    NotSharper,
    /// Bright points lie in too few range cells to hold some of them out. The correction is refused, unless
    /// [`Stopping::keep_unjudged`] is set.
    Unjudged,
}

/// Correction, judgement, figures and images of [`sharpen`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Sharpened {
    /// The correction; `None` if none was found, or if it was refused.
    pub correction: Option<Correction>,
    /// The correction that was refused, if one was found.
    pub refused: Option<Correction>,
    /// Judgement of the correction that was found.
    pub outcome: Outcome,
    /// Figures without the correction.
    pub before: Figures,
    /// Figures with the correction, of the pixels that it was estimated on: no evidence of a better image. See `held_out`.
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

/// Sharpens by a method.
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

/// The best track along the line of sight of a far scene, with its image; no correction if that image is not sharper than the one before.
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
