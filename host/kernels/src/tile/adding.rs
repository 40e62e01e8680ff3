//! The pulses of a call, one after another, onto all groups of a tile: what is compiled for each instruction set.

use super::expansion::Expansion;
use super::groups::{Groups, Offsets, Rows, Sums};
use super::pieces::Pieces;
use super::pulse::TilePulse;
use super::shape::Window;
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
        match (window, self.tile.shape.along == GROUP) {
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
        let half = layout.length().div_ceil(2) as f64;
        let offsets = Offsets::new(shape);
        let phasors = Table::new(lanes, COARSE);
        let round = lanes.splat(ROUND + R::MIDDLE as f32);
        for ((pulse, expansion), pieces) in pulses
            .iter()
            .zip(expansions)
            .zip(pieces.chunks_exact(layout.values()))
        {
            let planes: [&[f32]; MOST_PLANES] = std::array::from_fn(|p| match p < 2 * PLANES {
                true => &pieces[p * row..(p + 1) * row],
                false => &[],
            });
            // The turn in which the tile's middle lies, and where in it.
            let turns = ((expansion.at + half) / length).floor();
            let place = expansion.at - turns * length - layout.shift() - layout.first();
            let turned = pulse.cycles_a_bin * length * turns;
            let kappa = lanes.splat((pulse.cycles_a_bin * Table::<L>::A_TURN) as f32);
            let turned = lanes.splat(((turned - turned.round()) * Table::<L>::A_TURN) as f32);
            for column in 0..tile.counts[0] {
                let i = tile.middle(0, column);
                rows.of_column(
                    expansion,
                    place,
                    i,
                    ROW.then_some(offsets.line),
                    R::MIDDLE as f64,
                );
                let bend = match ROW {
                    true => [0.0; GROUP],
                    false => offsets.bend(expansion, i),
                };
                let down = tile.counts[1];
                let groups = &mut sums[column * down..(column + 1) * down];
                for part in (0..GROUP).step_by(L::COUNT) {
                    let first = lanes.load(&offsets.along[part..]);
                    let second = lanes.load(&offsets.across[part..]);
                    let bend = lanes.load(&bend[part..]);
                    for (run, groups) in groups.chunks_mut(rows.run).enumerate() {
                        let from = run * rows.run;
                        let mut values =
                            [R::window(lanes, planes[0], rows.base[from]); MOST_PLANES];
                        for p in 1..2 * PLANES {
                            values[p] = R::window(lanes, planes[p], rows.base[from]);
                        }
                        let group = Group::<L, R, PLANES, COARSE, ROW> {
                            lanes,
                            first,
                            second,
                            bend,
                            round,
                            kappa,
                            turned,
                            phasors: &phasors,
                            values,
                        };
                        let mut pairs = groups.chunks_exact_mut(2);
                        let mut row = from;
                        for pair in &mut pairs {
                            let [one, two] = pair else { unreachable!() };
                            group.add([one, two], part, rows.places(row));
                            row += 2;
                        }
                        for last in pairs.into_remainder() {
                            group.add([last], part, rows.places(row));
                        }
                    }
                }
            }
        }
    }
}

/// What groups that share a window have in common.
struct Group<'a, 'b, L: Lanes, R: Reading, const PLANES: usize, const COARSE: bool, const ROW: bool>
{
    lanes: L,
    first: L::Numbers,
    second: L::Numbers,
    bend: L::Numbers,
    round: L::Numbers,
    kappa: L::Numbers,
    turned: L::Numbers,
    phasors: &'b Table<L>,
    values: [R::Values<'a, L>; MOST_PLANES],
}

impl<L: Lanes, R: Reading, const PLANES: usize, const COARSE: bool, const ROW: bool>
    Group<'_, '_, L, R, PLANES, COARSE, ROW>
{
    /// Adds to the lanes from `part` of `N` groups from `row`, step by step side by side: one waits for what it has, the other works.
    #[inline(always)]
    fn add<const N: usize>(&self, sums: [&mut Sums; N], part: usize, places: [&[f32; N]; 3]) {
        let Self {
            lanes,
            first,
            second,
            bend,
            round,
            kappa,
            turned,
            phasors,
            values,
        } = self;
        // Loops by index: closures handed to functions of arrays would not be compiled in the lanes' instructions.
        let nothing = [*round; N];
        let [
            mut t,
            mut pattern,
            mut f,
            mut phase,
            mut real,
            mut imaginary,
            mut cos,
            mut sin,
        ] = [nothing; 8];
        for n in 0..N {
            let [at, along, across] = places;
            let (at, along) = (lanes.splat(at[n]), lanes.splat(along[n]));
            let across = lanes.splat(across[n]);
            t[n] = match ROW {
                true => lanes.mul_add(*first, lanes.mul_add(*first, across, along), at),
                false => {
                    let t = lanes.mul_add(*second, across, *bend);
                    lanes.add(lanes.mul_add(*first, along, t), at)
                }
            };
        }
        for n in 0..N {
            pattern[n] = lanes.add(t[n], *round);
        }
        for n in 0..N {
            f[n] = lanes.sub(t[n], lanes.sub(pattern[n], *round));
        }
        for n in 0..N {
            phase[n] = lanes.mul_add(f[n], *kappa, *turned);
        }
        for n in 0..N {
            real[n] = R::look_up(*lanes, values[2 * PLANES - 2], pattern[n]);
            imaginary[n] = R::look_up(*lanes, values[2 * PLANES - 1], pattern[n]);
        }
        for k in (0..PLANES - 1).rev() {
            for n in 0..N {
                let value = R::look_up(*lanes, values[2 * k], pattern[n]);
                real[n] = lanes.mul_add(real[n], f[n], value);
                let value = R::look_up(*lanes, values[2 * k + 1], pattern[n]);
                imaginary[n] = lanes.mul_add(imaginary[n], f[n], value);
            }
        }
        for n in 0..N {
            [cos[n], sin[n]] = phasors.at::<COARSE>(*lanes, phase[n]);
        }
        for n in 0..N {
            let Sums { re, im } = &mut *sums[n];
            let sum = lanes.mul_add(cos[n], real[n], lanes.load(&re[part..]));
            lanes.store(
                lanes.neg_mul_add(sin[n], imaginary[n], sum),
                &mut re[part..],
            );
            let sum = lanes.mul_add(cos[n], imaginary[n], lanes.load(&im[part..]));
            lanes.store(lanes.mul_add(sin[n], real[n], sum), &mut im[part..]);
        }
    }
}

/// How values are read from a plane.
trait Reading {
    /// The window's middle, from its first piece.
    const MIDDLE: u32;
    /// A window, ready to be looked up.
    type Values<'a, L: Lanes>: Copy;
    fn window<'a, L: Lanes>(lanes: L, plane: &'a [f32], base: u32) -> Self::Values<'a, L>;
    fn look_up<L: Lanes>(lanes: L, values: Self::Values<'_, L>, pattern: L::Numbers) -> L::Numbers;
}

struct Narrow;
struct Wide;
struct Any;

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
