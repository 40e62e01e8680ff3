//! Objects of a scene on its ground.

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_model::geometry::Extent;

use super::around::Around;
use super::platform;
use super::scene_keys::{
    AreaKeys, BuildingKeys, ClutterKeys, ExtentKeys, PictureKeys, TreeKeys, TreePlaces, VehicleKeys,
};
use crate::Scatterer;
use crate::random::unit;
use crate::scene::{
    Area, Backscatter, Building, Clutter, Density, Ground, InternalMotion, MAX_POINTS, Mask,
    Picture, Placement, Scene, SceneError, Texture, Tree, Vehicle,
};

/// Memory of a point with a velocity, in points: 64 bytes for the point, 40 while it is made, 56 of the engine, and as
/// much while those are sorted.
const MOVING_POINT: f64 = 1.5;

/// Random stream of the places of trees.
const STAND: u64 = u64::from_be_bytes(*b"stand\0\0\0");

/// Scene that is being built.
pub(super) struct Content<'a> {
    pub(super) scene: Scene,
    pub(super) ground: Ground<'a>,
    pub(super) around: &'a Around<'a>,
    /// Number of points that fit into memory.
    pub(super) most: f64,
}

/// Attach an error to a key.
fn made<K, T>(key: &Located<K>, result: Result<T, SceneError>) -> Result<T, Fault> {
    result.map_err(|error| key.fault(error.to_string()))
}

impl Content<'_> {
    /// Number of further points that fit into memory.
    fn left(&self) -> f64 {
        let moving = MOVING_POINT * self.scene.moving_points.len() as f64;
        (self.most - self.scene.points.len() as f64 - moving).min(MAX_POINTS)
    }

    /// Points on the plane, raised to the ground.
    fn raised(&self, points: Vec<Scatterer>) -> impl Iterator<Item = Scatterer> + use<'_> {
        points.into_iter().map(|point| Scatterer {
            position_m: self.ground.raise(point.position_m),
            ..point
        })
    }

    pub(super) fn add_clutter(&mut self, keys: &ClutterKeys, index: u32) -> Result<(), Fault> {
        let seed = self.around.seed;
        let motion = InternalMotion {
            velocity_spread_m_s: *keys.velocity_spread_m_s,
            epoch_s: platform::middle_s(self.around.radar),
        };
        let moves = motion.velocity_spread_m_s > 0.0;
        let most = match moves {
            true => (self.left() / MOVING_POINT).floor(),
            false => self.left(),
        };
        let (clutter, extent) = keys.build(self.around.radar.waveform.centre_hz())?;
        let mask = match &keys.map {
            None => None,
            Some(file) => Some(Mask {
                map: made(
                    file,
                    Picture::read_values(&self.around.folder.join(&**file)),
                )?,
                extent,
                value: keys.map_value as f32,
            }),
        };
        let points = clutter.points_within(&self.ground, mask.as_ref(), (seed, index), most);
        let points = made(&keys.density, points)?;
        if moves {
            let moving = motion.of(&points, seed, index);
            let moving = made(&keys.velocity_spread_m_s, moving)?;
            self.scene.moving_points.extend(moving);
        } else if self.scene.points.is_empty() {
            // Two copies of many points would take as much memory again.
            self.scene.points = points;
        } else {
            self.scene.points.extend(points);
        }
        Ok(())
    }

    pub(super) fn add_picture(&mut self, keys: &PictureKeys, index: u32) -> Result<(), Fault> {
        let path = self.around.folder.join(&*keys.file);
        let picture = made(&keys.file, Picture::read(&path))?;
        let placement = Placement {
            extent: keys.extent.build(),
            height_m: keys.height_m,
            spacing_m: *keys.spacing_m,
            white_sigma0_db: keys.sigma0_db,
            speckle: keys.speckle,
        };
        let points = picture.points_within(&placement, self.around.seed, index, self.left());
        let points = made(&keys.spacing_m, points)?;
        let raised: Vec<_> = self.raised(points).collect();
        self.scene.points.extend(raised);
        Ok(())
    }

    pub(super) fn add_building(&mut self, keys: &BuildingKeys, index: u32) -> Result<(), Fault> {
        let building = Building {
            centre_m: self.ground.raise(keys.position_m),
            size_m: *keys.size_m,
            yaw_rad: keys.yaw_rad,
            spacing_m: keys.spacing_m,
            wall_sigma0_db: keys.wall_db,
            edge_sigma_db: keys.edge_db,
            foot_sigma_db: keys.foot_db,
            roof_sigma0_db: keys.roof_db,
        };
        let points = building.points_within(self.around.seed, index, self.left());
        self.scene.points.extend(made(&keys.size_m, points)?);
        self.scene.blocks.push(building.block());
        Ok(())
    }

    pub(super) fn add_vehicle(&mut self, keys: &VehicleKeys, index: u32) -> Result<(), Fault> {
        let vehicle = Vehicle {
            position_m: self.ground.raise(keys.position_m),
            size_m: *keys.size_m,
            heading_rad: keys.heading_rad,
            speed_m_s: keys.speed_m_s,
            epoch_s: platform::middle_s(self.around.radar),
            cross_section_m2: keys.cross_section_m2,
            flash_rad: *keys.flash_rad,
        };
        let facets = vehicle.facets(self.around.seed, index);
        self.scene.facets.extend(made(&keys.size_m, facets)?);
        let block = vehicle.block();
        match vehicle.speed_m_s == 0.0 {
            true => self.scene.blocks.push(block.start),
            false => self.scene.moving_blocks.push(block),
        }
        Ok(())
    }

    pub(super) fn add_trees(&mut self, keys: &TreeKeys, index: u32) -> Result<(), Fault> {
        let seed = self.around.seed;
        let feet = match &keys.kind {
            TreePlaces::Single(own) => vec![own.position_m],
            TreePlaces::Stand(own) => {
                let Extent { x_m, y_m } = own.extent.build();
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(STAND + u64::from(index));
                let mut between = |(low, high): (f64, f64)| low + (high - low) * unit(&mut random);
                let place = |_| DVec2::new(between(x_m), between(y_m)).extend(0.0);
                (0..own.trees).map(place).collect()
            }
        };
        for (foot_m, number) in feet.into_iter().zip(0u32..) {
            let tree = Tree {
                foot_m: self.ground.raise(foot_m),
                height_m: *keys.height_m,
                crown_base_m: keys.crown_base_m,
                crown_radius_m: keys.crown_radius_m,
                cross_section_m2: keys.cross_section_m2,
                trunk_share: keys.trunk_share,
                crown_points: keys.points,
                attenuation_db_m: keys.attenuation_db,
            };
            if keys.points as f64 + 1.0 > self.left() {
                return Err(keys.height_m.fault(format!(
                    "trees of {} points each exceed the memory: give fewer trees or points, or allow more memory",
                    keys.points
                )));
            }
            // Trees of different stands have different streams.
            let stream = index.wrapping_mul(1_000_003).wrapping_add(number);
            let points = made(&keys.height_m, tree.points(seed, stream))?;
            self.scene.points.extend(points);
            self.scene.canopies.extend(tree.canopy());
        }
        Ok(())
    }
}

