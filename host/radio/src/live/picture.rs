//! An image as it forms.

/// Pixels that a picture has at most: what is larger is to be reduced first.
pub const MOST_PIXELS: usize = 1 << 20;

/// An image in levels, rows of y ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels a row.
    pub columns: usize,
    /// Where the outermost columns are, metres.
    pub x_m: [f64; 2],
    /// Where the outermost rows are, metres.
    pub y_m: [f64; 2],
    /// Level of each pixel, 20 log10 of its magnitude, a row after the other.
    pub levels_db: Vec<f32>,
    /// Pulses that it is of.
    pub pulses: u64,
}

impl Picture {
    /// Rows.
    pub fn rows(&self) -> usize {
        self.levels_db.len() / self.columns.max(1)
    }

    /// Whether it has rows of equal length, and no more pixels than are kept.
    pub fn is_whole(&self) -> bool {
        let count = self.levels_db.len();
        self.columns > 0 && count.is_multiple_of(self.columns) && count <= MOST_PIXELS
    }

    /// Its highest level, dB; `None` without one.
    pub fn highest_db(&self) -> Option<f32> {
        let finite = self.levels_db.iter().copied().filter(|db| db.is_finite());
        finite.reduce(f32::max)
    }
}
