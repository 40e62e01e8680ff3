//! Coloured dots on a picture: values of points, such as displacements.

use super::canvas::{Canvas, INK, Rgb};
use super::colours::Colours;
use super::scale::Levels;

/// Radius of a dot, and the width of its edge, pixels.
const RADIUS: f64 = 6.0;
const EDGE: f64 = 1.0;

/// Colour of dots without a value; not a colour of viridis.
const VALUELESS: Rgb = [214, 40, 40];

/// Dots over a picture. The colour bar shows their values in place of the picture's levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Dots {
    /// Dots; later ones cover earlier ones.
    pub dots: Vec<Dot>,
    /// Values of the lowest and highest colour; values outside have the colour of the end.
    pub range: (f64, f64),
    /// Short unit of the values, drawn below the colour bar.
    pub unit: String,
    /// Colour map of the values.
    pub colours: Colours,
}

/// Dot at a grid coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dot {
    /// Coordinates of row and column, as in [`subaperture_model::geometry::ImageGrid::coordinates`].
    pub at: [f64; 2],
    /// Value; NaN is drawn as a red ring.
    pub value: f64,
}

impl Dots {
    /// Levels of the colour bar.
    pub(super) fn levels(&self) -> Levels {
        Levels {
            bottom: self.range.0,
            top: self.range.1,
            marks_above: false,
        }
    }

    /// Error text if the range is invalid.
    pub(super) fn fault(&self) -> Option<String> {
        let (bottom, top) = self.range;
        let sound = bottom.is_finite() && top.is_finite() && bottom < top;
        (!sound).then(|| {
            format!("dots: expected a finite range with top above bottom, found {bottom} to {top}")
        })
    }

    /// Draw the dots at page positions `places` (fractions of the plot, rightwards and downwards) in a plot of `width` x `height` pixels at `(x, y)`.
    pub(super) fn draw(
        &self,
        canvas: &mut Canvas,
        places: &[[f64; 2]],
        (x, y): (usize, usize),
        (width, height): (usize, usize),
    ) {
        let (low, high) = self.range;
        for (dot, &[right, down]) in self.dots.iter().zip(places) {
            if !([right, down].iter().all(|part| (0.0..=1.0).contains(part))) {
                continue;
            }
            let centre = [
                x as f64 + right * width as f64,
                y as f64 + down * height as f64,
            ];
            let colour =
                (!dot.value.is_nan()).then(|| self.colours.at((dot.value - low) / (high - low)));
            let corner = centre.map(|v| (v - RADIUS - 1.0).floor() as i64);
            let side = (2.0 * RADIUS) as i64 + 3;
            for (row, column) in (0..side).flat_map(|r| (0..side).map(move |c| (r, c))) {
                let [across, up] = [corner[0] + column, corner[1] + row];
                let off = (across as f64 + 0.5 - centre[0]).hypot(up as f64 + 0.5 - centre[1]);
                let inside = |radius: f64| (radius + 0.5 - off).clamp(0.0, 1.0);
                match colour {
                    Some(colour) => {
                        canvas.mix(across, up, INK, inside(RADIUS) as f32);
                        canvas.mix(across, up, colour, inside(RADIUS - EDGE) as f32);
                    }
                    None => {
                        let ring = inside(RADIUS) - inside(RADIUS - 2.0 * EDGE);
                        canvas.mix(across, up, VALUELESS, ring as f32);
                    }
                }
            }
        }
    }
}
