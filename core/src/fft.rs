//! Forward complex FFT in place. The only module that uses microfft.
//!
//! ```text
//! X[q] = sum_p x[p] exp(-j 2 pi p q / N)
//! ```
//! Unscaled, input and output in natural order. There is no inverse FFT: `X[-q mod N]` is `N` times the inverse
//! transform, and every stage of this crate can read its output backwards and fold `1/N` into a table.
//!
//! **Cost** in instructions under QEMU's Cortex-M7: 64 points 3.0 k, 256 points 17.4 k, 1024 points 90.9 k,
//! 4096 points 448 k. **Accuracy**: relative RMS error of -137 to -140 dB on noise.
//!
//! ```
//! use num_complex::Complex32;
//! let mut x = [Complex32::new(1.0, 0.0); 4];
//! subaperture_core::fft::forward(&mut x);
//! assert_eq!(x.map(|v| v.re), [4.0, 0.0, 0.0, 0.0]);
//! ```

use microfft::complex as library;
use num_complex::Complex32;

/// Maximum transform length.
pub const MAX_LENGTH: usize = 4096;

/// Whether [`forward`] supports `length`: a power of two from 2 to [`MAX_LENGTH`].
pub const fn supports(length: usize) -> bool {
    length.is_power_of_two() && length >= 2 && length <= MAX_LENGTH
}

/// Transform `buffer` in place.
///
/// A buffer whose length [`supports`] rejects is left unchanged. [`crate::Plan::new`] and the stream's
/// `Setup::check` reject such lengths first, and this function must not panic on a target.
// The code of all lengths is tens of kilobytes: never inlined, so that one copy exists.
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
                _ => debug_assert!(false, "FFT length: expected a power of two from 2 to 4096"),
            }
        };
    }
    dispatch!(
        2 => cfft_2, 4 => cfft_4, 8 => cfft_8, 16 => cfft_16, 32 => cfft_32, 64 => cfft_64,
        128 => cfft_128, 256 => cfft_256, 512 => cfft_512, 1024 => cfft_1024, 2048 => cfft_2048,
        4096 => cfft_4096
    );
}
