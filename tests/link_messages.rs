//! Every message of the link: its bytes, there and back, and its size.

use proptest::prelude::*;
use subaperture_core::link::{
    Arithmetic, ChipGrid, Command, Configuration, DetectionRecord, EncodeError, Encoder, Encoding,
    LinkCounters, MAX_TEXT_BYTES, Message, Received, Receiver, Refusal, Report, Row, State, Status,
    complex32s, f32s, max_frame_bytes, max_received_bytes, row_bytes, sc16s, write_block_row,
    write_complex32s, write_f32s, write_sc16s,
};
use subaperture_core::stream::{
    BlockFloat, Capacity, MapHeader, Node, Patch, PulseCounters, Quantity, Setup, SetupError,
};
use subaperture_core::{Complex32, Pulse, Sc16};

/// What messages are made of.
#[derive(Clone, Debug)]
struct Values {
    long: u32,
    other: u32,
    short: u16,
    byte: u8,
    real: f64,
    single: f32,
    place_m: [f64; 3],
    bytes: Vec<u8>,
    text: String,
}

fn values() -> impl Strategy<Value = Values> {
    (
        any::<(u32, u32, u16, u8)>(),
        any::<(f64, f32, [f64; 3])>(),
        prop::collection::vec(prop_oneof![Just(0), any::<u8>()], 0..600),
        "\\PC{0,40}",
    )
        .prop_map(
            |((long, other, short, byte), (real, single, place_m), bytes, text)| Values {
                long,
                other,
                short,
                byte,
                real,
                single,
                place_m,
                bytes,
                text,
            },
        )
}

impl Values {
    fn patch(&self) -> Patch {
        Patch {
            centre_m: self.place_m,
            range_reach: self.short,
            doppler_reach: self.byte.into(),
        }
    }

    fn grid(&self) -> ChipGrid {
        ChipGrid {
            origin_m: self.place_m,
            column_step_m: self.place_m.map(|x| x / 2.0),
            row_step_m: [self.real; 3],
            num_columns: self.short,
            num_rows: self.byte.into(),
        }
    }

    fn encoding(&self) -> Encoding {
        [Encoding::Complex32, Encoding::Sc16][usize::from(self.byte % 2)]
    }

