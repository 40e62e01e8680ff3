//! One of every message, with values chosen by proptest.

use proptest::prelude::*;
use subaperture_core::cfar::{Cfar, TrainingWindow};
use subaperture_core::dpca::{Dpca, DpcaError};
use subaperture_core::link::{
    Arithmetic, ChipGrid, Command, Configuration, Encoding, Event, ImageCapacity, Increment, Level,
    LinkCounters, Motion, MotionConfiguration, PixelEncoding, ProfileHeader, Refusal, Report,
    State, Status, SweepConfiguration,
};
use subaperture_core::stream::{
    Capacity, MapHeader, Node, Patch, PulseCounters, Quantity, Setup, SetupError,
};
use subaperture_core::{Pulse, motion, sweep};

/// Values that messages are built from.
#[derive(Clone, Debug)]
pub(super) struct Values {
    pub(super) long: u32,
    pub(super) other: u32,
    pub(super) short: u16,
    pub(super) byte: u8,
    pub(super) real: f64,
    pub(super) single: f32,
    pub(super) place_m: [f64; 3],
    pub(super) bytes: Vec<u8>,
    pub(super) text: String,
}

pub(super) fn values() -> impl Strategy<Value = Values> {
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
            patch: self.byte.into(),
            origin_m: self.place_m,
            column_step_m: self.place_m.map(|x| x / 2.0),
            row_step_m: [self.real; 3],
            num_columns: self.short,
            num_rows: self.byte.into(),
        }
    }

    fn pulse(&self) -> Pulse {
        Pulse {
            number: self.other,
            time_s: self.real,
            transmitter_m: self.place_m,
            receiver_m: self.place_m.map(|x| -x),
            reference_path_m: self.place_m[2],
            weight: self.single,
        }
    }

    fn pixel_encoding(&self) -> PixelEncoding {
        [
            PixelEncoding::Complex32,
            PixelEncoding::Sc16,
            PixelEncoding::Power,
        ][usize::from(self.byte % 3)]
    }

    fn encoding(&self) -> Encoding {
        [Encoding::Complex32, Encoding::Sc16][usize::from(self.byte % 2)]
    }

    pub(super) fn motion_setup(&self) -> motion::Setup {
        let [near, far, length] = self.place_m;
        motion::Setup {
            num_frequencies: self.short,
            range_length: !self.short,
            start_hz: self.real,
            step_hz: length,
            side_lobe_db: near,
            ranges_m: [near, far],
            guard: self.byte.into(),
            training: self.short,
            rank: far,
            false_alarm_probability: length,
            least_snr_db: self.real,
            follow: motion::TrackerSettings {
                gate_cells: far,
                acceleration_cells: near,
                apart_cells: self.real,
                seen: self.byte.into(),
                within: self.short,
                bridge: !self.short,
            },
        }
    }

    pub(super) fn commands(&self) -> Vec<Command<'_>> {
        let (first, index, count) = (self.short, self.short, self.byte.into());
        vec![
            Command::Hello,
            Command::Configure(Configuration {
                id: self.long,
                setup: Setup {
                    num_pulses: self.short,
                    num_channels: 1,
                    num_frequencies: self.byte.into(),
                    range_length: !self.short,
                    doppler_length: 0,
                    start_hz: self.real,
                    step_hz: self.place_m[1],
                },
                total_pulses: self.other,
                send_maps: self.byte % 2 == 1,
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
                pulse: self.pulse(),
                encoding: self.encoding(),
                samples: &self.bytes,
            },
            Command::Stop,
            Command::Status,
            Command::Abort,
            Command::Chip(self.grid()),
            Command::Detect(Cfar {
                range: TrainingWindow {
                    guard: self.byte.into(),
                    training: self.short,
                },
                doppler: TrainingWindow {
                    guard: self.short,
                    training: self.byte.into(),
                },
                false_alarm_probability: self.real,
            }),
            Command::Motion(MotionConfiguration {
                id: self.long,
                setup: self.motion_setup(),
            }),
            Command::Antennas {
                transmitters: self.short,
                places: &self.bytes,
            },
            Command::Channel {
                pulse: self.other,
                channel: self.short,
                reference_path_m: self.real,
                encoding: self.encoding(),
                samples: &self.bytes,
            },
            Command::Profiles(SweepConfiguration {
                id: self.long,
                setup: sweep::Setup {
                    carriers: self.short,
                    period: self.byte.into(),
                    samples: self.other,
                    bins: !self.short,
                    start_hz: self.real,
                    step_hz: self.place_m[1],
                },
            }),
            Command::Burst {
                sweep: self.other,
                carrier: self.short,
                first: self.long,
                samples: &self.bytes,
            },
            Command::Sweep { sweep: self.long },
            Command::Accumulated { first: self.other },
            Command::SendChip { patch: self.short },
            Command::Log {
                least: [
                    None,
                    Some(Level::Info),
                    Some(Level::Warn),
                    Some(Level::Error),
                ][usize::from(self.byte % 4)],
            },
            Command::StartFrontEnd {
                run: self.other,
                first: self.long,
            },
            Command::Geometry {
                pulse: self.pulse(),
            },
            Command::Power,
            Command::Dpca(Dpca {
                lag_pulses: self.real,
            }),
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
            Quantity::Channels,
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
            Refusal::SubCpis { wanted, most },
            Refusal::Channels {
                wanted: self.short,
                most: !self.short,
            },
            Refusal::Detect,
            Refusal::Unsupported,
            Refusal::Antennas,
        ];
        let (few, many) = (self.short, self.byte.into());
        all.extend(
            [
                DpcaError::Channels { found: few },
                DpcaError::NoLag,
                DpcaError::NotFinite,
                DpcaError::LagTooLong {
                    found: wanted,
                    most: few,
                },
                DpcaError::Map { wanted, most },
            ]
            .map(Refusal::Dpca),
        );
        all.extend(
            [
                motion::SetupError::Frequencies {
                    wanted: few,
                    most: many,
                },
                motion::SetupError::RangeLength {
                    wanted: many,
                    most: few,
                },
                motion::SetupError::Band,
                motion::SetupError::Window,
                motion::SetupError::Ranges,
                motion::SetupError::Detection,
                motion::SetupError::Tracker,
                motion::SetupError::Channels { most: few },
                motion::SetupError::Array,
            ]
            .map(Refusal::Motion),
        );
        all.extend(
            [
                sweep::Quantity::Carriers,
                sweep::Quantity::Period,
                sweep::Quantity::Samples,
                sweep::Quantity::Bins,
                sweep::Quantity::Weights,
            ]
            .map(|what| sweep::SetupError::Size {
                what,
                wanted,
                least: few.into(),
                most,
            })
            .map(Refusal::Sweep),
        );
        all.extend(
            [
                sweep::SetupError::NoPowerOfTwo(few),
                sweep::SetupError::Band,
                sweep::SetupError::NotFinite,
            ]
            .map(Refusal::Sweep),
        );
        all.extend(quantities.map(|what| Refusal::Setup(SetupError::Size { what, wanted, most })));
        all
    }

    fn events(&self) -> Vec<Event> {
        let (one, other) = (self.long, self.other);
        let mut all = vec![
            Event::Started { faults: one },
            Event::RunStarted { run: one },
            Event::RunEnded {
                run: one,
                pulses: other,
                maps: self.short.into(),
            },
            Event::FramesDamaged { frames: one },
            Event::FramesLost { frames: one },
            Event::PulsesDropped { pulses: other },
            Event::SamplesAtLimit { samples: one },
            Event::ResultsSaturated { results: other },
            Event::StepTooLong {
                taken_us: one,
                most_us: other,
            },
            Event::EventsDropped { events: one },
            Event::RunCost {
                stack_bytes: one,
                stack_size_bytes: other,
                kiloticks: one,
                ticks_hz: other,
            },
        ];
        all.extend(self.refusals().into_iter().map(Event::Refused));
        all
    }

    pub(super) fn reports(&self) -> Vec<Report<'_>> {
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
                image: ImageCapacity {
                    pixels: self.long,
                    sub_cpis: self.other,
                },
                version: &self.text,
            },
            Report::MapStart {
                map,
                header: MapHeader {
                    sub_cpi: self.other,
                    patch_index: self.short,
                    channel: 0,
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
                left_out: self.long,
                encoding: self.pixel_encoding(),
            },
            Report::Accumulated {
                first: self.other,
                bits: &self.bytes,
            },
            Report::ChipPart {
                chip,
                part: rows,
                samples: &self.bytes,
            },
            Report::ChipEnd {
                chip,
                parts: rows,
                crc,
            },
            Report::Detections {
                map,
                sub_cpi: self.other,
                patch: self.short,
                first: !self.short,
                total: rows,
                channels: self.short,
                list: &self.bytes,
            },
            Report::ProfileStart {
                profile: self.long,
                header: ProfileHeader {
                    sweep: self.other,
                    usable: self.short,
                    taken: !self.long,
                    bins: self.byte.into(),
                    row_bins: !self.short,
                },
            },
            Report::ProfileRow {
                profile: self.other,
                row: self.short,
                samples: &self.bytes,
            },
            Report::ProfileEnd {
                profile: self.long,
                rows,
                crc,
            },
        ];
        let motion = Motion {
            moved_m: [self.real, self.place_m[1]],
            turn_rad: self.place_m[0],
            residual_m: self.single,
            targets: self.short,
            doubtful: self.byte.into(),
        };
        all.extend([None, Some(motion)].map(|motion| {
            Report::Increment(Increment {
                pulse: self.long,
                since: self.other,
                targets: self.byte.into(),
                echoes: self.short,
                motion,
            })
        }));
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
        all.extend(self.events().into_iter().map(Report::Event));
        all.extend(self.refusals().into_iter().map(|what| Report::Refused {
            sequence: self.long,
            what,
        }));
        all
    }
}

/// Maximum number of samples of 8 bytes in a message of `Values`.
pub(super) const SAMPLES: usize = 75;
