//! Signal chain of a radar: gain, noise figure, compression and quantisation from the exciter to the converter.
//!
//! A chain is a cascade of matched two-ports (Chim 2018, 5.3 and Appendix A). With gain `G_i` and noise factor `F_i` of stage `i`, the
//! first `n` stages have
//!
//! ```text
//! gain           G = G_1 G_2 ... G_n
//! noise factor   F = F_1 + (F_2 - 1) / G_1 + (F_3 - 1) / (G_1 G_2) + ...        Friis
//! ```
//!
//! A passive stage at 290 K has its loss as noise factor. A signal of power `S` at the receive antenna's port has at the output of these
//! stages the power `S G` and the signal-to-noise ratio `S / (k_B (T_a + (F - 1) T_0) B)` of [`radar_equation`](crate::radar_equation).
//! The noise bandwidth `B` is the complex sample rate of the converter.
//!
//! **Signals.** Levels are linear: a stage that compresses is reported, and the levels after it are those without compression.
//!
//! - The echoes are those of the chain's cross-section at the centre, the nearest and the farthest corner of the scene.
//! - The leakage from transmitter to receiver is the transmitted power less the isolation.
//! - The largest amplitude is that of leakage and nearest echo in phase. It is compared with the output 1 dB compression point of each stage.
//!
//! **Converter.** A tone at full scale has the signal-to-quantisation-noise ratio `6.02 b + 1.76 dB` with `b` effective bits
//! (`3/2 4^b`), for I and Q together as for each of them. The dynamic range is the ratio of two levels at the converter's input:
//!
//! - upper limit: the lowest of full scale and the compression points multiplied by the gain after their stage;
//! - lower limit: the larger of thermal noise and quantisation noise.
//!
//! The SNR after the converter includes both noise powers. Pulse compression multiplies it by `T B`, with `T` the time that the transmitter
//! is on in a pulse or a sweep, and an image of `N` pulses by `N`.
//!
//! Neglected: mismatch, filters narrower than the sample rate, intermodulation, phase noise of the leakage.

pub mod example;
mod keys;
mod levels;

pub use keys::{Chain, ChainError, Converter, Stage, reference};
pub use levels::{ChainLevels, ConverterLevels, ReceiveLevels, TransmitLevels};
