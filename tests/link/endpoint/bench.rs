//! An endpoint in memory, and the reports a host receives from it.

use num_complex::Complex32;
use subaperture_core::accumulate::ChipKernel;
use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
use subaperture_core::link::{
    CHIP_PART_PIXELS, ChipAssembly, ChipGrid, Command, Configuration, Encoder, Encoding, Event,
    Increment, MapAssembly, ProfileAssembly, Receiver, Refusal, Report, State, Status, detections,
    max_frame_bytes, max_received_bytes, sc16s, write_complex32s, write_f32s, write_sc16s,
};
use subaperture_core::motion::Odometer;
use subaperture_core::stream::{
    BlockFloat, FixedBuffers, FixedEngine, FloatBuffers, FloatEngine, MapHeader, MapSamples,
    PatchMap, SubCpiProcessor,
};
use subaperture_core::{Pulse, Sc16};
use subaperture_firmware::endpoint::{Endpoint, LinkBuffers};
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::products::{Chip as ChipPlace, NO_VALUES, ProductBuffers};
use subaperture_tests::stream_scene::{Scene, patch};
use subaperture_tests::sweep_scene::{BINS, SceneProfiler};

/// Pulses per sub-CPI, frequencies, range bins, Doppler rows and patches of the test modules.
pub(crate) const M: usize = 8;
pub(crate) const F: usize = 32;
pub(crate) const R: usize = 64;
pub(crate) const ROWS: usize = 15;
pub(crate) const PATCHES: usize = 3;
/// Maximum number of pixels of their chips.
pub(crate) const PIXELS: usize = 128;
pub(crate) const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// Received map.
pub(crate) struct Came {
    pub(crate) header: MapHeader,
    pub(crate) values: Vec<Complex32>,
    pub(crate) mantissas: Vec<Sc16>,
    pub(crate) exponents: Vec<i8>,
}

impl Came {
    pub(crate) fn view(&self) -> PatchMap<'_> {
        PatchMap {
            header: self.header,
            samples: match self.mantissas.is_empty() {
                true => MapSamples::Float(&self.values),
                false => MapSamples::Fixed(BlockFloat {
                    mantissas: &self.mantissas,
                    exponents: &self.exponents,
                }),
            },
        }
    }
}

/// Detection and the values of its channels.
pub(crate) type Target = (Detection, Vec<Complex32>);

/// Frame of detections: map, sub-CPI, patch, index of the first, total number, detections.
pub(crate) type Listed = (u32, u32, u16, u16, u16, Vec<Target>);

/// Odometer of the test modules.
pub(crate) type BenchOdometer = Odometer<8, 4, 64, 256>;

/// Received chip: grid, maps, sum of the weights, pixels.
pub(crate) type Chip = (ChipGrid, u32, f32, Vec<Complex32>);

/// Received profile: sweep, usable carriers, number of samples, values.
pub(crate) type ProfileCame = (u32, u16, u32, Vec<Complex32>);

/// Station with everything a host received from it.
pub(crate) struct Bench<E: WireEngine + 'static> {
    pub(crate) endpoint: Endpoint<'static, E>,
    pub(crate) receiver: Receiver<'static>,
    pub(crate) map: MapAssembly<'static>,
    pub(crate) chip: ChipAssembly<'static>,
    pub(crate) encoder: Encoder,
    /// Sequence number of the last command.
    pub(crate) sequence: u32,
    pub(crate) identities: u32,
    pub(crate) status: Option<Status>,
    pub(crate) refused: Vec<(u32, Refusal)>,
    pub(crate) maps: Vec<Came>,
    pub(crate) chips: Vec<Chip>,
    pub(crate) detections: Vec<Listed>,
    /// Last list of accumulated sub-CPIs.
    pub(crate) accumulated: Option<(u32, Vec<u8>)>,
    /// Whether configurations request maps.
    pub(crate) send_maps: bool,
    pub(crate) increments: Vec<Increment>,
    pub(crate) events: Vec<Event>,
    pub(crate) profile: ProfileAssembly<'static>,
    pub(crate) profiles: Vec<ProfileCame>,
}

