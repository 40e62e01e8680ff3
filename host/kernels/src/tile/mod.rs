//! Backprojection of pulses onto the pixels of a tile.
//!
//! ```text
//! sum[p] += sum_n exp(+j 2 pi kappa_n t_n(p)) value_n(t_n(p)),   t_n(p) = bins_n (|p - t_n| + |p - r_n| - datum_n)
//! ```
//!
//! The result is that of [`add_points`]; the method differs:
//! - **paths** are a third-degree polynomial over the tile (`expansion`), evaluated in float64 once per pulse and tile and once per group of
//!   16 pixels (`rows`); within a group a second-degree polynomial in float32, relative to the group's own bin;
//! - **profiles** are piecewise polynomials ([`Pieces`]);
//! - the **carrier** is a phasor recurrence from group to group, down a column (`turning`);
//! - **values** of a group's pixels lie in a window of 16 or 32 bins, loaded once and looked up in registers. For that, a
//!   group is 16 x 1, 8 x 2 or 4 x 4 pixels (`shape`), along rows or columns, whichever is across the beam. With fewer
//!   than 16 lanes, each part of a group uses 4 or 8 bins of its own where these suffice.
//!
//! **Accuracy** apart from the profile's spline: truncation of the polynomials ([`TileScratch::look`]); float32 positions
//! within a window ([`PLACE_RMS`] bins, with a phase of `2 pi kappa` times that); the phasor recurrence ([`PHASOR_RMS`]);
//! float32 sums over the pulses of a call, plus one addition to `sums`.
//!
//! The result is bit-identical in all instruction sets.
//!
//! **Cost** per pulse and 16 pixels: about 18 + 4 d vector operations, `d` the degree of the spline; about 150 more per 16 groups of a
//! column, and about 200 in float64 per tile and pulse.

mod adding;
mod carrier_recurrence;
mod expansion;
mod groups;
mod pieces;
mod points;
mod pulse;
mod rows;
mod scratch;
mod shape;

/// Supported spline degrees: the best trade-offs of arithmetic and upsampling.
pub const DEGREES: [usize; 2] = [2, 3];

pub use crate::phasor::PHASOR_RMS;
pub use expansion::{Expansion, Raster, left_out_m};
pub use pieces::{MAX_DEGREE, Pieces};
pub use points::add_points;
pub use pulse::TilePulse;
pub use scratch::TileScratch;
pub use shape::{PLACE_RMS, Window};
