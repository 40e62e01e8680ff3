//! Circular Gaussian speckle of known coherence and spectrum, from a generator of its own.
#![allow(dead_code, reason = "each test file uses a part")]

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_fft::{forward, inverse};
use subaperture_model::image::Image;

/// SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Circular complex Gaussian of unit power (Box and Muller).
    pub(crate) fn normal(&mut self) -> Complex64 {
        let radius = (-(1.0 - self.unit()).ln()).sqrt();
        Complex64::from_polar(radius, TAU * self.unit())
    }
}

pub(crate) fn image_of([rows, columns]: [usize; 2], pixels: &[Complex64]) -> Image {
    let narrow = |z: &Complex64| Complex32::new(z.re as f32, z.im as f32);
    Image {
        rows,
        columns,
        pixels: pixels.iter().map(narrow).collect(),
    }
}

/// Independent pixels of two images with this coherence.
pub(crate) fn pair(random: &mut Random, pixels: usize, coherence: f64) -> [Vec<Complex64>; 2] {
    let other = (1.0 - coherence * coherence).sqrt();
    let mut image = Vec::with_capacity(pixels);
    let mut reference = Vec::with_capacity(pixels);
    for _ in 0..pixels {
        let common = random.normal();
        image.push(common);
        reference.push(common * coherence + random.normal() * other);
    }
    [image, reference]
}

/// Multiply the spectrum of a square image by amplitudes of its rows' and columns' frequencies (signed, cycles per pixel).
pub(crate) fn filtered(
    pixels: &[Complex64],
    side: usize,
    of: impl Fn(f64, f64) -> Complex64,
) -> Vec<Complex64> {
    let mut data = pixels.to_vec();
    let transposed = |data: &[Complex64]| -> Vec<Complex64> {
        (0..side * side)
            .map(|i| data[i % side * side + i / side])
            .collect()
    };
    forward::<f64>(side).process(&mut data);
    data = transposed(&data);
    forward::<f64>(side).process(&mut data);
    let frequency = |k: usize| {
        let f = k as f64 / side as f64;
        if f < 0.5 { f } else { f - 1.0 }
    };
    for (i, z) in data.iter_mut().enumerate() {
        *z *= of(frequency(i % side), frequency(i / side)) / (side * side) as f64;
    }
    inverse::<f64>(side).process(&mut data);
    data = transposed(&data);
    inverse::<f64>(side).process(&mut data);
    data
}

/// Taylor weight at a fraction of the half-band, -1 to 1, for a peak sidelobe ratio of -35 dB and 5 equal sidelobes (Carrara et al. 1995, appendix D); 0 outside.
pub(crate) fn taylor(x: f64) -> f64 {
    if x.abs() > 1.0 {
        return 0.0;
    }
    let a = (10f64.powf(35.0 / 20.0)).acosh() / std::f64::consts::PI;
    let n = 5.0;
    let sigma = n * n / (a * a + (n - 0.5) * (n - 0.5));
    let mut weight = 1.0;
    for m in 1..5 {
        let m = f64::from(m);
        let mut numerator = 1.0;
        let mut denominator = 1.0;
        for i in 1..5 {
            let i = f64::from(i);
            numerator *= 1.0 - m * m / (sigma * (a * a + (i - 0.5) * (i - 0.5)));
            if i != m {
                denominator *= 1.0 - m * m / (i * i);
            }
        }
        let sign = if m as usize % 2 == 1 { 1.0 } else { -1.0 };
        weight += 2.0 * sign * 0.5 * numerator / denominator * (std::f64::consts::PI * m * x).cos();
    }
    weight
}