pub(crate) fn float() -> Bench<FloatEngine<'static>> {
    let buffers = Box::leak(Box::new(FloatBuffers::<M, F, R, ROWS, PATCHES>::new()));
    Bench::new(buffers.processor(), F)
}

pub(crate) fn fixed() -> Bench<FixedEngine<'static>> {
    let buffers = Box::leak(Box::new(FixedBuffers::<M, F, R, ROWS, 2, PATCHES>::new()));
    Bench::new(buffers.processor().unwrap(), F)
}

impl<E: WireEngine + 'static> Bench<E> {
    /// Create with link buffers for `frequencies`, as in the application.
    pub(crate) fn new(processor: SubCpiProcessor<'static, E>, frequencies: usize) -> Self {
        Self::with_row(processor, frequencies, frequencies.max(CHIP_PART_PIXELS))
    }

    /// Create with a row buffer for this many samples.
    pub(crate) fn with_row(
        processor: SubCpiProcessor<'static, E>,
        frequencies: usize,
        row: usize,
    ) -> Self {
        let link = LinkBuffers {
            received: vec![0; max_received_bytes(frequencies)].leak(),
            frame: vec![0; max_frame_bytes(frequencies.max(CHIP_PART_PIXELS))].leak(),
            row: vec![0; 8 * row].leak(),
        };
        let products = ProductBuffers {
            pixels: vec![Complex32::ZERO; PIXELS].leak(),
            chips: vec![ChipPlace::EMPTY; PATCHES].leak(),
            accumulated: vec![0; 2].leak(),
            kernel: Box::leak(Box::new(ChipKernel::new())),
            columns: vec![Column::EMPTY; frequencies].leak(),
            values: Box::leak(Box::new(NO_VALUES)),
        };
        Self {
            endpoint: Endpoint::new(processor, link, products, "bench")
                .with_odometer(Box::leak(Box::new(BenchOdometer::new())))
                .with_profiler(Box::leak(Box::new(SceneProfiler::new()))),
            receiver: Receiver::new(vec![0; max_received_bytes(PIXELS)].leak()),
            map: MapAssembly::new(vec![0; 9 * F * ROWS].leak()),
            chip: ChipAssembly::new(vec![0; 8 * PIXELS].leak()),
            encoder: Encoder::new(),
            sequence: 0,
            identities: 0,
            status: None,
            refused: Vec::new(),
            maps: Vec::new(),
            chips: Vec::new(),
            detections: Vec::new(),
            accumulated: None,
            send_maps: true,
            increments: Vec::new(),
            events: Vec::new(),
            profile: ProfileAssembly::new(vec![0; 8 * BINS].leak()),
            profiles: Vec::new(),
        }
    }

    /// Send a command and let the endpoint work until idle. Returns the refusal, if any.
    pub(crate) fn send(&mut self, command: &Command<'_>) -> Option<Refusal> {
        let mut wire = vec![0; max_frame_bytes(2 * F)];
        let bytes = self.encoder.encode(command, &mut wire).unwrap();
        self.sequence += 1;
        self.endpoint.receive(bytes);
        self.settle();
        let mine = |refused: &&(u32, Refusal)| refused.0 == self.sequence;
        self.refused.iter().find(mine).map(|(_, what)| *what)
    }

    pub(crate) fn settle(&mut self) {
        loop {
            let bytes = self.endpoint.pending().to_vec();
            if bytes.is_empty() && !self.endpoint.work() && self.endpoint.pending().is_empty() {
                return;
            }
            self.endpoint.sent(bytes.len());
            self.hear(&bytes);
        }
    }

    pub(crate) fn hear(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.receiver.receive::<Report<'_>>(&mut bytes) {
            let report = frame.expect("a line without faults").message;
            if let Some(map) = self.map.take(&report).expect("a map without faults") {
                let header = map.header;
                let rows = map.rows();
                let values = rows
                    .flat_map(|row| row.values().collect::<Vec<_>>())
                    .collect();
                let width = header.patch.num_range_bins();
                let (mut mantissas, mut exponents) = (Vec::new(), Vec::new());
                if map.encoding == Encoding::Sc16 {
                    for row in map.bytes.chunks(4 * width + BlockFloat::blocks(width)) {
                        let (samples, blocks) = row.split_at(4 * width);
                        mantissas.extend(sc16s(samples));
                        exponents.extend(blocks.iter().map(|byte| *byte as i8));
                    }
                }
                self.maps.push(Came {
                    header,
                    values,
                    mantissas,
                    exponents,
                });
            }
            if let Some(chip) = self.chip.take(&report).expect("a chip without faults") {
                let pixels = chip.pixels().collect();
                self.chips
                    .push((chip.grid, chip.maps, chip.weight_sum, pixels));
            }
            if let Ok(Some(profile)) = self.profile.take(&report) {
                let header = profile.header;
                let values = profile.values().collect();
                self.profiles
                    .push((header.sweep, header.usable, header.taken, values));
            }
            match report {
                Report::Identity { .. } => self.identities += 1,
                Report::Status(status) => self.status = Some(status),
                Report::Refused { sequence, what } => self.refused.push((sequence, what)),
                Report::Detections {
                    map,
                    sub_cpi,
                    patch,
                    first,
                    total,
                    channels,
                    list,
                } => {
                    let list = detections(list, channels.into());
                    let list = list.map(|(detection, values)| (detection, values.collect()));
                    let list = list.collect();
                    self.detections
                        .push((map, sub_cpi, patch, first, total, list));
                }
                Report::Accumulated { first, bits } => {
                    self.accumulated = Some((first, bits.to_vec()));
                }
                Report::Increment(increment) => self.increments.push(increment),
                Report::Event(event) => self.events.push(event),
                _ => {}
            }
        }
    }

    pub(crate) fn state(&self) -> State {
        self.status.expect("a status").state
    }

    /// Send everything that a run of `scene` needs except the products.
    pub(crate) fn configure(&mut self, scene: &Scene) {
        let setup = scene.setup;
        let configuration = Configuration {
            id: 5,
            setup,
            total_pulses: scene.pulses.len() as u32,
            send_maps: self.send_maps,
        };
        assert_eq!(self.send(&Command::Configure(configuration)), None);
        self.chip.restart();
        let mut first = 0;
        for weights in scene.weights.chunks(20) {
            let mut bytes = [0; 80];
            let weights = write_f32s(weights, &mut bytes).unwrap();
            assert_eq!(self.state(), State::Idle);
            assert_eq!(self.send(&Command::Weights { first, weights }), None);
            first += 20;
        }
        let count = scene.patches.len() as u16;
        for (index, &patch) in (0..).zip(&scene.patches) {
            let command = Command::Patch {
                index,
                count,
                patch,
            };
            assert_eq!(self.send(&command), None);
        }
        assert_eq!(self.state(), State::Ready);
        assert_eq!(self.status.unwrap().configuration, 5);
    }

    pub(crate) fn push(
        &mut self,
        pulse: &Pulse,
        samples: &[Complex32],
        encoding: Encoding,
    ) -> Option<Refusal> {
        let mut bytes = vec![0; 8 * samples.len()];
        let samples = match encoding {
            Encoding::Complex32 => write_complex32s(samples, &mut bytes),
            Encoding::Sc16 => {
                let samples: Vec<Sc16> =
                    samples.iter().map(|z| Sc16::from_complex32(*z).0).collect();
                write_sc16s(&samples, &mut bytes)
            }
        };
        self.send(&Command::Pulse {
            pulse: *pulse,
            encoding,
            samples: samples.unwrap(),
        })
    }

    /// Deliver a pulse without letting the endpoint work.
    pub(crate) fn deliver_pulse(&mut self, pulse: &Pulse, samples: &[Complex32]) {
        let (mut bytes, mut wire) = (vec![0; 8 * F], vec![0; max_frame_bytes(2 * F)]);
        let command = Command::Pulse {
            pulse: *pulse,
            encoding: Encoding::Complex32,
            samples: write_complex32s(samples, &mut bytes).unwrap(),
        };
        self.endpoint
            .receive(self.encoder.encode(&command, &mut wire).unwrap());
        self.sequence += 1;
    }

    /// Do a whole run. Discards the results of earlier ones.
    pub(crate) fn run(&mut self, run: u32, scene: &Scene) {
        self.restart();
        assert_eq!(self.send(&Command::Start { run, first: 0 }), None);
        assert_eq!(self.state(), State::Running);
        for (pulse, samples) in scene.pulses.iter().zip(&scene.samples) {
            assert_eq!(self.push(pulse, samples, E::MAP_ENCODING), None);
        }
        assert_eq!(self.send(&Command::Stop), None);
        assert_eq!(self.state(), State::Done);
        let status = self.status.unwrap();
        assert_eq!(status.run, run);
        if self.send_maps {
            assert_eq!(status.maps as usize, self.maps.len());
        }
        assert_eq!(status.pulses.accepted as usize, scene.pulses.len());
        assert_eq!(status.pulses.saturated, 0);
        let numbers = scene.setup.numbers_per_sub_cpi() as usize;
        let sub_cpis = scene.pulses.len().div_ceil(numbers);
        assert_eq!(status.maps as usize, sub_cpis * scene.patches.len());
    }

    /// Configure the chips of both patches.
    pub(crate) fn set_chips(&mut self) {
        for chip in [CHIP, SMALL_CHIP] {
            assert_eq!(self.send(&Command::Chip(chip)), None);
        }
    }

    /// Request both chips and return the received ones.
    pub(crate) fn collect(&mut self) -> Vec<Chip> {
        self.chips.clear();
        for patch in 0..2 {
            assert_eq!(self.send(&Command::SendChip { patch }), None);
        }
        assert_eq!(self.chips.len(), 2);
        self.chips.clone()
    }

    /// Request the list of accumulated sub-CPIs from the first on.
    pub(crate) fn list(&mut self) -> Vec<u8> {
        assert_eq!(self.send(&Command::Accumulated { first: 0 }), None);
        let (first, bits) = self.accumulated.take().expect("an answer");
        assert_eq!(first, 0);
        bits
    }

    pub(crate) fn restart(&mut self) {
        self.map.restart();
        self.maps.clear();
        self.detections.clear();
    }
}

