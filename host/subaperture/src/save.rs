//! Saving images in the format of `subap focus`.

use std::path::Path;

use serde_json::{Value, json};

use crate::FocusedImage;
use subaperture_io::atomic::WriteError;
use subaperture_io::claim::OutputClaims;
use subaperture_io::product;
use subaperture_io::product::record::{Picture, Record};
#[cfg(feature = "plot")]
use subaperture_plot::{Panel, PlotError};

/// Error of saving an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// Files could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The picture could not be drawn.
    #[cfg(feature = "plot")]
    #[error(transparent)]
    Picture(#[from] PlotError),
}

impl FocusedImage {
    /// Write `image.npy`, `image.json` and, with the feature `plot`, `image.png` into `folder`, which is created if necessary.
    /// Either all files are written or no file is ([`io::product`](crate::io::product)). `subap` measures, compares and draws the product.
    ///
    /// # Errors
    /// [`SaveError`]. Files not written by Subaperture, and the recording's own files, are never replaced.
    pub fn save(&self, folder: impl AsRef<Path>) -> Result<(), SaveError> {
        let folder = folder.as_ref();
        let inputs: Vec<&Path> = self.inputs.iter().map(|file| file.path.as_path()).collect();
        let mut claims = OutputClaims::new(&inputs, false);
        claims.folder(folder, product::NAMES)?;
        product::write_drawing(folder, &self.image, || self.record(), || self.drawn())?;
        Ok(())
    }

    /// Description of the recording and the channels used.
    fn recorded(&self) -> Value {
        let mut recorded = json!(self.survey);
        if let Some(about) = recorded.as_object_mut() {
            if !self.channels.is_empty() {
                about.insert("channels".to_owned(), json!(self.channels));
            }
            if !self.phase_conventions.is_empty() {
                about.insert("phase".to_owned(), json!(self.phase_conventions));
            }
        }
        recorded
    }

    /// Contents of `image.json`.
    pub fn record(&self) -> Value {
        let [fast, slow] = self.windows;
        Record {
            run: json!({
                "program": "subaperture",
                "version": env!("CARGO_PKG_VERSION"),
                "run_time_s": self.taken.as_secs_f64(),
                "instructions": subaperture_focus::instructions(),
                "memory_bytes": self.memory_bytes,
            }),
            command_line: Value::Null,
            grid: &self.grid,
            frame: &self.frame,
            settings: json!({
                "algorithm": self.former,
                "window": fast.to_string(),
                "slow_window": slow.to_string(),
                "resolved": self.settings,
            }),
            collection: self.recorded(),
            support: json!(self.looks),
            antennas: self.antennas.to_json(),
            inputs: &self.inputs,
            brightest: self.brightest(),
            picture: self.shown(&self.title()),
            check: Value::Null,
            warnings: json!(self.warnings),
        }
        .to_json()
    }
}

#[cfg(feature = "plot")]
impl FocusedImage {
    /// Picture of the image as PNG bytes: level in decibels over metres.
    ///
    /// # Errors
    /// [`PlotError`].
    pub fn picture(&self) -> Result<Vec<u8>, PlotError> {
        subaperture_plot::quicklook(&Panel {
            orientation: self.orientation,
            ..Panel::new(&self.image, &self.grid, self.title())
        })
    }

    fn drawn(&self) -> Result<Vec<u8>, SaveError> {
        Ok(self.picture()?)
    }

    fn shown<'a>(&self, title: &'a str) -> Option<Picture<'a>> {
        Some(Picture {
            title,
            look: self.orientation.look,
            north: self.orientation.north,
        })
    }
}

#[cfg(not(feature = "plot"))]
impl FocusedImage {
    fn drawn(&self) -> Result<Vec<u8>, SaveError> {
        Ok(Vec::new())
    }

    fn shown<'a>(&self, _: &'a str) -> Option<Picture<'a>> {
        None
    }
}