    fn commands(&self) -> Vec<Command<'_>> {
        let (first, index, count) = (self.short, self.short, self.byte.into());
        vec![
            Command::Hello,
            Command::Configure(Configuration {
                id: self.long,
                setup: Setup {
                    num_pulses: self.short,
                    num_frequencies: self.byte.into(),
                    range_length: !self.short,
                    doppler_length: 0,
                    start_hz: self.real,
                    step_hz: self.place_m[1],
                },
            }),
            Command::Weights {
                first,
                weights: &self.bytes,
            },
            Command::Patch {
                index,
                count,
                patch: self.patch(),
            },
            Command::Start {
                run: self.long,
                first: self.long,
            },
            Command::Pulse {
                pulse: Pulse {
                    number: self.other,
                    time_s: self.real,
                    transmitter_m: self.place_m,
                    receiver_m: self.place_m.map(|x| -x),
                    reference_path_m: self.place_m[2],
                    weight: self.single,
                },
                encoding: self.encoding(),
                samples: &self.bytes,
            },
            Command::Stop,
            Command::Status,
            Command::Abort,
            Command::Chip(self.grid()),
            Command::Detect {
                training: self.byte,
                guard: !self.byte,
                false_alarm: self.real,
            },
        ]
    }

    fn refusals(&self) -> Vec<Refusal> {
        let (wanted, most) = (self.long, self.other);
        let quantities = [
            Quantity::Pulses,
            Quantity::Frequencies,
            Quantity::Weights,
            Quantity::RangeLength,
            Quantity::RangeGate,
            Quantity::DopplerBand,
            Quantity::Map,
            Quantity::Patches,
        ];
        let mut all = vec![
            Refusal::NotConfigured,
            Refusal::Running,
            Refusal::NotRunning,
            Refusal::Setup(SetupError::RangeLength(self.short)),
            Refusal::Setup(SetupError::DopplerLength(self.short)),
            Refusal::Setup(SetupError::Band),
            Refusal::Setup(SetupError::NotFinite),
            Refusal::Weights,
            Refusal::PatchIndex,
            Refusal::Encoding,
            Refusal::PulseLength {
                expected: self.long,
                got: self.other,
            },
            Refusal::Chip { wanted, most },
            Refusal::Detect,
            Refusal::Unsupported,
        ];
        all.extend(quantities.map(|what| Refusal::Setup(SetupError::Size { what, wanted, most })));
        all
    }

    fn reports(&self) -> Vec<Report<'_>> {
        let (map, chip, crc, rows) = (self.long, self.long, self.other, self.short);
        let node = Node {
            transmitter_m: self.place_m,
            receiver_m: [self.real; 3],
        };
        let mut all = vec![
            Report::Identity {
                protocol: self.byte,
                arithmetic: [Arithmetic::Float, Arithmetic::Fixed][usize::from(self.byte % 2)],
                capacity: Capacity {
                    pulses: self.short,
                    frequencies: self.byte.into(),
                    range_bins: !self.short,
                    doppler_bins: self.short / 3,
                    patches: 1,
                },
                version: &self.text,
            },
            Report::MapStart {
                map,
                header: MapHeader {
                    sub_cpi: self.other,
                    patch_index: self.short,
                    num_pulses: !self.short,
                    patch: self.patch(),
                    time_s: [self.real, self.place_m[0]],
                    weight_sum: self.single,
                    nodes: [node, Node::default()],
                },
                encoding: self.encoding(),
            },
            Report::MapRow {
                map,
                row: rows,
                samples: &self.bytes,
            },
            Report::MapEnd { map, rows, crc },
            Report::ChipStart {
                chip,
                grid: self.grid(),
                maps: self.other,
                weight_sum: self.single,
            },
            Report::ChipRow {
                chip,
                row: rows,
                samples: &self.bytes,
            },
            Report::ChipEnd { chip, rows, crc },
            Report::Detections {
                map,
                sub_cpi: self.other,
                patch: self.short,
                first: !self.short,
                total: rows,
                list: &self.bytes,
            },
            Report::Log { text: &self.text },
        ];
        let states = [
            State::Idle,
            State::Ready,
            State::Running,
            State::Finishing,
            State::Done,
        ];
        all.extend(states.map(|state| {
            Report::Status(Status {
                state,
                configuration: self.long,
                run: self.other,
                next_pulse: !self.long,
                accept_through: self.long / 2,
                maps: self.byte.into(),
                link: LinkCounters {
                    frames: self.long,
                    corrupt: 1,
                    malformed: self.other,
                    too_long: 2,
                    version: 3,
                    lost: !self.other,
                    repeated: 4,
                },
                pulses: PulseCounters {
                    accepted: self.other,
                    lost: 5,
                    repeated: 6,
                    refused: 7,
                    dropped: 8,
                    at_limit: self.long,
                    saturated: 9,
                    incomplete: u32::MAX,
                },
            })
        }));
        all.extend(self.refusals().into_iter().map(|what| Report::Refused {
            sequence: self.long,
            what,
        }));
        all
    }
}

/// Most samples of 8 bytes that a message of `Values` may carry.
const SAMPLES: usize = 75;

/// Encodes all messages, sends them in pieces of `piece` bytes, and expects them all.
macro_rules! there_and_back {
    ($kind:ident, $messages:expr, $piece:expr) => {{
        let mut encoder = Encoder::new();
        let mut wire = Vec::new();
        let mut buffer = vec![0; max_frame_bytes(SAMPLES)];
        let mut expected = Vec::new();
        let mut number = 1;
        for message in $messages {
            let bytes = encoder.encode(&message, &mut buffer).expect("it fits");
            prop_assert_eq!(bytes.last(), Some(&0));
            prop_assert!(!bytes[..bytes.len() - 1].contains(&0));
            wire.extend_from_slice(bytes);
            if message.opens() {
                number = 0;
            }
            expected.push(Received {
                sequence: number,
                lost: 0,
                message,
            });
            number += 1;
        }
        let mut received = vec![0; max_received_bytes(SAMPLES)];
        let mut receiver = Receiver::new(&mut received);
        let mut due = expected.iter();
        for mut piece in wire.chunks($piece) {
            while let Some(frame) = receiver.receive::<$kind>(&mut piece) {
                prop_assert_eq!(frame.as_ref().ok(), due.next());
            }
        }
        prop_assert_eq!(due.next(), None);
        let frames = expected.len() as u32;
        prop_assert_eq!(
            receiver.counters(),
            &LinkCounters {
                frames,
                ..Default::default()
            }
        );
    }};
}

