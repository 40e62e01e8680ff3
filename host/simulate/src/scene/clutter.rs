//! Ground clutter: many weak point scatterers.
//!
//! `N` points, uniform over an area `A`, with independent complex Gaussian amplitudes of
//!
//! ```text
//! E |a|^2 = sigma0 A / N
//! ```
//!
//! so that the mean cross section per square metre is `sigma0`. Its image has exponentially distributed power (fully
//! developed speckle) at any density, since the amplitudes are Gaussian. With few points per resolution cell,
//! neighbouring cells show the fluctuation of their number; ten per cell keep the fluctuation of power within 3 % of
//! that of an exponential distribution. The points are isotropic and lie on the ground ([`Ground`]), or at a height above it: on slopes
//! `A` is the area of the sloping ground. `sigma0` is constant, or that of the angle of incidence at the middle of the collection
//! ([`Backscatter`]). With a [`Texture`] the powers vary over the area, and amplitudes are K-distributed. A [`Mask`] restricts a patch to the pixels
//! of one class. Points are static, or move with the wind ([`InternalMotion`](super::InternalMotion)).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{Backscatter, Ground, Mask, SceneError, Texture};
use crate::Scatterer;
use crate::random::{complex_normal, unit};
use subaperture_describe::error::ALLOW_MORE_MEMORY;
use subaperture_model::geometry::Extent;

/// Random stream.
const CLUTTER: u64 = u64::from_be_bytes(*b"clutter\0");

/// Maximum number of points of one clutter patch, picture or building: 2.7 GB of scatterers.
pub(crate) const MAX_POINTS: f64 = (1u64 << 26) as f64;

/// Refuse more points than memory allows.
pub(super) fn check_points(what: &str, count: f64, most: f64) -> Result<(), SceneError> {
    if count <= most {
        return Ok(());
    }
    Err(SceneError(format!(
        "{what} of {count} points exceeds the {most} that fit into memory: give fewer, or {ALLOW_MORE_MEMORY}"
    )))
}

/// Area of clutter on a horizontal plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Area {
    /// Axis-parallel rectangle.
    Rectangle(Extent),
    /// Circular disc.
    Disc {
        /// Centre, x and y in metres.
        centre_m: DVec2,
        /// Radius, metres.
        radius_m: f64,
    },
}

/// Number of points, per area or in total. It does not affect the mean power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Density {
    /// Points per square metre.
    PerSquareMetre(f64),
    /// Total number of points in the area.
    Total(usize),
}

/// Homogeneous clutter of random points in an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clutter {
    /// Area covered.
    pub area: Area,
    /// Height above the ground, metres.
    pub height_m: f64,
    /// Number of points.
    pub density: Density,
    /// Mean cross section per square metre (sigma nought).
    pub backscatter: Backscatter,
    /// Texture; `None` for homogeneous clutter.
    pub texture: Option<Texture>,
}

impl Area {
    fn square_metres(&self) -> f64 {
        match self {
            Self::Rectangle(extent) => {
                (extent.x_m.1 - extent.x_m.0) * (extent.y_m.1 - extent.y_m.0)
            }
            Self::Disc { radius_m, .. } => TAU / 2.0 * radius_m * radius_m,
        }
    }

    /// Smallest rectangle around the area.
    pub(crate) fn extent(&self) -> Extent {
        match self {
            Self::Rectangle(extent) => *extent,
            Self::Disc { centre_m, radius_m } => Extent {
                x_m: (centre_m.x - radius_m, centre_m.x + radius_m),
                y_m: (centre_m.y - radius_m, centre_m.y + radius_m),
            },
        }
    }

    /// Map a point of the unit square to the area, uniformly.
    fn point_m(&self, u: f64, v: f64) -> DVec2 {
        match self {
            Self::Rectangle(extent) => DVec2::new(
                extent.x_m.0 + u * (extent.x_m.1 - extent.x_m.0),
                extent.y_m.0 + v * (extent.y_m.1 - extent.y_m.0),
            ),
            // The area within r grows as r^2.
            Self::Disc { centre_m, radius_m } => {
                *centre_m + DVec2::from_angle(TAU * v) * (u.sqrt() * radius_m)
            }
        }
    }
}

