//! Tracks of which all is known, measured as by a radar at 1 kHz, a receiver at 5 Hz and an inertial solution at 20 Hz.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_navigation::fusion::{
    Assumed, Basis, Fused, FusionError, Increment, Inertial, Inputs, Measured, Model, Position,
    fuse,
};

/// Pulses a second.
const PULSES_HZ: f64 = 1000.0;
const WAVELENGTH_77_GHZ_M: f64 = 0.0039;
const WAVELENGTH_L_M: f64 = 0.21;

fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (a, b) = (1.0 - uniform(), uniform());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

/// A standard deviation for each axis.
fn noise(random: &mut ChaCha8Rng, sigma: DVec3) -> DVec3 {
    DVec3::new(gaussian(random), gaussian(random), gaussian(random)) * sigma
}

/// A metre a second, give or take a fifth, along a bend with a sway of 3 mm, up and down by 5 cm.
fn place(t: f64) -> DVec3 {
    DVec3::new(
        t + 0.6 * (TAU * t / 17.0).sin(),
        4.0 * (TAU * t / 45.0).sin() + 0.003 * (TAU * 1.3 * t).sin(),
        0.05 * (TAU * t / 20.0).sin(),
    )
}

fn velocity(t: f64) -> DVec3 {
    DVec3::new(
        1.0 + 0.6 * TAU / 17.0 * (TAU * t / 17.0).cos(),
        4.0 * TAU / 45.0 * (TAU * t / 45.0).cos() + 0.003 * TAU * 1.3 * (TAU * 1.3 * t).cos(),
        0.05 * TAU / 20.0 * (TAU * t / 20.0).cos(),
    )
}

/// Half a radian of bend, and 5 degrees of wander.
fn heading(t: f64) -> f64 {
    0.5 * (TAU * t / 45.0).cos() + 0.087 * (TAU * t / 7.3).sin()
}

fn turn_rate(t: f64) -> f64 {
    -0.5 * TAU / 45.0 * (TAU * t / 45.0).sin() + 0.087 * TAU / 7.3 * (TAU * t / 7.3).cos()
}

fn body(t: f64) -> DMat3 {
    DMat3::from_rotation_z(heading(t))
}

/// What is measured, and how well.
#[derive(Clone)]
struct Sensors {
    seconds: f64,
    /// Of an increment along x and y, metres, and of its turn, radians.
    step: [f64; 3],
    /// By which share x is too long.
    scale: f64,
    position: DVec3,
    inertial_position: f64,
    inertial_velocity: f64,
    inertial_heading: f64,
    /// What is true of what `Model` assumes.
    model: Model,
    receiver_clock_s: f64,
    inertial_clock_s: f64,
    squint: f64,
    receiver_arm: DVec3,
    inertial_arm: DVec3,
    /// When there are no increments, positions and inertial moments.
    out: [Option<[f64; 2]>; 3],
}

/// Random walks of 3 micrometres and microradians an increment, 2 mm too long over a metre, positions to a decimetre.
fn sensors() -> Sensors {
    Sensors {
        seconds: 60.0,
        step: [3e-6, 3e-6, 3e-6],
        scale: 2e-3,
        position: DVec3::new(0.1, 0.1, 0.2),
        inertial_position: 1e-3,
        inertial_velocity: 3e-3,
        inertial_heading: 3e-4,
        model: Model {
            acceleration: 0.5,
            acceleration_up: 0.01,
            inertial_position: [0.5, 5e-4],
            inertial_velocity: [0.02, 1e-3],
            inertial_heading: 1e-4,
            scale: 2e-3,
            scale_time_s: 1000.0,
            squint_rad: Assumed {
                value: 0.0,
                sigma: 0.02,
            },
            ..Model::default()
        },
        receiver_clock_s: 0.0,
        inertial_clock_s: 0.0,
        squint: 0.01,
        receiver_arm: DVec3::ZERO,
        inertial_arm: DVec3::ZERO,
        out: [None; 3],
    }
}

