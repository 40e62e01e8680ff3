//! Backprojection of some pulses onto the pixels of a tile, at the processor's limit.
//!
//! ```text
//! sum[p] += sum_n exp(+j 2 pi kappa_n t_n(p)) value_n(t_n(p)),   t_n(p) = bins_n (|p - t_n| + |p - r_n| - datum_n)
//! ```
//!
//! as of points ([`add_points`]), but
//! - **paths** are a polynomial of third degree over the tile (`expansion`), in float64 once a pulse and tile and once a group of
//!   16 pixels (`rows`); within the group of second degree, in float32, relative to the group's own bin;
//! - **profiles** are pieces of polynomials ([`Pieces`]);
//! - the **carrier** is turned from group to group, down a column of them (`turning`);
//! - **values** of a group's pixels lie in a window of 16 or 32 bins, which is loaded whole and looked up in registers. For that, a
//!   group is 16 x 1, 8 x 2 or 4 x 4 pixels (`shape`), along rows or columns, whichever looks across the beam. Where registers hold fewer
//!   than 16 numbers, each part of a group reads from 4 or 8 bins of its own, if these hold it.
//!
//! **Error** beside the profile's spline: what the polynomials leave out ([`TileScratch::look`]); float32 of places
//! within a window ([`PLACE_RMS`], bins, whose phase is `2 pi kappa` times that); the carrier's turning ([`PHASOR_RMS`]); sums in
//! float32 over the pulses of a call, then one more addition to `sums`.
//!
//! Every operation is rounded once and in the same order in all instruction sets: the result is the same bits.
//!
//! Cost: for each 16 pixels of a pulse some 18 + 4 d operations on 16 numbers, `d` the spline's degree; for each 16 groups of a column
//! some 150 more, and for each tile and pulse some 200 in float64.

mod adding;
mod expansion;
mod groups;
mod pieces;
mod points;
mod pulse;
mod rows;
mod scratch;
mod shape;
mod turning;

/// Degrees of splines that tiles are made of: in between, the least of work and of upsampling.
pub const DEGREES: [usize; 2] = [2, 3];

pub use crate::phasor::PHASOR_RMS;
pub use expansion::{Raster, left_out_m};
pub use pieces::{MOST_DEGREE, Pieces};
pub use points::add_points;
pub use pulse::TilePulse;
pub use scratch::TileScratch;
pub use shape::{PLACE_RMS, Window};
