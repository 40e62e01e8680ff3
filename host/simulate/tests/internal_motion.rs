//! Internal clutter motion: samples against a plain sum, correlation over lags against its closed form.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use num_complex::{Complex32, Complex64};
use subaperture_model::radar::{Antenna, Motion, Pattern};
use subaperture_model::track::{Pose, Trajectory};
use subaperture_simulate::engine::{Engine, Method, Scratch, Sweep, View};
use subaperture_simulate::scenario::Scenario;
use subaperture_simulate::scene::{InternalMotion, Scene};
use subaperture_simulate::{Experiment, Scatterer};

const C: f64 = 299_792_458.0;

fn experiment(text: &str) -> Experiment {
    Scenario::new("a.toml", text, ".").experiment().unwrap()
}

/// Samples of the first receiver, by pulse.
fn samples(experiment: &Experiment) -> Vec<Vec<Complex64>> {
    let channels = experiment.channels(1 << 30).unwrap();
    let history = channels.channel(0);
    let (count, width) = (
        history.collection().pulses.len(),
        history.collection().num_samples,
    );
    let mut samples = vec![Complex32::ZERO; count * width];
    history.read(0..count, &mut samples).unwrap();
    let wide = |z: &Complex32| Complex64::new(f64::from(z.re), f64::from(z.im));
    let rows = samples.chunks(width);
    rows.map(|row| row.iter().map(wide).collect()).collect()
}

fn error_db(got: &[Complex64], expected: &[Complex64]) -> f64 {
    let power = |z: &mut dyn Iterator<Item = Complex64>| z.map(|z| z.norm_sqr()).sum::<f64>();
    let error = power(&mut got.iter().zip(expected).map(|(a, b)| a - b));
    10.0 * (error / power(&mut expected.iter().copied())).log10()
}

/// Radar on an aircraft at the given speed over a disc of clutter; `{}` are further keys of the clutter.
fn flight(seed: u32, speed: f64, pulses: u32, clutter: &str) -> String {
    format!(
        "seed = {seed}\n\
         [radar]\nkind = \"ideal\"\npulses = {pulses}\npri = \"1 ms\"\ncentre = \"10 GHz\"\n\
         bandwidth = \"150 MHz\"\nsamples = 16\n\
         [platform]\nkind = \"{}\"\nposition = \"0, -5, 3 km\"\n{}\
         [[scene.clutter]]\nkind = \"disc\"\ncentre = \"3, 2, 1 m\"\nradius = \"4 m\"\ncount = 300\n\
         sigma0 = \"0 dB\"\n{clutter}\n",
        if speed > 0.0 { "linear" } else { "fixed" },
        if speed > 0.0 {
            format!("velocity = \"{speed}, 0, 0 m/s\"\n")
        } else {
            String::new()
        },
    )
}

/// Scatterers displaced at each pulse, summed in float64.
#[test]
fn phase_history_is_the_sum_over_displaced_scatterers() {
    let experiment = experiment(&flight(3, 125.0, 400, "velocity_spread = \"0.5 m/s\""));
    assert_eq!(experiment.scene.moving_points.len(), 300);
    assert!(experiment.scene.points.is_empty());
    let got = samples(&experiment);
    let channels = experiment.channels(1 << 30).unwrap();
    let collection = channels.channel(0).collection();
    for (pulse, got) in collection.pulses.iter().zip(&got) {
        let expected: Vec<Complex64> = (0..got.len())
            .map(|k| {
                let hz = pulse.start_hz + k as f64 * pulse.step_hz;
                let echo = |point: &subaperture_simulate::scene::MovingPoint| {
                    let place_m = point.start.position_m + pulse.time_s * point.velocity_m_s;
                    let path_m = (place_m - pulse.transmitter_m).length()
                        + (place_m - pulse.receiver_m).length();
                    let turns = hz * (path_m - pulse.reference_path_m) / C;
                    point.start.amplitude * Complex64::cis(-TAU * turns.fract())
                };
                experiment.scene.moving_points.iter().map(echo).sum()
            })
            .collect();
        let db = error_db(got, &expected);
        assert!(db < -90.0, "{} s: {db}", pulse.time_s);
    }
}

/// Correlation of the clutter at one frequency over seeds: the estimate from `M` pairs of Gaussian variables of the correlation `r` has the variances
/// `(1 - r^2)^2 / (2 M)` of the real part and `(1 - r^2) / (2 M)` of the imaginary part. Four standard deviations and the rounding of samples are allowed.
#[test]
fn correlation_over_lags_has_the_closed_form() {
    const SEEDS: u32 = 600;
    let spread = 0.4;
    let wavelength_m = C / 10e9;
    let lags = [1usize, 2, 4, 6, 9, 12];
    let mut sums = [(Complex64::ZERO, 0.0, 0.0); 6];
    for seed in 0..SEEDS {
        let clutter = format!("velocity_spread = \"{spread} m/s\"");
        let got = samples(&experiment(&flight(seed, 0.0, 13, &clutter)));
        for (&lag, (cross, first, second)) in lags.iter().zip(&mut sums) {
            let (a, b) = (got[0][8], got[lag][8]);
            *cross += b * a.conj();
            *first += a.norm_sqr();
            *second += b.norm_sqr();
        }
    }
    for (lag, (cross, first, second)) in lags.into_iter().zip(sums) {
        let tau_s = 1e-3 * lag as f64;
        let expected = (-8.0 * (PI * spread * tau_s / wavelength_m).powi(2)).exp();
        let got = cross / (first * second).sqrt();
        let free = 1.0 - expected * expected;
        let deviation = [free, free.sqrt()].map(|x| x / f64::from(2 * SEEDS).sqrt());
        println!("{lag} ms: {got:.5} of {expected:.5}, deviations {deviation:.5?}");
        assert!((got.re - expected).abs() < 4.0 * deviation[0] + 1e-6);
        assert!(got.im.abs() < 4.0 * deviation[1] + 1e-6);
    }
}

