//! Relief of a grid: intersection of a surface of the Earth with the normals of the grid's plane.
//!
//! At each node the height `z` over the plane at which the plane's normal intersects the surface is found by the fixed-point iteration
//!
//! ```text
//! z <- z + (surface(latitude, longitude) - height) / cos,      latitude, longitude, height of foot + z normal
//! ```
//!
//! with the cosine between normal and vertical. Each step multiplies the error by the surface's slope times the tangent of that angle, which for a
//! horizontal plane is at most a thousandth per kilometre of scene.
//!
//! **Node spacing** keeps the interpolation error within a twentieth of a pixel. The error is measured at the centres of all cells and of their edges, where
//! bilinear interpolation of a smooth surface is worst, and recorded as [`Relief::error_m`]. On an elevation model, nodes are never farther apart than its posts,
//! unless that takes more than [`Relief::MAX_NODES`]. The image is focused exactly on the interpolated surface: the error is a displacement on the
//! ground, at most the height error over the tangent of the grazing angle, and no defocus.

use glam::DVec3;

use subaperture_model::geometry::{Axis, ImageGrid, Relief, SceneFrame};
use subaperture_model::monitor::Monitor;

use crate::terrain::region::{MIN_COSINE, plane_box};
use crate::terrain::{Ground, TerrainError};

/// Target interpolation error over the smaller pixel side.
const OF_A_PIXEL: f64 = 0.05;

/// Refinement ends where the next spacing would exceed this fraction of the present one.
const LITTLE_FINER: f64 = 0.9;

/// Initial nodes per side.
const FIRST: usize = 5;

/// Largest number of iterations along a normal.
const MAX_STEPS: usize = 100;

/// Convergence threshold, metres; below the rounding of nodes.
const NEAR_M: f64 = 1e-5;

/// Surface on which an image is focused.
#[derive(Clone, Copy, Debug)]
pub enum Surface<'a> {
    /// Constant height above the WGS 84 ellipsoid, metres.
    Ellipsoid(f64),
    /// Ground heights from elevation models.
    Ground(&'a Ground),
}

impl Surface<'_> {
    /// Description for errors and records.
    fn name(&self) -> String {
        match self {
            Self::Ellipsoid(height_m) => {
                format!("the surface {height_m} m above the ellipsoid")
            }
            Self::Ground(ground) => ground.name().to_owned(),
        }
    }

    fn height_m(&self, latitude_deg: f64, longitude_deg: f64) -> Result<f64, TerrainError> {
        match self {
            Self::Ellipsoid(height_m) => Ok(*height_m),
            Self::Ground(ground) => ground.height_m(latitude_deg, longitude_deg),
        }
    }
}

/// Compute the relief of a surface over the plane of a grid.
///
/// # Errors
/// [`TerrainError`] if the scene has no position on the Earth, the surface has a void there, the plane is too steep, or the monitor cancels.
pub fn relief(
    grid: &ImageGrid,
    frame: &SceneFrame,
    surface: Surface,
    monitor: &dyn Monitor,
) -> Result<Relief, TerrainError> {
    let over = Over {
        grid,
        frame,
        surface,
        normal: grid.normal(),
    };
    let [low, high] = plane_box(grid);
    let sides_m = [high[1] - low[1], high[0] - low[0]];
    let middle = frame
        .geodetic(over.foot([0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])]))
        .ok_or(TerrainError::Local)?;
    let pixel_m = match grid.polar {
        false => grid.rows.step.min(grid.columns.step),
        true => grid.rows.step,
    };
    let farthest_m = match surface {
        Surface::Ellipsoid(_) => f64::INFINITY,
        Surface::Ground(ground) => ground.step_m(middle.latitude_deg),
    };
    let mut step_m = (sides_m[0].max(sides_m[1]) / (FIRST - 1) as f64).min(farthest_m);
    let count = |step_m: f64| sides_m.map(|side| (side / step_m).ceil() as usize + 1);
    let fits = |[rows, columns]: [usize; 2]| rows.saturating_mul(columns) <= Relief::MAX_NODES;
    while !fits(count(step_m).map(|n| n.max(2))) {
        step_m *= 1.1;
    }
    loop {
        let counts = count(step_m).map(|n| n.max(2));
        let axis = |i: usize, start: f64| Axis {
            start,
            step: sides_m[i] / (counts[i] - 1) as f64,
            count: counts[i],
        };
        let axes = [axis(0, low[1]), axis(1, low[0])];
        let heights_m = over.nodes(&axes, monitor)?;
        let nodes = Relief::new(surface.name(), axes, heights_m, 0.0)?;
        let error_m = over.error_m(&nodes, monitor)?;
        // Half the spacing, or the finest that the node limit allows.
        let mut finer_m = 0.5 * step_m;
        while !fits(count(finer_m)) {
            finer_m *= 1.02;
        }
        if error_m <= OF_A_PIXEL * pixel_m || finer_m > LITTLE_FINER * step_m {
            let heights_m = nodes.heights_m().to_vec();
            return Ok(Relief::new(surface.name(), axes, heights_m, error_m)?);
        }
        step_m = finer_m;
    }
}

