//! Strategies that relate the pixels of two images for [`super::Pair`], exact ones first.

use subaperture_maps::{MapError, PixelPositions, ProjectionModel, Raster, Resampled, Source};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::ImageSource;
use subaperture_model::resolution::support::Looks;
use subaperture_model::{SPEED_OF_LIGHT_M_S, quantity};

use super::lattice::{Lattice, OnLattice};
use super::pair::{Pair, PairError};
use super::project::{cannot_resample, is_detected, project, refuse_partial, unplaced};
use super::views::Finite;
use super::{OpenImage, PixelGeometry, Pixels};
use crate::on_map::SicdOnMap;

/// Maximum distance of pixels from the other image's surface for complex comparison, wavelengths: a phase of `4 pi` times it, 1e-3 rad.
const OFF_WAVELENGTHS: f64 = 8e-5;
/// Maximum distance for the comparison of amplitudes, pixels.
const OFF_PIXELS: f64 = 0.5;
/// Tolerance within which pixels of two rasters, or of two SICDs, are the same, pixels.
const SAME_PIXELS: f64 = 1e-3;

type Found<'a> = Result<Pair<'a>, String>;

impl<'a> Pair<'a> {
    /// Relate an image to the pixels of a reference; `looks` are those of both ([`OpenImage::looks`]), needed for resampling.
    ///
    /// # Errors
    /// [`PairError`].
    pub fn new(
        image: &'a OpenImage,
        reference: &'a OpenImage,
        looks: [Option<&'a Looks>; 2],
    ) -> Result<Self, PairError> {
        let wrong = |reason: String| PairError {
            image: image.path.clone(),
            reference: reference.path.clone(),
            reason,
            unplaced: image.is_unplaced() != reference.is_unplaced(),
        };
        let of = Both {
            image,
            reference,
            looks,
        };
        let mut pair = of.pair().map_err(wrong)?;
        pair.detect(image.values, reference.values).map_err(wrong)?;
        Ok(pair)
    }
}

/// Pair of images to be related.
#[derive(Clone, Copy)]
struct Both<'a> {
    image: &'a OpenImage,
    reference: &'a OpenImage,
    looks: [Option<&'a Looks>; 2],
}

impl<'a> Both<'a> {
    fn pair(self) -> Found<'a> {
        let Self {
            image, reference, ..
        } = self;
        match (&image.lies, &reference.lies) {
            (PixelGeometry::Pixels, _) | (_, PixelGeometry::Pixels) => self.by_shape(),
            (PixelGeometry::Map(own), PixelGeometry::Map(theirs)) => self.on_rasters(own, theirs),
            (_, PixelGeometry::Map(raster)) => {
                let (on_raster, notes) = project(image, self.looks[0], raster, reference.values)?;
                let complex = on_raster.complex;
                let pair = Pair::of(on_raster, checked(reference));
                Ok(Pair {
                    complex,
                    notes,
                    ..pair
                })
            }
            (PixelGeometry::Map(raster), _) => {
                let (on_raster, notes) = project(reference, self.looks[1], raster, image.values)?;
                let complex = on_raster.complex;
                let pair = Pair::of(checked(image), on_raster);
                Ok(Pair {
                    complex,
                    notes,
                    ..pair
                })
            }
            _ => self.in_space(),
        }
    }

    fn same_size(self) -> bool {
        self.image.pixels.size() == self.reference.pixels.size()
    }

