//! Odometer of the core, from samples: against the true track, against the host's on the same recording, and bit by bit.

use glam::DVec2;
use subaperture::motion::{self as host, Heading};
use subaperture::targets;
use subaperture_core::motion::{
    Antennas, Odometer, Progress, SampleError, Setup, SetupError, Step,
};
use subaperture_core::selftest::OdometerSelfTest;
use subaperture_tests::odometer_scene::{
    BINS, FREQUENCIES, STEP_HZ, Scene, between, pose, setup, wavelength_m,
};

/// Changes only if the arithmetic changes: find the reason, then update the value.
const CHECKSUM: u32 = 0x1b04_56da;

type Small = Odometer<8, 4, FREQUENCIES, BINS>;

/// Work until idle. Returns the resulting step.
fn drain(odometer: &mut Small) -> Option<Step> {
    let mut reported = None;
    // At most the possible number of steps.
    for _ in 0..100 {
        match odometer.work() {
            Progress::Idle => return reported,
            Progress::Busy => {}
            Progress::Step(step) => assert_eq!(reported.replace(step), None),
        }
    }
    panic!("the work does not end")
}

fn push(odometer: &mut Small, scene: &Scene, n: usize) -> Option<Step> {
    for (c, samples) in scene.pulse(n).into_iter().enumerate() {
        let samples = samples.into_iter();
        odometer
            .push(n as u32, c, scene.reference_path_m, samples)
            .unwrap();
    }
    drain(odometer)
}

fn started(scene: &Scene) -> Box<Small> {
    let mut odometer = Box::new(Small::new());
    odometer.configure(&setup(), &scene.antennas()).unwrap();
    assert_eq!(odometer.channels(), scene.channels());
    assert!(odometer.start(0));
    odometer
}

fn steps(scene: &Scene, pulses: usize) -> Vec<Step> {
    let mut odometer = started(scene);
    let each = (0..pulses).map(|n| push(&mut odometer, scene, n).expect("a step a pulse"));
    each.collect()
}

/// The host's increments, indexed by the later pulse, with the same detector settings, and targets subtracted with one path for all channels as in the
/// core.
fn on_host(scene: &Scene, pulses: usize) -> Vec<Option<host::pairwise::MotionEstimate>> {
    let reported = setup();
    let settings = targets::Settings {
        cfar: targets::cfar::Cfar {
            guard: reported.guard.into(),
            training: reported.training.into(),
            level: targets::cfar::Level::Ordered(reported.rank),
            ..targets::cfar::Cfar::default()
        },
        ranges_m: Some((reported.ranges_m[0], reported.ranges_m[1])),
        subtraction: targets::Subtraction::Common,
        ..targets::Settings::default()
    };
    let silent = subaperture::monitor::Silent;
    let seen = targets::detect_targets(scene.channels_of(pulses), &settings, &silent).unwrap();
    let middle_m = seen.array.receivers_m[0].distance(DVec2::from_array(scene.receivers_m[0]));
    assert!(middle_m < 1e-9, "the host's frame is the scene's");
    let mut pairwise = host::Pairwise::new(seen.array.clone(), Heading::Estimated).unwrap();
    let each = seen.pulses.iter();
    each.map(|sightings| pairwise.push(sightings).unwrap_or(None))
        .collect()
}

/// RMS error of the steps' increments against the true track: along and ahead in metres, and rotation, from pulse `from` on.
fn off(steps: &[Step], from: usize) -> [f64; 3] {
    let mut sums = [0.0; 3];
    let mut count = 0.0;
    for step in &steps[from..] {
        let moved = step.moved.expect("targets enough").increment;
        let (true_m, true_rad) = between(pose(step.since as usize), pose(step.pulse as usize));
        let off = [
            moved.moved_m[0] - true_m[0],
            moved.moved_m[1] - true_m[1],
            moved.turn_rad - true_rad,
        ];
        sums.iter_mut().zip(off).for_each(|(sum, x)| *sum += x * x);
        count += 1.0;
    }
    sums.map(|sum| (sum / count).sqrt())
}

