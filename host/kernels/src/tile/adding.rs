//! Inner loop of tile backprojection: all pulses of a call onto all groups of a tile, compiled for each instruction set.

use std::marker::PhantomData;

use super::carrier_recurrence::{CarrierRecurrence, Path};
use super::expansion::Expansion;
use super::groups::{Groups, Offsets, Sums};
use super::pieces::Pieces;
use super::pulse::TilePulse;
use super::rows::Run;
use super::shape::{QUARTER_REACH, SHORT_REACH, TURNED, Window};
use crate::lanes::{GROUP, Kernel, Lanes};
use crate::phasor::{Polynomials, ROUND_F64};

/// Tile backprojection kernel.
pub(super) struct Add<'a> {
    pub(super) layout: &'a Pieces,
    pub(super) pulses: &'a [TilePulse],
    pub(super) pieces: &'a [f32],
    pub(super) expansions: &'a [Expansion],
    pub(super) window: Window,
    /// Largest path gradient along the groups' axes, bins per pixel.
    pub(super) slopes: [f64; 2],
    pub(super) tile: Groups,
    /// Blocks of groups of a column; `shared` groups use one lookup window.
    pub(super) runs: &'a mut [Run],
    pub(super) shared: usize,
    pub(super) sums: &'a mut [Sums],
}

impl Kernel for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        match self.layout.degree() {
            2 => self.of_window::<L, 3>(lanes),
            3 => self.of_window::<L, 4>(lanes),
            other => panic!("tiles are made of splines of degree 2 and 3, not {other}"),
        }
    }
}

impl Add<'_> {
    #[inline(always)]
    fn of_window<L: Lanes, const PLANES: usize>(self, lanes: L) {
        // Without register lookup, windows are useless.
        let window = if L::LOOKS_UP {
            self.window
        } else {
            Window::Any
        };
        let shape = self.tile.shape;
        let reach = match L::LIKES_SHORT {
            true => shape.part_reach(self.slopes, L::COUNT),
            false => f64::INFINITY,
        };
        let (quarter, short) = (reach <= QUARTER_REACH, reach <= SHORT_REACH);
        match (window, shape.along == GROUP) {
            (_, true) if quarter => self.add::<L, Quarter, PLANES, true>(lanes),
            (_, false) if quarter => self.add::<L, Quarter, PLANES, false>(lanes),
            (_, true) if short => self.add::<L, Short, PLANES, true>(lanes),
            (_, false) if short => self.add::<L, Short, PLANES, false>(lanes),
            (Window::Narrow, true) => self.add::<L, Narrow, PLANES, true>(lanes),
            (Window::Narrow, false) => self.add::<L, Narrow, PLANES, false>(lanes),
            (Window::Wide, true) => self.add::<L, Wide, PLANES, true>(lanes),
            (Window::Wide, false) => self.add::<L, Wide, PLANES, false>(lanes),
            (Window::Any, true) => self.add::<L, Any, PLANES, true>(lanes),
            (Window::Any, false) => self.add::<L, Any, PLANES, false>(lanes),
        }
    }

    #[inline(always)]
    fn add<L: Lanes, R: Reading, const PLANES: usize, const ROW: bool>(self, lanes: L) {
        let Self {
            layout,
            pulses,
            pieces,
            expansions,
            tile,
            runs,
            shared,
            sums,
            ..
        } = self;
        let shape = tile.shape;
        let (row, length) = (layout.row(), layout.length() as f64);
        let offsets = Offsets::new(shape);
        let phasors = Polynomials::new(lanes);
        let down = tile.counts[1];
        // Cache blocking: the sums of a column stay in L1 while all pulses are added.
        for (column, groups) in sums.chunks_exact_mut(down).enumerate() {
            let i = tile.middle(0, column);
            let each = pulses.iter().zip(expansions);
            for ((pulse, expansion), pieces) in each.zip(pieces.chunks_exact(layout.values())) {
                let planes: [&[f32]; MAX_PLANES] = std::array::from_fn(|p| match p < 2 * PLANES {
                    true => &pieces[p * row..(p + 1) * row],
                    false => &[],
                });
                // Profile period of the tile's centre, and the position within it.
                let turns = layout.turn(expansion.at);
                let first = turns * length + layout.shift() + layout.first();
                let kappa = pulse.cycles_a_bin;
                let turns = kappa * expansion.at;
                let path = Path {
                    column: expansion.column(i, ROW.then_some(offsets.line)),
                    place: expansion.at - first,
                    turns: turns - ((turns + ROUND_F64) - ROUND_F64),
                    kappa,
                };
                let middle = R::MIDDLE;
                for run in &mut *runs {
                    run.of_column(lanes, &phasors, &path, &offsets, middle, R::SHORT);
                }
                for part in (0..GROUP).step_by(L::COUNT) {
                    let group = Group::<L, R, PLANES> {
                        lanes,
                        part,
                        reading: PhantomData,
                    };
                    for (groups, run) in groups.chunks_mut(TURNED).zip(&mut *runs) {
                        if R::SHORT {
                            run.of_part(part, part + L::COUNT - 1, middle as f32);
                            group.add_short(&planes, run, groups);
                        } else if shared == 1 {
                            group.add_run::<1>(&planes, run, shared, groups);
                        } else {
                            group.add_run::<2>(&planes, run, shared, groups);
                        }
                    }
                }
            }
        }
    }
}

