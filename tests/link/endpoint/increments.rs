//! Motion runs of the endpoint: bit-identical to the core, one pulse at a time, with any losses.

use num_complex::Complex32;
use subaperture_core::Sc16;
use subaperture_core::link::{
    Command, Configuration, Encoding, Increment, MAX_ANTENNAS, MotionConfiguration, Refusal, State,
    write_complex32s, write_places, write_sc16s,
};
use subaperture_core::motion::{Progress, SetupError, Step};
use subaperture_core::stream::{FixedBuffers, FixedEngine, FloatBuffers, FloatEngine};
use subaperture_firmware::engine::WireEngine;
use subaperture_tests::odometer_scene::{self, FREQUENCIES, Scene, as_sent};

use super::bench::{Bench, BenchOdometer, F, M, PATCHES, R, ROWS, scene};

fn float() -> Bench<FloatEngine<'static>> {
    let buffers = Box::leak(Box::new(FloatBuffers::<M, F, R, ROWS, PATCHES>::new()));
    Bench::new(buffers.processor(), FREQUENCIES)
}

fn fixed() -> Bench<FixedEngine<'static>> {
    let buffers = Box::leak(Box::new(FixedBuffers::<M, F, R, ROWS, 2, PATCHES>::new()));
    Bench::new(buffers.processor().unwrap(), FREQUENCIES)
}

/// Samples that are exact in 16 bits, so both encodings carry the same values.
fn pulse(scene: &Scene, n: u32) -> Vec<Vec<Complex32>> {
    let mut channels = scene.pulse(n as usize);
    for sample in channels.iter_mut().flatten() {
        *sample = Sc16::from_complex32(*sample * 0.125).0.to_complex32();
    }
    channels
}

fn send_channel<E: WireEngine>(
    bench: &mut Bench<E>,
    (number, channel): (u32, u16),
    samples: &[Complex32],
    encoding: Encoding,
) -> Option<Refusal> {
    let mut bytes = vec![0; 8 * samples.len()];
    let samples = match encoding {
        Encoding::Complex32 => write_complex32s(samples, &mut bytes),
        Encoding::Sc16 => {
            let short: Vec<Sc16> = samples.iter().map(|z| Sc16::from_complex32(*z).0).collect();
            write_sc16s(&short, &mut bytes)
        }
    };
    bench.send(&Command::Channel {
        pulse: number,
        channel,
        reference_path_m: 0.0,
        encoding,
        samples: samples.unwrap(),
    })
}

fn configuration() -> Command<'static> {
    Command::Motion(MotionConfiguration {
        id: 12,
        setup: odometer_scene::setup(),
    })
}

fn send_antennas<E: WireEngine>(bench: &mut Bench<E>, scene: &Scene) -> Option<Refusal> {
    let all = [scene.transmitters_m.clone(), scene.receivers_m.clone()].concat();
    let mut bytes = [0; 16 * MAX_ANTENNAS];
    let places = write_places(&all, &mut bytes).unwrap();
    let transmitters = scene.transmitters_m.len() as u16;
    bench.send(&Command::Antennas {
        transmitters,
        places,
    })
}

fn configure<E: WireEngine>(bench: &mut Bench<E>, scene: &Scene) {
    assert_eq!(bench.send(&configuration()), None);
    assert_eq!(bench.state(), State::Idle);
    assert_eq!(send_antennas(bench, scene), None);
    let status = bench.status.unwrap();
    assert_eq!((status.state, status.configuration), (State::Ready, 12));
}

/// Steps of the core for the same samples.
fn expected(scene: &Scene, pulses: u32) -> Vec<Step> {
    let mut odometer = Box::new(BenchOdometer::new());
    odometer
        .configure(&odometer_scene::setup(), &scene.antennas())
        .unwrap();
    odometer.start(0);
    let mut steps = Vec::new();
    for n in 0..pulses {
        for (c, samples) in pulse(scene, n).into_iter().enumerate() {
            odometer.push(n, c, 0.0, samples.into_iter()).unwrap();
        }
        steps.push(loop {
            match odometer.work() {
                Progress::Step(step) => break step,
                Progress::Busy => {}
                Progress::Idle => panic!("no step"),
            }
        });
    }
    steps
}