/// With two targets weights have no influence, so both must give the same: from float32 and float64 samples, by two
/// implementations that share no code.
///
/// Phases are sums of 64 float32 terms of up to 3 in 1, with other targets subtracted: 1e-6 of the parts, at most 1e-5 rad.
/// For two targets whose sines differ by 0.54 that is `1e-5 wavelength / (4 pi) 2 / 0.54` = 1e-8 m. A rotation is determined
/// by receivers half a wavelength apart: `1e-5 / pi`, times 4 for the part common to both directions.
#[test]
fn increments_match_host() {
    for snr_db in [25.0, 120.0] {
        let mut scene = Scene::new(2).with_snr_db(snr_db, 3);
        scene.reflectors.truncate(2);
        scene.reference_path_m = 7.3;
        let pulses = 60;
        let own = steps(&scene, pulses);
        let expected = on_host(&scene, pulses);
        let mut compared = 0;
        let mut most = [0.0f64; 2];
        for (step, expected) in own.iter().zip(&expected) {
            let (Some(moved), Some(expected)) = (step.moved, expected) else {
                continue;
            };
            assert_eq!((moved.targets, expected.targets), (2, 2));
            compared += 1;
            let off_m =
                DVec2::from_array(moved.increment.moved_m).distance(expected.increment.moved_m);
            let off_rad = (moved.increment.turn_rad - expected.increment.turn_rad).abs();
            most = [most[0].max(off_m), most[1].max(off_rad)];
        }
        println!("{snr_db} dB: {compared} of {pulses}, {most:?}");
        // A target is confirmed after five pulses.
        assert!(compared >= pulses - 6, "{compared}");
        assert!(most[0] < 1e-8 && most[1] < 2e-5, "{most:?}");
    }
}

/// Without noise the remaining error is that of the range from the centre of the antennas, `(antenna spacing)^2 / (2 range)` at
/// 2.4 m: 4e-5 of 0.7 mm, three times that for directions; for a rotation the same over the receivers' half wavelength. With
/// noise at 30 dB a phase has an error of 0.022 rad, a path between pulses of `0.022 wavelength / (2 pi)` in two channels, a
/// step of half of that over the spread of the sines, 0.35: 2e-5 m. The host, which detects targets itself and uses
/// float64, is no better.
#[test]
fn increments_match_true_motion() {
    let clean = off(&steps(&Scene::new(2), 40), 6);
    println!("{clean:?}");
    assert!(
        clean[0].hypot(clean[1]) < 8e-8 && clean[2] < 4e-5,
        "{clean:?}"
    );
    for receivers in [2, 4] {
        let scene = Scene::new(receivers).with_snr_db(30.0, 5);
        let own = steps(&scene, 80);
        let own_off = off(&own, 6);
        let expected = on_host(&scene, 80);
        let as_steps = own.iter().zip(&expected).map(|(step, expected)| Step {
            moved: step
                .moved
                .zip(expected.as_ref())
                .map(|(mut moved, expected)| {
                    moved.increment.moved_m = expected.increment.moved_m.to_array();
                    moved.increment.turn_rad = expected.increment.turn_rad;
                    moved
                }),
            ..*step
        });
        let host_off = off(&as_steps.collect::<Vec<_>>(), 6);
        println!("{receivers} receivers: {own_off:?}, on the host {host_off:?}");
        assert!(own_off[0] < 2.5e-5 && own_off[1] < 2.5e-5, "{own_off:?}");
        for (own, host) in own_off.iter().zip(host_off) {
            assert!(*own < 1.1 * host, "{own_off:?} {host_off:?}");
        }
        assert!(
            own[10..].iter().all(|step| step.targets == 4),
            "all four are seen"
        );
    }
}

