//! Buildings: a box of walls, roof edges and feet, with its shadow.
//!
//! Points lie in rows with a spacing `d`, the divisor of the lengths nearest to the requested spacing, at the centres
//! of their cells:
//!
//! | part | position | cross section of a point |
//! |---|---|---|
//! | walls | on the four faces | `wall sigma0 d_along d_up` |
//! | roof edge | along the top of the walls | `edge sigma d_along` |
//! | foot | along the bottom, where wall and ground form a dihedral | `foot sigma d_along` |
//! | roof | on the top, if a level is given | `roof sigma0 d_x d_y` |
//!
//! In an image focused on the ground, seen at the angle of incidence `theta`, a point at the height `h` lies `h / tan theta` nearer to the radar (layover,
//! `tests/simulate/distributed.rs`): the top of the front wall and the front of the roof lie before the foot, whose line is at its place. The shadow on
//! flat ground ends `h tan theta` behind the far edge of the roof.
//!
//! Every point has a random phase, so that mean powers add up at any spacing (rough walls). Neglected: specular flashes
//! of smooth walls, the directivity of edges and dihedrals, gables, and multiple reflections between buildings.
//! Walls reflect only outwards, because the box itself occludes those on the far side ([`super::shadow`]).

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::clutter::{MAX_POINTS, check_points};
use super::{Block, SceneError};
use crate::Scatterer;
use crate::random::unit;
use subaperture_model::units::power_of_db;
use subaperture_signal::phase::phasor;

/// Random stream.
const BUILDING: u64 = u64::from_be_bytes(*b"building");

/// Upright box with reflecting walls, edges and feet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Building {
    /// Centre of the ground plan, at the foot, metres.
    pub centre_m: DVec3,
    /// Length, width and height along the building's own x, y and z, metres.
    pub size_m: DVec3,
    /// Angle from the scene's x axis to the building's x axis, towards y, radians.
    pub yaw_rad: f64,
    /// Spacing of the points, metres.
    pub spacing_m: f64,
    /// Mean cross section per square metre of wall, dB.
    pub wall_sigma0_db: f64,
    /// Cross section per metre of roof edge, dB.
    pub edge_sigma_db: f64,
    /// Cross section per metre of the dihedral at the foot, dB.
    pub foot_sigma_db: f64,
    /// Mean cross section per square metre of the flat roof, dB; `None` for a roof without points.
    pub roof_sigma0_db: Option<f64>,
}

impl Building {
    /// Opaque box that casts the shadow.
    pub fn block(&self) -> Block {
        Block {
            centre_m: self.centre_m + DVec3::Z * (self.size_m.z / 2.0),
            half_m: self.size_m / 2.0,
            attitude: DQuat::from_rotation_z(self.yaw_rad),
        }
    }

