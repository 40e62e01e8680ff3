//! A building: a box of walls, roof edge and foot, and the shadow it casts.
//!
//! Points lie in rows at a spacing `d` (as near to the one asked for as divides the lengths), in the
//! middles of their cells:
//!
//! | part | where | cross section of a point |
//! |---|---|---|
//! | walls | on the four faces | `wall sigma0 d_along d_up` |
//! | roof edge | along the top of the walls | `edge sigma d_along` |
//! | foot | along the bottom, where wall and ground make a dihedral | `foot sigma d_along` |
//!
//! Every point has a random phase, so that mean powers add up at any spacing: rough walls. A smooth wall's glint,
//! the directivity of edge and dihedral, the flat roof and reflections between buildings are neglected.
//! Walls face outwards because the box itself hides those on the far side ([`super::shadow`]).

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::clutter::{MOST_POINTS, check_points};
use super::{Block, SceneError};
use crate::Scatterer;
use crate::random::unit;
use subaperture_model::units::power_of_db;
use subaperture_signal::phase::phasor;

/// Stream of random numbers.
const BUILDING: u64 = u64::from_be_bytes(*b"building");

/// A box that stands upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Building {
    /// Middle of its ground plan, at the foot, metres.
    pub centre_m: DVec3,
    /// Length, width and height, metres: along its own x, y and z.
    pub size_m: DVec3,
    /// Angle from the scene's x axis to its own, towards y, radians.
    pub yaw_rad: f64,
    /// Distance from point to point, metres.
    pub spacing_m: f64,
    /// Mean cross section of a square metre of wall, dB.
    pub wall_sigma0_db: f64,
    /// Of a metre of roof edge, dB.
    pub edge_sigma_db: f64,
    /// Of a metre of the dihedral at the foot, dB.
    pub foot_sigma_db: f64,
}

impl Building {
    /// The box that casts the shadow.
    pub fn block(&self) -> Block {
        Block {
            centre_m: self.centre_m + DVec3::Z * (self.size_m.z / 2.0),
            half_m: self.size_m / 2.0,
            attitude: DQuat::from_rotation_z(self.yaw_rad),
        }
    }

    /// Its points; the same seed gives the same ones. Buildings of one seed and different `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for sizes or a spacing that are not positive, or more than 67 million points.
    pub fn points(&self, seed: u64, index: u32) -> Result<Vec<Scatterer>, SceneError> {
        self.points_within(seed, index, MOST_POINTS)
    }

    /// [`Self::points`], at most so many of them.
    pub(crate) fn points_within(
        &self,
        seed: u64,
        index: u32,
        most: f64,
    ) -> Result<Vec<Scatterer>, SceneError> {
        let lengths = [self.size_m.x, self.size_m.y, self.size_m.z, self.spacing_m];
        if lengths.iter().any(|l| !(*l > 0.0 && l.is_finite())) {
            return Err(SceneError(format!(
                "a building of {} m with points {} m apart; give positive lengths",
                self.size_m, self.spacing_m
            )));
        }
        let levels = [self.wall_sigma0_db, self.edge_sigma_db, self.foot_sigma_db];
        let places = [
            self.yaw_rad,
            self.centre_m.x,
            self.centre_m.y,
            self.centre_m.z,
        ];
        if levels.iter().chain(&places).any(|v| !v.is_finite()) {
            return Err(SceneError(format!(
                "a building at {} m, turned by {} rad, of {levels:?} dB; give finite values",
                self.centre_m, self.yaw_rad
            )));
        }
        let cells = |length: f64| (length / self.spacing_m).round().max(1.0);
        let (across, along, up) = (
            cells(self.size_m.x),
            cells(self.size_m.y),
            cells(self.size_m.z),
        );
        let count = 2.0 * (across + along) * (up + 2.0);
        if count > MOST_POINTS {
            return Err(SceneError(format!(
                "a building of {count:e} points; {MOST_POINTS} are possible: give a wider spacing"
            )));
        }
        check_points("a building", count, most)?;
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
        // A wall by the middle of its foot and the way along it, half its length.
        for (middle, way, cells) in [
            (DVec3::X * half.x, DVec3::Y * half.y, along),
            (DVec3::NEG_X * half.x, DVec3::Y * half.y, along),
            (DVec3::Y * half.y, DVec3::X * half.x, across),
            (DVec3::NEG_Y * half.y, DVec3::X * half.x, across),
        ] {
            let step = 2.0 * way.length() / cells;
            for i in 0..cells as usize {
                let base = middle + way * ((2 * i + 1) as f64 / cells - 1.0);
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
        }
    }

    #[test]
    fn cross_sections_add_up_to_those_of_walls_and_edges_at_any_spacing() {
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
            // A perimeter of 60 m: foot 10 m² a metre, roof edge 1, walls 360 m² of 0.1.
            assert!((sum(|z| (z - 3.0).abs() < 1e-9) - 600.0).abs() < 1e-9);
            assert!((sum(|z| (z - 9.0).abs() < 1e-9) - 60.0).abs() < 1e-9);
            assert!((sum(|z| (z - 6.0).abs() < 3.0 - 1e-9) - 36.0).abs() < 1e-9);
        }
    }

    #[test]
    fn only_what_faces_the_radar_is_seen() {
        let house = house();
        let turn = DQuat::from_rotation_z(house.yaw_rad);
        let radar = house.centre_m + turn * DVec3::new(0.0, -500.0, 300.0);
        let points = house.points(1, 0).unwrap();
        let blocks = [house.block()];
        let mut seen = 0;
        for point in &points {
            let own = turn.conjugate() * (point.position_m - house.centre_m);
            // In its middle plane the radar sees the front, and over the roof all edges of it.
            let expected = (own.y + 5.0).abs() < 1e-9 || (own.z - 6.0).abs() < 1e-9;
            assert_eq!(!hidden(&blocks, radar, point.position_m), expected, "{own}");
            seen += usize::from(expected);
        }
        // 40 columns of 12 + 2 in front, and the other three sides' 40 + 20 + 20 of edge.
        assert_eq!((points.len(), seen), (120 * 14, 40 * 14 + 80));
    }

    #[test]
    fn impossible_buildings_are_refused() {
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
