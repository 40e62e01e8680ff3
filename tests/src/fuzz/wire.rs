//! Frames of the link in both directions, and maps, chips and profiles reassembled from them.

use num_complex::Complex;
use subaperture_core::cfar::{Cfar, TrainingWindow};
use subaperture_core::dpca::Dpca;
use subaperture_core::link::{
    ChipAssembly, ChipGrid, Command, Configuration, Damage, Encoder, Encoding, Event, MapAssembly,
    Message, MotionConfiguration, ProfileAssembly, Receiver, Refusal, Report, State, Status,
    SweepConfiguration, detections, max_frame_bytes, max_received_bytes, write_complex32s,
    write_f32s, write_pairs, write_places,
};
use subaperture_core::{Complex32, motion, stream, sweep};

use crate::link_scene;

/// Maximum of samples in a message here.
const SAMPLES: usize = 40;

/// Messages on the line, one after another.
struct Wire {
    encoder: Encoder,
    buffer: Vec<u8>,
    bytes: Vec<u8>,
}

impl Wire {
    fn new() -> Self {
        Self {
            encoder: Encoder::new(),
            buffer: vec![0; max_frame_bytes(SAMPLES)],
            bytes: Vec::new(),
        }
    }

    fn say(&mut self, message: &(impl Message + serde::Serialize)) {
        let frame = self.encoder.encode(message, &mut self.buffer);
        self.bytes.extend(frame.expect("a short message"));
    }
}

/// Commands of a complete session with every kind of message.
pub(super) fn commands() -> Vec<u8> {
    let scene = link_scene::scene();
    let mut wire = Wire::new();
    let mut say = |command: &Command<'_>| wire.say(command);
    say(&Command::Hello);
    say(&Command::Configure(Configuration {
        id: 5,
        setup: scene.setup,
        total_pulses: scene.pulses.len() as u32,
        send_maps: true,
    }));
    let mut bytes = [0; 8 * SAMPLES];
    let weights = write_f32s(&scene.weights, &mut bytes).expect("few weights");
    say(&Command::Weights { first: 0, weights });
    let count = scene.patches.len() as u16;
    for (index, &patch) in (0..).zip(&scene.patches) {
        say(&Command::Patch {
            index,
            count,
            patch,
        });
    }
    for patch in 0..count {
        say(&Command::Chip(ChipGrid {
            patch,
            origin_m: [1.5, -3.125, 0.5],
            column_step_m: [0.25, 0.0, 0.0],
            row_step_m: [0.0, 0.25, 0.0],
            num_columns: 6,
            num_rows: 5,
        }));
    }
    let reach = |guard, training| TrainingWindow { guard, training };
    say(&Command::Detect(Cfar {
        range: reach(1, 2),
        doppler: reach(1, 1),
        false_alarm_probability: 0.01,
    }));
    say(&Command::Start { run: 3, first: 0 });
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples).take(9) {
        let samples = write_complex32s(samples, &mut bytes).expect("a short pulse");
        say(&Command::Pulse {
            pulse: *pulse,
            encoding: Encoding::Complex32,
            samples,
        });
    }
    for command in [Command::Status, Command::Stop, Command::Abort] {
        say(&command);
    }
    wire.bytes
}

/// Commands of a session with clutter cancellation of two channels.
pub(super) fn cancellation() -> Vec<u8> {
    let scene = link_scene::scene();
    let mut wire = Wire::new();
    let mut say = |command: &Command<'_>| wire.say(command);
    say(&Command::Hello);
    say(&Command::Configure(Configuration {
        id: 8,
        setup: stream::Setup {
            num_channels: 2,
            ..scene.setup
        },
        total_pulses: 16,
        send_maps: false,
    }));
    let mut bytes = [0; 8 * SAMPLES];
    let weights = write_f32s(&scene.weights, &mut bytes).expect("few weights");
    say(&Command::Weights { first: 0, weights });
    say(&Command::Patch {
        index: 0,
        count: 1,
        patch: scene.patches[0],
    });
    for lag_pulses in [f64::NAN, 0.0, 1e300, 0.75] {
        say(&Command::Dpca(Dpca { lag_pulses }));
    }
    let window = TrainingWindow {
        guard: 0,
        training: 1,
    };
    say(&Command::Detect(Cfar {
        range: window,
        doppler: window,
        false_alarm_probability: 0.5,
    }));
    say(&Command::Start { run: 6, first: 0 });
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples).take(16) {
        let samples = write_complex32s(samples, &mut bytes).expect("a short pulse");
        say(&Command::Pulse {
            pulse: *pulse,
            encoding: Encoding::Complex32,
            samples,
        });
    }
    for command in [Command::Status, Command::Stop] {
        say(&command);
    }
    wire.bytes
}

