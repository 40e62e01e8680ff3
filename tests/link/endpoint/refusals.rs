//! Invalid commands are refused, reported once, and have no effect.

use subaperture_core::cfar::{Cfar, TrainingWindow};
use subaperture_core::link::{ChipGrid, Command, Configuration, Encoding, Refusal, State};
use subaperture_core::stream::{Quantity, Setup, SetupError};
use subaperture_tests::stream_scene::{at, patch, relative_error_db};

use super::bench::{CHIP, F, M, cfar, fixed, float, scene};

#[test]
fn invalid_commands_are_refused_without_effect() {
    let mut bench = float();
    let scene = scene();
    let setup = scene.setup;
    let settings = cfar(1e-3);
    let weights = [0; 40];
    let first_patch = scene.patches[0];
    let patch_of = |index, count, patch| Command::Patch {
        index,
        count,
        patch,
    };
    let commands = [
        Command::Weights {
            first: 0,
            weights: &weights,
        },
        patch_of(0, 2, first_patch),
        Command::Chip(CHIP),
        Command::Detect(settings),
        Command::Start { run: 1, first: 0 },
    ];
    for command in &commands {
        assert_eq!(bench.send(command), Some(Refusal::NotConfigured));
    }
    // Without an active run these commands have no effect.
    for command in [Command::Stop, Command::Abort, Command::Status] {
        assert_eq!(bench.send(&command), None);
        assert_eq!(bench.state(), State::Idle);
    }
    let configure = |setup| {
        Command::Configure(Configuration {
            id: 9,
            setup,
            total_pulses: 28,
            send_maps: true,
        })
    };
    let large = Setup {
        num_pulses: M as u16 + 1,
        num_channels: 1,
        doppler_length: 18,
        ..setup
    };
    let size = |what, wanted, most| Some(Refusal::Setup(SetupError::Size { what, wanted, most }));
    assert_eq!(bench.send(&configure(large)), size(Quantity::Pulses, 9, 8));
    assert_eq!(bench.status.unwrap().configuration, 0);
    assert_eq!(bench.send(&configure(setup)), None);

    let weights_at = |first, weights| Command::Weights { first, weights };
    assert_eq!(
        bench.send(&weights_at(10, &weights)),
        Some(Refusal::Weights)
    );
    assert_eq!(
        bench.send(&weights_at(0, &weights[..7])),
        Some(Refusal::Weights)
    );
    assert_eq!(bench.send(&weights_at(0, &weights)), None);
    assert_eq!(
        bench.send(&weights_at(11, &weights)),
        Some(Refusal::Weights)
    );
    for first in [10, 20] {
        assert_eq!(bench.send(&weights_at(first, &weights)), None);
    }
    assert_eq!(
        bench.send(&weights_at(30, &weights)),
        size(Quantity::Weights, 40, 32)
    );

    for (index, count) in [(1, 2), (2, 2), (0, 0)] {
        assert_eq!(
            bench.send(&patch_of(index, count, first_patch)),
            Some(Refusal::PatchIndex)
        );
    }
    assert_eq!(bench.send(&patch_of(0, 2, first_patch)), None);
    assert_eq!(
        bench.send(&patch_of(1, 3, first_patch)),
        Some(Refusal::PatchIndex)
    );
    assert_eq!(
        bench.send(&patch_of(1, 2, patch([0.0; 3], 16, 1))),
        size(Quantity::RangeGate, 33, 32)
    );
    assert_eq!(
        bench.send(&patch_of(1, 2, patch([f64::NAN; 3], 1, 1))),
        Some(Refusal::Setup(SetupError::NotFinite))
    );
    // A patch and two weights are still missing.
    let start = Command::Start { run: 1, first: 0 };
    assert_eq!(bench.send(&start), Some(Refusal::NotConfigured));

    let chip = |num_columns, num_rows| {
        Command::Chip(ChipGrid {
            num_columns,
            num_rows,
            ..CHIP
        })
    };
    let room = |wanted, most| Some(Refusal::Chip { wanted, most });
    assert_eq!(bench.send(&chip(12, 11)), room(132, 128));
    assert_eq!(bench.send(&chip(0, 11)), room(0, 128));
    assert_eq!(
        bench.send(&chip(u16::MAX, u16::MAX)),
        room(65_535 * 65_535, 128)
    );
    assert_eq!(bench.send(&chip(32, 3)), None);
    // The same chip may be repeated, another one not, and patches come in order.
    assert_eq!(bench.send(&chip(32, 3)), None);
    assert_eq!(bench.send(&chip(32, 2)), Some(Refusal::PatchIndex));
    let of_patch = |patch| Command::Chip(ChipGrid { patch, ..CHIP });
    assert_eq!(bench.send(&of_patch(2)), Some(Refusal::PatchIndex));
    // 96 pixels are taken.
    assert_eq!(bench.send(&of_patch(1)), room(96 + 120, 128));
    for probability in [0.0, 1.0, -0.5, f64::NAN] {
        assert_eq!(
            bench.send(&Command::Detect(cfar(probability))),
            Some(Refusal::Detect)
        );
    }
    let untrained = Cfar {
        range: TrainingWindow {
            guard: 1,
            training: 0,
        },
        doppler: TrainingWindow {
            guard: 1,
            training: 0,
        },
        ..settings
    };
    assert_eq!(
        bench.send(&Command::Detect(untrained)),
        Some(Refusal::Detect)
    );

    bench.configure(&scene);
    assert_eq!(bench.send(&start), None);
    for command in commands
        .iter()
        .chain([&configure(setup), &Command::Start { run: 2, first: 0 }])
    {
        // Starting the active run again is allowed.
        let expected = (*command != start).then_some(Refusal::Running);
        assert_eq!(bench.send(command), expected);
        assert_eq!(bench.state(), State::Running);
    }
    assert_eq!(bench.status.unwrap().run, 1);
    // None of these commands had an effect.
    assert_eq!(bench.send(&Command::Abort), None);
    bench.run(2, &scene);
    for came in &bench.maps {
        let first = came.header.sub_cpi as usize * M;
        let exact = scene.map(
            first..first + usize::from(came.header.num_pulses),
            came.header.patch_index.into(),
        );
        assert!(relative_error_db(&at(&came.view()), &exact) < -100.0);
    }
}

