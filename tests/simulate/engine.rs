//! Sums of the engine: the plain sum against closed forms and an independent oracle, the fast sum against the plain one
//! over scenes of every kind.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::radar::{Antenna, Motion, Pattern};
use subaperture::simulate::Scatterer;
use subaperture::simulate::engine::{Engine, Method, Scratch, Sweep, View};
use subaperture::simulate::scene::{Block, Corner, Mover, Scene};
use subaperture::track::{Pose, Trajectory};

const C: f64 = 299_792_458.0;

/// Constant velocity and attitude.
#[derive(Clone, Copy, Debug)]
struct Straight {
    start_m: DVec3,
    velocity_m_s: DVec3,
}

impl Trajectory for Straight {
    fn pose(&self, time_s: f64) -> Pose {
        Pose {
            position_m: self.start_m + self.velocity_m_s * time_s,
            attitude: DQuat::IDENTITY,
        }
    }
}

/// Track with vibration and roll.
#[derive(Clone, Copy, Debug)]
struct Shaky;

impl Trajectory for Shaky {
    fn pose(&self, time_s: f64) -> Pose {
        let sway = 0.002 * (TAU * 60.0 * time_s).sin();
        Pose {
            position_m: DVec3::new(125.0 * time_s, -1000.0 + sway, 400.0 + 2.0 * sway),
            attitude: DQuat::from_rotation_z(0.1 * time_s) * DQuat::from_rotation_x(sway),
        }
    }
}

const AIRCRAFT: Straight = Straight {
    start_m: DVec3::new(-300.0, -1000.0, 400.0),
    velocity_m_s: DVec3::new(125.0, 0.0, 0.0),
};

fn antenna(offset_m: DVec3, pattern: Pattern) -> Antenna {
    Antenna {
        name: "a".into(),
        offset_m,
        boresight: DVec3::new(0.3, 0.9, -0.3).normalize(),
        up: DVec3::new(0.0, 0.3, 0.9).normalize(),
        pattern,
        aim_m: None,
    }
}

/// Sweep of 150 MHz in 1 ms about 9.6 GHz, mixed with a copy without delay.
fn sweep(count: usize) -> Sweep {
    Sweep {
        start_hz: 9.525e9,
        step_hz: 150e6 / count as f64,
        count,
        start_s: 2e-6,
        step_s: 1e-3 / count as f64,
        residual_hz_s: 1.5e11,
    }
}

fn view<'a>(
    body: &'a dyn Trajectory,
    one: &'a Antenna,
    two: &'a Antenna,
    motion: Motion,
) -> View<'a> {
    View {
        body,
        transmitter: one,
        receiver: two,
        time_s: 0.4,
        sweep: sweep(300),
        reference_s: 2.0 * 900.0 / C,
        motion,
        spreading_from_m: None,
    }
}

fn uniform(random: &mut ChaCha8Rng) -> f64 {
    f64::from(random.next_u32()) / 2f64.powi(32) - 0.5
}

fn points(count: usize, half_m: f64) -> Vec<Scatterer> {
    let mut random = ChaCha8Rng::seed_from_u64(count as u64);
    let mut next = || uniform(&mut random);
    (0..count)
        .map(|_| Scatterer {
            position_m: DVec3::new(next(), next(), next() * 0.1) * 2.0 * half_m,
            amplitude: Complex64::new(next(), next()),
        })
        .collect()
}

fn samples(scene: &Scene, method: Method, view: &View) -> Vec<Complex64> {
    // The previous content must not matter.
    let mut out = vec![Complex64::new(7.0, f64::NAN); view.sweep.count];
    Engine::new(scene, method).pulse(view, &mut Scratch::default(), &mut out);
    out
}

fn error_db(z: &[Complex64], reference: &[Complex64]) -> f64 {
    assert_eq!(z.len(), reference.len());
    let error: f64 = z
        .iter()
        .zip(reference)
        .map(|(a, b)| (a - b).norm_sqr())
        .sum();
    let power: f64 = reference.iter().map(|z| z.norm_sqr()).sum();
    10.0 * (error / power).log10()
}

/// Check the fast sum against the plain one to -90 dB, 10 dB better than required.
fn hold(name: &str, scene: &Scene, view: &View) {
    let db = error_db(
        &samples(scene, Method::Fast, view),
        &samples(scene, Method::Sum, view),
    );
    println!("{name}: {db:.1} dB");
    assert!(db < -90.0, "{name}: {db}");
}

