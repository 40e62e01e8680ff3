//! How the pixels of a tile are taken 16 at a time.
//!
//! A group reads its pixels' values from a window of bins, so its pixels should be seen at nearly the same range. Those of a row are,
//! if the row lies across the beam; a block of 4 x 4 is from everywhere, less so. The shape is chosen for the pulses of a call together, from
//! how fast their paths change over the tile.

use super::expansion::Expansion;
use crate::lanes::GROUP;

/// A group's pixels: so many along one axis of the tile, and as many rows of them as make 16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Shape {
    /// 16, 8 or 4.
    pub(super) along: usize,
    /// Whether that axis is the tile's columns' (pixels of a column), not its rows'.
    pub(super) transposed: bool,
}

/// Groups along which places and carriers are found from those before (`turning`): roundings add up to
/// [`PHASOR_RMS`](super::PHASOR_RMS).
pub(super) const TURNED: usize = 16;

/// Groups that share a window, at most: more would save nothing.
const MOST_RUN: usize = 16;

/// Bins that pixels may lie from the middle of those that are worked on at once, so that 8 bins hold them, less the one that the middle is
/// rounded by.
pub(super) const SHORT_REACH: f64 = 2.9;

/// The same so that 4 bins hold them.
pub(super) const QUARTER_REACH: f64 = 0.9;

/// Bins that a group of 16 pixels reads from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Window {
    #[default]
    /// 16 bins, looked up in a register.
    Narrow,
    /// 32 bins, in two.
    Wide,
    /// Any: each value is read from memory.
    Any,
}

impl Window {
    /// Bins that a pixel may lie from the middle of its group, less the one that the middle is rounded by.
    pub(super) fn reach(self) -> f64 {
        match self {
            Self::Narrow => 6.9,
            Self::Wide => 14.9,
            Self::Any => f64::INFINITY,
        }
    }
}

impl Shape {
    /// All of them, those first that take fewer operations.
    const ALL: [Self; 6] = [
        Self::new(16, false),
        Self::new(16, true),
        Self::new(8, false),
        Self::new(8, true),
        Self::new(4, false),
        Self::new(4, true),
    ];

    /// A row of 16.
    #[cfg(test)]
    pub(super) const ROW: Self = Self::ALL[0];

    const fn new(along: usize, transposed: bool) -> Self {
        Self { along, transposed }
    }

    /// Rows of the group's pixels.
    pub(super) fn across(&self) -> usize {
        GROUP / self.along
    }

    /// Farthest that a pixel lies from the group's middle along its axes.
    pub(super) fn half(&self) -> [f64; 2] {
        [self.along, self.across()].map(|count| (count - 1) as f64 / 2.0)
    }

    /// Bins that a pixel may lie from the middle of the `lanes` pixels of a group that are worked on at once, where paths change at
    /// most by so many bins along the shape's axes.
    pub(super) fn part_reach(&self, slopes: [f64; 2], lanes: usize) -> f64 {
        let along = lanes.min(self.along);
        let half = [along, lanes / along].map(|count| (count - 1) as f64 / 2.0);
        half[0] * slopes[0] + half[1] * slopes[1]
    }

    /// Changes of paths a column and a row, along the shape's axes.
    pub(super) fn slopes(&self, steepest: [f64; 2]) -> [f64; 2] {
        match self.transposed {
            false => steepest,
            true => [steepest[1], steepest[0]],
        }
    }

    /// The shape of the least work for pulses whose paths change at most by so many bins a column and a row; the window
    /// that it needs, and how many groups, one beside another across, can share one.
    pub(super) fn of(steepest: [f64; 2]) -> (Self, Window, usize) {
        let reach = |shape: &Self| shape.part_reach(shape.slopes(steepest), GROUP);
        for window in [Window::Narrow, Window::Wide] {
            if let Some(shape) = Self::ALL.iter().find(|s| reach(s) <= window.reach()) {
                let left = window.reach() - reach(shape);
                let each = shape.slopes(steepest)[1] * shape.across() as f64;
                let run = (1.0 + 2.0 * left / each.max(1e-3)) as usize;
                // They are worked on two by two.
                let run = if run > 1 { run.min(MOST_RUN) & !1 } else { 1 };
                return (*shape, window, run);
            }
        }
        (Self::ALL[0], Window::Any, 1)
    }
}

/// Steepest change of paths over a tile of these sides, bins a column and a row.
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
    /// What groups of this shape lose of the third degree, in a tile of so many rows of pixels: the root of the mean square, over its pixels, of
    /// their places' error for each of its coefficients, whose magnitudes' errors add.
    ///
    /// With a group's middle `j` rows from the tile's, and a pixel at `a` and `b` from that: a row of 16 follows all but the part of
    /// `a^3` that no straight line takes; a block loses `j (c21 a^2 + 2 c12 a b + 3 c03 b^2)` and the cubic form of `a` and `b`. Of
    /// phases, runs of groups lose what of `j^2 (c12 a + 3 c03 b)` no straight line in `j` takes.
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

/// Means of the second, fourth and sixth power of `count` places a step apart, about their middle.
fn even_moments(count: usize) -> [f64; 3] {
    let half = (count as f64 - 1.0) / 2.0;
    [2, 4, 6].map(|power| {
        let places = (0..count).map(|i| (i as f64 - half).powi(power));
        places.sum::<f64>() / count as f64
    })
}

/// Root of the mean square error of a place, bins, where it is computed in float32: numbers up to 8, 1.4e-7 each, are rounded up to 16
/// times on the way along a run.
pub const PLACE_RMS: f64 = 6e-7;
