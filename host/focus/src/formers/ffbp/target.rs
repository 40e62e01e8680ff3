//! The pixels that are wanted of a patch.

use std::ops::Range;

use num_complex::Complex32;

use crate::patch::{Rectangle, Segment};

/// The pixels of a first patch that are wanted.
pub(super) struct Target<'a, 'b> {
    pub(super) segments: &'a mut [Segment<'b>],
}

impl Target<'_, '_> {
    /// Whether any of them is in `part`.
    pub(super) fn wants(&self, part: &Rectangle) -> bool {
        self.segments.iter().any(|segment| {
            let rows = part.row..part.row + part.size.rows;
            rows.contains(&segment.row) && !common(segment, part).is_empty()
        })
    }

    /// Those in `part`: row, column and pixel.
    pub(super) fn each(
        &mut self,
        part: Rectangle,
        mut of: impl FnMut(usize, usize, &mut Complex32),
    ) {
        let rows = part.row..part.row + part.size.rows;
        for segment in self.segments.iter_mut() {
            if !rows.contains(&segment.row) {
                continue;
            }
            for column in common(segment, &part) {
                let pixel = &mut segment.pixels[column - segment.column];
                of(segment.row, column, pixel);
            }
        }
    }
}

/// Columns that a segment and a rectangle share.
fn common(segment: &Segment, part: &Rectangle) -> Range<usize> {
    let end = segment.column + segment.pixels.len();
    segment.column.max(part.column)..end.min(part.column + part.size.columns)
}
