//! The discrete Fourier transform, forward and in place: the only module that knows microfft.
//!
//! ```text
//! X[q] = sum_p x[p] exp(-j 2 pi p q / N)
//! ```
//! Unscaled, input and output in natural order. There is no inverse: `X[-q mod N]` is `N` times the
//! inverse transform, and every stage here can read its output backwards and fold `1/N` into a
//! table.
//!
//! **Cost** under QEMU's Cortex-M7, instructions: 64 points 3.0 k, 256 17.4 k, 1024 90.9 k, 4096
//! 448 k. **Accuracy**: relative RMS error of -137 to -140 dB on noise.
//!
//! ```
//! use num_complex::Complex32;
//! let mut x = [Complex32::new(1.0, 0.0); 4];
//! subaperture_core::fft::forward(&mut x);
//! assert_eq!(x.map(|v| v.re), [4.0, 0.0, 0.0, 0.0]);
//! ```

use microfft::complex as library;
use num_complex::Complex32;

/// Longest transform.
pub const MAX_LENGTH: usize = 4096;

/// Whether [`forward`] takes `length` points: a power of two from 2 to [`MAX_LENGTH`].
pub const fn supports(length: usize) -> bool {
    length.is_power_of_two() && length >= 2 && length <= MAX_LENGTH
}

/// Transforms `buffer` in place.
///
/// A buffer of a length that [`supports`] does not admit is left as it is: [`crate::Plan::new`] and
/// the stream's `Setup::check` admit no others, and a target must not be able to panic here.
// All lengths' code is tens of kilobytes: once, and not wherever it is called.
#[inline(never)]
pub fn forward(buffer: &mut [Complex32]) {
    let length = buffer.len();
    macro_rules! dispatch {
        ($($length:literal => $transform:ident),*) => {
            match length {
                $($length => {
                    if let Ok(array) = buffer.try_into() {
                        let _ = library::$transform(array);
                    }
                })*
                _ => debug_assert!(false, "an FFT has 2 to 4096 points, a power of two"),
            }
        };
    }
    dispatch!(
        2 => cfft_2, 4 => cfft_4, 8 => cfft_8, 16 => cfft_16, 32 => cfft_32, 64 => cfft_64,
        128 => cfft_128, 256 => cfft_256, 512 => cfft_512, 1024 => cfft_1024, 2048 => cfft_2048,
        4096 => cfft_4096
    );
}
