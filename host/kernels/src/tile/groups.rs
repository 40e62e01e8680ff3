//! A tile in groups of 16 pixels: where they lie, and what the places of their pixels follow from.

use num_complex::Complex32;

use super::expansion::Expansion;
use super::shape::Shape;
use crate::lanes::{GROUP, Kernel, Lanes};
use crate::phasor::{ROUND, ROUND_F64};

/// Those of a group's pixels, in cache lines of their own.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Sums {
    pub(super) re: [f32; GROUP],
    pub(super) im: [f32; GROUP],
}

impl Sums {
    pub(super) const ZERO: Self = Self {
        re: [0.0; GROUP],
        im: [0.0; GROUP],
    };
}

/// Groups of a column of groups: what their pixels' places follow from.
#[derive(Default)]
pub(super) struct Rows {
    /// Groups that share a window.
    pub(super) run: usize,
    /// From the tile's middle, in pixels; and the middle of those that share a window.
    middle: Vec<f64>,
    run_middle: Vec<f64>,
    /// The window's first piece.
    pub(super) base: Vec<u32>,
    /// Place of the group's middle from the window's.
    at: Vec<f32>,
    /// Change of place along the group.
    along: Vec<f32>,
    /// Change across it; of a row of 16 half the change of the change along it.
    across: Vec<f32>,
    /// Of the part of a group that is worked on at once: the first of the 8 pieces that it reads from, and by how much places are to be
    /// shifted to count from there ([`Self::of_part`]).
    short: Vec<u32>,
    shift: Vec<f32>,
}

/// What the places of a group's pixels follow from, and the 8 pieces of a part of it.
pub(super) struct RowPart {
    pub(super) place: [f32; 3],
    pub(super) first: u32,
    pub(super) shift: f32,
}

/// A tile in groups of one shape, column by column of groups.
#[derive(Clone, Copy, Default)]
pub(super) struct Groups {
    pub(super) shape: Shape,
    /// Pixels along the groups' first axis and their second.
    pub(super) sides: [usize; 2],
    /// Groups along them.
    pub(super) counts: [usize; 2],
}

impl Groups {
    /// Of a tile of so many columns and rows.
    pub(super) fn new(shape: Shape, sides: [usize; 2]) -> Self {
        let sides = match shape.transposed {
            false => sides,
            true => [sides[1], sides[0]],
        };
        Self {
            shape,
            sides,
            counts: [
                sides[0].div_ceil(shape.along),
                sides[1].div_ceil(shape.across()),
            ],
        }
    }

    pub(super) fn count(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    /// From the tile's middle to that of the group at `index` of an axis, pixels.
    #[inline(always)]
    pub(super) fn middle(&self, axis: usize, index: usize) -> f64 {
        let pixels = [self.shape.along, self.shape.across()][axis];
        (index * pixels) as f64 + (pixels as f64 - self.sides[axis] as f64) / 2.0
    }

    /// Farthest from the tile's middle that a group reaches along the axes, pixels.
    pub(super) fn extent(&self) -> [f64; 2] {
        let pixels = [self.shape.along, self.shape.across()];
        [0, 1].map(|axis| (self.counts[axis] * pixels[axis]) as f64 - self.sides[axis] as f64 / 2.0)
    }
}

/// Adds groups' sums to the pixels of their tile, row by row.
pub(super) struct Deliver<'a> {
    pub(super) tile: Groups,
    pub(super) parts: &'a [Sums],
    pub(super) sums: &'a mut [Complex32],
}

impl Kernel for Deliver<'_> {
    type Output = ();

    /// Plain loops: what the lanes' instructions make of them.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { tile, parts, sums } = self;
        let (shape, [_, down]) = (tile.shape, tile.counts);
        let columns = tile.sides[usize::from(shape.transposed)];
        for (group, Sums { re, im }) in parts.iter().enumerate() {
            let (first, second) = (group / down * shape.along, group % down * shape.across());
            let count = shape.along.min(tile.sides[0] - first);
            let lines = re.chunks(shape.along).zip(im.chunks(shape.along));
            for ((re, im), second) in lines.zip(second..tile.sides[1]) {
                let both = re.iter().zip(im);
                if shape.transposed {
                    let column = sums[first * columns + second..].iter_mut();
                    for (sum, (re, im)) in column.step_by(columns).take(count).zip(both) {
                        *sum += Complex32::new(*re, *im);
                    }
                } else {
                    let row = &mut sums[second * columns + first..][..count];
                    for (sum, (re, im)) in row.iter_mut().zip(both) {
                        *sum += Complex32::new(*re, *im);
                    }
                }
            }
        }
    }
}

impl Rows {
    pub(super) fn resize(&mut self, tile: &Groups, run: usize) {
        let count = tile.counts[1];
        self.run = run;
        self.middle.clear();
        self.middle.extend((0..count).map(|j| tile.middle(1, j)));
        self.run_middle.clear();
        for run in self.middle.chunks(run) {
            let middle = (run[0] + run[run.len() - 1]) / 2.0;
            self.run_middle.extend(run.iter().map(|_| middle));
        }
        self.base.resize(count, 0);
        self.short.resize(count, 0);
        for values in [
            &mut self.at,
            &mut self.along,
            &mut self.across,
            &mut self.shift,
        ] {
            values.resize(count, 0.0);
        }
    }

