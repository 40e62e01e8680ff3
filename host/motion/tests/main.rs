//! Tracks estimated from simulated phases, compared with the truth and with the Cramer-Rao bound.

mod coverage;
mod diagnosis;
mod held;
mod increments;
mod live;
mod movers;
mod nonsense;
mod scene;
mod squint;

use std::f64::consts::TAU;

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_motion::joint::{Estimate, Prior, covariances};
use subaperture_motion::{Array, MotionError, Pose, Sighting, Target, Tracker, track};

const WAVELENGTH_M: f64 = 299_792_458.0 / 77e9;
/// Range resolution at a bandwidth of 1 GHz.
const RANGE_BIN_M: f64 = 0.15;

/// One transmitter and receivers half a wavelength apart.
fn array(receivers: usize) -> Array {
    let receiver = |i: usize| DVec2::new(0.5 * WAVELENGTH_M * i as f64, 0.0);
    Array {
        transmitters_m: vec![DVec2::new(-0.02, 0.0)],
        receivers_m: (0..receivers).map(receiver).collect(),
        wavelength_m: WAVELENGTH_M,
    }
}

/// Four reflectors at 2 to 5 m (Chim 2018, 7.5).
const PLACES_M: [[f64; 2]; 4] = [[-0.8, 2.2], [0.3, 3.1], [1.6, 3.6], [-1.1, 4.7]];

/// Targets with their phases at the first pose. The phase at path 0 is the target's number in radians.
fn targets(array: &Array) -> Vec<Target> {
    let each = PLACES_M.iter().enumerate();
    each.map(|(i, place)| {
        let (at_m, from) = (DVec2::from_array(*place), Pose::default());
        let receivers = 0..array.receivers_m.len();
        let count = receivers.len() as f64;
        let paths_m = receivers.map(|r| path_m(array, [0, r], &from, at_m));
        let mean_m = paths_m.sum::<f64>() / count;
        Target {
            at_m,
            phase_rad: i as f64 - TAU * mean_m / array.wavelength_m,
            from,
        }
    })
    .collect()
}

/// Track of 1 m along x in `count` pulses, with sway of 3 mm across and 0.01 rad in heading.
fn poses(count: usize) -> Vec<Pose> {
    let pose = |n: usize| {
        let u = n as f64 / (count - 1) as f64;
        let sway = |cycles: f64| (TAU * cycles * u).sin();
        Pose {
            at_m: DVec2::new(u + 0.001 * sway(3.0), 0.003 * sway(2.0)),
            heading_rad: 0.01 * sway(1.5),
        }
    };
    (0..count).map(pose).collect()
}

/// Path length from plain distances, independent of the model under test.
fn path_m(array: &Array, channel: [usize; 2], pose: &Pose, at_m: DVec2) -> f64 {
    let antenna = |a: DVec2| pose.at_m + DVec2::from_angle(pose.heading_rad).rotate(a);
    let [t, r] = channel;
    at_m.distance(antenna(array.transmitters_m[t])) + at_m.distance(antenna(array.receivers_m[r]))
}

fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (a, b) = (1.0 - uniform(), uniform());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

struct Noise {
    phase_rad: f64,
    range_m: f64,
}

impl Noise {
    /// Noise for this SNR in each channel, dB.
    fn of_snr(db: f64) -> Self {
        let amplitude = 10f64.powf(db / 20.0);
        Self {
            phase_rad: 1.0 / (2f64.sqrt() * amplitude),
            range_m: 0.39 * RANGE_BIN_M / amplitude,
        }
    }
}

fn sightings(array: &Array, pose: &Pose, noise: &Noise, random: &mut ChaCha8Rng) -> Vec<Sighting> {
    let k = TAU / array.wavelength_m;
    let channels: Vec<[usize; 2]> = (0..array.transmitters_m.len())
        .flat_map(|t| (0..array.receivers_m.len()).map(move |r| [t, r]))
        .collect();
    let each = PLACES_M.iter().enumerate();
    each.map(|(target, place)| {
        let at_m = DVec2::from_array(*place);
        let paths_m: Vec<f64> = channels
            .iter()
            .map(|&c| path_m(array, c, pose, at_m))
            .collect();
        let mean_m = paths_m.iter().sum::<f64>() / paths_m.len() as f64;
        let phases_rad = paths_m.iter().map(|path_m| {
            let phase = target as f64 - k * path_m + noise.phase_rad * gaussian(random);
            phase - TAU * (phase / TAU).round()
        });
        Sighting {
            target,
            phases_rad: phases_rad.collect(),
            range_m: 0.5 * mean_m + noise.range_m * gaussian(random),
            range_sigma_m: noise.range_m,
            phase_sigma_rad: noise.phase_rad,
        }
    })
    .collect()
}