#[test]
fn wrong_pulses_are_refused_and_counted() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    bench.send(&Command::Start { run: 1, first: 0 });
    let short = &scene.samples[0][..F - 1];
    let expected = Some(Refusal::PulseLength {
        expected: 8 * F as u32,
        got: 8 * (F as u32 - 1),
    });
    assert_eq!(
        bench.push(&scene.pulses[0], short, Encoding::Complex32),
        expected
    );
    // Reported once per run, then only counted.
    assert_eq!(
        bench.push(&scene.pulses[1], short, Encoding::Complex32),
        None
    );
    bench.send(&Command::Status);
    let counters = bench.status.unwrap().pulses;
    assert_eq!((counters.refused, counters.accepted), (2, 0));
    // They cost their sub-CPI. The next one is complete, in the other encoding, which a floating-point module accepts as well.
    let rest = scene.pulses.iter().zip(&scene.samples).skip(2);
    for (pulse, samples) in rest.take(2 * M - 2) {
        assert_eq!(bench.push(pulse, samples, Encoding::Sc16), None);
    }
    assert_eq!(bench.maps.len(), scene.patches.len());
    assert_eq!(bench.maps[0].header.sub_cpi, 1);
    let exact = scene.map(M..2 * M, 0);
    assert!(relative_error_db(&at(&bench.maps[0].view()), &exact) < -100.0);

    let mut bench = fixed();
    bench.configure(&scene);
    bench.send(&Command::Start { run: 1, first: 0 });
    assert_eq!(
        bench.push(&scene.pulses[0], &scene.samples[0], Encoding::Complex32),
        Some(Refusal::Encoding)
    );
    // Reported once per run and counted; pulse numbers continue.
    assert_eq!(
        bench.push(&scene.pulses[1], &scene.samples[1], Encoding::Complex32),
        None
    );
    bench.send(&Command::Status);
    let status = bench.status.unwrap();
    assert_eq!((status.pulses.refused, status.next_pulse), (2, 2));
    // Late pulses of a finished run are ignored.
    bench.send(&Command::Abort);
    assert_eq!(
        bench.push(&scene.pulses[0], &scene.samples[0], Encoding::Complex32),
        None
    );
}

