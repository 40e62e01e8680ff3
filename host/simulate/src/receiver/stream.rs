//! Random streams that depend only on the seed, the kind of impairment, the channel and the pulse.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Purpose of a random stream. The values are part of the meaning of a seed and must not change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Thermal = 1,
    PhaseNoise = 2,
    Jitter = 3,
    Interference = 4,
}

/// Random stream: kind in the 8 highest bits, channel in the next 16, pulse in the lowest 40.
pub(super) fn stream(seed: u64, kind: Kind, channel: usize, pulse: usize) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (channel, pulse) = (channel as u64 & 0xffff, pulse as u64 & ((1 << 40) - 1));
    random.set_stream((kind as u64) << 56 | channel << 40 | pulse);
    random
}
