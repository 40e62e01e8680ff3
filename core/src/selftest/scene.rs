//! Synthetic pulses of the stream self-tests: samples from integers, geometry of exact numbers.
//!
//! Samples are 16-bit: three scatterers of amplitudes 1/2, 1/4 and 1/8 with phases `t0 + tk k + tm m + tkm k m` in
//! 2^-32 turns, and noise within 1/32. Their sum is below 1, so no sample clips. The float path processes the same samples
//! after exact conversion. Positions, times, paths and weights are small multiples of powers of two, which float32 or
//! float64 represent exactly.

use super::Lcg;
use crate::fixed_point::sine;
use crate::stream::{Patch, Setup};
use crate::{Pulse, Sc16, Turns};

/// Two full sub-CPIs and a partial third, with two patches.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scene {
    pub(super) setup: Setup,
    pub(super) patches: [Patch; 2],
    /// Pulses of the last sub-CPI, fewer than in the others.
    pub(super) last_pulses: u16,
}

impl Scene {
    /// Create a scene from the sizes `[pulses, frequencies, range length, Doppler length]` and the half-widths
    /// `[range, Doppler]` of the patches.
    pub(super) const fn new(sizes: [u16; 4], reaches: [[u16; 2]; 2], last_pulses: u16) -> Self {
        let [num_pulses, num_frequencies, range_length, doppler_length] = sizes;
        let [first, second] = reaches;
        Self {
            setup: Setup {
                num_pulses,
                num_channels: 1,
                num_frequencies,
                range_length,
                doppler_length,
                start_hz: 9.9e9,
                step_hz: 3.125e6,
            },
            patches: [
                patch([0.0, 0.0, 0.0], first),
                patch([3.0, -2.0, 0.5], second),
            ],
            last_pulses,
        }
    }

    /// Number of pulses of the run.
    pub(super) fn num_pulses(&self) -> u32 {
        2 * u32::from(self.setup.num_pulses) + u32::from(self.last_pulses)
    }

    /// Number of maps of the run.
    pub(super) const fn num_maps(&self) -> u32 {
        3 * self.patches.len() as u32
    }

    /// Fast-time weights: a triangle whose sum is 1 up to rounding.
    pub(super) fn weights(&self) -> impl ExactSizeIterator<Item = f32> + Clone {
        let frequencies = self.setup.num_frequencies;
        let height = move |k: u16| (k + 1).min(frequencies - k);
        let total: u32 = (0..frequencies).map(|k| u32::from(height(k))).sum();
        (0..frequencies).map(move |k| f32::from(height(k)) / total as f32)
    }
}

const fn patch(centre_m: [f64; 3], [range_reach, doppler_reach]: [u16; 2]) -> Patch {
    Patch {
        centre_m,
        range_reach,
        doppler_reach,
    }
}

/// Metadata of pulse `number`: transmitter and receiver at a kilometre, on curved tracks.
pub(super) fn pulse(number: u32) -> Pulse {
    let n = f64::from(number);
    let bend_m = n * n / 256.0;
    Pulse {
        number,
        time_s: n / 64.0,
        transmitter_m: [n / 4.0 - 4.0, bend_m - 1024.0, 512.0],
        receiver_m: [n / 4.0 + 2.0, bend_m - 1020.0, 500.0 - n / 32.0],
        reference_path_m: 2280.0 + n / 128.0,
        weight: (32 + number % 16) as f32 / 64.0,
    }
}

/// Samples of pulse `number`. `noise` continues from pulse to pulse.
pub(super) fn samples(
    number: u32,
    num_frequencies: u16,
    noise: Lcg,
) -> impl ExactSizeIterator<Item = Sc16> + Clone {
    let mut noise = noise;
    (0..num_frequencies).map(move |k| {
        let (re, im) = scatterers(number.into(), k.into());
        Sc16::from_bits(re + noise.next_part(), im + noise.next_part())
    })
}

impl Lcg {
    /// Uniform in [-1/32, 1/32), in units of 2^-15.
    fn next_part(&mut self) -> i16 {
        (self.next_bits() >> 21) as i16
    }

    /// Skip `count` numbers.
    pub(super) fn skip(&mut self, count: u32) {
        for _ in 0..count {
            self.next_bits();
        }
    }
}

/// Sample `k` of pulse `m` without noise, parts in units of 2^-15.
fn scatterers(m: i64, k: i64) -> (i16, i16) {
    // The shift scales from 2^-30 to 2^-15 and applies the amplitude.
    const PHASES: [(u32, [i64; 4]); 3] = [
        (16, [0, -50_000_000, 300_000_000, 96_000]),
        (17, [1 << 30, 210_000_000, -700_000_000, -220_000]),
        (18, [3 << 29, 12_345_678, 98_765_432, 31_000]),
    ];
    PHASES
        .iter()
        .fold((0, 0), |(re, im), (shift, [t0, tk, tm, tkm])| {
            let turns = t0 + tk * k + tm * m + tkm * k * m;
            let phasor = sine::phasor(Turns(turns as u64).times(1 << 32));
            let part = |part: i32| (part >> shift) as i16;
            (re + part(phasor.re), im + part(phasor.im))
        })
}
