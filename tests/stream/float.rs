//! Stream in float32 against a float64 evaluation of its defining sum.

use num_complex::Complex64;
use subaperture_core::stream::{FloatBuffers, Progress, PulseError, Quantity, SetupError};
use subaperture_core::{Complex32, Pulse};
use subaperture_tests::stream_scene::{Scene, at, patch, relative_error_db};

/// Maps of every patch of every sub-CPI, in order.
macro_rules! run {
    ($buffers:expr, $scene:expr) => {{
        let scene: &Scene = $scene;
        let mut processor = $buffers.processor();
        begin(&mut processor, scene);
        let mut maps = Vec::new();
        for (pulse, samples) in scene.pulses.iter().zip(&scene.samples) {
            assert!(pulse.number < processor.accept_through());
            processor.push(pulse, samples.iter().copied()).unwrap();
            drain(&mut processor, &mut maps);
        }
        processor.finish();
        drain(&mut processor, &mut maps);
        maps
    }};
}

type Processor<'a> =
    subaperture_core::stream::SubCpiProcessor<'a, subaperture_core::stream::FloatEngine<'a>>;

struct Made {
    sub_cpi: u32,
    patch: usize,
    num_pulses: usize,
    samples: Vec<Complex32>,
}

/// Configure the scene's run and start it.
fn begin(processor: &mut Processor<'_>, scene: &Scene) {
    processor.configure(&scene.setup).unwrap();
    processor
        .set_weights(0, scene.weights.iter().copied())
        .unwrap();
    for (index, patch) in scene.patches.iter().enumerate() {
        processor.set_patch(index, patch).unwrap();
    }
    processor.start(scene.pulses[0].number).unwrap();
}

fn drain(processor: &mut Processor<'_>, maps: &mut Vec<Made>) {
    loop {
        match processor.work() {
            Progress::Idle => return,
            Progress::Busy => {}
            Progress::Map => {
                let map = processor.map().unwrap();
                maps.push(Made {
                    sub_cpi: map.header.sub_cpi,
                    patch: map.header.patch_index.into(),
                    num_pulses: map.header.num_pulses.into(),
                    samples: at(&map),
                });
            }
        }
    }
}

#[test]
fn float_maps_match_defining_sum() {
    let mut worst = f64::NEG_INFINITY;
    for (scene, mut buffers) in [
        (
            Scene::new(30, 48, 128, 64, 30, vec![patch([0.0; 3], 20, 12)]),
            Box::new(FloatBuffers::<30, 48, 128, 41, 4>::new()),
        ),
        // Two patches, a short last sub-CPI, odd dimensions, a Doppler length that is not a power of two.
        (
            Scene::new(
                7,
                33,
                64,
                15,
                18,
                vec![
                    patch([3.0, -2.0, 0.5], 22, 5),
                    patch([-4.0, 6.0, 0.0], 8, 7),
                ],
            ),
            Box::new(FloatBuffers::<30, 48, 128, 41, 4>::new()),
        ),
        // One pulse per sub-CPI, one frequency: the extremes of both axes.
        (
            Scene::new(1, 48, 64, 4, 3, vec![patch([1.0, 0.0, 0.0], 23, 1)]),
            Box::new(FloatBuffers::<30, 48, 128, 41, 4>::new()),
        ),
        (
            Scene::new(2, 1, 2, 2, 4, vec![patch([1.0, 0.0, 0.0], 0, 0)]),
            Box::new(FloatBuffers::<30, 48, 128, 41, 4>::new()),
        ),
        (
            Scene::new(30, 2, 2, 31, 30, vec![patch([1.0, 0.0, 0.0], 0, 15)]),
            Box::new(FloatBuffers::<30, 48, 128, 41, 4>::new()),
        ),
    ] {
        let maps = run!(buffers, &scene);
        let m = usize::from(scene.setup.num_pulses);
        let expected = scene.pulses.len().div_ceil(m) * scene.patches.len();
        assert_eq!(maps.len(), expected);
        for made in &maps {
            let first = made.sub_cpi as usize * m;
            let pulses = first..(first + m).min(scene.pulses.len());
            assert_eq!(made.num_pulses, pulses.len());
            let exact = scene.map(pulses, made.patch);
            let error_db = relative_error_db(&made.samples, &exact);
            worst = worst.max(error_db);
            // A phasor is accurate to 1.6e-7 (-136 dB), and rotated up to 15 times for compensation and up to M/2 times for Doppler:
            // 15 + 15 roundings of 6e-8 that add as noise make -130 dB; sums of M F float32 terms add as much. 10 dB are
            // reserved for errors that do not add as noise.
            assert!(error_db < -120.0, "{error_db:.1} dB");
        }
    }
    println!("worst map {worst:.1} dB");
}

