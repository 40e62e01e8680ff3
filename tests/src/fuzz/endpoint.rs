//! The module's end of the link with a host that sends arbitrary bytes.

use std::sync::OnceLock;

use num_complex::Complex32;
use subaperture_core::accumulate::ChipKernel;
use subaperture_core::cfar::Column;
use subaperture_core::link::{
    Command, Configuration, Encoder, Encoding, MapAssembly, Receiver, Report, State, Status,
    max_frame_bytes, max_received_bytes, write_complex32s, write_f32s,
};
use subaperture_core::motion::Odometer;
use subaperture_core::stream::{FloatBuffers, FloatEngine};
use subaperture_core::sweep::Profiler;
use subaperture_firmware::endpoint::{Endpoint, LinkBuffers};
use subaperture_firmware::products::{ChannelValues, Chip, NO_VALUES, ProductBuffers};

use super::{choice, wire};
use crate::link_scene::{self, Kept, bits};

/// Sizes of the module's buffers: pulses, frequencies, range bins, Doppler rows, patches.
type Buffers = FloatBuffers<8, 40, 128, 24, 4>;

/// Maximum of samples in a row of a map.
const ROW: usize = 128;

/// Maximum of steps that a few bytes can cause: each is that of a pulse, a row or a column, for some patches.
const MAX_STEPS: usize = 100_000;

/// A module's memory.
pub(super) struct Bench {
    buffers: Box<Buffers>,
    received: Vec<u8>,
    frame: Vec<u8>,
    row: Vec<u8>,
    pixels: Vec<Complex32>,
    chips: Vec<Chip>,
    accumulated: Vec<u8>,
    columns: Vec<Column>,
    values: Box<ChannelValues>,
    kernel: ChipKernel,
    odometer: Box<Odometer<4, 2, 32, 64>>,
    profiler: Box<Profiler<8, 16, 32>>,
}

impl Bench {
    pub(super) fn new() -> Self {
        Self {
            buffers: Box::new(Buffers::new()),
            received: vec![0; max_received_bytes(ROW)],
            frame: vec![0; max_frame_bytes(ROW)],
            row: vec![0; 8 * ROW],
            pixels: vec![Complex32::ZERO; 256],
            chips: vec![Chip::EMPTY; 4],
            accumulated: vec![0; 16],
            columns: vec![Column::EMPTY; ROW],
            values: Box::new(NO_VALUES),
            kernel: ChipKernel::new(),
            odometer: Box::default(),
            profiler: Box::default(),
        }
    }

    pub(super) fn endpoint(&mut self) -> Endpoint<'_, FloatEngine<'_>> {
        let link = LinkBuffers {
            received: &mut self.received,
            frame: &mut self.frame,
            row: &mut self.row,
        };
        let products = ProductBuffers {
            pixels: &mut self.pixels,
            chips: &mut self.chips,
            accumulated: &mut self.accumulated,
            kernel: &self.kernel,
            columns: &mut self.columns,
            values: &mut self.values,
        };
        let endpoint = Endpoint::new(self.buffers.processor(), link, products, "module");
        let endpoint = endpoint.with_odometer(&mut *self.odometer);
        endpoint.with_profiler(&mut *self.profiler)
    }

    /// Output of a module that has just started, for this input.
    pub(super) fn hear(&mut self, wire: &[u8]) -> Vec<u8> {
        let mut endpoint = self.endpoint();
        let mut said = settle(&mut endpoint);
        for piece in wire.split_inclusive(|&byte| byte == 0) {
            endpoint.receive(piece);
            said.extend(settle(&mut endpoint));
        }
        said
    }
}

/// Let an endpoint complete its work; returns its output.
fn settle(endpoint: &mut Endpoint<'_, FloatEngine<'_>>) -> Vec<u8> {
    let mut said = Vec::new();
    for _ in 0..MAX_STEPS {
        let pending = endpoint.pending();
        let count = pending.len();
        said.extend_from_slice(pending);
        endpoint.sent(count);
        if !endpoint.work() && count == 0 && endpoint.pending().is_empty() {
            return said;
        }
    }
    panic!("an endpoint that never comes to rest");
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let all = wire::commands();
    // Without the commands of chips and detections.
    let frames: Vec<&[u8]> = all.split_inclusive(|&byte| byte == 0).collect();
    let plain = [&frames[..5], &frames[7..]].concat().concat();
    vec![
        all.clone(),
        plain,
        frames[..8].concat(),
        wire::increments(),
        wire::cancellation(),
        wire::profiles(),
    ]
}

/// Receiver of the host.
struct Ear {
    received: Vec<u8>,
    room: Vec<u8>,
}

/// The last status, kinds of messages, and complete maps.
#[derive(Default)]
struct Heard {
    status: Option<Status>,
    kinds: Vec<&'static str>,
    maps: Kept,
}

impl Ear {
    fn new() -> Self {
        Self {
            received: vec![0; max_received_bytes(ROW)],
            room: vec![0; 1 << 16],
        }
    }

