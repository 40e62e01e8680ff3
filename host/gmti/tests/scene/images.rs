//! Moving targets in simulated clutter: cancellation, velocities and positions, with and without errors of the channels.

use glam::DVec3;
use subaperture_gmti::detection::{Settings, detect};
use subaperture_gmti::tracker::Detection;
use subaperture_gmti::{GmtiError, MovingTargets, Target, find};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::phase_history::Channels;
use subaperture_signal::window::Window;

use crate::counts::Counts;
use crate::recording::{
    Errors, SPREAD_M_S, THREE, TWO, Truth, Uniform, imaging, impaired, number_of_scenes, recorded,
    scenario_of_movers, scene, strip, strip_of_seed, with_movers,
};

const GRID: &str = "x=-60:60:0.3,y=-60:60:0.5,z=0";

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

/// Mean power of the pixels of the first channel.
fn mean_power(found: &MovingTargets) -> f64 {
    let pixels = &found.images.images[0].pixels;
    pixels.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / pixels.len() as f64
}

/// Noise power of a pixel, for noise of unit power in 200 frequencies and 1040 pulses, from the windows.
fn noise_of_pixel() -> f64 {
    let part = |count: usize| {
        let weights = Window::default().weights(count);
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        squares / weights.iter().sum::<f64>().powi(2)
    };
    part(200) * part(1040)
}

