//! FFT with bit-identical results on every machine.
//!
//! rustfft chooses algorithms by the processor, and computes roots of unity with the platform's library. Here the
//! algorithm depends only on the length, roots are computed by libm, and each operation is rounded once.
//!
//! With `N = r m` and stride `s` (one transform for each `q` = 0 .. s-1), a pass of radix `r` computes (Stockham)
//!
//! ```text
//! y[q + s (r p + k)] = exp(-j 2 pi p k / N) sum_i x[q + s (p + m i)] exp(-j 2 pi i k / r),   p = 0 .. m-1, k = 0 .. r-1
//! ```
//!
//! which leaves transforms of `m` values with stride `r s`; after all passes the values are in order. Radices are 4,
//! then 2, 3, 5, 7, 11 and 13. A length with another prime factor is computed as a correlation with a chirp
//! (Bluestein), by transforms of at least twice its length, a power of 2.
//!
//! Cost: two to four times that of rustfft. Error: about `1e-7 sqrt(log2 N)` of the RMS value in float32.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Direction, Fft, FftDirection, FftNum, Length};

/// Radices in the order in which a length is factored.
const RADICES: [usize; 7] = [4, 2, 3, 5, 7, 11, 13];

/// Make a plan for `length` values.
pub(crate) fn plan<T: FftNum>(length: usize, direction: FftDirection) -> Arc<dyn Fft<T>> {
    match Passes::new(length, direction) {
        Some(passes) => Arc::new(passes),
        None => Arc::new(Chirp::new(length, direction)),
    }
}

/// Root of unity `exp(-j 2 pi i / n)` for forward transforms, its conjugate for inverse ones.
fn root<T: FftNum>(i: usize, n: usize, direction: FftDirection) -> Complex<T> {
    // Nearest quarter turn and exact remainder.
    let (i, n) = (i as u128, n as u128);
    let quarter = (8 * i + n) / (2 * n);
    let left = (4 * i) as i128 - (quarter * n) as i128;
    let (sin, cos) = libm::sincos(FRAC_PI_2 * left as f64 / n as f64);
    let (re, im) = match quarter % 4 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    };
    let im = match direction {
        FftDirection::Forward => -im,
        FftDirection::Inverse => im,
    };
    Complex::new(number(re), number(im))
}

fn number<T: FftNum>(value: f64) -> T {
    T::from_f64(value).expect("conversion from float64")
}

/// Pass of one radix.
struct Pass<T> {
    radix: usize,
    /// Length of the remaining transforms.
    count: usize,
    stride: usize,
    /// Twiddle factors of each `p`, for `k` = 1 .. radix-1.
    twiddles: Vec<Complex<T>>,
    /// Roots of unity of the radix.
    roots: Vec<Complex<T>>,
}

/// Mixed-radix transform by passes.
struct Passes<T> {
    length: usize,
    direction: FftDirection,
    passes: Vec<Pass<T>>,
}

impl<T: FftNum> Passes<T> {
    /// Make the passes; `None` for a length with prime factors other than the radices.
    fn new(length: usize, direction: FftDirection) -> Option<Self> {
        let mut passes = Vec::new();
        let (mut left, mut stride) = (length.max(1), 1);
        for radix in RADICES {
            while left.is_multiple_of(radix) {
                let count = left / radix;
                let twiddles = (0..count)
                    .flat_map(|p| (1..radix).map(move |k| root(p * k, left, direction)))
                    .collect();
                passes.push(Pass {
                    radix,
                    count,
                    stride,
                    twiddles,
                    roots: (0..radix).map(|i| root(i, radix, direction)).collect(),
                });
                (left, stride) = (count, stride * radix);
            }
        }
        (left == 1).then_some(Self {
            length,
            direction,
            passes,
        })
    }