/// Three and a half sub-CPIs, two patches. The samples are exact in 16 bits, so both arithmetics receive the same.
/// `R = 2F`, `D = 2M`.
pub(crate) fn scene() -> Scene {
    let patches = vec![
        patch([3.0, -2.0, 0.5], 13, 7),
        patch([-4.0, 6.0, 0.0], 12, 6),
    ];
    let mut scene = Scene::new(M as u16, F as u16, R as u16, 2 * M as u16, 28, patches);
    for sample in scene.samples.iter_mut().flatten() {
        *sample = Sc16::from_complex32(*sample).0.to_complex32();
    }
    scene
}

/// 4 x 2 pixels around the centre of the second patch.
pub(crate) const SMALL_CHIP: ChipGrid = ChipGrid {
    patch: 1,
    origin_m: [-4.5, 5.75, 0.0],
    num_columns: 4,
    num_rows: 2,
    ..CHIP
};

/// 12 x 10 pixels around the centre of the first patch. Coordinates are exact in binary in any order of summation.
pub(crate) const CHIP: ChipGrid = ChipGrid {
    patch: 0,
    origin_m: [1.5, -3.125, 0.5],
    column_step_m: [0.25, 0.0, 0.0],
    row_step_m: [0.0, 0.25, 0.0],
    num_columns: 12,
    num_rows: 10,
};

pub(crate) const fn cfar(false_alarm_probability: f64) -> Cfar {
    Cfar {
        range: TrainingWindow {
            guard: 2,
            training: 4,
        },
        doppler: TrainingWindow {
            guard: 1,
            training: 2,
        },
        false_alarm_probability,
    }
}
