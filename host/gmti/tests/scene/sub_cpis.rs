//! Targets of any velocity, integrated over sub-CPIs along their motion.

use std::sync::OnceLock;

use glam::DVec3;
use subaperture_gmti::adaptive::{Performance, Statistic, TargetModel, mean_sinr_loss};
use subaperture_gmti::space_time::{
    Calibration, Motion, Mover, Settings, SpaceTime, Training, find,
};
use subaperture_gmti::{Alignment, GmtiError, balance, detection};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{Channels, Collection};

use crate::counts::Counts;
use crate::recording::{
    Errors, FOUR, STRIP_GRID, THREE, TWO, Truth, Uniform, imaging, impaired, moving_clutter,
    number_of_scenes, recorded, scenario_of_movers, scene, scene_of_seed, scene_with, with_movers,
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

fn movers(channels: &Channels, grid: &str, settings: &Settings) -> Vec<Mover> {
    let alignment = aligned(channels);
    let grid: ImageGrid = grid.parse().unwrap();
    let imaging = imaging(&grid);
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

/// Counts of detections over sub-CPIs.
fn counts() -> Counts<4> {
    Counts::new(["x", "y", "velocity along x", "velocity along y"])
}

/// Errors of a target near a mover: position and velocity along x and y.
fn errors_of((place, velocity, _): &Truth, mover: &Mover) -> Option<[f64; 4]> {
    let (p, v) = (mover.motion.at(MIDDLE_S), mover.motion.velocity_m_s);
    let near = (p.y - place[1]).abs() < 1.5
        && (p.x - place[0]).abs() < 15.0
        && (v.y - velocity[1]).abs() < 1.0;
    let found = [p.x, p.y, v.x, v.y];
    let truth = [place[0], place[1], velocity[0], velocity[1]];
    let error = |k: usize| (found[k] - truth[k]) / mover.covariance[k][k].sqrt();
    near.then(|| [0, 1, 2, 3].map(error))
}

/// Random movers at these ranges, of 0.5 to 29 m/s across the track and 0.5 to 5 m^2.
fn random_movers(random: &mut Uniform, ranges_m: impl Iterator<Item = f64>) -> Vec<Truth> {
    let mover = |y: f64| {
        let mut uniform = |low, high| random.between(low, high);
        let place = [uniform(-50.0, 50.0), y];
        let speed = uniform(0.5, 29.0) * if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        (place, [uniform(-15.0, 15.0), speed], uniform(0.5, 5.0))
    };
    ranges_m.map(mover).collect()
}

/// Twenty movers of 0.5 to 29 m/s in each scene, seen by an array at a crab angle of 5 degrees with errors of gain and phase. Number of scenes: `SUBAPERTURE_SCENES`, 1 if it is not
/// set; number of receivers: `SUBAPERTURE_RECEIVERS`, 3 or 4.
#[test]
fn movers_of_any_velocity_are_within_their_covariances() {
    let scenes = number_of_scenes(1);
    let receivers: &[&str] = match std::env::var("SUBAPERTURE_RECEIVERS").as_deref() {
        Ok("4") => &FOUR,
        _ => &THREE,
    };
    let mut random = Uniform(5);
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
    let mut counts = counts();
    for seed in 0..scenes {
        let noise_db = [10.0, 0.0, 20.0][seed as usize % 3];
        let truths = random_movers(&mut random, (0..20).map(|i| -57.0 + 6.0 * f64::from(i)));
        let scenario = scenario_of_movers(300 + seed, &truths, receivers, noise_db);
        let recorded = recorded(&scenario.experiment().unwrap());
        let found = movers(&impaired(&recorded, &errors), GRID, &Settings::default());
        counts.add(seed, &truths, &found, errors_of);
    }
    counts.assert_covered();
    counts.assert_detected(98, scenes);
}

/// Clutter of the extent of the training cells: 9 resolution cells of a sub-CPI are 140 m along the track. Where training cells are beyond the end of moving clutter, the covariance is too small:
/// with clutter of 120 m x 30 m the statistic has a mean of 8 at the velocities of the clutter. Number of scenes: `SUBAPERTURE_SCENES`, 6 if it is not set.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn movers_of_any_velocity_are_detected_in_clutter_with_internal_motion() {
    let scenes = number_of_scenes(6);
    let scenario = moving_clutter(11, &[], [200.0, 30.0], 10.0);
    let clutter = recorded(&scenario.experiment().unwrap());
    let mut random = Uniform(6);
    let mut counts = counts();
    for scene in 0..scenes {
        let truths = random_movers(&mut random, (0..5).map(|i| -13.0 + 6.5 * f64::from(i)));
        let recorded = with_movers(&clutter, &truths);
        let found = movers(&recorded, STRIP_GRID, &Settings::default());
        counts.add(scene, &truths, &found, errors_of);
    }
    counts.assert_covered();
    // Movers near a blind velocity of a pair, 3.7 m/s and its multiples, may be missed or displaced.
    counts.assert_detected(85, 2 * scenes);
}

/// A car that brakes from 12 m/s at 4 m/s^2 across the track.
const BRAKING_CAR: &str = r#"
[[scene.mover]]
kind = "profile"
position = "0, -6, 0 m"
velocity = "0, 12, 0 m/s"
pieces = ["2 s, 0, -4, 0 m/s^2"]
cross_section = "5 m^2"
"#;

/// The braking car, and the same target with its mean velocity.
#[test]
fn braking_target_is_integrated_under_its_acceleration() {
    let recorded = recorded(&scene_with(11, &[], BRAKING_CAR, &THREE, 10.0));
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

/// A mover 60 m beyond the end of the grid along the track, at other velocities in the grid by its range and Doppler, and a weak one within.
#[test]
fn targets_outside_of_the_grid_are_removed_and_not_reported() {
    let outside = ("120, 10, 0 m", "2, 6, 0 m/s", "5 m^2");
    let inside = ("-20, -30, 0 m", "-3, -4, 0 m/s", "0.5 m^2");
    let recorded = recorded(&scene(&[outside, inside], &THREE, 10.0));
    let found = movers(&recorded, GRID, &Settings::default());
    for mover in &found {
        println!(
            "{:.1} dB: {:.2?}",
            db(mover.integrated.coherent),
            mover.motion
        );
    }
    assert_eq!(found.len(), 1);
    let away_m = found[0].motion.at(MIDDLE_S) - DVec3::new(-20.0, -30.0, 0.0);
    let sigma_m = [0, 1].map(|i| found[0].covariance[i][i].sqrt());
    assert!(
        away_m.x.abs() < 4.0 * sigma_m[0] && away_m.y.abs() < 4.0 * sigma_m[1],
        "{away_m}"
    );
}

/// A car that brakes at 4 m/s^2 across the track, found among accelerations to 5 m/s^2.
#[test]
fn accelerating_targets_are_found() {
    let recorded = recorded(&scene_with(11, &[], BRAKING_CAR, &THREE, 10.0));
    let settings = Settings {
        max_acceleration_m_s2: 5.0,
        ..Settings::default()
    };
    let grid: ImageGrid = GRID.parse().unwrap();
    let imaging = imaging(&grid);
    let detection = detection::Settings::default();
    let targets = subaperture_gmti::find(&recorded, &imaging, &detection, Some(&settings)).unwrap();
    let [best] = &targets.targets[..] else {
        panic!("{:?}", targets.targets);
    };
    println!("{best:.3?}");
    let truth = Motion {
        epoch_s: 0.0,
        acceleration_m_s2: DVec3::new(0.0, -4.0, 0.0),
        ..motion([0.0, -6.0], [0.0, 12.0])
    };
    let away_m = DVec3::from(best.position_m.unwrap()) - truth.at(best.time_s);
    println!("{away_m} m away");
    assert!(away_m.x.abs() < 0.5 && away_m.y.abs() < 0.1, "{away_m}");
    // The car has no cross-range velocity, as is assumed.
    assert!((best.acceleration_m_s2.unwrap()[1] + 4.0).abs() < 0.05);
    let chips = targets.refocus(&recorded, &imaging, 32).unwrap();
    let peak = chips[0]
        .image
        .pixels
        .iter()
        .map(|z| z.norm_sqr())
        .fold(0.0, f32::max);
    let level_db = db(f64::from(peak) / 5.0);
    println!("refocused to {level_db:.2} dB of its cross-section");
    // Between pixels of half the resolution, 0.5 dB, and the clutter.
    assert!(level_db.abs() < 1.0, "{level_db}");
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
        let found = movers(&recorded, GRID, &settings);
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