    /// Compute one transform in place; `other` has the same length.
    fn transform(&self, values: &mut [Complex<T>], other: &mut [Complex<T>]) {
        let mut swapped = false;
        for pass in &self.passes {
            match swapped {
                false => pass.run(values, other),
                true => pass.run(other, values),
            }
            swapped = !swapped;
        }
        if swapped {
            values.copy_from_slice(other);
        }
    }
}

impl<T: FftNum> Pass<T> {
    fn run(&self, from: &[Complex<T>], to: &mut [Complex<T>]) {
        match self.radix {
            2 => self.butterflies(from, to, |[a, b]| [a + b, a - b]),
            4 => {
                // Root of unity of a quarter turn: -j or j.
                let sign = self.roots[1].im;
                self.butterflies(from, to, |[a, b, c, d]| {
                    let (even, odd) = (a + c, a - c);
                    let (sum, difference) = (b + d, b - d);
                    let rotated = Complex::new(-difference.im * sign, difference.re * sign);
                    [even + sum, odd + rotated, even - sum, odd - rotated]
                });
            }
            3 => self.odd::<3>(from, to),
            5 => self.odd::<5>(from, to),
            7 => self.odd::<7>(from, to),
            11 => self.odd::<11>(from, to),
            _ => self.odd::<13>(from, to),
        }
    }

    /// Pass of an odd radix: inputs `i` and `R - i` have conjugate roots.
    fn odd<const R: usize>(&self, from: &[Complex<T>], to: &mut [Complex<T>]) {
        let roots: [Complex<T>; R] = std::array::from_fn(|i| self.roots[i]);
        self.butterflies(from, to, |x: [Complex<T>; R]| {
            let mut y = [x[0]; R];
            for i in 1..=R / 2 {
                y[0] = y[0] + (x[i] + x[R - i]);
            }
            for k in 1..=R / 2 {
                let (mut along, mut across) = (x[0], Complex::new(T::zero(), T::zero()));
                for i in 1..=R / 2 {
                    let (sum, difference) = (x[i] + x[R - i], x[i] - x[R - i]);
                    let root = roots[i * k % R];
                    along = along + sum * root.re;
                    across = across + difference * root.im;
                }
                let across = Complex::new(-across.im, across.re);
                (y[k], y[R - k]) = (along + across, along - across);
            }
            y
        });
    }

    #[inline(always)]
    fn butterflies<const R: usize>(
        &self,
        from: &[Complex<T>],
        to: &mut [Complex<T>],
        butterfly: impl Fn([Complex<T>; R]) -> [Complex<T>; R],
    ) {
        let (count, stride) = (self.count, self.stride);
        let inputs: [&[Complex<T>]; R] =
            std::array::from_fn(|i| &from[stride * count * i..][..stride * count]);
        let outputs = to[..R * count * stride].chunks_exact_mut(R * stride);
        let twiddles = self.twiddles.chunks_exact(R - 1);
        for (p, (out, twiddles)) in outputs.zip(twiddles).enumerate() {
            let inputs = inputs.map(|input| &input[stride * p..][..stride]);
            let mut rest = out;
            let outputs: [&mut [Complex<T>]; R] = std::array::from_fn(|_| {
                let (first, others) = std::mem::take(&mut rest).split_at_mut(stride);
                rest = others;
                first
            });
            for q in 0..stride {
                let y = butterfly(std::array::from_fn(|i| inputs[i][q]));
                outputs[0][q] = y[0];
                for k in 1..R {
                    outputs[k][q] = y[k] * twiddles[k - 1];
                }
            }
        }
    }
}

/// Transform of any length as a correlation (Bluestein): `i k = (i^2 + k^2 - (k - i)^2) / 2`.
struct Chirp<T> {
    direction: FftDirection,
    /// Chirp `exp(-j pi i^2 / N)`.
    chirp: Vec<Complex<T>>,
    /// Transform of its conjugate, divided by the inner length.
    kernel: Vec<Complex<T>>,
    forward: Passes<T>,
    inverse: Passes<T>,
}