/// The residual of two channels is their noise: the ratio is `1 + CNR`, with the noise of a pixel computed from the windows.
#[test]
fn two_channels_cancel_clutter_to_the_noise() {
    let experiment = scene(&[("0, 0, 0 m", "0, 1, 0 m/s", "5 m^2")], &TWO, -10.0);
    let channels = recorded(&experiment);
    let found = targets(&channels).unwrap();
    let power = mean_power(&found);
    let noise = 0.1 * noise_of_pixel();
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
        // Of 9200 independent cells: a standard deviation of 10 %.
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

/// Counts of detections in images.
fn counts() -> Counts<4> {
    Counts::new([
        "radial velocity",
        "position along the track",
        "position across the track",
        "cross-range velocity",
    ])
}

/// Errors of a target near a mover: radial velocity, position along x and y, and cross-range velocity.
fn errors_of(&([x, y], [along, speed], _): &Truth, target: &Target) -> Option<[f64; 4]> {
    let [px, py, _] = target.position_m.unwrap();
    let near = (py - y).abs() < 1.5 && (px - x).abs() < 10.0;
    let sight = DVec3::new(x, y, 0.0) - DVec3::new(0.0, -5000.0, 1000.0);
    let radial_m_s = -sight.normalize().dot(DVec3::new(along, speed, 0.0));
    near.then(|| {
        let across = target.cross_range.unwrap();
        let [[xx, _], [_, yy]] = target.covariance_m2.unwrap();
        [
            (target.radial_velocity_m_s - radial_m_s) / target.velocity_deviation_m_s,
            (px - x) / xx.sqrt(),
            (py - y) / yy.sqrt(),
            (across.velocity_m_s - along) / across.deviation_m_s,
        ]
    })
}

/// Random movers at these ranges, of 0.3 to 1.3 m/s and 3 to 20 m^2, whose images are within the grid.
fn slow_movers(random: &mut Uniform, ranges_m: impl Iterator<Item = f64>) -> Vec<Truth> {
    let mover = |y: f64| {
        let mut uniform = |low, high| random.between(low, high);
        let speed = uniform(0.3, 1.3) * if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let image_m = -40.0 * speed;
        let x = uniform((-45.0 - image_m).max(-45.0), (45.0 - image_m).min(45.0));
        let along = uniform(-3.0, 3.0);
        ([x, y], [along, speed], uniform(3.0, 20.0))
    };
    ranges_m.map(mover).collect()
}

/// Random movers at ranges apart, so that no target is on the range line of another.
fn movers_at_ranges_apart(random: &mut Uniform) -> Vec<Truth> {
    slow_movers(random, (0..8).map(|i| -52.0 + 14.0 * f64::from(i)))
}

/// Targets of 42 to 55 dB over the noise. Other targets in their training cells lower the SNR of the map by up to 21 dB, but not that of all side lobes.
#[test]
fn side_lobes_of_targets_near_strong_ones_are_left_out() {
    let mut random = Uniform(1);
    let movers = (0..13).map(|_| movers_at_ranges_apart(&mut random)).last();
    let movers = movers.unwrap();
    let scenario = scenario_of_movers(112, &movers, &THREE, 0.0);
    let channels = recorded(&scenario.experiment().unwrap());
    let found = targets(&channels).unwrap();
    println!("{} side lobes", found.side_lobes);
    let mut counts = counts();
    counts.add(0, &movers, &found.targets, errors_of);
    counts.assert_detected(100, 0);
    assert!(found.side_lobes > 0);
}

/// Scenes with random movers: probability of detection, false targets, and errors in units of the stated standard deviations. Number of scenes:
/// `SUBAPERTURE_SCENES`, 2 if it is not set.
#[test]
fn errors_of_random_movers_are_within_their_covariances() {
    let scenes = number_of_scenes(2);
    let mut random = Uniform(1);
    let mut counts = counts();
    for seed in 0..scenes {
        let noise_db = [0.0, 10.0, 20.0][seed as usize % 3];
        let movers = movers_at_ranges_apart(&mut random);
        let scenario = scenario_of_movers(100 + seed, &movers, &THREE, noise_db);
        let channels = recorded(&scenario.experiment().unwrap());
        let found = targets(&channels).unwrap();
        counts.add(seed, &movers, &found.targets, errors_of);
    }
    counts.assert_covered();
    // Targets on the line of a much stronger one are taken for its side lobes. 9,200 cells with a false alarm probability of 1e-6 have 0.009 false targets in a scene; more on the range lines of strong targets, whose side lobes add to noise.
    counts.assert_detected(99, scenes.div_ceil(10));
}

/// Grid within a strip. A scatterer of 0.3 m/s, three standard deviations, appears 12 m from its place: clutter that ended at the edge of the grid would have a mean velocity there.
const MIDDLE_GRID: &str = "x=-48:48:0.3,y=-15:15:0.5,z=0";

/// Targets of a strip.
fn targets_of_strip(channels: &Channels) -> MovingTargets {
    let grid: ImageGrid = MIDDLE_GRID.parse().unwrap();
    find(channels, &imaging(&grid), &Settings::default(), None).unwrap()
}

/// Internal clutter motion of 0.1 m/s. A scatterer of radial velocity `v` is displaced by `R v / V`, up to 4 m at one standard deviation: each pixel sums scatterers of all velocities, and
/// the coherence over a lag is that of the ensemble, `exp(-8 pi^2 sigma_v^2 tau^2 / lambda^2)`, times `CNR / (1 + CNR)`.
#[test]
fn internal_motion_limits_cancellation_as_by_theory() {
    let found = targets_of_strip(strip());
    let power = mean_power(&found);
    let noise = 10.0 * noise_of_pixel();
    for c in 1..3 {
        let tau_s = found.alignment.lags_s()[c];
        let turns = SPREAD_M_S * tau_s / 0.029_979_245_8;
        let motion = (-8.0 * (std::f64::consts::PI * turns).powi(2)).exp();
        let coherence = motion * (1.0 - noise / power);
        let expected_db = -10.0 * (1.0 - coherence).log10();
        let got = found.images.cancellation(c);
        println!(
            "lag {:.1} ms: cancellation {:.2} dB, expected {expected_db:.2} dB; coherence {:.5}, expected {coherence:.5}",
            1e3 * tau_s,
            got.ratio_db,
            got.coherence
        );
        // Median over 100 blocks of 50 independent cells: a standard deviation of 20 % in each, and 2.5 % of the median; the median of the ratio is 1 % above the mean. Three standard deviations
        // and the bias are 0.4 dB.
        assert!((got.ratio_db - expected_db).abs() < 0.4, "{got:?}");
    }
}

/// Number of scenes: `SUBAPERTURE_SCENES`, 12 if it is not set. Each 40 have clutter of their own.
#[test]
fn slow_movers_are_detected_in_clutter_with_internal_motion() {
    let scenes = number_of_scenes(12);
    let mut random = Uniform(7);
    let mut counts = counts();
    let mut clutter = None;
    for scene in 0..scenes {
        let movers = slow_movers(&mut random, (0..4).map(|i| -12.0 + 8.0 * f64::from(i)));
        if scene > 0 && scene % 40 == 0 {
            clutter = Some(strip_of_seed(11 + scene));
        }
        let channels = with_movers(clutter.as_ref().unwrap_or(strip()), &movers);
        let found = targets_of_strip(&channels);
        counts.add(scene, &movers, &found.targets, errors_of);
    }
    counts.assert_covered();
    counts.assert_detected(98, scenes.div_ceil(16));
}
