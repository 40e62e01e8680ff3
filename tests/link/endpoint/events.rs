//! Events of the module: levels, counts, and a queue of limited length.

use std::cell::RefCell;

use subaperture_core::Complex32;
use subaperture_core::cfar::Cfar;
use subaperture_core::link::{Command, Encoder, Encoding, Event, Level, Refusal, max_frame_bytes};
use subaperture_core::stream::FloatBuffers;

use super::bench::{Bench, F, M, PATCHES, R, ROWS, cfar, fixed, float, scene};

const INVALID: Command<'_> = Command::Detect(Cfar {
    false_alarm_probability: 2.0,
    ..CFAR
});
const CFAR: Cfar = cfar(0.1);

fn request(least: Level) -> Command<'static> {
    Command::Log { least: Some(least) }
}

/// Encode a command.
fn frame(encoder: &mut Encoder, command: &Command<'_>) -> Vec<u8> {
    let mut wire = vec![0; max_frame_bytes(2 * F)];
    encoder.encode(command, &mut wire).unwrap().to_vec()
}

#[test]
fn events_of_requested_level_are_sent() {
    let scene = scene();
    let mut bench = fixed();
    // Without a request no event is sent.
    bench.configure(&scene);
    assert_eq!(bench.send(&INVALID), Some(Refusal::Detect));
    assert_eq!(bench.events, []);

    assert_eq!(bench.send(&request(Level::Warn)), None);
    assert_eq!(bench.events, []);
    assert_eq!(bench.send(&request(Level::Info)), None);
    assert_eq!(bench.events, [Event::Started { faults: 0 }]);
    bench.events.clear();

    assert_eq!(bench.send(&INVALID), Some(Refusal::Detect));
    bench.run(9, &scene);
    let pulses = scene.pulses.len() as u32;
    let maps = bench.maps.len() as u32;
    assert_eq!(
        bench.events,
        [
            Event::Refused(Refusal::Detect),
            Event::RunStarted { run: 9 },
            Event::RunEnded {
                run: 9,
                pulses,
                maps
            }
        ]
    );
    bench.events.clear();

    // The same run again has the same counters; only warnings are requested now.
    assert_eq!(bench.send(&request(Level::Warn)), None);
    bench.run(10, &scene);
    assert_eq!(bench.events, []);
    assert_eq!(bench.send(&Command::Log { least: None }), None);
    assert_eq!(bench.send(&INVALID), Some(Refusal::Detect));
    assert_eq!(bench.events, []);
}

#[test]
fn events_count_damaged_frames_and_lost_pulses() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    assert_eq!(bench.send(&request(Level::Warn)), None);
    assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), None);
    // Two stores of pulses have room, if the module does not work.
    let extra = 3;
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples).take(2 * M + extra) {
        bench.deliver_pulse(pulse, samples);
    }
    let lost = frame(&mut bench.encoder, &Command::Status);
    assert!(!lost.is_empty());
    for _ in 0..2 {
        bench.endpoint.receive(&[1, 2, 3, 0]);
    }
    bench.send(&Command::Status);
    let counted = [
        Event::FramesDamaged { frames: 2 },
        Event::FramesLost { frames: 1 },
        Event::PulsesDropped {
            pulses: extra as u32,
        },
    ];
    assert_eq!(bench.events, counted);
    // Counted once.
    bench.send(&Command::Status);
    assert_eq!(bench.events, counted);
    assert!(
        bench
            .events
            .iter()
            .all(|event| event.level() == Level::Warn)
    );
}

#[test]
fn events_count_samples_at_limit_and_saturated_results() {
    let mut scene = scene();
    // Such a gain saturates full-scale samples.
    scene.weights.fill(f32::MAX);
    let mut bench = fixed();
    bench.configure(&scene);
    assert_eq!(bench.send(&request(Level::Warn)), None);
    assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), None);
    for pulse in &scene.pulses {
        bench.push(pulse, &[Complex32::new(0.0, -1.0); F], Encoding::Sc16);
    }
    bench.send(&Command::Stop);
    let pulses = bench.status.unwrap().pulses;
    let (mut samples_at_limit, mut results_saturated) = (0, 0);
    for event in &bench.events {
        match event {
            Event::SamplesAtLimit { samples } => samples_at_limit += samples,
            Event::ResultsSaturated { results } => results_saturated += results,
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(samples_at_limit, (F * scene.pulses.len()) as u32);
    assert!(results_saturated > 0);
    assert_eq!(
        (samples_at_limit, results_saturated),
        (pulses.at_limit, pulses.saturated)
    );
}

#[test]
fn full_queue_drops_events_and_counts_them() {
    let mut bench = float();
    bench.configure(&scene());
    assert_eq!(bench.send(&request(Level::Info)), None);
    bench.events.clear();
    for _ in 0..12 {
        let bytes = frame(&mut bench.encoder, &INVALID);
        bench.endpoint.receive(&bytes);
    }
    bench.settle();
    let (last, refused) = bench.events.split_last().unwrap();
    assert_eq!(*last, Event::EventsDropped { events: 4 });
    assert_eq!(refused, [Event::Refused(Refusal::Detect); 8]);
}

#[test]
fn board_log_receives_all_events() {
    thread_local! {
        static LOGGED: RefCell<Vec<Event>> = const { RefCell::new(Vec::new()) };
    }
    let log = |event: &Event| LOGGED.with_borrow_mut(|all| all.push(*event));
    let buffers = Box::leak(Box::new(FloatBuffers::<M, F, R, ROWS, PATCHES>::new()));
    let mut bench = Bench::new(buffers.processor(), F);
    bench.endpoint = bench.endpoint.with_log(log, 2);
    let slow = Event::StepTooLong {
        taken_us: 3,
        most_us: 2,
    };
    bench.endpoint.record(slow);
    assert_eq!(bench.send(&INVALID), Some(Refusal::NotConfigured));
    let all = [
        Event::Started { faults: 2 },
        slow,
        Event::Refused(Refusal::NotConfigured),
    ];
    assert_eq!(LOGGED.take(), all);
    assert_eq!(
        all.map(|event| event.level()),
        [Level::Error, Level::Warn, Level::Warn]
    );
    assert_eq!(
        all.map(|event| event.to_string()),
        [
            "program started, 2 resets after faults".to_owned(),
            "step of 3 us: expected at most 2 us".to_owned(),
            format!("command refused: {}", Refusal::NotConfigured)
        ]
    );
    // The host learns of the resets too.
    assert_eq!(bench.send(&request(Level::Error)), None);
    assert_eq!(bench.events, all[..1]);
}
