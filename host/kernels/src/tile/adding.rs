//! The pulses of a call, one after another, onto all groups of a tile: what is compiled for each instruction set.

use std::marker::PhantomData;

use super::expansion::Expansion;
use super::groups::{Bend, Groups, Offsets, Rows, Sums};
use super::pieces::Pieces;
use super::pulse::TilePulse;
use super::shape::{SHORT_REACH, Window};
use crate::lanes::{GROUP, Kernel, Lanes};
use crate::phasor::{ROUND, Table};

/// What is compiled for each instruction set.
pub(super) struct Add<'a> {
    pub(super) layout: &'a Pieces,
    pub(super) coarse: bool,
    pub(super) pulses: &'a [TilePulse],
    pub(super) pieces: &'a [f32],
    pub(super) expansions: &'a [Expansion],
    pub(super) window: Window,
    /// How fast paths change along the groups' axes at most, bins a pixel.
    pub(super) slopes: [f64; 2],
    pub(super) tile: Groups,
    pub(super) rows: &'a mut Rows,
    pub(super) sums: &'a mut [Sums],
}

impl Kernel for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        match self.layout.degree() {
            2 => self.of_degree::<L, 3>(lanes),
            3 => self.of_degree::<L, 4>(lanes),
            other => panic!("tiles are made of splines of degree 2 and 3, not {other}"),
        }
    }
}

impl Add<'_> {
    #[inline(always)]
    fn of_degree<L: Lanes, const PLANES: usize>(self, lanes: L) {
        match self.coarse {
            true => self.of_window::<L, PLANES, true>(lanes),
            false => self.of_window::<L, PLANES, false>(lanes),
        }
    }

    #[inline(always)]
    fn of_window<L: Lanes, const PLANES: usize, const COARSE: bool>(self, lanes: L) {
        // Where nothing is looked up in registers a window is worth nothing.
        let window = if L::LOOKS_UP {
            self.window
        } else {
            Window::Any
        };
        let shape = self.tile.shape;
        let short = L::LIKES_SHORT && shape.part_reach(self.slopes, L::COUNT) <= SHORT_REACH;
        match (window, shape.along == GROUP) {
            (_, true) if short => self.add::<L, Short, PLANES, COARSE, true>(lanes),
            (_, false) if short => self.add::<L, Short, PLANES, COARSE, false>(lanes),
            (Window::Narrow, true) => self.add::<L, Narrow, PLANES, COARSE, true>(lanes),
            (Window::Narrow, false) => self.add::<L, Narrow, PLANES, COARSE, false>(lanes),
            (Window::Wide, true) => self.add::<L, Wide, PLANES, COARSE, true>(lanes),
            (Window::Wide, false) => self.add::<L, Wide, PLANES, COARSE, false>(lanes),
            (Window::Any, true) => self.add::<L, Any, PLANES, COARSE, true>(lanes),
            (Window::Any, false) => self.add::<L, Any, PLANES, COARSE, false>(lanes),
        }
    }

    #[inline(always)]
    fn add<L: Lanes, R: Reading, const PLANES: usize, const COARSE: bool, const ROW: bool>(
        self,
        lanes: L,
    ) {
        let Self {
            layout,
            pulses,
            pieces,
            expansions,
            tile,
            rows,
            sums,
            ..
        } = self;
        let shape = tile.shape;
        let (row, length) = (layout.row(), layout.length() as f64);
        let offsets = Offsets::new(shape);
        let phasors = Table::new(lanes, COARSE);
        let round = lanes.splat(ROUND + R::MIDDLE as f32);
        let down = tile.counts[1];
        // Sums of a column stay in the nearest cache while all pulses are added to them.
        for (column, groups) in sums.chunks_exact_mut(down).enumerate() {
            let i = tile.middle(0, column);
            let each = pulses.iter().zip(expansions);
            for ((pulse, expansion), pieces) in each.zip(pieces.chunks_exact(layout.values())) {
                let planes: [&[f32]; MOST_PLANES] = std::array::from_fn(|p| match p < 2 * PLANES {
                    true => &pieces[p * row..(p + 1) * row],
                    false => &[],
                });
                // The turn in which the tile's middle lies, and where in it.
                let turns = layout.turn(expansion.at);
                let place = expansion.at - turns * length - layout.shift() - layout.first();
                let turned = pulse.cycles_a_bin * length * turns;
                let kappa = lanes.splat((pulse.cycles_a_bin * Table::<L>::A_TURN) as f32);
                let turned = lanes.splat(((turned - turned.round()) * Table::<L>::A_TURN) as f32);
                rows.of_column(
                    expansion,
                    place,
                    i,
                    ROW.then_some(offsets.line),
                    R::MIDDLE as f64,
                );
                let bend = match ROW {
                    true => Bend::NONE,
                    false => Bend::new(expansion, i),
                };
                let bends: [f32; GROUP] =
                    std::array::from_fn(|n| bend.at(offsets.along[n], offsets.across[n]));
                for part in (0..GROUP).step_by(L::COUNT) {
                    if R::SHORT {
                        let [first, second] = offsets.middle(part..part + L::COUNT);
                        let along = (!ROW).then_some(second);
                        rows.of_part(first, along, bend.at(first, second));
                    }
                    let first = lanes.load(&offsets.along[part..]);
                    let second = lanes.load(&offsets.across[part..]);
                    let bend = lanes.load(&bends[part..]);
                    let group = Group::<L, R, PLANES, COARSE, ROW> {
                        lanes,
                        first,
                        second,
                        bend,
                        round,
                        kappa,
                        turned,
                        phasors: &phasors,
                        reading: PhantomData,
                    };
                    match rows.run {
                        _ if R::SHORT => group.add_short(&planes, rows, part, groups),
                        1 => group.add_column::<1>(&planes, rows, part, groups),
                        _ => group.add_column::<2>(&planes, rows, part, groups),
                    }
                }
            }
        }
    }
}

