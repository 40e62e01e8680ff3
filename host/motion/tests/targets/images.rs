//! Images on the estimated, the true and the recorded track, by an independent backprojection.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};
use num_complex::Complex64;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{Channels, OnTrack, PhaseHistory};
use subaperture_model::track::{Fix, SampledTrack};
use subaperture_motion::targets::{Arrangement, Settings, recover};

use crate::scene::{C_M_S, Truth, l_band};
use crate::tracks::{reflectors, straight, walk, walked};

/// Oversampling of range profiles: the error of linear interpolation is below -55 dB.
const FINE: usize = 16;

/// Range profiles of a recording on a track, with a Hamming window over frequency and pulses.
struct Profiles {
    /// Transmitter, receiver, reference path and profile of each pulse.
    all: Vec<([DVec3; 2], f64, Vec<Complex64>)>,
    bin_m: f64,
    middle_hz: f64,
    weight: f64,
}

impl Profiles {
    fn new(channels: &Channels) -> Self {
        let radar = l_band();
        let (count, length) = (radar.samples, radar.samples * FINE);
        let hamming = |i: usize, n: usize| 0.54 - 0.46 * (TAU * (i as f64 + 0.5) / n as f64).cos();
        let fft = subaperture_fft::inverse::<f64>(length);
        let (mut all, mut weight) = (Vec::new(), 0.0);
        for (_, history) in channels.iter() {
            let pulses = &history.collection().pulses;
            let mut samples = vec![Default::default(); count * pulses.len()];
            history.read(0..pulses.len(), &mut samples).unwrap();
            for (n, pulse) in pulses.iter().enumerate() {
                let slow = hamming(n, pulses.len());
                let mut profile = vec![Complex64::ZERO; length];
                // Sample 75 is in the middle.
                for k in 0..count {
                    let z = samples[n * count + k];
                    let z = Complex64::new(z.re.into(), z.im.into());
                    profile[(k + length - 75) % length] = z * (slow * hamming(k, count));
                }
                fft.process(&mut profile);
                weight += (0..count).map(|k| slow * hamming(k, count)).sum::<f64>();
                all.push((
                    [pulse.transmitter_m, pulse.receiver_m],
                    pulse.reference_path_m,
                    profile,
                ));
            }
        }
        Self {
            all,
            bin_m: C_M_S / radar.step_hz / length as f64,
            middle_hz: radar.middle_hz(),
            weight,
        }
    }

    fn power(&self, at: DVec2) -> f64 {
        let at = at.extend(0.0);
        let mut sum = Complex64::ZERO;
        for ([t, r], reference_m, profile) in &self.all {
            let path_m = at.distance(*t) + at.distance(*r) - reference_m;
            let bin = (path_m / self.bin_m).rem_euclid(profile.len() as f64);
            let (low, part) = (bin as usize, bin.fract());
            let value = profile[low % profile.len()] * (1.0 - part)
                + profile[(low + 1) % profile.len()] * part;
            sum += value * Complex64::cis(TAU * (self.middle_hz * path_m / C_M_S).fract());
        }
        (sum / self.weight).norm_sqr()
    }

    /// Power on a square grid around `about`, spaced by 6 cm.
    fn square(&self, about: DVec2, half_m: f64) -> Vec<(DVec2, f64)> {
        let steps = (half_m / 0.06).round() as i32;
        let places = (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j)));
        let place = |(i, j)| about + 0.06 * DVec2::new(f64::from(i), f64::from(j));
        places.map(place).map(|at| (at, self.power(at))).collect()
    }

    /// Highest power within 0.5 m, dB, by pattern search from the highest grid point.
    fn peak_db(&self, about: DVec2) -> f64 {
        let best = |all: Vec<(DVec2, f64)>| all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let (mut at, mut power) = best(self.square(about, 0.5)).unwrap();
        let mut step_m = 0.02;
        while step_m > 5e-4 {
            let around = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|u| at + step_m * u);
            match best(around.map(|at| (at, self.power(at))).to_vec()) {
                Some(higher) if higher.1 > power => (at, power) = higher,
                _ => step_m *= 0.5,
            }
        }
        10.0 * power.log10()
    }
}