struct Measurements {
    increments: Vec<Increment>,
    positions: Vec<Position>,
    inertial: Vec<Inertial>,
}

impl Measurements {
    fn inputs(&self) -> Inputs<'_> {
        Inputs {
            increments: &self.increments,
            positions: &self.positions,
            inertial: &self.inertial,
        }
    }
}

impl Sensors {
    fn out(&self, which: usize, t: f64) -> bool {
        self.out[which].is_some_and(|[from, to]| (from..to).contains(&t))
    }

    fn measure(&self, seed: u64) -> Measurements {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let random = &mut random;
        let mut increments = Vec::new();
        let covariance = DMat3::from_diagonal(DVec3::from(self.step.map(|sigma| sigma * sigma)));
        for n in 0..(self.seconds * PULSES_HZ) as usize {
            let (from_s, to_s) = (n as f64 / PULSES_HZ, (n + 1) as f64 / PULSES_HZ);
            let moved = body(from_s).transpose() * (place(to_s) - place(from_s));
            let error: [f64; 3] = self.step.map(|sigma| sigma * gaussian(random));
            if !self.out(0, from_s) {
                increments.push(Increment {
                    from_s,
                    to_s,
                    moved_m: [
                        (moved.x + error[0]) / (1.0 - self.scale),
                        moved.y + error[1],
                    ],
                    turned_rad: heading(to_s) - heading(from_s) + error[2],
                    covariance,
                });
            }
        }
        let mut positions = Vec::new();
        for n in 0..=(self.seconds * 5.0) as usize {
            // Not at an increment's edge.
            let t = n as f64 / 5.0 + 0.0003;
            let at = place(t) + body(t) * self.receiver_arm + noise(random, self.position);
            if !self.out(1, t) && t < self.seconds {
                positions.push(Position {
                    time_s: t + self.receiver_clock_s,
                    position_m: at,
                    sigma_m: self.position,
                    velocity_m_s: None,
                });
            }
        }
        // Drifts as random walks of a hundredth of a second.
        let model = &self.model;
        let mut b = noise(random, DVec3::splat(model.inertial_position[0]));
        let mut c = noise(random, DVec3::splat(model.inertial_velocity[0]));
        let mut h = 0.0;
        let mut inertial = Vec::new();
        for n in 0..(self.seconds * 100.0) as usize {
            let t = n as f64 / 100.0;
            let (place_noise, velocity_noise) = (
                noise(random, DVec3::splat(self.inertial_position)),
                noise(random, DVec3::splat(self.inertial_velocity)),
            );
            let heading_noise = self.inertial_heading * gaussian(random);
            if n % 5 == 2 && !self.out(2, t) {
                let arm = body(t) * self.inertial_arm;
                let end = velocity(t) + turn_rate(t) * DVec3::Z.cross(arm);
                inertial.push(Inertial {
                    time_s: t + self.inertial_clock_s,
                    position_m: Some([
                        place(t) + arm + b + place_noise,
                        DVec3::splat(self.inertial_position),
                    ]),
                    velocity_m_s: Some([
                        end + c + velocity_noise,
                        DVec3::splat(self.inertial_velocity),
                    ]),
                    heading_rad: Some([
                        heading(t) - self.squint + h + heading_noise,
                        self.inertial_heading,
                    ]),
                    roll_pitch_rad: [0.0; 2],
                });
            }
            b += c * 0.01 + noise(random, DVec3::splat(model.inertial_position[1] * 0.1));
            c += noise(random, DVec3::splat(model.inertial_velocity[1] * 0.1));
            h += model.inertial_heading * 0.1 * gaussian(random);
        }
        Measurements {
            increments,
            positions,
            inertial,
        }
    }

    fn fused(&self, seed: u64) -> Fused {
        let measured = self.measure(seed);
        fuse(&measured.inputs(), &self.model, &Silent).unwrap()
    }
}

