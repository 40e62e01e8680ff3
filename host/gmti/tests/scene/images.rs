//! Moving targets in simulated clutter: cancellation, velocities and positions, with and without errors of the channels.

use glam::DVec3;
use subaperture_focus::Numerics;
use subaperture_focus::formers::auto::Auto;
use subaperture_gmti::detection::{Settings, detect};
use subaperture_gmti::tracker::Detection;
use subaperture_gmti::{GmtiError, Imaging, MovingTargets, Target, find};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::Channels;
use subaperture_signal::window::Window;

use crate::recording::{Errors, THREE, TWO, Uniform, impaired, recorded, scene, scene_of_movers};

const GRID: &str = "x=-60:60:0.3,y=-60:60:0.5,z=0";

fn imaging(grid: &ImageGrid) -> Imaging<'_> {
    Imaging {
        former: &Auto { error_db: -60.0 },
        grid,
        windows: [Window::default(); 2],
        memory_bytes: 1 << 30,
        numerics: Numerics::default(),
        monitor: &Silent,
    }
}

fn targets(channels: &Channels) -> Result<MovingTargets, GmtiError> {
    let grid: ImageGrid = GRID.parse().unwrap();
    let imaging = imaging(&grid);
    find(channels, &imaging, &Settings::default(), None)
}

/// Radial velocity of a target that moves across the track at the middle of the aperture, m/s.
fn radial_m_s(y_m: f64, velocity_m_s: f64) -> f64 {
    let ground_m = 5000.0 + y_m;
    -velocity_m_s * ground_m / ground_m.hypot(1000.0)
}

/// Assert that a target of `found` is at this place with this velocity across the track, within four standard deviations.
fn assert_found(found: &MovingTargets, [x, y]: [f64; 2], velocity_m_s: f64) {
    let expected_m_s = radial_m_s(y, velocity_m_s);
    let near = |place: &[f64; 3]| (place[1] - y).abs() < 1.0 && (place[0] - x).abs() < 8.0;
    let target = found
        .targets
        .iter()
        .find(|target| target.position_m.as_ref().is_some_and(near));
    let target = target.unwrap_or_else(|| panic!("no target at {x}, {y}: {:#?}", found.targets));
    let error_m_s = target.radial_velocity_m_s - expected_m_s;
    println!(
        "{x}, {y}: {:?}, velocity error {error_m_s:.4} of {expected_m_s:.3} m/s, sigma {:.4}, SNR {:.1} dB",
        target.position_m.unwrap(),
        target.velocity_deviation_m_s,
        target.snr_db
    );
    assert!(
        error_m_s.abs() < 4.0 * target.velocity_deviation_m_s,
        "{target:#?}"
    );
    let [[xx, _], _] = target.covariance_m2.unwrap();
    // An error of the radial velocity moves the position along x by -R / V times it; R at the middle of the aperture within 2 %.
    let lever_s = DVec3::new(x, y + 5000.0, 1000.0).length() / 125.0;
    let expected = -lever_s * target.velocity_deviation_m_s.powi(2);
    let [covariance, _] = target.position_velocity_covariance.unwrap();
    assert!(
        (covariance / expected - 1.0).abs() < 0.02,
        "{covariance} {expected}"
    );
    let detection = Detection::of(target).unwrap();
    // The place in the image has an error too.
    assert!(detection.covariance[0][0] > 0.98 * (lever_s * expected).abs());
    assert!(
        (target.position_m.unwrap()[0] - x).abs() < 4.0 * xx.sqrt() + 0.5,
        "{target:#?}"
    );
}

