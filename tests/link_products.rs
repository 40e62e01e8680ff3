//! Chips, detections and refusals of the firmware's station, byte for byte as a host would see them.
//!
//! Maps are put together from the frames, and everything else is held against them: the chip has to be
//! the sum that the host makes of the same maps, bit by bit, and the exact sum over pulses and
//! frequencies in float64, which shares no code with it; detections have to be those of the detector run
//! here on the map that came.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_core::accumulate::{PixelGrid, add_patch_map};
use subaperture_core::cfar::{Cfar, Column, Detection, Reach};
use subaperture_core::link::{
    ChipAssembly, ChipGrid, Command, Configuration, Encoder, Encoding, MAX_DETECTIONS, MapAssembly,
    Receiver, Refusal, Report, State, Status, complex32s, detections, max_frame_bytes,
    max_received_bytes, sc16s, write_complex32s, write_f32s, write_sc16s,
};
use subaperture_core::stream::{
    BlockFloat, FixedBuffers, FixedEngine, FloatBuffers, FloatEngine, MapHeader, MapSamples,
    PatchMap, Quantity, Setup, SetupError, SubCpiProcessor,
};
use subaperture_core::{Pulse, Sc16};
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::products::{ChipKernel, DETECTIONS, ProductBuffers};
use subaperture_firmware::station::{LinkBuffers, Station};
use subaperture_tests::stream_scene::{Scene, at, patch, relative_error_db};

/// Pulses a sub-CPI, frequencies, range bins, Doppler rows, patches of the modules here.
const M: usize = 8;
const F: usize = 32;
const R: usize = 64;
const ROWS: usize = 15;
const PATCHES: usize = 3;
/// Most pixels of their chips.
const PIXELS: usize = 128;
const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

/// A map that came.
struct Came {
    header: MapHeader,
    values: Vec<Complex32>,
    mantissas: Vec<Sc16>,
    exponents: Vec<i8>,
}

impl Came {
    fn view(&self) -> PatchMap<'_> {
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

/// A frame of detections: map, sub-CPI, patch, place of the first, number of all, those here.
type Listed = (u32, u32, u16, u16, u16, Vec<Detection>);

/// A chip that came: grid, maps, sum of the weights, pixels.
type Chip = (ChipGrid, u32, f32, Vec<Complex32>);

/// A station, and what a host heard of it.
struct Bench<E: WireEngine + 'static> {
    station: Station<'static, E>,
    receiver: Receiver<'static>,
    map: MapAssembly<'static>,
    chip: ChipAssembly<'static>,
    encoder: Encoder,
    /// Sequence number of the last command.
    sequence: u32,
    identities: u32,
    status: Option<Status>,
    refused: Vec<(u32, Refusal)>,
    maps: Vec<Came>,
    chips: Vec<Chip>,
    detections: Vec<Listed>,
}

fn float() -> Bench<FloatEngine<'static>> {
    let buffers = Box::leak(Box::new(FloatBuffers::<M, F, R, ROWS, PATCHES>::new()));
    Bench::new(buffers.processor(), F)
}

fn fixed() -> Bench<FixedEngine<'static>> {
    let buffers = Box::leak(Box::new(FixedBuffers::<M, F, R, ROWS, 2, PATCHES>::new()));
    Bench::new(buffers.processor().unwrap(), F)
}

