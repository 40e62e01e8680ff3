//! Targets of any velocity, integrated over sub-CPIs along their motion.

use std::sync::OnceLock;

use glam::DVec3;
use subaperture_focus::Numerics;
use subaperture_focus::formers::auto::Auto;
use subaperture_gmti::adaptive::{Performance, Statistic, TargetModel, mean_sinr_loss};
use subaperture_gmti::space_time::{
    Calibration, Motion, Mover, Settings, SpaceTime, Training, find,
};
use subaperture_gmti::{Alignment, GmtiError, Imaging, balance};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{Channels, Collection};
use subaperture_signal::window::Window;

use crate::recording::{
    Errors, FOUR, THREE, TWO, Uniform, impaired, recorded, scene, scene_of_movers, scene_of_seed,
    scene_with,
};

const GRID: &str = "x=-60:60:0.3,y=-60:60:0.5,z=0";

/// Time of the positions of movers: the middle of 1040 pulses.
const MIDDLE_S: f64 = 0.5195;

fn aligned(channels: &Channels) -> Alignment {
    let collections: Vec<&Collection> = channels.iter().map(|(_, h)| h.collection()).collect();
    Alignment::new(&collections).unwrap()
}

/// Maps without an estimate of the array's orientation.
fn maps(channels: &Channels, settings: &Settings) -> Result<SpaceTime, GmtiError> {
    let alignment = aligned(channels);
    let calibration = Calibration {
        balances: balance(channels, &alignment, DVec3::ZERO).unwrap(),
        models: Vec::new(),
        view: None,
    };
    SpaceTime::form(
        channels,
        &alignment,
        &calibration,
        &GRID.parse().unwrap(),
        settings,
    )
}

fn movers(channels: &Channels, settings: &Settings) -> Vec<Mover> {
    let alignment = aligned(channels);
    let grid: ImageGrid = GRID.parse().unwrap();
    let imaging = Imaging {
        former: &Auto { error_db: -60.0 },
        grid: &grid,
        windows: [Window::default(); 2],
        memory_bytes: 1 << 30,
        numerics: Numerics::default(),
        monitor: &Silent,
    };
    let images = imaging.form(channels, &alignment).unwrap();
    find(
        channels,
        &alignment,
        &Calibration::of(&images),
        &grid,
        settings,
        &Silent,
    )
    .unwrap()
}

fn motion(position: [f64; 2], velocity: [f64; 2]) -> Motion {
    Motion {
        epoch_s: MIDDLE_S,
        position_m: DVec3::new(position[0], position[1], 0.0),
        velocity_m_s: DVec3::new(velocity[0], velocity[1], 0.0),
        acceleration_m_s2: DVec3::ZERO,
    }
}