/// Sightings of all pulses of a track.
fn seen(array: &Array, poses: &[Pose], noise: &Noise, seed: u64) -> Vec<Vec<Sighting>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let each = poses.iter();
    each.map(|pose| sightings(array, pose, noise, &mut random))
        .collect()
}

/// Errors of the last pose's distance from the first (metres) and of its heading relative to the direction of the first target (radians):
/// both are independent of the frame's rotation.
fn errors(last: &Pose, target_m: DVec2, truth: &Pose) -> [f64; 2] {
    let of = |pose: &Pose, at_m: DVec2| [pose.at_m.length(), pose.heading_rad - at_m.to_angle()];
    let (got, wanted) = (
        of(last, target_m),
        of(truth, DVec2::from_array(PLACES_M[0])),
    );
    [got[0] - wanted[0], got[1] - wanted[1]]
}

/// Sightings with the model's values, without noise.
fn without_noise(array: &Array, poses: &[Pose], noise: &Noise) -> Vec<Vec<Sighting>> {
    let mut pulses = seen(array, poses, noise, 0);
    for (all, pose) in pulses.iter_mut().zip(poses) {
        for sighting in all {
            let lines = array.lines(pose, &targets(array)[sighting.target]);
            let count = sighting.phases_rad.len();
            sighting.phases_rad = lines[..count].iter().map(|line| line.value).collect();
            sighting.range_m = lines[count].value;
        }
    }
    pulses
}

/// Cramer-Rao bounds of the last pose's distance (metres) and heading (radians), given the direction of the first target.
fn bound(array: &Array, poses: &[Pose], noise: &Noise) -> [f64; 2] {
    let truth = Estimate {
        poses: poses.to_vec(),
        targets: targets(array),
        ..Estimate::default()
    };
    let pulses = without_noise(array, poses, noise);
    let all = covariances(array, &pulses, 0, &truth, &Prior::default()).unwrap();
    let last = all.pose(poses.len() - 1);
    let along = poses[poses.len() - 1].at_m.normalize().extend(0.0);
    [along.dot(last * along).sqrt(), last.z_axis.z.sqrt()]
}

/// Window of the fixed-lag smoother, pulses.
const WINDOW: usize = 10;

/// RMS errors over seeds relative to the Cramer-Rao bound: of the batch track, then of the online track.
fn ratios(receivers: usize, snr_db: f64, seeds: u64) -> [[f64; 2]; 2] {
    let (poses, array, noise) = (poses(1000), array(receivers), Noise::of_snr(snr_db));
    let truth = &poses[poses.len() - 1];
    let bound = bound(&array, &poses, &noise);
    let mut squares = [[0.0; 2]; 2];
    for seed in 0..seeds {
        let pulses = seen(&array, &poses, &noise, seed);
        let track = track(&array, &pulses, WINDOW).unwrap();
        assert!(track.converged, "{seed}");
        // At 15 dB, noise may look like a wrapped phase.
        let doubtful = track.doubtful.iter().filter(|&&n| n > 0).count();
        assert!(doubtful <= usize::from(snr_db < 20.0), "{seed}: {doubtful}");
        // Chi-square within five standard deviations of its degrees of freedom.
        let [sum, free] = track.chi_square;
        assert!(
            (sum - free).abs() < 5.0 * (2.0 * free).sqrt(),
            "{sum} {free}"
        );
        let first_target_m = track.targets[0].1.at_m;
        let lasts = [&track.poses, &track.live].map(|poses| &poses[poses.len() - 1]);
        for (squares, last) in squares.iter_mut().zip(lasts) {
            let off = errors(last, first_target_m, truth);
            (0..2).for_each(|i| squares[i] += off[i] * off[i] / seeds as f64);
        }
    }
    let ratios = squares.map(|squares| [0, 1].map(|i| squares[i].sqrt() / bound[i]));
    println!(
        "{receivers} receivers, {snr_db} dB: bound {:.4} mm along, {:.4} deg of heading; batch errors {:.2?} times that, online {:.2?}",
        1e3 * bound[0],
        bound[1].to_degrees(),
        ratios[0],
        ratios[1]
    );
    ratios
}

#[track_caller]
fn check(receivers: usize, snrs_db: &[f64], seeds: u64) {
    for &snr_db in snrs_db {
        let ratios = ratios(receivers, snr_db, seeds);
        assert!(
            ratios.as_flattened().iter().all(|ratio| *ratio < 1.3),
            "{ratios:?}"
        );
    }
}

#[test]
fn track_of_two_receivers_reaches_cramer_rao_bound() {
    check(2, &[15.0, 30.0], 8);
}

