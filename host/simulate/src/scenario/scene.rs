//! Geometry and content of a scene from `[scene]`.

use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;

use crate::Scatterer;
use crate::scene::{Corner, Ground, Mover, Scene, TerrainShadow};
use subaperture_describe::place;
use subaperture_describe::track::{line, segments};
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::radar::Reference;
use subaperture_model::track::{Profile, Trajectory};
use subaperture_signal::phase::cis;

use super::around::Around;
use super::error::Fault;
use super::objects::Content;
use super::platform;
use super::scene_keys::{MoverKeys, MoverMotion, ReflectionKeys, SceneKeys};
use super::terrain;

/// Memory per point while a scene is prepared, bytes: 40 for the point, as much while it is made, 32 of the engine, and
/// as much while those are sorted.
const BYTES_A_POINT: u64 = 160;

/// Part of the memory for the terrain's shadow.
const SHADOW_SHARE: u64 = 8;

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
pub(super) fn build(keys: &SceneKeys, around: &Around, memory_bytes: u64) -> Result<Scene, Fault> {
    let middle_s = platform::middle_s(around.radar);
    let terrain = terrain::build(keys, around, memory_bytes)?;
    let terrain_shadow = terrain.as_ref().and_then(|terrain| {
        let times_s = (around.radar.start_s, 2.0 * middle_s - around.radar.start_s);
        TerrainShadow::new(terrain, around.track, times_s, memory_bytes / SHADOW_SHARE)
    });
    let shadow_bytes = terrain_shadow.as_ref().map_or(0, TerrainShadow::held_bytes);
    let ground = Ground {
        terrain: terrain.as_ref(),
        radar_m: around.track.pose(middle_s).position_m,
    };
    let most = ((memory_bytes - shadow_bytes) / BYTES_A_POINT) as f64;
    let mut building = Content {
        scene: Scene {
            terrain_shadow: terrain_shadow.map(Arc::new),
            ..Scene::default()
        },
        ground,
        around,
        most,
    };
    for point in &keys.point {
        building.scene.points.push(Scatterer {
            position_m: point.position_m,
            amplitude: point.reflection.amplitude(),
        });
    }
    for corner in &keys.corner {
        building.scene.corners.push(Corner {
            position_m: corner.position_m,
            boresight: corner.boresight.direction()?,
            edge_m: corner.edge_m,
        });
    }
    for mover in &keys.mover {
        building.scene.movers.push(Mover {
            motion: mover.track(middle_s)?,
            amplitude: mover.reflection.amplitude(),
        });
    }
    for (clutter, index) in keys.clutter.iter().zip(0..) {
        building.add_clutter(clutter, index)?;
    }
    for (picture, index) in keys.picture.iter().zip(0..) {
        building.add_picture(picture, index)?;
    }
    for (keys, index) in keys.building.iter().zip(0..) {
        building.add_building(keys, index)?;
    }
    for (vehicle, index) in keys.vehicle.iter().zip(0..) {
        building.add_vehicle(vehicle, index)?;
    }
    for (tree, index) in keys.tree.iter().zip(0..) {
        building.add_trees(tree, index)?;
    }
    Ok(building.scene)
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

impl ReflectionKeys {
    /// Square root of the cross section, with the phase of the reflection.
    fn amplitude(&self) -> Complex64 {
        cis(self.phase_rad) * self.cross_section_m2.sqrt()
    }
}
