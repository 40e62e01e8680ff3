//! Vehicles: an opaque box with scattering centres.
//!
//! | part | share of the power | position | aspect |
//! |---|---|---|---|
//! | plates: front, rear, both sides, each with the ground before it | 1/2, by area | along the foot of the plate, at most 0.5 m apart | flash of the given width ([`super::Facet`]) |
//! | wheel wells | 1/4 | at the sides, a fifth of the length from the ends, 0.3 m high at most | own side |
//! | corners of the roof | 1/4 | on the top | all |
//!
//! Phases are random, so that powers add up. The stated cross section is the sum of all powers, averaged over the azimuth, without occlusion:
//! the box hides wells and plates on the far side, so that a radar sees about two thirds of it. With a speed, box and scattering centres move
//! along the heading at constant height. Neglected: windows, the ground clearance, vibration and turning wheels, the tilt on slopes.

use glam::{DQuat, DVec2, DVec3};
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::facet::flash;
use super::{Block, Facet, MovingBlock, SceneError};
use crate::Scatterer;
use crate::random::unit;
use subaperture_signal::phase::phasor;

/// Random stream of the phases.
const VEHICLE: u64 = u64::from_be_bytes(*b"vehicle\0");

/// Largest distance between the scattering centres of a plate, metres.
const SPACING_M: f64 = 0.5;

/// Widest flash, radians: 60 degrees.
const WIDEST_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// Largest length of a vehicle, metres.
const LONGEST_M: f64 = 100.0;

/// Vehicle on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vehicle {
    /// Middle of the ground plan at the epoch, metres.
    pub position_m: DVec3,
    /// Length, width and height, metres.
    pub size_m: DVec3,
    /// Angle from the scene's x axis to the length, towards y, radians.
    pub heading_rad: f64,
    /// Speed along the heading, metres per second.
    pub speed_m_s: f64,
    /// Time at which it is at its position, seconds.
    pub epoch_s: f64,
    /// Sum of the cross sections of all scattering centres, each averaged over the azimuth, m².
    pub cross_section_m2: f64,
    /// Half-power width of the flashes of the plates, radians, at most 60 degrees.
    pub flash_rad: f64,
}

impl Vehicle {
    fn velocity_m_s(&self) -> DVec3 {
        let (sin, cos) = libm::sincos(self.heading_rad);
        DVec3::new(cos, sin, 0.0) * self.speed_m_s
    }

    /// Opaque box, which moves with the vehicle.
    pub fn block(&self) -> MovingBlock {
        let velocity_m_s = self.velocity_m_s();
        MovingBlock {
            start: Block {
                centre_m: self.position_m + DVec3::Z * (self.size_m.z / 2.0)
                    - velocity_m_s * self.epoch_s,
                half_m: self.size_m / 2.0,
                attitude: DQuat::from_rotation_z(self.heading_rad),
            },
            velocity_m_s,
        }
    }

    /// Scattering centres; the same seed gives the same phases. Vehicles with one seed and different `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for sizes that are not positive or exceed 100 m, a negative cross section, a flash that is not wider than 0 or exceeds 60
    /// degrees, and other values that are not finite.
    pub fn facets(&self, seed: u64, index: u32) -> Result<Vec<Facet>, SceneError> {
        let size = self.size_m;
        let sized = size.min_element() > 0.0 && size.max_element() <= LONGEST_M;
        let flashes = self.flash_rad > 0.0 && self.flash_rad <= WIDEST_RAD;
        let placed = self.position_m.is_finite() && self.heading_rad.is_finite();
        let moves = self.speed_m_s.is_finite() && self.epoch_s.is_finite();
        let strong = self.cross_section_m2 >= 0.0 && self.cross_section_m2.is_finite();
        if !(sized && flashes && placed && moves && strong) {
            return Err(SceneError(format!(
                "vehicle of {size} m at {} m with a flash of {} rad and {} m2: expected lengths of at most {LONGEST_M} m, a flash of at most \
                 {WIDEST_RAD:.3} rad and finite values",
                self.position_m, self.flash_rad, self.cross_section_m2
            )));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(VEHICLE.wrapping_add(u64::from(index)));
        let half = size / 2.0;
        let mut facets = Vec::new();
        let mut add = |place: DVec3, power_m2: f64, normal: Option<DVec2>| {
            let phase = phasor(unit(&mut random));
            facets.push(self.facet(place, power_m2, phase, normal));
        };
        let plates = [
            (DVec2::X, half.x, half.y),
            (DVec2::NEG_X, half.x, half.y),
            (DVec2::Y, half.y, half.x),
            (DVec2::NEG_Y, half.y, half.x),
        ];
        // Areas are proportional to lengths.
        let all_m: f64 = plates.iter().map(|plate| 2.0 * plate.2).sum();
        for (normal, out_m, half_m) in plates {
            let count = (2.0 * half_m / SPACING_M).ceil().max(1.0);
            let power_m2 = 0.5 * self.cross_section_m2 * 2.0 * half_m / all_m / count;
            for i in 0..count as usize {
                let along = half_m * ((2 * i + 1) as f64 / count - 1.0);
                let place = normal * out_m + normal.perp() * along;
                add(place.extend(0.0), power_m2, Some(normal));
            }
        }
        let each_m2 = self.cross_section_m2 / 16.0;
        for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let well = DVec3::new(0.6 * half.x * x, half.y * y, 0.3f64.min(half.z));
            add(well, each_m2, None);
            add(DVec3::new(half.x * x, half.y * y, size.z), each_m2, None);
        }
        Ok(facets)
    }