#[test]
fn track_of_four_receivers_reaches_cramer_rao_bound() {
    check(4, &[15.0, 30.0], 8);
}

#[test]
#[ignore = "minutes: cargo xtask long"]
fn tracks_of_fifty_seeds_reach_cramer_rao_bound() {
    for receivers in [2, 4] {
        check(receivers, &[15.0, 20.0, 25.0, 30.0, 35.0, 40.0], 50);
    }
}

/// The reference is the inverse of the full normal matrix, from central differences of plain distances.
#[test]
fn covariances_equal_inverse_of_full_normal_matrix() {
    let array = array(3);
    let poses: Vec<Pose> = poses(40).into_iter().step_by(10).collect();
    let noise = Noise::of_snr(20.0);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let pulses: Vec<_> = poses
        .iter()
        .map(|pose| sightings(&array, pose, &noise, &mut random))
        .collect();
    let truth = Estimate {
        poses: poses.clone(),
        targets: targets(&array),
        ..Estimate::default()
    };
    // Without noise, so that Huber weights are 1.
    let exact: Vec<Vec<Sighting>> = pulses
        .iter()
        .zip(&poses)
        .map(|(all, pose)| {
            let each = all.iter().cloned();
            each.map(|mut sighting| {
                let lines = array.lines(pose, &targets(&array)[sighting.target]);
                for (phase, line) in sighting.phases_rad.iter_mut().zip(&lines) {
                    *phase = line.value;
                }
                sighting.range_m = lines[lines.len() - 1].value;
                sighting
            })
            .collect()
        })
        .collect();
    let got = covariances(&array, &exact, 0, &truth, &Prior::default()).unwrap();

    let unknowns = 3 * poses.len() + 3 * truth.targets.len();
    let numbers = |x: &[f64]| {
        // Held to a micrometre: the first position, and the first target across its direction.
        let across = truth.targets[0].at_m.perp().normalize();
        let target = DVec2::from_slice(&x[3 * poses.len()..]);
        let mut all = vec![x[0] / 1e-6, x[1] / 1e-6, across.dot(target) / 1e-6];
        for (n, pose) in poses.iter().enumerate() {
            let mut pose = *pose;
            let by = &x[3 * n..3 * n + 3];
            pose.at_m += DVec2::new(by[0], by[1]);
            pose.heading_rad += by[2];
            for (i, target) in truth.targets.iter().enumerate() {
                let by = &x[3 * (poses.len() + i)..];
                let at_m = target.at_m + DVec2::new(by[0], by[1]);
                let from =
                    |pose: &Pose| (0..3).map(|r| path_m(&array, [0, r], pose, at_m)).collect();
                let (paths_m, seen_m): (Vec<f64>, Vec<f64>) = (from(&pose), from(&target.from));
                let seen_m = seen_m.iter().sum::<f64>() / 3.0;
                for path_m in &paths_m {
                    let phase =
                        target.phase_rad + by[2] - TAU * (path_m - seen_m) / array.wavelength_m;
                    all.push(phase / noise.phase_rad);
                }
                all.push(paths_m.iter().sum::<f64>() / 6.0 / noise.range_m);
            }
        }
        all
    };
    let step = 1e-6;
    let columns: Vec<Vec<f64>> = (0..unknowns)
        .map(|i| {
            let at = |by: f64| {
                let mut x = vec![0.0; unknowns];
                x[i] = by;
                numbers(&x)
            };
            let (after, before) = (at(step), at(-step));
            let differences = after.iter().zip(before);
            differences.map(|(a, b)| (a - b) / (2.0 * step)).collect()
        })
        .collect();
    // Gauss-Jordan elimination with partial pivoting on the matrix augmented by the identity.
    let mut rows: Vec<Vec<f64>> = (0..unknowns)
        .map(|i| {
            let product = |j: usize| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum();
            let one = (0..unknowns).map(|j| f64::from(u8::from(i == j)));
            (0..unknowns).map(product).chain(one).collect()
        })
        .collect();
    for k in 0..unknowns {
        let pivot = (k..unknowns).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs()));
        rows.swap(k, pivot.unwrap());
        let row: Vec<f64> = rows[k].iter().map(|x| x / rows[k][k]).collect();
        for (i, other) in rows.iter_mut().enumerate() {
            if i != k {
                let factor = other[k];
                other
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(x, y)| *x -= factor * y);
            }
        }
        rows[k] = row;
    }
    for (n, got) in got.poses().enumerate() {
        for i in 0..3 {
            for j in 0..3 {
                let [a, b] = [i, j].map(|i| 3 * n + i);
                let expected = rows[a][unknowns + b];
                let scale = (rows[a][unknowns + a] * rows[b][unknowns + b]).sqrt();
                let actual = got.col(j)[i];
                assert!(
                    (actual - expected).abs() < 1e-3 * scale,
                    "{n} {i} {j}: {actual} {expected}"
                );
            }
        }
    }
}