#[test]
fn clutter_without_spread_is_bit_identical_to_static_clutter() {
    let still = experiment(&flight(7, 125.0, 20, ""));
    let zero = experiment(&flight(7, 125.0, 20, "velocity_spread = \"0 m/s\""));
    assert!(zero.scene.moving_points.is_empty());
    assert_eq!(still.scene.points, zero.scene.points);
    assert_eq!(samples(&still), samples(&zero));
    // The spread does not change amplitudes, or the positions at the middle of 20 pulses.
    let moving = experiment(&flight(7, 125.0, 20, "velocity_spread = \"1 m/s\""));
    for (still, moving) in still.scene.points.iter().zip(&moving.scene.moving_points) {
        assert_eq!(still.amplitude, moving.start.amplitude);
        let place_m = moving.position_m(9.5e-3);
        assert!((still.position_m - place_m).length() < 1e-12);
    }
}

/// Body with vibration.
#[derive(Debug)]
struct Aircraft;

impl Trajectory for Aircraft {
    fn pose(&self, time_s: f64) -> Pose {
        let sway = 0.001 * (TAU * 40.0 * time_s).sin();
        Pose {
            position_m: DVec3::new(125.0 * time_s - 50.0, sway - 1000.0, 400.0),
            attitude: DQuat::IDENTITY,
        }
    }
}

/// Motion during the sweep: delays of each sample by 40 rounds of the fixed point.
#[test]
fn intra_pulse_motion_of_points_is_that_of_their_delays() {
    let points: Vec<Scatterer> = (0..500)
        .map(|i| {
            let i = f64::from(i);
            Scatterer {
                position_m: DVec3::new((7.1 * i).sin(), (3.3 * i).cos(), 0.0) * 60.0,
                amplitude: Complex64::cis(i * i),
            }
        })
        .collect();
    let antenna = |x: f64| Antenna {
        name: "a".into(),
        offset_m: DVec3::new(x, 0.0, 0.0),
        boresight: DVec3::Y,
        up: DVec3::Z,
        pattern: Pattern::Isotropic,
        aim_m: None,
    };
    let (one, two) = (antenna(0.5), antenna(-0.5));
    let count = 300;
    let view = View {
        body: &Aircraft,
        transmitter: &one,
        receiver: &two,
        time_s: 0.4,
        sweep: Sweep {
            start_hz: 9.525e9,
            step_hz: 0.5e6,
            count,
            start_s: 2e-6,
            step_s: 1e-3 / count as f64,
            residual_hz_s: 1.5e11,
        },
        reference_s: 1800.0 / C,
        motion: Motion::True,
        spreading_from_m: None,
    };
    for velocity_spread_m_s in [0.1, 20.0] {
        let motion = InternalMotion {
            velocity_spread_m_s,
            epoch_s: 0.4,
        };
        let scene = Scene {
            points: points[..200].to_vec(),
            moving_points: motion.of(&points[200..], 1, 0).unwrap(),
            ..Scene::default()
        };
        let [fast, plain] = [Method::Fast, Method::Sum].map(|method| {
            let mut out = vec![Complex64::ZERO; count];
            Engine::new(&scene, method).pulse(&view, &mut Scratch::default(), &mut out);
            out
        });
        let still = scene.points.iter().map(|p| (*p, DVec3::ZERO));
        let moving = scene
            .moving_points
            .iter()
            .map(|p| (p.start, p.velocity_m_s));
        let all: Vec<(Scatterer, DVec3)> = still.chain(moving).collect();
        let expected: Vec<Complex64> = (0..count)
            .map(|k| {
                let k = k as f64;
                let received_s = 0.4 + 2e-6 + k * 1e-3 / count as f64;
                let antenna_m = |t: f64, x: f64| Aircraft.pose(t).position_m + DVec3::X * x;
                let echo = |(point, velocity_m_s): &(Scatterer, DVec3)| {
                    let place = |t: f64| point.position_m + *velocity_m_s * t;
                    let receiver_m = antenna_m(received_s, -0.5);
                    let (mut back_s, mut delay_s) = (0.0, 0.0);
                    for _ in 0..40 {
                        back_s = (place(received_s - back_s) - receiver_m).length() / C;
                    }
                    let place_m = place(received_s - back_s);
                    for _ in 0..40 {
                        let sent_m = antenna_m(received_s - delay_s, 0.5);
                        delay_s = back_s + (place_m - sent_m).length() / C;
                    }
                    let d = delay_s - 1800.0 / C;
                    let turns = 0.75e11 * d * d - (9.525e9 + k * 0.5e6) * d;
                    point.amplitude * Complex64::cis(TAU * turns.fract())
                };
                all.iter().map(echo).sum()
            })
            .collect();
        let [fast_db, plain_db] = [fast, plain].map(|got| error_db(&got, &expected));
        println!("{velocity_spread_m_s} m/s: fast {fast_db:.1} dB, plain {plain_db:.1} dB");
        assert!(fast_db < -90.0, "{fast_db}");
        assert!(plain_db < -150.0, "{plain_db}");
    }
}