#[test]
fn scatterer_lies_at_defined_range_and_doppler() {
    // A point in the patch: its position on both axes from the linear path over the sub-CPI.
    let scene = Scene::point(30, 48, 128, 64, patch([0.0; 3], 23, 12), [2.0, 1.0, 0.0]);
    let mut buffers = Box::new(FloatBuffers::<30, 48, 128, 43, 1>::new());
    let maps = run!(buffers, &scene);
    let (a_m, b_m) = scene.line([2.0, 1.0, 0.0], 0);
    let c = 299_792_458.0;
    let range = a_m * 128.0 * scene.setup.step_hz / c;
    let doppler = -b_m * 64.0 * scene.setup.centre_hz() / c;
    let peak = (0..maps[0].samples.len())
        .max_by(|&i, &j| {
            let power = |i: usize| maps[0].samples[i].norm_sqr();
            power(i).total_cmp(&power(j))
        })
        .unwrap();
    let (d, r) = ((peak / 47) as f64 - 12.0, (peak % 47) as f64 - 23.0);
    assert!((d - doppler).abs() <= 0.51 && (r - range).abs() <= 0.51);
    // There it has the phase -2 pi f_ref a / c and, apart from straddle loss, amplitude 1.
    let value = scene.value_at(0, 0, doppler, range);
    let expected = Complex64::cis(-std::f64::consts::TAU * scene.setup.centre_hz() * a_m / c);
    // Deviation of the path from the line, and range migration: kept small by the scene.
    assert!((value - expected).norm() < 2e-3, "{value} {expected}");
}

#[test]
fn missing_pulses_are_counted_and_next_sub_cpi_is_correct() {
    let mut scene = Scene::new(6, 16, 32, 8, 36, vec![patch([0.0; 3], 7, 3)]);
    let mut buffers = Box::new(FloatBuffers::<6, 16, 32, 7, 1>::new());
    let whole = run!(buffers, &scene);
    let mut processor = buffers.processor();
    begin(&mut processor, &scene);
    let mut maps = Vec::new();
    for n in 0..36 {
        // Pulse 8 is lost; 15 is not finite; 20 is repeated.
        if n == 8 {
            continue;
        }
        if n == 15 {
            scene.samples[n][3].im = f32::NAN;
        }
        let result = processor.push(&scene.pulses[n], scene.samples[n].iter().copied());
        let expected = match n {
            9..=11 => Err(PulseError::Waiting),
            15 => Err(PulseError::NotFinite),
            16..=17 => Err(PulseError::Waiting),
            _ => Ok(()),
        };
        assert_eq!(result, expected, "{n}");
        if n == 20 {
            let again = processor.push(&scene.pulses[n], scene.samples[n].iter().copied());
            assert_eq!(again, Err(PulseError::Repeated));
        }
        drain(&mut processor, &mut maps);
    }
    let counters = processor.counters();
    assert_eq!(counters.accepted, 36 - 1 - 1 - 5);
    assert_eq!((counters.lost, counters.refused), (1, 1));
    assert_eq!((counters.repeated, counters.dropped), (1, 5));
    assert_eq!(counters.incomplete, 2);
    let sub_cpis: Vec<u32> = maps.iter().map(|map| map.sub_cpi).collect();
    assert_eq!(sub_cpis, [0, 3, 4, 5]);
    for made in &maps {
        assert_eq!(made.samples, whole[made.sub_cpi as usize].samples);
    }
}

