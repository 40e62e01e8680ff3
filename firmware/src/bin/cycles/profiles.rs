//! Cost of a sweep through the endpoint's range profiler at maximum size, call by call.
//!
//! The maximum number of carriers, each with a burst of sixteen blocks of four periods of eight samples, sent in parts that fit the link buffers here; one echo.

use num_complex::Complex;
use subaperture_core::link::{
    Command, Encoder, State, SweepConfiguration, write_f32s, write_pairs,
};
use subaperture_core::sweep::Setup;
use subaperture_core::{Complex32, Turns};
use subaperture_firmware::board::{Board, Current};
use subaperture_firmware::endpoint::Endpoint;
use subaperture_firmware::meter::Meter;
use subaperture_firmware::module::Engine;
use subaperture_firmware::sizes::{CARRIERS, PROFILER_BINS};

use crate::run::{Cost, give, stop};

const SAMPLES: u32 = 512;
/// Samples per message.
const PART: u32 = 64;

const SETUP: Setup = Setup {
    carriers: CARRIERS as u16,
    period: 8,
    samples: SAMPLES,
    bins: PROFILER_BINS as u16,
    start_hz: 1.100_125e9,
    step_hz: 1e6,
};

/// Run the measurement and print the costs. `None` on failure.
#[inline(never)]
pub(crate) fn run(
    board: &mut Current,
    meter: &Meter,
    endpoint: &mut Endpoint<'_, Engine<'_>>,
    encoder: &mut Encoder,
    (samples, frame): (&mut [u8], &mut [u8]),
) -> Option<()> {
    let configuration = Command::Profiles(SweepConfiguration {
        id: 3,
        setup: SETUP,
    });
    give(endpoint, encoder, &configuration, frame)?;
    for first in (0..SETUP.carriers).step_by(32) {
        let weights = write_f32s(&[1.0 / CARRIERS as f32; 32], samples)?;
        let command = Command::Weights { first, weights };
        give(endpoint, encoder, &command, frame)?;
    }
    let start = Command::Start { run: 3, first: 0 };
    give(endpoint, encoder, &start, frame)?;
    (endpoint.state() == State::Running).then_some(())?;
    let (mut receive, mut work, mut send) = (Cost::default(), Cost::default(), Cost::default());
    let mut up_bytes = 0;
    for carrier in 0..SETUP.carriers {
        for first in (0..SAMPLES).step_by(PART as usize) {
            let command = Command::Burst {
                sweep: 0,
                carrier,
                first,
                samples: write_samples(carrier, first, samples)?,
            };
            let bytes = encoder.encode(&command, frame).ok()?;
            up_bytes += bytes.len();
            receive.add(meter.measure(board, || endpoint.receive(bytes)).0);
        }
    }
    let ask = Command::Sweep { sweep: 0 };
    endpoint.receive(encoder.encode(&ask, frame).ok()?);
    loop {
        let (count, more) = meter.measure(board, || endpoint.work());
        if !more {
            break;
        }
        work.add(count);
    }
    let mut down_bytes = 0;
    loop {
        let (count, bytes) = meter.measure(board, || endpoint.pending().len());
        if bytes == 0 {
            break;
        }
        endpoint.sent(bytes);
        send.add(count);
        down_bytes += bytes;
    }
    stop(endpoint, encoder, frame)?;
    let mut show = |name: &str, value: u64| board.log(format_args!("{name} {value}"));
    show("profiler_carriers", CARRIERS as u64);
    show("profiler_samples", SAMPLES.into());
    show("profiler_bins", PROFILER_BINS as u64);
    // All steps of a sweep cost the same.
    show("profiler_step", receive.sum / CARRIERS as u64);
    show("profiler_receive_worst", receive.most);
    show("profiler_work", work.sum);
    show("profiler_send", send.sum);
    show("profiler_up_bytes", up_bytes as u64);
    show("profile_bytes", down_bytes as u64);
    // More than eight bytes per bin.
    (endpoint.state() == State::Done && down_bytes > 8 * PROFILER_BINS).then_some(())
}

/// Reference and echo, whose phase advances by an eighth of a turn per sample plus the synthesisers' phase.
fn write_samples(carrier: u16, first: u32, buffer: &mut [u8]) -> Option<&[u8]> {
    let n = i64::from(carrier);
    let synthesisers = Turns(0x9e37_79b9_7f4a_7c15).times(n * n);
    let path = Turns(0xf300_0000_0000_0000).times(n).phasor();
    let counts = |z: Complex32| Complex::new((z.re * 16384.0) as i16, (z.im * 16384.0) as i16);
    let mut pairs = [[Complex::new(0, 0); 2]; PART as usize];
    for (i, pair) in (i64::from(first)..).zip(&mut pairs) {
        let sent = synthesisers.plus(Turns(1 << 61).times(i)).phasor();
        *pair = [counts(sent), counts(sent * path * 0.25)];
    }
    write_pairs(&pairs, buffer)
}
