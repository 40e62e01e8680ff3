//! Geometry and content of a scene from `[scene]`.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;

use crate::Scatterer;
use crate::scene::{
    Area, Building, Clutter, Corner, Density, InternalMotion, MAX_POINTS, Mover, Picture,
    Placement, Scene, SceneError,
};
use subaperture_describe::declare::Located;
use subaperture_describe::place;
use subaperture_describe::track::{line, segments};
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::radar::{Radar, Reference};
use subaperture_model::track::{Profile, Trajectory};
use subaperture_signal::phase::cis;

use super::error::Fault;
use super::keys::{
    AreaKeys, ClutterKeys, ExtentKeys, MoverKeys, MoverMotion, ReflectionKeys, SceneKeys,
};
use super::platform;

/// Memory per point while a scene is prepared, bytes: 40 for the point, as much while it is made, 32 of the engine, and
/// as much while those are sorted.
const BYTES_A_POINT: u64 = 160;

/// Memory of a point with a velocity, in points: 64 bytes for the point, 40 while it is made, 56 of the engine, and as
/// much while those are sorted.
const MOVING_POINT: f64 = 1.5;

/// Geometry of the scene.
pub(super) struct Place {
    pub(super) frame: SceneFrame,
    pub(super) extent: Option<Extent>,
    pub(super) reference: Reference,
}

/// Build the frame, extent and reference of the scene.
pub(super) fn place(scene: &SceneKeys) -> Result<Place, Fault> {
    let reference = place::reference(scene.reference_m, &scene.reference_range_m);
    Ok(Place {
        frame: scene.origin.frame(),
        extent: place::extent(&scene.x_m, &scene.y_m)?,
        reference: reference?.unwrap_or(Reference::Point(DVec3::ZERO)),
    })
}

/// Build the content of the scene.
pub(super) fn build(
    keys: &SceneKeys,
    radar: &Radar,
    seed: u64,
    folder: &Path,
    memory_bytes: u64,
) -> Result<Scene, Fault> {
    let most = (memory_bytes / BYTES_A_POINT) as f64;
    let mut scene = Scene::default();
    let left = |scene: &Scene| {
        let moving = MOVING_POINT * scene.moving_points.len() as f64;
        (most - scene.points.len() as f64 - moving).min(MAX_POINTS)
    };
    for point in &keys.point {
        scene.points.push(Scatterer {
            position_m: point.position_m,
            amplitude: point.reflection.amplitude(),
        });
    }
    for corner in &keys.corner {
        scene.corners.push(Corner {
            position_m: corner.position_m,
            boresight: corner.boresight.direction()?,
            edge_m: corner.edge_m,
        });
    }
    for mover in &keys.mover {
        scene.movers.push(Mover {
            motion: mover.track(platform::middle_s(radar))?,
            amplitude: mover.reflection.amplitude(),
        });
    }
    for (clutter, index) in keys.clutter.iter().zip(0..) {
        let motion = InternalMotion {
            velocity_spread_m_s: *clutter.velocity_spread_m_s,
            epoch_s: platform::middle_s(radar),
        };
        let moves = motion.velocity_spread_m_s > 0.0;
        let most = match moves {
            true => (left(&scene) / MOVING_POINT).floor(),
            false => left(&scene),
        };
        let points = clutter.build()?.points_within(seed, index, most);
        let points = made(&clutter.sigma0_db, points)?;
        if moves {
            let moving = motion.of(&points, seed, index);
            let moving = made(&clutter.velocity_spread_m_s, moving)?;
            scene.moving_points.extend(moving);
        } else {
            scene.points.extend(points);
        }
    }
    for (keys, index) in keys.picture.iter().zip(0..) {
        let picture = made(&keys.file, Picture::read(&folder.join(&*keys.file)))?;
        let placement = Placement {
            extent: keys.extent.build(),
            height_m: keys.height_m,
            spacing_m: *keys.spacing_m,
            white_sigma0_db: keys.sigma0_db,
            speckle: keys.speckle,
        };
        let points = picture.points_within(&placement, seed, index, left(&scene));
        scene.points.extend(made(&keys.spacing_m, points)?);
    }
    for (keys, index) in keys.building.iter().zip(0..) {
        let building = Building {
            centre_m: keys.position_m,
            size_m: *keys.size_m,
            yaw_rad: keys.yaw_rad,
            spacing_m: keys.spacing_m,
            wall_sigma0_db: keys.wall_db,
            edge_sigma_db: keys.edge_db,
            foot_sigma_db: keys.foot_db,
        };
        let points = building.points_within(seed, index, left(&scene));
        scene.points.extend(made(&keys.size_m, points)?);
        scene.blocks.push(building.block());
    }
    Ok(scene)
}

/// Attach an error to a key.
fn made<K, T>(key: &Located<K>, result: Result<T, SceneError>) -> Result<T, Fault> {
    result.map_err(|error| key.fault(error.to_string()))
}

impl MoverKeys {
    /// Track of the target. `middle_s` is the middle of the collection, seconds.
    fn track(&self, middle_s: f64) -> Result<Arc<dyn Trajectory>, Fault> {
        Ok(match &self.kind {
            MoverMotion::Linear(keys) => {
                line(keys.position_m, keys.velocity_m_s, keys.at.time_s(middle_s))
            }
            MoverMotion::Circular(keys) => {
                let at_s = keys.at.time_s(middle_s);
                keys.turn
                    .circle(keys.centre_m, keys.radius_m, keys.speed_m_s, at_s)
            }
            MoverMotion::Waypoints(keys) => segments(&keys.points)?,
            MoverMotion::Profile(keys) => {
                let rows = keys.pieces.iter();
                let pieces: Vec<(f64, DVec3)> = rows
                    .map(|&[duration_s, x, y, z]| (duration_s, DVec3::new(x, y, z)))
                    .collect();
                let profile =
                    Profile::new(keys.start_s, keys.position_m, keys.velocity_m_s, &pieces);
                Arc::new(profile.map_err(|error| keys.pieces.fault(error.to_string()))?)
            }
        })
    }
}

impl ClutterKeys {
    fn build(&self) -> Result<Clutter, Fault> {
        let (area, height_m) = match &self.kind {
            AreaKeys::Rectangle(keys) => (Area::Rectangle(keys.extent.build()), keys.height_m),
            AreaKeys::Disc(keys) => {
                let disc = Area::Disc {
                    centre_m: keys.centre_m.truncate(),
                    radius_m: keys.radius_m,
                };
                (disc, keys.centre_m.z)
            }
        };
        let density = match (*self.density, &self.count) {
            (Some(density), None) => Density::PerSquareMetre(density),
            (None, Some(count)) => Density::Total(**count),
            (Some(_), Some(count)) => {
                return Err(count.fault("give either density or count, not both"));
            }
            (None, None) => {
                return Err(self.density.fault(
                    "[[scene.clutter]] needs 'density' or 'count': write for example density = 1",
                ));
            }
        };
        Ok(Clutter {
            area,
            height_m,
            density,
            sigma0_db: *self.sigma0_db,
        })
    }
}

impl ExtentKeys {
    fn build(&self) -> Extent {
        let (x_m, y_m) = (self.x_m, self.y_m);
        Extent { x_m, y_m }
    }
}

impl ReflectionKeys {
    /// Square root of the cross section, with the phase of the reflection.
    fn amplitude(&self) -> Complex64 {
        cis(self.phase_rad) * self.cross_section_m2.sqrt()
    }
}
