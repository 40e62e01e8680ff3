//! Streaming processor: pulses in, motion-compensated range-Doppler maps of several patches out, in fixed buffers.
//!
//! **Equation.** Every pulse `m` of a sub-CPI of `M` pulses is motion-compensated to the patch centre `q` with its
//! own antenna positions, `rho_m(q) = path_m(q) - reference_path_m`. This removes the range, range migration
//! and phase curvature that are common to the patch. Keystone, Doppler and range transform then follow in one
//! sum. With `u_m = m - (M - 1)/2`, for `|d| <= doppler_reach` and `|r| <= range_reach` about the patch
//! centre:
//!
//! ```text
//! map[d][r] = 1/M  sum_k sum_m  w_f[k] w_m z[m][k] exp(+j 2 pi f_k rho_m(q) / c)
//!             exp(+j 2 pi (k - F/2) r / R)  exp(-j 2 pi (f_k / f_ref) u_m d / D)
//! ```
//!
//! A scatterer whose path relative to the patch centre is `a + b u_m` lies at
//! `r = a R step_hz / c`, `d = -b D f_ref / c` with the phase `-2 pi f_ref a / c`. Maps interpolated there and
//! multiplied by the conjugate phasor sum to the image (Schone 2020, chapter 3). The compensation removes the
//! quadratic phase and with it the grating lobes. Fast-time weights sum to 1. Slow-time weights `w_m` are
//! supplied with the pulses, so a window over the whole aperture can be used.
//!
//! **Data flow.** Two stores of raw pulses alternate: one fills while the other is processed. Pulses are stored
//! raw so that one store serves any number of patches. Compensation is applied as samples enter the transform.
//!
//! ```text
//! push -> store A | B [M][F] -> for each patch: column (compensate, Keystone) for each frequency
//!                               -> map [2Q+1][F] -> row (range, gate) for each Doppler bin -> map out
//! ```
//!
//! [`SubCpiProcessor`] controls the order of steps. An [`Engine`] does the arithmetic in steps of bounded
//! duration: [`FloatEngine`] in float32, [`FixedEngine`] in fixed point on 16-bit samples.
//!
//! # Memory
//! Every buffer is an array of a size known at compile time, with its size as a `BYTES` constant. There are three
//! kinds, by access pattern: the stores are large and every sample is written once; the map is large and accessed
//! throughout; the scratch buffers are small and accessed most. On a part with several memories each kind can be
//! placed separately. Sizes in bytes, with `B` exponent blocks per row, `P` patches and `rows` Doppler bins of
//! capacity; the figures are for `M = 30`, `F = 424`, `R = 1024`, 41 rows, 16 patches:
//!
//! | | float32 | | fixed point | |
//! |---|---|---|---|---|
//! | [`PulseStores`] | `16 M F + 144 M` | 207840 | `8 M F + 144 M` | 106080 |
//! | [`FloatMap`], [`FixedMap`] | `8 F rows` | 139072 | `(4 F + B + 1) rows + F` | 70576 |
//! | [`FloatScratch`], [`FixedScratch`] | `8 R + 40 M + 4 F + 32 P` | 11600 | `8 R + 48 M + 4 F + 32 P` | 11840 |
//!
//! (`tests/stream/memory.rs` checks these figures and that no other memory is used.)
//!
//! # Example
//! One sub-CPI and one patch. The scatterer's path is one range bin longer than that of the patch centre, and
//! shortens at a rate of one Doppler bin:
//!
//! ```
//! use subaperture_core::stream::{FloatBuffers, Patch, Progress, Setup};
//! use subaperture_core::{Pulse, SPEED_OF_LIGHT_M_S as C, Turns};
//!
//! // 8 pulses of 16 frequencies, range transforms of 32 points, 5 Doppler rows, 1 patch.
//! let mut buffers = FloatBuffers::<8, 16, 32, 5, 1>::new();
//! let mut processor = buffers.processor();
//! let setup = Setup {
//!     num_pulses: 8,
//!     num_channels: 1,
//!     num_frequencies: 16,
//!     range_length: 32,
//!     doppler_length: 16,
//!     start_hz: 1.0e9,
//!     step_hz: 1.0e6,
//! };
//! processor.configure(&setup)?;
//! let patch = Patch { centre_m: [0.0, 1000.0, 0.0], range_reach: 3, doppler_reach: 2 };
//! processor.set_patch(0, &patch)?;
//! processor.start(0)?;
//! // An antenna at rest at the origin, phases relative to the patch's centre: 2000 m there and back.
//! for m in 0..8 {
//!     let pulse = Pulse { number: m, reference_path_m: 2000.0, weight: 1.0, ..Pulse::EMPTY };
//!     let longer_m = C / (32.0 * 1.0e6) - C / (16.0 * 1.008e9) * (f64::from(m) - 3.5);
//!     let samples = (0..16u32).map(|k| {
//!         let frequency_hz = 1.0e9 + f64::from(k) * 1.0e6;
//!         Turns::from_f64(-frequency_hz * longer_m / C).phasor()
//!     });
//!     assert_eq!(processor.push(&pulse, samples), Ok(()));
//! }
//! while processor.work() == Progress::Busy {}
//! let map = processor.map().expect("eight of eight pulses");
//! // Phase at 1.008 GHz: a range bin is 31.5 wavelengths.
//! assert!((map.at(1, 1) + 1.0).l1_norm() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
// Links to items that are compiled out lead to the feature table.
#![cfg_attr(
    not(feature = "fixed"),
    doc = "[`FixedEngine`]: crate#features",
    doc = "[`FixedMap`]: crate#features",
    doc = "[`FixedScratch`]: crate#features"
)]

#[cfg(feature = "fixed")]
mod block_float;
mod counters;
mod engine;
#[cfg(feature = "fixed")]
mod fixed_buffers;
#[cfg(feature = "fixed")]
pub mod fixed_point;
mod float;
mod float_buffers;
mod map_samples;
mod patch;
mod processor;
mod sample;
mod setup;
mod stores;
mod track;

#[cfg(feature = "fixed")]
pub use block_float::{BlockFloat, power_of_two};
pub use counters::PulseCounters;
pub use engine::{Engine, Work};
#[cfg(feature = "fixed")]
pub use fixed_buffers::{FixedBuffers, FixedMap, FixedScratch};
#[cfg(feature = "fixed")]
pub use fixed_point::FixedEngine;
#[cfg(feature = "fixed")]
pub(crate) use float::compensation;
pub use float::{ANCHOR, FloatEngine, PulsePhase};
pub use float_buffers::{FloatBuffers, FloatMap, FloatScratch};
pub use map_samples::MapSamples;
pub use patch::{MapHeader, Node, Patch, PatchMap};
pub use processor::{Progress, PulseError, SubCpiProcessor};
pub use sample::Sample;
#[cfg(feature = "fixed")]
pub(crate) use sample::sealed::Sealed;
pub use setup::{Capacity, Quantity, Setup, SetupError};
pub use stores::{PulseStores, Store};
pub(crate) use track::node_offset_pulses;
pub use track::nodes;
