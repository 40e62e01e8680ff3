//! Blocks of groups of a column: positions and carrier phasors of group centres.

use super::carrier_recurrence::{Path, Start};
use super::groups::{Groups, Offsets};
use super::shape::TURNED;
use crate::lanes::Lanes;
use crate::phasor::{Polynomials, ROUND, ROUND_F64};

/// Windows are symmetric about their centre and positions are rounded to nearest: the centre is the even
/// piece nearest to half a piece behind that of the pixels.
const LEAN: f64 = 0.5;

/// Block of groups; the column's last block may have unused entries.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Run {
    /// Start of the pixel recurrences.
    pub(super) start: Start,
    /// Offsets of group centres from the tile's centre, pixels; and of the centres of groups that share a window.
    middle: [f64; TURNED],
    shared_middle: [f64; TURNED],
    /// Position of the group's centre relative to the nearest even piece.
    pub(super) at: [f32; TURNED],
    /// Rounding constant from such positions to window pieces.
    pub(super) round: [f32; TURNED],
    /// First piece of the window.
    pub(super) base: [u32; TURNED],
    /// Carrier at the group's centre: cosine and sine.
    pub(super) turned: [[f32; TURNED]; 2],
    /// As `round`, for a part of the lanes ([`Self::of_part`]).
    pub(super) part_round: [f32; TURNED],
    /// As `base`, for a part of the lanes.
    pub(super) part_base: [u32; TURNED],
    /// Number of groups.
    count: usize,
}

/// Divide a column into blocks, where `shared` groups share a window.
pub(super) fn runs(tile: &Groups, shared: usize, runs: &mut Vec<Run>) {
    let groups = tile.counts[1];
    runs.clear();
    runs.extend((0..groups).step_by(TURNED).map(|first| {
        let middle: [f64; TURNED] = std::array::from_fn(|row| tile.middle(1, first + row));
        let mut shared_middle = middle;
        for shared in shared_middle.chunks_mut(shared) {
            let middle = (shared[0] + shared[shared.len() - 1]) / 2.0;
            shared.fill(middle);
        }
        Run {
            start: Start::ZERO,
            middle,
            shared_middle,
            at: [0.0; TURNED],
            round: [0.0; TURNED],
            base: [0; TURNED],
            turned: [[0.0; TURNED]; 2],
            part_round: [0.0; TURNED],
            part_base: [0; TURNED],
            count: TURNED.min(groups - first),
        }
    }));
}

impl Run {
    /// Set up for a column. Windows begin `middle` pieces before the centre of the groups that share one, or before each group's own centre if `alone`.
    ///
    /// Positions are counted from an even piece, and window centres are even: positions at a half are rounded to the same piece
    /// in any window.
    #[inline(always)]
    pub(super) fn of_column<L: Lanes>(
        &mut self,
        lanes: L,
        phasors: &Polynomials<L>,
        path: &Path,
        offsets: &Offsets,
        middle: u32,
        alone: bool,
    ) {
        self.start
            .set(lanes, phasors, path, offsets, &self.middle[..self.count]);
        let [a0, a1, a2, a3] = path.column.place;
        let (place, middle) = (path.place, f64::from(middle));
        let zero = f64::from(ROUND) + middle;
        // Copied first, so that the compiler sees no aliasing.
        let (middles, shared) = (self.middle, self.shared_middle);
        let [mut ats, mut rounds, mut cycles] = [[0.0f32; TURNED]; 3];
        let mut bases = [0u32; TURNED];
        for row in 0..TURNED {
            let j = middles[row];
            let a = a3.mul_add(j, a2).mul_add(j, a1).mul_add(j, a0);
            let turned = path.kappa.mul_add(a, path.turns);
            cycles[row] = (turned - ((turned + ROUND_F64) - ROUND_F64)) as f32;
            let own = (a + place + 2.0 * ROUND_F64) - 2.0 * ROUND_F64;
            ats[row] = (a + place - own) as f32;
            let whole = if alone {
                own
            } else {
                let m = shared[row];
                let m = a3.mul_add(m, a2).mul_add(m, a1).mul_add(m, a0);
                (m + (place + LEAN) + 2.0 * ROUND_F64) - 2.0 * ROUND_F64
            };
            rounds[row] = (zero + (own - whole)) as f32;
            bases[row] = (whole - middle + ROUND_F64).to_bits() as u32;
        }
        (self.at, self.round, self.base) = (ats, rounds, bases);
        let [cos, sin] = &mut self.turned;
        for part in (0..TURNED).step_by(L::COUNT) {
            let at = phasors.at(lanes, lanes.load(&cycles[part..]));
            lanes.store(at[0], &mut cos[part..]);
            lanes.store(at[1], &mut sin[part..]);
        }
    }

    /// Windows for lanes `first` to `last`: pieces about the position of their midpoint, `middle` of them before it.
    #[inline(always)]
    pub(super) fn of_part(&mut self, first: usize, last: usize, middle: f32) {
        let [begin, step] = self.start.middle(first, last);
        for (row, &groups) in ROWS.iter().enumerate() {
            let place = self.at[row] + (begin + groups * step + LEAN as f32);
            let even = (place + 2.0 * ROUND) - 2.0 * ROUND;
            self.part_round[row] = (ROUND + middle) - even;
            let whole = (even + ROUND).to_bits().wrapping_sub(ROUND.to_bits());
            self.part_base[row] = self.base[row].wrapping_add(whole);
        }
    }
}

/// Indices of the groups of a block.
const ROWS: [f32; TURNED] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];