/// Commands of a session about increments.
pub(super) fn increments() -> Vec<u8> {
    const FREQUENCIES: u16 = 32;
    let mut wire = Wire::new();
    let mut say = |command: &Command<'_>| wire.say(command);
    say(&Command::Hello);
    say(&Command::Motion(MotionConfiguration {
        id: 6,
        setup: motion::Setup {
            num_frequencies: FREQUENCIES,
            range_length: 64,
            start_hz: 77e9,
            step_hz: 31.25e6,
            side_lobe_db: 45.0,
            ranges_m: [0.5, 4.5],
            guard: 1,
            training: 4,
            rank: 0.6,
            false_alarm_probability: 0.01,
            least_snr_db: 5.0,
            follow: motion::TrackerSettings {
                seen: 1,
                within: 2,
                ..motion::TrackerSettings::default()
            },
        },
    }));
    let antennas = [[-0.01, 0.0], [0.0, 0.0], [0.0019, 0.0]];
    let mut bytes = [0; 8 * SAMPLES];
    let places = write_places(&antennas, &mut bytes).expect("three places");
    say(&Command::Antennas {
        transmitters: 1,
        places,
    });
    say(&Command::Start { run: 4, first: 0 });
    for (pulse, channel) in (0..4).flat_map(|pulse| [(pulse, 0), (pulse, 1)]) {
        // Two approaching echoes.
        let sample = |k: u16| {
            let turns = |path: f32| std::f32::consts::TAU * path * f32::from(k) / 32.0;
            let near = Complex32::cis(-turns(8.0) + 0.3 * pulse as f32);
            near + Complex32::cis(-turns(19.0) + 0.2 * f32::from(channel))
        };
        let samples: Vec<Complex32> = (0..FREQUENCIES).map(sample).collect();
        let samples = write_complex32s(&samples, &mut bytes).expect("a short pulse");
        say(&Command::Channel {
            pulse,
            channel,
            reference_path_m: 1.5,
            encoding: Encoding::Complex32,
            samples,
        });
    }
    for command in [Command::Status, Command::Stop] {
        say(&command);
    }
    wire.bytes
}

/// Commands of a session about range profiles.
pub(super) fn profiles() -> Vec<u8> {
    let mut wire = Wire::new();
    let mut say = |command: &Command<'_>| wire.say(command);
    say(&Command::Hello);
    say(&Command::Profiles(SweepConfiguration {
        id: 7,
        setup: sweep::Setup {
            carriers: 6,
            period: 4,
            samples: 40,
            bins: 16,
            start_hz: 1.1e9,
            step_hz: 4e6,
        },
    }));
    let mut bytes = [0; 8 * SAMPLES];
    let weights = write_f32s(&[0.25; 6], &mut bytes).expect("six weights");
    say(&Command::Weights { first: 0, weights });
    say(&Command::Start { run: 5, first: 0 });
    for (carrier, first) in (0..6).flat_map(|carrier| [(carrier, 0), (carrier, 20)]) {
        // A tone of four samples per period, and its echo.
        let pair = |i: u32| {
            let sent = Complex::new(0i16, 400) * [1, -1][(i / 2 % 2) as usize];
            [sent, Complex::new(sent.im, carrier as i16)]
        };
        let pairs: Vec<_> = (first..first + 20).map(pair).collect();
        let samples = write_pairs(&pairs, &mut bytes).expect("twenty pairs");
        say(&Command::Burst {
            sweep: 0,
            carrier,
            first,
            samples,
        });
    }
    for command in [
        Command::Sweep { sweep: 0 },
        Command::Status,
        Command::Sweep { sweep: 1 },
        Command::Stop,
    ] {
        say(&command);
    }
    wire.bytes
}

/// Output of a module for these commands.
fn reports() -> Vec<u8> {
    super::endpoint::Bench::new().hear(&commands())
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let mut rare = Wire::new();
    let status = Status {
        state: State::Done,
        configuration: 1,
        run: 2,
        next_pulse: 3,
        accept_through: 4,
        maps: 5,
        link: Default::default(),
        pulses: Default::default(),
    };
    for report in [
        Report::Status(status),
        Report::Refused {
            sequence: 9,
            what: Refusal::PulseLength {
                expected: 3,
                got: 4,
            },
        },
        Report::Event(Event::StepTooLong {
            taken_us: 300,
            most_us: 200,
        }),
    ] {
        rare.say(&report);
    }
    let answers = super::endpoint::Bench::new().hear(&increments());
    let shown = super::endpoint::Bench::new().hear(&profiles());
    let talks = [commands(), reports(), rare.bytes, increments(), answers];
    let found = super::endpoint::Bench::new().hear(&cancellation());
    [&talks[..], &[profiles(), shown, cancellation(), found]].concat()
}