/// Surface seen from a grid's plane.
struct Over<'a> {
    grid: &'a ImageGrid,
    frame: &'a SceneFrame,
    surface: Surface<'a>,
    normal: DVec3,
}

impl Over<'_> {
    fn foot(&self, [x, y]: [f64; 2]) -> DVec3 {
        self.grid.origin_m + self.grid.x_axis * x + self.grid.y_axis * y
    }

    /// Heights over the plane at all nodes, metres.
    fn nodes(
        &self,
        [rows, columns]: &[Axis; 2],
        monitor: &dyn Monitor,
    ) -> Result<Vec<f64>, TerrainError> {
        let mut heights_m = Vec::with_capacity(rows.count * columns.count);
        let mut last_m = 0.0;
        for row in 0..rows.count {
            if monitor.cancelled() {
                return Err(TerrainError::Cancelled);
            }
            for column in 0..columns.count {
                last_m = self.height_m([columns.at(column), rows.at(row)], last_m)?;
                heights_m.push(last_m);
            }
        }
        Ok(heights_m)
    }

    /// Interpolation error, metres: maximum over the centres of cells and of their edges.
    fn error_m(&self, nodes: &Relief, monitor: &dyn Monitor) -> Result<f64, TerrainError> {
        let (rows, columns) = (nodes.rows(), nodes.columns());
        let mut error_m = 0.0f64;
        for row in 0..rows.count - 1 {
            if monitor.cancelled() {
                return Err(TerrainError::Cancelled);
            }
            for column in 0..columns.count - 1 {
                for [v, u] in [[0.5, 0.5], [0.0, 0.5], [0.5, 0.0]] {
                    let x = columns.start + (column as f64 + u) * columns.step;
                    let y = rows.start + (row as f64 + v) * rows.step;
                    let between_m = nodes.height_m(x, y);
                    let own_m = self.height_m([x, y], between_m)?;
                    error_m = error_m.max((own_m - between_m).abs());
                }
            }
        }
        Ok(error_m)
    }

    /// Height over the plane at a point of it, metres; the iteration starts at `guess_m`.
    fn height_m(&self, place: [f64; 2], guess_m: f64) -> Result<f64, TerrainError> {
        let foot = self.foot(place);
        let mut height_m = guess_m;
        let mut at = self.frame.geodetic(foot).ok_or(TerrainError::Local)?;
        for _ in 0..MAX_STEPS {
            at = self
                .frame
                .geodetic(foot + self.normal * height_m)
                .ok_or(TerrainError::Local)?;
            let cosine = self
                .frame
                .direction_from_ecf(at.east_north_up()[2])
                .dot(self.normal);
            if cosine.abs() < MIN_COSINE {
                break;
            }
            let there_m = self.surface.height_m(at.latitude_deg, at.longitude_deg)?;
            let step_m = (there_m - at.height_m) / cosine;
            height_m += step_m;
            if step_m.abs() < NEAR_M {
                return Ok(height_m);
            }
        }
        Err(TerrainError::Steep {
            surface: self.surface.name(),
            latitude_deg: at.latitude_deg,
            longitude_deg: at.longitude_deg,
        })
    }
}
