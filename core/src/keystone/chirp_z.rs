//! Exact keystone: Doppler transform scaled with frequency, by Bluestein's chirp-z algorithm.
//!
//! **Equation**, with `a = f[k] / f_ref`, `p = m - M/2`, `q = d - D/2`:
//!
//! ```text
//! out[d] = L sum_m z[m] exp(-j 2 pi a p q / D)
//!        = L c*(q) sum_p (z[p] c*(p)) c(q - p),    c(n) = exp(+j pi a n^2 / D)
//! ```
//!
//! This follows from `2 p q = p^2 + q^2 - (q - p)^2` (L. I. Bluestein 1970; Rabiner, Schafer and Rader 1969). The
//! sum over `p` is a circular convolution of length `L >= M + D - 1`, computed by three forward FFTs, of which the
//! last is read backwards. The caller folds the factor `L` into a window.
//!
//! **Neglected**: nothing; there are no edge effects. **Input**: `M` windowed samples of one frequency. **Output**: `D`
//! Doppler bins spaced `1/D` cycles per pulse at `f_ref`, zero Doppler at `D/2`, times `L`.
//!
//! **Cost.** Storing the kernel spectra of all frequencies would take `8 F L` bytes (64 KiB at `F = 64`,
//! `L = 128`; 0.9 MB at 424 and 256). The chirp is therefore recomputed for each frequency:
//! `D/2 + (M-1)/2 + 1` phasors from an exact integer recurrence. Memory is `24 L` bytes for any `F`. Operations are
//! three FFTs of `L` points and the phasors: 31 k instructions at `M = 32`, `D = L/2 = 64` under QEMU's Cortex-M7,
//! 22 k in the FFTs and 4 k in the phasors. On a target without float64 hardware a phasor takes 2.2 k
//! instructions instead of 76, and the whole transform 131 k.
//!
//! **Accuracy.** The phase of `c(n)` is `n^2` times an integer rate in units of `2^-64` turns, so it does not
//! degrade with `n`. Against float64: -132 dB or better (`tests/stream/map.rs`).
//!
//! ```
//! use num_complex::Complex32;
//! use subaperture_core::{Turns, keystone::chirp_z};
//! // Four constant pulses at 1.5 times the reference frequency add up in bin 8, zero Doppler.
//! let rate = chirp_z::rate(1.5, 16);
//! let mut out = [Complex32::ZERO; 16];
//! let mut scratch = [Complex32::ZERO; 3 * 32];
//! chirp_z::transform(rate, &[Complex32::ONE; 4], 16, &mut scratch, out.iter_mut());
//! assert!((out[8] / 32.0 - 4.0).l1_norm() < 1e-5);
//! // Bin 10 rotates pulse p by -1.5 * 2/16 = -3/16 of a turn times p, for p from -2 to 1.
//! let turn = |p: i64| Turns::from_f64(-3.0 / 16.0).times(p).phasor();
//! let sum = turn(-2) + turn(-1) + turn(0) + turn(1);
//! assert!((out[10] / 32.0 - sum).l1_norm() < 1e-5);
//! ```

use num_complex::Complex32;

use crate::{Turns, fft};

/// Chirp rate `a / (2 D)` in turns. `ratio` is `a = f[k] / f_ref`, below 2 for any band.
pub fn rate(ratio: f64, num_doppler_bins: usize) -> Turns {
    Turns::from_f64(ratio / (2 * num_doppler_bins) as f64)
}

/// Transform `pulses` to scaled Doppler and write the bins, times `L`, to `column`.
///
/// `scratch` must have `3 L` samples, `M` must be at least 1, `D` even, and `L` a length that [`fft::supports`]
/// accepts and at least `M + D - 1`, as [`crate::Plan::new`] ensures. Otherwise nothing is written to `column`.
pub fn transform<'a>(
    rate: Turns,
    pulses: &[Complex32],
    num_doppler_bins: usize,
    scratch: &mut [Complex32],
    column: impl Iterator<Item = &'a mut Complex32>,
) {
    let length = scratch.len() / 3;
    let least = pulses.len().saturating_add(num_doppler_bins);
    if pulses.is_empty() || least > length + 1 || !fft::supports(length) {
        debug_assert!(
            false,
            "chirp transform length: expected a power of two, at least M + D - 1"
        );
        return;
    }
    let mut parts = scratch.chunks_exact_mut(length.max(1));
    let (Some(chirp), Some(kernel), Some(work)) = (parts.next(), parts.next(), parts.next()) else {
        return;
    };

    // c(n) for all |n| of p, q and q - p; it is even in n. If M is odd the largest n occurs with one sign
    // only. Its mirror position in the kernel is then not read, or is the same position.
    let half = num_doppler_bins / 2;
    let Some(chirp) = chirp.get_mut(..half + pulses.len().div_ceil(2)) else {
        return;
    };
    let (mut phase, mut step) = (Turns(0), rate);
    for value in chirp.iter_mut() {
        *value = phase.phasor();
        phase = phase.plus(step);
        step = step.plus(rate.times(2));
    }
    kernel.fill(Complex32::ZERO);
    for (place, value) in kernel.iter_mut().zip(chirp.iter()) {
        *place = *value;
    }
    for (place, value) in kernel.iter_mut().rev().zip(chirp.iter().skip(1)) {
        *place = *value;
    }

    // Pulses with p >= 0 from the front, with p < 0 from the back.
    let (before, after) = pulses.split_at(pulses.len() / 2);
    work.fill(Complex32::ZERO);
    for ((place, sample), factor) in work.iter_mut().zip(after).zip(chirp.iter()) {
        *place = *sample * factor.conj();
    }
    let before = before.iter().rev().zip(chirp.iter().skip(1));
    for (place, (sample, factor)) in work.iter_mut().rev().zip(before) {
        *place = *sample * factor.conj();
    }
    fft::forward(kernel);
    fft::forward(work);
    for (value, factor) in work.iter_mut().zip(kernel.iter()) {
        *value *= *factor;
    }
    fft::forward(work);

    // Bin q of the inverse transform is at index -q: q = -D/2..0 at D/2..0, then from L-1 down.
    let (Some(near), Some(chirp)) = (work.get(..=half), chirp.get(..=half)) else {
        return;
    };
    let to_zero = near.iter().zip(chirp).rev();
    let positive = chirp.iter().skip(1).take(half.saturating_sub(1));
    let positive = work.iter().rev().zip(positive);
    for (out, (value, factor)) in column.zip(to_zero.chain(positive)) {
        *out = *value * factor.conj();
    }
}
