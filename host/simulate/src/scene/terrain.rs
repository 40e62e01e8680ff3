//! Terrain: heights of the ground over x and y.
//!
//! Heights are given at the nodes of a lattice, bilinear in between, and continue beyond the outermost nodes at the height of the edge
//! ([`Relief`]). They are those of an elevation model or of a sum of functions ([`HeightFunction`]):
//!
//! ```text
//! h(x, y) = slope . (x, y)
//!         + sum of hills  A exp(-|p - p0|^2 / (2 r^2))
//!         + sum of ridges A cos(2 pi (u . p - d) / wavelength)
//!         + random relief rms sqrt(2 / N) sum_n cos(k_n . p + phase_n)
//! ```
//!
//! The random relief has Gaussian wave vectors `k_n` with the standard deviation `sqrt 2 / L` per component, so that its ensemble has the
//! correlation `exp(-d^2 / L^2)`; `N` is 64, and by the central limit theorem the heights are Gaussian up to an excess kurtosis of
//! `-3 / (2 N)`, -0.02.
//!
//! The bilinear surface is the terrain: placement of points, normals and shadows ([`super::terrain_shadow`]) use the same one. Its distance
//! from the function is at most `(|h_xx| dx^2 + |h_yy| dy^2) / 8`.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_model::geometry::{Axis, Extent, Relief};

use super::SceneError;
use crate::random::{complex_normal, unit};

/// Random stream of the wave vectors.
const RELIEF: u64 = u64::from_be_bytes(*b"terrain\0");

/// Number of waves of the random relief.
const WAVES: usize = 64;

/// Heights of the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain(Relief);

/// Hill of Gaussian shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hill {
    /// Position of the summit, metres.
    pub centre_m: DVec2,
    /// Height of the summit above the surrounding ground, metres; negative for a hollow.
    pub height_m: f64,
    /// Radius at which the height has fallen to `exp(-1/2)`, metres.
    pub radius_m: f64,
}

/// Parallel ridges of sinusoidal section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ridges {
    /// Direction across the ridges, from x towards y, radians.
    pub direction_rad: f64,
    /// Distance of a crest from the origin along the direction, metres.
    pub crest_m: f64,
    /// Distance between crests, metres.
    pub wavelength_m: f64,
    /// Height of the crests above the mean, metres.
    pub height_m: f64,
}

/// Sum of a plane, hills, ridges and random relief.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeightFunction {
    /// Slopes along x and y.
    pub slope: DVec2,
    /// Hills and hollows of Gaussian shape.
    pub hills: Vec<Hill>,
    /// Systems of parallel ridges.
    pub ridges: Vec<Ridges>,
    /// RMS of the random relief, metres.
    pub rms_m: f64,
    /// Correlation length of the random relief, metres.
    pub correlation_m: f64,
}

impl HeightFunction {
    /// Whether the height is zero everywhere.
    pub fn is_flat(&self) -> bool {
        self.slope == DVec2::ZERO
            && self.rms_m == 0.0
            && self.hills.is_empty()
            && self.ridges.is_empty()
    }

    /// Height as a function of x and y, metres; the same seed gives the same random relief.
    pub fn prepare(&self, seed: u64) -> impl Fn(DVec2) -> f64 + use<'_> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RELIEF);
        let waves: Vec<(DVec2, f64)> = match self.rms_m > 0.0 {
            true => (0..WAVES)
                .map(|_| {
                    let k = complex_normal(&mut random) * (2f64.sqrt() / self.correlation_m);
                    (DVec2::new(k.re, k.im), TAU * unit(&mut random))
                })
                .collect(),
            false => Vec::new(),
        };
        let scale_m = self.rms_m * (2.0 / WAVES as f64).sqrt();
        move |at: DVec2| {
            let mut height_m = self.slope.dot(at);
            for hill in &self.hills {
                let far = at.distance_squared(hill.centre_m) / (hill.radius_m * hill.radius_m);
                height_m += hill.height_m * libm::exp(-far / 2.0);
            }
            for ridges in &self.ridges {
                let (sin, cos) = libm::sincos(ridges.direction_rad);
                let along_m = DVec2::new(cos, sin).dot(at) - ridges.crest_m;
                height_m += ridges.height_m * libm::cos(TAU * along_m / ridges.wavelength_m);
            }
            for (k, phase) in &waves {
                height_m += scale_m * libm::cos(k.dot(at) + phase);
            }
            height_m
        }
    }
}

impl Terrain {
    /// Terrain of these nodes.
    pub fn new(relief: Relief) -> Self {
        Self(relief)
    }

    /// Terrain from heights at nodes `spacing_m` apart over an extent; the spacing is reduced to a divisor of the extent, and increased where
    /// more than [`Relief::MAX_NODES`] nodes would be needed. `name` describes the source.
    ///
    /// # Errors
    /// [`SceneError`] for an extent or a spacing that is not positive, and for heights that are not finite or exceed 1000 km.
    pub fn sample(
        name: &str,
        extent: &Extent,
        spacing_m: f64,
        height_m: impl Fn(DVec2) -> f64,
    ) -> Result<Self, SceneError> {
        let axes = node_axes(extent, spacing_m)?;
        let [rows, columns] = axes;
        let mut heights_m = Vec::with_capacity(rows.count * columns.count);
        for row in 0..rows.count {
            for column in 0..columns.count {
                heights_m.push(height_m(DVec2::new(columns.at(column), rows.at(row))));
            }
        }
        let relief = Relief::new(name, axes, heights_m, 0.0);
        relief.map(Self).map_err(|e| SceneError(e.to_string()))
    }

    /// Heights at the nodes.
    pub fn relief(&self) -> &Relief {
        &self.0
    }

