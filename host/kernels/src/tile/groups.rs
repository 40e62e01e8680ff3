//! A tile in groups of 16 pixels, and where these lie.

use num_complex::Complex32;

use super::shape::Shape;
use crate::lanes::{GROUP, Kernel, Lanes};

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

/// Where the pixels of a group lie from its middle.
pub(super) struct Offsets {
    pub(super) along: [f32; GROUP],
    pub(super) across: [f32; GROUP],
    /// What changes across a group are times: of a row of 16 the square along it, of a block the offset across.
    pub(super) second: [f32; GROUP],
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
        let across = std::array::from_fn(|lane| ((lane / shape.along) as f64 - half_across) as f32);
        Self {
            line: power(4) / power(2),
            second: match shape.across() {
                1 => along.map(|x| x * x),
                _ => across,
            },
            across,
            along,
        }
    }
}
