//! Resampling of an image to the pixels of another image.
//!
//! The result has the rows and columns of the other image ([`ImageSource`]), so that both can be compared pixel by pixel. Pixels outside the image, or where the
//! interpolation kernel would extend beyond the image's edge, are NaN.
//!
//! Two kinds of target pixels:
//! - **points** of the image's own surface ([`Resampled::on_points`], [`Resampled::projected_on_points`]): exact positions in the scene. Complex
//!   values of an image that was formed here equal those that its image former would compute at these points.
//! - **ground positions** ([`Resampled::at_places`], [`Resampled::projected_at_places`]): each is projected into the image as for a map ([`crate::Ortho`]).
//!
//! [`Resampled::off_surface_m`] is the distance between target pixels and the image's surface; the caller decides whether it is acceptable.
//!
//! **Error** of complex values, relative RMS: [`Resampled::error_db`], below -60 dB where 16 taps suffice for the image's bandwidth. **Cost** as [`crate::Ortho`].
//! **Memory** one patch of the image.

use num_complex::Complex32;
use rayon::prelude::*;

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, blocks,
};

use crate::carrier::Carrier;
use crate::reader::{NO_VALUE, Reader, Traced};
use crate::surface::Surface;
use crate::{MapError, ProjectionModel, Source};

/// Patch side, pixels.
const PATCH: usize = 128;
/// Smallest patch side, pixels.
const MIN_PATCH: usize = 8;
/// Image pixels per target pixel above which a patch is subdivided.
const MAX_READ: usize = 16;
/// Samples per side at which the distance from the image's surface is measured.
const LOOKED_AT: usize = 33;

/// Ground positions of an image's pixels.
#[derive(Clone, Copy, Debug)]
pub enum PixelPositions<'a> {
    /// Pixels of a grid in a frame with a position on the Earth.
    Grid(&'a ImageGrid, SceneFrame),
    /// Pixels of an image that its metadata project, and its rows and columns.
    Projected(&'a dyn ProjectionModel, (usize, usize)),
}

impl PixelPositions<'_> {
    fn size(&self) -> (usize, usize) {
        match self {
            Self::Grid(grid, _) => (grid.rows.count, grid.columns.count),
            Self::Projected(_, size) => *size,
        }
    }

    fn at(&self, [row, column]: [usize; 2]) -> Option<Geodetic> {
        match self {
            Self::Grid(grid, frame) => frame.geodetic(grid.position_m(row, column)),
            Self::Projected(model, _) => model.place([row as f64, column as f64]),
        }
    }
}

/// Target pixels.
#[derive(Debug)]
enum Targets<'a> {
    /// Points of a grid in its frame; the image's own frame.
    Points(&'a ImageGrid, SceneFrame, SceneFrame),
    Places(PixelPositions<'a>),
}

impl Targets<'_> {
    fn size(&self) -> (usize, usize) {
        match self {
            Self::Points(grid, ..) => (grid.rows.count, grid.columns.count),
            Self::Places(places) => places.size(),
        }
    }

    /// Project a target pixel into the image.
    fn traced(&self, surface: &Surface, at: [usize; 2]) -> Traced {
        let plane = match (self, surface) {
            (Self::Points(grid, theirs, own), Surface::Grid(on)) => {
                on.foot(between(theirs, own, grid.position_m(at[0], at[1])))
            }
            (Self::Points(grid, theirs, _), Surface::Projected(..)) => theirs
                .geodetic(grid.position_m(at[0], at[1]))
                .map_or([f64::NAN; 2], |place| surface.on_plane(&place)),
            (Self::Places(places), _) => places
                .at(at)
                .map_or([f64::NAN; 2], |place| surface.on_plane(&place)),
        };
        Traced {
            pixel: surface.pixel(plane),
            plane,
        }
    }

    /// Distance of a target pixel from the image's surface, metres; `None` where the image's metadata define the projection.
    fn off_m(&self, surface: &Surface, at: [usize; 2], traced: &Traced) -> Option<f64> {
        let Surface::Grid(on) = surface else {
            return None;
        };
        let shown_m = on.point_m(traced.plane);
        let point_m = match self {
            Self::Points(grid, theirs, own) => between(theirs, own, grid.position_m(at[0], at[1])),
            Self::Places(places) => on.frame.from_ecf_m(places.at(at)?.to_ecf_m()),
        };
        Some(point_m.distance(shown_m))
    }
}

/// Convert a position between frames.
fn between(from: &SceneFrame, to: &SceneFrame, point_m: glam::DVec3) -> glam::DVec3 {
    match from.agrees_with(to) {
        true => point_m,
        false => to.from_ecf_m(from.to_ecf_m(point_m)),
    }
}

/// Image resampled to the pixels of another.
#[derive(Debug)]
pub struct Resampled<'a> {
    reader: Reader<'a>,
    targets: Targets<'a>,
}

impl<'a> Resampled<'a> {
    /// Resample an image at the points of a grid on the image's own surface. Both frames are local, or both are on the Earth.
    ///
    /// # Errors
    /// [`MapError::Unseen`] if the looks give no band; [`MapError::Folded`] if the image is undersampled.
    pub fn on_points(
        source: Source<'a>,
        grid: &'a ImageGrid,
        frame: &SceneFrame,
    ) -> Result<Self, MapError> {
        let carrier = Carrier::of(source.grid, source.looks)?;
        let surface = Surface::in_scene(source.grid, source.frame);
        Ok(Self {
            reader: Reader::carried(source.pixels, surface, carrier, source.grid),
            targets: Targets::Points(grid, *frame, *source.frame),
        })
    }

