//! Views of pixels for pairs of images: finite values, amplitudes, the raster of a map.

use num_complex::Complex32;

use subaperture_maps::Ortho;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, blocks, power,
};

/// Pixels that must be finite: other values are errors, not missing pixels.
#[derive(Debug)]
pub(crate) struct Finite<'a> {
    pub(crate) pixels: &'a dyn ImageSource,
    pub(crate) name: String,
}

impl ImageSource for Finite<'_> {
    fn size(&self) -> (usize, usize) {
        self.pixels.size()
    }

    fn places(&self) -> PixelBlocks {
        self.pixels.places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let window = self.pixels.window(place)?;
        match window.pixels.iter().position(|z| !z.is_finite()) {
            None => Ok(window),
            Some(i) => Err(format!(
                "{}: expected finite values, found another at row {}, column {}",
                self.name,
                place[0].start + i / window.columns,
                place[1].start + i % window.columns
            )
            .into()),
        }
    }
}

/// Amplitudes of pixels, optionally limited to a range of levels in dB.
#[derive(Debug)]
pub(crate) struct Amplitudes<'a> {
    pub(crate) pixels: Box<dyn ImageSource + 'a>,
    pub(crate) levels_db: Option<[f64; 2]>,
}

impl ImageSource for Amplitudes<'_> {
    fn size(&self) -> (usize, usize) {
        self.pixels.size()
    }

    fn places(&self) -> PixelBlocks {
        self.pixels.places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let mut window = self.pixels.window(place)?;
        let limits = self
            .levels_db
            .map(|levels| levels.map(|db| libm::pow(10.0, db / 20.0)));
        for z in &mut window.pixels {
            let amplitude = power(*z).sqrt();
            let amplitude = match limits {
                // NaN remains NaN.
                Some([low, high]) if amplitude.is_finite() => amplitude.clamp(low, high),
                _ => amplitude,
            };
            *z = Complex32::new(amplitude as f32, 0.0);
        }
        Ok(window)
    }
}

/// Image on the raster of a map: complex values, or roots of mean power.
#[derive(Debug)]
pub(crate) struct OnRaster<'a> {
    pub(crate) ortho: Ortho<'a>,
    pub(crate) complex: bool,
}

impl ImageSource for OnRaster<'_> {
    fn size(&self) -> (usize, usize) {
        let raster = self.ortho.raster();
        (raster.rows, raster.columns)
    }

    fn places(&self) -> PixelBlocks {
        let (rows, columns) = self.size();
        blocks(rows, columns)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let pixels = match self.complex {
            true => self.ortho.complex(place)?,
            false => self
                .ortho
                .powers(place)?
                .into_iter()
                .map(|power| Complex32::new(power.sqrt(), 0.0))
                .collect(),
        };
        Ok(Image {
            rows: place[0].len(),
            columns: place[1].len(),
            pixels,
        })
    }
}
