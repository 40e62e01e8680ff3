//! A tile, the pulses that are added to it, and a thread's buffers for that.

use num_complex::Complex32;

use super::adding::Add;
use super::expansion::{Expansion, Raster, left_out_m};
use super::groups::{Deliver, Groups, Sums};
use super::pieces::Pieces;
use super::pulse::TilePulse;
use super::rows::{Run, runs};
use super::shape::{Shape, Window, steepest};
use crate::lanes::Instructions;

/// One thread's buffers, and how it sees some pulses from a tile.
#[derive(Default)]
pub struct TileScratch {
    expansions: Vec<Expansion>,
    window: Window,
    /// Groups that share a window.
    run: usize,
    /// How fast paths change along the groups' axes at most, bins a pixel.
    slopes: [f64; 2],
    tile: Groups,
    sums: Vec<Sums>,
    runs: Vec<Run>,
}

impl TileScratch {
    /// Looks at pulses from a tile, for profiles of `length` bins, and says by how much paths will be off, at most, metres: the root
    /// of the mean square over the tile's pixels, of the worst pulse. To be followed by [`Self::add`] of the same.
    ///
    /// What a polynomial of third degree leaves out grows at least with the fourth power from the middle, so that its RMS over a
    /// rectangle is a third of that at the corners at most.
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
            let [out_m, back_m] = e.legs_m.map(|leg_m| left_out_m(leg_m, radius_m) / 3.0);
            let legs_m = out_m + back_m;
            let off = lost.iter().zip(e.third).map(|(each, c)| each * c.abs());
            let off_m = legs_m + off.sum::<f64>() / (pulse.turns_m * bins).abs();
            // Antennas that are nowhere are no tile's.
            if off_m.is_nan() { f64::INFINITY } else { off_m }
        });
        each.fold(0.0, f64::max)
    }

    /// The bins, before a tile's centre or behind it, from which pulses that were looked at are read at most: a margin that suffices where
    /// all paths are 0 at the centre.
    pub fn reach(&self) -> usize {
        let extent = self.tile.extent();
        let each = self.expansions.iter().map(|e| e.bound(extent));
        // Windows reach 16 further, and are counted from whole bins.
        each.fold(0.0, f64::max).ceil() as usize + 18
    }

    /// How the pulses that were looked at will be added: the window of a group, and how many groups there are.
    pub fn grouping(&self) -> (Window, usize) {
        (self.window, self.tile.count())
    }

    /// Adds the pulses that were looked at to the pixels of the tile, row by row. `pieces` are those of all pulses, laid out as
    /// `layout`.
    ///
    /// The layout's margin must be [`Pieces::margin_for`] the tile at least.
    ///
    /// # Panics
    /// If the splines are not of degree 2 or 3 ([`DEGREES`](super::DEGREES)), or if there are not as many pulses or pixels as were looked at, or not [`Pieces::values`] for each pulse.
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
