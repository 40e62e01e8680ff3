//! Bytes of one frame of every message, so that the format cannot change unnoticed.

use subaperture_core::Pulse;
use subaperture_core::cfar::{Cfar, TrainingWindow};
use subaperture_core::dpca::{Dpca, DpcaError};
use subaperture_core::link::{
    Arithmetic, ChipGrid, Command, Configuration, Encoder, Encoding, Event, ImageCapacity,
    Increment, Level, LinkCounters, Motion, MotionConfiguration, PixelEncoding, ProfileHeader,
    Refusal, Report, State, Status, SweepConfiguration,
};
use subaperture_core::stream::{
    Capacity, MapHeader, Node, Patch, PulseCounters, Quantity, Setup, SetupError,
};
use subaperture_core::{motion, sweep};

fn golden_commands() -> Vec<(&'static str, Vec<u8>)> {
    let samples = [1i16, -2, 32767, -32768].map(i16::to_le_bytes).concat();
    let weights = [0.25f32, 0.5].map(f32::to_le_bytes).concat();
    let places = [-0.02, 0.0, 0.0, 0.25, 0.5, -1.0].map(f64::to_le_bytes);
    let places = places.concat();
    let commands = [
        Command::Hello,
        Command::Configure(Configuration {
            id: 7,
            setup: Setup {
                num_pulses: 64,
                num_channels: 1,
                num_frequencies: 300,
                range_length: 512,
                doppler_length: 128,
                start_hz: 9.6e9,
                step_hz: 1.5e6,
            },
            total_pulses: 70_000,
            send_maps: true,
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
            pulse: GOLDEN_PULSE,
            encoding: Encoding::Sc16,
            samples: &samples,
        },
        Command::Stop,
        Command::Status,
        Command::Abort,
        Command::Chip(GOLDEN_GRID),
        Command::Detect(Cfar {
            range: TrainingWindow {
                guard: 2,
                training: 12,
            },
            doppler: TrainingWindow {
                guard: 1,
                training: 300,
            },
            false_alarm_probability: 1.0e-6,
        }),
        Command::Motion(MotionConfiguration {
            id: 8,
            setup: motion::Setup {
                num_frequencies: 256,
                range_length: 1024,
                start_hz: 77e9,
                step_hz: 3.906_25e6,
                side_lobe_db: 50.0,
                ranges_m: [1.0, 30.0],
                guard: 3,
                training: 12,
                rank: 0.75,
                false_alarm_probability: 1e-5,
                least_snr_db: 10.0,
                follow: motion::TrackerSettings {
                    gate_cells: 0.5,
                    acceleration_cells: 0.01,
                    apart_cells: 1.5,
                    seen: 5,
                    within: 8,
                    bridge: 300,
                },
            },
        }),
        Command::Antennas {
            transmitters: 1,
            places: &places,
        },
        Command::Channel {
            pulse: 70_000,
            channel: 3,
            reference_path_m: 2.5,
            encoding: Encoding::Sc16,
            samples: &samples,
        },
        Command::Profiles(SweepConfiguration {
            id: 9,
            setup: sweep::Setup {
                carriers: 50,
                period: 8,
                samples: 1000,
                bins: 128,
                start_hz: 1.100_125e9,
                step_hz: 4e6,
            },
        }),
        Command::Burst {
            sweep: 70_000,
            carrier: 49,
            first: 936,
            samples: &samples,
        },
        Command::Sweep { sweep: 70_000 },
        Command::Accumulated { first: 512 },
        Command::SendChip { patch: 3 },
        Command::Log {
            least: Some(Level::Warn),
        },
        Command::StartFrontEnd {
            run: 300,
            first: 90,
        },
        Command::Geometry {
            pulse: GOLDEN_PULSE,
        },
        Command::Power,
        Command::Dpca(Dpca { lag_pulses: -1.75 }),
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
    let bins = [1.0f32, -2.0].map(f32::to_le_bytes).concat();
    let pixels = [0.0f32, 2.0].map(f32::to_le_bytes).concat();
    let list = [10.5f32, 7.25, 100.0, 2.0, 1.5, -0.5, 0.25, 4.0];
    let list = list.map(f32::to_le_bytes).concat();
    let node = |y| Node {
        transmitter_m: [7000.0, y, 7000.0],
        receiver_m: [7000.0, y, 7000.0],
    };
    let reports = [
        Report::Identity {
            protocol: 3,
            arithmetic: Arithmetic::Fixed,
            capacity: Capacity {
                pulses: 64,
                frequencies: 512,
                range_bins: 512,
                doppler_bins: 127,
                patches: 16,
            },
            image: ImageCapacity {
                pixels: 32_768,
                sub_cpis: 16_384,
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
                channel: 0,
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
            left_out: 200,
            encoding: PixelEncoding::Sc16,
        },
        Report::ChipPart {
            chip: 0,
            part: 99,
            samples: &pixels,
        },
        Report::ChipEnd {
            chip: 0,
            parts: 100,
            crc: 0,
        },
        Report::Detections {
            map: 5,
            sub_cpi: 4,
            patch: 3,
            first: 0,
            total: 1,
            channels: 2,
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
        Report::Event(Event::StepTooLong {
            taken_us: 90_001,
            most_us: 88_888,
        }),
        Report::Increment(Increment {
            pulse: 70_001,
            since: 70_000,
            targets: 4,
            echoes: 300,
            motion: Some(Motion {
                moved_m: [0.000_976_562_5, -0.5],
                turn_rad: 0.25,
                residual_m: 0.125,
                targets: 3,
                doubtful: 1,
            }),
        }),
        Report::Increment(Increment {
            pulse: 90,
            since: 90,
            targets: 0,
            echoes: 2,
            motion: None,
        }),
        Report::Refused {
            sequence: 17,
            what: Refusal::Motion(motion::SetupError::Frequencies {
                wanted: 300,
                most: 256,
            }),
        },
        Report::ProfileStart {
            profile: 6,
            header: ProfileHeader {
                sweep: 70_000,
                usable: 49,
                taken: 49_936,
                bins: 128,
                row_bins: 64,
            },
        },
        Report::ProfileRow {
            profile: 6,
            row: 1,
            samples: &bins,
        },
        Report::ProfileEnd {
            profile: 6,
            rows: 2,
            crc: 0xDEAD_BEEF,
        },
        Report::Refused {
            sequence: 17,
            what: Refusal::Sweep(sweep::SetupError::Size {
                what: sweep::Quantity::Bins,
                wanted: 4096,
                least: 50,
                most: 512,
            }),
        },
        Report::Accumulated {
            first: 512,
            bits: &[0xFF, 0x01],
        },
        Report::Refused {
            sequence: 18,
            what: Refusal::SubCpis {
                wanted: 20_000,
                most: 16_384,
            },
        },
        Report::Refused {
            sequence: 19,
            what: Refusal::Channels { wanted: 5, most: 4 },
        },
        Report::Refused {
            sequence: 20,
            what: Refusal::Dpca(DpcaError::LagTooLong {
                found: 300,
                most: 16,
            }),
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

/// A change of any of these frames requires a new protocol version.
#[test]
fn frame_bytes_match_format_description() {
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
    patch: 3,
    origin_m: [0.0; 3],
    column_step_m: [0.25, 0.0, 0.0],
    row_step_m: [0.0, 0.25, 0.0],
    num_columns: 200,
    num_rows: 100,
};

// Generated from the tables in `subaperture_core::link` by a program in another language with another CRC library.
const GOLDEN_PULSE: Pulse = Pulse {
    number: 70_000,
    time_s: 1.5,
    transmitter_m: [7000.0, 0.0, 7000.0],
    receiver_m: [7000.0, 1.0, 7000.0],
    reference_path_m: 19_798.75,
    weight: 0.75,
};

const COMMAND_FRAMES: [&str; 24] = [
    // Hello
    "020301010101050dd3563700",
    // Configure
    "03030101010b01074001ac028004800101010105a3e101420101010d60e33641f0a204019397314900",
    // Weights
    "030302010105028001080103803e0101063f7ed2d26400",
    // Patch
    "030303010104030304010101010103f03f01010101010102c0010101010109e03f1407bc64368b00",
    // Start
    "03030401010904ac025aaacf46bd00",
    // Pulse
    "03030501010505f0a204010101010103f83f010101010458bb400101010101010101010101010458bb400101010104\
     58bb40010101010103f03f010101010458bb4001010105b055d3400106403f01080105feffff7f068034d981b600",
    // Stop
    "030306010106069883755100",
    // Status
    "03030701010607be9a121b00",
    // Abort
    "03030801010608fe10fd0900",
    // Chip
    "0303090101030903010101010101010101010101010101010101010101010101010101010103d03f01010101010101\
     0101010101010101010101010101010101010101010103d03f0101010101010108c801643ce99e4000",
    // Detect
    "03030a0101130a020c01ac028dedb5a0f7c6b03e7288f8bb00",
    // Motion
    "03030b0101070b0880028008010106c28eed31420101010565cd4d410101010101034940010101010103f03f010101\
     0101053e40030c01010101010be83ff168e388b5f8e43e010101010103244001010101010be03f7b14ae47e17a843f\
     01010101010bf83f0508ac02b55f217200",
    // Antennas
    "03030c01010c0c01307b14ae47e17a94bf01010101010101010101010101010101010101010103d03f010101010103\
     e03f010101010107f0bfbb72ab7e00",
    // Channel
    "03030d0101060df0a20403010101010106044001080105feffff7f06802c4eaa1800",
    // Profiles
    "03030e0101090e093208e8078001010106d2a464d0410101010980844e4199145f6f00",
    // Burst
    "03030f01010a0ff0a20431a807080105feffff7f0680a5ce043700",
    // Sweep
    "03031001010910f0a2047d27bedd00",
    // Accumulated
    "030311010108118004e5da0e0b00",
    // SendChip
    "03031201010712031a47670300",
    // Log
    "0303130101081301012742e7cd00",
    // StartFrontEnd
    "03031401010914ac025a1ea9e49100",
    // Geometry
    "03031501010515f0a204010101010103f83f010101010458bb400101010101010101010101010458bb400101010104\
     58bb40010101010103f03f010101010458bb4001010105b055d3400107403f676a99a400",
    // Power
    "030316010106167e04222c00",
    // Dpca
    "03031701010217010101010107fcbf8ad3d84f00",
];
const REPORT_FRAMES: [&str; 22] = [
    // Identity
    "02030101010121030140800480047f108080028080010c6d6f64756c6520302e312e300777c5c100",
    // Status
    "030301010122010207ac0282018002e8078407010203040506810101020304f4030607a2d02f1700",
    // MapStart
    "030302010105020504030240010101010103f03f01010101010102c0010101010105e03f1407010101010103f83f01\
     0101010103044001037242010101010458bb40010101010103f0bf010101010458bb40010101010458bb4001010101\
     0103f0bf010101010458bb40010101010458bb40010101010103f03f010101010458bb40010101010458bb40010101\
     010103f03f010101010458bb400528499bed00",
    // MapRow
    "03030301010503050e080103803f010780bf0bfff94d00",
    // MapEnd
    "03030401010d04050feffdb6f50d28f7bd9e00",
    // ChipStart
    "030305010102050203010101010101010101010101010101010101010101010101010101010103d03f010101010101\
     010101010101010101010101010101010101010101010103d03f0101010101010105c80164060106c043c801010473\
     cf8000",
    // ChipPart
    "030306010102060363080101010101010640c63a0dd100",
    // ChipEnd
    "0303070101020702640568b7074900",
    // Detections
    "0303080101050805040304010220010328410103e8400103c842010102400103c03f010102bf0103803e010780408e\
     59cd3b00",
    // Refused
    "0303090101040911030a0588278020c532f7da00",
    // Event
    "03030a01010d0a0991bf05b8b6053e631a2600",
    // Increment
    "03030b01010c0bf1a204f0a20404ac0201010101010103503f010101010103e0bf010101010103d03f0101083e0301\
     81fc8dac00",
    // Increment without a motion
    "03030c0101040b5a5a0202058e9dbb6600",
    // Refused, for a motion setup
    "03030d01010409110b09ac02800284dc844900",
    // ProfileStart
    "03030e0101110c06f0a2043190860380014071ca8fb800",
    // ProfileRow
    "03030f0101050d0601080103803f010106c0b7363a9000",
    // ProfileEnd
    "03031001010d0e0602effdb6f50d2034158d00",
    // Refused, for a range-profile setup
    "03031101010409110d0b03802032800403dcf96d00",
    // Accumulated
    "03031201010b0f800402ff01a20a4bf900",
    // Refused: sub-CPIs
    "03031301010e09120ea09c018080019f62f27e00",
    // Refused
    "03031401010a09130f0504692d6bc700",
    // Refused, for a clutter cancellation
    "03031501010c09141003ac0210c697835300",
];