    /// Pixel by pixel, both images unchanged.
    fn unchanged(self) -> Pair<'a> {
        let partial = [self.image, self.reference]
            .iter()
            .any(|image| is_partial(image));
        let pair = match partial {
            true => Pair::of(checked(self.image), checked(self.reference)),
            // Non-finite values are reported by the comparison.
            false => Pair::of(&self.image.pixels, &self.reference.pixels),
        };
        Pair {
            whole: !partial,
            ..pair
        }
    }

    fn by_shape(self) -> Found<'a> {
        self.check_meaning()?;
        let without = |image: &OpenImage| matches!(image.lies, PixelGeometry::Pixels);
        let is_velocity = |image: &OpenImage| matches!(image.pixels, Pixels::Velocity(_));
        if is_velocity(self.image) && is_velocity(self.reference) {
            return Ok(self.unchanged());
        }
        let names: Vec<String> = [self.image, self.reference]
            .into_iter()
            .filter(|image| without(image))
            .map(|image| image.path.display().to_string())
            .collect();
        let names = names.join(" and ");
        if !self.same_size() {
            let (a, b) = (self.image.pixels.size(), self.reference.pixels.size());
            return Err(format!(
                "differ in size: {} rows x {} columns and {} x {}; {names} has no metadata to relate its pixels to the other's; form both on one grid",
                a.0, a.1, b.0, b.1
            ));
        }
        Ok(self.unchanged().noting(format!(
            "{names} has no metadata: pixels are compared by row and column alone"
        )))
    }

    /// Refuse a pair if the position of one image is unreadable or the axes are of different kinds.
    fn check_meaning(self) -> Result<(), String> {
        let both = [self.image, self.reference];
        let placed = |image: &OpenImage| !matches!(image.lies, PixelGeometry::Pixels);
        let any_placed = both.into_iter().any(placed);
        for image in both {
            let why = match &image.pixels {
                Pixels::Map(map) => map.raster().err(),
                Pixels::Sidd(file) if file.plane().is_none() => {
                    Some("its metadata contain no plane projection".to_owned())
                }
                _ => None,
            };
            if let (Some(why), true) = (why, any_placed) {
                return Err(format!(
                    "cannot be related: {}: {why}",
                    image.path.display()
                ));
            }
        }
        let velocities = both.map(|image| match &image.pixels {
            Pixels::Velocity(_) => image.record.as_ref(),
            _ => None,
        });
        match velocities {
            [Some(own), Some(theirs)] => {
                let same = ["velocities", "position_m", "epoch_s"]
                    .iter()
                    .all(|key| own[key] == theirs[key]);
                match same {
                    true => Ok(()),
                    false => Err(
                        "are velocity planes of different velocities or positions: form both with the same"
                            .to_owned(),
                    ),
                }
            }
            [Some(_), None] | [None, Some(_)] if any_placed => Err(
                "cannot be compared: the axes of one are velocities, those of the other positions"
                    .to_owned(),
            ),
            _ => Ok(()),
        }
    }

    fn on_rasters(self, own: &Raster, theirs: &Raster) -> Found<'a> {
        let near = |a: f64, b: f64, step: f64| (a - b).abs() < SAME_PIXELS * step;
        let same = own.projection.epsg() == theirs.projection.epsg()
            && near(own.west, theirs.west, own.step[0])
            && near(own.north, theirs.north, own.step[1])
            && (0..2).all(|i| {
                let count = own.rows.max(own.columns) as f64;
                near(own.step[i] * count, theirs.step[i] * count, own.step[i])
            });
        match same && self.same_size() {
            true => Ok(self.unchanged()),
            false => Err(
                "are maps on different rasters: export both with the same pixel size and projection, or compare the complex images from which they were made"
                    .to_owned(),
            ),
        }
    }

    /// Relate pixels in planes, on surfaces, or by a SICD's metadata.
    fn in_space(self) -> Found<'a> {
        let (Some((own, own_frame)), Some((theirs, their_frame))) =
            (self.image.grid(), self.reference.grid())
        else {
            return self.on_ground(None);
        };
        let mut assumed = None;
        let (own_frame, their_frame) = match (own_frame, their_frame) {
            (Some(own), Some(theirs)) => (own, theirs),
            (None, None) => (SceneFrame::Local, SceneFrame::Local),
            (one, other) => {
                let known = one.or(other).unwrap_or(SceneFrame::Local);
                let unknown = if one.is_none() {
                    self.image
                } else {
                    self.reference
                };
                assumed = Some(format!(
                    "the scene frame of {} is not recorded yet: that of the other image is assumed",
                    unknown.path.display()
                ));
                (known, known)
            }
        };
        let is_local = |frame: &SceneFrame| matches!(frame, SceneFrame::Local);
        let noted = |pair: Pair<'a>| match &assumed {
            Some(note) => pair.noting(note),
            None => pair,
        };
        if is_local(&own_frame) != is_local(&their_frame) {
            let local = if is_local(&own_frame) {
                self.image
            } else {
                self.reference
            };
            return match own == theirs {
                true => Ok(self.unchanged().noting(format!(
                    "{} has no position on the Earth: the scene frame of the other image is assumed, because the grids are equal",
                    local.path.display()
                ))),
                false => Err(unplaced(local)),
            };
        }
        if own == theirs && own_frame.agrees_with(&their_frame) {
            return Ok(noted(self.unchanged()));
        }
        let lattice = Lattice::of((own, &own_frame), (theirs, &their_frame));
        if let Some(lattice) = lattice.filter(|_| self.is_plane()) {
            return Ok(noted(self.on_lattice(lattice)));
        }
        // The complex image is resampled, never the detected one.
        let own_side = !is_detected(self.image);
        let points = match own_side {
            true => self.on_points((own, own_frame), (theirs, their_frame)),
            false if is_detected(self.reference) => {
                return Err("are detected images on different pixels: compare the complex images from which they were made".to_owned());
            }
            false => self
                .swapped()
                .on_points((theirs, their_frame), (own, own_frame))
                .map(swap),
        };
        match points {
            Ok(pair) => Ok(noted(pair)),
            Err(why) if is_local(&own_frame) => Err(why),
            Err(why) => self.on_ground(Some(why)),
        }
    }

    fn swapped(self) -> Self {
        Self {
            image: self.reference,
            reference: self.image,
            looks: [self.looks[1], self.looks[0]],
        }
    }

    /// Whether pixels of both are points of their planes, or both use the same projection.
    fn is_plane(self) -> bool {
        match (sicd(self.image), sicd(self.reference)) {
            (None, None) => true,
            (Some(one), None) | (None, Some(one)) => one.is_plane(),
            (Some(own), Some(theirs)) => {
                let (rows, columns) = self.reference.pixels.size();
                let corners = [
                    [0, 0],
                    [0, columns - 1],
                    [rows - 1, 0],
                    [rows - 1, columns - 1],
                ];
                let both_planes = own.is_plane() && theirs.is_plane();
                both_planes
                    || corners.iter().all(|at| {
                        let at = at.map(|n| n as f64);
                        let places = [own.place(at), theirs.place(at)];
                        let [Some(a), Some(b)] = places else {
                            return false;
                        };
                        let steps = theirs.steps_m();
                        a.to_ecf_m().distance(b.to_ecf_m()) < SAME_PIXELS * steps[0].min(steps[1])
                    })
            }
        }
    }

    fn on_lattice(self, lattice: Lattice) -> Pair<'a> {
        if lattice == Lattice::SAME && self.same_size() {
            return self.unchanged();
        }
        let size = self.reference.pixels.size();
        let image = OnLattice {
            image: checked(self.image),
            lattice,
            size,
        };
        let pair = Pair::of(image, checked(self.reference));
        match lattice.turn() {
            Some(turn) => pair.noting(format!(
                "both grids have the same points: {} is {turn} onto the pixels of {}",
                self.image.path.display(),
                self.reference.path.display()
            )),
            None => pair,
        }
    }

    /// Resample the image at the points of the reference's grid, which must lie on the image's surface.
    fn on_points(
        self,
        (own, own_frame): (&'a ImageGrid, SceneFrame),
        (theirs, their_frame): (&'a ImageGrid, SceneFrame),
    ) -> Found<'a> {
        refuse_partial(self.image)?;
        let name = self.image.path.display();
        if let Some(on_map) = sicd(self.image) {
            if !on_map.is_plane() {
                return Err("lie on different pixels".to_owned());
            }
            let resampled = Resampled::projected_on_points(
                &self.image.pixels,
                on_map,
                (own, &own_frame),
                (theirs, &their_frame),
            );
            let step_m = own.rows.step.min(own.columns.step);
            self.check_surface(&resampled, SAME_PIXELS * step_m)?;
            let note = resampled_note(self.image, self.reference, &resampled);
            return Ok(Pair::of(resampled, checked(self.reference))
                .noting(note)
                .amplitudes(format!(
                    "amplitudes are compared: phases of {name} refer to its own pixels"
                )));
        }
        let looks = self.looks_of_image()?;
        let source = Source {
            pixels: &self.image.pixels,
            grid: own,
            frame: match &self.image.lies {
                PixelGeometry::Grid {
                    frame: Some(frame), ..
                } => frame,
                _ => &SceneFrame::Local,
            },
            looks,
        };
        let resampled = Resampled::on_points(source, theirs, &their_frame)
            .map_err(|error| cannot_resample(self.image, &error))?;
        let middle = looks.looks().get(looks.looks().len() / 2);
        let wavelength_m = middle.map_or(0.0, |look| {
            2.0 * SPEED_OF_LIGHT_M_S / (look.band_hz[0] + look.band_hz[1])
        });
        self.check_surface(&resampled, OFF_WAVELENGTHS * wavelength_m)?;
        let note = resampled_note(self.image, self.reference, &resampled);
        let pair = Pair::of(resampled, checked(self.reference)).noting(note);
        Ok(match sicd(self.reference) {
            Some(_) => pair.amplitudes(format!(
                "amplitudes are compared: phases of {} refer to its own pixels",
                self.reference.path.display()
            )),
            None => pair,
        })
    }

    fn looks_of_image(self) -> Result<&'a Looks, String> {
        self.looks[0].ok_or_else(|| cannot_resample(self.image, &MapError::Unseen))
    }

    fn check_surface(self, resampled: &Resampled, most_m: f64) -> Result<(), String> {
        match resampled.off_surface_m() {
            None => Err("show different places: no pixel of one lies on the other".to_owned()),
            Some(off_m) if off_m <= most_m => Ok(()),
            Some(off_m) => Err(format!(
                "lie on different surfaces, up to {} apart; at most {} is allowed: form both on one surface",
                quantity::metres(off_m),
                quantity::metres(most_m)
            )),
        }
    }

    /// Relate by ground position, where one image is a SICD. `why` is the reason why no more exact strategy applied.
    fn on_ground(self, why: Option<String>) -> Found<'a> {
        let why = why.unwrap_or_else(|| {
            "cannot be related: their metadata do not locate pixels of one on the other".to_owned()
        });
        let reason = |image: &OpenImage| match &image.lies {
            PixelGeometry::Sicd { on_map, .. } => match &**on_map {
                Err(what) => Some(format!("cannot be related: {what}")),
                Ok(_) => None,
            },
            _ => None,
        };
        if let Some(reason) = reason(self.image).or_else(|| reason(self.reference)) {
            return Err(reason);
        }
        refuse_partial(self.image)?;
        let size = self.reference.pixels.size();
        let resampled = match (sicd(self.image), sicd(self.reference)) {
            (None, None) => return Err(why),
            (Some(own), Some(theirs)) => {
                let places = PixelPositions::Projected(theirs, size);
                Resampled::projected_at_places(&self.image.pixels, own, places)
            }
            (Some(own), None) => {
                let Some((grid, Some(frame))) = self.reference.grid() else {
                    return Err(why);
                };
                self.check_heights(own, grid, &frame)?;
                Resampled::projected_at_places(
                    &self.image.pixels,
                    own,
                    PixelPositions::Grid(grid, frame),
                )
            }
            (None, Some(theirs)) => {
                let (
                    PixelGeometry::Grid {
                        grid,
                        frame: Some(frame),
                    },
                    false,
                ) = (&self.image.lies, is_detected(self.image))
                else {
                    return Err(why);
                };
                self.check_heights(theirs, grid, frame)?;
                let source = Source {
                    pixels: &self.image.pixels,
                    grid,
                    frame,
                    looks: self.looks_of_image()?,
                };
                Resampled::at_places(source, PixelPositions::Projected(theirs, size))
                    .map_err(|error| cannot_resample(self.image, &error))?
            }
        };
        if resampled.off_surface_m().is_none() {
            return Err("show different places: no pixel of one lies on the other".to_owned());
        }
        let note = resampled_note(self.image, self.reference, &resampled);
        Ok(Pair::of(resampled, checked(self.reference))
            .noting(note)
            .amplitudes("amplitudes are compared: phases refer to different pixels"))
    }

    /// Check that a grid lies at the height assumed for a SICD's pixels.
    fn check_heights(
        self,
        on_map: &SicdOnMap,
        grid: &ImageGrid,
        frame: &SceneFrame,
    ) -> Result<(), String> {
        let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
        let places = [
            [0, 0],
            [0, columns],
            [rows, 0],
            [rows, columns],
            [rows / 2, columns / 2],
        ];
        let heights = places.into_iter().filter_map(|[row, column]| {
            let place = frame.geodetic(grid.position_m(row, column))?;
            Some((place.height_m - on_map.height_m()).abs())
        });
        let off_m = heights.fold(0.0, f64::max);
        let steps = on_map.steps_m();
        let most_m = OFF_PIXELS * steps[0].min(steps[1]);
        match off_m <= most_m {
            true => Ok(()),
            false => Err(format!(
                "lie on different surfaces: pixels are up to {} above or below those of the SICD; at most {} is allowed: form the image on the SICD's plane or at its height",
                quantity::metres(off_m),
                quantity::metres(most_m)
            )),
        }
    }
}