/// Residual of a moving reflector, whose path change is not due to the radar's motion.
#[test]
fn residual_reveals_moving_target() {
    let mut odometer = started(&Scene::new(2));
    let mut residuals_m = [0.0f64; 2];
    for n in 0..60usize {
        let mut scene = Scene::new(2).with_snr_db(40.0, 2);
        let moving = n >= 40;
        // From pulse 40 on 0.2 mm per pulse towards the radar.
        scene.reflectors[1].0[1] -= 2e-4 * f64::from(n.saturating_sub(40) as u32);
        let step = push(&mut odometer, &scene, n).unwrap();
        if let (Some(moved), false) = (step.moved, n == 40) {
            let most = &mut residuals_m[usize::from(moving)];
            *most = match moving {
                true => moved.residual_m,
                false => most.max(moved.residual_m),
            };
        }
    }
    // A path that is 0.4 mm too short is distributed over four targets, with two fitted parameters.
    let [still, moving] = residuals_m;
    assert!(still < 3e-5 && moving > 1e-4, "{residuals_m:?}");
}

#[test]
fn lost_pulses_and_channels_are_bridged_over() {
    let scene = Scene::new(2);
    let mut odometer = started(&scene);
    let mut reported = Vec::new();
    for n in 0..40 {
        match n {
            // Pulse lost entirely.
            20 => {}
            // One channel lost, and later received twice.
            25 => {
                let samples = &scene.pulse(n)[1];
                let again = || samples.iter().copied();
                assert_eq!(odometer.push(25, 1, 0.0, again()), Ok(()));
                assert_eq!(
                    odometer.push(25, 1, 0.0, again()),
                    Err(SampleError::Repeated)
                );
                assert_eq!(
                    odometer.push(24, 0, 0.0, again()),
                    Err(SampleError::Repeated)
                );
                assert_eq!(drain(&mut odometer), None);
            }
            // NaN.
            30 => {
                let mut samples = scene.pulse(n)[0].clone();
                samples[3].im = f32::NAN;
                let result = odometer.push(30, 0, 0.0, samples.into_iter());
                assert_eq!(result, Err(SampleError::NotFinite));
                assert_eq!(drain(&mut odometer), None);
            }
            _ => reported.extend(push(&mut odometer, &scene, n)),
        }
    }
    assert_eq!(reported.len(), 37);
    assert_eq!(odometer.incomplete(), 2);
    for pair in reported.windows(2) {
        assert_eq!(pair[1].since, pair[0].pulse);
    }
    let clean = off(&reported, 6);
    // As without gaps, for steps of up to twice the length.
    assert!(clean[0].hypot(clean[1]) < 1.6e-7, "{clean:?}");
}

#[test]
fn hidden_target_keeps_its_track() {
    let mut odometer = started(&Scene::new(2));
    let mut seen = Vec::new();
    for n in 0..50 {
        let mut scene = Scene::new(2).with_snr_db(30.0, 6);
        if (20..30).contains(&n) {
            scene.reflectors.truncate(3);
        }
        let step = push(&mut odometer, &scene, n).unwrap();
        seen.push((step.targets, step.moved.map(|moved| moved.targets)));
    }
    assert_eq!(seen[19], (4, Some(4)));
    assert!(
        seen[20..30].iter().all(|seen| *seen == (3, Some(3))),
        "{seen:?}"
    );
    assert_eq!(
        seen[30],
        (4, Some(3)),
        "seen at once, and compared from the next pulse on"
    );
    assert_eq!(seen[31], (4, Some(4)));
}

