//! Sub-CPI processing in bounded buffers: pulses in, range-Doppler maps and pixels out.
//!
//! No standard library, no allocator, no `unsafe`. Stage code works on slices whose lengths are
//! known at run time. What owns memory ([`stream::FloatBuffers`] and its parts,
//! [`accumulate::CoherentGrid`], [`accumulate::PowerMap`], [`selftest::SelfTest`]) carries its sizes in
//! its type and states its bytes as a constant, so that all memory is accounted for before the program
//! runs; stream buffers of sizes that cannot be do not compile.
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
//! also searched for targets by [`cfar`] and sent over a serial line by [`link`].
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
//! # Example
//! A stream of one sub-CPI and one patch. The scatterer's path is one range bin longer than that of the
//! patch's centre, and shrinks by one Doppler bin:
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
//! [`Plan`] has an example of its own.
#![no_std]
#![forbid(unsafe_code)]

pub mod accumulate;
mod axes;
pub mod cfar;
pub mod fft;
pub mod fixed_point;
pub mod keystone;
pub mod link;
mod map;
mod plan;
mod pulse;
pub mod range;
mod sample;
pub mod selftest;
pub mod stream;
mod turns;
pub mod window;

pub use axes::{Axes, ParamError, Shape};
pub use map::Map;
pub use num_complex::Complex32;
pub use plan::{LengthError, Params, Plan, Tables};
pub use pulse::Pulse;
pub use sample::Sc16;
pub use turns::Turns;
pub use window::Window;

/// Speed of light in vacuum, metres a second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;
