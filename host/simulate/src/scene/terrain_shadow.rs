//! Terrain shadow: visibility of points from antennas over terrain.
//!
//! For an antenna at `a` the lowest visible height over a node of the terrain at the horizontal distance `r` is that of the line over the
//! highest obstacle before it,
//!
//! ```text
//! s = a_z + r max over r' < r of (h(r') - a_z) / r'
//! ```
//!
//! (horizon by a running maximum along rays; Dozier and Frew 1990). A point is hidden if it is below `s`, bilinear between the nodes. Points
//! above the ground (roofs, crowns of trees) are tested with their own height.
//!
//! **Approximations.**
//! - Rays start at the antenna, half a node apart at the far end of the terrain, with samples half a node apart. A crest between samples is
//!   missed by at most a quarter of a node times its slope; the end of its shadow is displaced by that over the tangent of the grazing angle.
//!   The last sample before a node is left out, so that slopes towards the radar stay visible: a shadow begins up to one node
//!   behind its crest.
//! - `s` is computed at up to [`MAX_MAPS`] positions of the track, equally spaced in time, and interpolated linearly in between. Their number is
//!   chosen so that the direction of the longest shadow turns by at most one node between them. Where the maximum limits it (wide
//!   apertures with long shadows) the edge of a shadow is off by up to a quarter of its movement between two positions.
//! - One position of the radar's body stands for all its antennas: an antenna at the offset `b` displaces the edge of a shadow at the
//!   distance `d` behind an obstacle by `b d / R`.
//! - Edges are hard, the Earth is flat, and points outside of the terrain are visible.
//!
//! Cost: a few nanoseconds per point and pulse. Memory: 4 bytes per node and position.

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use subaperture_model::geometry::Relief;
use subaperture_model::track::Trajectory;

use super::terrain::Terrain;

/// Largest number of positions of the track at which the shadow is computed.
pub const MAX_MAPS: usize = 64;

/// Number of positions at which the movement of the radar is examined.
const EXAMINED: usize = 128;

/// Largest number of samples of all rays: 64 MiB. Only terrain of very unequal sides, or spacings of nodes, has longer steps for it.
const MOST_SAMPLES: f64 = (1u64 << 24) as f64;

/// Slope before the first sample of a ray.
const OPEN: f64 = -1e9;

/// Lowest visible heights over a terrain along a track.
#[derive(Clone, Debug)]
pub struct TerrainShadow {
    terrain: Terrain,
    first_s: f64,
    step_s: f64,
    /// Lowest visible heights at the nodes, metres, for each position.
    maps: Vec<Vec<f32>>,
}

/// Terrain shadow at one time.
#[derive(Clone, Copy, Debug)]
pub struct Shade<'a> {
    relief: &'a Relief,
    maps: [&'a [f32]; 2],
    second: f32,
}

impl TerrainShadow {
    /// Compute the shadow for the times `first_s` to `last_s` of a track, within `memory_bytes`; `None` if all ground is visible all the time.
    pub fn new(
        terrain: &Terrain,
        track: &dyn Trajectory,
        (first_s, last_s): (f64, f64),
        memory_bytes: u64,
    ) -> Option<Self> {
        let nodes = terrain.relief().heights_m().len() as u64;
        let fitting = (memory_bytes / (4 * nodes)).clamp(1, MAX_MAPS as u64) as usize;
        let count = positions(terrain, track, (first_s, last_s)).min(fitting);
        let step_s = (last_s - first_s) / (count.max(2) - 1) as f64;
        let maps: Vec<Vec<f32>> = (0..count)
            .into_par_iter()
            .map(|i| {
                let time_s = match count {
                    1 => 0.5 * (first_s + last_s),
                    _ => first_s + step_s * i as f64,
                };
                lowest_visible(terrain.relief(), track.pose(time_s).position_m)
            })
            .collect();
        let heights_m = terrain.relief().heights_m();
        let hides = |map: &Vec<f32>| map.iter().zip(heights_m).any(|(s, h)| f64::from(*s) > *h);
        maps.iter().any(hides).then(|| Self {
            terrain: terrain.clone(),
            first_s,
            step_s,
            maps,
        })
    }

