//! Triangular trihedral corner reflector: radar cross section by aspect.
//!
//! After three reflections, a wave returns to its source if it hits the common part, seen from there, of the aperture
//! (the triangle of the three edges' ends) and its image in the apex. With `c1 <= c2 <= c3` the direction cosines to
//! the three edges of length `a`, and `s = c1 + c2 + c3`, its area is (Siegel et al. 1955; derived again in the test by
//! clipping the triangles)
//!
//! ```text
//! A = a^2 4 c1 c2 / s        for c1 + c2 <= c3
//! A = a^2 (s - 2 / s)        otherwise
//! sigma = 4 pi A^2 / lambda^2
//! ```
//!
//! On boresight: `a^2 / sqrt 3` and `4 pi a^4 / (3 lambda^2)`. The phase is that of the apex. Neglected: single and
//! double reflections, which matter near the plates' planes and beyond 30 degrees from boresight, and diffraction, of
//! relative size `lambda / a`.

use std::f64::consts::PI;

use glam::DVec3;

use super::Corner;

impl Corner {
    /// Amplitude (square root of the cross section, metres) towards a unit vector from the corner; 0 from behind any of
    /// its plates.
    ///
    /// One edge lies in the vertical plane of the boresight, on the upper side: a corner with a boresight elevation of
    /// 35.26 degrees stands on a horizontal plate. If the boresight is vertical, that edge leans to x.
    pub fn amplitude(&self, towards: DVec3, wavelength_m: f64) -> f64 {
        let mut c = self.edges().map(|edge| towards.dot(edge));
        c.sort_by(f64::total_cmp);
        let [c1, c2, c3] = c;
        if c1 <= 0.0 {
            return 0.0;
        }
        let s = c1 + c2 + c3;
        let area = if c1 + c2 <= c3 {
            4.0 * c1 * c2 / s
        } else {
            s - 2.0 / s
        };
        (4.0 * PI).sqrt() * self.edge_m * self.edge_m * area / wavelength_m
    }

    /// Unit vectors along the edges, each with a component of `1 / sqrt 3` along the boresight.
    fn edges(&self) -> [DVec3; 3] {
        let b = self.boresight;
        let across = |v: DVec3| v - b * v.dot(b);
        let up = across(DVec3::Z).try_normalize();
        // Within 1e-6 of the vertical, the upper side is determined by rounding errors.
        let up = up.filter(|_| across(DVec3::Z).length() > 1e-6);
        let up = up.unwrap_or_else(|| across(DVec3::X).normalize_or_zero());
        let left = up.cross(b);
        let (along, aside) = (1.0 / 3f64.sqrt(), (2.0 / 3f64).sqrt());
        let half = 3f64.sqrt() / 2.0;
        [up, left * half - up * 0.5, left * -half - up * 0.5].map(|v| b * along + v * aside)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn corner(boresight: DVec3) -> Corner {
        Corner {
            position_m: DVec3::ZERO,
            boresight: boresight.normalize(),
            edge_m: 0.7,
        }
    }

    #[test]
    fn corner_has_textbook_rcs_on_boresight_and_orthogonal_edges() {
        for boresight in [
            DVec3::new(1.0, 1.0, 1.0),
            DVec3::new(-0.3, 0.8, 0.1),
            DVec3::Z,
            DVec3::NEG_Z,
        ] {
            let corner = corner(boresight);
            let sigma = corner.amplitude(corner.boresight, 0.03).powi(2);
            let expected = 4.0 * PI * 0.7f64.powi(4) / (3.0 * 0.03 * 0.03);
            assert!((sigma / expected - 1.0).abs() < 1e-12);
            let [a, b, c] = corner.edges();
            assert!(a.dot(b).abs() < 1e-15 && b.dot(c).abs() < 1e-15 && c.dot(a).abs() < 1e-15);
            assert!((a.length() - 1.0).abs() < 1e-15);
        }
        // With boresight (1, 1, 1) the corner stands on the x-y plane: its edges are the axes.
        let [up, ..] = corner(DVec3::ONE).edges();
        assert!(up.distance(DVec3::Z) < 1e-15);
        assert_eq!(corner(DVec3::ONE).amplitude(DVec3::NEG_X, 0.03), 0.0);
    }

    /// Signed area of a polygon.
    fn area(polygon: &[DVec2]) -> f64 {
        let next = polygon.iter().cycle().skip(1);
        polygon
            .iter()
            .zip(next)
            .map(|(p, q)| p.perp_dot(*q))
            .sum::<f64>()
            / 2.0
    }

    fn cut(polygon: &[DVec2], a: DVec2, b: DVec2) -> Vec<DVec2> {
        let side = |p: DVec2| (b - a).perp_dot(p - a);
        let mut kept = Vec::new();
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            if side(p) >= 0.0 {
                kept.push(p);
            }
            if (side(p) > 0.0) != (side(q) > 0.0) {
                kept.push(p + (q - p) * (side(p) / (side(p) - side(q))));
            }
        }
        kept
    }

    #[test]
    fn effective_area_is_intersection_of_aperture_and_its_image() {
        // Edges along the axes; directions over the whole octant, covering both branches.
        let corner = corner(DVec3::ONE);
        let mut branches = [0, 0];
        for i in 1..12 {
            for k in 1..12 {
                let (elevation, azimuth) = (f64::from(i) * PI / 24.0, f64::from(k) * PI / 24.0);
                let d = DVec3::new(
                    elevation.cos() * azimuth.cos(),
                    elevation.cos() * azimuth.sin(),
                    elevation.sin(),
                );
                let u = d.any_orthonormal_vector();
                let v = d.cross(u);
                let seen = |p: DVec3| DVec2::new(p.dot(u), p.dot(v));
                // Seen from outside, the axes are ordered anticlockwise.
                let triangle = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| seen(e * 0.7));
                assert!(area(&triangle) > 0.0);
                let mut shared: Vec<DVec2> = triangle.map(|p| -p).to_vec();
                for n in 0..3 {
                    shared = cut(&shared, triangle[n], triangle[(n + 1) % 3]);
                }
                let expected = (4.0 * PI).sqrt() * area(&shared) / 0.03;
                let got = corner.amplitude(d, 0.03);
                assert!((got - expected).abs() < 1e-9, "{d}: {got}, {expected}");
                let wide = 2.0 * d.max_element() < d.element_sum();
                branches[usize::from(wide)] += 1;
            }
        }
        assert!(branches[0] > 20 && branches[1] > 20, "{branches:?}");
    }
}
