//! Cost of a sub-CPI through the endpoint, call by call; then of motion increments and of a range profile.
//!
//! Commands are encoded as by the host and received by the endpoint, and every call of it is timed. There are two patches:
//! one fills the map buffer and has an image chip; the other has one Doppler bin, so its columns are compensation only. Both
//! are searched for detections.

use subaperture_core::accumulate::ChipKernel;
use subaperture_core::cfar::{Cfar, TrainingWindow};
use subaperture_core::link::{
    Arithmetic, ChipGrid, Command, Configuration, Encoder, Encoding, State, max_frame_bytes,
    write_complex32s,
};
use subaperture_core::stream::{Patch, Setup, nodes};
use subaperture_core::{Complex32, Pulse, Turns};
use subaperture_firmware::board::{Board, Current};
use subaperture_firmware::endpoint::Endpoint;
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::memory::{self, Placed};
use subaperture_firmware::meter::Meter;
use subaperture_firmware::module::{self, Engine};
use subaperture_firmware::place;
use subaperture_firmware::sizes::{DOPPLER_BINS, FREQUENCIES, NAME, PATCHES, PULSES, RANGE_BINS};

const SETUP: Setup = Setup {
    num_pulses: PULSES as u16,
    num_channels: 1,
    num_frequencies: FREQUENCIES as u16,
    range_length: RANGE_BINS as u16,
    doppler_length: 2 * PULSES as u16,
    start_hz: 9.4e9,
    step_hz: 1.4e6,
};

/// Half-widths that fill the map buffer, whose rows have one element per frequency.
const FULL: Patch = Patch {
    centre_m: [3.0, -2.0, 0.0],
    range_reach: (FREQUENCIES as u16 - 1) / 2,
    doppler_reach: (DOPPLER_BINS as u16 - 1) / 2,
};

const ONE_BIN: Patch = Patch {
    doppler_reach: 0,
    ..FULL
};

/// Rows of 32 pixels of the chip of the first patch.
const CHIP_ROWS: u16 = 31;

const ENCODING: Encoding = match Engine::ARITHMETIC {
    Arithmetic::Float => Encoding::Complex32,
    Arithmetic::Fixed => Encoding::Sc16,
};

place!(sram static PULSES_SENT: [Pulse; PULSES] = [Pulse::EMPTY; PULSES]);
static SAMPLES: Placed<[u8; 8 * FREQUENCIES]> = Placed::new([0; 8 * FREQUENCIES]);
static FRAME: Placed<[u8; max_frame_bytes(FREQUENCIES)]> =
    Placed::new([0; max_frame_bytes(FREQUENCIES)]);

/// Total and maximum cost of calls of one kind.
#[derive(Default)]
pub(crate) struct Cost {
    pub(crate) sum: u64,
    pub(crate) most: u64,
}

impl Cost {
    pub(crate) fn add(&mut self, count: u64) {
        self.sum += count;
        self.most = self.most.max(count);
    }
}

/// Costs of one map.
#[derive(Default)]
struct MapCost {
    begin: Cost,
    columns: Cost,
    rows: Cost,
    /// Rows of the chip, and the search for detections.
    products: Cost,
    frames: Cost,
    bytes: usize,
}