impl Clutter {
    /// Points of the patch on the plane `z = 0`, seen from the vertical; the same seed gives the same points. Patches with one seed and different `index`
    /// differ.
    ///
    /// # Errors
    /// As of [`Self::points_on`].
    pub fn points(&self, seed: u64, index: u32) -> Result<Vec<Scatterer>, SceneError> {
        let above = Ground {
            terrain: None,
            radar_m: DVec3::Z * 1e9,
        };
        self.points_on(&above, None, (seed, index))
    }

    /// Points of the patch on the ground, those of the mask if one is given. The number of points is that before the mask. `seed` is a seed and the index of
    /// the patch.
    ///
    /// # Errors
    /// [`SceneError`] for an area that is empty or not finite, no points, or more than 67 million, and for an invalid texture.
    pub fn points_on(
        &self,
        ground: &Ground,
        mask: Option<&Mask>,
        seed: (u64, u32),
    ) -> Result<Vec<Scatterer>, SceneError> {
        self.points_within(ground, mask, seed, MAX_POINTS)
    }

    /// [`Self::points_on`], with an error beyond `most` points.
    pub(crate) fn points_within(
        &self,
        ground: &Ground,
        mask: Option<&Mask>,
        (seed, index): (u64, u32),
        most: f64,
    ) -> Result<Vec<Scatterer>, SceneError> {
        let area_m2 = self.area.square_metres();
        let count = self.checked_count(most)?;
        // A texture's node takes 8 bytes, a point 160 while a scene is made.
        let left = 20.0 * (most - count);
        let texture = self.texture.as_ref();
        let texture = texture.map(|texture| texture.over(&self.area.extent(), seed, index, left));
        let texture = texture.transpose()?;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(CLUTTER + u64::from(index));
        // Real and imaginary parts have half the power each.
        let scale = |sigma0: f64| (sigma0 * area_m2 / count / 2.0).sqrt();
        let constant = match self.backscatter {
            Backscatter::Constant(_) if ground.terrain.is_none() && texture.is_none() => {
                Some(scale(self.backscatter.sigma0(0.0)))
            }
            _ => None,
        };
        let strength = |point_m: DVec3| {
            let at = point_m.truncate();
            let slant = ground.normal(at).z;
            let tau = texture.as_ref().map_or(1.0, |texture| texture.at(at));
            scale(self.backscatter.sigma0(ground.incidence_rad(point_m)) * tau / slant)
        };
        let mut points = Vec::new();
        if mask.is_none() {
            points.reserve_exact(count as usize);
        }
        for _ in 0..count as usize {
            let place = self.area.point_m(unit(&mut random), unit(&mut random));
            let amplitude = complex_normal(&mut random);
            if mask.is_none_or(|mask| mask.contains(place)) {
                let position_m = ground.raise(place.extend(self.height_m));
                points.push(Scatterer {
                    position_m,
                    amplitude: amplitude * constant.unwrap_or_else(|| strength(position_m)),
                });
            }
        }
        Ok(points)
    }

