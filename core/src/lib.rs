//! Sub-CPI processing in bounded buffers: pulses in, range-Doppler maps and pixels out.
//!
//! No standard library, no allocator, no `unsafe`. Stage code works on slices whose lengths are
//! known at run time; only owners ([`SubCpi`], [`accumulate::CoherentGrid`],
//! [`accumulate::PowerMap`]) carry sizes in their types, so that every byte is accounted for before
//! the program runs, and impossible sizes do not compile.
//!
//! # The range-Doppler map
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
//! `c / (R step_hz)` of two-way path, a Doppler bin `1 / D` cycles a pulse at `f_ref`.
//!
//! # The way of the data
//! ```text
//! push -> window -> history [F][M] -> keystone -> map [D][F] -> range -> map [D][R] -> accumulate
//! ```
//! [`window`], [`keystone`], [`range`] and [`accumulate`] do not know each other; [`Plan`] and
//! [`Processor`] know their order. Only [`fft`] knows the FFT library.
//!
//! # Example
//! A scatterer one range bin beyond and one Doppler bin above the map's centre:
//!
//! ```
//! use subaperture_core::{ChirpZSubCpi, Params, Status, Turns, Window};
//!
//! // 8 pulses, 16 frequencies, 32 range bins, 16 Doppler bins, chirp transforms of 32 points.
//! let mut owner = ChirpZSubCpi::<8, 16, 32, 16, 32>::new();
//! let mut processor = owner.start(&Params {
//!     start_hz: 1.0e9,
//!     step_hz: 1.0e6,
//!     fast_window: Window::Rectangular,
//!     slow_window: Window::Rectangular,
//! })?;
//! for m in 0..8 {
//!     let pulse: [_; 16] = core::array::from_fn(|k| {
//!         let f = (1.0e9 + k as f64 * 1.0e6) / 1.008e9;
//!         let range = -(k as f64 - 8.0) / 32.0;
//!         let doppler = f * (m as f64 - 4.0) / 16.0;
//!         Turns::from_f64(range + doppler).phasor()
//!     });
//!     let status = processor.push(m, &pulse)?;
//!     assert_eq!(status == Status::Full, m == 7);
//! }
//! let map = processor.take_map().expect("eight of eight pulses");
//! assert!((map.at(8 + 1, 16 + 1) - 1.0).l1_norm() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

pub mod accumulate;
mod axes;
pub mod fft;
pub mod fixed_point;
pub mod keystone;
mod map;
mod plan;
mod pulse;
pub mod range;
mod sample;
pub mod selftest;
pub mod stream;
mod sub_cpi;
mod turns;
pub mod window;

pub use axes::{Axes, ParamError, Shape};
pub use map::Map;
pub use num_complex::Complex32;
pub use plan::{LengthError, Params, Plan, Tables};
pub use pulse::Pulse;
pub use sample::Sc16;
pub use sub_cpi::{ChirpZSubCpi, Processor, PushError, SincSubCpi, Status, SubCpi};
pub use turns::Turns;
pub use window::Window;

/// Speed of light in vacuum, metres a second (exact by definition).
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;