/// The residual of two channels is their noise: the ratio is `1 + CNR`, with the noise of a pixel computed from the windows.
#[test]
fn two_channels_cancel_clutter_to_the_noise() {
    let experiment = scene(&[("0, 0, 0 m", "0, 1, 0 m/s", "5 m^2")], &TWO, -10.0);
    let channels = recorded(&experiment);
    let found = targets(&channels).unwrap();
    let pixels = &found.images.images[0].pixels;
    let power = pixels.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / pixels.len() as f64;
    let part = |count: usize| {
        let weights = Window::default().weights(count);
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        squares / weights.iter().sum::<f64>().powi(2)
    };
    let noise = 0.1 * part(200) * part(1040);
    let expected_db = 10.0 * (power / noise).log10();
    let got = found.images.cancellation(1);
    println!(
        "cancellation {:.2} dB, expected {expected_db:.2} dB",
        got.ratio_db
    );
    // The median over blocks, and the error of the images.
    assert!(
        (got.ratio_db - expected_db).abs() < 1.5,
        "{got:?} {expected_db}"
    );
    assert_eq!(found.targets.len(), 1, "{:#?}", found.targets);
    assert_found(&found, [0.0, 0.0], 1.0);
    // SINR by the noise of two channels, and the velocity at which a fluctuating target is detected in half of all cases: with many training cells
    // `Pd = Pfa^(1 / (1 + SINR))`.
    let sensitivity = found.sensitivity(&Settings::default(), 1e-3).unwrap();
    let sinr = |velocity_m_s: f64| {
        let phase_rad = 4.0 * std::f64::consts::PI * velocity_m_s * 0.002 / 0.029979;
        1e-3 * 4.0 * (phase_rad / 2.0).sin().powi(2) / (2.0 * noise)
    };
    for at in &sensitivity.curve[8..] {
        let expected_db = 10.0 * sinr(at.velocity_m_s).log10();
        assert!(
            (at.sinr_db - expected_db).abs() < 0.5,
            "{at:?} {expected_db}"
        );
    }
    let mdv_m_s = sensitivity.mdv_m_s.unwrap();
    let detection = 1e-6f64.powf(1.0 / (1.0 + sinr(mdv_m_s)));
    println!("MDV {mdv_m_s:.4} m/s, probability of detection {detection:.3}");
    assert!((detection - 0.5).abs() < 0.05, "{mdv_m_s} {detection}");
    // A baseline of 0.25 m of the phase centres at 125 m/s.
    assert!((found.alignment.lags_s()[1] - 0.002).abs() < 1e-9);
    assert!((found.targets[0].velocity_ambiguity_m_s - 7.495).abs() < 0.001);
}

#[test]
fn errors_of_three_channels_are_measured_and_removed() {
    let movers = [
        ("0, 0, 0 m", "0, 1, 0 m/s", "5 m^2"),
        ("20, 20, 0 m", "0, -0.5, 0 m/s", "5 m^2"),
        ("-20, -40, 0 m", "0, -1.5, 0 m/s", "10 m^2"),
        ("30, -20, 0 m", "0, 0.8, 0 m/s", "2 m^2"),
    ];
    let experiment = scene(&movers, &THREE, 10.0);
    let channels = recorded(&experiment);
    let crab_rad = 5f64.to_radians();
    let errors = [
        Errors::default(),
        Errors {
            gain_db: 1.0,
            phase_deg: 10.0,
            delay_s: 0.5e-9,
            displaced_m: DVec3::new(0.0, -0.4 * crab_rad, 0.0),
        },
        Errors {
            gain_db: -1.0,
            phase_deg: -120.0,
            delay_s: -1e-9,
            displaced_m: DVec3::new(0.0, -crab_rad, 0.0),
        },
    ];
    let found = targets(&impaired(&channels, &errors)).unwrap();
    for (c, errors) in errors.iter().enumerate().skip(1) {
        let (balance, model) = (found.images.balances[c], found.images.models[c - 1]);
        let gain_db = 20.0 * (balance.gain * model.gain).log10();
        // The part of the displacement along the line of sight is a delay too.
        let sight = DVec3::new(0.0, 5.0, -1.0).normalize();
        let delay_s = errors.delay_s + errors.displaced_m.dot(sight) / 299_792_458.0;
        let crab_deg = found.crab_rad(c).unwrap().to_degrees();
        println!(
            "gain {gain_db:.4} dB, delay {:.4e} of {delay_s:.4e} s, crab {crab_deg:.2} deg",
            balance.delay_s
        );
        assert!((gain_db - errors.gain_db).abs() < 0.02, "{gain_db}");
        assert!((balance.delay_s - delay_s).abs() < 5e-12, "{balance:?}");
        assert!((crab_deg + 5.0).abs() < 1.0, "{crab_deg}");
        assert!(found.images.cancellation(c).ratio_db > 35.0);
    }
    assert_eq!(found.targets.len(), movers.len(), "{:#?}", found.targets);
    assert_found(&found, [0.0, 0.0], 1.0);
    assert_found(&found, [20.0, 20.0], -0.5);
    assert_found(&found, [-20.0, -40.0], -1.5);
    assert_found(&found, [30.0, -20.0], 0.8);
}

