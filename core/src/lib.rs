//! Sub-CPI processing in bounded buffers: pulses in, range-Doppler maps and pixels out.
//!
//! No standard library, no allocator, no `unsafe`. Stage code works on slices whose lengths are
//! known at run time. What owns memory ([`stream::FloatBuffers`] and its parts,
//! [`accumulate::CoherentGrid`], [`accumulate::PowerMap`], [`selftest::SelfTest`]) carries its sizes in
//! its type and states its bytes as a constant, so that all memory is accounted for before the program
//! runs; stream buffers of sizes that cannot be do not compile.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the host's side is the crate `subaperture`.
//!
//! # Two ways to a map
//! - [`stream`]: pulses come one at a time and are stored raw; a bounded piece of work at a time, they
//!   become a map of each patch of the scene, compensated to its centre with each pulse's antenna
//!   positions, and only as large as the patch. For a processor that runs as the data come.
//! - [`Plan`]: a whole sub-CPI in a slice becomes the whole map in another, by the thesis's sinc
//!   Keystone or by the exact one ([`keystone`]), without knowledge of any geometry. For batches, for the
//!   comparison of the two forms, and for checking another implementation against this one.
//!
//! Maps of either way are read into pixels or summed as power by [`accumulate`]; those of the stream are
//! also searched for targets by [`cfar`] and sent over a serial line by [`link`]. A radar that steps its carrier
//! has range profiles of [`sweep`] instead.
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
//! (Schone 2020, chapter 3: range compression, Keystone and Doppler transform in one sum.) `R` and
//! `D` are powers of two, `R >= F`, `D >= M`. Samples have the phase `-2 pi f path / c`, so an
//! approaching scatterer has positive Doppler; a unit scatterer on a bin reads 1. A range bin is
//! `c / (R step_hz)` of two-way path, a Doppler bin `1 / D` cycles a pulse at `f_ref`. The stream's map
//! is defined at [`stream`]; it counts bins from the patch's centre and pulses from the middle of the
//! sub-CPI.
//!
//! # The way of the data
//! ```text
//! Plan    window -> history [F][M] -> keystone -> map [D][F] -> range -> map [D][R] -> accumulate
//! stream  push -> store [M][F] -> compensate, Doppler -> map [2Q+1][F] -> range, gate -> map out
//! ```
//! [`window`], [`keystone`], [`range`] and [`accumulate`] do not know each other; [`Plan`] knows their
//! order, [`stream::SubCpiProcessor`] that of the stream. Only [`fft`] knows the FFT library.
//!
//! [`Plan`] and [`stream`] have an example each.
//!
//! # Features
//! The Keystone is always there: [`Plan`] and its stages, [`Map`], and [`accumulate`] for whole maps, on
//! `num-complex`, `libm` and `microfft`. What more there is:
//!
//! | feature | adds | needs | dependencies |
//! |---|---|---|---|
//! | `stream` | [`stream`] in float32, [`cfar`], and [`accumulate`] for maps of patches | | `heapless`, for lists of detections |
//! | `fixed` | 16-bit samples, and the stream in fixed point without floating-point arithmetic: `fixed_point` | `stream` | `fixed` |
//! | `link` | [`link`], the wire format of a module; `serde` for what it sends | `fixed`: both forms of samples are sent; `motion`: increments too; `sweep`: profiles too | `cobs`, `crc`, `postcard`, `serde` |
//! | `selftest` | [`selftest`]: checksums that every machine must get; of the stream too if there is `link` | | |
//! | `motion` | [`motion`]: a radar's motion from pulse to pulse, of the samples of its channels | | |
//! | `sweep` | [`sweep`]: range profiles of a stepped-carrier radar, of the counts of its two receivers | | |
//! | `defmt` | log formatting of everything that is logged on a target | | `defmt` |
//!
//! The first six are on unless `default-features = false`: a program holds only what it calls, whatever
//! the features, so that leaving one out saves compiling and dependencies, and makes no program smaller.
//!
// Names of what is not there lead to the table above.
#![cfg_attr(
    not(feature = "stream"),
    doc = "[`cfar`]: crate#features",
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

/// Speed of light in vacuum, metres a second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// The crate's page on crates.io, whose example is run with the others.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