/// Errors of a stretch of track after the offset and the turn about z that make them least: RMS in the plane, and upwards.
fn relative(errors: &[(DVec3, DVec3)]) -> [f64; 2] {
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

/// Of every second of a track, half a second on from one to the next.
fn apertures(
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

fn largest(apertures: &[[f64; 2]]) -> [f64; 2] {
    let most = |k: usize| apertures.iter().map(|one| one[k]).fold(0.0, f64::max);
    [most(0), most(1)]
}

/// RMS of all.
fn typical(apertures: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|k| {
        let sum: f64 = apertures.iter().map(|one| one[k] * one[k]).sum();
        (sum / apertures.len() as f64).sqrt()
    })
}

/// Errors within apertures of the estimate, largest and typical; and typical ones as its covariance has them.
fn judged(sensors: &Sensors, fused: &Fused) -> [[f64; 2]; 3] {
    // Every tenth pulse is enough of a curve that is smooth but for micrometres.
    let thinned = fused.samples.iter().enumerate();
    let track: Vec<(f64, DVec3)> = thinned
        .filter(|(n, sample)| n % 10 == 0 || sample.basis == Basis::Bridged)
        .map(|(_, sample)| (sample.time_s, sample.position_m))
        .collect();
    let errors = apertures(&track, sensors.seconds, |i| place(track[i].0));
    let mut random = ChaCha8Rng::seed_from_u64(99);
    let mut foretold = Vec::new();
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
        foretold.extend(apertures(&track, sensors.seconds, |i| known[i]));
    }
    [largest(&errors), typical(&errors), typical(&foretold)]
}

fn told(name: &str, [largest, typical, foretold]: [[f64; 2]; 3]) {
    println!(
        "{name}: in the plane at most {:.1} um, RMS {:.1} um, by the covariance {:.1} um; upwards {:.1}, {:.1}, {:.1} um",
        largest[0] * 1e6,
        typical[0] * 1e6,
        foretold[0] * 1e6,
        largest[1] * 1e6,
        typical[1] * 1e6,
        foretold[1] * 1e6
    );
}

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

/// The drift: within any second, after an offset and a turn, less than a twentieth of a wavelength, with 10 s of any of the three missing. In L band
/// also upwards.
#[test]
fn l_band_apertures_stay_within_a_twentieth_of_a_wavelength() {
    // As white noise that adds up to 2 mm along a metre: the worst that MPGA at 30 dB may be.
    let mut walk = sensors();
    walk.step = [63e-6, 10e-6, 20e-6];
    for (kind, base) in [("scale", sensors()), ("walk", walk)] {
        for (name, sensors) in NAMES.into_iter().zip(outages(&base)) {
            let fused = sensors.fused(1);
            let judged = judged(&sensors, &fused);
            told(&format!("{kind}, {name}"), judged);
            let [most, typical, foretold] = judged;
            let bound = WAVELENGTH_L_M / 20.0;
            assert!(most[0] < bound && most[1] < bound, "{kind}, {name}");
            // RMS over 119 apertures that overlap by half, of errors with few degrees of freedom each: some 60 independent squares, 10 % of RMS;
            // slow parts (scale) are one number for all, and may be twice what is typical.
            for k in [0, 1] {
                let ratio = typical[k] / foretold[k];
                assert!((0.4..2.2).contains(&ratio), "{kind}, {name}: {ratio}");
            }
        }
    }
}

/// At 77 GHz a twentieth is 0.2 mm. An error of 2 mm of scale is found well enough by positions to 2 cm (corrected ones), where there are increments.
#[test]
fn millimetre_apertures_stay_within_a_twentieth_where_positions_hold_the_scale() {
    let mut base = sensors();
    base.position = DVec3::new(0.02, 0.02, 0.04);
    for (n, (name, sensors)) in NAMES.into_iter().zip(outages(&base)).enumerate() {
        let fused = sensors.fused(2);
        let judged = judged(&sensors, &fused);
        told(name, judged);
        // Without increments the inertial solution's millimetre is what is left: nobody knows better.
        if n != 1 {
            assert!(judged[0][0] < WAVELENGTH_77_GHZ_M / 20.0, "{name}");
        }
    }
}