/// Send whole pulses as a host does: the next one after the increment of the previous one.
fn run<E: WireEngine>(bench: &mut Bench<E>, scene: &Scene, run: u32, encoding: Encoding) {
    const PULSES: u32 = 20;
    bench.increments.clear();
    assert_eq!(bench.send(&Command::Start { run, first: 0 }), None);
    let status = bench.status.unwrap();
    assert_eq!((status.state, status.run), (State::Running, run));
    assert_eq!((status.next_pulse, status.accept_through), (0, 1));
    bench.status = None;
    for n in 0..PULSES {
        for (c, samples) in (0..).zip(pulse(scene, n)) {
            assert_eq!(bench.increments.len() as u32, n);
            assert_eq!(send_channel(bench, (n, c), &samples, encoding), None);
        }
    }
    assert_eq!(bench.status, None, "increments are credit enough");
    assert_eq!(bench.send(&Command::Stop), None);
    let status = bench.status.unwrap();
    assert_eq!((status.state, status.run), (State::Done, run));
    assert_eq!((status.pulses.accepted, status.pulses.lost), (PULSES, 0));
    let steps = expected(scene, PULSES);
    assert!(steps.iter().filter(|step| step.moved.is_some()).count() > 10);
    let expected: Vec<Increment> = steps.iter().map(as_sent).collect();
    assert_eq!(bench.increments, expected);
}

/// The module is sent samples and asked for maps in between; either arithmetic gives the same increments.
#[test]
fn increments_are_bit_identical_to_core() {
    let own = Scene::new(2).with_snr_db(30.0, 4);
    let mut bench = float();
    configure(&mut bench, &own);
    run(&mut bench, &own, 1, Encoding::Complex32);
    run(&mut bench, &own, 2, Encoding::Sc16);
    let maps = scene();
    bench.configure(&maps);
    bench.run(3, &maps);
    configure(&mut bench, &own);
    run(&mut bench, &own, 4, Encoding::Complex32);
    let mut bench = fixed();
    let wider = Scene::new(4).with_snr_db(30.0, 5);
    configure(&mut bench, &wider);
    run(&mut bench, &wider, 1, Encoding::Sc16);
}

/// The host repeats the lost channels, or all of them.
#[test]
fn lost_channels_and_increments_are_repeated() {
    let own = Scene::new(2).with_snr_db(30.0, 4);
    let mut bench = float();
    configure(&mut bench, &own);
    assert_eq!(bench.send(&Command::Start { run: 9, first: 0 }), None);
    let encoding = Encoding::Complex32;
    let both = |bench: &mut Bench<_>, n: u32| {
        for (c, samples) in (0..).zip(pulse(&own, n)) {
            assert_eq!(send_channel(bench, (n, c), &samples, encoding), None);
        }
    };
    for n in 0..12 {
        if n == 7 {
            // The first channel is lost.
            let samples = &pulse(&own, n)[1];
            assert_eq!(send_channel(&mut bench, (n, 1), samples, encoding), None);
            assert_eq!(bench.send(&Command::Status), None);
            let status = bench.status.unwrap();
            assert_eq!((status.next_pulse, status.accept_through), (7, 8));
            assert_eq!(bench.increments.len(), 7);
        }
        both(&mut bench, n);
        if n == 9 {
            // The increment is lost.
            let reported = bench.increments.pop();
            assert_eq!(bench.send(&Command::Status), None);
            assert_eq!(bench.status.unwrap().next_pulse, 10);
            both(&mut bench, n);
            assert_eq!(bench.increments.pop(), reported);
            assert_eq!(bench.increments.pop(), reported, "once for each channel");
            bench.increments.extend(reported);
        }
    }
    // The increment of pulse 7 was repeated as well, when its second channel was received again.
    bench.increments.dedup();
    let steps = expected(&own, 12);
    assert_eq!(
        bench.increments,
        steps.iter().map(as_sent).collect::<Vec<_>>()
    );
    assert_eq!(bench.send(&Command::Abort), None);
    assert_eq!(bench.state(), State::Done);
    let pulses = bench.status.unwrap().pulses;
    assert_eq!((pulses.accepted, pulses.repeated), (12, 3));
}

