//! Images of several polarisations of one collection, on one grid.
//!
//! **Pauli's basis** of a scattering matrix `S`: `|S_hh - S_vv| / sqrt 2`, what reflects twice (red by custom), `|S_hv + S_vh| / sqrt 2`, what turns the polarisation (green), and
//! `|S_hh + S_vv| / sqrt 2`, what reflects once (blue); together with `|S_hv - S_vh| / sqrt 2`, which is nothing where transmitter and receiver stand at one place, they have the power of all four.

use std::f32::consts::FRAC_1_SQRT_2;

use num_complex::Complex32;
use subaperture_model::image::{Image, Parts, PartsError, Place};

/// `factor (first + sign second)` of two images of one size, read part by part.
#[derive(Debug)]
pub struct Sum<'a> {
    images: [&'a dyn Parts; 2],
    factors: [f32; 2],
}

impl Parts for Sum<'_> {
    fn size(&self) -> (usize, usize) {
        self.images[0].size()
    }

    fn places(&self) -> Vec<Place> {
        self.images[0].places()
    }

    fn window(&self, place: &Place) -> Result<Image, PartsError> {
        let mut sum = self.images[0].window(place)?;
        let other = self.images[1].window(place)?;
        let [a, b] = self.factors;
        let pairs = sum.pixels.iter_mut().zip(other.pixels);
        pairs.for_each(|(z, w): (&mut Complex32, _)| *z = *z * a + w * b);
        Ok(sum)
    }
}

/// Pauli's basis of images in HH, HV, VH and VV, of one size: red, green and blue with their names.
pub fn pauli([hh, hv, vh, vv]: [&dyn Parts; 4]) -> [(&'static str, Sum<'_>); 3] {
    let sum = |images, sign: f32| Sum {
        images,
        factors: [FRAC_1_SQRT_2, sign * FRAC_1_SQRT_2],
    };
    [
        ("HH - VV", sum([hh, vv], -1.0)),
        ("HV + VH", sum([hv, vh], 1.0)),
        ("HH + VV", sum([hh, vv], 1.0)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trihedral is blue, a dihedral red, and one turned by 45 degrees green; all of their power in one.
    #[test]
    fn scatterers_of_each_kind_are_a_colour() {
        let i = Complex32::new(0.0, 2.0);
        let zero = Complex32::ZERO;
        // HH, HV, VH, VV of each pixel.
        let scatterers = [[i, zero, zero, i], [i, zero, zero, -i], [zero, i, i, zero]];
        let images = [0, 1, 2, 3].map(|k| Image {
            rows: 1,
            columns: 3,
            pixels: scatterers.iter().map(|s| s[k]).collect(),
        });
        let [hh, hv, vh, vv] = [0, 1, 2, 3].map(|k| &images[k] as &dyn Parts);
        let basis = pauli([hh, hv, vh, vv]);
        for (k, lit) in [(0, 1), (1, 2), (2, 0)] {
            let seen = basis[k].1.window(&[0..1, 0..3]).unwrap();
            for (pixel, z) in seen.pixels.iter().enumerate() {
                // 4 + 4 of |S|^2; float32 rounds to 1e-6 of it.
                let expected = if pixel == lit { 8.0 } else { 0.0 };
                assert!((z.norm_sqr() - expected).abs() < 1e-5, "{k} {pixel}");
            }
        }
    }
}