#[test]
fn scatterer_has_exact_phase_with_residual_video_phase() {
    let (one, two) = (
        antenna(DVec3::X, Pattern::Isotropic),
        antenna(DVec3::NEG_X, Pattern::Isotropic),
    );
    let view = view(&AIRCRAFT, &one, &two, Motion::StopAndGo);
    let scene = Scene {
        points: vec![Scatterer {
            position_m: DVec3::new(-250.0, 0.0, 0.0),
            amplitude: Complex64::new(0.6, 0.8),
        }],
        ..Scene::default()
    };
    // At 0.4 s the body is at x = -250: both antennas are offset by 1 m.
    let range_m = (1.0f64 + 1000.0 * 1000.0 + 400.0 * 400.0).sqrt();
    let d = 2.0 * (range_m - 900.0) / C;
    let exact: Vec<Complex64> = (0..300)
        .map(|k| {
            let f = 9.525e9 + 0.5e6 * f64::from(k);
            let phase = -TAU * f * d + PI * 1.5e11 * d * d;
            Complex64::new(0.6, 0.8) * Complex64::new(phase.cos(), phase.sin())
        })
        .collect();
    // Delays of 8e-6 s are rounded to 1e-21 s, 5e-11 rad, a few times: below 3e-10.
    assert!(error_db(&samples(&scene, Method::Sum, &view), &exact) < -190.0);
    assert!(error_db(&samples(&scene, Method::Fast, &view), &exact) < -110.0);
}

#[test]
fn delay_is_exact_for_motion_towards_a_scatterer() {
    // For head-on motion the light-time equation is linear. With the radar at r(t) and the mover receding at u: it was
    // at x_r = x0 + u t_r when t - t_r = (x_r - r(t)) / c, and the transmitter at r(t - tau) when t_r - (t - tau) =
    // (x_r - r(t - tau)) / c. Solved by hand:
    let (v, u) = (125.0, 30.0);
    let body = Straight {
        start_m: DVec3::new(10.0, 0.0, 0.0),
        velocity_m_s: DVec3::new(v, 0.0, 0.0),
    };
    let mover = Straight {
        start_m: DVec3::new(1500.0, 0.0, 0.0),
        velocity_m_s: DVec3::new(u, 0.0, 0.0),
    };
    let at = antenna(DVec3::ZERO, Pattern::Isotropic);
    let view = view(&body, &at, &at, Motion::True);
    let scene = Scene {
        movers: vec![Mover {
            motion: Arc::new(mover),
            amplitude: Complex64::ONE,
        }],
        ..Scene::default()
    };
    let exact: Vec<Complex64> = (0..300)
        .map(|k| {
            let t = 0.4 + 2e-6 + f64::from(k) * 1e-3 / 300.0;
            let r = 10.0 + v * t;
            // c (t - t_r) = x0 + u t_r - r
            let reflected = (C * t + r - 1500.0) / (C + u);
            let place = 1500.0 + u * reflected;
            // c (t_r - t_t) = place - x_radar(t_t)
            let sent = (C * reflected - place + 10.0) / (C - v);
            let d = (t - sent) - 2.0 * 900.0 / C;
            let f = 9.525e9 + 0.5e6 * f64::from(k);
            Complex64::cis(-TAU * f * d + PI * 1.5e11 * d * d)
        })
        .collect();
    // In the oracle, c t of 1e8 m has rounding errors of 1.5e-8 m: 3e-6 rad, a few of them: -105 dB.
    let sum = error_db(&samples(&scene, Method::Sum, &view), &exact);
    let fast = error_db(&samples(&scene, Method::Fast, &view), &exact);
    println!("sum {sum:.1} dB, fast {fast:.1} dB");
    assert!(sum < -100.0, "{sum}");
    assert!(fast < -90.0, "{fast}");
    // Stop-and-go differs clearly: the range changes by 95 mm, three wavelengths, within a sweep.
    let still = View {
        motion: Motion::StopAndGo,
        ..view
    };
    assert!(error_db(&samples(&scene, Method::Sum, &still), &exact) > -10.0);
}