impl<E: WireEngine + 'static> Bench<E> {
    /// With buffers of the link for `frequencies`, as the application has them.
    fn new(processor: SubCpiProcessor<'static, E>, frequencies: usize) -> Self {
        let link = LinkBuffers {
            received: vec![0; max_received_bytes(frequencies)].leak(),
            frame: vec![0; max_frame_bytes(frequencies)].leak(),
            row: vec![0; 8 * frequencies].leak(),
        };
        let products = ProductBuffers {
            chip: vec![Complex32::ZERO; PIXELS].leak(),
            kernel: Box::leak(Box::new(ChipKernel::new())),
            columns: vec![Column::EMPTY; frequencies].leak(),
        };
        Self {
            station: Station::new(processor, link, products, "bench"),
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
        }
    }

    /// Sends a command and lets the station do all it can; the refusal, if it is one.
    fn send(&mut self, command: &Command<'_>) -> Option<Refusal> {
        let mut wire = vec![0; max_frame_bytes(2 * F)];
        let bytes = self.encoder.encode(command, &mut wire).unwrap();
        self.sequence += 1;
        self.station.receive(bytes);
        self.settle();
        let mine = |refused: &&(u32, Refusal)| refused.0 == self.sequence;
        self.refused.iter().find(mine).map(|(_, what)| *what)
    }

    fn settle(&mut self) {
        loop {
            let bytes = self.station.pending().to_vec();
            if bytes.is_empty() && !self.station.work() && self.station.pending().is_empty() {
                return;
            }
            self.station.sent(bytes.len());
            self.hear(&bytes);
        }
    }

    fn hear(&mut self, mut bytes: &[u8]) {
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
                let pixels = complex32s(chip.bytes).collect();
                self.chips
                    .push((chip.grid, chip.maps, chip.weight_sum, pixels));
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
                    list,
                } => {
                    let list = detections(list).collect();
                    self.detections
                        .push((map, sub_cpi, patch, first, total, list));
                }
                _ => {}
            }
        }
    }

    fn state(&self) -> State {
        self.status.expect("a status").state
    }

    /// Everything that a run of `scene` needs but the products.
    fn configure(&mut self, scene: &Scene) {
        let setup = scene.setup;
        let configuration = Configuration { id: 5, setup };
        assert_eq!(self.send(&Command::Configure(configuration)), None);
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

    fn push(
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

    /// A whole run; what came of earlier ones is forgotten.
    fn run(&mut self, run: u32, scene: &Scene) {
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
        assert_eq!(status.maps as usize, self.maps.len());
        assert_eq!(status.pulses.accepted as usize, scene.pulses.len());
        assert_eq!(status.pulses.saturated, 0);
        let sub_cpis = scene.pulses.len().div_ceil(scene.setup.num_pulses.into());
        assert_eq!(self.maps.len(), sub_cpis * scene.patches.len());
    }

    fn restart(&mut self) {
        self.map.restart();
        self.chip.restart();
        self.maps.clear();
        self.chips.clear();
        self.detections.clear();
    }
}

/// Three sub-CPIs and a half, two patches; samples that 16 bits hold without rounding, so that both
/// arithmetics are given the same. `R = 2F`, `D = 2M`.
fn scene() -> Scene {
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

/// 12 by 10 pixels about the first patch's centre. Coordinates are exact in binary, in whatever order
/// they are added up.
const CHIP: ChipGrid = ChipGrid {
    patch: 0,
    origin_m: [1.5, -3.125, 0.5],
    column_step_m: [0.25, 0.0, 0.0],
    row_step_m: [0.0, 0.25, 0.0],
    num_columns: 12,
    num_rows: 10,
};

/// The exact sum at every pixel of `CHIP`.
fn exact_chip(scene: &Scene) -> Vec<Complex64> {
    let distance =
        |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    let mut pixels = Vec::new();
    for row in 0..10 {
        for column in 0..12 {
            let place = [
                1.5 + 0.25 * f64::from(column),
                -3.125 + 0.25 * f64::from(row),
                0.5,
            ];
            let mut sum = Complex64::ZERO;
            for (pulse, samples) in scene.pulses.iter().zip(&scene.samples) {
                let path = distance(pulse.transmitter_m, place) + distance(pulse.receiver_m, place)
                    - pulse.reference_path_m;
                for (k, z) in samples.iter().enumerate() {
                    let f = scene.setup.start_hz + k as f64 * scene.setup.step_hz;
                    let weight = f64::from(scene.weights[k]) * f64::from(pulse.weight);
                    sum += Complex64::new(z.re.into(), z.im.into())
                        * Complex64::cis(TAU * (f * path / SPEED_OF_LIGHT_M_S).fract())
                        * weight;
                }
            }
            let weights: f64 = scene
                .pulses
                .iter()
                .map(|pulse| f64::from(pulse.weight))
                .sum();
            pixels.push(sum / weights);
        }
    }
    pixels
}

/// The sum of the maps that came, as documented: each times its pulses, over the sum of their weights.
fn chip_of<'m>(maps: impl Iterator<Item = &'m Came>, setup: &Setup) -> (u32, f32, Vec<Complex32>) {
    let grid = PixelGrid {
        origin_m: CHIP.origin_m,
        column_step_m: CHIP.column_step_m,
        row_step_m: CHIP.row_step_m,
        num_columns: 12,
        num_rows: 10,
    };
    let kernel = ChipKernel::new();
    let (mut count, mut weights, mut pixels) = (0, 0.0f32, vec![Complex32::ZERO; 120]);
    for map in maps.filter(|map| map.header.patch_index == CHIP.patch) {
        count += 1;
        weights += map.header.weight_sum;
        let pulses = f32::from(map.header.num_pulses);
        let reached =
            add_patch_map(&mut pixels, &grid, setup, &map.view(), &kernel, pulses).unwrap();
        assert_eq!(reached, 120, "the chip lies within the patch");
    }
    let scale = 1.0 / weights;
    let pixels = pixels
        .iter()
        .map(|z| Complex32::new(z.re * scale, z.im * scale));
    (count, weights, pixels.collect())
}

fn check_chip<E: WireEngine + 'static>(mut bench: Bench<E>, most_db: f64) {
    let scene = scene();
    bench.configure(&scene);
    assert_eq!(bench.send(&Command::Chip(CHIP)), None);
    bench.run(1, &scene);
    let exact = exact_chip(&scene);
    let first = bench.chips.clone();
    assert_eq!(first.len(), 1);
    let (grid, maps, weights, pixels) = &first[0];
    assert_eq!(*grid, CHIP);
    let expected = chip_of(bench.maps.iter(), &scene.setup);
    assert_eq!((*maps, *weights), (expected.0, expected.1));
    assert_eq!(*maps, 4);
    assert_eq!(*pixels, expected.2);
    let error_db = relative_error_db(pixels, &exact);
    println!("{error_db:.1} dB");
    assert!(error_db <= most_db, "{error_db}");
    // A chip is of one run.
    bench.run(2, &scene);
    assert_eq!(bench.chips, first);
    // Without the option there is none; a new configuration forgets it.
    bench.configure(&scene);
    bench.run(3, &scene);
    assert!(bench.chips.is_empty() && bench.detections.is_empty());
}