impl ClutterKeys {
    /// Patch of clutter at the radar's centre frequency, and the rectangle around it.
    fn build(&self, centre_hz: f64) -> Result<(Clutter, Extent), Fault> {
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
        let clutter = Clutter {
            area,
            height_m,
            density,
            backscatter: self.backscatter(centre_hz)?,
            texture: self.texture_shape.as_ref().map(|shape| Texture {
                shape: **shape,
                length_m: self.texture_length_m,
            }),
        };
        Ok((clutter, area.extent()))
    }

    /// Mean backscatter by the one key that states it.
    fn backscatter(&self, centre_hz: f64) -> Result<Backscatter, Fault> {
        match (*self.sigma0_db, &self.gamma_db, &self.cover) {
            (Some(db), None, None) => Ok(Backscatter::Constant(db)),
            (None, Some(db), None) => Ok(Backscatter::Gamma(**db)),
            (None, None, Some(cover)) => {
                made(cover, cover.backscatter(centre_hz, self.polarisation))
            }
            (None, None, None) => Err(self.sigma0_db.fault(
                "[[scene.clutter]] needs 'sigma0', 'gamma' or 'cover': write for example sigma0 = \"-15 dB\"",
            )),
            _ => Err(self.sigma0_db.fault(
                "[[scene.clutter]]: expected one of sigma0, gamma and cover, found several: leave one of them",
            )),
        }
    }
}

impl ExtentKeys {
    fn build(&self) -> Extent {
        let (x_m, y_m) = (self.x_m, self.y_m);
        Extent { x_m, y_m }
    }
}