/// The refocused target has its amplitude at its place; in the image of the scene it is displaced.
#[test]
fn refocused_target_is_at_its_place() {
    let experiment = scene(&[("10, 20, 0 m", "3, 1, 0 m/s", "200 m^2")], &THREE, 10.0);
    let channels = recorded(&experiment);
    let grid: ImageGrid = GRID.parse().unwrap();
    let found = targets(&channels).unwrap();
    let chips = found.refocus(&channels, &imaging(&grid), 64).unwrap();
    assert_eq!(chips.len(), 1);
    let mut image = found.images.images[0].clone();
    let before = image.clone();
    chips[0].put_into(&mut image);
    let brightest = |image: &Image| {
        let powers = image.pixels.iter().map(|z| z.norm_sqr()).enumerate();
        let (at, power) = powers.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        (
            grid.position_m(at / image.columns, at % image.columns),
            power,
        )
    };
    let (displaced_m, _) = brightest(&before);
    let (place_m, power) = brightest(&image);
    println!("{displaced_m:.1} m in the image, {place_m:.1} m refocused, {power:.1} m^2");
    assert!((displaced_m - place_m).length() > 20.0, "{displaced_m}");
    // Half a pixel, and the deviation of the position.
    let [[xx, _], _] = found.targets[0].covariance_m2.unwrap();
    assert!(
        (place_m.x - 10.0).abs() < 0.3 + 4.0 * xx.sqrt() && (place_m.y - 20.0).abs() < 0.5,
        "{place_m}"
    );
    // Scalloping between pixels of half a cell, and clutter.
    assert!((140.0..230.0).contains(&power), "{power}");
}

/// A target with two thirds of the power of all clutter.
#[test]
fn dominant_mover_does_not_bias_the_balance() {
    let experiment = scene(
        &[("-20, 40, 0 m", "0, -1.5, 0 m/s", "3000 m^2")],
        &THREE,
        10.0,
    );
    let channels = recorded(&experiment);
    let found = targets(&channels).unwrap();
    assert_found(&found, [-20.0, 40.0], -1.5);
    assert!(found.images.cancellation(1).ratio_db > 34.0);
}

/// Pixels of clutter without targets. The bound on the maximum over velocities has a slack of 1.5 with these lags.
#[test]
fn false_alarms_have_the_requested_probability() {
    for (receivers, least) in [(&TWO[..], 0.8), (&THREE[..], 0.4)] {
        let experiment = scene(&[], receivers, 10.0);
        let channels = recorded(&experiment);
        let found = targets(&channels).unwrap();
        let settings = Settings {
            false_alarm_probability: 1e-2,
            ..Settings::default()
        };
        let map = detect(&found.images, &found.alignment, &settings).unwrap();
        let count = map.detected.iter().filter(|&&detected| detected).count();
        let measured = count as f64 / map.detected.len() as f64;
        // Of 12000 independent cells: a standard deviation of 9 %.
        let ratio = measured / settings.false_alarm_probability;
        println!(
            "{} channels: {ratio:.3} of the requested probability",
            receivers.len()
        );
        assert!((least..1.27).contains(&ratio), "{ratio}");
    }
}

#[test]
fn faulty_channels_are_named() {
    let experiment = scene(&[], &TWO, 10.0);
    let channels = recorded(&experiment);
    let fault = |errors: [Errors; 2]| {
        let error = targets(&impaired(&channels, &errors)).unwrap_err();
        println!("{error}");
        error
    };
    let ok = Errors::default();
    let dead = Errors {
        gain_db: -1e9,
        ..ok
    };
    assert!(matches!(fault([ok, dead]), GmtiError::Dead { channel } if channel == "T1R2"));
    assert!(matches!(fault([dead, ok]), GmtiError::Dead { channel } if channel == "T1R1"));
    let moved = |x: f64| Errors {
        displaced_m: DVec3::new(x, 0.0, 0.0),
        ..ok
    };
    assert!(matches!(
        fault([moved(-0.5), moved(0.5)]),
        GmtiError::Exchanged { .. }
    ));
    // Receivers at the same position along the track.
    assert!(matches!(
        fault([moved(-0.25), moved(0.25)]),
        GmtiError::NoBaseline { .. }
    ));
    // The first channel alone, and with a channel of another scene.
    let alone = channels.select(&["T1R1"]).unwrap();
    assert!(matches!(
        targets(&alone).unwrap_err(),
        GmtiError::Channels { found: 1 }
    ));
    let other = scene(&[], &TWO, 60.0);
    let other = recorded(&other).select(&["T1R2"]).unwrap();
    let both = alone
        .into_inner()
        .into_iter()
        .chain(other.into_inner())
        .collect();
    let error = targets(&Channels::new(both).unwrap()).unwrap_err();
    println!("{error}");
    assert!(matches!(error, GmtiError::Incoherent { .. }));
}

