//! Exact pixel correspondence of grids that differ by quarter turns, mirroring and whole-pixel shifts.

use num_complex::Complex32;

use glam::DVec3;
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, Tiling,
};

/// Distance within which points of two grids are the same, metres: a phase of `4 pi d / lambda`, 4e-5 rad at a wavelength of 3 cm.
const SAME_M: f64 = 1e-7;

/// Correspondence of pixels: row and column of the image as a function of row and column of the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lattice {
    /// Whether the image's rows run along the reference's columns.
    pub(crate) crossed: bool,
    /// Whether the image's rows, and its columns, are opposite to the reference axis parallel to them.
    pub(crate) against: [bool; 2],
    /// Row and column of the image at the first pixel of the reference.
    pub(crate) first: [i64; 2],
}

impl Lattice {
    pub(crate) const SAME: Self = Self {
        crossed: false,
        against: [false; 2],
        first: [0; 2],
    };

    /// Correspondence of two grids, each in its scene frame; `None` if their pixels do not coincide.
    pub(crate) fn of(
        (image, own): (&ImageGrid, &SceneFrame),
        (reference, theirs): (&ImageGrid, &SceneFrame),
    ) -> Option<Self> {
        if !image.is_raster() || !reference.is_raster() {
            return None;
        }
        let same_frame = own.agrees_with(theirs);
        let normal = image.normal();
        // Row and column of the image at a pixel of the reference, if the point lies in the image's plane.
        let pixel = |row: f64, column: f64| {
            let (rows, columns) = (&reference.rows, &reference.columns);
            let point = reference.point_m(
                rows.start + row * rows.step,
                columns.start + column * columns.step,
            );
            let point = match same_frame {
                true => point,
                false => own.from_ecf_m(theirs.to_ecf_m(point)),
            };
            let off_m = (point - image.origin_m).dot(normal).abs();
            let [y, x] = image.coordinates(point);
            let found = DVec3::new(
                (y - image.rows.start) / image.rows.step,
                (x - image.columns.start) / image.columns.step,
                0.0,
            );
            let whole = found.round();
            let apart = found - whole;
            let near = off_m < SAME_M
                && (apart.x * image.rows.step).abs() < SAME_M
                && (apart.y * image.columns.step).abs() < SAME_M
                && whole.abs().max_element() < 1e12;
            near.then_some([whole.x as i64, whole.y as i64])
        };
        // At least one step, so that a single row or column has a direction.
        let [down, across] =
            [reference.rows.count, reference.columns.count].map(|count| (count.max(2) - 1) as i64);
        let first = pixel(0.0, 0.0)?;
        let corners = [
            pixel(down as f64, 0.0)?,
            pixel(0.0, across as f64)?,
            pixel(down as f64, across as f64)?,
        ];
        let candidates = (0..8u8).map(|bits| Self {
            crossed: bits & 1 != 0,
            against: [bits & 2 != 0, bits & 4 != 0],
            first,
        });
        let at = [[down, 0], [0, across], [down, across]];
        candidates
            .into_iter()
            .find(|lattice| at.iter().zip(&corners).all(|(&at, &c)| lattice.at(at) == c))
    }

    /// Row and column of the image at those of the reference.
    fn at(&self, [row, column]: [i64; 2]) -> [i64; 2] {
        let along = match self.crossed {
            true => [column, row],
            false => [row, column],
        };
        [0, 1].map(|i| match self.against[i] {
            true => self.first[i] - along[i],
            false => self.first[i] + along[i],
        })
    }

    /// Description of the rotation or mirroring of the image; `None` for a pure shift.
    pub(crate) fn turn(&self) -> Option<&'static str> {
        Some(match (self.crossed, self.against) {
            (false, [false, false]) => return None,
            (false, [true, true]) => "rotated by 180 degrees",
            (false, [true, false]) => "mirrored in its rows",
            (false, [false, true]) => "mirrored in its columns",
            (true, [a, b]) if a != b => "rotated by 90 degrees",
            (true, _) => "transposed",
        })
    }
}

/// Image on the pixels of a reference; NaN where the image has no pixel.
#[derive(Debug)]
pub(crate) struct OnLattice<'a> {
    pub(crate) image: Box<dyn ImageSource + 'a>,
    pub(crate) lattice: Lattice,
    pub(crate) size: (usize, usize),
}

