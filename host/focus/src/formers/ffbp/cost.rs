//! What factorisation takes: of each stretch of pulses, as often as there are first patches, the way down in the middle one.
//!
//! ```text
//! a patch whose history is made smaller, with W taps:
//!     a sample before: phase 12, spread over frequency 4 W
//!     a pulse before and a frequency after: spread over pulses 4 W
//! a leaf: a pulse a transform of its profile, and as in backprojection 49 a pixel
//! ```
//!
//! How much smaller follows from the paths to the patch's corners, as in `patch_history`; what a decimation costs at the data's
//! ends is not looked at, which keeps more pulses in places. Against the operations done (`counted`) the account is 0.6 to 1.0 of them.
//! A tile takes what its first patches take: nothing is shared.

use std::ops::Range;

use super::descent::{LARGEST_LEAF_PIXELS, quarters};
use super::{LEAF_PIXELS, SCRATCH_COPIES, Shares, pulse_bytes};
use crate::Aim;
use crate::cost::{Cost, Each, transform};
use crate::patch::{Patches, Rectangle};
use crate::rounding;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Pulse;

/// Operations a pixel and pulse of a leaf.
const PIXEL_AND_PULSE: f64 = 49.0;
/// Places on a stretch at which paths are looked at.
const PLACES: usize = 8;

/// Of all of `aim` in `stretches` of so many pulses and these first patches.
pub(super) fn cost(
    aim: &Aim,
    stretches: &[usize],
    patches: &Patches,
    taps: usize,
    shares: &Shares,
) -> Cost {
    let num_samples = aim.collection.num_samples;
    let middle = patches.middle();
    let mut first = 0;
    let operations = stretches.iter().map(|&count| {
        let way = Way {
            aim,
            taps,
            shares,
            stretch: first..first + count,
        };
        first += count;
        let whole = History {
            pulses: count,
            samples: num_samples,
            by_pulse: 1,
            by_sample: 1,
        };
        patches.count() as f64 * way.down(middle, whole)
    });
    let operations = operations.sum();
    let longest = stretches.iter().max().copied().unwrap_or(0) as f64;
    let pulses_bytes = longest * pulse_bytes(num_samples) as f64;
    let copies_bytes = SCRATCH_COPIES as f64 * pulses_bytes;
    Cost::new(operations, 0.0)
        .holding("pulses", Each::Pass, pulses_bytes)
        .holding("patches' pulses", Each::Thread, copies_bytes)
}

/// How large a patch's history is, and how many recorded pulses and frequencies made one.
#[derive(Clone, Copy)]
struct History {
    pulses: usize,
    samples: usize,
    by_pulse: usize,
    by_sample: usize,
}

/// The way down to a leaf.
struct Way<'a> {
    aim: &'a Aim<'a>,
    taps: usize,
    shares: &'a Shares,
    stretch: Range<usize>,
}

impl Way<'_> {
    /// Operations of a patch and all in it.
    fn down(&self, rectangle: Rectangle, parent: History) -> f64 {
        let (history, refined) = self.refine(&rectangle, parent);
        let side = rectangle.size.rows.max(rectangle.size.columns);
        let few_pulses = history.pulses <= 4 * self.taps || !self.shares.decimate;
        if side <= LEAF_PIXELS || (few_pulses && side <= LARGEST_LEAF_PIXELS) {
            return refined + self.leaf(&rectangle, history);
        }
        let parts: Vec<Rectangle> = quarters(rectangle).collect();
        refined + parts.len() as f64 * self.down(parts[0], history)
    }

    /// The patch's own history, and what it takes to make it.
    fn refine(&self, rectangle: &Rectangle, parent: History) -> (History, f64) {
        if !self.shares.decimate {
            return (parent, 0.0);
        }
        let [cycles_a_pulse, cycles_a_sample] = self.cycles(rectangle);
        let by_pulse = self.allowed(cycles_a_pulse * parent.by_pulse as f64, parent.pulses);
        let by_sample = self.allowed(cycles_a_sample * parent.by_sample as f64, parent.samples);
        if by_pulse == 1 && by_sample == 1 {
            return (parent, 0.0);
        }
        let after = |count: usize, by: usize| match by {
            1 => count,
            _ => (count - 1) / by + self.taps,
        };
        let own = History {
            pulses: after(parent.pulses, by_pulse),
            samples: after(parent.samples, by_sample),
            by_pulse: parent.by_pulse * by_pulse,
            by_sample: parent.by_sample * by_sample,
        };
        let spread = |count: usize, by: usize| if by > 1 { 4 * self.taps * count } else { 0 };
        let over_samples = 12 * parent.samples + spread(parent.samples, by_sample);
        let over_pulses = spread(own.samples, by_pulse);
        let operations = parent.pulses as f64 * (over_samples + over_pulses) as f64;
        (own, operations)
    }

    fn leaf(&self, rectangle: &Rectangle, history: History) -> f64 {
        let bins = self.shares.oversampling() * history.samples as f64;
        let pixels = (rectangle.size.rows * rectangle.size.columns) as f64;
        history.pulses as f64 * (transform(bins) + PIXEL_AND_PULSE * pixels)
    }

    /// Cycles by which the phase of a pixel at a corner goes on against the centre's, at most, from a recorded pulse to the next
    /// and from a frequency to the next.
    fn cycles(&self, rectangle: &Rectangle) -> [f64; 2] {
        let (grid, pulses) = (self.aim.grid, &self.aim.collection.pulses);
        let centre = rectangle.centre_m(grid);
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)];
        let corners = corners.map(|(row, column)| rectangle.point_m(grid, row, column));
        let offsets_m = |pulse: &Pulse| {
            let centre_m = pulse.path_m(centre);
            corners.map(|corner| pulse.path_m(corner) - centre_m)
        };
        let last = self.stretch.len() - 1;
        let places = (0..=PLACES).map(|i| i * last / PLACES);
        let places: Vec<(usize, [f64; 4])> = places
            .map(|n| (n, offsets_m(&pulses[self.stretch.start + n])))
            .collect();
        let depths_m = places.iter().flat_map(|(_, offsets)| offsets);
        let depth_m = depths_m.fold(0.0f64, |most, offset| most.max(offset.abs()));
        let mut rate_m = 0.0f64;
        for pair in places.windows(2) {
            let ((early, a), (late, b)) = (pair[0], pair[1]);
            let steps = (late - early).max(1) as f64;
            let rates = a.iter().zip(b).map(|(a, b)| (b - a).abs() / steps);
            rate_m = rates.fold(rate_m, f64::max);
        }
        let step_hz = pulses[self.stretch.start].step_hz.abs();
        [
            rate_m * rounding::highest_hz(self.aim) / SPEED_OF_LIGHT_M_S,
            depth_m * step_hz / SPEED_OF_LIGHT_M_S,
        ]
    }

    /// How many can be made one, of `count` that are `cycles` apart: within a quarter of a cycle, if it pays.
    fn allowed(&self, cycles: f64, count: usize) -> usize {
        let by = (0.25 / (cycles * super::patch_view::MARGIN)).min(count as f64) as usize;
        let after = count as f64 / by.max(1) as f64 + self.taps as f64;
        match by >= 2 && after <= super::patch_history::WORTHWHILE * count as f64 {
            true => by,
            false => 1,
        }
    }
}