proptest! {
    #[test]
    fn every_message_comes_back(values in values(), piece in 1..700usize) {
        there_and_back!(Command, values.commands(), piece);
        there_and_back!(Report, values.reports(), piece);
    }

    /// Some message, none, or damage; never a panic, and the same however the bytes are split.
    #[test]
    fn any_bytes_may_come(
        bytes in prop::collection::vec(prop_oneof![2 => any::<u8>(), 1 => 0..4u8], 0..400),
        piece in 1..50usize,
        room in 0..40usize,
    ) {
        let (mut buffer, mut other) = (vec![0; room], vec![0; room]);
        let (mut by_byte, mut by_piece) = (Receiver::new(&mut buffer), Receiver::new(&mut other));
        for byte in &bytes {
            let _ = by_byte.push::<Command>(*byte);
        }
        for mut part in bytes.chunks(piece) {
            while by_piece.receive::<Command>(&mut part).is_some() {}
        }
        prop_assert_eq!(by_byte.counters(), by_piece.counters());
        prop_assert_eq!(by_byte.counters().frames, 0);
    }

    /// Any bytes behind a right head and CRC: a message that encodes to the same frame, or malformed.
    #[test]
    fn any_payload_may_come(
        variant in 0..12u8,
        payload in prop::collection::vec(any::<u8>(), 0..60),
    ) {
        let payload: Vec<u8> = std::iter::once(variant).chain(payload).collect();
        let frame = framed(1, &[0, 0, 0, 0], &payload);
        let mut buffer = [0; 100];
        for number in [0u32, 1] {
            let frame = if number == 0 { frame.clone() } else { framed(1, &number.to_le_bytes(), &payload) };
            let mut receiver = Receiver::new(&mut buffer);
            let _ = receiver.receive::<Command>(&mut frame.as_slice());
            let counters = *receiver.counters();
            prop_assert_eq!(counters.frames + counters.malformed, 1);
            let mut receiver = Receiver::new(&mut buffer);
            let _ = receiver.receive::<Report>(&mut frame.as_slice());
            let counters = *receiver.counters();
            prop_assert_eq!(counters.frames + counters.malformed, 1);
        }
    }

    #[test]
    fn samples_come_back(parts in prop::collection::vec(any::<(i16, i16)>(), 0..200), shift in any::<i8>()) {
        let short: Vec<Sc16> = parts.iter().map(|(re, im)| Sc16::from_bits(*re, *im)).collect();
        let floats: Vec<Complex32> = short.iter().map(|z| z.to_complex32() * 1.0e-3).collect();
        let reals: Vec<f32> = floats.iter().map(|z| z.re).collect();
        let mut buffer = vec![0; 8 * parts.len()];
        let bytes = write_complex32s(&floats, &mut buffer).expect("it fits");
        prop_assert!(complex32s(bytes).eq(floats.iter().copied()));
        let row = Row::new(Encoding::Complex32, floats.len(), bytes).expect("its length");
        prop_assert!(row.values().eq(floats.iter().copied()));
        let bytes = write_sc16s(&short, &mut buffer).expect("it fits");
        prop_assert_eq!(bytes.len(), 4 * short.len());
        prop_assert!(sc16s(bytes).eq(short.iter().copied()));
        let bytes = write_f32s(&reals, &mut buffer).expect("it fits");
        prop_assert!(f32s(bytes).eq(reals.iter().copied()));

        // Exponents from -64 up to 63, one for each 32 samples begun.
        let exponents: Vec<i8> =
            (0..BlockFloat::blocks(short.len())).map(|i| (shift / 2).wrapping_add(i as i8)).collect();
        let len = row_bytes(Encoding::Sc16, short.len()).expect("a number");
        prop_assert_eq!(len, 4 * short.len() + short.len().div_ceil(32));
        let mut buffer = vec![0; len];
        let bytes = write_block_row(&short, &exponents, &mut buffer).expect("it fits");
        let row = Row::new(Encoding::Sc16, short.len(), bytes).expect("its length");
        let mut count = 0;
        for (i, value) in row.values().enumerate() {
            // Exact: 16-bit mantissas times powers of two within the normal numbers.
            let scale = 2.0f64.powi(i32::from(exponents[i / 32])) / 32768.0;
            prop_assert_eq!(f64::from(value.re), f64::from(parts[i].0) * scale);
            prop_assert_eq!(f64::from(value.im), f64::from(parts[i].1) * scale);
            count += 1;
        }
        prop_assert_eq!(count, short.len());
        prop_assert_eq!(Row::new(Encoding::Sc16, short.len() + 1, bytes), None);
        if len > 0 {
            prop_assert!(write_block_row(&short, &exponents, &mut vec![0; len - 1]).is_none());
        }
    }
}