impl ImageSource for OnLattice<'_> {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn places(&self) -> PixelBlocks {
        // Square blocks suit every orientation.
        const SIDE: usize = 256;
        let image = [self.size.0, self.size.1];
        PixelBlocks::of_size(Tiling { image, tile: image }, [SIDE, SIDE])
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let [rows, columns] = place;
        let mut window = Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: vec![Complex32::new(f32::NAN, f32::NAN); rows.len() * columns.len()],
        };
        if rows.is_empty() || columns.is_empty() {
            return Ok(window);
        }
        let ends = [
            self.lattice.at([rows.start as i64, columns.start as i64]),
            self.lattice
                .at([rows.end as i64 - 1, columns.end as i64 - 1]),
        ];
        let counts = self.image.size();
        let counts = [counts.0 as i64, counts.1 as i64];
        let range = |i: usize| {
            let first = ends[0][i].min(ends[1][i]).max(0);
            let last = ends[0][i].max(ends[1][i]).min(counts[i] - 1);
            first..last + 1
        };
        let [r, c] = [range(0), range(1)];
        if r.is_empty() || c.is_empty() {
            return Ok(window);
        }
        let own = [
            r.start as usize..r.end as usize,
            c.start as usize..c.end as usize,
        ];
        let read = self.image.window(&own)?;
        let cells = rows
            .clone()
            .flat_map(|row| columns.clone().map(move |column| [row, column]));
        for (out, [row, column]) in window.pixels.iter_mut().zip(cells) {
            let [row, column] = self.lattice.at([row as i64, column as i64]);
            if r.contains(&row) && c.contains(&column) {
                let at = (row - r.start) as usize * read.columns + (column - c.start) as usize;
                *out = read.pixels[at];
            }
        }
        Ok(window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Image whose values encode the scene positions of its pixels.
    fn places(grid: &ImageGrid) -> Image {
        let (rows, columns) = (grid.rows.count, grid.columns.count);
        let value = |i: usize| {
            let at = grid.position_m(i / columns, i % columns);
            Complex32::new(at.x as f32, at.y as f32)
        };
        Image {
            rows,
            columns,
            pixels: (0..rows * columns).map(value).collect(),
        }
    }

    #[test]
    fn rotated_mirrored_and_shifted_grids_map_to_the_same_points() {
        let image: ImageGrid = "x=-3:5:1,y=2:7:1,z=4".parse().unwrap();
        let pixels = places(&image);
        let (x, y) = (DVec3::X, DVec3::Y);
        let mut turns = std::collections::BTreeSet::new();
        for (across, up) in [
            (x, y),
            (-x, y),
            (x, -y),
            (-x, -y),
            (y, x),
            (-y, x),
            (y, -x),
            (-y, -x),
        ] {
            // Part of the reference lies outside the image.
            let reference = ImageGrid {
                origin_m: DVec3::new(1.0, 4.0, 4.0),
                x_axis: across,
                y_axis: up,
                ..("x=-2:4:1,y=-3:2:1".parse::<ImageGrid>().unwrap())
            };
            let frame = SceneFrame::Local;
            let lattice = Lattice::of((&image, &frame), (&reference, &frame)).unwrap();
            turns.insert(lattice.turn());
            let on = OnLattice {
                image: Box::new(&pixels),
                lattice,
                size: (reference.rows.count, reference.columns.count),
            };
            let expected = places(&reference);
            for place in on.places() {
                let found = on.window(&place).unwrap();
                for (i, z) in found.pixels.iter().enumerate() {
                    let row = place[0].start + i / found.columns;
                    let column = place[1].start + i % found.columns;
                    let at = reference.position_m(row, column);
                    let inside = (-3.0..5.0).contains(&at.x) && (2.0..7.0).contains(&at.y);
                    match inside {
                        true => assert_eq!(*z, expected.pixels[row * expected.columns + column]),
                        false => assert!(z.is_nan(), "{at}"),
                    }
                }
            }
        }
        assert_eq!(turns.len(), 6, "{turns:?}");
        // A difference of 1e-7 of a 1 m pixel is within tolerance; a larger one is not.
        for (shift, same) in [(5e-8, true), (2e-7, false)] {
            let shifted = ImageGrid {
                origin_m: image.origin_m + DVec3::new(shift, 0.0, 0.0),
                ..image.clone()
            };
            let raised = ImageGrid {
                origin_m: image.origin_m + DVec3::new(0.0, 0.0, shift),
                ..image.clone()
            };
            for other in [shifted, raised] {
                let frame = SceneFrame::Local;
                let found = Lattice::of((&image, &frame), (&other, &frame));
                assert_eq!(found.is_some(), same, "{shift}");
            }
        }
    }
}
