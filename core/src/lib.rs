//! Range-Doppler processing of short coherent processing intervals (sub-CPIs) in fixed memory.
//!
//! Pulses go in; range-Doppler maps, detections and image pixels come out. The crate is `no_std`, allocates
//! nothing and contains no `unsafe`. Processing stages work on slices whose lengths are checked at run time.
//! Types that own memory ([`stream::FloatBuffers`] and its parts, [`selftest::SelfTest`]) carry their sizes as const generics and state their size in
//! bytes as a constant, so the memory budget is known before the program runs. Stream buffers with invalid
//! sizes do not compile.
//!
//! This crate is the embedded part of [Subaperture](https://docs.rs/subaperture), a library for radar image
//! formation. The host side is the crate `subaperture`.
//!
//! # Two methods to form a range-Doppler map
//! - [`stream`]: for a processor that runs while data arrive. Pulses are pushed one at a time and stored raw.
//!   Calls of bounded duration turn each sub-CPI into one map per patch of the scene. Each map is
//!   motion-compensated to its patch centre with the antenna positions of every pulse, and covers the patch only.
//! - [`Plan`]: for batches, for comparing the two keystone transforms, and for verifying other implementations.
//!   A whole sub-CPI in one slice becomes the whole map in another slice, by the sinc keystone resampling of the
//!   thesis or by the exact chirp-z keystone ([`keystone`]). No geometry is needed.
//!
//! [`accumulate`] interpolates maps of either kind into complex pixels or sums their power. Maps of the stream
//! can also be searched for targets by [`cfar`], after cancellation of the clutter between two channels by [`dpca`],
//! and sent over a serial link by [`link`]. [`sweep`] computes range profiles of a stepped-frequency radar.
//!
//! # A plan's map
//! `M` pulses of `F` frequencies, `f[k] = start_hz + k step_hz`, reference frequency
//! `f_ref = f[F/2]` and reference pulse `M/2` (both divisions round down):
//!
//! ```text
//! map[d][r] = 1 / (sum w_f  sum w_s)  sum_k sum_m  w_f[k] w_s[m] z[m][k]
//!             exp(+j 2 pi (k - F/2)(r - R/2) / R)
//!             exp(-j 2 pi (f[k] / f_ref)(m - M/2)(d - D/2) / D)
//! ```
//!
//! This is range compression, keystone transform and Doppler transform in one sum (Schone 2020, chapter 3).
//! `R` and `D` are powers of two, `R >= F`, `D >= M`. Samples have the phase `-2 pi f path / c`, so an
//! approaching scatterer has positive Doppler. A scatterer of unit amplitude centred on a bin has the value 1. The range
//! bin spacing is `c / (R step_hz)` of two-way path; the Doppler bin spacing is `1 / D` cycles per pulse at
//! `f_ref`. The stream's map is defined in [`stream`]: its bins count from the patch centre and its pulses from
//! the middle of the sub-CPI.
//!
//! # Data flow
//! ```text
//! Plan    window -> history [F][M] -> keystone -> map [D][F] -> range -> map [D][R] -> accumulate
//! stream  push -> store [M][F] -> compensate, Doppler -> map [2Q+1][F] -> range, gate -> map out
//! ```
//! The modules [`window`], [`keystone`], [`range`] and [`accumulate`] are independent of each other. [`Plan`]
//! sets their order; [`stream::SubCpiProcessor`] sets the order of the stream. Only [`fft`] uses the FFT library.
//!
//! [`Plan`] and [`stream`] contain runnable examples.
//!
//! # Features
//! Always compiled: the keystone transform ([`Plan`] and its stages), [`Map`], and [`accumulate`] for whole maps, on
//! `num-complex`, `libm` and `microfft`. Optional:
//!
//! | feature | adds | needs | dependencies |
//! |---|---|---|---|
//! | `stream` | [`stream`] in float32, [`cfar`], [`dpca`], and [`accumulate`] for maps of patches | | `heapless`, for lists of detections |
//! | `fixed` | 16-bit samples, and the stream in fixed-point arithmetic without floating-point operations: `fixed_point` | `stream` | `fixed` |
//! | `link` | [`link`], the wire format of the embedded module; `serde` for the types it sends | `fixed` (both sample formats are sent), `motion` (increments are sent), `sweep` (range profiles are sent) | `cobs`, `crc`, `postcard`, `serde` |
//! | `selftest` | [`selftest`]: checksums that must be equal on every machine; includes the stream if `link` is on | | |
//! | `motion` | [`motion`]: pulse-to-pulse radar motion estimated from multichannel samples | | |
//! | `sweep` | [`sweep`]: range profiles of a stepped-frequency radar from two receivers' samples | | |
//! | `defmt` | `defmt::Format` for the types that a target logs | | `defmt` |
//!
//! All features except `defmt` are on by default. The linker drops what a program does not call, so disabling a
//! feature saves compile time and dependencies but does not make a program smaller.
//!
// Links to items that are compiled out lead to the feature table above.
#![cfg_attr(
    not(feature = "stream"),
    doc = "[`cfar`]: crate#features",
    doc = "[`dpca`]: crate#features",
    doc = "[`stream`]: crate#features",
    doc = "[`stream::FloatBuffers`]: crate#features",
    doc = "[`stream::SubCpiProcessor`]: crate#features"
)]
#![cfg_attr(not(feature = "link"), doc = "[`link`]: crate#features")]
#![cfg_attr(
    not(feature = "selftest"),
    doc = "[`selftest`]: crate#features",
    doc = "[`selftest::SelfTest`]: crate#features"
)]
#![cfg_attr(not(feature = "motion"), doc = "[`motion`]: crate#features")]
#![cfg_attr(not(feature = "sweep"), doc = "[`sweep`]: crate#features")]
#![no_std]
#![forbid(unsafe_code)]

pub mod accumulate;
mod axes;
#[cfg(feature = "stream")]
pub mod cfar;
#[cfg(feature = "stream")]
pub mod dpca;
pub mod fft;
pub mod keystone;
#[cfg(feature = "link")]
pub mod link;
mod map;
#[cfg(feature = "motion")]
pub mod motion;
mod plan;
#[cfg(feature = "stream")]
mod pulse;
pub mod range;
#[cfg(feature = "fixed")]
mod sample;
#[cfg(feature = "selftest")]
pub mod selftest;
#[cfg(feature = "stream")]
pub mod stream;
#[cfg(feature = "sweep")]
pub mod sweep;
mod turns;
pub mod window;

pub use axes::{Axes, ParamError, Shape};
pub use map::Map;
pub use num_complex::Complex32;
pub use plan::{LengthError, Params, Plan, Tables};
#[cfg(feature = "stream")]
pub use pulse::Pulse;
#[cfg(feature = "fixed")]
pub use sample::Sc16;
#[cfg(feature = "fixed")]
pub use stream::fixed_point;
pub use turns::Turns;
pub use window::Window;

/// Speed of light in vacuum in metres per second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// Runs the example of the README as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