#[test]
fn fast_sum_matches_plain_sum() {
    let at = antenna(DVec3::ZERO, Pattern::Isotropic);
    let far = antenna(DVec3::new(-30.0, 4.0, 1.0), Pattern::Isotropic);
    let narrow = Pattern::Gaussian {
        azimuth_rad: 0.1,
        elevation_rad: 0.2,
    };
    let beam = antenna(DVec3::X, narrow);
    let scene = |count, half_m| Scene {
        points: points(count, half_m),
        ..Scene::default()
    };
    let rich = Scene {
        corners: vec![Corner {
            position_m: DVec3::new(20.0, -30.0, 0.0),
            boresight: DVec3::new(-0.2, -0.9, 0.4).normalize(),
            edge_m: 0.2,
        }],
        movers: vec![Mover {
            motion: Arc::new(Straight {
                start_m: DVec3::new(5.0, 10.0, 0.0),
                velocity_m_s: DVec3::new(10.0, 30.0, 0.0),
            }),
            amplitude: Complex64::new(3.0, 1.0),
        }],
        blocks: vec![Block {
            centre_m: DVec3::new(0.0, -20.0, 10.0),
            half_m: DVec3::new(15.0, 3.0, 10.0),
            attitude: DQuat::from_rotation_z(0.3),
        }],
        ..scene(300, 60.0)
    };
    for motion in [Motion::StopAndGo, Motion::True] {
        for (name, body, one, two, scene) in [
            (
                "points",
                &AIRCRAFT as &dyn Trajectory,
                &at,
                &at,
                &scene(600, 60.0),
            ),
            // The unambiguous range c / (2 step) is 300 m: these points wrap several times.
            ("wide", &AIRCRAFT, &at, &at, &scene(600, 900.0)),
            ("bistatic", &AIRCRAFT, &at, &far, &scene(300, 60.0)),
            ("beams", &AIRCRAFT, &beam, &far, &scene(300, 60.0)),
            ("rich", &AIRCRAFT, &at, &beam, &rich),
            ("shaky", &Shaky, &beam, &far, &rich),
            ("one", &AIRCRAFT, &at, &at, &scene(1, 60.0)),
        ] {
            for spreading_from_m in [None, Some(1000.0)] {
                let view = View {
                    spreading_from_m,
                    ..view(body, one, two, motion)
                };
                hold(&format!("{name}, {motion:?}"), scene, &view);
            }
        }
    }
}

#[test]
fn fast_sum_matches_plain_sum_for_every_sweep_length_and_direction() {
    let at = antenna(DVec3::ZERO, Pattern::Isotropic);
    let scene = Scene {
        points: points(100, 60.0),
        ..Scene::default()
    };
    for motion in [Motion::StopAndGo, Motion::True] {
        for count in [1, 2, 3, 7, 64, 129] {
            let mut view = view(&AIRCRAFT, &at, &at, motion);
            view.sweep = sweep(count);
            hold(&format!("{count} samples, {motion:?}"), &scene, &view);
        }
        let mut down = view(&AIRCRAFT, &at, &at, motion);
        down.sweep.step_hz *= -1.0;
        down.sweep.residual_hz_s *= -1.0;
        hold(&format!("down, {motion:?}"), &scene, &down);
        // Stepped carriers, 50 ms in total: 6 m of travel within a sweep, for which blocks are shortened.
        let mut slow = view(&AIRCRAFT, &at, &at, motion);
        slow.sweep.step_s *= 50.0;
        slow.sweep.residual_hz_s = 0.0;
        hold(&format!("slow, {motion:?}"), &scene, &slow);
    }
}

#[test]
fn antenna_pattern_spreading_and_occlusion_match_definition() {
    // Independent oracle: two points, one behind a wall; beams by their published formula.
    let width = 0.2;
    let mut beam = antenna(
        DVec3::ZERO,
        Pattern::Gaussian {
            azimuth_rad: width,
            elevation_rad: width,
        },
    );
    beam.boresight = DVec3::Y;
    beam.up = DVec3::Z;
    let body = Straight {
        start_m: DVec3::ZERO,
        velocity_m_s: DVec3::ZERO,
    };
    let at = |x: f64, y: f64| Scatterer {
        position_m: DVec3::new(x, y, 0.0),
        amplitude: Complex64::ONE,
    };
    let scene = Scene {
        points: vec![at(50.0, 1000.0), at(-50.0, 1000.0)],
        blocks: vec![Block {
            centre_m: DVec3::new(-25.0, 500.0, 0.0),
            half_m: DVec3::new(5.0, 5.0, 5.0),
            attitude: DQuat::IDENTITY,
        }],
        ..Scene::default()
    };
    for method in [Method::Sum, Method::Fast] {
        let mut view = view(&body, &beam, &beam, Motion::StopAndGo);
        view.spreading_from_m = Some(2000.0);
        let range_m = 50f64.hypot(1000.0);
        let azimuth = (50f64 / 1000.0).atan();
        // Two-way amplitude: the power pattern, one half at half the width.
        let power = (-4.0 * 2f64.ln() * (azimuth / width).powi(2)).exp();
        let expected = power * (2000.0 / range_m).powi(2);
        for z in samples(&scene, method, &view) {
            assert!(
                (z.norm() / expected - 1.0).abs() < 1e-4,
                "{}",
                z.norm() / expected
            );
        }
    }
}