/// 8 taps are documented with -64.4 dB (`core/src/accumulate/chip.rs`) on a smooth track. This track is
/// shaken by 1 mm either way, which a line over the sub-CPI cannot follow: seen from a pixel 1.5 m aside
/// at 850 m, 2 legs of 0.58 mm RMS times 1.5 / 850 are 1.4 um of 32 mm, 2.9e-4 rad or -71 dB, so
/// that 1 dB above the kernel's figure is allowed.
#[test]
fn chip_is_the_sum_of_the_maps_sent() {
    check_chip(float(), -63.4);
}

/// The same, since rounding of 16-bit maps is -74 dB or better (`core/src/fixed_point/mod.rs`).
#[test]
fn fixed_point_chip_is_the_sum_of_the_maps_sent() {
    check_chip(fixed(), -63.0);
}

fn cfar(false_alarm_probability: f64) -> Cfar {
    Cfar {
        range: Reach {
            guard: 2,
            training: 4,
        },
        doppler: Reach {
            guard: 1,
            training: 2,
        },
        false_alarm_probability,
    }
}

/// Lists put together from their frames, a map each.
fn lists(frames: &[Listed], most: usize) -> Vec<(u32, u16, Vec<Detection>)> {
    let mut lists: Vec<(u32, u16, Vec<Detection>)> = Vec::new();
    for (map, sub_cpi, patch, first, total, list) in frames {
        if *first == 0 {
            assert_eq!(*map as usize, lists.len(), "a list a map, in order");
            lists.push((*sub_cpi, *patch, Vec::new()));
        }
        let (_, _, whole) = lists.last_mut().unwrap();
        assert_eq!(usize::from(*first), whole.len());
        whole.extend(list);
        let rest = usize::from(*total) - usize::from(*first);
        assert_eq!(list.len(), rest.min(most));
    }
    lists
}

/// Detections of the maps that came, by the detector run here; how many there are.
fn check_detections<E: WireEngine + 'static>(
    bench: &Bench<E>,
    cfar: &Cfar,
    most: usize,
) -> Vec<usize> {
    let lists = lists(&bench.detections, most);
    assert_eq!(lists.len(), bench.maps.len());
    let mut counts = Vec::new();
    for (map, (sub_cpi, patch, list)) in bench.maps.iter().zip(&lists) {
        assert_eq!(
            (*sub_cpi, *patch),
            (map.header.sub_cpi, map.header.patch_index)
        );
        let mut columns = vec![Column::EMPTY; map.header.patch.num_range_bins()];
        let mut expected = heapless::Vec::<Detection, DETECTIONS>::new();
        cfar.detect_in_map(&map.view(), &mut columns, &mut expected)
            .unwrap();
        assert_eq!(*list, expected.as_slice());
        counts.push(list.len());
    }
    counts
}