/// Run the measurement and print the costs. `None` on failure.
#[inline(never)]
pub(crate) fn run(board: &mut Current, meter: &Meter) -> Option<()> {
    let kernel = ChipKernel::new();
    let mut endpoint = module::endpoint(&kernel)?;
    let (pulses, samples, frame) = (
        PULSES_SENT.try_take()?,
        SAMPLES.try_take()?,
        FRAME.try_take()?,
    );
    let mut encoder = Encoder::new();
    let setup = Command::Configure(Configuration {
        id: 1,
        setup: SETUP,
        total_pulses: PULSES as u32,
        send_maps: true,
    });
    let weights = Command::Weights {
        first: 0,
        weights: weights(FREQUENCIES, samples)?,
    };
    let patch = |index, patch| Command::Patch {
        index,
        count: 2,
        patch,
    };
    // The chip of the second patch is one pixel.
    let chip = |patch, num_columns, num_rows| {
        Command::Chip(ChipGrid {
            patch,
            origin_m: [-4.0, -4.0, 0.0],
            column_step_m: [0.25, 0.0, 0.0],
            row_step_m: [0.0, 0.25, 0.0],
            num_columns,
            num_rows,
        })
    };
    let detect = Command::Detect(Cfar {
        range: TrainingWindow {
            guard: 2,
            training: 6,
        },
        doppler: TrainingWindow {
            guard: 1,
            training: 3,
        },
        false_alarm_probability: 1e-6,
    });
    let start = Command::Start { run: 1, first: 0 };
    let preparation = [
        Command::Hello,
        setup,
        weights,
        patch(0, FULL),
        patch(1, ONE_BIN),
        chip(0, 32, CHIP_ROWS),
        chip(1, 1, 1),
        detect,
        start,
    ];
    for command in &preparation {
        give(&mut endpoint, &mut encoder, command, frame)?;
    }
    (endpoint.state() == State::Running).then_some(())?;

    let (mut receive, mut up_bytes) = (Cost::default(), 0);
    for (m, place) in pulses.iter_mut().enumerate() {
        *place = pulse(m);
        let command = pulse_command(m, FREQUENCIES, samples)?;
        let bytes = encoder.encode(&command, frame).ok()?;
        up_bytes += bytes.len();
        receive.add(meter.measure(board, || endpoint.receive(bytes)).0);
        drain(&mut endpoint);
    }
    let full = map(board, meter, &mut endpoint, &FULL);
    let one = map(board, meter, &mut endpoint, &ONE_BIN);
    stop(&mut endpoint, &mut encoder, frame)?;
    let send_chip = Command::SendChip { patch: 0 };
    let chip_bytes = give(&mut endpoint, &mut encoder, &send_chip, frame)?;
    let nodes = meter
        .measure(board, || core::hint::black_box(nodes(pulses)))
        .0;

    let mut show = |name: &str, value: u64| board.log(format_args!("{name} {value}"));
    show("pulses", PULSES as u64);
    show("frequencies", FREQUENCIES as u64);
    show("range_length", RANGE_BINS as u64);
    show("rows_of_map", FULL.num_doppler_bins() as u64);
    show("bins_of_row", FULL.num_range_bins() as u64);
    show("patches", PATCHES as u64);
    show("receive_pulses", receive.sum);
    show("receive_worst", receive.most);
    show("begin", full.begin.sum);
    show("columns", full.columns.sum);
    show("column_worst", full.columns.most);
    show("compensation", one.columns.sum);
    show("rows", full.rows.sum);
    show("row_worst", full.rows.most);
    show("products", full.products.sum);
    show("products_worst", full.products.most);
    show("send_map", full.frames.sum);
    show("send_worst", full.frames.most);
    show("nodes", nodes);
    show("up_bytes", up_bytes as u64);
    show("down_bytes_a_map", full.bytes as u64);
    show("chip_bytes", chip_bytes as u64);
    board.log(format_args!(
        "configuration {NAME} {:?}",
        Engine::ARITHMETIC
    ));
    let talk = (samples.as_mut_slice(), frame.as_mut_slice());
    crate::odometer::run(board, meter, &mut endpoint, &mut encoder, talk)?;
    let talk = (samples.as_mut_slice(), frame.as_mut_slice());
    crate::profiles::run(board, meter, &mut endpoint, &mut encoder, talk)?;
    let talk = (samples.as_mut_slice(), frame.as_mut_slice());
    crate::random::run(board, meter, &mut endpoint, &mut encoder, talk)?;
    let stack_bytes = memory::stack_high_water_bytes();
    board.log(format_args!("stack {stack_bytes}"));
    (full.bytes > 0 && one.bytes > 0 && chip_bytes > 0).then_some(())
}

/// Give the endpoint a command, and remove its answers. Returns their size in bytes.
pub(crate) fn give(
    endpoint: &mut Endpoint<'_, Engine<'_>>,
    encoder: &mut Encoder,
    command: &Command<'_>,
    frame: &mut [u8],
) -> Option<usize> {
    endpoint.receive(encoder.encode(command, frame).ok()?);
    Some(drain(endpoint))
}

