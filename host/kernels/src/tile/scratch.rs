//! Backprojection of several pulses onto a tile, with the buffers of one thread.

use num_complex::Complex32;

use super::adding::Add;
use super::expansion::{Expansion, Raster};
use super::groups::{Deliver, Groups, Sums};
use super::pieces::Pieces;
use super::pulse::TilePulse;
use super::rows::{Run, runs};
use super::shape::{Shape, Window, steepest};
use crate::lanes::Instructions;

/// Buffers of one thread, and the geometry of pulses relative to a tile.
#[derive(Default)]
pub struct TileScratch {
    expansions: Vec<Expansion>,
    window: Window,
    /// Number of groups that share a window.
    run: usize,
    /// Largest path gradient along the groups' axes, bins per pixel.
    slopes: [f64; 2],
    tile: Groups,
    sums: Vec<Sums>,
    runs: Vec<Run>,
}

impl TileScratch {
    /// Expand the paths of pulses about a tile, for profiles of `length` bins. Returns the bound on the path error, metres: RMS over
    /// the tile's pixels, for the worst pulse. [`Self::add`] uses the same pulses.
    ///
    /// It is that of [`Expansion::truncation_m`] and of the terms that groups leave out.
    pub fn look(&mut self, length: usize, pulses: &[TilePulse], raster: &Raster) -> f64 {
        self.expansions.clear();
        let bins = length as f64;
        self.expansions.extend(
            pulses
                .iter()
                .map(|pulse| Expansion::new(&pulse.antennas, raster, pulse.turns_m * bins)),
        );
        let sides = [raster.columns, raster.rows];
        let steepest = steepest(self.expansions.iter(), sides);
        let (shape, window, run) = Shape::of(steepest);
        (self.window, self.run) = (window, run);
        self.slopes = shape.slopes(steepest);
        self.tile = Groups::new(shape, sides);
        if shape.transposed {
            self.expansions.iter_mut().for_each(|e| *e = e.transposed());
        }
        let radius_m = raster.radius_m();
        let lost = shape.left_out(self.tile.sides[1]);
        let each = pulses.iter().zip(&self.expansions).map(|(pulse, e)| {
            let off = lost.iter().zip(e.third).map(|(each, c)| each * c.abs());
            let off_m = e.truncation_m(radius_m) + off.sum::<f64>() / (pulse.turns_m * bins).abs();
            // NaN positions cannot be expanded.
            if off_m.is_nan() { f64::INFINITY } else { off_m }
        });
        each.fold(0.0, f64::max)
    }

    /// Largest distance in bins from the tile's centre at which the pulses are read: a sufficient margin if
    /// all paths are 0 at the centre.
    pub fn reach(&self) -> usize {
        let extent = self.tile.extent();
        let each = self.expansions.iter().map(|e| e.bound(extent));
        // Windows extend 16 further, and are counted from whole bins.
        each.fold(0.0, f64::max).ceil() as usize + 18
    }

    /// Grouping of the expanded pulses: lookup window, and number of groups.
    pub fn grouping(&self) -> (Window, usize) {
        (self.window, self.tile.count())
    }

    /// Add the expanded pulses to the pixels of the tile, row by row. `pieces` are those of all pulses, in the layout
    /// `layout`.
    ///
    /// The layout's margin must be at least [`Pieces::margin_for`] the tile.
    ///
    /// # Panics
    /// If the spline degree is not 2 or 3 ([`DEGREES`](super::DEGREES)), the numbers of pulses or pixels differ from those of [`Self::look`], or `pieces` does not have [`Pieces::values`] for each pulse.
    pub fn add(
        &mut self,
        instructions: Instructions,
        layout: &Pieces,
        pulses: &[TilePulse],
        pieces: &[f32],
        sums: &mut [Complex32],
    ) {
        let tile = self.tile;
        assert!(
            sums.len() == tile.sides[0] * tile.sides[1] && pulses.len() == self.expansions.len()
        );
        assert_eq!(pieces.len(), pulses.len() * layout.values());
        self.sums.clear();
        self.sums.resize(tile.count(), Sums::ZERO);
        runs(&tile, self.run, &mut self.runs);
        instructions.run(Add {
            layout,
            pulses,
            pieces,
            expansions: &self.expansions,
            window: self.window,
            slopes: self.slopes,
            tile,
            runs: &mut self.runs,
            shared: self.run,
            sums: &mut self.sums,
        });
        instructions.run(Deliver {
            tile,
            parts: &self.sums,
            sums,
        });
    }
}