fn check_lists<E: WireEngine + 'static>(mut bench: Bench<E>) {
    let scene = scene();
    bench.configure(&scene);
    // So many false alarms that lists are full and take several frames.
    let many = cfar(0.5);
    assert_eq!(bench.send(&Command::Detect(many)), None);
    bench.run(1, &scene);
    let counts = check_detections(&bench, &many, MAX_DETECTIONS);
    println!("{counts:?}");
    assert!(counts.iter().all(|count| *count > MAX_DETECTIONS));
    // The last settings count. None at all: one frame a map that says so.
    let none = cfar(1e-300);
    assert_eq!(bench.send(&Command::Detect(none)), None);
    bench.run(2, &scene);
    assert_eq!(bench.detections.len(), bench.maps.len());
    let counts = check_detections(&bench, &none, MAX_DETECTIONS);
    assert!(counts.iter().all(|count| *count == 0), "{counts:?}");
    // Detections and a chip together.
    assert_eq!(bench.send(&Command::Detect(many)), None);
    assert_eq!(bench.send(&Command::Chip(CHIP)), None);
    bench.run(3, &scene);
    check_detections(&bench, &many, MAX_DETECTIONS);
    assert_eq!(bench.chips[0].3, chip_of(bench.maps.iter(), &scene.setup).2);
}

#[test]
fn detections_are_those_of_the_maps_sent() {
    check_lists(float());
}

#[test]
fn fixed_point_detections_are_those_of_the_maps_sent() {
    check_lists(fixed());
}

/// A module whose row's buffer has room for 8 detections sends 8 a frame.
#[test]
fn short_rows_carry_fewer_detections_a_frame() {
    let buffers = Box::leak(Box::new(FloatBuffers::<M, 16, 32, ROWS, 1>::new()));
    let mut bench = Bench::new(buffers.processor(), 16);
    let patches = vec![patch([1.0, 1.0, 0.0], 7, 7)];
    let scene = Scene::new(M as u16, 16, 32, 16, 2 * M, patches);
    bench.configure(&scene);
    let many = cfar(0.5);
    assert_eq!(bench.send(&Command::Detect(many)), None);
    bench.run(1, &scene);
    let counts = check_detections(&bench, &many, 8);
    assert!(counts.iter().all(|count| *count > 8), "{counts:?}");
}

/// The strongest detection is the point, within a tenth of a bin of where the path says.
fn check_point<E: WireEngine + 'static>(mut bench: Bench<E>) {
    let place = [5.0, -3.0, 0.0];
    let wide = patch([2.0, -1.0, 0.0], 15, 7);
    let mut scene = Scene::point(M as u16, F as u16, R as u16, 2 * M as u16, wide, place);
    for sample in scene.samples.iter_mut().flatten() {
        *sample *= 0.5;
    }
    bench.configure(&scene);
    let settings = cfar(1e-3);
    assert_eq!(bench.send(&Command::Detect(settings)), None);
    bench.run(1, &scene);
    check_detections(&bench, &settings, MAX_DETECTIONS);
    let (a, b) = scene.line(place, 0);
    let setup = &scene.setup;
    let range_bin = a * R as f64 * setup.step_hz / SPEED_OF_LIGHT_M_S;
    let doppler_bin = -b * 2.0 * M as f64 * setup.centre_hz() / SPEED_OF_LIGHT_M_S;
    let strongest = bench.detections[0].5[0];
    println!("{strongest:?} for {range_bin:.2} {doppler_bin:.2}");
    assert!((f64::from(strongest.range_bin) - range_bin).abs() < 0.1);
    assert!((f64::from(strongest.doppler_bin) - doppler_bin).abs() < 0.1);
    // The parabola goes through logarithms: of sinc^2 sampled twice a resolution cell it comes out right on
    // a bin and, half a bin off, where the cells are ln 0.8106 twice and ln 0.0901, at exp(0.0647) in
    // either axis.
    let gain = strongest.power / 0.25;
    assert!(gain > 0.99 && gain < 1.067f32.powi(2) * 1.01, "{gain}");
}

#[test]
fn strong_point_is_detected_at_its_place() {
    check_point(float());
    check_point(fixed());
}