    /// Shadow at a time, seconds; before the first and after the last position that position is used.
    pub fn at(&self, time_s: f64) -> Shade<'_> {
        let last = self.maps.len() - 1;
        let place = match self.step_s > 0.0 {
            true => ((time_s - self.first_s) / self.step_s)
                .max(0.0)
                .min(last as f64),
            false => 0.0,
        };
        let first = (place as usize).min(last.saturating_sub(1));
        Shade {
            relief: self.terrain.relief(),
            maps: [&self.maps[first], &self.maps[(first + 1).min(last)]],
            second: (place - first as f64) as f32,
        }
    }

    /// Size in memory, bytes.
    pub fn held_bytes(&self) -> u64 {
        self.maps.iter().map(|map| size_of_val(&**map) as u64).sum()
    }
}

impl Shade<'_> {
    /// Whether the terrain hides a point.
    pub fn hides(&self, point_m: DVec3) -> bool {
        let (rows, columns) = (self.relief.rows(), self.relief.columns());
        let u = (point_m.x - columns.start) / columns.step;
        let v = (point_m.y - rows.start) / rows.step;
        let (last_u, last_v) = ((columns.count - 1) as f64, (rows.count - 1) as f64);
        // NaN is outside, too.
        if !((0.0..=last_u).contains(&u) && (0.0..=last_v).contains(&v)) {
            return false;
        }
        let (column, row) = (
            (u as usize).min(columns.count - 2),
            (v as usize).min(rows.count - 2),
        );
        let (u, v) = ((u - column as f64) as f32, (v - row as f64) as f32);
        let at = row * columns.count + column;
        let height_m = |map: &[f32]| {
            let low = map[at] + (map[at + 1] - map[at]) * u;
            let above = at + columns.count;
            let high = map[above] + (map[above + 1] - map[above]) * u;
            low + (high - low) * v
        };
        let first = height_m(self.maps[0]);
        let lowest_m = match self.second == 0.0 {
            true => first,
            false => first + (height_m(self.maps[1]) - first) * self.second,
        };
        (point_m.z as f32) < lowest_m
    }
}

/// Number of positions for which the longest shadow turns by at most one node between them.
fn positions(terrain: &Terrain, track: &dyn Trajectory, (first_s, last_s): (f64, f64)) -> usize {
    let relief = terrain.relief();
    let (rows, columns) = (relief.rows(), relief.columns());
    let corner = |row: usize, column: usize| DVec2::new(columns.at(column), rows.at(row));
    let low = corner(0, 0);
    let high = corner(rows.count - 1, columns.count - 1);
    let middle = 0.5 * (low + high);
    let [lowest_m, highest_m] = relief.range_m();
    let reach_m = low.distance(high);
    let at = |i: usize| {
        let part = i as f64 / EXAMINED as f64;
        let place_m = track.pose(first_s + (last_s - first_s) * part).position_m;
        (place_m.truncate() - middle, place_m.z - highest_m)
    };
    let (mut turned, mut longest_m) = (0.0, 0.0f64);
    for i in 0..=EXAMINED {
        let (from, up_m) = at(i);
        let far_m = from.length() + 0.5 * reach_m;
        let shadow_m = match up_m > 0.0 {
            true => (highest_m - lowest_m) * far_m / up_m,
            false => reach_m,
        };
        longest_m = longest_m.max(shadow_m.min(reach_m));
        if i > 0 {
            let (before, before_up_m) = at(i - 1);
            let turn = libm::atan2(before.perp_dot(from), before.dot(from)).abs();
            let elevation = |from: DVec2, up_m: f64| libm::atan2(up_m, from.length());
            turned += turn + (elevation(from, up_m) - elevation(before, before_up_m)).abs();
        }
    }
    let moved = turned * longest_m / rows.step.min(columns.step);
    match moved < 0.01 {
        true => 1,
        false => (moved.ceil() as usize + 1).clamp(2, MAX_MAPS),
    }
}

