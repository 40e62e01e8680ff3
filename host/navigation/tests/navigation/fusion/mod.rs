//! Fused tracks, compared with the truth and with their covariances.

mod apertures;
mod logs;
mod sensors;

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_navigation::fusion::{Assumed, Basis, FusionError, Inputs, Measured, Model, fuse};

use apertures::{aperture_errors, print};
use sensors::{Sensors, gaussian, heading, place, sensors};

const WAVELENGTH_77_GHZ_M: f64 = 0.0039;
const WAVELENGTH_L_M: f64 = 0.21;

const NAMES: [&str; 4] = ["no outage", "no increments", "no positions", "no inertial"];

fn outages(base: &Sensors) -> [Sensors; 4] {
    [0, 1, 2, 3].map(|n| {
        let mut sensors = base.clone();
        if n > 0 {
            sensors.out[n - 1] = Some([25.0, 35.0]);
        }
        sensors
    })
}

/// In any second, after alignment by translation and rotation, the error is below a twentieth of a wavelength, also with 10 s of any of the three sources missing; in L band
/// also vertically.
#[test]
fn l_band_apertures_stay_within_a_twentieth_of_a_wavelength() {
    // White noise that accumulates to 2 mm over 1 m: the worst case of MPGA at 30 dB.
    let mut walk = sensors();
    walk.step = [63e-6, 10e-6, 20e-6];
    for (kind, base) in [("scale", sensors()), ("walk", walk)] {
        for (name, sensors) in NAMES.into_iter().zip(outages(&base)) {
            let fused = sensors.fused(1);
            let errors = aperture_errors(&sensors, &fused);
            print(&format!("{kind}, {name}"), errors);
            let [most, typical, predicted] = errors;
            let bound = WAVELENGTH_L_M / 20.0;
            assert!(most[0] < bound && most[1] < bound, "{kind}, {name}");
            // RMS over 119 apertures that overlap by half, with few degrees of freedom each: about 60 independent squares, 10 % of the RMS. Slow
            // errors (scale) are common to all apertures and may be twice the expected ones.
            for k in [0, 1] {
                let ratio = typical[k] / predicted[k];
                assert!((0.4..2.2).contains(&ratio), "{kind}, {name}: {ratio}");
            }
        }
    }
}

/// At 77 GHz a twentieth of a wavelength is 0.2 mm. Positions with 2 cm errors (corrected GNSS) determine a scale error of 2 mm/m well enough, where there are increments.
#[test]
fn millimetre_apertures_stay_within_a_twentieth_of_a_wavelength() {
    let mut base = sensors();
    base.position = DVec3::new(0.02, 0.02, 0.04);
    for (n, (name, sensors)) in NAMES.into_iter().zip(outages(&base)).enumerate() {
        let fused = sensors.fused(2);
        let errors = aperture_errors(&sensors, &fused);
        print(name, errors);
        // Without increments the error is that of the inertial solution, a millimetre.
        if n != 1 {
            assert!(errors[0][0] < WAVELENGTH_77_GHZ_M / 20.0, "{name}");
        }
    }
}

/// Squared errors of position and heading over their covariance have mean 4, and their sum is chi-square distributed.
#[test]
fn errors_agree_with_covariance() {
    let mut base = sensors();
    base.seconds = 20.0;
    base.out[0] = Some([9.0, 11.0]);
    let (mut sum, mut count, mut chi) = (0.0, 0, [0.0; 2]);
    for seed in 0..24 {
        let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
        let mut sensors = base.clone();
        // Draw the true parameters from their priors.
        sensors.scale = sensors.model.scale * gaussian(&mut random);
        sensors.squint = sensors.model.squint_rad.sigma * gaussian(&mut random);
        let fused = sensors.fused(seed);
        chi = [0, 1].map(|k| chi[k] + fused.chi_square[k]);
        // At the middle of an aperture, in the gap, and between two states.
        for t in [3.0137, 10.02, 17.4] {
            let sample = fused.samples.iter().min_by(|a, b| {
                let off = |s: &&subaperture_navigation::fusion::Sample| (s.time_s - t).abs();
                off(a).total_cmp(&off(b))
            });
            let sample = sample.unwrap();
            let off = sample.position_m - place(sample.time_s);
            let turn = sample.heading_rad - heading(sample.time_s);
            let error = [off.x, off.y, off.z, turn - TAU * (turn / TAU).round()];
            sum += mahalanobis(&sample.covariance, error);
            println!(
                "Z {t} {:?}",
                [0, 1, 2, 3].map(|k| error[k] / sample.covariance[k][k].sqrt())
            );
            count += 4;
        }
    }
    // 288 numbers: chi-square is within 3.3 sqrt(2 * 288) = 79 of 288 in 999 of 1000 cases. Times of a track share its slow errors, which
    // increases the spread by half at most.
    let off = sum - f64::from(count);
    println!(
        "chi-square {sum:.0} of {count}; of residuals {:.4}",
        chi[0] / chi[1]
    );
    assert!(off.abs() < 1.5 * 79.0, "{sum} of {count}");
    // Residuals fit the stated noise: 24 times about 4000 numbers, whose chi-square has a spread of 0.5 %. The ratio is below 1 as the true motion is smoother than the model's noise.
    assert!((0.93..1.02).contains(&(chi[0] / chi[1])), "{chi:?}");
}