/// A frame by the description: CRC by another library, stuffing by the definition.
fn framed(version: u8, sequence: &[u8; 4], payload: &[u8]) -> Vec<u8> {
    let mut body = vec![version];
    body.extend(sequence);
    body.extend(payload);
    body.extend(crc32fast::hash(&body).to_le_bytes());
    assert!(body.len() < 254, "no piece longer than a code can say");
    let mut wire = Vec::new();
    for piece in body.split(|byte| *byte == 0) {
        wire.push(piece.len() as u8 + 1);
        wire.extend(piece);
    }
    wire.push(0);
    wire
}

/// A peer that speaks another version is told apart from noise.
#[test]
fn another_version_is_counted_as_such() {
    let mut buffer = [0; 32];
    let mut receiver = Receiver::new(&mut buffer);
    let wire = framed(2, &[0; 4], &[0]);
    let result = receiver.receive::<Command>(&mut wire.as_slice());
    let damage = result
        .expect("a frame's end")
        .expect_err("not of this version");
    assert_eq!(
        damage.to_string(),
        "a frame of protocol version 2; this side speaks 1"
    );
    assert_eq!(receiver.counters().version, 1);
    assert_eq!(receiver.counters().frames, 0);
}

/// The longest of every kind fits the sizes stated; with one byte less of room there is no frame, and
/// no number is used up.
#[test]
fn sizes_are_enough() {
    let full = Values {
        long: u32::MAX,
        other: u32::MAX,
        short: u16::MAX,
        byte: 255,
        real: -1.0e300,
        single: -1.0e30,
        place_m: [-1.1e300; 3],
        // Not one zero: the most codes.
        bytes: vec![0xA5; 8 * SAMPLES],
        text: "x".repeat(MAX_TEXT_BYTES),
    };
    let list = [0xA5; DetectionRecord::MOST * DetectionRecord::BYTES];
    let mut reports = full.reports();
    let long = u32::MAX;
    let short = u16::MAX;
    reports.push(Report::Detections {
        map: long,
        sub_cpi: long,
        patch: short,
        first: short,
        total: short,
        list: &list,
    });
    let mut encoder = Encoder::new();
    let mut buffer = vec![0; max_frame_bytes(SAMPLES)];
    let mut longest = 0;
    let mut check =
        |frame: Result<&[u8], EncodeError>| longest = longest.max(frame.expect("room").len());
    for command in full.commands() {
        check(encoder.encode(&command, &mut buffer));
    }
    for report in &reports {
        check(encoder.encode(report, &mut buffer));
    }
    assert!(
        longest + 192 > max_frame_bytes(SAMPLES),
        "{longest} is far below"
    );

    let without = max_frame_bytes(0);
    let has_samples = |report: &Report| {
        matches!(report, Report::MapRow { .. } | Report::ChipRow { .. })
            || matches!(report, Report::Detections { list, .. } if list.len() > 160)
    };
    for report in reports.iter().filter(|report| !has_samples(report)) {
        encoder
            .encode(report, &mut buffer[..without])
            .expect("no samples");
    }

    let mut encoder = Encoder::new();
    for report in &reports {
        let needed = encoder
            .clone()
            .encode(report, &mut buffer)
            .expect("room")
            .len();
        for room in [0, 1, 5, needed / 2, needed - 2, needed - 1] {
            let result = encoder.encode(report, &mut buffer[..room]);
            assert_eq!(result, Err(EncodeError::Room { room }));
        }
        // A number used up by a failure would change these bytes.
        let alone = encoder
            .clone()
            .encode(report, &mut buffer)
            .expect("room")
            .to_vec();
        assert_eq!(
            encoder.encode(report, &mut buffer[..needed]).expect("room"),
            alone
        );
    }
}