#[test]
fn invalid_motion_commands_are_refused() {
    let own = Scene::new(2);
    let mut bench = float();
    let no = Some(Refusal::NotConfigured);
    assert_eq!(send_antennas(&mut bench, &own), no);
    let wrong = |setup| Command::Motion(MotionConfiguration { id: 1, setup });
    let long = subaperture_core::motion::Setup {
        num_frequencies: 65,
        ..odometer_scene::setup()
    };
    assert_eq!(bench.send(&wrong(long)), None);
    assert_eq!(
        send_antennas(&mut bench, &own),
        Some(Refusal::Motion(SetupError::Frequencies {
            wanted: 65,
            most: 64
        }))
    );
    assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), no);
    assert_eq!(bench.send(&configuration()), None);
    let antennas = |transmitters, places| Command::Antennas {
        transmitters,
        places,
    };
    for (transmitters, places) in [(1, &[0; 47][..]), (3, &[0; 32]), (1, &[0; 16 * 12])] {
        assert_eq!(
            bench.send(&antennas(transmitters, places)),
            Some(Refusal::Antennas)
        );
    }
    assert_eq!(
        bench.send(&antennas(1, &[0; 48])),
        Some(Refusal::Motion(SetupError::Array))
    );
    let many = Scene::new(5);
    assert_eq!(
        send_antennas(&mut bench, &many),
        Some(Refusal::Motion(SetupError::Channels { most: 4 }))
    );
    assert_eq!(bench.state(), State::Idle);
    // Commands of map configurations.
    let weights = Command::Weights {
        first: 0,
        weights: &[0; 8],
    };
    assert_eq!(bench.send(&weights), no);
    configure(&mut bench, &own);
    assert_eq!(bench.send(&weights), no);
    assert_eq!(bench.send(&Command::Start { run: 2, first: 0 }), None);
    assert_eq!(bench.send(&configuration()), Some(Refusal::Running));
    assert_eq!(send_antennas(&mut bench, &own), Some(Refusal::Running));
    let maps = scene();
    let configure_maps = Command::Configure(Configuration {
        id: 3,
        setup: maps.setup,
        total_pulses: 0,
        send_maps: true,
    });
    assert_eq!(bench.send(&configure_maps), Some(Refusal::Running));
    // A pulse for maps is refused once; invalid channels are counted.
    let encoding = Encoding::Complex32;
    assert_eq!(bench.push(&maps.pulses[0], &maps.samples[0], encoding), no);
    assert_eq!(
        bench.push(&maps.pulses[0], &maps.samples[0], encoding),
        None
    );
    let samples = &pulse(&own, 0)[0];
    for (channel, samples) in [(2, &samples[..]), (0, &samples[1..])] {
        assert_eq!(
            send_channel(&mut bench, (0, channel), samples, encoding),
            None
        );
    }
    let mut holed = samples.clone();
    holed[5].re = f32::INFINITY;
    assert_eq!(send_channel(&mut bench, (0, 0), &holed, encoding), None);
    assert_eq!(bench.send(&Command::Status), None);
    let status = bench.status.unwrap();
    assert_eq!((status.pulses.refused, status.pulses.incomplete), (3, 1));
    assert_eq!((status.next_pulse, status.accept_through), (1, 2));
    assert_eq!(bench.send(&Command::Abort), None);
    // And vice versa.
    bench.configure(&maps);
    assert_eq!(bench.send(&Command::Start { run: 5, first: 0 }), None);
    assert_eq!(send_channel(&mut bench, (0, 0), samples, encoding), no);
    assert_eq!(send_channel(&mut bench, (0, 1), samples, encoding), None);
}