/// Stop the run, and remove the results of the work that is left.
pub(crate) fn stop(
    endpoint: &mut Endpoint<'_, Engine<'_>>,
    encoder: &mut Encoder,
    frame: &mut [u8],
) -> Option<()> {
    give(endpoint, encoder, &Command::Stop, frame)?;
    while endpoint.work() {}
    drain(endpoint);
    Some(())
}

/// Remove everything that the endpoint has to send. Returns its size in bytes.
pub(crate) fn drain(endpoint: &mut Endpoint<'_, Engine<'_>>) -> usize {
    let mut bytes = 0;
    loop {
        let count = endpoint.pending().len();
        if count == 0 {
            return bytes;
        }
        endpoint.sent(count);
        bytes += count;
    }
}

/// Measure the next map.
fn map(
    board: &Current,
    meter: &Meter,
    endpoint: &mut Endpoint<'_, Engine<'_>>,
    patch: &Patch,
) -> MapCost {
    let mut cost = MapCost::default();
    let mut work = |cost: &mut Cost| cost.add(meter.measure(board, || endpoint.work()).0);
    work(&mut cost.begin);
    for _ in 0..FREQUENCIES {
        work(&mut cost.columns);
    }
    for _ in 0..patch.num_doppler_bins() {
        work(&mut cost.rows);
    }
    loop {
        let (count, more) = meter.measure(board, || endpoint.work());
        if !more {
            break;
        }
        cost.products.add(count);
    }
    loop {
        let (count, bytes) = meter.measure(board, || endpoint.pending().len());
        if bytes == 0 {
            break;
        }
        endpoint.sent(bytes);
        cost.frames.add(count);
        cost.bytes += bytes;
    }
    // Advance to the next patch.
    endpoint.work();
    cost
}

fn pulse(m: usize) -> Pulse {
    let along_m = 0.35 * m as f64 - 5.0;
    Pulse {
        number: m as u32,
        time_s: 1e-3 * m as f64,
        transmitter_m: [800.0, along_m, 300.0],
        receiver_m: [800.0, along_m + 1.5, 300.0],
        reference_path_m: 1708.8,
        weight: 0.75,
    }
}

/// Equal weights of sum 1.
pub(crate) fn weights(num_frequencies: usize, buffer: &mut [u8]) -> Option<&[u8]> {
    let weight = (1.0 / num_frequencies as f32).to_le_bytes();
    buffer
        .as_chunks_mut()
        .0
        .get_mut(..num_frequencies)?
        .fill(weight);
    buffer.get(..4 * num_frequencies)
}

/// Pulse `m` of two scatterers, in the encoding of the engine.
pub(crate) fn pulse_command(
    m: usize,
    num_frequencies: usize,
    buffer: &mut [u8],
) -> Option<Command<'_>> {
    let samples = write_samples(m, buffer)?;
    Some(Command::Pulse {
        pulse: pulse(m),
        encoding: ENCODING,
        samples: samples.get(..ENCODING.sample_bytes() * num_frequencies)?,
    })
}

/// Write the samples of two scatterers in the encoding of the engine.
fn write_samples(m: usize, buffer: &mut [u8]) -> Option<&[u8]> {
    let near = Turns(0x0123_4567_89ab_cdef).times(m as i64);
    let far = Turns(0x7654_3210_fedc_ba98).times(m as i64);
    let value = |k: usize| -> Complex32 {
        let near = near.plus(Turns(0x00f1_2345_6789_abcd).times(k as i64));
        let far = far.plus(Turns(0x0a98_7654_3210_fedc).times(k as i64));
        near.phasor() * 0.5 + far.phasor() * 0.25
    };
    let bytes = ENCODING.sample_bytes();
    let places = buffer.chunks_exact_mut(bytes).take(FREQUENCIES);
    for (k, place) in places.enumerate() {
        match ENCODING {
            Encoding::Complex32 => {
                write_complex32s(&[value(k)], place)?;
            }
            Encoding::Sc16 => {
                let value = value(k);
                let [a, b] = ((value.re * 32767.0) as i16).to_le_bytes();
                let [c, d] = ((value.im * 32767.0) as i16).to_le_bytes();
                place.copy_from_slice(&[a, b, c, d]);
            }
        }
    }
    buffer.get(..bytes * FREQUENCIES)
}