#[test]
fn detections_come_back() {
    let records: Vec<DetectionRecord> = (0..4)
        .map(|i| DetectionRecord {
            range_bin: i as f32 + 0.25,
            doppler_bin: 7.5,
            power: 1.0e-6,
            noise: 1.0e-9 * i as f32,
        })
        .collect();
    let mut bytes: Vec<u8> = records.iter().flat_map(DetectionRecord::to_bytes).collect();
    bytes.push(1); // of no whole record
    assert!(DetectionRecord::list(&bytes).eq(records));
}

fn golden_commands() -> Vec<(&'static str, Vec<u8>)> {
    let samples = [1i16, -2, 32767, -32768].map(i16::to_le_bytes).concat();
    let weights = [0.25f32, 0.5].map(f32::to_le_bytes).concat();
    let commands = [
        Command::Hello,
        Command::Configure(Configuration {
            id: 7,
            setup: Setup {
                num_pulses: 64,
                num_frequencies: 300,
                range_length: 512,
                doppler_length: 128,
                start_hz: 9.6e9,
                step_hz: 1.5e6,
            },
        }),
        Command::Weights {
            first: 128,
            weights: &weights,
        },
        Command::Patch {
            index: 3,
            count: 4,
            patch: GOLDEN_PATCH,
        },
        Command::Start {
            run: 300,
            first: 90,
        },
        Command::Pulse {
            pulse: Pulse {
                number: 70_000,
                time_s: 1.5,
                transmitter_m: [7000.0, 0.0, 7000.0],
                receiver_m: [7000.0, 1.0, 7000.0],
                reference_path_m: 19_798.75,
                weight: 0.75,
            },
            encoding: Encoding::Sc16,
            samples: &samples,
        },
        Command::Stop,
        Command::Status,
        Command::Abort,
        Command::Chip(GOLDEN_GRID),
        Command::Detect {
            training: 12,
            guard: 2,
            false_alarm: 1.0e-6,
        },
    ];
    let mut encoder = Encoder::new();
    let mut buffer = [0; 300];
    let frames = commands.map(|message| {
        encoder
            .encode(&message, &mut buffer)
            .expect("room")
            .to_vec()
    });
    COMMAND_FRAMES.into_iter().zip(frames).collect()
}

fn golden_reports() -> Vec<(&'static str, Vec<u8>)> {
    let row = [1.0f32, -1.0].map(f32::to_le_bytes).concat();
    let pixels = [0.0f32, 2.0].map(f32::to_le_bytes).concat();
    let list = [10.5f32, 7.25, 100.0, 2.0].map(f32::to_le_bytes).concat();
    let node = |y| Node {
        transmitter_m: [7000.0, y, 7000.0],
        receiver_m: [7000.0, y, 7000.0],
    };
    let reports = [
        Report::Identity {
            protocol: 1,
            arithmetic: Arithmetic::Fixed,
            capacity: Capacity {
                pulses: 64,
                frequencies: 512,
                range_bins: 512,
                doppler_bins: 127,
                patches: 16,
            },
            version: "module 0.1.0",
        },
        Report::Status(Status {
            state: State::Running,
            configuration: 7,
            run: 300,
            next_pulse: 130,
            accept_through: 256,
            maps: 1000,
            link: LinkCounters {
                frames: 900,
                corrupt: 1,
                malformed: 2,
                too_long: 3,
                version: 4,
                lost: 5,
                repeated: 6,
            },
            pulses: PulseCounters {
                accepted: 129,
                lost: 1,
                repeated: 2,
                refused: 3,
                dropped: 4,
                at_limit: 500,
                saturated: 6,
                incomplete: 7,
            },
        }),
        Report::MapStart {
            map: 5,
            header: MapHeader {
                sub_cpi: 4,
                patch_index: 3,
                num_pulses: 64,
                patch: GOLDEN_PATCH,
                time_s: [1.5, 2.5],
                weight_sum: 60.5,
                nodes: [node(-1.0), node(1.0)],
            },
            encoding: Encoding::Complex32,
        },
        Report::MapRow {
            map: 5,
            row: 14,
            samples: &row,
        },
        Report::MapEnd {
            map: 5,
            rows: 15,
            crc: 0xDEAD_BEEF,
        },
        Report::ChipStart {
            chip: 0,
            grid: GOLDEN_GRID,
            maps: 6,
            weight_sum: 384.0,
        },
        Report::ChipRow {
            chip: 0,
            row: 99,
            samples: &pixels,
        },
        Report::ChipEnd {
            chip: 0,
            rows: 100,
            crc: 0,
        },
        Report::Detections {
            map: 5,
            sub_cpi: 4,
            patch: 3,
            first: 0,
            total: 1,
            list: &list,
        },
        Report::Refused {
            sequence: 17,
            what: Refusal::Setup(SetupError::Size {
                what: Quantity::DopplerBand,
                wanted: 5000,
                most: 4096,
            }),
        },
        Report::Log {
            text: "ready: 25 °C",
        },
    ];
    let mut encoder = Encoder::new();
    let mut buffer = [0; 300];
    let frames = reports.map(|message| {
        encoder
            .encode(&message, &mut buffer)
            .expect("room")
            .to_vec()
    });
    REPORT_FRAMES.into_iter().zip(frames).collect()
}