    /// Height at a position, metres.
    pub fn height_m(&self, at: DVec2) -> f64 {
        self.0.height_m(at.x, at.y)
    }

    /// Unit normal of the ground at a position, upwards.
    pub fn normal(&self, at: DVec2) -> DVec3 {
        let [x, y] = self.0.slopes(at.x, at.y);
        DVec3::new(-x, -y, 1.0).normalize()
    }
}

/// Rows and columns of nodes.
fn node_axes(extent: &Extent, spacing_m: f64) -> Result<[Axis; 2], SceneError> {
    let Extent { x_m, y_m } = extent;
    let sides_m = [y_m.1 - y_m.0, x_m.1 - x_m.0];
    let lengths = [sides_m[0], sides_m[1], spacing_m];
    if lengths.iter().any(|l| !(*l > 0.0 && l.is_finite())) {
        return Err(SceneError(format!(
            "terrain of {} x {} m with nodes {spacing_m} m apart: expected positive lengths",
            sides_m[1], sides_m[0]
        )));
    }
    let counts = |spacing_m: f64| sides_m.map(|side| (side / spacing_m).ceil().max(1.0) + 1.0);
    let mut spacing_m = spacing_m;
    while counts(spacing_m).iter().product::<f64>() > Relief::MAX_NODES as f64 {
        spacing_m *= 1.02;
    }
    let counts = counts(spacing_m);
    let axis = |i: usize, start: f64| Axis {
        start,
        step: sides_m[i] / (counts[i] - 1.0),
        count: counts[i] as usize,
    };
    Ok([axis(0, y_m.0), axis(1, x_m.0)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(half_m: f64) -> Extent {
        Extent {
            x_m: (-half_m, half_m),
            y_m: (-half_m, half_m),
        }
    }

    #[test]
    fn plane_hill_and_ridge_have_their_heights_and_normals() {
        let function = HeightFunction {
            slope: DVec2::new(0.1, -0.05),
            hills: vec![Hill {
                centre_m: DVec2::new(10.0, -20.0),
                height_m: 8.0,
                radius_m: 15.0,
            }],
            ridges: vec![Ridges {
                direction_rad: 0.5,
                crest_m: 3.0,
                wavelength_m: 60.0,
                height_m: 2.0,
            }],
            ..HeightFunction::default()
        };
        let terrain =
            Terrain::sample("a function", &square(80.0), 0.5, function.prepare(0)).unwrap();
        for at in [DVec2::new(10.0, -20.0), DVec2::new(-31.3, 44.4)] {
            let hill = 8.0 * (-at.distance_squared(DVec2::new(10.0, -20.0)) / 450.0).exp();
            let u = DVec2::new(0.5f64.cos(), 0.5f64.sin());
            let turns = (u.dot(at) - 3.0) / 60.0;
            let expected = 0.1 * at.x - 0.05 * at.y + hill + 2.0 * (TAU * turns).cos();
            // Bilinear: curvatures of 8 / 15^2 and 2 (TAU / 60)^2 over 0.5 m, two axes: 0.0036 m.
            let got = terrain.height_m(at);
            assert!((got - expected).abs() < 0.0037, "{at}: {got}, {expected}");
        }
        let plane = HeightFunction {
            slope: DVec2::new(0.3, 0.4),
            ..HeightFunction::default()
        };
        let terrain = Terrain::sample("a plane", &square(50.0), 1.0, plane.prepare(0)).unwrap();
        let expected = DVec3::new(-0.3, -0.4, 1.0) / 1.25f64.sqrt();
        // Heights are rounded to 0.1 mm: slopes of nodes 1 m apart are off by at most 1e-4.
        assert!(terrain.normal(DVec2::new(7.7, 1.2)).distance(expected) < 2e-4);
        assert!(!plane.is_flat() && HeightFunction::default().is_flat());
    }

    #[test]
    fn random_relief_has_stated_rms_and_correlation_and_depends_on_seed() {
        let function = HeightFunction {
            rms_m: 3.0,
            correlation_m: 40.0,
            ..HeightFunction::default()
        };
        // Over seeds, heights at two points: 2000 pairs, relative standard error of moments 1/sqrt(1000) = 3.2 %.
        let (mut square_sum, mut product) = (0.0, 0.0);
        let count = 2000;
        for seed in 0..count {
            let height = function.prepare(seed);
            let (a, b) = (height(DVec2::ZERO), height(DVec2::new(24.0, 18.0)));
            square_sum += a * a;
            product += a * b;
        }
        let variance = square_sum / count as f64;
        assert!((variance / 9.0 - 1.0).abs() < 0.16, "{variance}");
        // 30 m: exp(-9/16) = 0.570.
        let correlation = product / square_sum;
        assert!((correlation - 0.570).abs() < 0.1, "{correlation}");
        let here = DVec2::new(1.0, 2.0);
        assert_eq!(function.prepare(4)(here), function.prepare(4)(here));
        assert_ne!(function.prepare(4)(here), function.prepare(5)(here));
    }

    #[test]
    fn nodes_are_limited_and_empty_extents_refused() {
        let wide = Terrain::sample("flat", &square(1e4), 1.0, |_| 1.0).unwrap();
        let nodes = wide.relief().heights_m().len();
        assert!((200_000..=Relief::MAX_NODES).contains(&nodes), "{nodes}");
        let error = Terrain::sample("flat", &square(-1.0), 1.0, |_| 1.0).unwrap_err();
        assert!(error.to_string().contains("positive lengths"), "{error}");
        assert!(Terrain::sample("flat", &square(1.0), 1.0, |_| f64::NAN).is_err());
    }
}
