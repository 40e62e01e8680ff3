//! Trees: a trunk on the ground and a crown that attenuates.
//!
//! | part | share of the power | position |
//! |---|---|---|
//! | trunk with the ground (dihedral) | as given | at the foot |
//! | crown | the rest, in equal parts | random points, uniform in an ellipsoid |
//!
//! Phases are random, so that the powers of the points add up to the stated cross section. The ellipsoid attenuates all that is seen through it
//! ([`Canopy`]), its own points included: one-way, `attenuation` per metre of the line of sight within it. At 28.8 and 57.6 GHz 1.3 to 2.0 dB per
//! metre were measured over the first 30 m of foliage (Schwering, Violette and Espeland 1988).

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::SceneError;
use crate::Scatterer;
use crate::random::unit;
use subaperture_signal::phase::phasor;

/// Random stream of places and phases.
const TREE: u64 = u64::from_be_bytes(*b"tree\0\0\0\0");

/// Largest number of points of a crown.
const MOST_POINTS: usize = 100_000;

/// Ellipsoid of foliage with a vertical axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Canopy {
    /// Centre, metres in the scene frame.
    pub centre_m: DVec3,
    /// Half axes of the ellipsoid, metres.
    pub half_m: DVec3,
    /// One-way attenuation, dB per metre.
    pub attenuation_db_m: f64,
}

/// Tree on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tree {
    /// Foot of the trunk, metres.
    pub foot_m: DVec3,
    /// Height of the top of the crown above the foot, metres.
    pub height_m: f64,
    /// Height of the lower end of the crown above the foot, metres.
    pub crown_base_m: f64,
    /// Horizontal radius of the crown, metres.
    pub crown_radius_m: f64,
    /// Sum of the cross sections of all points, without attenuation, m².
    pub cross_section_m2: f64,
    /// Share of the trunk in the cross section, 0 to 1.
    pub trunk_share: f64,
    /// Number of points of the crown.
    pub crown_points: usize,
    /// One-way attenuation of the crown, dB per metre.
    pub attenuation_db_m: f64,
}

impl Canopy {
    /// Factor of the amplitude along the line from one point to another, one-way.
    pub fn transmission(&self, from_m: DVec3, to_m: DVec3) -> f64 {
        let start = (from_m - self.centre_m) / self.half_m;
        let step = (to_m - from_m) / self.half_m;
        // |start + t step|^2 = 1.
        let (a, b, c) = (
            step.length_squared(),
            start.dot(step),
            start.length_squared() - 1.0,
        );
        let root = b * b - a * c;
        // NaN transmits, too.
        if !(root > 0.0 && a > 0.0) {
            return 1.0;
        }
        let (enter, leave) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
        let inside = leave.min(1.0) - enter.max(0.0);
        if inside <= 0.0 {
            return 1.0;
        }
        let depth_m = inside * to_m.distance(from_m);
        libm::pow(10.0, -self.attenuation_db_m * depth_m / 20.0)
    }
}

impl Tree {
    /// Foliage; `None` without attenuation.
    pub fn canopy(&self) -> Option<Canopy> {
        let half_m = (self.height_m - self.crown_base_m) / 2.0;
        (self.attenuation_db_m > 0.0).then(|| Canopy {
            centre_m: self.foot_m + DVec3::Z * (self.crown_base_m + half_m),
            half_m: DVec3::new(self.crown_radius_m, self.crown_radius_m, half_m),
            attenuation_db_m: self.attenuation_db_m,
        })
    }

