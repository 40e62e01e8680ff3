//! Input image of any format, in coordinates of its grid or in pixels.

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail};
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::{Image, ImageSource};
use subaperture::images::{OpenImage, Pair, Pixels, Values};
use subaperture::quality::response::{Carrier, Direction, Geometry, Response, ResponseError};
use subaperture::resolution::support::RecordedLooks;
use subaperture::signal::window::Window;

use crate::args::At;
use crate::commands::stored;
use crate::config::Session;
use crate::failure::Usage;
use crate::text;

/// Image with its pixel geometry and band.
pub(super) struct Source {
    /// Path as given by the user.
    pub(super) name: String,
    pub(super) image: OpenImage,
    pub(super) grid: ImageGrid,
    /// Windows of fast and slow time.
    pub(super) windows: Option<[Window; 2]>,
    /// Viewing geometry of the image.
    pub(super) carrier: Option<Carrier>,
    /// Representative pulses of the recording.
    pub(super) looks: Option<RecordedLooks>,
    /// Record of a product.
    pub(super) metadata: Option<Value>,
    axes: Axes,
}

/// Meaning of grid coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axes {
    /// Column and row indices.
    Pixels,
    /// Metres in the plane of a SICD or SIDD, from its reference point along columns and rows.
    Plane,
    /// Metres in the scene frame, or angle and range.
    Scene,
}

impl Source {
    /// Opens an image of any format.
    pub(super) fn open(session: &Session, path: &Path) -> anyhow::Result<Self> {
        let image = stored::open(session, path)?;
        let is_product = matches!(image.pixels, Pixels::Product(_));
        let record = image.record.clone().filter(|_| is_product);
        let record_value = record.clone().unwrap_or_default();
        let settings = &record_value["settings"];
        let window = |key: &str| settings[key].as_str().and_then(|text| text.parse().ok());
        let seen = Geometry::deserialize(&record_value["collection"]);
        let frame = match image.grid() {
            Some(_) if image.rows_down() => Axes::Plane,
            Some(_) => Axes::Scene,
            None => Axes::Pixels,
        };
        Ok(Self {
            name: path.display().to_string(),
            carrier: seen.ok().map(|seen| Carrier::of(&seen)),
            windows: window("window").zip(window("slow_window")).map(Into::into),
            looks: RecordedLooks::deserialize(&record_value["support"]).ok(),
            grid: match image.grid() {
                Some((grid, _)) => grid.clone(),
                None => image.pixel_grid(),
            },
            metadata: record,
            axes: frame,
            image,
        })
    }

    /// Pixels of the image.
    pub(super) fn pixels(&self) -> &dyn ImageSource {
        &self.image.pixels
    }

    /// Whether some pixels have no value: in an image in progress, and around a map.
    pub(super) fn is_partial(&self) -> bool {
        matches!(self.image.pixels, Pixels::Unfinished(_) | Pixels::Map(_))
    }

    /// Reason why point responses cannot be measured, if any.
    pub(super) fn without_phase(&self) -> Option<String> {
        (self.image.values != Values::Complex).then(|| {
            format!(
                "{}: point responses need complex values, found {}",
                self.name, self.image.values
            )
        })
    }

    /// Convert a typed coordinate across, degrees for a polar grid, to grid units.
    pub(super) fn across(&self, typed: f64) -> f64 {
        match self.grid.polar {
            true => typed.to_radians(),
            false => typed,
        }
    }