/// Noise peaks, as many cells as requested above the threshold: with 53 cells per pulse within the range limits, 21 in total. A
/// peak between bins that are one cell apart would be missed by such bins; four bins per cell up to double the number.
/// Poisson's deviation is 5 to 7, and for the order statistic a quarter more are expected under a window.
#[test]
fn noise_alone_gives_no_motion() {
    let mut scene = Scene::new(2).with_snr_db(0.0, 11);
    scene.reflectors.clear();
    let mut odometer = Box::new(Small::new());
    let pulses = 400;
    for rank in [0.0, 0.6] {
        let often = Setup {
            false_alarm_probability: 1e-3,
            least_snr_db: -100.0,
            rank,
            ..setup()
        };
        odometer.configure(&often, &scene.antennas()).unwrap();
        odometer.start(0);
        let mut echoes = 0;
        for n in 0..pulses {
            let step = push(&mut odometer, &scene, n).unwrap();
            echoes += usize::from(step.echoes);
            assert_eq!(step.moved, None);
        }
        println!("rank {rank}: {echoes} of {} cells", 53 * pulses);
        assert!((8..80).contains(&echoes), "{echoes}");
    }
}

/// The near range limit varies from just before a target to one bin nearer, so that its peak is first the first bin searched,
/// then one before it, which is counted as the last: it is detected at its range in both cases. The same holds for a target
/// just before the far limit.
#[test]
fn target_at_range_limit_is_detected() {
    let cell_m = 0.5 * 299_792_458.0 / (FREQUENCIES as f64 * STEP_HZ);
    let bin_m = cell_m * FREQUENCIES as f64 / BINS as f64;
    let scene = Scene::new(2);
    // Half of the two-way path to each antenna, to a tenth of a millimetre.
    let nearest_m = 0.9f64.hypot(2.25);
    for part in 0..12 {
        let before_m = 2e-3 + bin_m * f64::from(part) / 12.0;
        let own = Setup {
            ranges_m: [nearest_m - before_m, 9.0],
            ..setup()
        };
        let mut odometer = Box::new(Small::new());
        odometer.configure(&own, &scene.antennas()).unwrap();
        odometer.start(0);
        let all: Vec<Step> = (0..8)
            .map(|n| push(&mut odometer, &scene, n).unwrap())
            .collect();
        assert!(
            all.iter().all(|step| step.echoes == 4),
            "{before_m} {all:?}"
        );
        let off = off(&all, 6);
        assert!(off[0].hypot(off[1]) < 8e-8 && off[2] < 4e-5, "{off:?}");
    }
}

/// A pulse so strong that the power of its noise overflows, and the deviations of its echoes are not finite: the next motion is relative to the pulse before it, and states so.
#[test]
fn pulse_with_overflow_is_not_used_as_reference() {
    let scene = Scene::new(2).with_snr_db(20.0, 8);
    let own = Setup {
        least_snr_db: -999.0,
        ..setup()
    };
    let mut odometer = Box::new(Small::new());
    odometer.configure(&own, &scene.antennas()).unwrap();
    odometer.start(0);
    let mut reported = Vec::new();
    for n in 0..24u32 {
        let scale = if n == 16 { 4.5e18 } else { 1.0 };
        for (c, samples) in scene.pulse(n as usize).into_iter().enumerate() {
            let samples = samples.into_iter().map(|z| z * scale);
            odometer.push(n, c, 0.0, samples).unwrap();
        }
        reported.push(drain(&mut odometer).unwrap());
    }
    assert!(reported[16].moved.is_none() && reported[17].moved.is_some());
    assert_eq!(
        (reported[16].since, reported[17].since, reported[18].since),
        (15, 15, 17)
    );
    for step in &reported[8..] {
        let Some(moved) = step.moved else { continue };
        let (true_m, _) = between(pose(step.since as usize), pose(step.pulse as usize));
        let [x, y] = moved.increment.moved_m;
        // A step is 7e-4 m, its error about 6e-5 m.
        assert!((x - true_m[0]).hypot(y - true_m[1]) < 2.5e-4, "{step:?}");
    }
}