fn on_track(channels: Channels<'static>, fixes: &[Fix]) -> Profiles {
    let arrangement = Arrangement::of(&channels).unwrap();
    let track = SampledTrack::new(fixes).unwrap();
    let span_s = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    let each = channels.into_inner().into_iter().enumerate();
    let moved = each.map(|(c, (about, history))| {
        let [t, r] = arrangement.of_channels[c];
        let arms_m = [arrangement.transmitters_m[t], arrangement.receivers_m[r]];
        let moved = OnTrack::new(history, &track, arms_m, span_s).unwrap();
        (about, Box::new(moved) as Box<dyn PhaseHistory>)
    });
    Profiles::new(&Channels::new(moved.collect()).unwrap())
}

/// Fixes of the antennas' phase centre on a track.
fn fixes(track: &[Truth], middle_m: DVec2) -> Vec<Fix> {
    let fix = |(n, pose): (usize, &Truth)| Fix {
        time_s: n as f64 * 1e-2,
        position_m: (pose.at_m + DVec2::from_angle(pose.heading_rad).rotate(middle_m)).extend(0.0),
        attitude: Some(DQuat::from_rotation_z(pose.heading_rad)),
    };
    track.iter().enumerate().map(fix).collect()
}

/// Peak of each reflector, dB, and the entropy `-sum p ln p` of the shares of power within 1 m of them along x and y.
fn judged(profiles: &Profiles) -> (Vec<f64>, f64) {
    let peaks = reflectors().map(|reflector| profiles.peak_db(reflector.at_m));
    let squares = reflectors().map(|reflector| profiles.square(reflector.at_m, 1.0));
    let all: Vec<f64> = squares.iter().flatten().map(|(_, power)| *power).collect();
    let total: f64 = all.iter().sum();
    let shares = all.iter().map(|power| power / total);
    (
        peaks.to_vec(),
        shares.map(|p| -p * p.max(1e-300).ln()).sum(),
    )
}

#[test]
fn image_on_estimated_track_is_as_sharp_as_on_true_track() {
    let (radar, truth) = (l_band(), walk(801));
    let (recorded_track, all) = (straight(801), reflectors());
    let recording = walked(&radar, [&truth, &recorded_track], &all);
    let recorded = recording.collections();
    let channels = || crate::scene::channels(recorded.clone());
    let found = recover(channels(), &Settings::default(), &Silent).unwrap();
    let found: Vec<Fix> = found
        .moments
        .iter()
        .map(|moment| Fix {
            time_s: moment.time_s,
            position_m: moment.position_m,
            attitude: Some(moment.attitude),
        })
        .collect();
    let middle_m =
        0.5 * (radar.transmitters_m[0] + 0.5 * (radar.receivers_m[0] + radar.receivers_m[1]));
    let [
        (true_db, of_true),
        (found_db, of_found),
        (recorded_db, of_recorded),
    ] = [
        fixes(&truth, middle_m),
        found,
        fixes(&recorded_track, middle_m),
    ]
    .map(|fixes| judged(&on_track(channels(), &fixes)));
    println!("peaks on the true track {true_db:.2?} dB");
    println!("on the estimated track {found_db:.2?} dB");
    println!("on the recorded track {recorded_db:.2?} dB");
    println!("entropy {of_true:.4}, {of_found:.4}, {of_recorded:.4}");
    for (i, reflector) in reflectors().iter().enumerate() {
        // Peaks equal amplitudes within the errors by noise and neighbours.
        assert!(
            (true_db[i] - 20.0 * reflector.amplitude.log10()).abs() < 0.5,
            "{i}"
        );
        assert!((found_db[i] - true_db[i]).abs() < 0.5, "{i}");
        // On the recorded track, peaks have less than half of the amplitude.
        assert!(recorded_db[i] < true_db[i] - 6.0, "{i}");
    }
    assert!((of_found / of_true - 1.0).abs() < 0.01);
    assert!(of_recorded > 1.1 * of_true);
}