/// A pulse refused for another reason does not suppress the report of a wrong length.
#[test]
fn wrong_length_is_reported_after_nonfinite_sample() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    bench.send(&Command::Start { run: 1, first: 0 });
    let mut samples = scene.samples[0].clone();
    samples[0].re = f32::NAN;
    assert_eq!(
        bench.push(&scene.pulses[0], &samples, Encoding::Complex32),
        None
    );
    let refusal = bench.push(&scene.pulses[1], &samples[1..], Encoding::Complex32);
    assert!(
        matches!(refusal, Some(Refusal::PulseLength { .. })),
        "{refusal:?}"
    );
}

#[test]
fn chips_of_some_patches_only_are_refused_at_start() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    assert_eq!(bench.send(&Command::Chip(CHIP)), None);
    let start = Command::Start { run: 1, first: 0 };
    assert_eq!(bench.send(&start), Some(Refusal::PatchIndex));
    assert_eq!(bench.state(), State::Ready);
    bench.set_chips();
    bench.run(1, &scene);
    assert_eq!(bench.collect().len(), 2);
    // There is no third chip.
    let third = Command::SendChip { patch: 2 };
    assert_eq!(bench.send(&third), Some(Refusal::PatchIndex));
}

#[test]
fn chip_needs_a_known_number_of_sub_cpis() {
    let scene = scene();
    let mut bench = float();
    // The list of accumulated sub-CPIs has 16 bits.
    for (total_pulses, wanted) in [(0, 0), (17 * 8, 17)] {
        let configuration = Command::Configure(Configuration {
            id: 9,
            setup: scene.setup,
            total_pulses,
            send_maps: true,
        });
        assert_eq!(bench.send(&configuration), None);
        let refused = Some(Refusal::SubCpis { wanted, most: 16 });
        assert_eq!(bench.send(&Command::Chip(CHIP)), refused);
    }
}

/// Repeated commands are harmless, and an aborted run leaves no data.
#[test]
fn repeated_commands_have_no_effect() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    bench.run(1, &scene);
    let count = bench.maps.len();
    // Stop again, and start the finished run again.
    for command in [
        Command::Stop,
        Command::Start { run: 1, first: 0 },
        Command::Abort,
    ] {
        assert_eq!(bench.send(&command), None);
        assert_eq!(bench.state(), State::Done);
    }
    assert_eq!(bench.maps.len(), count);

    bench.restart();
    let start = Command::Start { run: 2, first: 0 };
    bench.send(&start);
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples).take(M + 3) {
        bench.push(pulse, samples, Encoding::Complex32);
    }
    // A repeated start during a run does not restart it.
    bench.send(&start);
    assert_eq!(bench.status.unwrap().next_pulse, M as u32 + 3);
    assert_eq!(bench.maps.len(), scene.patches.len());
    for _ in 0..2 {
        assert_eq!(bench.send(&Command::Abort), None);
        assert_eq!(bench.state(), State::Done);
    }
    assert_eq!(bench.maps.len(), scene.patches.len());
    bench.run(3, &scene);
    assert_eq!(bench.maps.len(), count);
}

/// Frame written from the description: CRC by another library, byte stuffing by definition.
fn framed(version: u8, sequence: u32, message: u8) -> Vec<u8> {
    let mut body = vec![version];
    body.extend(sequence.to_le_bytes());
    body.push(message);
    body.extend(crc32fast::hash(&body).to_le_bytes());
    let mut wire = Vec::new();
    for piece in body.split(|byte| *byte == 0) {
        wire.push(piece.len() as u8 + 1);
        wire.extend(piece);
    }
    wire.push(0);
    wire
}

#[test]
fn frames_of_another_version_are_counted_and_ignored() {
    let mut bench = float();
    bench.settle();
    assert_eq!(bench.identities, 1, "the first word of a module");
    // A greeting, by its bytes.
    bench.endpoint.receive(&framed(4, 0, 0));
    bench.settle();
    assert_eq!(bench.identities, 1);
    bench.endpoint.receive(&framed(3, 0, 0));
    bench.settle();
    assert_eq!(bench.identities, 2);
    bench.send(&Command::Status);
    let link = bench.status.unwrap().link;
    assert_eq!((link.frames, link.version), (2, 1));
    assert_eq!((link.corrupt, link.malformed, link.lost), (0, 0, 0));
}