/// The format cannot change unnoticed: a change of any of these is a new protocol version.
#[test]
fn frames_have_the_bytes_described() {
    for (expected, frame) in golden_commands().into_iter().chain(golden_reports()) {
        let hex: String = frame.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, expected);
    }
}

const GOLDEN_PATCH: Patch = Patch {
    centre_m: [1.0, -2.0, 0.5],
    range_reach: 20,
    doppler_reach: 7,
};

const GOLDEN_GRID: ChipGrid = ChipGrid {
    origin_m: [0.0; 3],
    column_step_m: [0.25, 0.0, 0.0],
    row_step_m: [0.0, 0.25, 0.0],
    num_columns: 200,
    num_rows: 100,
};

// Made from the tables at the head of `subaperture_core::link` by a program in another language, with
// another library's CRC.
const COMMAND_FRAMES: [&str; 11] = [
    // Hello
    "0201010101010506729e7a00",
    // Configure
    "03010101010a010740ac028004800101010105a3e101420101010960e33641149e0a4d00",
    // Weights
    "030102010105028001080103803e0101063fb942eeb000",
    // Patch
    "030103010104030304010101010103f03f01010101010102c0010101010109e03f1407d0c632c200",
    // Start
    "03010401010804ac02f1c172b600",
    // Pulse
    "03010501010505f0a204010101010103f83f010101010458bb400101010101010101010101010458bb4001010101\
     0458bb40010101010103f03f010101010458bb4001010105b055d3400106403f01080105feffff7f06809da70a36\
     00",
    // Stop
    "030106010106069322bd1c00",
    // Status
    "03010701010607b53bda5600",
    // Abort
    "03010801010608f5b1354400",
    // Chip
    "03010901010209010101010101010101010101010101010101010101010101010101010103d03f01010101010101\
     0101010101010101010101010101010101010101010103d03f0101010101010108c80164e918293200",
    // Detect
    "03010a0101100a0c028dedb5a0f7c6b03e2d0ae7c800",
];
const REPORT_FRAMES: [&str; 11] = [
    // Identity
    "0201010101011b010140800480047f100c6d6f64756c6520302e312e3087f123ca00",
    // Status
    "030101010122010207ac0282018002e8078407010203040506810101020304f4030607ce722b5e00",
    // MapStart
    "0301020101060205040340010101010103f03f01010101010102c0010101010105e03f1407010101010103f83f01\
     0101010103044001037242010101010458bb40010101010103f0bf010101010458bb40010101010458bb40010101\
     010103f0bf010101010458bb40010101010458bb40010101010103f03f010101010458bb40010101010458bb4001\
     0101010103f03f010101010458bb4005f095785f00",
    // MapRow
    "03010301010503050e080103803f010780bfcc6fc59900",
    // MapEnd
    "03010401010d04050feffdb6f50d6342e1fe00",
    // ChipStart
    "0301050101020501010101010101010101010101010101010101010101010101010101010103d03f010101010101\
     010101010101010101010101010101010101010101010103d03f0101010101010105c80164060107c04369a6cdf4\
     00",
    // ChipRow
    "03010601010206036308010101010101064001aa310500",
    // ChipEnd
    "03010701010207026405ee9ff16700",
    // Detections
    "03010801010508050403030110010328410103e8400103c842010106405738f18000",
    // Refused
    "0301090101040911030a058827802068f6993b00",
    // Log
    "03010a0101140a0d72656164793a20323520c2b043a248977a00",
];
