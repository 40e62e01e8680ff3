//! A stepped-carrier radar's range profiles, from the counts of its two receivers (Chim 2018, chapter 5), so that a module beside the radio can send profiles instead of samples.
//!
//! ```text
//! burst at a carrier: reference and echo, counts ─> fold ─> mean of a block ─> z_n, echo over reference
//! sweep: z_n of all carriers ─> window ─> inverse transform ─> profile
//! ```
//!
//! **Equation.** A tone of `P` samples a period is sent at each carrier and received twice. Of channel `c` and block `b` of a whole number of periods, and over the blocks of a burst,
//!
//! ```text
//! x_c[b] = mean over the block of s_c[i] exp(-j 2 pi i / P)          z_n = sum_b x_1[b] conj(x_0[b]) / sum_b |x_0[b]|^2
//! p(r_l) = sum_n w_n z_n exp(+j 2 pi f_n 2 r_l / c),   r_l = l c / (2 R step_hz),   f_n = start_hz + n step_hz,   l = 0 .. R-1
//! ```
//!
//! so that a scatterer of `z_n = exp(-j 2 pi f_n 2 r / c)` reads the sum of the weights at its range. That is (5.4) to (5.11) with the sign of phases that all of this project has.
//!
//! The mean needs no product a sample: counts are added up by their place in the period, in integers and so without error, and only the `P` sums of a block meet the tone.
//!
//! **Rules** for what is not whole, those of the host's radio where a bounded module can:
//! - A block of which a sample is missing is left out of its burst's mean. Samples are missing where the next that come are farther on.
//! - A burst of which less than half came, or whose reference is off its tone by more than 0.3 (the greatest part of its amplitude, or radians of its phase off a straight line, from
//!   block to block), is left out. Of several bursts at a carrier in a sweep that of the steadiest reference counts. A late burst is none: it is not given.
//! - With less than two carriers of three there is no profile. Those that are missing are zero: what the host does if echoes may lie anywhere up to the range at which they repeat. It fills gaps by least
//!   squares where they are known to lie nearer, in a matrix of all carriers: that is not done here.
//!
//! **Input** counts in full scale 32768. **Output** `R` values, and how many carriers and samples they are made of. **Memory** [`Profiler::BYTES`]. **Cost** four sums of integers a sample of both channels, `2 P` products
//! of complex numbers a block, a transform of `R` and a phasor a bin a sweep. **Accuracy** (`tests/stream/sweep.rs`) profiles to -115 dB and better of the host's, which are float64; the same bits on every
//! machine (`selftest::SweepSelfTest`). **Errors** [`SetupError`], [`BurstError`].
//!
//! **Neglected**: what the host's mixing neglects: a difference of frequency of both sides within a block. Blocks are a sixteenth of a burst however long it is; the host's are a quarter of a millisecond
//! at the most. Of bursts longer than 4 ms, blocks are longer here, and of `T` seconds a difference `d` weakens both channels by `sinc(d T)`, alike: of 20 ms and 800 Hz nothing is left but noise. Motion within a sweep; the empty scene and cables, for profiles are linear and their range begins
//! anywhere: whoever reads them takes those off.

mod profiler;
mod setup;
mod tone;

pub use profiler::{BurstError, Profiler, SweepProfile};
pub use setup::{Quantity, Setup, SetupError};
