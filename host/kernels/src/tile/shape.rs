//! Shape of the groups of 16 pixels of a tile.
//!
//! A group looks up its pixels' values in a window of bins, so its pixels should have nearly the same range. That holds for a row
//! across the beam; a block of 4 x 4 is a compromise for any direction. One shape is chosen for all pulses of a call, from
//! their path gradients over the tile.

use super::expansion::Expansion;
use crate::lanes::GROUP;

/// Shape of a group: `along` pixels along one axis of the tile, and 16 / `along` rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Shape {
    /// Pixels along the first axis: 16, 8 or 4.
    pub(super) along: usize,
    /// Whether the first axis runs along the tile's columns instead of its rows.
    pub(super) transposed: bool,
}

/// Length of the recurrences of positions and carriers (`turning`), groups; rounding accumulates to
/// [`PHASOR_RMS`](super::PHASOR_RMS).
pub(super) const TURNED: usize = 16;

/// Largest number of groups that share a window; more would save nothing.
const MAX_RUN: usize = 16;

/// Largest distance of pixels from the midpoint of a register's pixels for a window of 8 bins, less one bin for rounding
/// of the midpoint.
pub(super) const SHORT_REACH: f64 = 2.9;

/// As [`SHORT_REACH`], for a window of 4 bins.
pub(super) const QUARTER_REACH: f64 = 0.9;

/// Lookup window of a group of 16 pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Window {
    #[default]
    /// 16 bins in one register.
    Narrow,
    /// 32 bins in two registers.
    Wide,
    /// No window: each value is gathered from memory.
    Any,
}

impl Window {
    /// Largest distance of a pixel from its group's centre, less one bin for rounding of the centre.
    pub(super) fn reach(self) -> f64 {
        match self {
            Self::Narrow => 6.9,
            Self::Wide => 14.9,
            Self::Any => f64::INFINITY,
        }
    }
}

impl Shape {
    /// All shapes, in ascending order of cost.
    const ALL: [Self; 6] = [
        Self::new(16, false),
        Self::new(16, true),
        Self::new(8, false),
        Self::new(8, true),
        Self::new(4, false),
        Self::new(4, true),
    ];

    /// Row of 16 pixels.
    #[cfg(test)]
    pub(super) const ROW: Self = Self::ALL[0];

    const fn new(along: usize, transposed: bool) -> Self {
        Self { along, transposed }
    }

    /// Number of rows of the group.
    pub(super) fn across(&self) -> usize {
        GROUP / self.along
    }

    /// Largest offset of a pixel from the group's centre along its axes, pixels.
    pub(super) fn half(&self) -> [f64; 2] {
        [self.along, self.across()].map(|count| (count - 1) as f64 / 2.0)
    }

    /// Largest distance in bins of a pixel from the midpoint of the `lanes` pixels in a register, for path gradients of
    /// `slopes` bins along the shape's axes.
    pub(super) fn part_reach(&self, slopes: [f64; 2], lanes: usize) -> f64 {
        let along = lanes.min(self.along);
        let half = [along, lanes / along].map(|count| (count - 1) as f64 / 2.0);
        half[0] * slopes[0] + half[1] * slopes[1]
    }

    /// Path gradients per column and row, mapped to the shape's axes.
    pub(super) fn slopes(&self, steepest: [f64; 2]) -> [f64; 2] {
        match self.transposed {
            false => steepest,
            true => [steepest[1], steepest[0]],
        }
    }

    /// Cheapest shape for pulses with path gradients of at most `steepest` bins per column and row, its
    /// window, and the number of adjacent groups that can share one.
    pub(super) fn of(steepest: [f64; 2]) -> (Self, Window, usize) {
        let reach = |shape: &Self| shape.part_reach(shape.slopes(steepest), GROUP);
        for window in [Window::Narrow, Window::Wide] {
            if let Some(shape) = Self::ALL.iter().find(|s| reach(s) <= window.reach()) {
                let left = window.reach() - reach(shape);
                let each = shape.slopes(steepest)[1] * shape.across() as f64;
                let run = (1.0 + 2.0 * left / each.max(1e-3)) as usize;
                // Groups are processed in pairs.
                let run = if run > 1 { run.min(MAX_RUN) & !1 } else { 1 };
                return (*shape, window, run);
            }
        }
        (Self::ALL[0], Window::Any, 1)
    }
}

/// Largest path gradient over a tile of these sides, bins per column and per row.
pub(super) fn steepest<'a>(
    expansions: impl Iterator<Item = &'a Expansion>,
    [columns, rows]: [usize; 2],
) -> [f64; 2] {
    let (i, j) = (columns as f64 / 2.0, rows as f64 / 2.0);
    expansions.fold([0.0f64; 2], |most, expansion| {
        let own = expansion.steepest(i, j);
        [most[0].max(own[0]), most[1].max(own[1])]
    })
}

impl Shape {
    /// Error of the third-degree terms in groups of this shape, for a tile of `rows` rows: RMS over the pixels of the
    /// position error per unit of each coefficient; the magnitudes add.
    ///
    /// With a group's centre `j` rows from the tile's, and a pixel at `a` and `b` from it: a row of 16 loses only the part of
    /// `a^3` that is not linear; a block loses `j (c21 a^2 + 2 c12 a b + 3 c03 b^2)` and the cubic form of `a` and `b`. For
    /// phases, blocks of groups lose the part of `j^2 (c12 a + 3 c03 b)` that is not linear in `j`.
    pub(super) fn left_out(&self, rows: usize) -> [f64; 4] {
        let ([a2, a4, a6], [b2, b4, b6]) = (even_moments(self.along), even_moments(self.across()));
        let [run2, run4, _] = even_moments(TURNED);
        let pixels = self.across() as f64;
        let bent = pixels * pixels * (run4 - run2 * run2).sqrt();
        if self.across() == 1 {
            let cubed = (a6 - a4 * a4 / a2).max(0.0).sqrt();
            return [cubed, 0.0, bent * a2.sqrt(), 0.0];
        }
        let j = rows as f64 / 12f64.sqrt();
        [
            a6.sqrt(),
            j * a4.sqrt() + (a4 * b2).sqrt(),
            j * 2.0 * (a2 * b2).sqrt() + (a2 * b4).sqrt() + bent * a2.sqrt(),
            j * 3.0 * b4.sqrt() + b6.sqrt() + bent * 3.0 * b2.sqrt(),
        ]
    }
}

/// Mean second, fourth and sixth power of `count` unit-spaced positions about their centre.
fn even_moments(count: usize) -> [f64; 3] {
    let half = (count as f64 - 1.0) / 2.0;
    [2, 4, 6].map(|power| {
        let places = (0..count).map(|i| (i as f64 - half).powi(power));
        places.sum::<f64>() / count as f64
    })
}

/// RMS error of a float32 position, bins: numbers up to 8, 1.4e-7 each, are rounded up to 16
/// times along a block.
pub const PLACE_RMS: f64 = 6e-7;