/// `e^T C^-1 e` by elimination.
fn mahalanobis(covariance: &[[f64; 4]; 4], error: [f64; 4]) -> f64 {
    let mut rows: Vec<Vec<f64>> = covariance
        .iter()
        .zip(error)
        .map(|(row, e)| row.iter().copied().chain([e]).collect())
        .collect();
    for p in 0..4 {
        let pivot = rows[p].clone();
        for (i, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != p) {
            let factor = row[p] / pivot[p];
            let _ = i;
            row.iter_mut()
                .zip(&pivot)
                .for_each(|(a, b)| *a -= factor * b);
        }
    }
    (0..4).map(|i| error[i] * rows[i][4] / rows[i][i]).sum()
}

#[test]
fn observable_clocks_arms_and_squint_are_estimated() {
    let mut sensors = sensors();
    let known = |sigma| Assumed { value: 0.0, sigma };
    let arm = |sigma| Assumed {
        value: DVec3::ZERO,
        sigma: DVec3::splat(sigma),
    };
    sensors.position = DVec3::splat(0.02);
    sensors.receiver_clock_s = 0.13;
    sensors.inertial_clock_s = -0.045;
    sensors.receiver_arm = DVec3::new(0.7, -0.4, 1.2);
    sensors.model.receiver_clock_s = known(0.5);
    sensors.model.inertial_clock_s = known(0.5);
    sensors.model.receiver_arm_m = arm(1.0);
    sensors.model.inertial_position[0] = 10.0;
    let fused = sensors.fused(5);
    let near = |name: &str, found: subaperture_navigation::fusion::Found, truth: f64| {
        println!(
            "{name}: {:.5} +- {:.5}, is {truth}",
            found.value, found.sigma
        );
        // Within 4 standard deviations.
        assert!(
            (found.value - truth).abs() < 4.0 * found.sigma,
            "{name}: {found:?}"
        );
    };
    near("receiver's clock", fused.receiver_clock_s, 0.13);
    near("inertial clock", fused.inertial_clock_s, -0.045);
    near("squint", fused.squint_rad, 0.01);
    near("scale", fused.scale, 2e-3);
    for k in 0..3 {
        near("arm", fused.receiver_arm_m[k], sensors.receiver_arm[k]);
    }
    assert!(fused.inertial_clock_s.sigma < 1e-3 && fused.receiver_clock_s.is_observed());
    assert!(fused.receiver_arm_m[0].sigma < 0.1 && fused.receiver_arm_m[1].sigma < 0.1);
    // The height of the antenna on a level body is not observable.
    assert!(
        !fused.receiver_arm_m[2].is_observed(),
        "{:?}",
        fused.receiver_arm_m[2]
    );
    // A parameter with a prior standard deviation of 0 keeps its value.
    assert!(fused.inertial_arm_m[0].value.abs() < 1e-5);
}