    fn facet(&self, place: DVec3, power_m2: f64, phase: Complex64, normal: Option<DVec2>) -> Facet {
        let turn = DQuat::from_rotation_z(self.heading_rad);
        let velocity_m_s = self.velocity_m_s();
        let amplitude = match normal {
            Some(_) => flash(power_m2, self.flash_rad, phase),
            None => phase * power_m2.sqrt(),
        };
        Facet {
            start: Scatterer {
                position_m: self.position_m + turn * place - velocity_m_s * self.epoch_s,
                amplitude,
            },
            velocity_m_s,
            normal: normal.map(|normal| (turn * normal.extend(0.0)).truncate()),
            width_rad: self.flash_rad,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::scene::shadow::hidden;

    fn car() -> Vehicle {
        Vehicle {
            position_m: DVec3::new(30.0, -8.0, 2.0),
            size_m: DVec3::new(4.4, 1.8, 1.5),
            heading_rad: 0.7,
            speed_m_s: 0.0,
            epoch_s: 0.0,
            cross_section_m2: 40.0,
            flash_rad: 0.15,
        }
    }

    #[test]
    fn powers_averaged_over_azimuth_add_up_to_stated_cross_section() {
        let facets = car().facets(3, 0).unwrap();
        let count = 7200;
        let mut sum = 0.0;
        for i in 0..count {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(count)).sin_cos();
            let towards = DVec3::new(cos, sin, 0.6);
            let power = |f: &Facet| f.start.amplitude.norm_sqr() * f.gain(towards).powi(2);
            sum += facets.iter().map(power).sum::<f64>();
        }
        assert!((sum / f64::from(count) / 40.0 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn broadside_flashes_and_far_side_is_hidden() {
        let car = car();
        let facets = car.facets(3, 0).unwrap();
        let block = [car.block().start];
        // Seen power from 1 km at 30 degrees of elevation, at an azimuth from the heading.
        let seen = |azimuth: f64| {
            let (sin, cos) = (azimuth + 0.7).sin_cos();
            let radar_m = car.position_m + DVec3::new(cos, sin, 0.577) * 1000.0;
            let power = |f: &Facet| {
                let place_m = f.position_m(0.0);
                let visible = !hidden(&block, radar_m, place_m);
                f.start.amplitude.norm_sqr()
                    * f.gain(radar_m - place_m).powi(2)
                    * f64::from(u8::from(visible))
            };
            facets.iter().map(power).sum::<f64>()
        };
        // Broadside: one side's plate, 4.4 of 12.4 m of half of the power, in a flash of the mean
        // 0.15 sqrt(pi / (4 ln 2)) / (2 pi) = 0.02541 of its peak; two wells and four corners.
        let side = 20.0 * 4.4 / 12.4 / 0.02541 + 5.0 + 10.0;
        let got = seen(TAU / 4.0);
        assert!((got / side - 1.0).abs() < 2e-3, "{got}, {side}");
        // At 45 degrees there are no flashes: two wells and the corners.
        let oblique = seen(TAU / 8.0);
        assert!((oblique - 15.0).abs() < 0.1, "{oblique}");
    }

    #[test]
    fn box_and_centres_move_along_heading_through_position_at_epoch() {
        let moving = Vehicle {
            speed_m_s: 12.0,
            epoch_s: 3.0,
            ..car()
        };
        let (still, moved) = (car().facets(1, 2).unwrap(), moving.facets(1, 2).unwrap());
        let shift = DVec3::new(0.7f64.cos(), 0.7f64.sin(), 0.0) * 24.0;
        for (still, moved) in still.iter().zip(&moved) {
            assert!(moved.position_m(3.0).distance(still.position_m(0.0)) < 1e-9);
            assert!(
                moved
                    .position_m(5.0)
                    .distance(still.position_m(0.0) + shift)
                    < 1e-9
            );
        }
        let block = moving.block().at(5.0);
        assert!(
            block
                .centre_m
                .distance(car().block().start.centre_m + shift)
                < 1e-9
        );
    }

    #[test]
    fn impossible_vehicles_are_refused() {
        let flat = Vehicle {
            size_m: DVec3::new(4.0, 0.0, 1.0),
            ..car()
        };
        let wide = Vehicle {
            flash_rad: 1.2,
            ..car()
        };
        let lost = Vehicle {
            heading_rad: f64::NAN,
            ..car()
        };
        for vehicle in [flat, wide, lost] {
            assert!(
                vehicle
                    .facets(0, 0)
                    .unwrap_err()
                    .to_string()
                    .contains("vehicle")
            );
        }
    }
}