impl<T: FftNum> Chirp<T> {
    fn new(length: usize, direction: FftDirection) -> Self {
        let inner = (2 * length - 1).next_power_of_two();
        let passes =
            |direction| Passes::new(inner, direction).expect("a power of 2 has no other factors");
        let (forward, inverse) = (passes(FftDirection::Forward), passes(FftDirection::Inverse));
        let square = |i: usize| (i as u128 * i as u128 % (2 * length as u128)) as usize;
        let chirp: Vec<Complex<T>> = (0..length)
            .map(|i| root(square(i), 2 * length, direction))
            .collect();
        let scale = number::<T>(1.0 / inner as f64);
        let mut kernel = vec![Complex::new(T::zero(), T::zero()); inner];
        for (i, z) in chirp.iter().enumerate() {
            kernel[i] = z.conj() * scale;
            kernel[(inner - i) % inner] = kernel[i];
        }
        let mut other = kernel.clone();
        forward.transform(&mut kernel, &mut other);
        Self {
            direction,
            chirp,
            kernel,
            forward,
            inverse,
        }
    }

    /// Compute one transform in place; `scratch` has twice the inner length.
    fn transform(&self, values: &mut [Complex<T>], scratch: &mut [Complex<T>]) {
        let (work, other) = scratch.split_at_mut(self.kernel.len());
        for ((w, z), chirp) in work.iter_mut().zip(&*values).zip(&self.chirp) {
            *w = *z * *chirp;
        }
        work[values.len()..].fill(Complex::new(T::zero(), T::zero()));
        self.forward.transform(work, other);
        for (w, kernel) in work.iter_mut().zip(&self.kernel) {
            *w = *w * *kernel;
        }
        self.inverse.transform(work, other);
        for ((z, w), chirp) in values.iter_mut().zip(work).zip(&self.chirp) {
            *z = *w * *chirp;
        }
    }
}

/// Implement rustfft's traits by `transform`, with the given length and scratch size.
macro_rules! fft {
    ($of:ident, $length:expr, $scratch:expr) => {
        impl<T: FftNum> Length for $of<T> {
            fn len(&self) -> usize {
                $length(self)
            }
        }

        impl<T: FftNum> Direction for $of<T> {
            fn fft_direction(&self) -> FftDirection {
                self.direction
            }
        }

        impl<T: FftNum> Fft<T> for $of<T> {
            fn process_with_scratch(&self, buffer: &mut [Complex<T>], scratch: &mut [Complex<T>]) {
                let length = self.len();
                if length == 0 {
                    return;
                }
                assert!(!buffer.is_empty() && buffer.len().is_multiple_of(length));
                let scratch = &mut scratch[..self.get_inplace_scratch_len()];
                for values in buffer.chunks_exact_mut(length) {
                    self.transform(values, scratch);
                }
            }

            fn process_outofplace_with_scratch(
                &self,
                input: &mut [Complex<T>],
                output: &mut [Complex<T>],
                scratch: &mut [Complex<T>],
            ) {
                self.process_immutable_with_scratch(input, output, scratch);
            }

            fn process_immutable_with_scratch(
                &self,
                input: &[Complex<T>],
                output: &mut [Complex<T>],
                scratch: &mut [Complex<T>],
            ) {
                output.copy_from_slice(input);
                self.process_with_scratch(output, scratch);
            }

            fn get_inplace_scratch_len(&self) -> usize {
                $scratch(self)
            }

            fn get_outofplace_scratch_len(&self) -> usize {
                $scratch(self)
            }

            fn get_immutable_scratch_len(&self) -> usize {
                $scratch(self)
            }
        }
    };
}

fft!(Passes, |own: &Self| own.length, |own: &Self| own.length);
fft!(Chirp, |own: &Self| own.chirp.len(), |own: &Self| 2 * own
    .kernel
    .len());