/// Read one frame; pushes a description that does not depend on how its bytes were split.
fn heard(words: &mut Vec<String>, received: Result<(u32, String), Damage>) {
    words.push(match received {
        Ok((sequence, message)) => format!("{sequence} {message}"),
        Err(damage) => damage.to_string(),
    });
}

/// Assert that a message is read unchanged after the core's writer wrote it.
macro_rules! again {
    ($kind:ty, $message:expr) => {{
        let mut wire = vec![0; max_frame_bytes(8 * SAMPLES)];
        let mut encoder = Encoder::new();
        let mut bytes = encoder
            .encode($message, &mut wire)
            .expect("it came in a frame");
        let mut buffer = vec![0; max_received_bytes(8 * SAMPLES)];
        let mut receiver = Receiver::new(&mut buffer);
        let frame = receiver.receive::<$kind>(&mut bytes).expect("a frame");
        // Compared as text, because NaN does not equal NaN.
        let read = format!("{:?}", frame.expect("it is whole").message);
        assert_eq!(read, format!("{:?}", $message));
    }};
}

/// Read commands in pieces of this length.
fn hear_commands(wire: &[u8], piece: usize) -> Vec<String> {
    let mut buffer = vec![0; max_received_bytes(SAMPLES)];
    let mut receiver = Receiver::new(&mut buffer);
    let mut words = Vec::new();
    for mut bytes in wire.chunks(piece) {
        while let Some(frame) = receiver.receive::<Command<'_>>(&mut bytes) {
            if let Ok(frame) = &frame {
                again!(Command<'_>, &frame.message);
            }
            heard(
                &mut words,
                frame.map(|f| (f.sequence, format!("{:?}", f.message))),
            );
        }
    }
    words
}

/// Read reports in pieces of this length, and reassemble maps and chips.
fn hear_reports(wire: &[u8], piece: usize) -> Vec<String> {
    let mut buffer = vec![0; max_received_bytes(SAMPLES)];
    let mut receiver = Receiver::new(&mut buffer);
    let (mut room, mut chip_room) = (vec![0; 4096], vec![0; 1024]);
    let mut profile_room = vec![0; 1024];
    let (mut map, mut chip, mut profile) = (
        MapAssembly::new(&mut room),
        ChipAssembly::new(&mut chip_room),
        ProfileAssembly::new(&mut profile_room),
    );
    let mut words = Vec::new();
    for mut bytes in wire.chunks(piece) {
        while let Some(frame) = receiver.receive::<Report<'_>>(&mut bytes) {
            if let Ok(frame) = &frame {
                let report = &frame.message;
                again!(Report<'_>, report);
                if let Report::Detections { channels, list, .. } = report {
                    let values =
                        detections(list, (*channels).into()).map(|(_, values)| values.len());
                    assert!(values.sum::<usize>() <= list.len());
                }
                if let Ok(Some(map)) = map.take(report) {
                    let patch = &map.header.patch;
                    let width = patch.num_range_bins();
                    let rows = map
                        .rows()
                        .map(|row| assert_eq!(row.values().count(), width));
                    assert_eq!(rows.count(), patch.num_doppler_bins());
                    words.push("a map".to_owned());
                }
                if let Ok(Some(chip)) = chip.take(report) {
                    let grid = chip.grid;
                    let pixels = usize::from(grid.num_columns) * usize::from(grid.num_rows);
                    assert_eq!(chip.bytes.len(), 8 * pixels);
                    words.push("a chip".to_owned());
                }
                if let Ok(Some(profile)) = profile.take(report) {
                    let header = profile.header;
                    let bins = usize::from(header.num_rows()) * usize::from(header.row_bins);
                    assert_eq!(profile.values().len(), bins);
                    words.push("a profile".to_owned());
                }
            }
            heard(
                &mut words,
                frame.map(|f| (f.sequence, format!("{:?}", f.message))),
            );
        }
    }
    words
}

/// Kinds of the messages, which distinguish inputs.
fn names(words: &[String]) -> String {
    let name = |word: &String| -> String {
        let word = word.trim_start_matches(|c: char| c.is_ascii_digit() || c == ' ');
        word.split(['(', '{', ' '])
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let mut names: Vec<String> = words.iter().map(name).collect();
    names.dedup();
    names.truncate(12);
    names.join(" ")
}

pub(super) fn read(bytes: &[u8]) -> String {
    let commands = hear_commands(bytes, bytes.len().max(1));
    assert_eq!(
        commands,
        hear_commands(bytes, 7),
        "it depends on how bytes are split"
    );
    let reports = hear_reports(bytes, bytes.len().max(1));
    assert_eq!(
        reports,
        hear_reports(bytes, 5),
        "it depends on how bytes are split"
    );
    format!("{}; {}", names(&commands), names(&reports))
}