    /// Of the part of each group whose middle lies at `first` and `second` from the group's: 8 pieces about the place of that middle, `bend`
    /// beside what is linear. Of a row of 16 `second` is none.
    ///
    /// The shift is added after rounding: halves are rounded to even numbers, whichever piece is counted from.
    #[inline(always)]
    pub(super) fn of_part(&mut self, first: f32, second: Option<f32>, bend: f32) {
        let count = self.base.len();
        let (at, along) = (&self.at[..count], &self.along[..count]);
        let (across, base) = (&self.across[..count], &self.base[..count]);
        let (short, shift) = (&mut self.short[..count], &mut self.shift[..count]);
        for row in 0..count {
            let place = match second {
                None => at[row] + first * (along[row] + first * across[row]),
                Some(second) => at[row] + bend + first * along[row] + second * across[row],
            };
            let pattern = place + ROUND;
            shift[row] = ROUND - pattern;
            short[row] = base[row].wrapping_add(pattern.to_bits().wrapping_sub(ROUND.to_bits()));
        }
    }

    /// Place of the middle, change along and change across, of the group of a row.
    #[inline(always)]
    pub(super) fn place(&self, row: usize) -> [f32; 3] {
        [self.at[row], self.along[row], self.across[row]]
    }

    /// Of all rows, with the parts that were asked for last.
    #[inline(always)]
    pub(super) fn parts(&self) -> impl Iterator<Item = RowPart> {
        let places = self.at.iter().zip(&self.along).zip(&self.across);
        let shorts = self.short.iter().zip(&self.shift);
        places
            .zip(shorts)
            .map(|(((at, along), across), (first, shift))| RowPart {
                place: [*at, *along, *across],
                first: *first,
                shift: *shift,
            })
    }

    /// For the groups whose middles are `i` pixels along, where the tile's middle has `place` among the pieces.
    #[inline(always)]
    pub(super) fn of_column(
        &mut self,
        e: &Expansion,
        place: f64,
        i: f64,
        line: Option<f64>,
        reach: f64,
    ) {
        let ([c10, c01], [c20, c11, c02], [c30, c21, c12, c03]) = (e.first, e.second, e.third);
        let a0 = place + i * (c10 + i * (c20 + i * c30));
        let a1 = c01 + i * (c11 + i * c21);
        let a2 = c02 + i * c12;
        let b0 = c10 + i * (2.0 * c20 + 3.0 * i * c30) + line.unwrap_or(0.0) * c30;
        let b1 = c11 + 2.0 * i * c21;
        let (d0, d1, d2) = match line {
            Some(_) => (c20 + 3.0 * i * c30, c21, 0.0),
            None => (a1, 2.0 * a2, 3.0 * c03),
        };
        let count = self.middle.len();
        let Self {
            middle,
            run_middle,
            base,
            at,
            along,
            across,
            ..
        } = self;
        let run_middle = &run_middle[..count];
        let (base, at) = (&mut base[..count], &mut at[..count]);
        let (along, across) = (&mut along[..count], &mut across[..count]);
        for row in 0..count {
            let j = middle[row];
            let a = c03.mul_add(j, a2).mul_add(j, a1).mul_add(j, a0);
            let m = run_middle[row];
            let whole = c03.mul_add(m, a2).mul_add(m, a1).mul_add(m, a0);
            let whole = (whole + ROUND_F64) - ROUND_F64;
            at[row] = (a - whole) as f32;
            base[row] = (whole - reach + ROUND_F64).to_bits() as u32;
            along[row] = c12.mul_add(j, b1).mul_add(j, b0) as f32;
            across[row] = d2.mul_add(j, d1).mul_add(j, d0) as f32;
        }
    }
}

/// Where the pixels of a group lie from its middle.
pub(super) struct Offsets {
    pub(super) along: [f32; GROUP],
    pub(super) across: [f32; GROUP],
    /// What of the cube of `along` a straight line takes: in least squares.
    pub(super) line: f64,
}

impl Offsets {
    #[inline(always)]
    pub(super) fn new(shape: Shape) -> Self {
        let [half, half_across] = shape.half();
        let along = std::array::from_fn(|lane| ((lane % shape.along) as f64 - half) as f32);
        let power = |n: i32| {
            along
                .iter()
                .map(|&i: &f32| f64::from(i).powi(n))
                .sum::<f64>()
        };
        Self {
            line: power(4) / power(2),
            across: std::array::from_fn(|lane| ((lane / shape.along) as f64 - half_across) as f32),
            along,
        }
    }

    /// The middle of the pixels in some lanes.
    pub(super) fn middle(&self, lanes: std::ops::Range<usize>) -> [f32; 2] {
        let count = lanes.len() as f32;
        [&self.along, &self.across]
            .map(|offsets| offsets[lanes.clone()].iter().sum::<f32>() / count)
    }
}

/// Terms of second degree within the groups of a column, which rows of 16 have in their changes.
#[derive(Clone, Copy)]
pub(super) struct Bend([f32; 3]);

impl Bend {
    pub(super) const NONE: Self = Self([0.0; 3]);

    /// `i` pixels along from the tile's middle.
    #[inline(always)]
    pub(super) fn new(e: &Expansion, i: f64) -> Self {
        let ([c20, c11, c02], [c30, c21, c12, _]) = (e.second, e.third);
        Self([
            (c20 + 3.0 * c30 * i) as f32,
            (c11 + 2.0 * c21 * i) as f32,
            (c02 + c12 * i) as f32,
        ])
    }

    /// At a place from the group's middle.
    #[inline(always)]
    pub(super) fn at(&self, x: f32, y: f32) -> f32 {
        let [a, b, c] = self.0;
        a * (x * x) + b * (x * y) + c * (y * y)
    }
}