/// Scenes with random movers: probability of detection, false targets, and errors in units of the stated standard deviations. Number of scenes:
/// `SUBAPERTURE_SCENES`, 2 if it is not set.
#[test]
fn errors_of_random_movers_are_within_their_covariances() {
    let scenes: u64 = std::env::var("SUBAPERTURE_SCENES").map_or(2, |text| text.parse().unwrap());
    let mut random = Uniform(1);
    let mut uniform = |low, high| random.between(low, high);
    let (mut total, mut found_count, mut false_count) = (0, 0, 0);
    let mut errors: [Vec<f64>; 3] = Default::default();
    for seed in 0..scenes {
        let noise_db = [0.0, 10.0, 20.0][seed as usize % 3];
        let mut movers = Vec::new();
        for i in 0..8 {
            // Ranges apart, so that no target is on the range line of another.
            let y = -52.0 + 14.0 * f64::from(i);
            let speed = uniform(0.3, 1.3) * if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            // The image is within the grid.
            let image_m = -40.0 * speed;
            let x = uniform((-45.0 - image_m).max(-45.0), (45.0 - image_m).min(45.0));
            let along = uniform(-3.0, 3.0);
            movers.push(([x, y], [along, speed], uniform(3.0, 20.0)));
        }
        let experiment = scene_of_movers(100 + seed, &movers, &THREE, noise_db);
        let channels = recorded(&experiment);
        let found = targets(&channels).unwrap();
        total += movers.len();
        let mut left: Vec<_> = found.targets.iter().collect();
        for ([x, y], [along, speed], _) in movers {
            let near = |target: &&Target| {
                let [px, py, _] = target.position_m.unwrap();
                (py - y).abs() < 1.5 && (px - x).abs() < 10.0
            };
            let Some(i) = left.iter().position(near) else {
                println!("scene {seed}: missed {x:.1}, {y} at {along:.2}, {speed:.2} m/s");
                continue;
            };
            let target = left.remove(i);
            found_count += 1;
            let sight = DVec3::new(x, y, 0.0) - DVec3::new(0.0, -5000.0, 1000.0);
            let radial_m_s = -sight.normalize().dot(DVec3::new(along, speed, 0.0));
            let [px, ..] = target.position_m.unwrap();
            let across = target.cross_range.unwrap();
            errors[0]
                .push((target.radial_velocity_m_s - radial_m_s) / target.velocity_deviation_m_s);
            errors[1].push((px - x) / target.covariance_m2.unwrap()[0][0].sqrt());
            errors[2].push((across.velocity_m_s - along) / across.deviation_m_s);
        }
        false_count += left.len();
        for target in left {
            println!(
                "scene {seed}: false {:?} in the image at {:?} {:.3} m/s, SNR {:.1} dB",
                target.position_m,
                target.image_position_m,
                target.radial_velocity_m_s,
                target.snr_db
            );
        }
    }
    println!("detected {found_count} of {total}, {false_count} false");
    // Targets on the line of a much stronger one are taken for its side lobes; side lobes of strong targets add to noise.
    assert!(100 * found_count >= 99 * total, "{found_count} of {total}");
    assert!(
        false_count <= scenes as usize,
        "{false_count} in {scenes} scenes"
    );
    for (name, errors) in ["radial velocity", "position", "cross-range velocity"]
        .iter()
        .zip(&errors)
    {
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        let inside = errors.iter().filter(|e| e.abs() < 1.96).count() as f64 / errors.len() as f64;
        println!(
            "{name}: RMS {rms:.2} sigma, {:.1} % within 1.96 sigma, {:.2?}",
            100.0 * inside,
            errors.iter().take(16).collect::<Vec<_>>()
        );
        // 95 % of all errors; of 16, at least 12 with a probability of 99.9 %.
        assert!(inside > 0.74, "{name}: {inside}");
    }
}