/// Errors of place and heading in their covariance: 4 on average of many tracks and times, whose sum is of chi-square.
#[test]
fn errors_are_what_the_covariance_says() {
    let mut base = sensors();
    base.seconds = 20.0;
    base.out[0] = Some([9.0, 11.0]);
    let (mut sum, mut count, mut chi) = (0.0, 0, [0.0; 2]);
    for seed in 0..24 {
        let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
        let mut sensors = base.clone();
        // What is assumed to be of a spread is of it.
        sensors.scale = sensors.model.scale * gaussian(&mut random);
        sensors.squint = sensors.model.squint_rad.sigma * gaussian(&mut random);
        let fused = sensors.fused(seed);
        chi = [0, 1].map(|k| chi[k] + fused.chi_square[k]);
        // In an aperture's middle, between two moments, and in the gap.
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
    // 288 numbers: their chi-square is 288 within 3.3 sqrt(2 * 288) = 79 in 999 of 1000. Times of a track share its slow errors, which
    // adds to the spread, by half at most.
    let off = sum - f64::from(count);
    println!(
        "chi-square {sum:.0} of {count}; of residuals {:.4}",
        chi[0] / chi[1]
    );
    assert!(off.abs() < 1.5 * 79.0, "{sum} of {count}");
    // What was measured fits: of 24 times 4000 numbers or so, whose squares have a spread of 0.5 %; motion is not the noise that it is taken for.
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
fn clocks_arms_and_squint_are_found_where_the_data_tell_them() {
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
        // Within 4 standard deviations, one of which is of ten thousand.
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
    assert!(fused.inertial_clock_s.sigma < 1e-3 && fused.receiver_clock_s.told());
    assert!(fused.receiver_arm_m[0].sigma < 0.1 && fused.receiver_arm_m[1].sigma < 0.1);
    // A level body never tells how high its antenna is, where the heights of both are not told apart.
    assert!(
        !fused.receiver_arm_m[2].told(),
        "{:?}",
        fused.receiver_arm_m[2]
    );
    // What is held stays.
    assert!(fused.inertial_arm_m[0].value.abs() < 1e-5);
}

#[test]
fn outliers_of_every_kind_move_nothing() {
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
    // A wrap of the phase: half a wavelength at once.
    measured.increments[12_345].moved_m[1] += WAVELENGTH_77_GHZ_M / 2.0;
    without.increments.remove(12_345);
    let [fused, known] =
        [&measured, &without].map(|all| fuse(&all.inputs(), &sensors.model, &Silent).unwrap());
    let of = |what: Measured| fused.outliers.iter().filter(|one| one.of == what).count();
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
    // One of 20,000 is bridged.
    let bridged = fused
        .samples
        .iter()
        .filter(|s| s.basis == Basis::Bridged)
        .count();
    assert!(bridged <= 2, "{bridged}");
    // The track is that of who knew: what is left out weighs nothing, and least squares end within a hundredth of a standard deviation.
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
fn a_heading_that_nobody_states_follows_from_the_way() {
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
    // 5 cm over 60 m, by 300 positions, and as much of the random walk of headings: some tenths of a milliradian.
    assert!(off.abs() < 4.0 * sigma && sigma < 2e-3);
}

#[test]
fn what_cannot_be_fused_is_refused_in_words() {
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
    assert!(refused(with(&back), &model).contains("a time that is not after"));
    let mut flat = measured.increments[..10].to_vec();
    flat[7].covariance = DMat3::ZERO;
    let inputs = Inputs {
        increments: &flat,
        ..measured.inputs()
    };
    assert!(refused(inputs, &model).contains("increment 8, at 0.007 s, has a covariance"));
    let endless = Model {
        acceleration: f64::INFINITY,
        ..model
    };
    assert!(refused(measured.inputs(), &endless).contains("acceleration is inf"));
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

/// Positions alone, one of them, and two at one time of the clock's resolution: a track with the spread it has.
#[test]
fn little_makes_a_track_of_little_certainty() {
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
