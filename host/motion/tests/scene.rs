//! Simulator of sightings in three dimensions, with moving reflectors and heights, from plain distances.

use super::{ChaCha8Rng, Noise, Rng, SeedableRng, TAU, gaussian};
use glam::DVec2;
use subaperture_motion::{Array, Pose, Sighting};

/// Reflector: position at the first pulse, motion per pulse, and height above the plane, in metres.
#[derive(Clone, Copy)]
pub(super) struct Reflector {
    pub(super) at_m: [f64; 2],
    pub(super) step_m: [f64; 2],
    pub(super) height_m: f64,
}

pub(super) fn still(places: &[[f64; 2]]) -> Vec<Reflector> {
    let at = |at_m: &[f64; 2]| Reflector {
        at_m: *at_m,
        step_m: [0.0; 2],
        height_m: 0.0,
    };
    places.iter().map(at).collect()
}

/// Sightings of a radar at the height `height_m(pulse)` above the plane.
pub(super) fn seen(
    array: &Array,
    poses: &[Pose],
    height_m: impl Fn(usize) -> f64,
    reflectors: &[Reflector],
    noise: &Noise,
    seed: u64,
) -> Vec<Vec<Sighting>> {
    // A generator for each reflector: its noise is independent of the other reflectors.
    let own = |target: usize| ChaCha8Rng::seed_from_u64(1000 * seed + target as u64);
    let mut random: Vec<ChaCha8Rng> = (0..reflectors.len()).map(own).collect();
    let starts: Vec<f64> = random
        .iter_mut()
        .map(|random| random.next_u32() as f64)
        .collect();
    let mut pulse = |n: usize| {
        let pose = &poses[n];
        let antenna = |a: &DVec2| pose.at_m + DVec2::from_angle(pose.heading_rad).rotate(*a);
        let mut all = Vec::new();
        for (target, reflector) in reflectors.iter().enumerate() {
            let random = &mut random[target];
            let step_m = DVec2::from_array(reflector.step_m);
            let at_m = DVec2::from_array(reflector.at_m) + step_m * n as f64;
            let up_m = reflector.height_m - height_m(n);
            let leg = |a: &DVec2| (at_m.distance_squared(antenna(a)) + up_m * up_m).sqrt();
            let mut paths_m = Vec::new();
            for t in &array.transmitters_m {
                for r in &array.receivers_m {
                    paths_m.push(leg(t) + leg(r));
                }
            }
            let mean_m = paths_m.iter().sum::<f64>() / paths_m.len() as f64;
            let phases_rad = paths_m.iter().map(|path_m| {
                let clean = starts[target] - TAU * path_m / array.wavelength_m;
                let phase = clean + noise.phase_rad * gaussian(random);
                phase - TAU * (phase / TAU).round()
            });
            let phases_rad = phases_rad.collect();
            all.push(Sighting {
                target,
                phases_rad,
                range_m: 0.5 * mean_m + noise.range_m * gaussian(random),
                range_sigma_m: noise.range_m,
                phase_sigma_rad: noise.phase_rad,
            });
        }
        all
    };
    (0..poses.len()).map(&mut pulse).collect()
}