/// Rays from an antenna over the rectangle of a relief.
struct Rays {
    /// Direction of the middle of the fan.
    ahead: DVec2,
    from_rad: f64,
    step_rad: f64,
    count: usize,
    near_m: f64,
    step_m: f64,
    samples: usize,
}

impl Rays {
    fn over(relief: &Relief, antenna: DVec2) -> Self {
        let (rows, columns) = (relief.rows(), relief.columns());
        let low = DVec2::new(columns.start, rows.start);
        let high = DVec2::new(columns.at(columns.count - 1), rows.at(rows.count - 1));
        let corners = [
            low,
            DVec2::new(high.x, low.y),
            high,
            DVec2::new(low.x, high.y),
        ];
        let mut step_m = 0.5 * rows.step.min(columns.step);
        let far_m = corners
            .iter()
            .map(|c| c.distance(antenna))
            .fold(0.0, f64::max);
        let near_m = antenna.distance(antenna.clamp(low, high));
        let ahead = (0.5 * (low + high) - antenna).normalize_or(DVec2::X);
        let angles = corners.map(|corner| angle(ahead, corner - antenna));
        let least = angles.into_iter().fold(f64::INFINITY, f64::min);
        let most = angles.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let (from_rad, to_rad) = match near_m > 0.0 {
            true => (least, most),
            false => (-std::f64::consts::PI, std::f64::consts::PI),
        };
        let counts = |step_m: f64| {
            let lengths = [(to_rad - from_rad) * far_m, far_m - near_m];
            lengths.map(|length_m| (length_m / step_m).ceil() + 2.0)
        };
        while counts(step_m).iter().product::<f64>() > MOST_SAMPLES {
            step_m *= 1.5;
        }
        let [count, samples] = counts(step_m).map(|count| count as usize);
        Self {
            ahead,
            from_rad,
            step_rad: (to_rad - from_rad) / (count.max(2) - 1) as f64,
            count: count.max(2),
            near_m,
            step_m,
            samples: samples.max(1),
        }
    }

    fn direction(&self, ray: usize) -> DVec2 {
        let (sin, cos) = libm::sincos(self.from_rad + self.step_rad * ray as f64);
        self.ahead.rotate(DVec2::new(cos, sin))
    }
}

/// Angle from one direction to another, radians.
fn angle(from: DVec2, to: DVec2) -> f64 {
    libm::atan2(from.perp_dot(to), from.dot(to))
}

