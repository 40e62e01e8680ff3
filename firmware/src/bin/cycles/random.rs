//! Longest pieces of work over random setups.
//!
//! Sizes, patch, chip and detector are drawn within the capacity of the build. A piece is one call of the endpoint; the firmware
//! reads its receive buffer between two calls. The largest sizes alone do not show the longest piece: chip and detector have
//! sizes of their own. The last setups have two channels, and a clutter cancellation in place of a chip.

use subaperture_core::cfar::{Cfar, TrainingWindow};
use subaperture_core::dpca::Dpca;
use subaperture_core::fft;
use subaperture_core::link::{ChipGrid, Command, Configuration, Encoder, State};
use subaperture_core::stream::{Patch, Setup};
use subaperture_firmware::board::{Board, Current};
use subaperture_firmware::endpoint::Endpoint;
use subaperture_firmware::meter::Meter;
use subaperture_firmware::module::Engine;
use subaperture_firmware::sizes::{DOPPLER_BINS, FREQUENCIES, PIXELS, PULSES, RANGE_BINS};

use crate::run::{Cost, give, pulse_command, weights};

const SETUPS: u32 = 15;

/// Setups of one channel.
const SINGLE: u32 = 12;

/// Generator of setups: SplitMix64.
struct Random(u64);

impl Random {
    /// Number from `least` to `most`, both included.
    fn within(&mut self, least: usize, most: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        least + ((z ^ (z >> 31)) % (most - least + 1) as u64) as usize
    }

    fn window(&mut self, most: usize) -> TrainingWindow {
        TrainingWindow {
            guard: self.within(0, 8) as u16,
            training: self.within(1, most) as u16,
        }
    }
}

/// Run the setups and print the longest pieces. `None` on failure.
#[inline(never)]
pub(crate) fn run(
    board: &mut Current,
    meter: &Meter,
    endpoint: &mut Endpoint<'_, Engine<'_>>,
    encoder: &mut Encoder,
    (samples, frame): (&mut [u8], &mut [u8]),
) -> Option<()> {
    let (mut receive, mut work, mut send) = (Cost::default(), Cost::default(), Cost::default());
    let mut random = Random(1);
    for id in 0..SETUPS {
        let num_pulses = random.within(1, PULSES);
        let num_frequencies = random.within(1, FREQUENCIES);
        let lengths = || {
            let powers = (0..16).map(|power| 1usize << power);
            powers.filter(|n| (num_frequencies..=RANGE_BINS).contains(n) && fft::supports(*n))
        };
        let range_length = lengths().nth(random.within(0, lengths().count() - 1))?;
        let doppler_length = random.within(num_pulses, 2 * PULSES);
        let half = |count: usize| (count - 1) / 2;
        let bins = range_length.min(FREQUENCIES);
        let mut patch = Patch {
            centre_m: [3.0, -2.0, 0.0],
            range_reach: random.within(0, half(bins)) as u16,
            doppler_reach: random.within(0, half(doppler_length.min(DOPPLER_BINS))) as u16,
        };
        let cancels = id >= SINGLE;
        let (num_pulses, num_channels) = match cancels {
            true => ((num_pulses / 2).max(2), 2),
            false => (num_pulses, 1),
        };
        if cancels {
            // The kept map fits the pixels.
            let most = half(PIXELS / (patch.num_doppler_bins() + 1));
            patch.range_reach = patch.range_reach.min(most as u16);
        }
        let setup = Setup {
            num_pulses: num_pulses as u16,
            num_channels,
            num_frequencies: num_frequencies as u16,
            range_length: range_length as u16,
            doppler_length: doppler_length.max(num_pulses) as u16,
            start_hz: 9.4e9,
            step_hz: 1.4e6,
        };
        let chip = ChipGrid {
            patch: 0,
            origin_m: [-4.0, -4.0, 0.0],
            column_step_m: [0.05, 0.0, 0.0],
            row_step_m: [0.0, 0.25, 0.0],
            num_columns: random.within(1, 200) as u16,
            num_rows: random.within(1, 5) as u16,
        };
        let exponent = random.within(1, 60) as f64 / 10.0;
        let detect = Cfar {
            range: random.window(200),
            doppler: random.window(20),
            false_alarm_probability: 1.0 / (1.0 + exponent * exponent * exponent),
        };
        let configuration = Configuration {
            id,
            setup,
            total_pulses: num_pulses as u32 * u32::from(num_channels),
            send_maps: !cancels,
        };
        give(endpoint, encoder, &Command::Configure(configuration), frame)?;
        let weights = Command::Weights {
            first: 0,
            weights: weights(num_frequencies, samples)?,
        };
        give(endpoint, encoder, &weights, frame)?;
        for command in [
            Command::Patch {
                index: 0,
                count: 1,
                patch,
            },
            match cancels {
                true => Command::Dpca(Dpca { lag_pulses: 0.75 }),
                false => Command::Chip(chip),
            },
            Command::Detect(detect),
            Command::Start { run: id, first: 0 },
        ] {
            give(endpoint, encoder, &command, frame)?;
        }
        (endpoint.state() == State::Running).then_some(())?;
        for m in 0..num_pulses * usize::from(num_channels) {
            let command = pulse_command(m, num_frequencies, samples)?;
            let bytes = encoder.encode(&command, frame).ok()?;
            receive.add(meter.measure(board, || endpoint.receive(bytes)).0);
        }
        endpoint.receive(encoder.encode(&Command::Stop, frame).ok()?);
        loop {
            let (count, worked) = meter.measure(board, || endpoint.work());
            work.add(count);
            let (count, bytes) = meter.measure(board, || endpoint.pending().len());
            send.add(count);
            endpoint.sent(bytes);
            if !worked && bytes == 0 {
                break;
            }
        }
        (endpoint.state() == State::Done).then_some(())?;
    }
    let mut show = |name: &str, value: u64| board.log(format_args!("{name} {value}"));
    show("random_setups", SETUPS.into());
    show("random_receive_worst", receive.most);
    show("random_work_worst", work.most);
    show("random_send_worst", send.most);
    Some(())
}