    /// Resample an image whose metadata give its spectrum at the points of a grid in the image's plane, `plane` in the frame `own`.
    pub fn projected_on_points(
        pixels: &'a dyn ImageSource,
        model: &'a dyn ProjectionModel,
        (plane, own): (&ImageGrid, &SceneFrame),
        (grid, frame): (&'a ImageGrid, &SceneFrame),
    ) -> Self {
        Self {
            reader: Reader::projected(pixels, Surface::in_scene(plane, own), model),
            targets: Targets::Points(grid, *frame, *own),
        }
    }

    /// Resample an image at ground positions.
    ///
    /// # Errors
    /// [`MapError`] if the grid is vertical or not on the Earth, or the image's bandwidth is unknown or undersampled.
    pub fn at_places(source: Source<'a>, places: PixelPositions<'a>) -> Result<Self, MapError> {
        let carrier = Carrier::of(source.grid, source.looks)?;
        let surface = Surface::of_grid(source.grid, source.frame)?;
        Ok(Self {
            reader: Reader::carried(source.pixels, surface, carrier, source.grid),
            targets: Targets::Places(places),
        })
    }

    /// Resample an image whose metadata give its spectrum and projection at ground positions.
    pub fn projected_at_places(
        pixels: &'a dyn ImageSource,
        model: &'a dyn ProjectionModel,
        places: PixelPositions<'a>,
    ) -> Self {
        let (rows, columns) = pixels.size();
        let surface = Surface::Projected(model, [rows, columns]);
        Self {
            reader: Reader::projected(pixels, surface, model),
            targets: Targets::Places(places),
        }
    }

    /// Relative RMS error of complex values, dB, for an image that fills its band.
    pub fn error_db(&self) -> f64 {
        self.reader.error_db()
    }

    /// Largest distance between the target pixels on the image and the image's surface, metres, sampled at up to 33 x 33 pixels; `None` where no target pixel is on the
    /// image. 0 for an image whose metadata define its projection.
    pub fn off_surface_m(&self) -> Option<f64> {
        let (rows, columns) = self.targets.size();
        let some = |count: usize| {
            let seen = count.min(LOOKED_AT);
            (0..seen).map(move |i| i * (count - 1) / (seen - 1).max(1))
        };
        let mut most_m = None;
        for row in some(rows) {
            for column in some(columns) {
                let at = [row, column];
                let traced = self.targets.traced(&self.reader.surface, at);
                if self.is_read(traced.pixel) {
                    let off_m = self.targets.off_m(&self.reader.surface, at, &traced);
                    most_m = Some(most_m.unwrap_or(0.0f64).max(off_m.unwrap_or(0.0)));
                }
            }
        }
        most_m
    }

    /// Whether the kernel about a fractional pixel lies on the image.
    fn is_read(&self, pixel: [f64; 2]) -> bool {
        let counts = self.reader.surface.counts();
        let reach = self.reader.reach() as f64;
        // An image narrower than the kernel, such as one row, is accepted over its own extent.
        (0..2).all(|i| {
            let last = counts[i] as f64 - 1.0;
            let near = (reach - 1.0).min(0.5 * last);
            pixel[i] >= near - 1e-6 && pixel[i] <= last - near + 1e-6
        })
    }

    fn read(&self, place: &PixelBlock) -> Result<Image, MapError> {
        let mut image = Image {
            rows: place[0].len(),
            columns: place[1].len(),
            pixels: vec![NO_VALUE; place[0].len() * place[1].len()],
        };
        self.patches(place, PATCH, place, &mut image.pixels)?;
        Ok(image)
    }

    /// Resample `place`, patch by patch, into the pixels of `whole`.
    fn patches(
        &self,
        place: &PixelBlock,
        side: usize,
        whole: &PixelBlock,
        out: &mut [Complex32],
    ) -> Result<(), MapError> {
        for row in place[0].clone().step_by(side) {
            for column in place[1].clone().step_by(side) {
                let patch = [
                    row..(row + side).min(place[0].end),
                    column..(column + side).min(place[1].end),
                ];
                let traced = self.traced(&patch);
                let Some(window) = self.reader.window(&traced) else {
                    continue;
                };
                let most = MAX_READ * traced.len() + PATCH * PATCH;
                if window[0].len() * window[1].len() > most && side > MIN_PATCH {
                    self.patches(&patch, (side / 2).max(MIN_PATCH), whole, out)?;
                    continue;
                }
                let values = self.reader.read(&traced, &window)?;
                for (row, values) in patch[0].clone().zip(values.chunks(patch[1].len())) {
                    let at =
                        (row - whole[0].start) * whole[1].len() + patch[1].start - whole[1].start;
                    out[at..at + values.len()].copy_from_slice(values);
                }
            }
        }
        Ok(())
    }

    fn traced(&self, patch: &PixelBlock) -> Vec<Traced> {
        let columns = patch[1].len();
        let mut traced = vec![Traced::default(); patch[0].len() * columns];
        // Shared by threads; the image's file handle is not.
        let (targets, surface) = (&self.targets, &self.reader.surface);
        let lines = traced.par_chunks_mut(columns).zip(patch[0].clone());
        lines.for_each(|(line, row)| {
            for (traced, column) in line.iter_mut().zip(patch[1].clone()) {
                *traced = targets.traced(surface, [row, column]);
            }
        });
        for traced in &mut traced {
            if !self.is_read(traced.pixel) {
                traced.pixel = [f64::NAN; 2];
            }
        }
        traced
    }
}

impl ImageSource for Resampled<'_> {
    fn size(&self) -> (usize, usize) {
        self.targets.size()
    }

    fn places(&self) -> PixelBlocks {
        let (rows, columns) = self.size();
        blocks(rows, columns)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        Ok(self.read(place)?)
    }
}
