//! Numbered marks on a picture, such as detected targets.

use super::canvas::{Anchor, Canvas, Rgb, Typeface};

/// Colour of marks: readable on black and on white.
const COLOUR: Rgb = [255, 120, 0];

/// Half the side of a mark's square, and its line width, pixels.
const HALF: usize = 9;
const WIDTH: usize = 2;

/// Font size of labels, and the space around them, pixels.
const LABEL_PX: f32 = 13.0;
const PAD: f32 = 3.0;

/// Mark at a grid coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Coordinates of row and column, as in [`subaperture_model::geometry::ImageGrid::coordinates`].
    pub at: [f64; 2],
    /// Label of a few characters.
    pub label: String,
}

/// Draw marks at page positions within a plot of `width` x `height` pixels at `(x, y)`. Marks outside are not drawn.
pub(super) fn draw(
    canvas: &mut Canvas,
    marks: &[([f64; 2], &str)],
    (x, y): (usize, usize),
    (width, height): (usize, usize),
) {
    let font = Typeface::sans(LABEL_PX, true);
    for &([right, down], label) in marks {
        let inside = |part: f64| (0.0..=1.0).contains(&part);
        if !(inside(right) && inside(down)) {
            continue;
        }
        let at = |part: f64, from: usize, side: usize| from + (part * side as f64).round() as usize;
        let (centre_x, centre_y) = (at(right, x, width), at(down, y, height));
        let span = |centre: usize, from: usize, side: usize| {
            let first = centre.saturating_sub(HALF).max(from);
            (first, (centre + HALF).min(from + side) - first)
        };
        let (left, across) = span(centre_x, x, width);
        let (top, tall) = span(centre_y, y, height);
        for edge in [top, (top + tall).saturating_sub(WIDTH)] {
            canvas.fill(left, edge, across, WIDTH, COLOUR);
        }
        for edge in [left, (left + across).saturating_sub(WIDTH)] {
            canvas.fill(edge, top, WIDTH, tall, COLOUR);
        }
        let room = (font.width(label) + 2.0 * PAD).ceil() as usize;
        let line = (LABEL_PX + 2.0 * PAD) as usize;
        // To the right of the square, or to the left where the plot ends.
        let label_x = match left + across + room <= x + width {
            true => left + across,
            false => left.saturating_sub(room),
        };
        canvas.fill(label_x, top, room, line, COLOUR);
        let (text_x, text_y) = (label_x as f32 + PAD, top as f32 + LABEL_PX);
        canvas.text(text_x, text_y, Anchor::Left, &font, label);
    }
}