    /// Receive all output of an endpoint; asserts that each frame is complete.
    fn hear(&mut self, mut said: &[u8]) -> Heard {
        let mut receiver = Receiver::new(&mut self.received);
        let mut assembly = MapAssembly::new(&mut self.room);
        let mut heard = Heard::default();
        while let Some(frame) = receiver.receive::<Report<'_>>(&mut said) {
            let report = frame.expect("an endpoint sends whole frames").message;
            if let Ok(Some(map)) = assembly.take(&report) {
                let key = (map.header.sub_cpi, map.header.patch_index);
                let values = map.rows().flat_map(|row| row.values().collect::<Vec<_>>());
                heard.maps.insert(key, (map.header, values.collect()));
            }
            heard.kinds.push(match report {
                Report::Identity { .. } => "identity",
                Report::Status(status) => {
                    heard.status = Some(status);
                    "status"
                }
                Report::MapStart { .. } | Report::MapRow { .. } | Report::MapEnd { .. } => "map",
                Report::ChipStart { .. } | Report::ChipPart { .. } | Report::ChipEnd { .. } => {
                    "chip"
                }
                Report::Accumulated { .. } => "accumulated",
                Report::Detections { .. } => "detections",
                Report::Refused { .. } => "refused",
                Report::Event(_) => "event",
                Report::Increment(_) => "increment",
                Report::ProfileStart { .. }
                | Report::ProfileRow { .. }
                | Report::ProfileEnd { .. } => "profile",
            });
        }
        heard
    }
}

pub(super) fn read(bytes: &[u8]) -> String {
    let mut bench = Bench::new();
    let mut endpoint = bench.endpoint();
    let mut said = settle(&mut endpoint);
    let piece = 1 + choice(bytes, 300) as usize;
    for piece in bytes.chunks(piece) {
        endpoint.receive(piece);
        said.extend(settle(&mut endpoint));
    }
    let mut ear = Ear::new();
    let mut kinds = ear.hear(&said).kinds;
    kinds.dedup();
    kinds.truncate(12);
    // After any input the module serves the next host normally. A run takes time, so only one input in four is followed by one.
    if choice(bytes, 4) == 0 {
        serves(&mut endpoint, &mut ear);
    }
    kinds.join(" ")
}

/// A complete run; asserts that its maps are bit-identical to the core's.
fn serves(endpoint: &mut Endpoint<'_, FloatEngine<'_>>, ear: &mut Ear) {
    static EXPECTED: OnceLock<Kept> = OnceLock::new();
    let scene = link_scene::scene();
    let expected = EXPECTED.get_or_init(|| link_scene::expected(&scene));
    let mut encoder = Encoder::new();
    let mut buffer = vec![0; max_frame_bytes(ROW)];
    // A zero ends any unfinished frame.
    endpoint.receive(&[0]);
    let mut said = settle(endpoint);
    let mut ask = |said: &mut Vec<u8>, command: &Command<'_>| {
        let bytes = encoder
            .encode(command, &mut buffer)
            .expect("a short command");
        endpoint.receive(bytes);
        said.extend(settle(endpoint));
    };
    said.clear();
    ask(&mut said, &Command::Hello);
    ask(&mut said, &Command::Status);
    let before = ear.hear(&said).status.expect("a status, asked for");
    said.clear();
    ask(&mut said, &Command::Hello);
    ask(&mut said, &Command::Abort);
    let (id, run) = (
        before.configuration.wrapping_add(1),
        before.run.wrapping_add(1),
    );
    ask(
        &mut said,
        &Command::Configure(Configuration {
            id,
            setup: scene.setup,
            total_pulses: scene.pulses.len() as u32,
            send_maps: true,
        }),
    );
    let mut bytes = [0; 512];
    let weights = write_f32s(&scene.weights, &mut bytes).expect("few weights");
    ask(&mut said, &Command::Weights { first: 0, weights });
    let count = scene.patches.len() as u16;
    for (index, &patch) in (0..).zip(&scene.patches) {
        ask(
            &mut said,
            &Command::Patch {
                index,
                count,
                patch,
            },
        );
    }
    ask(&mut said, &Command::Start { run, first: 0 });
    for (pulse, samples) in scene.pulses.iter().zip(&scene.samples) {
        let samples = write_complex32s(samples, &mut bytes).expect("a short pulse");
        let encoding = Encoding::Complex32;
        ask(
            &mut said,
            &Command::Pulse {
                pulse: *pulse,
                encoding,
                samples,
            },
        );
    }
    ask(&mut said, &Command::Stop);
    let heard = ear.hear(&said);
    let status = heard.status.expect("a status, asked for");
    assert_eq!(
        (status.configuration, status.run, status.state),
        (id, run, State::Done)
    );
    assert_eq!(heard.maps.len(), expected.len());
    for (key, (header, values)) in &heard.maps {
        let (expected_header, expected_values) = &expected[key];
        assert_eq!(header, expected_header);
        assert_eq!(bits(values), bits(expected_values), "map {key:?}");
    }
}