/// Data common to the groups of a column.
struct Group<L: Lanes, R: Reading, const PLANES: usize> {
    lanes: L,
    /// First lane of the current part.
    part: usize,
    reading: PhantomData<R>,
}

/// Positions of a group's pixels in the lookup window.
#[derive(Clone, Copy)]
struct Place<L: Lanes> {
    /// Spline piece, in the low bits.
    pattern: L::Numbers,
    /// Position within the piece.
    within: L::Numbers,
}

impl<L: Lanes, R: Reading, const PLANES: usize> Group<L, R, PLANES> {
    /// Add to a block of groups, `N` at a time. Groups that share a window come in multiples of `N`, except at the column's end.
    ///
    /// Positions are computed one step ahead, to overlap with the lookup latency of the current groups.
    #[inline(always)]
    fn add_run<const N: usize>(
        &self,
        planes: &[&[f32]; MAX_PLANES],
        run: &Run,
        shared: usize,
        groups: &mut [Sums],
    ) {
        let lanes = self.lanes;
        let mut pixels = CarrierRecurrence::new(lanes, &run.start, self.part);
        let mut ahead = [self.place(&mut pixels, run.at[0], run.round[0]); N];
        for (n, ahead) in ahead.iter_mut().enumerate().skip(1) {
            *ahead = self.place(&mut pixels, run.at[n], run.round[n]);
        }
        for (window, groups) in groups.chunks_mut(shared).enumerate() {
            let mut row = window * shared;
            let mut values = [R::window(lanes, planes[0], run.base[row]); MAX_PLANES];
            for p in 1..2 * PLANES {
                values[p] = R::window(lanes, planes[p], run.base[row]);
            }
            let mut steps = groups.chunks_exact_mut(N);
            for step in &mut steps {
                let here = ahead;
                for n in 0..N {
                    // Positions beyond the last group are computed and ignored.
                    let next = (row + N + n) % TURNED;
                    ahead[n] = self.place(&mut pixels, run.at[next], run.round[next]);
                    let turned = self.turned(&mut pixels, run, row + n);
                    self.add_group(&mut step[n], &here[n], &values, turned);
                }
                row += N;
            }
            for (n, last) in steps.into_remainder().iter_mut().enumerate() {
                let turned = self.turned(&mut pixels, run, row + n);
                self.add_group(last, &ahead[n], &values, turned);
            }
        }
    }

    /// As [`Self::add_run`], with a window per part of each group.
    #[inline(always)]
    fn add_short(&self, planes: &[&[f32]; MAX_PLANES], run: &Run, groups: &mut [Sums]) {
        let lanes = self.lanes;
        let mut pixels = CarrierRecurrence::new(lanes, &run.start, self.part);
        for (row, sums) in groups.iter_mut().enumerate().take(TURNED) {
            let place = self.place(&mut pixels, run.at[row], run.part_round[row]);
            let base = run.part_base[row];
            let mut values = [R::window(lanes, planes[0], base); MAX_PLANES];
            for p in 1..2 * PLANES {
                values[p] = R::window(lanes, planes[p], base);
            }
            let turned = self.turned(&mut pixels, run, row);
            self.add_group(sums, &place, &values, turned);
        }
    }

    /// Positions of the next group from that of its centre; `round` is the rounding constant.
    #[inline(always)]
    fn place(&self, pixels: &mut CarrierRecurrence<L>, at: f32, round: f32) -> Place<L> {
        let lanes = self.lanes;
        let (t, round) = (pixels.place(lanes, at), lanes.splat(round));
        let pattern = lanes.add(t, round);
        Place {
            pattern,
            within: lanes.sub(t, lanes.sub(pattern, round)),
        }
    }

    /// Carrier phasor at a group's pixels.
    #[inline(always)]
    fn turned(&self, pixels: &mut CarrierRecurrence<L>, run: &Run, row: usize) -> [L::Numbers; 2] {
        let [cos, sin] = &run.turned;
        pixels.turned(self.lanes, [cos[row], sin[row]])
    }

