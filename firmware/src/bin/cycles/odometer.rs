//! Cost of a pulse through the endpoint's odometer at maximum size, call by call.
//!
//! One transmitter, the maximum number of receivers at half-wavelength spacing, four reflectors. Targets are confirmed in the second pulse. The last pulse is measured; its increment is of all four targets.

use subaperture_core::link::{
    Command, Encoder, Encoding, MotionConfiguration, State, write_complex32s, write_places,
    write_sc16s,
};
use subaperture_core::motion::{Setup, TrackerSettings};
use subaperture_core::{Complex32, Pulse, SPEED_OF_LIGHT_M_S, Sc16, Turns};
use subaperture_firmware::board::{Board, Current};
use subaperture_firmware::endpoint::Endpoint;
use subaperture_firmware::engine::WireEngine;
use subaperture_firmware::meter::Meter;
use subaperture_firmware::module::Engine;
use subaperture_firmware::sizes::{CHANNELS, ODOMETER_BINS, ODOMETER_FREQUENCIES};

use crate::run::{Cost, drain, give, stop};

const STEP_HZ: f64 = 1e9 / ODOMETER_FREQUENCIES as f64;

const SETUP: Setup = Setup {
    num_frequencies: ODOMETER_FREQUENCIES as u16,
    range_length: ODOMETER_BINS as u16,
    start_hz: 77e9,
    step_hz: STEP_HZ,
    side_lobe_db: 50.0,
    ranges_m: [1.0, 9.0],
    guard: 3,
    training: 12,
    rank: 0.6,
    false_alarm_probability: 1e-5,
    least_snr_db: 10.0,
    follow: TrackerSettings {
        gate_cells: 0.5,
        acceleration_cells: 0.01,
        apart_cells: 1.5,
        seen: 2,
        within: 3,
        bridge: 30,
    },
};

const PULSES: u32 = 4;

/// Encoding of the samples: as for maps.
const ENCODING: Encoding = Engine::MAP_ENCODING;

const PLACES_M: [[f64; 2]; 4] = [[-0.9, 2.25], [0.6, 3.5], [2.1, 4.7], [-2.6, 6.4]];

/// Run the measurement and print the costs. `None` on failure.
#[inline(never)]
pub(crate) fn run(
    board: &mut Current,
    meter: &Meter,
    endpoint: &mut Endpoint<'_, Engine<'_>>,
    encoder: &mut Encoder,
    (samples, frame): (&mut [u8], &mut [u8]),
) -> Option<()> {
    let mut antennas = [[-0.01, 0.0]; CHANNELS + 1];
    for (i, place) in antennas.iter_mut().skip(1).enumerate() {
        *place = [0.0019 * i as f64, 0.0];
    }
    let configuration = Command::Motion(MotionConfiguration {
        id: 2,
        setup: SETUP,
    });
    give(endpoint, encoder, &configuration, frame)?;
    let places = Command::Antennas {
        transmitters: 1,
        places: write_places(&antennas, samples)?,
    };
    let bytes = encoder.encode(&places, frame).ok()?;
    let configure = meter.measure(board, || endpoint.receive(bytes)).0;
    drain(endpoint);
    let start = Command::Start { run: 2, first: 0 };
    give(endpoint, encoder, &start, frame)?;
    (endpoint.state() == State::Running).then_some(())?;
    let (mut receive, mut work) = (Cost::default(), Cost::default());
    let (mut up_bytes, mut down_bytes) = (0, 0);
    for pulse in 0..PULSES {
        (receive, work) = (Cost::default(), Cost::default());
        up_bytes = 0;
        for (channel, receiver) in antennas.iter().skip(1).enumerate() {
            let command = Command::Channel {
                pulse,
                channel: channel as u16,
                reference_path_m: 5.0,
                encoding: ENCODING,
                samples: write_samples(pulse, receiver, samples)?,
            };
            let bytes = encoder.encode(&command, frame).ok()?;
            up_bytes += bytes.len();
            receive.add(meter.measure(board, || endpoint.receive(bytes)).0);
        }
        loop {
            let (count, more) = meter.measure(board, || endpoint.work());
            work.add(count);
            if !more {
                break;
            }
        }
        down_bytes = drain(endpoint);
    }
    stop(endpoint, encoder, frame)?;
    let mut show = |name: &str, value: u64| board.log(format_args!("{name} {value}"));
    show("odometer_channels", CHANNELS as u64);
    show("odometer_frequencies", ODOMETER_FREQUENCIES as u64);
    show("odometer_bins", ODOMETER_BINS as u64);
    show("odometer_configure", configure);
    show("odometer_receive", receive.sum);
    show("odometer_work", work.sum);
    show("odometer_worst", work.most);
    show("odometer_up_bytes", up_bytes as u64);
    show("increment_bytes", down_bytes as u64);
    // An increment with a motion has more than 40 bytes.
    (endpoint.state() == State::Done && down_bytes > 40).then_some(())
}

/// Samples of one receiver in a pulse, each part below 1: moved half a millimetre per pulse, phases referenced to 5 m.
fn write_samples<'b>(pulse: u32, receiver: &[f64; 2], buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let x_m = f64::from(pulse) * 0.000_5;
    let [x, y] = *receiver;
    let geometry = Pulse {
        transmitter_m: [x_m - 0.01, 0.0, 0.0],
        receiver_m: [x_m + x, y, 0.0],
        reference_path_m: 5.0,
        ..Pulse::EMPTY
    };
    let phases = PLACES_M.map(|[x, y]| {
        let path_m = geometry.relative_path_m([x, y, 0.0]);
        [77e9, STEP_HZ].map(|hz| Turns::from_f64(-hz * (path_m / SPEED_OF_LIGHT_M_S)))
    });
    let bytes = ENCODING.sample_bytes();
    let places = buffer.chunks_exact_mut(bytes).take(ODOMETER_FREQUENCIES);
    for (k, place) in places.enumerate() {
        let each = phases.map(|[start, step]| start.plus(step.times(k as i64)).phasor());
        let sum: Complex32 = each.iter().sum();
        // Add pseudo-noise, so that the residual is not zero.
        let noise = Turns(0x9e37_79b9_7f4a_7c15)
            .times((k as i64 + 7919 * i64::from(pulse)) * (k as i64 + 3))
            .phasor();
        let sample = (sum + noise * 0.05) * 0.2;
        match ENCODING {
            Encoding::Complex32 => write_complex32s(&[sample], place)?,
            Encoding::Sc16 => write_sc16s(&[Sc16::from_complex32(sample).0], place)?,
        };
    }
    buffer.get(..bytes * ODOMETER_FREQUENCIES)
}
