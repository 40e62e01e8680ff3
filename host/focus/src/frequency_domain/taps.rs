//! Length of the interpolation kernels, and of the grids that they read or fill.

use subaperture_signal::fast_length::fast_length;

/// Taps of every kernel: -107 dB in one dimension ([`subaperture_signal::kaiser_bessel`]).
pub(crate) const TAPS: usize = 6;

/// Cells per period of a transform that is gridded or interpolated by a kernel: twice the retained wavenumbers.
pub(super) fn cells(num_bins: usize) -> usize {
    fast_length((2 * num_bins).max(2 * TAPS))
}