#[test]
fn empty_scene_gives_zeros_and_nan_positions_do_not_panic() {
    let at = antenna(DVec3::ZERO, Pattern::Isotropic);
    for motion in [Motion::StopAndGo, Motion::True] {
        for method in [Method::Sum, Method::Fast] {
            let view = view(&AIRCRAFT, &at, &at, motion);
            let empty = samples(&Scene::default(), method, &view);
            assert!(empty.iter().all(|z| *z == Complex64::ZERO));
            let scene = Scene {
                points: vec![Scatterer {
                    position_m: DVec3::new(f64::NAN, f64::INFINITY, 0.0),
                    amplitude: Complex64::ONE,
                }],
                ..Scene::default()
            };
            assert!(samples(&scene, method, &view)[0].re.is_nan());
        }
    }
}

#[test]
fn reused_scratch_memory_changes_no_bit() {
    let at = antenna(DVec3::ZERO, Pattern::Isotropic);
    let scene = Scene {
        points: points(700, 60.0),
        ..Scene::default()
    };
    let engine = Engine::new(&scene, Method::Fast);
    let mut scratch = Scratch::default();
    for motion in [Motion::True, Motion::StopAndGo, Motion::True] {
        let mut view = view(&AIRCRAFT, &at, &at, motion);
        view.sweep.count = 100;
        let mut out = vec![Complex64::ZERO; 100];
        engine.pulse(&view, &mut scratch, &mut out);
        assert_eq!(out, samples(&scene, Method::Fast, &view));
        view.sweep = sweep(64);
        engine.pulse(&view, &mut scratch, &mut out[..64]);
        assert_eq!(out[..64], samples(&scene, Method::Fast, &view));
    }
}

#[test]
fn table_reuse_matches_direct_sums() {
    let wide = Pattern::Gaussian {
        azimuth_rad: 0.4,
        elevation_rad: 0.4,
    };
    let (one, two) = (antenna(DVec3::X, wide.clone()), antenna(DVec3::NEG_X, wide));
    // The radar moves 0.125 m per pulse; points are 0.0625 or 0.25 m apart, rows at arbitrary positions.
    for pitch_m in [0.0625, 0.25] {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let points = (0..4)
            .flat_map(|row| (0..200).map(move |i| (row, i)))
            .map(|(row, i)| Scatterer {
                position_m: DVec3::new(
                    -255.0 + pitch_m * f64::from(i),
                    7.3 * f64::from(row * row),
                    0.4 * f64::from(row),
                ),
                amplitude: Complex64::new(uniform(&mut random), uniform(&mut random)),
            })
            .collect();
        let scene = Scene {
            points,
            corners: vec![Corner {
                position_m: DVec3::new(-240.0, 3.0, 0.0),
                boresight: DVec3::new(0.0, -0.9, 0.4).normalize(),
                edge_m: 0.05,
            }],
            ..Scene::default()
        };
        let mut views: Vec<View> = (0..40)
            .map(|n| {
                let mut view = view(&AIRCRAFT, &one, &two, Motion::StopAndGo);
                view.time_s = 0.4 + 1e-3 * f64::from(n);
                view.sweep.residual_hz_s = 0.0;
                // As in motion compensation to a point of the scene.
                view.reference_s += 1e-9 * f64::from(n);
                view.spreading_from_m = Some(1000.0);
                view
            })
            .collect();
        let engine = Engine::for_track(&scene, Method::Fast, &views, 1 << 20);
        assert!(engine.recycles());
        for view in &views {
            let mut out = vec![Complex64::ZERO; view.sweep.count];
            engine.pulse(view, &mut Scratch::default(), &mut out);
            let fast = error_db(&out, &samples(&scene, Method::Fast, view));
            let sum = error_db(&out, &samples(&scene, Method::Sum, view));
            // Pulse positions may be off by at most 1e-6 wavelengths: 1.3e-5 rad, -98 dB; here only by rounding.
            assert!(fast < -110.0 && sum < -110.0, "{fast} {sum}");
        }
        // Too little memory, an uneven track, or a scene off the lattice: no tables.
        assert!(!Engine::for_track(&scene, Method::Fast, &views, 1000).recycles());
        views[7].time_s += 1e-5;
        assert!(!Engine::for_track(&scene, Method::Fast, &views, 1 << 20).recycles());
        views[7].time_s -= 1e-5;
        let mut off = scene.clone();
        off.points[5].position_m.x += 1e-4;
        assert!(!Engine::for_track(&off, Method::Fast, &views, 1 << 20).recycles());
        // A pulse off the tables' track is computed directly.
        views[7].time_s += 3.3e-4;
        let mut out = vec![Complex64::ZERO; 300];
        engine.pulse(&views[7], &mut Scratch::default(), &mut out);
        assert_eq!(out, samples(&scene, Method::Fast, &views[7]));
    }
}
