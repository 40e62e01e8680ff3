//! Live image in display levels.

/// Maximum number of pixels of a picture. Larger images must be reduced first.
pub const MAX_PIXELS: usize = 1 << 20;

/// Image in levels, rows by ascending y.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Number of pixels per row.
    pub columns: usize,
    /// x of the first and last columns, metres.
    pub x_m: [f64; 2],
    /// y of the first and last rows, metres.
    pub y_m: [f64; 2],
    /// Level of each pixel, `20 log10` of its magnitude, dB; row by row.
    pub levels_db: Vec<f32>,
    /// Number of pulses in the image.
    pub pulses: u64,
}

impl Picture {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.levels_db.len() / self.columns.max(1)
    }

    /// Whether all rows have equal length and there are at most [`MAX_PIXELS`] pixels.
    pub fn is_whole(&self) -> bool {
        let count = self.levels_db.len();
        self.columns > 0 && count.is_multiple_of(self.columns) && count <= MAX_PIXELS
    }

    /// Highest finite level, dB; `None` if there is none.
    pub fn highest_db(&self) -> Option<f32> {
        let finite = self.levels_db.iter().copied().filter(|db| db.is_finite());
        finite.reduce(f32::max)
    }
}
