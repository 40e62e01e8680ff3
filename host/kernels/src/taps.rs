//! Kernel weights at fractional positions.

use subaperture_signal::kaiser_bessel::TERMS;

use crate::lanes::Lanes;
use crate::phasor::nearest;

/// Floor.
#[inline(always)]
pub(crate) fn below(x: f64) -> f64 {
    let near = nearest(x);
    if near > x { near - 1.0 } else { near }
}

/// Kernel weights by polynomials of their even and odd parts ([`subaperture_signal::kaiser_bessel::KaiserBessel::polynomials`]); `u` is the fraction above the lower element, minus a half.
#[inline(always)]
pub(crate) fn weights<L: Lanes, const W: usize>(
    lanes: L,
    polynomials: &[[[f32; TERMS]; 2]],
    u: L::Numbers,
) -> [L::Numbers; W] {
    let mut weights = [lanes.splat(0.0); W];
    let square = lanes.mul(u, u);
    for (tap, [even, odd]) in polynomials[..W / 2].iter().enumerate() {
        let mut sums = [lanes.splat(0.0); 2];
        for (sum, terms) in sums.iter_mut().zip([even, odd]) {
            let [a, b, c, d] = *terms;
            *sum = lanes.mul_add(square, lanes.splat(d), lanes.splat(c));
            *sum = lanes.mul_add(square, *sum, lanes.splat(b));
            *sum = lanes.mul_add(square, *sum, lanes.splat(a));
        }
        weights[tap] = lanes.mul_add(u, sums[1], sums[0]);
        weights[W - 1 - tap] = lanes.neg_mul_add(u, sums[1], sums[0]);
    }
    weights
}
