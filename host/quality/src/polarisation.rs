//! Pauli decomposition of polarimetric images on one grid.
//!
//! Components of the scattering matrix `S`: `|S_hh - S_vv| / sqrt 2`, double bounce (red by convention); `|S_hv + S_vh| / sqrt 2`, cross-polarisation or volume scattering
//! (green); `|S_hh + S_vv| / sqrt 2`, single bounce (blue). With `|S_hv - S_vh| / sqrt 2`, which is zero for a monostatic radar, they contain the span (total power).

use std::f32::consts::FRAC_1_SQRT_2;

use num_complex::Complex32;
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks};

/// Linear combination `factor (first + sign second)` of two images of one size, computed window by window.
#[derive(Debug)]
pub struct Sum<'a> {
    images: [&'a dyn ImageSource; 2],
    factors: [f32; 2],
}

impl ImageSource for Sum<'_> {
    fn size(&self) -> (usize, usize) {
        self.images[0].size()
    }

    fn places(&self) -> PixelBlocks {
        self.images[0].places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        let mut sum = self.images[0].window(place)?;
        let other = self.images[1].window(place)?;
        let [a, b] = self.factors;
        let pairs = sum.pixels.iter_mut().zip(other.pixels);
        pairs.for_each(|(z, w): (&mut Complex32, _)| *z = *z * a + w * b);
        Ok(sum)
    }
}

/// Pauli components of images in HH, HV, VH and VV of one size: red, green and blue, with their names.
pub fn pauli([hh, hv, vh, vv]: [&dyn ImageSource; 4]) -> [(&'static str, Sum<'_>); 3] {
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

    /// A trihedral is blue, a dihedral red, a dihedral rotated by 45 degrees green, each with its whole power in one component.
    #[test]
    fn canonical_scatterers_have_one_pauli_component() {
        let i = Complex32::new(0.0, 2.0);
        let zero = Complex32::ZERO;
        // HH, HV, VH, VV per pixel.
        let scatterers = [[i, zero, zero, i], [i, zero, zero, -i], [zero, i, i, zero]];
        let images = [0, 1, 2, 3].map(|k| Image {
            rows: 1,
            columns: 3,
            pixels: scatterers.iter().map(|s| s[k]).collect(),
        });
        let [hh, hv, vh, vv] = [0, 1, 2, 3].map(|k| &images[k] as &dyn ImageSource);
        let basis = pauli([hh, hv, vh, vv]);
        for (k, lit) in [(0, 1), (1, 2), (2, 0)] {
            let seen = basis[k].1.window(&[0..1, 0..3]).unwrap();
            for (pixel, z) in seen.pixels.iter().enumerate() {
                // |S|^2 is 4 + 4, within float32 rounding of 1e-6.
                let expected = if pixel == lit { 8.0 } else { 0.0 };
                assert!((z.norm_sqr() - expected).abs() < 1e-5, "{k} {pixel}");
            }
        }
    }
}
