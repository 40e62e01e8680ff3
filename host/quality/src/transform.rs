//! Two-dimensional discrete Fourier transform, in place, without normalisation.

use num_complex::Complex64;
use subaperture_fft::{FftDirection, Real, Transforms};

/// Transform `data` (`rows` x `columns`) along both axes.
pub(super) fn transform(
    data: &mut [Complex64],
    rows: usize,
    columns: usize,
    direction: FftDirection,
) {
    f64::plan(Transforms::Fastest, columns, direction).process(data);
    let down = f64::plan(Transforms::Fastest, rows, direction);
    let mut scratch = vec![Complex64::ZERO; down.get_inplace_scratch_len()];
    let mut column = vec![Complex64::ZERO; rows];
    for first in 0..columns {
        for (to, from) in column.iter_mut().zip(data[first..].iter().step_by(columns)) {
            *to = *from;
        }
        down.process_with_scratch(&mut column, &mut scratch);
        for (to, from) in data[first..].iter_mut().step_by(columns).zip(&column) {
            *to = *from;
        }
    }
}

/// Signed frequency of bin `k` of `n`, cycles over the whole length: -n/2 to n/2.
pub(super) fn signed(k: usize, n: usize) -> f64 {
    if 2 * k < n {
        k as f64
    } else {
        k as f64 - n as f64
    }
}
