//! Range profiles of a stepped-frequency radar from the samples of its two receivers (Chim 2018, chapter 5), for a module that sends profiles instead of samples.
//!
//! ```text
//! burst at a carrier: reference and echo samples ─> fold ─> block means ─> z_n, echo over reference
//! sweep: z_n of all carriers ─> window ─> inverse transform ─> profile
//! ```
//!
//! **Equation.** A tone with `P` samples per period is transmitted at each carrier and received by two channels. For channel `c` and block `b` of an integer number of periods, and over the blocks of a burst:
//!
//! ```text
//! x_c[b] = mean over the block of s_c[i] exp(-j 2 pi i / P)          z_n = sum_b x_1[b] conj(x_0[b]) / sum_b |x_0[b]|^2
//! p(r_l) = sum_n w_n z_n exp(+j 2 pi f_n 2 r_l / c),   r_l = l c / (2 R step_hz),   f_n = start_hz + n step_hz,   l = 0 .. R-1
//! ```
//!
//! A scatterer with `z_n = exp(-j 2 pi f_n 2 r / c)` has the sum of the weights as its value at its range. This is
//! (5.4) to (5.11) with the phase sign of this project.
//!
//! The mean takes no product per sample: samples are summed by their position in the period, exactly, in integers. Only the
//! `P` sums of a block are multiplied by the tone.
//!
//! **Incomplete data** is handled like the host's radio does, as far as bounded memory permits:
//! - A block with a missing sample is excluded from its burst's mean. Samples are missing if the next ones received have a
//!   higher index.
//! - A burst is rejected if less than half of it was received, or if its reference deviates from a tone by more than 0.3:
//!   the largest relative amplitude deviation, or phase deviation in radians from a straight line, over the blocks. Of
//!   several bursts at a carrier in a sweep the one with the steadiest reference is used.
//! - There is no profile if fewer than two thirds of the carriers are usable. Missing carriers are zero, as on the host if
//!   echoes may lie anywhere within the unambiguous range. The host fills gaps by least squares if echoes are known to be
//!   nearer, with a matrix over all carriers; this module does not.
//!
//! **Input**: samples with a full scale of 32768. **Output**: `R` values, and the numbers of carriers and samples used.
//! **Memory**: [`Profiler::BYTES`]. **Cost**: four integer sums per sample pair, `2 P` complex products per block, and per
//! sweep one transform of `R` points and one phasor per bin. **Accuracy** (`tests/stream/sweep.rs`): -115 dB or better
//! against the host's float64 profiles; bit-identical on every machine (`selftest::SweepSelfTest`). **Errors**:
//! [`SetupError`], [`BurstError`].
//!
//! **Neglected**, as by the host: a frequency offset between both sides within a block. A block is a sixteenth of a burst of
//! any length, while the host's are at most a quarter of a millisecond. In bursts longer than 4 ms the blocks are longer
//! here, and over a block of `T` seconds an offset `d` attenuates both channels alike by `sinc(d T)`: for bursts of 20 ms
//! and 800 Hz only noise remains. Also neglected: motion within a sweep. Empty scene and cable delays are not removed;
//! profiles are linear and start at an arbitrary range, so the reader of the profiles subtracts them.

mod profiler;
mod setup;
mod tone;

pub use profiler::{BurstError, Profiler, SweepProfile};
pub use setup::{Quantity, Setup, SetupError};