#[test]
fn invalid_settings_are_rejected() {
    let scene = Scene::new(2);
    let with = |change: &dyn Fn(&mut Setup)| {
        let mut own = setup();
        change(&mut own);
        Small::new().configure(&own, &scene.antennas())
    };
    assert_eq!(with(&|_| ()), Ok(()));
    let frequencies = |wanted| Err(SetupError::Frequencies { wanted, most: 64 });
    assert_eq!(with(&|own| own.num_frequencies = 65), frequencies(65));
    assert_eq!(with(&|own| own.num_frequencies = 0), frequencies(0));
    for wanted in [0, 64, 200, 512] {
        let error = SetupError::RangeLength { wanted, most: 256 };
        assert_eq!(with(&|own| own.range_length = wanted), Err(error));
    }
    assert_eq!(with(&|own| own.step_hz = 0.0), Err(SetupError::Band));
    assert_eq!(with(&|own| own.start_hz = f64::NAN), Err(SetupError::Band));
    assert_eq!(
        with(&|own| own.side_lobe_db = 101.0),
        Err(SetupError::Window)
    );
    for ranges_m in [[-1.0, 2.0], [3.0, 2.0], [0.0, 20.0], [1.0, f64::NAN]] {
        assert_eq!(
            with(&|own| own.ranges_m = ranges_m),
            Err(SetupError::Ranges)
        );
    }
    assert_eq!(with(&|own| own.training = 0), Err(SetupError::Detection));
    assert_eq!(with(&|own| own.guard = 40), Err(SetupError::Detection));
    assert_eq!(with(&|own| own.rank = 1.5), Err(SetupError::Detection));
    let certain = |own: &mut Setup| own.false_alarm_probability = 1.0;
    assert_eq!(with(&certain), Err(SetupError::Detection));
    assert_eq!(with(&|own| own.follow.seen = 9), Err(SetupError::Tracker));
    assert_eq!(
        with(&|own| own.follow.gate_cells = 0.0),
        Err(SetupError::Tracker)
    );
    for bridge in [256, u16::MAX] {
        assert_eq!(
            with(&|own| own.follow.bridge = bridge),
            Err(SetupError::Tracker)
        );
    }
    assert_eq!(
        with(&|own| own.follow.within = 256),
        Err(SetupError::Tracker)
    );
    let channels = Small::new().configure(&setup(), &Scene::new(5).antennas());
    assert_eq!(channels, Err(SetupError::Channels { most: 4 }));
    let apart = [[0.0, 0.0], [wavelength_m(), 0.0]];
    let antennas = Antennas {
        receivers_m: &apart,
        ..scene.antennas()
    };
    assert_eq!(
        Small::new().configure(&setup(), &antennas),
        Err(SetupError::Array)
    );
    // The configuration is kept.
    let mut odometer = started(&scene);
    assert!(odometer.configure(&setup(), &antennas).is_err());
    assert_eq!(odometer.setup(), Some(&setup()));
    assert!(push(&mut odometer, &scene, 0).is_some());
    let empty = std::iter::empty();
    assert_eq!(
        odometer.push(1, 7, 0.0, empty.clone()),
        Err(SampleError::Channel)
    );
    assert_eq!(
        odometer.push(1, 0, 0.0, empty.clone()),
        Err(SampleError::Length)
    );
    odometer.stop();
    assert_eq!(
        odometer.push(1, 0, 0.0, empty),
        Err(SampleError::NotStarted)
    );
    assert_eq!(drain(&mut odometer), None);
    assert!(!Small::new().start(0), "no setup is configured");
}

#[test]
fn step_checksum_is_reproducible() {
    let mut test = OdometerSelfTest::new();
    let first = test.run().unwrap();
    assert_eq!(test.run(), Ok(first), "buffers in use leave no trace");
    assert_eq!(
        first, CHECKSUM,
        "0x{first:08x} is not the recorded 0x{CHECKSUM:08x}"
    );
}

/// As documented, and below half a kilobyte per target.
#[test]
fn memory_matches_documentation() {
    const C: usize = 4;
    const F: usize = 256;
    const R: usize = 1024;
    let stated = 8 * C * F + 4 * F + 12 * R;
    let rest = Odometer::<8, C, F, R>::BYTES - stated;
    println!("{stated} bytes and {rest}");
    assert!(rest < 8 * 512, "{rest}");
}
