//! Displaced phase centre antenna (DPCA): clutter cancellation between the maps of two channels.
//!
//! **Geometry.** The phase centre of a channel is the middle between its transmitter and its receiver. Channel 1 passes every
//! along-track position the lag `tau` after channel 0: `tau` is the separation of the phase centres over the platform speed,
//! `L = tau PRF` pulses, any real number but 0, negative if channel 1 is ahead. At the same position both channels have the same
//! path to a stationary scatterer.
//!
//! **Equation.** Both maps are compensated to the patch centre with the antennas of their own channel ([`crate::stream`]). The path
//! of a stationary scatterer relative to the patch centre is `a + b u_m` in channel 0. In channel 1 it is `a + b (u_m - L)`: the
//! compensation removes the lag of the patch centre and leaves that of the Doppler offset `d = -b D f_ref / c` from it. With slow-time
//! weights `w(u)` in channel 0 and `w(u - L)` in channel 1 ([`Dpca::weight`]) the maps of stationary scatterers are related, in every cell
//! `(d, r)` of the response and not only at its peak, by
//!
//! ```text
//! x_1 = g x_0 exp(-j 2 pi d L / D)                        g: complex gain of channel 1 relative to channel 0
//! y_0 = x_0 exp(-j 2 pi d L / D),   h = 1 / g             kept map, gain
//! difference = h x_1 - y_0                                searched by CFAR
//! ```
//!
//! A target with the radial velocity `v_r`, positive when it approaches, has the phase `4 pi v_r tau / lambda` between the aligned
//! values `h x_1 exp(+j 2 pi d L / D)` and `x_0` ([`Difference::values`]).
//!
//! **Alignment.** Three methods were considered. *The phase by Doppler alone*, with equal weights in both channels: they then weight different
//! sections of the track, and the difference has the power `13 (L / M)^2` of the clutter in one channel for a Hann window, a cancellation of
//! 16 dB for `L = 2`, `M = 32`. *Pairs of pulses* shifted by `L`: exact, for whole `L` only. *That phase and the displaced window*, built here: both channels
//! sample the same integral over the section that both pass, at positions displaced by the fractional part of `L`. For whole `L` the samples
//! coincide as with shifted pulses. For other `L` they differ by aliases, which the Hann window suppresses as long as the clutter's
//! Doppler bandwidth is below the PRF: 57 dB for `L = 2`, 61 dB for `L = 1.37` (`tests/stream/dpca.rs`, limited by the bandwidth, see below).
//! The displaced window costs the module no operation: weights come with the pulses, and the host sends those of [`Dpca::weight`].
//!
//! **Gain** ([`Balance`]), estimated on the module for each patch and sub-CPI: for every range bin the least-squares factor from channel 1 to
//! channel 0 over all Doppler bins,
//!
//! ```text
//! h_r = sum_d y_0 conj(x_1) / sum_d |x_1|^2,   h = median_r Re h_r + j median_r Im h_r
//! ```
//!
//! Only range bins with a squared coherence above 1/2 count; without any, `h` is 1. The variance of `h` is `pi / 2 (1 - |rho|^2) |h|^2 / N` for `N`
//! independent cells, so that it raises the power of the difference by the factor `1 + pi / (2 N)`. A target changes the ratios of
//! its own range bins only: a fraction `e` of them moves each median by at most the quantile `e / (2 - 2 e)` from the middle, 0.14 standard
//! deviations of `h_r` for `e = 0.1`, whatever the power of the target. The host cannot know this gain better: receivers drift, and
//! the module alone has the samples.
//!
//! **Cancellation.** The ratio of the power of both channels to that of the difference is at most `1 / (1 - |rho|)`, `rho` the coherence of
//! clutter and noise: `1 + CNR` for stationary clutter of the clutter-to-noise ratio `CNR`.
//!
//! **Neglected**:
//! - The lag within the band: at the frequency `f_k` the Doppler phase is larger by `f_k / f_ref`. With the bandwidth `B` the cancellation is at
//!   most `24 / (2 pi d L / D)^2 (f_ref / B)^2`: 48 dB at `d L / D = 0.31` cycles and `B / f_ref = 1 %`.
//! - Variation of the gain over Doppler and range within a patch, by antenna patterns or a baseline across the track.
//! - Variation of the speed: the lag is one number for the whole run. An error of `dL` pulses leaves the power `(2 pi d dL / D)^2`.
//!
//! **Ambiguity.** The difference has `4 sin^2(phi / 2)` of the target's power, `phi = 4 pi v_r tau / lambda`. Targets are lost near the blind
//! velocities `n lambda / (2 tau)`, `n = 0` included, and velocities that differ by `lambda / (2 tau)` have the same phase. A
//! target much weaker than the clutter in its cell is detected, but the phase of its values is that of the sum of clutter and target, pulled toward 0:
//! two channels do not suffice to separate them. With a target stronger by the amplitude ratio `a > 1` the phase is within `2 asin(1 / a)`.
//!
//! **Memory**: a kept map and one row, `(2Q + 2)(2G + 1)` complex float32 values ([`Dpca::kept_len`]) that the caller lends, in both arithmetics. **Cost**: a
//! step of keeping is a Doppler row, a step of balancing is a range bin or one of 33 passes over the range bins. **Accuracy**: float32
//! rounding; maps in fixed point are rounded to 16 bits per block, which bounds the cancellation near 70 dB (`tests/stream/dpca.rs`).
//!
//! **Errors**: [`DpcaError`].
//!
//! ```
//! use subaperture_core::dpca::Dpca;
//! // Four pulses, channel 1 one pulse behind: the window has moved by one pulse, and its mean is 1.
//! let dpca = Dpca { lag_pulses: 1.0 };
//! let weights = |channel| [0, 1, 2, 3].map(|pulse| dpca.weight(channel, pulse, 4));
//! assert_eq!(weights(0)[..3], weights(1)[1..]);
//! assert!((weights(0).iter().sum::<f32>() - 4.0).abs() < 1e-6);
//! ```
mod balance;
mod difference;
mod settings;

pub use balance::Balance;
pub use difference::Difference;
pub use settings::{Dpca, DpcaError};