#[test]
fn processor_without_work_drops_pulses_and_recovers() {
    let scene = Scene::new(4, 16, 32, 8, 24, vec![patch([0.0; 3], 7, 3)]);
    let mut buffers = Box::new(FloatBuffers::<4, 16, 32, 7, 1>::new());
    let whole = run!(buffers, &scene);
    let mut processor = buffers.processor();
    begin(&mut processor, &scene);
    let mut maps = Vec::new();
    for n in 0..24 {
        let result = processor.push(&scene.pulses[n], scene.samples[n].iter().copied());
        let expected = match n {
            8..=9 => Err(PulseError::Full),
            10..=11 => Err(PulseError::Waiting),
            _ => Ok(()),
        };
        assert_eq!(result, expected, "{n}");
        let may_come = processor.accept_through();
        match n {
            0..=6 => assert_eq!(may_come, 8),
            7 => assert_eq!(may_come, 8, "both stores are full"),
            _ => {}
        }
        if n >= 9 {
            drain(&mut processor, &mut maps);
        }
    }
    assert_eq!(processor.counters().dropped, 4);
    let sub_cpis: Vec<u32> = maps.iter().map(|map| map.sub_cpi).collect();
    assert_eq!(sub_cpis, [0, 1, 3, 4, 5]);
    for made in &maps {
        assert_eq!(made.samples, whole[made.sub_cpi as usize].samples);
    }
}

#[test]
fn invalid_setup_is_rejected_without_effect() {
    let scene = Scene::new(4, 16, 32, 8, 4, vec![patch([0.0; 3], 7, 3)]);
    let mut buffers = Box::new(FloatBuffers::<4, 16, 32, 7, 1>::new());
    let mut processor = buffers.processor();
    assert_eq!(
        processor.push(&Pulse::EMPTY, [].iter().copied()),
        Err(PulseError::NotRunning)
    );
    let unset_size = |what, most| {
        Err(SetupError::Size {
            what,
            wanted: 0,
            most,
        })
    };
    let unset = unset_size(Quantity::Pulses, 4);
    assert_eq!(processor.start(0), unset);
    assert_eq!(processor.set_patch(0, &scene.patches[0]), unset);
    assert_eq!(processor.set_weights(0, [1.0].into_iter()), unset);
    processor.configure(&scene.setup).unwrap();
    assert_eq!(processor.start(0), unset_size(Quantity::Patches, 1));
    let mut wrong = scene.setup;
    wrong.num_pulses = 5;
    assert!(matches!(
        processor.configure(&wrong),
        Err(SetupError::Size {
            wanted: 5,
            most: 4,
            ..
        })
    ));
    wrong = scene.setup;
    wrong.range_length = 24;
    assert_eq!(
        processor.configure(&wrong),
        Err(SetupError::RangeLength(24))
    );
    wrong = scene.setup;
    wrong.doppler_length = 3;
    assert_eq!(
        processor.configure(&wrong),
        Err(SetupError::DopplerLength(3))
    );
    wrong = scene.setup;
    wrong.step_hz = f64::NAN;
    assert_eq!(processor.configure(&wrong), Err(SetupError::Band));
    for refused in [
        patch([0.0; 3], 16, 0),
        patch([0.0; 3], 3, 4),
        patch([0.0; 3], 8, 3),
        patch([f64::INFINITY, 0.0, 0.0], 3, 3),
    ] {
        assert!(processor.set_patch(0, &refused).is_err(), "{refused:?}");
    }
    processor.set_patch(0, &scene.patches[0]).unwrap();
    assert!(processor.set_patch(1, &scene.patches[0]).is_err());
    assert!(processor.set_weights(16, [1.0].into_iter()).is_err());
    assert!(processor.set_weights(15, [f32::NAN].into_iter()).is_err());
    processor.start(0).unwrap();
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples) {
        processor.push(pulse, samples.iter().copied()).unwrap();
    }
    let mut maps = Vec::new();
    drain(&mut processor, &mut maps);
    assert_eq!(maps.len(), 1);
}