#[test]
fn unobservable_motion_is_refused() {
    let noise = Noise::of_snr(30.0);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let array = array(2);
    let poses = poses(1000)[..100].to_vec();
    // One target does not determine a pose.
    let mut tracker = Tracker::new(array.clone(), 5).unwrap();
    let one = |n: usize, random: &mut ChaCha8Rng| {
        let mut all = sightings(&array, &poses[n], &noise, random);
        all.truncate(1);
        all
    };
    tracker.push(&one(0, &mut random)).unwrap();
    let refused = tracker.push(&one(1, &mut random)).unwrap_err();
    assert!(refused.to_string().contains("too few targets"), "{refused}");
    // A refused pulse is skipped: the track continues with the next ones.
    let mut tracker = Tracker::new(array.clone(), 5).unwrap();
    for (n, pose) in poses.iter().enumerate() {
        if n % 10 == 7 {
            tracker.push(&one(n, &mut random)).unwrap_err();
        } else {
            tracker
                .push(&sightings(&array, pose, &noise, &mut random))
                .unwrap();
        }
    }
    let step = tracker
        .push(&sightings(&array, &poses[99], &noise, &mut random))
        .unwrap();
    let [sum, free] = step.chi_square;
    assert!(
        free > 40.0 && (sum - free).abs() < 5.0 * (2.0 * free).sqrt(),
        "{sum} {free}"
    );
    let last = tracker.window()[tracker.window().len() - 1];
    assert!(last.at_m.distance(poses[99].at_m) < 0.01, "{last:?}");

    let mut all = sightings(&array, &poses[0], &noise, &mut random);
    for (wrong, text) in [
        (
            Sighting {
                range_m: f64::NAN,
                ..all[0].clone()
            },
            "finite range",
        ),
        (
            Sighting {
                phases_rad: vec![0.0],
                ..all[0].clone()
            },
            "one phase a channel",
        ),
        (
            Sighting {
                phases_rad: vec![f64::NAN; 2],
                ..all[0].clone()
            },
            "finite phases",
        ),
        (
            Sighting {
                phase_sigma_rad: 0.0,
                ..all[0].clone()
            },
            "standard deviation",
        ),
        (all[1].clone(), "twice"),
    ] {
        all[0] = wrong;
        let refused = tracker.push(&all).unwrap_err().to_string();
        assert!(refused.contains(text), "{refused}");
    }
    let far = Array {
        receivers_m: vec![DVec2::ZERO, DVec2::new(WAVELENGTH_M, 0.0)],
        ..array.clone()
    };
    assert!(matches!(
        Tracker::new(far, 5),
        Err(MotionError::Baseline { .. })
    ));
    let one_receiver = Array {
        receivers_m: vec![DVec2::ZERO],
        ..array.clone()
    };
    let no_transmitter = Array {
        transmitters_m: Vec::new(),
        ..array.clone()
    };
    for (array, antennas) in [(one_receiver, [1, 1]), (no_transmitter, [0, 2])] {
        let Err(MotionError::Antennas {
            transmitters,
            receivers,
        }) = Tracker::new(array, 5)
        else {
            panic!("{antennas:?}");
        };
        assert_eq!([transmitters, receivers], antennas);
    }
    for wavelength_m in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
        let array = Array {
            wavelength_m,
            ..array.clone()
        };
        assert!(matches!(
            Tracker::new(array, 5),
            Err(MotionError::Array("wavelength"))
        ));
    }
    let not_finite = Array {
        transmitters_m: vec![DVec2::new(0.0, f64::NAN)],
        ..array
    };
    assert!(matches!(
        Tracker::new(not_finite, 5),
        Err(MotionError::Array(_))
    ));
}

/// One target's phases are off by 1.5 rad in every seventh pulse.
#[test]
fn outliers_of_one_target_do_not_bend_track() {
    let (array, poses) = (array(4), poses(1000));
    let noise = Noise::of_snr(30.0);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut tracker = Tracker::new(array.clone(), 10).unwrap();
    let mut last = None;
    for (n, pose) in poses.iter().enumerate() {
        let mut all = sightings(&array, pose, &noise, &mut random);
        if n % 7 == 3 {
            all[2].phases_rad.iter_mut().for_each(|phase| *phase += 1.5);
        }
        last = Some(tracker.push(&all).unwrap());
    }
    let last = last.unwrap();
    let allowed = bound(&array, &poses, &noise);
    let off_m = last.pose.at_m.length() - poses[999].at_m.length();
    assert!(off_m.abs() < 8.0 * allowed[0], "{off_m}");
}