    /// Name of the direction of a cut.
    pub(super) fn along(&self, along: Direction) -> &'static str {
        match along {
            Direction::X if self.axes != Axes::Scene => "column",
            Direction::Y if self.axes != Axes::Scene => "row",
            Direction::X if self.grid.polar => "angle",
            Direction::Y if self.grid.polar => "range",
            Direction::X => self.grid.scene_axes()[0].name,
            Direction::Y => self.grid.scene_axes()[1].name,
            _ => along.name(),
        }
    }

    /// Unit of lengths along a cut, and the factor to it from grid units.
    pub(super) fn unit(&self, along: Direction) -> (&'static str, f64) {
        match along {
            _ if self.axes == Axes::Pixels => ("px", 1.0),
            Direction::X if self.grid.polar => ("deg", 1f64.to_degrees()),
            _ => ("m", 1.0),
        }
    }

    /// Grid coordinates, row then column, of a typed position: in the scene frame, but degrees and range on a polar
    /// grid, column and row for an array.
    pub(super) fn coordinates(&self, at: &At) -> anyhow::Result<[f64; 2]> {
        if self.axes != Axes::Scene || self.grid.polar {
            if at.z.is_some() {
                let fault = "--at: an array or a polar grid has two coordinates: leave the third number out";
                return Err(Usage(fault.to_owned()).into());
            }
            return Ok([at.y, self.across(at.x)]);
        }
        let grid = &self.grid;
        let normal = grid.x_axis.cross(grid.y_axis);
        let z_m = match at.z {
            Some(z_m) => z_m,
            // Position above or below the plane.
            None if normal.z.abs() > 1e-6 => {
                let from = DVec3::new(at.x, at.y, 0.0) - grid.origin_m.with_z(0.0);
                grid.origin_m.z - normal.dot(from) / normal.z
            }
            None => {
                let fault = "--at: the image plane is vertical, so that x and y do not define a point on it: give X,Y,Z";
                return Err(Usage(fault.to_owned()).into());
            }
        };
        Ok(grid.coordinates(DVec3::new(at.x, at.y, z_m)))
    }

    /// Add advice to the error of a point that was not measured.
    pub(super) fn explain(&self, error: ResponseError) -> anyhow::Error {
        let advice = match error {
            ResponseError::TooCoarse { .. } => {
                ", or give the recording with --from to form and measure a finely sampled chip"
            }
            _ => "",
        };
        anyhow::anyhow!("{error}{advice}")
    }

    /// Position of a measured point in the scene or in an array.
    pub(super) fn place(&self, response: &Response) -> String {
        let (row_value, column_value) = (response.row_value, response.column_value);
        match self.axes {
            Axes::Pixels => return format!("column {column_value:.3}, row {row_value:.3}"),
            Axes::Plane => {
                return format!(
                    "{column_value:.4} m along columns and {row_value:.4} m along rows from the reference point"
                );
            }
            Axes::Scene => {}
        }
        let [x, y, z] = response.position_m;
        let scene = format!("x {x:.4} m, y {y:.4} m, z {z:.4} m");
        if self.grid.polar {
            let angle = column_value.to_degrees();
            return format!("{scene} (angle {angle:.5} deg, range {row_value:.3} m)");
        }
        scene
    }

    /// Axes across and up as shown with their labels: those of the scene if the grid is aligned with it.
    pub(super) fn shown_axes(&self) -> [(String, Axis); 2] {
        let grid = &self.grid;
        let named = |across: &str, up: &str| {
            [
                (across.to_owned(), grid.columns),
                (up.to_owned(), grid.rows),
            ]
        };
        match self.axes {
            Axes::Pixels => return named("column", "row"),
            Axes::Plane => return named("along columns (m)", "along rows (m)"),
            Axes::Scene => {}
        }
        if grid.polar {
            let degrees = Axis {
                start: grid.columns.start.to_degrees(),
                step: grid.columns.step.to_degrees(),
                ..grid.columns
            };
            return [
                ("angle (deg)".to_owned(), degrees),
                ("range (m)".to_owned(), grid.rows),
            ];
        }
        let [across, up] = grid.scene_axes();
        [(across, grid.columns), (up, grid.rows)].map(|(scene, axis)| {
            // Values must ascend: on an axis opposite to the scene's they are shown negated.
            let sign = if scene.sign < 0.0 { "-" } else { "" };
            let shown = Axis {
                start: scene.sign * scene.value_m(axis.start),
                ..axis
            };
            (format!("{sign}{} (m)", scene.name), shown)
        })
    }
}

/// Two images on the same pixels, in memory.
pub(super) struct Both {
    pub(super) image: Image,
    pub(super) reference: Image,
    /// Whether values are complex; amplitudes otherwise.
    pub(super) complex: bool,
    pub(super) notes: Vec<String>,
}

