//! Range-profile runs of the endpoint: bit-identical to the core, rows of any length, and refusals.

use num_complex::Complex32;
use subaperture_core::link::{
    Command, Configuration, MotionConfiguration, Refusal, State, SweepConfiguration, write_f32s,
    write_pairs,
};
use subaperture_core::sweep::SetupError;
use subaperture_firmware::engine::WireEngine;
use subaperture_tests::odometer_scene;
use subaperture_tests::sweep_scene::{SweepScene, there};

use super::bench::{Bench, float, scene};

fn own() -> SweepScene {
    let mut own = SweepScene::new(20, 168, 128);
    own.lost = vec![(9, 40..52)];
    own
}

fn configuration(own: &SweepScene) -> Command<'static> {
    Command::Profiles(SweepConfiguration {
        id: 12,
        setup: own.setup,
    })
}

fn send_weights<E: WireEngine>(bench: &mut Bench<E>, own: &SweepScene) -> Option<Refusal> {
    let weights = own.weights();
    let mut bytes = vec![0; 4 * weights.len()];
    for (first, part) in (0u16..).step_by(8).zip(weights.chunks(8)) {
        let weights = write_f32s(part, &mut bytes).unwrap();
        let refused = bench.send(&Command::Weights { first, weights });
        if refused.is_some() {
            return refused;
        }
    }
    None
}

fn send_sweep<E: WireEngine>(bench: &mut Bench<E>, own: &SweepScene, sweep: u32) {
    let mut bytes = vec![0; 8 * 24];
    for burst in own.bursts(sweep) {
        for run in there(&burst) {
            let parts = burst.samples[run.clone()].chunks(24);
            for (first, part) in run.step_by(24).zip(parts) {
                let samples = write_pairs(part, &mut bytes).unwrap();
                let refused = bench.send(&Command::Burst {
                    sweep,
                    carrier: burst.carrier,
                    first: first as u32,
                    samples,
                });
                assert_eq!(refused, None);
            }
        }
    }
}

fn expected(own: &SweepScene, sweep: u32) -> (u32, u16, u32, Vec<Complex32>) {
    let (values, usable, taken) = own.profile(sweep);
    (sweep, usable, taken, values)
}

/// The module forms maps before and after; rows have 32 bins, the size of its buffer.
#[test]
fn profiles_are_bit_identical_to_core() {
    let own = own();
    let maps = scene();
    let mut bench = float();
    bench.configure(&maps);
    bench.run(1, &maps);
    assert_eq!(bench.send(&configuration(&own)), None);
    assert_eq!(bench.state(), State::Idle);
    assert_eq!(send_weights(&mut bench, &own), None);
    let status = bench.status.unwrap();
    assert_eq!((status.state, status.configuration), (State::Ready, 12));
    assert_eq!(bench.send(&Command::Start { run: 2, first: 0 }), None);
    for sweep in 0..2 {
        send_sweep(&mut bench, &own, sweep);
        assert_eq!(bench.profiles, []);
        assert_eq!(bench.send(&Command::Sweep { sweep }), None);
        assert_eq!(bench.profiles.pop().unwrap(), expected(&own, sweep));
    }
    // A repeated request gives the same profile; for a sweep that is behind, a status is sent instead.
    assert_eq!(bench.send(&Command::Sweep { sweep: 1 }), None);
    assert_eq!(bench.profiles.pop().unwrap(), expected(&own, 1));
    bench.status = None;
    assert_eq!(bench.send(&Command::Sweep { sweep: 0 }), None);
    assert_eq!(bench.profiles, []);
    let status = bench.status.unwrap();
    assert_eq!((status.next_pulse, status.maps), (1, 3));
    // A repeated sweep gives the same profile; a sweep without samples has an empty profile.
    send_sweep(&mut bench, &own, 1);
    assert_eq!(bench.send(&Command::Sweep { sweep: 1 }), None);
    assert_eq!(bench.profiles.pop().unwrap(), expected(&own, 1));
    assert_eq!(bench.send(&Command::Sweep { sweep: 7 }), None);
    assert_eq!(bench.profiles.pop().unwrap(), (7, 0, 0, vec![]));
    assert_eq!(bench.send(&Command::Stop), None);
    let status = bench.status.unwrap();
    assert_eq!((status.state, status.maps), (State::Done, 5));
    // 168 samples are 7 parts of 24, and so are 40 and 116.
    let parts = 3 * 20 * 7;
    assert_eq!((status.pulses.accepted, status.pulses.refused), (parts, 0));
    bench.configure(&maps);
    bench.run(3, &maps);
}

