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
//! that of an exponential distribution. The points are isotropic, on a horizontal plane: `sigma0` does not depend on
//! the grazing angle. They are static, or move with the wind ([`InternalMotion`](super::InternalMotion)).

use std::f64::consts::TAU;

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::SceneError;
use crate::Scatterer;
use crate::random::{complex_normal, unit};
use subaperture_describe::error::ALLOW_MORE_MEMORY;
use subaperture_model::geometry::Extent;
use subaperture_model::units::power_of_db;

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
    /// Height (z), metres.
    pub height_m: f64,
    /// Number of points.
    pub density: Density,
    /// Mean cross section per square metre (sigma nought), dB relative to 1 m² per m².
    pub sigma0_db: f64,
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
    /// Points of the patch; the same seed gives the same points. Patches with one seed and different `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for an area that is empty or not finite, no points, or more than 67 million.
    pub fn points(&self, seed: u64, index: u32) -> Result<Vec<Scatterer>, SceneError> {
        self.points_within(seed, index, MAX_POINTS)
    }

    /// [`Self::points`], with an error beyond `most` points.
    pub(crate) fn points_within(
        &self,
        seed: u64,
        index: u32,
        most: f64,
    ) -> Result<Vec<Scatterer>, SceneError> {
        let area_m2 = self.area.square_metres();
        let ordered = match &self.area {
            Area::Rectangle(e) => e.x_m.1 > e.x_m.0 && e.y_m.1 > e.y_m.0,
            Area::Disc { centre_m, radius_m } => *radius_m > 0.0 && centre_m.is_finite(),
        };
        let known = self.height_m.is_finite() && self.sigma0_db.is_finite();
        if !(ordered && area_m2.is_finite() && known) {
            return Err(SceneError(format!(
                "clutter of {} dB at height {} m over {:?}: expected finite values and a non-empty area",
                self.sigma0_db, self.height_m, self.area
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
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(CLUTTER + u64::from(index));
        // Real and imaginary parts have half the power each.
        let scale = (power_of_db(self.sigma0_db) * area_m2 / count / 2.0).sqrt();
        let point = |_| {
            let place = self.area.point_m(unit(&mut random), unit(&mut random));
            Scatterer {
                position_m: place.extend(self.height_m),
                amplitude: complex_normal(&mut random) * scale,
            }
        };
        Ok((0..count as usize).map(point).collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use num_complex::Complex64;

    use super::*;

    fn meadow(area: Area, density: Density) -> Clutter {
        Clutter {
            area,
            height_m: 2.0,
            density,
            sigma0_db: -13.0,
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
