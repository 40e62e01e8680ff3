//! Values of the pixels of a panel.

use subaperture_model::image::{Image, ImageSource, ImageSourceError, power};

use crate::{cells, raster};

/// Image source of a picture.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// Image in memory.
    Whole(&'a Image),
    /// Image read window by window.
    ImageSource(&'a dyn ImageSource),
}

impl<'a> From<&'a Image> for Source<'a> {
    fn from(image: &'a Image) -> Self {
        Self::Whole(image)
    }
}

impl Source<'_> {
    pub(crate) fn size(&self) -> (usize, usize) {
        match self {
            Self::Whole(image) => (image.rows, image.columns),
            Self::ImageSource(parts) => parts.size(),
        }
    }

    /// Mean power on `height` x `width` cells that cover the first `rows` and `columns`.
    pub(crate) fn powers(
        &self,
        (rows, columns): (usize, usize),
        height: usize,
        width: usize,
    ) -> Result<Vec<f64>, ImageSourceError> {
        match self {
            Self::Whole(image) => {
                let line = |row: usize| &image.pixels[row * image.columns..];
                let size = (rows, columns);
                Ok(raster::resample(size, line, |&z| power(z), height, width))
            }
            Self::ImageSource(parts) => {
                let mut reduced = raster::Reduced::new((rows, columns), height, width);
                for place in parts.places() {
                    if place[0].start >= rows || place[1].start >= columns {
                        continue;
                    }
                    let window = parts.window(&place)?;
                    let [down, across] = place;
                    let place = [down.start..down.end.min(rows), across];
                    cells::add_window(&mut reduced, &place, &window);
                }
                Ok(reduced.finish())
            }
        }
    }
}