fn swap(pair: Pair) -> Pair {
    Pair {
        image: pair.reference,
        reference: pair.image,
        ..pair
    }
}

fn sicd(image: &OpenImage) -> Option<&SicdOnMap> {
    match &image.lies {
        PixelGeometry::Sicd { on_map, .. } => (**on_map).as_ref().ok(),
        _ => None,
    }
}

/// Whether pixels may legitimately have no value.
fn is_partial(image: &OpenImage) -> bool {
    match &image.pixels {
        Pixels::Unfinished(_) | Pixels::Map(_) => true,
        Pixels::Zarr(zarr) => zarr.attributes()["missing"] == "NaN",
        _ => false,
    }
}

/// Pixels that must be finite, except in a partial image.
fn checked(image: &OpenImage) -> Box<dyn ImageSource + '_> {
    match is_partial(image) {
        true => Box::new(&image.pixels),
        false => Box::new(Finite {
            pixels: &image.pixels,
            name: image.path.display().to_string(),
        }),
    }
}

fn resampled_note(image: &OpenImage, reference: &OpenImage, resampled: &Resampled) -> String {
    format!(
        "{} is resampled onto the pixels of {}, with a relative error below {:.0} dB",
        image.path.display(),
        reference.path.display(),
        resampled.error_db().ceil()
    )
}