    /// Points of the building; the same seed gives the same points. Buildings with one seed and different `index`
    /// differ.
    ///
    /// # Errors
    /// [`SceneError`] for sizes or a spacing that are not positive, other values that are not finite, or more than 67
    /// million points.
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
        let lengths = [self.size_m.x, self.size_m.y, self.size_m.z, self.spacing_m];
        if lengths.iter().any(|l| !(*l > 0.0 && l.is_finite())) {
            return Err(SceneError(format!(
                "building of {} m with a point spacing of {} m: expected positive lengths",
                self.size_m, self.spacing_m
            )));
        }
        let levels = [self.wall_sigma0_db, self.edge_sigma_db, self.foot_sigma_db];
        let roof_db = self.roof_sigma0_db;
        let places = [
            self.yaw_rad,
            self.centre_m.x,
            self.centre_m.y,
            self.centre_m.z,
        ];
        if levels
            .iter()
            .chain(&places)
            .chain(&roof_db)
            .any(|v| !v.is_finite())
        {
            return Err(SceneError(format!(
                "building at {} m, yaw of {} rad, levels of {levels:?} dB: expected finite values",
                self.centre_m, self.yaw_rad
            )));
        }
        let cells = |length: f64| (length / self.spacing_m).round().max(1.0);
        let (across, along, up) = (
            cells(self.size_m.x),
            cells(self.size_m.y),
            cells(self.size_m.z),
        );
        let roofed = if roof_db.is_some() {
            across * along
        } else {
            0.0
        };
        let count = 2.0 * (across + along) * (up + 2.0) + roofed;
        if count > MAX_POINTS {
            return Err(SceneError(format!(
                "building of {count:e} points: expected at most {MAX_POINTS}. Give a wider spacing"
            )));
        }
        check_points("building", count, most)?;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(BUILDING + u64::from(index));
        let turn = DQuat::from_rotation_z(self.yaw_rad);
        let mut points = Vec::with_capacity(count as usize);
        let mut add = |place: DVec3, sigma_m2: f64| {
            points.push(Scatterer {
                position_m: self.centre_m + turn * place,
                amplitude: phasor(unit(&mut random)) * sigma_m2.sqrt(),
            });
        };
        let [wall, edge, foot] = levels.map(power_of_db);
        let half = self.size_m / 2.0;
        let step_up = self.size_m.z / up;
        // Each wall is given by the middle of its foot and half its length as a vector.
        for (middle, half_length, cells) in [
            (DVec3::X * half.x, DVec3::Y * half.y, along),
            (DVec3::NEG_X * half.x, DVec3::Y * half.y, along),
            (DVec3::Y * half.y, DVec3::X * half.x, across),
            (DVec3::NEG_Y * half.y, DVec3::X * half.x, across),
        ] {
            let step = 2.0 * half_length.length() / cells;
            for i in 0..cells as usize {
                let base = middle + half_length * ((2 * i + 1) as f64 / cells - 1.0);
                add(base, foot * step);
                for k in 0..up as usize {
                    add(
                        base + DVec3::Z * ((k as f64 + 0.5) * step_up),
                        wall * step * step_up,
                    );
                }
                add(base + DVec3::Z * self.size_m.z, edge * step);
            }
        }
        if let Some(db) = roof_db {
            let (dx, dy) = (self.size_m.x / across, self.size_m.y / along);
            let roof_m2 = power_of_db(db) * dx * dy;
            for row in 0..along as usize {
                for column in 0..across as usize {
                    let x_m = (column as f64 + 0.5) * dx - half.x;
                    let y_m = (row as f64 + 0.5) * dy - half.y;
                    add(DVec3::new(x_m, y_m, self.size_m.z), roof_m2);
                }
            }
        }
        Ok(points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shadow::hidden;

    fn house() -> Building {
        Building {
            centre_m: DVec3::new(100.0, 50.0, 3.0),
            size_m: DVec3::new(20.0, 10.0, 6.0),
            yaw_rad: 0.5,
            spacing_m: 0.5,
            wall_sigma0_db: -10.0,
            edge_sigma_db: 0.0,
            foot_sigma_db: 10.0,
            roof_sigma0_db: None,
        }
    }

    #[test]
    fn total_cross_section_is_independent_of_spacing() {
        for spacing_m in [0.5, 0.77, 3.0, 50.0] {
            let points = Building {
                spacing_m,
                ..house()
            }
            .points(1, 0)
            .unwrap();
            let sum = |pick: fn(f64) -> bool| -> f64 {
                let part = points.iter().filter(|p| pick(p.position_m.z));
                part.map(|p| p.amplitude.norm_sqr()).sum()
            };
            // A perimeter of 60 m: the foot has 10 m² per metre, the roof edge 1 m², the walls 360 m² times 0.1.
            assert!((sum(|z| (z - 3.0).abs() < 1e-9) - 600.0).abs() < 1e-9);
            assert!((sum(|z| (z - 9.0).abs() < 1e-9) - 60.0).abs() < 1e-9);
            assert!((sum(|z| (z - 6.0).abs() < 3.0 - 1e-9) - 36.0).abs() < 1e-9);
        }
    }

    #[test]
    fn only_parts_facing_the_radar_are_visible() {
        let house = house();
        let turn = DQuat::from_rotation_z(house.yaw_rad);
        let radar = house.centre_m + turn * DVec3::new(0.0, -500.0, 300.0);
        let points = house.points(1, 0).unwrap();
        let blocks = [house.block()];
        let mut seen = 0;
        for point in &points {
            let own = turn.conjugate() * (point.position_m - house.centre_m);
            // From its middle plane the radar sees the front, and all edges of the roof.
            let expected = (own.y + 5.0).abs() < 1e-9 || (own.z - 6.0).abs() < 1e-9;
            assert_eq!(!hidden(&blocks, radar, point.position_m), expected, "{own}");
            seen += usize::from(expected);
        }
        // 40 columns of 12 + 2 points in front, and 40 + 20 + 20 edge points of the other three sides.
        assert_eq!((points.len(), seen), (120 * 14, 40 * 14 + 80));
    }

    #[test]
    fn invalid_buildings_are_refused() {
        let refused = |b: Building| b.points(0, 0).unwrap_err().to_string();
        let flat = Building {
            size_m: DVec3::new(1.0, 0.0, 1.0),
            ..house()
        };
        assert!(refused(flat).contains("positive lengths"));
        let fine = Building {
            spacing_m: 1e-4,
            ..house()
        };
        assert!(refused(fine).contains("wider spacing"));
        let lost = Building {
            yaw_rad: f64::NAN,
            ..house()
        };
        assert!(refused(lost).contains("finite"));
    }
}