#[test]
fn what_cannot_be_is_refused() {
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
    // Nothing is going on: there is nothing to do, and no harm in it.
    for command in [Command::Stop, Command::Abort, Command::Status] {
        assert_eq!(bench.send(&command), None);
        assert_eq!(bench.state(), State::Idle);
    }
    let configure = |setup| Command::Configure(Configuration { id: 9, setup });
    let large = Setup {
        num_pulses: M as u16 + 1,
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
    // A patch and two weights are missing still.
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
    // Rows of a chip go through the buffer of rows, 32 samples long.
    assert_eq!(bench.send(&chip(33, 3)), room(33, 32));
    assert_eq!(bench.send(&chip(32, 4)), None);
    for probability in [0.0, 1.0, -0.5, f64::NAN] {
        assert_eq!(
            bench.send(&Command::Detect(cfar(probability))),
            Some(Refusal::Detect)
        );
    }
    let untrained = Cfar {
        range: Reach {
            guard: 1,
            training: 0,
        },
        doppler: Reach {
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
        // The run that is going on may be started again.
        let expected = (*command != start).then_some(Refusal::Running);
        assert_eq!(bench.send(command), expected);
        assert_eq!(bench.state(), State::Running);
    }
    assert_eq!(bench.status.unwrap().run, 1);
    // Nothing of that has changed anything.
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
    // Once a run; then they are counted alone.
    assert_eq!(
        bench.push(&scene.pulses[1], short, Encoding::Complex32),
        None
    );
    bench.send(&Command::Status);
    let counters = bench.status.unwrap().pulses;
    assert_eq!((counters.refused, counters.accepted), (2, 0));
    // They cost their sub-CPI. The next is whole, in the other encoding, which a module in floating point
    // takes too.
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
    // Once a run, and counted: the numbers go on.
    assert_eq!(
        bench.push(&scene.pulses[1], &scene.samples[1], Encoding::Complex32),
        None
    );
    bench.send(&Command::Status);
    let status = bench.status.unwrap();
    assert_eq!((status.pulses.refused, status.next_pulse), (2, 2));
    // Late pulses of a run that is over are no news.
    bench.send(&Command::Abort);
    assert_eq!(
        bench.push(&scene.pulses[0], &scene.samples[0], Encoding::Complex32),
        None
    );
}

/// A pulse that is refused for another reason does not keep the host from being told of its length.
#[test]
fn a_wrong_length_is_told_after_a_sample_that_is_no_number() {
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
fn a_chip_of_a_patch_that_is_not_there_is_refused_at_the_start() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    let patch = scene.patches.len() as u16;
    assert_eq!(bench.send(&Command::Chip(ChipGrid { patch, ..CHIP })), None);
    let start = Command::Start { run: 1, first: 0 };
    assert_eq!(bench.send(&start), Some(Refusal::PatchIndex));
    assert_eq!(bench.state(), State::Ready);
    bench.send(&Command::Chip(CHIP));
    bench.run(1, &scene);
    assert_eq!(bench.chips.len(), 1);
}

/// Commands that come twice do no harm, and an aborted run leaves nothing behind.
#[test]
fn repeated_commands_change_nothing() {
    let scene = scene();
    let mut bench = float();
    bench.configure(&scene);
    bench.send(&Command::Chip(CHIP));
    bench.run(1, &scene);
    let (count, chip) = (bench.maps.len(), bench.chips.clone());
    // The end, and the start of the run that is over, once more.
    for command in [
        Command::Stop,
        Command::Start { run: 1, first: 0 },
        Command::Abort,
    ] {
        assert_eq!(bench.send(&command), None);
        assert_eq!(bench.state(), State::Done);
    }
    assert_eq!((bench.maps.len(), bench.chips.len()), (count, 1));

    bench.restart();
    let start = Command::Start { run: 2, first: 0 };
    bench.send(&start);
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples).take(M + 3) {
        bench.push(pulse, samples, Encoding::Complex32);
    }
    // A start that comes again amid a run does not begin it anew.
    bench.send(&start);
    assert_eq!(bench.status.unwrap().next_pulse, M as u32 + 3);
    assert_eq!(bench.maps.len(), scene.patches.len());
    for _ in 0..2 {
        assert_eq!(bench.send(&Command::Abort), None);
        assert_eq!(bench.state(), State::Done);
    }
    assert_eq!(bench.maps.len(), scene.patches.len());
    assert!(bench.chips.is_empty(), "the aborted run's chip is dropped");
    bench.run(3, &scene);
    assert_eq!(bench.chips, chip, "nothing of the aborted run is in it");
}

/// A frame by the description: CRC by another library, stuffing by the definition.
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
fn frames_of_another_version_are_counted_and_not_obeyed() {
    let mut bench = float();
    bench.settle();
    assert_eq!(bench.identities, 1, "the first word of a module");
    // A greeting, by its bytes.
    bench.station.receive(&framed(2, 0, 0));
    bench.settle();
    assert_eq!(bench.identities, 1);
    bench.station.receive(&framed(1, 0, 0));
    bench.settle();
    assert_eq!(bench.identities, 2);
    bench.send(&Command::Status);
    let link = bench.status.unwrap().link;
    assert_eq!((link.frames, link.version), (2, 1));
    assert_eq!((link.corrupt, link.malformed, link.lost), (0, 0, 0));
}