/// Lowest visible heights at the nodes from an antenna, metres.
fn lowest_visible(relief: &Relief, antenna_m: DVec3) -> Vec<f32> {
    let (rows, columns) = (relief.rows(), relief.columns());
    let antenna = antenna_m.truncate();
    let rays = Rays::over(relief, antenna);
    let last = DVec2::new(columns.at(columns.count - 1), rows.at(rows.count - 1));
    let first = DVec2::new(columns.start, rows.start);
    let inside = |at: DVec2| at.cmpge(first).all() && at.cmple(last).all();
    // Horizon before each sample of each ray.
    let mut horizon = vec![OPEN as f32; rays.count * rays.samples];
    for (ray, line) in horizon.chunks_mut(rays.samples).enumerate() {
        let direction = rays.direction(ray);
        let mut highest = OPEN;
        for (i, before) in line.iter_mut().enumerate() {
            *before = highest as f32;
            let range_m = rays.near_m + rays.step_m * i as f64;
            let at = antenna + direction * range_m;
            if range_m > 0.0 && inside(at) {
                highest = highest.max((relief.height_m(at.x, at.y) - antenna_m.z) / range_m);
            }
        }
    }
    // Far below the ground a height has no meaning, and would bend the edge of a shadow between nodes.
    let depth_m = 8.0 * rows.step.max(columns.step);
    let mut lowest = Vec::with_capacity(rows.count * columns.count);
    for row in 0..rows.count {
        for column in 0..columns.count {
            let from = DVec2::new(columns.at(column), rows.at(row)) - antenna;
            let range_m = from.length();
            let place = (angle(rays.ahead, from) - rays.from_rad) / rays.step_rad;
            let place = place.max(0.0).min((rays.count - 1) as f64);
            let ray = (place as usize).min(rays.count - 2);
            let sample = ((range_m - rays.near_m) / rays.step_m).max(0.0) as usize;
            let at =
                |ray: usize| f64::from(horizon[ray * rays.samples + sample.min(rays.samples - 1)]);
            let slope = at(ray) + (at(ray + 1) - at(ray)) * (place - ray as f64);
            let ground_m = relief.heights_m()[row * columns.count + column];
            let height_m = antenna_m.z + slope * range_m;
            lowest.push(height_m.max(ground_m - depth_m) as f32);
        }
    }
    lowest
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::DQuat;
    use subaperture_model::geometry::Extent;
    use subaperture_model::track::Pose;

    use super::*;
    use crate::scene::terrain::{HeightFunction, Hill};

    #[derive(Debug)]
    struct Flight {
        start_m: DVec3,
        velocity_m_s: DVec3,
    }

    impl Trajectory for Flight {
        fn pose(&self, time_s: f64) -> Pose {
            Pose {
                position_m: self.start_m + self.velocity_m_s * time_s,
                attitude: DQuat::IDENTITY,
            }
        }
    }

    fn square(half_m: f64) -> Extent {
        Extent {
            x_m: (-half_m, half_m),
            y_m: (-half_m, half_m),
        }
    }

    /// Roof-shaped ridge along x with its crest at `y = -20`, 10 m high and 20 m wide.
    fn roof(at: DVec2) -> f64 {
        (10.0 - (at.y + 20.0).abs()).max(0.0)
    }

    #[test]
    fn ridge_casts_shadow_of_geometric_length_on_flat_ground() {
        // From 1000 m to the south of the crest and 200 m above the ground: the line over the crest drops 190 m in 1000 m and
        // meets the ground 10 / 0.19 = 52.63 m behind it.
        let terrain = Terrain::sample("a roof", &square(80.0), 1.0, roof).unwrap();
        let radar = Flight {
            start_m: DVec3::new(0.0, -1020.0, 200.0),
            velocity_m_s: DVec3::ZERO,
        };
        let shadow = TerrainShadow::new(&terrain, &radar, (0.0, 1.0), u64::MAX).unwrap();
        let shade = shadow.at(0.4);
        let end_m = -20.0 + 10.0 / 0.19;
        // The crest is a node; rays are not along the columns, so that it is missed by up to a quarter of a node's slope: 0.25 m, over
        // a grazing tangent of 0.19: 1.3 m.
        for x in [0.0, 13.3] {
            let hides = |y: f64| shade.hides(DVec3::new(x, y, roof(DVec2::new(x, y))));
            assert!(
                (0..700).all(|i| !hides(-79.0 + 0.08 * f64::from(i))),
                "before"
            );
            assert!(
                (0..480).all(|i| hides(-18.0 + 0.1 * f64::from(i))),
                "within"
            );
            assert!(hides(end_m - 1.4) && !hides(end_m + 0.1), "{end_m}");
            // A point 5 m above the ground: half the height, 26.3 m behind the crest.
            let up = |y: f64| shade.hides(DVec3::new(x, y, 5.0));
            assert!(up(-20.0 + 26.3 - 1.4) && !up(-20.0 + 26.3 + 0.1));
        }
        assert!(!shade.hides(DVec3::new(0.0, 90.0, 0.0)), "outside");
        assert!(!shade.hides(DVec3::new(f64::NAN, 0.0, 0.0)));
    }

    #[test]
    fn shadow_agrees_with_march_along_the_line_of_sight() {
        let function = HeightFunction {
            hills: vec![Hill {
                centre_m: DVec2::new(10.0, -5.0),
                height_m: 25.0,
                radius_m: 14.0,
            }],
            rms_m: 2.0,
            correlation_m: 30.0,
            ..HeightFunction::default()
        };
        let terrain = Terrain::sample("hills", &square(100.0), 1.0, function.prepare(2)).unwrap();
        let flight = Flight {
            start_m: DVec3::new(-150.0, -600.0, 150.0),
            velocity_m_s: DVec3::new(100.0, 0.0, 0.0),
        };
        let shadow = TerrainShadow::new(&terrain, &flight, (0.0, 3.0), u64::MAX).unwrap();
        let (mut hidden, mut differ, mut count) = (0, 0, 0);
        for time_s in [0.0, 0.71, 1.9, 3.0] {
            let radar_m = flight.pose(time_s).position_m;
            let shade = shadow.at(time_s);
            for i in 0..2500 {
                let at = DVec2::new(
                    -95.0 + 3.8 * f64::from(i % 50),
                    -95.0 + 3.8 * f64::from(i / 50),
                );
                let point_m = at.extend(terrain.height_m(at));
                // March in steps of 0.1 m on the same bilinear surface; lines that clear it by less than 0.1 m at 2 m or more
                // from the point are hidden.
                let to = (radar_m - point_m).normalize();
                let blocked = (20..2500).any(|k| {
                    let on = point_m + to * (0.1 * f64::from(k));
                    let within = on.x.abs() < 100.0 && on.y.abs() < 100.0;
                    within && terrain.height_m(on.truncate()) > on.z
                });
                let found = shade.hides(point_m);
                hidden += usize::from(blocked);
                differ += usize::from(blocked != found);
                count += 1;
            }
        }
        // Only points at edges of shadows differ: edges are some 400 m long, and at most one node wide on either side,
        // 400 x 2 of 40000 m^2.
        assert!(
            hidden * 20 > count && hidden * 2 < count,
            "{hidden} of {count}"
        );
        assert!(differ * 50 < count, "{differ} of {count}");
    }

    #[test]
    fn gentle_terrain_and_circular_tracks() {
        let gentle = Terrain::sample("a plane", &square(50.0), 1.0, |at| 0.05 * at.x).unwrap();
        let radar = Flight {
            start_m: DVec3::new(0.0, -900.0, 300.0),
            velocity_m_s: DVec3::new(50.0, 0.0, 0.0),
        };
        assert!(TerrainShadow::new(&gentle, &radar, (0.0, 2.0), u64::MAX).is_none());
        // A radar above the terrain sees all of a gentle hill, and the far side of a wall from neither side.
        let wall = Terrain::sample("a roof", &square(80.0), 1.0, roof).unwrap();
        #[derive(Debug)]
        struct Circle;
        impl Trajectory for Circle {
            fn pose(&self, time_s: f64) -> Pose {
                let (sin, cos) = (TAU * time_s).sin_cos();
                Pose {
                    position_m: DVec3::new(500.0 * cos, 500.0 * sin, 100.0),
                    attitude: DQuat::IDENTITY,
                }
            }
        }
        let shadow = TerrainShadow::new(&wall, &Circle, (0.0, 1.0), u64::MAX).unwrap();
        assert_eq!(shadow.held_bytes(), (MAX_MAPS * 161 * 161 * 4) as u64);
        let behind = DVec3::new(0.0, -5.0, 0.0);
        assert!(shadow.at(0.75).hides(behind), "from the south");
        assert!(!shadow.at(0.25).hides(behind), "from the north");
        // A strip of 1000 m x 1 cm, seen from the middle of its side, takes longer steps instead of memory.
        let strip = Extent {
            x_m: (-500.0, 500.0),
            y_m: (-0.005, 0.005),
        };
        let strip = Terrain::sample("a strip", &strip, 0.01, |at| at.x.abs()).unwrap();
        assert!(TerrainShadow::new(&strip, &Circle, (0.0, 1.0), u64::MAX).is_some());
        let within = TerrainShadow::new(&wall, &Circle, (0.0, 1.0), 4 * 161 * 161 * 9).unwrap();
        assert_eq!(within.held_bytes(), 9 * 161 * 161 * 4);
    }
}