/// What the groups of a column have in common.
struct Group<'b, L: Lanes, R: Reading, const PLANES: usize, const COARSE: bool, const ROW: bool> {
    lanes: L,
    first: L::Numbers,
    second: L::Numbers,
    bend: L::Numbers,
    round: L::Numbers,
    kappa: L::Numbers,
    turned: L::Numbers,
    phasors: &'b Table<L>,
    reading: PhantomData<R>,
}

/// Where in the windows the pixels of a group lie.
#[derive(Clone, Copy)]
struct Place<L: Lanes> {
    /// Their pieces.
    pattern: L::Numbers,
    /// Where within them.
    within: L::Numbers,
    /// Their phases.
    phase: [L::Numbers; 2],
}

impl<L: Lanes, R: Reading, const PLANES: usize, const COARSE: bool, const ROW: bool>
    Group<'_, L, R, PLANES, COARSE, ROW>
{
    /// Adds to the lanes from `part` of a column's groups, `N` at a time; runs are of whole `N`.
    ///
    /// Places are found one step ahead: while one group waits for what it has looked up, the next ones' are worked on.
    #[inline(always)]
    fn add_column<const N: usize>(
        &self,
        planes: &[&[f32]; MOST_PLANES],
        rows: &Rows,
        part: usize,
        groups: &mut [Sums],
    ) {
        let whole = groups.len() / N * N;
        let mut ahead = [self.place(rows.place(0)); N];
        for (n, place) in ahead.iter_mut().enumerate().take(groups.len()) {
            *place = self.place(rows.place(n));
        }
        for (run, groups) in groups.chunks_mut(rows.run).enumerate() {
            let mut row = run * rows.run;
            let mut values = [R::window(self.lanes, planes[0], rows.base[row]); MOST_PLANES];
            for p in 1..2 * PLANES {
                values[p] = R::window(self.lanes, planes[p], rows.base[row]);
            }
            let mut steps = groups.chunks_exact_mut(N);
            for step in &mut steps {
                let here = ahead;
                row += N;
                // After the last there is none: it is found again.
                let next = if row < whole { row } else { row - N };
                for n in 0..N {
                    ahead[n] = self.place(rows.place(next + n));
                    self.add(&mut step[n], part, &here[n], &values);
                }
            }
            for last in steps.into_remainder() {
                self.add(last, part, &self.place(rows.place(row)), &values);
                row += 1;
            }
        }
    }

    /// The same, each group from windows of its own.
    #[inline(always)]
    fn add_short(
        &self,
        planes: &[&[f32]; MOST_PLANES],
        rows: &Rows,
        part: usize,
        groups: &mut [Sums],
    ) {
        let lanes = self.lanes;
        for (sums, row) in groups.iter_mut().zip(rows.parts()) {
            let place = self.place(row.place);
            let place = Place {
                pattern: lanes.add(place.pattern, lanes.splat(row.shift)),
                ..place
            };
            let mut values = [R::window(lanes, planes[0], row.first); MOST_PLANES];
            for p in 1..2 * PLANES {
                values[p] = R::window(lanes, planes[p], row.first);
            }
            self.add(sums, part, &place, &values);
        }
    }

    #[inline(always)]
    fn place(&self, [at, along, across]: [f32; 3]) -> Place<L> {
        let lanes = self.lanes;
        let (at, along) = (lanes.splat(at), lanes.splat(along));
        let across = lanes.splat(across);
        let t = match ROW {
            true => {
                let slope = lanes.mul_add(self.first, across, along);
                lanes.mul_add(self.first, slope, at)
            }
            false => {
                let t = lanes.mul_add(self.second, across, self.bend);
                lanes.add(lanes.mul_add(self.first, along, t), at)
            }
        };
        let pattern = lanes.add(t, self.round);
        let within = lanes.sub(t, lanes.sub(pattern, self.round));
        let phase = lanes.mul_add(within, self.kappa, self.turned);
        Place {
            pattern,
            within,
            phase: self.phasors.place(lanes, phase),
        }
    }

    #[inline(always)]
    fn add(
        &self,
        sums: &mut Sums,
        part: usize,
        place: &Place<L>,
        values: &[R::Values<'_, L>; MOST_PLANES],
    ) {
        let lanes = self.lanes;
        let Place {
            pattern,
            within,
            phase,
        } = *place;
        let mut real = R::look_up(lanes, values[2 * PLANES - 2], pattern);
        let mut imaginary = R::look_up(lanes, values[2 * PLANES - 1], pattern);
        for k in (0..PLANES - 1).rev() {
            let value = R::look_up(lanes, values[2 * k], pattern);
            real = lanes.mul_add(real, within, value);
            let value = R::look_up(lanes, values[2 * k + 1], pattern);
            imaginary = lanes.mul_add(imaginary, within, value);
        }
        let [cos, sin] = self.phasors.at::<COARSE>(lanes, phase);
        let Sums { re, im } = sums;
        let sum = lanes.mul_add(cos, real, lanes.load(&re[part..]));
        lanes.store(lanes.neg_mul_add(sin, imaginary, sum), &mut re[part..]);
        let sum = lanes.mul_add(cos, imaginary, lanes.load(&im[part..]));
        lanes.store(lanes.mul_add(sin, real, sum), &mut im[part..]);
    }
}

/// How values are read from a plane.
trait Reading {
    /// The window's middle, from its first piece.
    const MIDDLE: u32;
    /// Whether each part of a group that is worked on at once has a window of its own.
    const SHORT: bool = false;
    /// A window, ready to be looked up.
    type Values<'a, L: Lanes>: Copy;
    fn window<'a, L: Lanes>(lanes: L, plane: &'a [f32], base: u32) -> Self::Values<'a, L>;
    fn look_up<L: Lanes>(lanes: L, values: Self::Values<'_, L>, pattern: L::Numbers) -> L::Numbers;
}

struct Short;
struct Narrow;
struct Wide;
struct Any;

impl Reading for Short {
    const MIDDLE: u32 = 4;
    const SHORT: bool = true;
    type Values<'a, L: Lanes> = L::Short;

    #[inline(always)]
    fn window<L: Lanes>(lanes: L, plane: &[f32], base: u32) -> L::Short {
        let base = base as usize;
        lanes.short(plane[base..base + 8].try_into().expect("8 pieces"))
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
        let base = base as usize;
        lanes.narrow(plane[base..base + 16].try_into().expect("16 pieces"))
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
        let base = base as usize;
        lanes.wide(plane[base..base + 32].try_into().expect("32 pieces"))
    }

    #[inline(always)]
    fn look_up<L: Lanes>(lanes: L, values: L::Wide, pattern: L::Numbers) -> L::Numbers {
        lanes.of_wide(values, pattern)
    }
}

impl Reading for Any {
    const MIDDLE: u32 = 1 << 20;
    /// A plane and where places are counted from.
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
            // The base is less than the place by the middle, modulo 2^32.
            let at = base.wrapping_add(place.to_bits() & 0x003F_FFFF);
            *value = plane[at as usize];
        }
        lanes.load(&values)
    }
}

/// Real and imaginary parts of a spline's pieces, of the highest degree.
const MOST_PLANES: usize = 8;