impl Source {
    /// Common part of this and another image, if the budget allows: up to six times their size, mostly for registration.
    pub(super) fn both(&self, session: &Session, other: &Self) -> anyhow::Result<Both> {
        let pixels = |source: &Self| {
            let (rows, columns) = source.pixels().size();
            rows as u128 * columns as u128
        };
        let bytes = 6 * 8 * (pixels(self) + pixels(other));
        if bytes > u128::from(session.memory_bytes) {
            bail!(
                "comparing the images needs up to {}; --memory allows {}: raise --memory, measure smaller \
                 images, or use subap compare, which has no size limit",
                text::bytes(bytes),
                text::bytes(session.memory_bytes.into())
            );
        }
        let looks = [self.image.looks(), other.image.looks()];
        let looks = [looks[0].as_ref(), looks[1].as_ref()];
        let pair = Pair::new(&self.image, &other.image, looks)?;
        let read = |parts: &dyn ImageSource| {
            let (rows, columns) = parts.size();
            let read = parts.window(&[0..rows, 0..columns]);
            read.map_err(|error| anyhow::anyhow!(error))
        };
        let (image, reference) = (read(&*pair.image)?, read(&*pair.reference)?);
        let mut notes = pair.notes;
        let [image, reference] = match pair.whole {
            true => [image, reference],
            false => {
                let place = largest_common(&image, &reference).with_context(|| {
                    format!("{} and {} have no pixel in common", self.name, other.name)
                })?;
                let [rows, columns] = &place;
                if (rows.len(), columns.len()) != (reference.rows, reference.columns) {
                    notes.push(format!(
                        "compared on {} x {} pixels from row {}, column {}: the largest rectangle contained in both",
                        rows.len(),
                        columns.len(),
                        rows.start,
                        columns.start
                    ));
                }
                let part = |image: &Image| {
                    let part = image.window(&place);
                    part.map_err(|error| anyhow::anyhow!(error))
                };
                [part(&image)?, part(&reference)?]
            }
        };
        Ok(Both {
            image,
            reference,
            complex: pair.complex,
            notes,
        })
    }
}

/// Largest rectangle of pixels contained in both images; `None` if they have no pixel in common.
///
/// Row by row, the runs of common pixels above each pixel form a histogram, whose largest rectangle is found with a stack in one pass.
fn largest_common(image: &Image, reference: &Image) -> Option<[Range<usize>; 2]> {
    let columns = image.columns;
    let has = |i: usize| !image.pixels[i].is_nan() && !reference.pixels[i].is_nan();
    let mut heights = vec![0; columns + 1];
    let mut best: Option<[Range<usize>; 2]> = None;
    for row in 0..image.rows {
        for (column, height) in heights[..columns].iter_mut().enumerate() {
            *height = if has(row * columns + column) {
                *height + 1
            } else {
                0
            };
        }
        // Columns of ascending heights; the last height is 0 and closes all rectangles.
        let mut open: Vec<usize> = Vec::new();
        for column in 0..=columns {
            while let Some(&last) = open.last() {
                if heights[last] <= heights[column] {
                    break;
                }
                open.pop();
                let first = open.last().map_or(0, |before| before + 1);
                let rectangle = [row + 1 - heights[last]..row + 1, first..column];
                let area = |[rows, columns]: &[Range<usize>; 2]| rows.len() * columns.len();
                if best
                    .as_ref()
                    .is_none_or(|best| area(&rectangle) > area(best))
                {
                    best = Some(rectangle);
                }
            }
            open.push(column);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture::num_complex::Complex32;

    /// By hand: the largest rectangle without a gap is rows 1 to 3 of columns 1 to 4.
    #[test]
    fn largest_rectangle_without_gaps_is_found() {
        let picture = ["#....", ".####", "#####", ".####", ".##.#"];
        let pixels = picture.iter().flat_map(|line| line.bytes());
        let image = Image {
            rows: 5,
            columns: 5,
            pixels: pixels
                .map(|c| match c {
                    b'#' => Complex32::ONE,
                    _ => Complex32::new(f32::NAN, f32::NAN),
                })
                .collect(),
        };
        let whole = Image {
            pixels: vec![Complex32::ONE; 25],
            ..image.clone()
        };
        assert_eq!(largest_common(&image, &whole), Some([1..4, 1..5]));
        assert_eq!(largest_common(&whole, &image), Some([1..4, 1..5]));
        assert_eq!(largest_common(&whole, &whole), Some([0..5, 0..5]));
        let empty = Image {
            pixels: vec![Complex32::new(f32::NAN, 0.0); 25],
            ..whole.clone()
        };
        assert_eq!(largest_common(&whole, &empty), None);
    }
}