    /// Points; the same seed gives the same points. Trees with one seed and different `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for lengths, powers, a share or a number of points that are out of range or not finite.
    pub fn points(&self, seed: u64, index: u32) -> Result<Vec<Scatterer>, SceneError> {
        let crowned = self.crown_radius_m > 0.0 && self.height_m > self.crown_base_m;
        let based = self.crown_base_m >= 0.0 && (self.height_m + self.crown_radius_m).is_finite();
        let shared = (0.0..=1.0).contains(&self.trunk_share);
        let counted = (1..=MOST_POINTS).contains(&self.crown_points);
        let strong = self.cross_section_m2 >= 0.0 && self.cross_section_m2.is_finite();
        let dims = self.attenuation_db_m >= 0.0 && self.attenuation_db_m.is_finite();
        if !(crowned && based && shared && counted && strong && dims && self.foot_m.is_finite()) {
            return Err(SceneError(format!(
                "tree at {} m with a crown of the radius {} m from {} to {} m, {} points, {} m2, trunk's share {}, {} dB/m: expected a crown of \
                 positive size, 1 to {MOST_POINTS} points, a share of 0 to 1, and finite values that are not negative",
                self.foot_m,
                self.crown_radius_m,
                self.crown_base_m,
                self.height_m,
                self.crown_points,
                self.cross_section_m2,
                self.trunk_share,
                self.attenuation_db_m
            )));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(TREE.wrapping_add(u64::from(index)));
        let half_m = (self.height_m - self.crown_base_m) / 2.0;
        let centre_m = self.foot_m + DVec3::Z * (self.crown_base_m + half_m);
        let half = DVec3::new(self.crown_radius_m, self.crown_radius_m, half_m);
        let trunk_m2 = self.trunk_share * self.cross_section_m2;
        let each_m2 = (self.cross_section_m2 - trunk_m2) / self.crown_points as f64;
        let mut points = vec![Scatterer {
            position_m: self.foot_m,
            amplitude: phasor(unit(&mut random)) * trunk_m2.sqrt(),
        }];
        points.extend((0..self.crown_points).map(|_| {
            let place = in_ball(|| 2.0 * unit(&mut random) - 1.0);
            Scatterer {
                position_m: centre_m + place * half,
                amplitude: phasor(unit(&mut random)) * each_m2.sqrt(),
            }
        }));
        Ok(points)
    }
}

/// Uniform point of the unit ball from numbers in [-1, 1).
fn in_ball(mut next: impl FnMut() -> f64) -> DVec3 {
    loop {
        let place = DVec3::new(next(), next(), next());
        if place.length_squared() <= 1.0 {
            return place;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oak() -> Tree {
        Tree {
            foot_m: DVec3::new(5.0, 7.0, 1.0),
            height_m: 9.0,
            crown_base_m: 3.0,
            crown_radius_m: 2.0,
            cross_section_m2: 12.0,
            trunk_share: 0.25,
            crown_points: 400,
            attenuation_db_m: 1.5,
        }
    }

    #[test]
    fn powers_add_up_and_crown_fills_its_ellipsoid() {
        let points = oak().points(1, 0).unwrap();
        let power: f64 = points.iter().map(|p| p.amplitude.norm_sqr()).sum();
        assert!((power - 12.0).abs() < 1e-9);
        assert_eq!(points[0].position_m, oak().foot_m);
        assert!((points[0].amplitude.norm_sqr() - 3.0).abs() < 1e-12);
        let centre_m = DVec3::new(5.0, 7.0, 7.0);
        let off = |p: &Scatterer| (p.position_m - centre_m) / DVec3::new(2.0, 2.0, 3.0);
        assert!(points[1..].iter().all(|p| off(p).length() <= 1.0));
        // Uniform in a ball: mean square of each coordinate 1/5, of 400 points with a standard error of 0.0093.
        for axis in 0..3 {
            let mean = points[1..]
                .iter()
                .map(|p| off(p)[axis].powi(2))
                .sum::<f64>()
                / 400.0;
            assert!((mean - 0.2).abs() < 0.04, "{axis}: {mean}");
        }
        assert_ne!(oak().points(1, 1).unwrap(), points);
    }

    #[test]
    fn canopy_attenuates_by_depth_of_line_within_it() {
        let canopy = oak().canopy().unwrap();
        let level_db = |from: DVec3, to: DVec3| 20.0 * canopy.transmission(from, to).log10();
        let middle = DVec3::new(5.0, 7.0, 7.0);
        let across = DVec3::new(50.0, 0.0, 0.0);
        // Through the middle: 4 m, from the middle outwards 2 m, vertically 6 m.
        assert!((level_db(middle - across, middle + across) + 6.0).abs() < 1e-9);
        assert!((level_db(middle + across, middle) + 3.0).abs() < 1e-9);
        let up = DVec3::Z * 40.0;
        assert!((level_db(middle - up, middle + up) + 9.0).abs() < 1e-9);
        // At 60 % of the radius the chord is 0.8 of the diameter.
        let aside = DVec3::new(0.0, 1.2, 0.0);
        assert!((level_db(middle + aside - across, middle + aside + across) + 4.8).abs() < 1e-9);
        let past = DVec3::new(0.0, 2.01, 0.0);
        assert_eq!(
            level_db(middle + past - across, middle + past + across),
            0.0
        );
        assert_eq!(
            level_db(middle + across, middle + across * 2.0),
            0.0,
            "before it"
        );
        assert!(
            Tree {
                attenuation_db_m: 0.0,
                ..oak()
            }
            .canopy()
            .is_none()
        );
    }

    #[test]
    fn impossible_trees_are_refused() {
        let low = Tree {
            height_m: 3.0,
            ..oak()
        };
        let bare = Tree {
            crown_points: 0,
            ..oak()
        };
        let odd = Tree {
            trunk_share: 1.5,
            ..oak()
        };
        for tree in [low, bare, odd] {
            assert!(
                tree.points(0, 0)
                    .unwrap_err()
                    .to_string()
                    .contains("tree at")
            );
        }
    }
}