/// Clutter without movers, seen by three receivers.
fn clutter() -> &'static Channels<'static> {
    static CLUTTER: OnceLock<Channels<'static>> = OnceLock::new();
    CLUTTER.get_or_init(|| recorded(&scene(&[], &THREE, 10.0)))
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Echoes of point targets by the simulator's sum over all pulses and frequencies.
#[test]
fn coherent_integration_has_the_gain_of_all_sub_cpis() {
    let targets = [
        ([0.0, 0.0], [0.0, 1.0]),
        ([20.0, 30.0], [15.0, 2.0]),
        ([-30.0, -30.0], [-5.0, -12.0]),
        ([-30.0, 20.0], [10.0, 28.0]),
    ];
    for (place, velocity) in targets {
        let text = [place, velocity].map(|[x, y]| format!("{x}, {y}, 0 m"));
        let velocity_text = text[1].clone() + "/s";
        let recorded = recorded(&scene(&[(&text[0], &velocity_text, "5 m^2")], &THREE, 10.0));
        for bins in [1, 3] {
            let settings = Settings {
                bins,
                ..Settings::default()
            };
            let maps = maps(&recorded, &settings).unwrap();
            let target = motion(place, velocity);
            let all = maps.integrate(&target);
            let single = all.non_coherent / 26.0;
            let gain_db = db(all.coherent / single);
            let expected_db = db(26.0);
            println!(
                "{bins} bins {velocity:?}: {:.2} dB, gain {gain_db:.3} of {expected_db:.2} dB, amplitude {:.4}",
                db(all.coherent),
                all.amplitude / 5f64.sqrt()
            );
            assert!((gain_db - expected_db).abs() < 0.05, "{gain_db}");
            // The amplitude is the root of the cross-section, without phase: by noise to 4 / sqrt(SNR), by the quadratic phase in sub-CPIs to 1 %.
            let error = (all.amplitude / 5f64.sqrt() - 1.0).norm();
            assert!(error < 0.02 + 4.0 / all.coherent.sqrt(), "{error}");
        }
    }
}

/// Twenty movers of 0.5 to 29 m/s in each scene, seen by an array at a crab angle of 5 degrees with errors of gain and phase. Number of scenes: `SUBAPERTURE_SCENES`, 1 if it is not
/// set; number of receivers: `SUBAPERTURE_RECEIVERS`, 3 or 4.
#[test]
fn movers_of_any_velocity_are_within_their_covariances() {
    let number =
        |name: &str, least: u64| std::env::var(name).map_or(least, |text| text.parse().unwrap());
    let scenes = number("SUBAPERTURE_SCENES", 1);
    let receivers: &[&str] = match number("SUBAPERTURE_RECEIVERS", 3) {
        4 => &FOUR,
        _ => &THREE,
    };
    let mut random = Uniform(5);
    let mut uniform = |low, high| random.between(low, high);
    let crab_rad = 5f64.to_radians();
    let phase_centres_m = [0.0, 0.4, 1.0, 1.2];
    let errors: Vec<Errors> = (0..receivers.len())
        .map(|c| Errors {
            gain_db: [0.0, 1.0, -1.0, 0.5][c],
            phase_deg: [0.0, 10.0, -120.0, 60.0][c],
            delay_s: [0.0, 0.5e-9, -1e-9, 0.0][c],
            displaced_m: DVec3::new(0.0, -phase_centres_m[c] * crab_rad, 0.0),
        })
        .collect();
    let (mut total, mut detected, mut false_count) = (0, 0, 0);
    let mut errors_in_sigma: [Vec<f64>; 4] = Default::default();
    for seed in 0..scenes {
        let noise_db = [10.0, 0.0, 20.0][seed as usize % 3];
        let mut truths = Vec::new();
        for i in 0..20 {
            let place = [uniform(-50.0, 50.0), -57.0 + 6.0 * f64::from(i)];
            let speed = uniform(0.5, 29.0) * if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            truths.push((place, [uniform(-15.0, 15.0), speed], uniform(0.5, 5.0)));
        }
        let recorded = recorded(&scene_of_movers(300 + seed, &truths, receivers, noise_db));
        let found = movers(&impaired(&recorded, &errors), &Settings::default());
        total += truths.len();
        let mut left: Vec<&Mover> = found.iter().collect();
        for (place, velocity, section) in truths {
            let near = |mover: &&Mover| {
                let (p, v) = (mover.motion.at(MIDDLE_S), mover.motion.velocity_m_s);
                (p.y - place[1]).abs() < 1.5
                    && (p.x - place[0]).abs() < 15.0
                    && (v.y - velocity[1]).abs() < 1.0
            };
            let Some(i) = left.iter().position(near) else {
                println!("scene {seed}: missed {place:.2?}, {velocity:.2?} m/s, {section:.2} m^2");
                continue;
            };
            let mover = left.remove(i);
            detected += 1;
            let (p, v) = (mover.motion.at(MIDDLE_S), mover.motion.velocity_m_s);
            let truth = [place[0], place[1], velocity[0], velocity[1]];
            for (k, value) in [p.x, p.y, v.x, v.y].into_iter().enumerate() {
                errors_in_sigma[k].push((value - truth[k]) / mover.covariance[k][k].sqrt());
            }
        }
        false_count += left.len();
        for mover in left {
            println!(
                "scene {seed}: false {:.2?}, {:.1} dB",
                mover.motion,
                db(mover.integrated.coherent)
            );
        }
    }
    println!("detected {detected} of {total}, {false_count} false");
    assert!(100 * detected >= 98 * total, "{detected} of {total}");
    assert!(false_count as u64 <= scenes, "{false_count}");
    for (name, errors) in ["x", "y", "velocity along x", "velocity along y"]
        .iter()
        .zip(&errors_in_sigma)
    {
        let inside = errors.iter().filter(|e| e.abs() < 1.96).count() as f64 / errors.len() as f64;
        println!("{name}: {:.1} % within 1.96 sigma", 100.0 * inside);
        // 95 % of all errors; of 20, at least 16 with a probability of 99.7 %.
        assert!(inside > 0.79, "{name}: {inside}");
    }
}

/// A car that brakes from 12 m/s at 4 m/s^2, and the same target with its mean velocity.
#[test]
fn braking_target_is_integrated_under_its_acceleration() {
    let car = r#"
[[scene.mover]]
kind = "profile"
position = "0, -6, 0 m"
velocity = "0, 12, 0 m/s"
pieces = ["2 s, 0, -4, 0 m/s^2"]
cross_section = "5 m^2"
"#;
    let recorded = recorded(&scene_with(11, &[], car, &THREE, 10.0));
    let maps = maps(&recorded, &Settings::default()).unwrap();
    let braking = Motion {
        epoch_s: 0.0,
        acceleration_m_s2: DVec3::new(0.0, -4.0, 0.0),
        ..motion([0.0, -6.0], [0.0, 12.0])
    };
    let level_db =
        |motion: &Motion| 2.0 * db((maps.integrate(motion).amplitude / 5f64.sqrt()).norm());
    let mean = motion(
        [0.0, -6.0 + 12.0 * MIDDLE_S - 2.0 * MIDDLE_S * MIDDLE_S],
        [0.0, 12.0 - 4.0 * MIDDLE_S],
    );
    let [braking_db, mean_db] = [&braking, &mean].map(level_db);
    println!("{braking_db:.2} dB with the acceleration, {mean_db:.2} dB with the mean velocity");
    assert!(braking_db.abs() < 0.2, "{braking_db}");
    assert!(mean_db < -6.0, "{mean_db}");
}

/// A mover 60 m beyond the end of the grid along the track has the range and Doppler of places in the grid at other velocities. Its main response is not detected there; an ambiguity is, 25 dB
/// below it.
#[test]
fn main_response_of_target_outside_of_the_grid_is_not_detected_inside() {
    let mover = ("120, 10, 0 m", "2, 6, 0 m/s", "5 m^2");
    let recorded = recorded(&scene(&[mover], &THREE, 10.0));
    let level = maps(&recorded, &Settings::default())
        .unwrap()
        .integrate(&motion([120.0, 10.0], [2.0, 6.0]))
        .coherent;
    for found in movers(&recorded, &Settings::default()) {
        let relative_db = db(found.integrated.coherent / level);
        println!("{relative_db:.1} dB: {:.1?}", found.motion.position_m);
        assert!(relative_db < -20.0, "{relative_db}");
    }
}

/// Clutter and noise without movers.
#[test]
fn search_has_at_most_the_requested_false_alarms() {
    let settings = Settings {
        false_alarm_probability: 1e-5,
        ..Settings::default()
    };
    for noise_db in [-10.0, 10.0] {
        let recorded = recorded(&scene_of_seed(500, &[], &THREE, noise_db));
        let found = movers(&recorded, &settings);
        // Resolution cells of the maps: 120 m plus 30 m/s of slant range on both sides, and Doppler of 30 m/s and the scene.
        let cells = 180.0 * (2.0 * 2.2 * 1040.0);
        let expected = 1e-5 * cells;
        println!("{} of {expected:.1} expected", found.len());
        // Of 8, at most 20 with a probability of 99.99 %.
        assert!(found.len() <= 20, "{}", found.len());
    }
}

/// A target of 28 m/s walks 7 m of slant range in a sub-CPI of 0.26 s.
#[test]
fn keystone_removes_the_loss_by_range_walk() {
    for speed in [10.0, 28.0] {
        let text = format!("0, {speed}, 0 m/s");
        let recorded = recorded(&scene(&[("0, 0, 0 m", &text, "5 m^2")], &THREE, 10.0));
        for sub_cpis in [4, 13, 26] {
            let level = |keystone: bool| {
                let settings = Settings {
                    sub_cpis,
                    keystone,
                    ..Settings::default()
                };
                let maps = maps(&recorded, &settings).unwrap();
                let all = maps.integrate(&motion([0.0, 0.0], [0.0, speed]));
                (all.amplitude / 5f64.sqrt()).norm()
            };
            let [with_db, without_db] = [true, false].map(|keystone| 2.0 * db(level(keystone)));
            println!(
                "{speed} m/s, {sub_cpis} sub-CPIs: {with_db:.2} dB with Keystone, {without_db:.2} dB without"
            );
            assert!(with_db.abs() < 0.2, "{with_db}");
            if sub_cpis == 4 && speed > 20.0 {
                assert!(without_db < -3.0, "{without_db}");
            }
        }
    }
}

/// SINR after the filter of a sub-CPI, relative to that with Keystone.
#[test]
fn keystone_does_not_change_the_filter_of_clutter() {
    let recorded = clutter();
    for (sub_cpis, bins) in [(4, 1), (4, 3)] {
        let gains = [true, false].map(|keystone| {
            let settings = Settings {
                sub_cpis,
                keystone,
                bins,
                ..Settings::default()
            };
            let maps = maps(recorded, &settings).unwrap();
            [0.1, 1.0, 5.0].map(|speed| {
                let places =
                    (0..9).map(|i| motion([0.0, 10.0 * f64::from(i) - 40.0], [0.0, speed]));
                places
                    .map(|target| maps.integrate(&target).gain)
                    .sum::<f64>()
            })
        });
        let change_db = [0, 1, 2].map(|i| db(gains[1][i] / gains[0][i]));
        println!(
            "{sub_cpis} sub-CPIs, {bins} bins: without Keystone {change_db:.2?} dB at 0.1, 1 and 5 m/s"
        );
        assert!(
            change_db.iter().all(|change| change.abs() < 0.1),
            "{change_db:?}"
        );
    }
}

/// Minimum detectable velocity of a fluctuating target (Swerling 1) by the gains of the filters in measured clutter: probability of detection 0.5, of false alarm 1e-6.
#[test]
fn integration_halves_the_minimum_detectable_velocity_of_a_sub_cpi() {
    let all = clutter();
    let pair = recorded(&scene(&[], &THREE, 10.0));
    let pair = pair.select(&["T1R1", "T1R2"]).unwrap();
    let mut table = Vec::new();
    for (name, channels, bins) in [
        ("DPCA", &pair, 1),
        ("EFA 1", all, 1),
        ("EFA 3", all, 3),
        ("EFA 5", all, 5),
    ] {
        let maps = maps(
            channels,
            &Settings {
                bins,
                ..Settings::default()
            },
        )
        .unwrap();
        let still = motion([0.0, 0.0], [0.0, 0.0]);
        let snapshots = maps
            .in_sub_cpi(13, |time_s| still.at(time_s))
            .unwrap()
            .snapshots;
        let size = bins * channels.len();
        let performance = Performance::new(Statistic::Amf, size, snapshots).unwrap();
        let threshold = performance.threshold(1e-6).unwrap();
        let mdv_m_s = |integrated: bool| {
            let detected = |velocity: f64| {
                let places = [-30.0, -15.0, 0.0, 15.0, 30.0].map(|y| {
                    let target = motion([0.0, y], [0.0, velocity]);
                    let one = maps.in_sub_cpi(13, |time_s| target.at(time_s)).unwrap();
                    let gain = match integrated {
                        true => maps.integrate(&target).gain,
                        false => one.gain,
                    };
                    performance.detection_probability(
                        threshold,
                        CROSS_SECTION_M2 * gain,
                        TargetModel::Swerling1,
                    )
                });
                places.iter().sum::<f64>() / places.len() as f64
            };
            let steps = (1..1000).map(|i| 0.001 * f64::from(i));
            steps
                .into_iter()
                .find(|&velocity| detected(velocity) >= 0.5)
        };
        let row = [false, true].map(mdv_m_s);
        println!(
            "{name}: MDV of one sub-CPI {:.3?} m/s, of 26 {:.3?} m/s",
            row[0], row[1]
        );
        table.push(row);
    }
    for row in &table[1..] {
        let [one, all] = row.map(|mdv| mdv.unwrap());
        assert!(all <= 0.5 * one, "{one} {all}");
    }
}

/// Radar cross-section of the target whose minimum detectable velocity is computed.
const CROSS_SECTION_M2: f64 = 3.0;

#[test]
fn few_training_cells_lose_sinr_as_by_theory() {
    let recorded = clutter();
    // `K` of the smallest ring without guard cells is at least twice the degrees of freedom.
    for bins in [1, 3, 5] {
        let settings = |training_cells| Settings {
            bins,
            guard_cells: 0,
            training_cells,
            ..Settings::default()
        };
        let few = maps(recorded, &settings(1 + bins / 4)).unwrap();
        let target = motion([0.0, 0.0], [0.0, 6.0]);
        let size = 3 * bins;
        let one = few.in_sub_cpi(13, |time_s| target.at(time_s)).unwrap();
        let loss_db = -db(mean_sinr_loss(size, one.snapshots));
        println!(
            "{bins} bins: {} snapshots, mean loss {loss_db:.2} dB",
            one.snapshots
        );
        assert!(one.snapshots >= 2 * size && loss_db < 3.1, "{loss_db}");
    }
}

#[test]
fn strongest_training_cells_lower_the_false_alarms() {
    let recorded = clutter();
    let mean = |training| {
        let maps = maps(
            recorded,
            &Settings {
                training,
                ..Settings::default()
            },
        )
        .unwrap();
        let places = (0..400).map(|i| motion([0.0, -50.0 + 0.25 * f64::from(i)], [0.0, 5.0]));
        let levels = places.map(|target| maps.integrate(&target).coherent);
        levels.sum::<f64>() / 400.0
    };
    let (all, strongest) = (mean(Training::All), mean(Training::Strongest));
    println!("mean statistic {all:.3} with all cells, {strongest:.3} with the strongest");
    // Exponential of mean 1 over at least 100 independent cells; the stronger half of snapshots of three channels has at most 1.44 times the mean power.
    assert!((0.7..1.3).contains(&all), "{all}");
    assert!((0.65..0.95).contains(&(strongest / all)), "{strongest}");
}

#[test]
fn settings_out_of_range_are_named() {
    let recorded = recorded(&scene(&[], &TWO, 10.0));
    let refused = |settings: Settings| {
        let error = maps(&recorded, &settings).err().unwrap().to_string();
        println!("{error}");
        error
    };
    let ok = Settings::default();
    assert!(refused(Settings { bins: 2, ..ok }).contains("1, 3 or 5"));
    assert!(refused(Settings { sub_cpis: 2, ..ok }).contains("3 sub-CPIs"));
    assert!(
        refused(Settings {
            sub_cpis: 600,
            ..ok
        })
        .contains("4 pulses")
    );
    assert!(
        refused(Settings {
            max_speed_m_s: f64::NAN,
            ..ok
        })
        .contains("speed")
    );
    assert!(
        refused(Settings {
            false_alarm_probability: 0.0,
            ..ok
        })
        .contains("false alarm")
    );
    assert!(
        refused(Settings {
            memory_bytes: 1 << 20,
            ..ok
        })
        .contains("bytes")
    );
}
