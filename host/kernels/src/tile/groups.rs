//! Division of a tile into groups of 16 pixels.

use num_complex::Complex32;

use super::shape::Shape;
use crate::lanes::{GROUP, Kernel, Lanes};

/// Sums of a group's pixels, aligned to cache lines.
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

/// Groups of a tile, by columns of groups.
#[derive(Clone, Copy, Default)]
pub(super) struct Groups {
    pub(super) shape: Shape,
    /// Pixels along the groups' first and second axis.
    pub(super) sides: [usize; 2],
    /// Groups along both axes.
    pub(super) counts: [usize; 2],
}

impl Groups {
    /// Divide a tile of `sides` columns and rows.
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

    /// Offset of group `index` of an axis from the tile's centre, pixels.
    #[inline(always)]
    pub(super) fn middle(&self, axis: usize, index: usize) -> f64 {
        let pixels = [self.shape.along, self.shape.across()][axis];
        (index * pixels) as f64 + (pixels as f64 - self.sides[axis] as f64) / 2.0
    }

    /// Largest offset of a group's pixel from the tile's centre along the axes, pixels.
    pub(super) fn extent(&self) -> [f64; 2] {
        let pixels = [self.shape.along, self.shape.across()];
        [0, 1].map(|axis| (self.counts[axis] * pixels[axis]) as f64 - self.sides[axis] as f64 / 2.0)
    }
}

/// Add the sums of groups to the pixels of the tile, row by row.
pub(super) struct Deliver<'a> {
    pub(super) tile: Groups,
    pub(super) parts: &'a [Sums],
    pub(super) sums: &'a mut [Complex32],
}

impl Kernel for Deliver<'_> {
    type Output = ();

    /// Scalar loops, vectorised by the compiler.
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

/// Offsets of a group's pixels from its centre.
pub(super) struct Offsets {
    pub(super) along: [f32; GROUP],
    pub(super) across: [f32; GROUP],
    /// Factor of the gradient across a group: the squared offset along for rows of 16, the offset across for blocks.
    pub(super) second: [f32; GROUP],
    /// Least-squares slope of the cube of `along`.
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