#[test]
fn outliers_of_every_kind_do_not_move_track() {
    let mut sensors = sensors();
    sensors.seconds = 20.0;
    let mut measured = sensors.measure(7);
    let mut without = sensors.measure(7);
    for n in [20, 21, 22, 60] {
        measured.positions[n].position_m += DVec3::new(15.0, -8.0, 30.0);
        without.positions[n].sigma_m = DVec3::splat(1e8);
    }
    for n in [100, 300] {
        measured.inertial[n].position_m.as_mut().unwrap()[0].x += 2.0;
        measured.inertial[n].heading_rad.as_mut().unwrap()[0] += 0.7;
        without.inertial[n].position_m = None;
        without.inertial[n].heading_rad = None;
    }
    // A phase slip: half a wavelength in one increment.
    measured.increments[12_345].moved_m[1] += WAVELENGTH_77_GHZ_M / 2.0;
    without.increments.remove(12_345);
    let [fused, known] =
        [&measured, &without].map(|all| fuse(&all.inputs(), &sensors.model, &Silent).unwrap());
    let of = |kind: Measured| fused.outliers.iter().filter(|one| one.of == kind).count();
    assert_eq!(
        [
            of(Measured::Position),
            of(Measured::InertialPosition),
            of(Measured::InertialHeading),
            of(Measured::Increments)
        ],
        [4, 2, 2, 1],
        "{:?}",
        fused.outliers
    );
    let wrapped = fused
        .outliers
        .iter()
        .find(|one| one.of == Measured::Increments);
    assert!((wrapped.unwrap().time_s - 12.345).abs() < 1e-9);
    // One of 20,000 increments is bridged.
    let bridged = fused
        .samples
        .iter()
        .filter(|s| s.basis == Basis::Bridged)
        .count();
    assert!(bridged <= 2, "{bridged}");
    // The track equals the one without the outliers: they have weight 0, and the least squares converge within a hundredth of a standard deviation.
    assert_eq!(fused.samples.len(), known.samples.len());
    for (one, other) in fused.samples.iter().zip(&known.samples) {
        let off = one.position_m.distance(other.position_m);
        assert!(
            off < 0.02 * one.covariance[0][0].sqrt(),
            "{off} at {}",
            one.time_s
        );
    }
}

#[test]
fn heading_without_inertial_solution_follows_from_track() {
    let mut sensors = sensors();
    sensors.position = DVec3::splat(0.05);
    let mut measured = sensors.measure(8);
    measured.inertial.clear();
    let fused = fuse(&measured.inputs(), &sensors.model, &Silent).unwrap();
    let middle = &fused.samples[fused.samples.len() / 2];
    let off = middle.heading_rad - heading(middle.time_s);
    let off = off - TAU * (off / TAU).round();
    let sigma = middle.covariance[3][3].sqrt();
    println!("heading off by {off:.5} rad, standard deviation {sigma:.5} rad");
    // 5 cm over 60 m from 300 positions, and as much from the random walk of headings: some tenths of a milliradian.
    assert!(off.abs() < 4.0 * sigma && sigma < 2e-3);
}

#[test]
fn invalid_measurements_and_models_are_refused() {
    let measured = sensors().measure(1);
    let model = Model::default();
    let refused = |inputs: Inputs<'_>, model: &Model| {
        fuse(&inputs, model, &Silent).err().unwrap().to_string()
    };
    let alone = Inputs {
        increments: &measured.increments,
        ..Inputs::default()
    };
    assert!(refused(alone, &model).contains("no position"));
    let mut nan = measured.positions.clone();
    nan[3].position_m.y = f64::NAN;
    let with = |positions| Inputs {
        positions,
        ..Inputs::default()
    };
    assert!(refused(with(&nan), &model).contains("position 4, at 0.6003 s, has numbers"));
    let mut back = measured.positions.clone();
    back.swap(1, 2);
    assert!(refused(with(&back), &model).contains("a time that is not later"));
    let mut flat = measured.increments[..10].to_vec();
    flat[7].covariance = DMat3::ZERO;
    let inputs = Inputs {
        increments: &flat,
        ..measured.inputs()
    };
    assert!(refused(inputs, &model).contains("increment 8, at 0.007 s, has a covariance"));
    let infinite = Model {
        acceleration: f64::INFINITY,
        ..model
    };
    assert!(refused(measured.inputs(), &infinite).contains("acceleration is inf"));
    struct Stop;
    impl Monitor for Stop {
        fn progress(&self, _fraction: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let stopped = fuse(&measured.inputs(), &model, &Stop).err();
    assert_eq!(stopped, Some(FusionError::Cancelled));
}

/// Positions alone, 1, 2 or 20 of them, give a track with a large covariance.
#[test]
fn few_positions_give_track_with_large_covariance() {
    let measured = sensors().measure(3);
    for count in [1, 2, 20] {
        let inputs = Inputs {
            positions: &measured.positions[..count],
            ..Inputs::default()
        };
        let fused = fuse(&inputs, &Model::default(), &Silent).unwrap();
        assert_eq!(fused.samples.len(), count);
        let off = fused.samples[0]
            .position_m
            .distance(measured.positions[0].position_m);
        assert!(off < 0.4, "{off}");
        assert!(fused.samples.iter().all(|one| one.basis == Basis::Bridged));
        assert!(fused.samples[0].covariance[3][3].sqrt() > 1.0);
    }
}
