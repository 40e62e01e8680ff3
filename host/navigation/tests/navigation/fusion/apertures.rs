//! Errors of track segments of 1 s, after least-squares alignment by translation and rotation.

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_navigation::fusion::{Basis, Fused};

use super::sensors::{Sensors, gaussian, place};

/// RMS errors of a track segment in the plane and vertically, metres, after least-squares alignment by translation and rotation about z.
pub(crate) fn relative(errors: &[(DVec3, DVec3)]) -> [f64; 2] {
    let share = 1.0 / errors.len() as f64;
    let centre = errors.iter().map(|one| one.0).sum::<DVec3>() * share;
    let mean = errors.iter().map(|one| one.1).sum::<DVec3>() * share;
    let turned = |at: DVec3| DVec3::Z.cross(at - centre);
    let (with, of): (f64, f64) = errors
        .iter()
        .map(|(at, error)| (turned(*at).dot(*error - mean), turned(*at).length_squared()))
        .fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    let turn = if of > 0.0 { with / of } else { 0.0 };
    let (mut level, mut up) = (0.0, 0.0);
    for (at, error) in errors {
        let left = *error - mean - turn * turned(*at);
        level += left.x * left.x + left.y * left.y;
        up += left.z * left.z;
    }
    [(level * share).sqrt(), (up * share).sqrt()]
}

/// [`relative`] errors of segments of 1 s that overlap by half.
pub(crate) fn apertures(
    track: &[(f64, DVec3)],
    seconds: f64,
    truth: impl Fn(usize) -> DVec3,
) -> Vec<[f64; 2]> {
    let count = ((seconds - 1.0) * 2.0) as usize;
    let of = |n: usize| {
        let from = n as f64 / 2.0;
        let within = track.iter().enumerate();
        let within = within.filter(|(_, (t, _))| (from..=from + 1.0).contains(t));
        let errors: Vec<_> = within
            .map(|(i, &(_, at))| (truth(i), at - truth(i)))
            .collect();
        relative(&errors)
    };
    (0..=count).map(of).collect()
}

pub(crate) fn largest(apertures: &[[f64; 2]]) -> [f64; 2] {
    let most = |k: usize| apertures.iter().map(|one| one[k]).fold(0.0, f64::max);
    [most(0), most(1)]
}

/// RMS over all apertures.
pub(crate) fn typical(apertures: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|k| {
        let sum: f64 = apertures.iter().map(|one| one[k] * one[k]).sum();
        (sum / apertures.len() as f64).sqrt()
    })
}

/// Errors within apertures of the estimate: largest, RMS, and the RMS predicted by its covariance.
pub(crate) fn aperture_errors(sensors: &Sensors, fused: &Fused) -> [[f64; 2]; 3] {
    // Every tenth pulse is sufficient: the error is smooth except for micrometres.
    let decimated = fused.samples.iter().enumerate();
    let track: Vec<(f64, DVec3)> = decimated
        .filter(|(n, sample)| n % 10 == 0 || sample.basis == Basis::Bridged)
        .map(|(_, sample)| (sample.time_s, sample.position_m))
        .collect();
    let errors = apertures(&track, sensors.seconds, |i| place(track[i].0));
    let mut random = ChaCha8Rng::seed_from_u64(99);
    let mut predicted = Vec::new();
    for _ in 0..12 {
        let other = fused.plausible(|| gaussian(&mut random));
        let known: Vec<DVec3> = {
            let mut samples = fused.samples.iter();
            let at = |t: &f64| {
                samples
                    .find(|sample| sample.time_s == *t)
                    .unwrap()
                    .position_m
            };
            other.times_s.iter().map(at).collect()
        };
        let track: Vec<(f64, DVec3)> = other
            .times_s
            .iter()
            .copied()
            .zip(other.positions_m)
            .collect();
        predicted.extend(apertures(&track, sensors.seconds, |i| known[i]));
    }
    [largest(&errors), typical(&errors), typical(&predicted)]
}

pub(crate) fn print(name: &str, [largest, typical, predicted]: [[f64; 2]; 3]) {
    println!(
        "{name}: in the plane at most {:.1} um, RMS {:.1} um, by the covariance {:.1} um; upwards {:.1}, {:.1}, {:.1} um",
        largest[0] * 1e6,
        typical[0] * 1e6,
        predicted[0] * 1e6,
        largest[1] * 1e6,
        typical[1] * 1e6,
        predicted[1] * 1e6
    );
}