    #[inline(always)]
    fn add_group(
        &self,
        sums: &mut Sums,
        place: &Place<L>,
        values: &[R::Values<'_, L>; MAX_PLANES],
        [cos, sin]: [L::Numbers; 2],
    ) {
        let Self { lanes, part, .. } = *self;
        let Place { pattern, within } = *place;
        let mut real = R::look_up(lanes, values[2 * PLANES - 2], pattern);
        let mut imaginary = R::look_up(lanes, values[2 * PLANES - 1], pattern);
        for k in (0..PLANES - 1).rev() {
            let value = R::look_up(lanes, values[2 * k], pattern);
            real = lanes.mul_add(real, within, value);
            let value = R::look_up(lanes, values[2 * k + 1], pattern);
            imaginary = lanes.mul_add(imaginary, within, value);
        }
        let Sums { re, im } = sums;
        let sum = lanes.mul_add(cos, real, lanes.load(&re[part..]));
        lanes.store(lanes.neg_mul_add(sin, imaginary, sum), &mut re[part..]);
        let sum = lanes.mul_add(cos, imaginary, lanes.load(&im[part..]));
        lanes.store(lanes.mul_add(sin, real, sum), &mut im[part..]);
    }
}

/// Lookup method of spline pieces.
trait Reading {
    /// Offset of the window's centre from its first piece.
    const MIDDLE: u32;
    /// Whether each part of a group has its own window.
    const SHORT: bool = false;
    /// Window loaded for lookup.
    type Values<'a, L: Lanes>: Copy;
    fn window<'a, L: Lanes>(lanes: L, plane: &'a [f32], base: u32) -> Self::Values<'a, L>;
    fn look_up<L: Lanes>(lanes: L, values: Self::Values<'_, L>, pattern: L::Numbers) -> L::Numbers;
}

/// Pieces of a window.
#[inline(always)]
fn pieces<const N: usize>(plane: &[f32], base: u32) -> &[f32; N] {
    let base = base as usize;
    plane[base..base + N].try_into().expect("N pieces")
}

struct Quarter;
struct Short;
struct Narrow;
struct Wide;
struct Any;

impl Reading for Quarter {
    const MIDDLE: u32 = 2;
    const SHORT: bool = true;
    type Values<'a, L: Lanes> = L::Quarter;

    #[inline(always)]
    fn window<L: Lanes>(lanes: L, plane: &[f32], base: u32) -> L::Quarter {
        lanes.quarter(pieces(plane, base))
    }

    #[inline(always)]
    fn look_up<L: Lanes>(lanes: L, values: L::Quarter, pattern: L::Numbers) -> L::Numbers {
        lanes.of_quarter(values, pattern)
    }
}

impl Reading for Short {
    const MIDDLE: u32 = 4;
    const SHORT: bool = true;
    type Values<'a, L: Lanes> = L::Short;

    #[inline(always)]
    fn window<L: Lanes>(lanes: L, plane: &[f32], base: u32) -> L::Short {
        lanes.short(pieces(plane, base))
    }

    #[inline(always)]
    fn look_up<L: Lanes>(lanes: L, values: L::Short, pattern: L::Numbers) -> L::Numbers {
        lanes.of_short(values, pattern)
    }
}

impl Reading for Narrow {
    const MIDDLE: u32 = 8;
    type Values<'a, L: Lanes> = L::Narrow;

    #[inline(always)]
    fn window<L: Lanes>(lanes: L, plane: &[f32], base: u32) -> L::Narrow {
        lanes.narrow(pieces(plane, base))
    }

    #[inline(always)]
    fn look_up<L: Lanes>(lanes: L, values: L::Narrow, pattern: L::Numbers) -> L::Numbers {
        lanes.of_narrow(values, pattern)
    }
}

impl Reading for Wide {
    const MIDDLE: u32 = 16;
    type Values<'a, L: Lanes> = L::Wide;

    #[inline(always)]
    fn window<L: Lanes>(lanes: L, plane: &[f32], base: u32) -> L::Wide {
        lanes.wide(pieces(plane, base))
    }

    #[inline(always)]
    fn look_up<L: Lanes>(lanes: L, values: L::Wide, pattern: L::Numbers) -> L::Numbers {
        lanes.of_wide(values, pattern)
    }
}

impl Reading for Any {
    const MIDDLE: u32 = 1 << 20;
    /// Plane and base index.
    type Values<'a, L: Lanes> = (&'a [f32], u32);

    #[inline(always)]
    fn window<L: Lanes>(_: L, plane: &[f32], base: u32) -> (&[f32], u32) {
        (plane, base)
    }

    #[inline(always)]
    fn look_up<L: Lanes>(
        lanes: L,
        (plane, base): (&[f32], u32),
        pattern: L::Numbers,
    ) -> L::Numbers {
        let mut places = [0.0f32; GROUP];
        lanes.store(pattern, &mut places);
        let mut values = [0.0f32; GROUP];
        for (value, place) in values[..L::COUNT].iter_mut().zip(places) {
            // The base is the position minus the centre, modulo 2^32.
            let at = base.wrapping_add(place.to_bits() & 0x003F_FFFF);
            *value = plane[at as usize];
        }
        lanes.load(&values)
    }
}

/// Largest number of planes: real and imaginary parts of all spline coefficients.
const MAX_PLANES: usize = 8;
