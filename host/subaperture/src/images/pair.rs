//! Pairs of images on common pixels.

use std::fmt;
use std::path::PathBuf;

use subaperture_model::image::{Image, ImageSource};

use super::Values;
use super::views::Amplitudes;

/// Two images on the same pixels.
///
/// | images | pixels | values |
/// |---|---|---|
/// | grids of the same points, perhaps rotated by 90 degrees, mirrored, or one a part of the other | the reference's, exactly | complex |
/// | products on grids of the same surface | the reference's; the image is resampled, with an error below -60 dB as a rule ([`Resampled`](subaperture_maps::Resampled)) | complex |
/// | a complex image and a map | the map's; the complex image is projected ([`Ortho`](subaperture_maps::Ortho)) | as the map's |
/// | a SICD and an image on other pixels | the reference's; the image is resampled | amplitudes, because phases refer to different pixels |
/// | a detected and a complex image | the detected image's | amplitudes, limited to the levels of the detected image |
/// | an image without metadata, and any other | by rows and columns, if sizes are equal; a note says so | complex |
///
/// All other pairs are refused ([`PairError`]). Pixels missing in one of the images are NaN.
#[derive(Debug)]
pub struct Pair<'a> {
    /// Image, on the common pixels.
    pub image: Box<dyn ImageSource + 'a>,
    /// Reference, of the same size.
    pub reference: Box<dyn ImageSource + 'a>,
    /// Whether values are complex; amplitudes otherwise.
    pub complex: bool,
    /// Whether both images contain every pixel.
    pub whole: bool,
    /// Processing steps and assumptions, one sentence each.
    pub notes: Vec<String>,
}

/// Error of relating two images to common pixels.
#[derive(Debug, thiserror::Error)]
#[error("{} and {} {reason}", image.display(), reference.display())]
pub struct PairError {
    /// Path of the image.
    pub image: PathBuf,
    /// Path of the reference.
    pub reference: PathBuf,
    /// Reason, with a remedy.
    pub reason: String,
    /// Whether georeferencing a scene's origin ([`super::OpenImage::placed`]) would help.
    pub unplaced: bool,
}

impl<'a> Pair<'a> {
    pub(super) fn of(image: impl ImageSource + 'a, reference: impl ImageSource + 'a) -> Self {
        Self {
            image: Box::new(image),
            reference: Box::new(reference),
            complex: true,
            whole: false,
            notes: Vec::new(),
        }
    }

    pub(super) fn noting(mut self, note: impl fmt::Display) -> Self {
        self.notes.push(note.to_string());
        self
    }

    pub(super) fn amplitudes(mut self, why: impl fmt::Display) -> Self {
        self.complex = false;
        self.notes.push(why.to_string());
        self
    }

    /// Use amplitudes if either image is detected.
    pub(super) fn detect(&mut self, image: Values, reference: Values) -> Result<(), String> {
        let mut levels_db = None;
        for values in [image, reference] {
            match values {
                Values::Complex => {}
                Values::Amplitudes => self.complex = false,
                Values::Levels([black, white]) => {
                    self.complex = false;
                    let [low, high] = levels_db.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                    levels_db = Some([black.max(low), white.min(high)]);
                }
                Values::Greys => {
                    return Err(
                        "cannot be compared: the grey levels of one have no stated scale, so that amplitudes are unknown"
                            .to_owned(),
                    );
                }
            }
        }
        if self.complex {
            return Ok(());
        }
        if image != Values::Complex || reference != Values::Complex {
            self.notes
                .push("amplitudes are compared: one of the images is detected".to_owned());
        }
        if let Some([black, white]) = levels_db {
            if black >= white {
                return Err("are detected between levels that do not overlap".to_owned());
            }
            self.notes.push(format!(
                "amplitudes are limited to the detected image's levels, {black:.2} to {white:.2} dB"
            ));
        }
        let empty = || -> Box<dyn ImageSource + 'a> {
            Box::new(Image {
                rows: 0,
                columns: 0,
                pixels: Vec::new(),
            })
        };
        for side in [&mut self.image, &mut self.reference] {
            let pixels = std::mem::replace(side, empty());
            *side = Box::new(Amplitudes { pixels, levels_db });
        }
        Ok(())
    }
}