#[test]
fn invalid_profile_commands_are_refused() {
    let own = own();
    let mut bench = float();
    let no = Some(Refusal::NotConfigured);
    assert_eq!(bench.send(&Command::Sweep { sweep: 0 }), no);
    let mut odd = own.clone();
    odd.setup.bins = 100;
    let error = SetupError::NoPowerOfTwo(100);
    assert_eq!(
        bench.send(&configuration(&odd)),
        Some(Refusal::Sweep(error))
    );
    assert_eq!(bench.send(&configuration(&own)), None);
    let weights = |first, weights| Command::Weights { first, weights };
    for (first, bytes) in [(0, &[0; 7][..]), (1, &[0; 4]), (0, &[0; 84])] {
        assert_eq!(bench.send(&weights(first, bytes)), Some(Refusal::Weights));
    }
    let nan = f32::NAN.to_le_bytes();
    let error = SetupError::NotFinite;
    assert_eq!(bench.send(&weights(0, &nan)), Some(Refusal::Sweep(error)));
    assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), no);
    assert_eq!(send_weights(&mut bench, &own), None);
    let sweep = Command::Sweep { sweep: 0 };
    assert_eq!(bench.send(&sweep), Some(Refusal::NotRunning));
    assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), None);
    assert_eq!(bench.send(&configuration(&own)), Some(Refusal::Running));
    assert_eq!(bench.send(&weights(0, &[0; 4])), Some(Refusal::Running));
    let motion = Command::Motion(MotionConfiguration {
        id: 1,
        setup: odometer_scene::setup(),
    });
    assert_eq!(bench.send(&motion), Some(Refusal::Running));
    // Rejected samples are counted.
    for (carrier, first, samples) in [(20, 0, &[0; 8][..]), (0, 0, &[0; 9]), (0, 168, &[0; 8])] {
        let burst = Command::Burst {
            sweep: 0,
            carrier,
            first,
            samples,
        };
        assert_eq!(bench.send(&burst), None);
    }
    // A pulse for maps is refused.
    let maps = scene();
    let encoding = subaperture_core::link::Encoding::Complex32;
    assert_eq!(bench.push(&maps.pulses[0], &maps.samples[0], encoding), no);
    assert_eq!(bench.send(&Command::Abort), None);
    let status = bench.status.unwrap();
    assert_eq!((status.state, status.pulses.refused), (State::Done, 3));
    // And vice versa.
    let configure = Command::Configure(Configuration {
        id: 3,
        setup: maps.setup,
        total_pulses: 0,
        send_maps: true,
    });
    assert_eq!(bench.send(&configure), None);
    assert_eq!(bench.send(&sweep), no);
    bench.configure(&maps);
    assert_eq!(bench.send(&Command::Start { run: 5, first: 0 }), None);
    let burst = Command::Burst {
        sweep: 0,
        carrier: 0,
        first: 0,
        samples: &[0; 8],
    };
    assert_eq!(bench.send(&burst), no);
}

/// A host that requested twice repeats the sweep when the first answer reports too few samples: the second request must not end the repeated sweep.
#[test]
fn pending_request_does_not_end_repeated_sweep() {
    let own = own();
    let mut bench = float();
    assert_eq!(bench.send(&configuration(&own)), None);
    assert_eq!(send_weights(&mut bench, &own), None);
    assert_eq!(bench.send(&Command::Start { run: 1, first: 0 }), None);
    let mut wire = vec![0; 256];
    let sweep = Command::Sweep { sweep: 0 };
    let bytes = bench.encoder.encode(&sweep, &mut wire).unwrap();
    bench.sequence += 1;
    // Both have arrived before the endpoint processes anything.
    bench.endpoint.receive(bytes);
    send_sweep(&mut bench, &own, 0);
    assert_eq!(bench.profiles, []);
    assert_eq!(bench.send(&sweep), None);
    assert_eq!(bench.profiles, [expected(&own, 0)]);
}