    /// Number of points of a valid patch.
    fn checked_count(&self, most: f64) -> Result<f64, SceneError> {
        let area_m2 = self.area.square_metres();
        let ordered = match &self.area {
            Area::Rectangle(e) => e.x_m.1 > e.x_m.0 && e.y_m.1 > e.y_m.0,
            Area::Disc { centre_m, radius_m } => *radius_m > 0.0 && centre_m.is_finite(),
        };
        let known = self.height_m.is_finite() && self.backscatter.is_finite();
        if !(ordered && area_m2.is_finite() && known) {
            return Err(SceneError(format!(
                "clutter of {:?} at height {} m over {:?}: expected finite values and a non-empty area",
                self.backscatter, self.height_m, self.area
            )));
        }
        let count = match self.density {
            Density::PerSquareMetre(density) => (density * area_m2).round(),
            Density::Total(count) => count as f64,
        };
        if !(1.0..=MAX_POINTS).contains(&count) {
            return Err(SceneError(format!(
                "clutter of {count} points over {area_m2} m²: expected 1 to {MAX_POINTS} points"
            )));
        }
        check_points("clutter", count, most)?;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;

    fn meadow(area: Area, density: Density) -> Clutter {
        Clutter {
            area,
            height_m: 2.0,
            density,
            backscatter: Backscatter::Constant(-13.0),
            texture: None,
        }
    }

    fn power_within(points: &[Scatterer], place_m: DVec3, radius_m: f64) -> f64 {
        let inside = points
            .iter()
            .filter(|p| p.position_m.distance(place_m) < radius_m);
        inside.map(|p| p.amplitude.norm_sqr()).sum()
    }

    #[test]
    fn clutter_power_per_area_is_sigma0_at_any_density() {
        let sigma0 = 10f64.powf(-1.3);
        let disc = Area::Disc {
            centre_m: DVec2::new(5.0, -5.0),
            radius_m: 40.0,
        };
        let rectangle = Area::Rectangle(Extent {
            x_m: (-40.0, 50.0),
            y_m: (-50.0, 50.0),
        });
        for area in [disc, rectangle] {
            for density in [Density::PerSquareMetre(2.0), Density::Total(60_000)] {
                let points = meadow(area, density).points(3, 0).unwrap();
                for centre in [DVec3::new(5.0, -5.0, 2.0), DVec3::new(-8.0, 15.0, 2.0)] {
                    // Within 15 m (the disc's edge is 40 m away, and 16.1 m): 707 m², at least 1414 points. Number and
                    // power each add a relative variance of 1 / n: sqrt(2 / 1414) = 3.8 %; four times this is allowed.
                    let got = power_within(&points, centre, 15.0) / (15.0 * 15.0 * TAU / 2.0);
                    assert!((got / sigma0 - 1.0).abs() < 0.15, "{got}");
                }
                assert!(points.iter().all(|p| p.position_m.z == 2.0));
            }
        }
        let all = meadow(disc, Density::Total(20_000)).points(3, 0).unwrap();
        assert!(
            all.iter()
                .all(|p| p.position_m.truncate().distance(DVec2::new(5.0, -5.0)) <= 40.0)
        );
    }

    #[test]
    fn clutter_amplitudes_are_complex_gaussian_and_depend_on_seed() {
        let extent = Extent {
            x_m: (0.0, 10.0),
            y_m: (0.0, 10.0),
        };
        let clutter = meadow(Area::Rectangle(extent), Density::Total(20_000));
        let points = clutter.points(8, 0).unwrap();
        let moment = |f: fn(Complex64) -> f64| {
            points.iter().map(|p| f(p.amplitude)).sum::<f64>() / points.len() as f64
        };
        let power = moment(|a| a.norm_sqr());
        // Exponential power: E p^2 = 2 (E p)^2, standard error sqrt(20 / 20000) = 3 %; no preferred phase.
        assert!((moment(|a| a.norm_sqr().powi(2)) / power.powi(2) - 2.0).abs() < 0.25);
        assert!((moment(|a| a.re * a.im) / power).abs() < 0.02);
        assert!((moment(|a| a.re * a.re - a.im * a.im) / power).abs() < 0.04);
        assert_eq!(points, clutter.points(8, 0).unwrap());
        assert_ne!(points, clutter.points(9, 0).unwrap());
        assert_ne!(points, clutter.points(8, 1).unwrap());
    }

    #[test]
    fn points_follow_slope_with_power_of_local_incidence() {
        use crate::scene::{HeightFunction, Terrain};
        // Ground that rises towards y with the slope 0.75, seen from 45 degrees of elevation in -y: the normal (0, -0.6, 0.8) and the line of
        // sight (0, -1, 1) / sqrt 2 have the cosine 1.4 / sqrt 2 = 0.98995. A horizontal square metre has 1.25 m² of ground.
        let extent = Extent {
            x_m: (-40.0, 40.0),
            y_m: (-40.0, 40.0),
        };
        let plane = HeightFunction {
            slope: DVec2::new(0.0, 0.75),
            ..HeightFunction::default()
        };
        let terrain = Terrain::sample("a plane", &extent, 1.0, plane.prepare(0)).unwrap();
        let ground = Ground {
            terrain: Some(&terrain),
            radar_m: DVec3::new(0.0, -1e6, 1e6),
        };
        let clutter = Clutter {
            backscatter: Backscatter::Gamma(-13.0),
            ..meadow(Area::Rectangle(extent), Density::Total(40_000))
        };
        let points = clutter.points_on(&ground, None, (4, 0)).unwrap();
        let power: f64 = points.iter().map(|p| p.amplitude.norm_sqr()).sum();
        let expected = 10f64.powf(-1.3) * 1.4 / 2f64.sqrt() * 1.25 * 6400.0;
        // Relative standard error 1 / sqrt(40,000) = 0.5 %; four times this is allowed.
        assert!((power / expected - 1.0).abs() < 0.02, "{power}, {expected}");
        for p in &points {
            let off = p.position_m.z - (2.0 + 0.75 * p.position_m.y);
            assert!(off.abs() < 2e-4, "{off}");
        }
        // A slope away from the radar, steeper than its line of sight, is dark.
        let away = Ground {
            radar_m: DVec3::new(0.0, 2e6, 1e6),
            ..ground
        };
        let dark = clutter.points_on(&away, None, (4, 0)).unwrap();
        assert!(dark.iter().all(|p| p.amplitude == Complex64::ZERO));
    }

    #[test]
    fn texture_gives_moments_of_k_distribution_and_mask_keeps_its_class() {
        let extent = Extent {
            x_m: (0.0, 300.0),
            y_m: (0.0, 300.0),
        };
        let clutter = Clutter {
            texture: Some(Texture {
                shape: 1.5,
                length_m: 3.0,
            }),
            ..meadow(Area::Rectangle(extent), Density::Total(90_000))
        };
        let points = clutter.points(5, 0).unwrap();
        let moment = |n: i32| {
            points
                .iter()
                .map(|p| p.amplitude.norm_sqr().powi(n))
                .sum::<f64>()
                / 90_000.0
        };
        // <I^2> / <I>^2 = 2 (1 + 1 / nu) = 3.333. Of I^2: <I^4> / <I>^4 = 24 (nu+1)(nu+2)(nu+3) / nu^3 = 280, and independent textures of
        // pi L^2 / 2 = 14 m², 6400 of them: standard error sqrt(280 / 24 / 6400) x 2 + sqrt(280 / 90,000) = 0.14 at most; four times.
        let ratio = moment(2) / moment(1).powi(2);
        assert!((ratio - 10.0 / 3.0).abs() < 0.56, "{ratio}");
        assert!((moment(1) / (10f64.powf(-1.3)) - 1.0).abs() < 0.06);

        let map = crate::scene::Picture::new(1, 2, vec![7.0, 9.0]).unwrap();
        let mask = Mask {
            map,
            extent,
            value: 9.0,
        };
        let ground = Ground::default();
        let part = clutter.points_on(&ground, Some(&mask), (5, 0)).unwrap();
        let right: Vec<_> = points.iter().filter(|p| p.position_m.x >= 150.0).collect();
        assert!(part.iter().eq(right));
    }

    #[test]
    fn invalid_clutter_is_refused() {
        let reversed = Extent {
            x_m: (1.0, 0.0),
            y_m: (1.0, 0.0),
        };
        let flat = meadow(Area::Rectangle(reversed), Density::Total(5));
        assert!(
            flat.points(0, 0)
                .unwrap_err()
                .to_string()
                .contains("non-empty")
        );
        let disc = Area::Disc {
            centre_m: DVec2::ZERO,
            radius_m: 1e6,
        };
        for density in [
            Density::PerSquareMetre(1.0),
            Density::PerSquareMetre(f64::NAN),
            Density::Total(0),
        ] {
            let error = meadow(disc, density).points(0, 0).unwrap_err().to_string();
            assert!(error.contains("expected 1 to"), "{error}");
        }
    }
}
