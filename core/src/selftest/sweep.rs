//! Self-test of range profiles: sweeps of a stepped-frequency radar.

use num_complex::Complex;

use super::{Fnv1a, Lcg};
use crate::sweep::{BurstError, Profiler, Setup, SetupError};
use crate::{Complex32, Turns, Window};

/// Number of sweeps of the synthetic scene.
pub const SWEEPS: u32 = 3;

const PERIOD: usize = 8;
const CARRIERS: usize = 50;
const BINS: usize = 128;
const SAMPLES: usize = 8 * 37;

const SETUP: Setup = Setup {
    carriers: CARRIERS as u16,
    period: PERIOD as u16,
    samples: SAMPLES as u32,
    bins: BINS as u16,
    start_hz: 1.100_125e9,
    step_hz: 4e6,
};

/// Self-test of [`Profiler`]: [`SWEEPS`] sweeps. Intended as a static.
#[derive(Clone, Debug)]
pub struct SweepSelfTest {
    profiler: Profiler<PERIOD, CARRIERS, BINS>,
}

/// Step that rejected valid data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SweepSelfTestError {
    /// The setup was rejected.
    Setup(SetupError),
    /// Samples were rejected.
    Samples(BurstError),
    /// A sweep gave no profile.
    Profile,
}

impl SweepSelfTest {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers.
    pub const fn new() -> Self {
        Self {
            profiler: Profiler::new(),
        }
    }

    /// Run the test and return the checksum of all profiles.
    ///
    /// # Errors
    /// None in a correct build.
    pub fn run(&mut self) -> Result<u32, SweepSelfTestError> {
        let profiler = &mut self.profiler;
        profiler
            .configure(&SETUP)
            .map_err(SweepSelfTestError::Setup)?;
        let mut weights = [0.0; CARRIERS];
        if (Window::Taylor { side_lobe_db: 40.0 })
            .fill(&mut weights)
            .is_err()
        {
            return Err(SweepSelfTestError::Profile);
        }
        let weights = weights.iter().copied();
        profiler
            .set_weights(0, weights)
            .map_err(SweepSelfTestError::Setup)?;
        profiler.start(0);
        let mut checksum = Fnv1a::new();
        let mut noise = Lcg(9);
        for sweep in 0..SWEEPS {
            for carrier in 0..CARRIERS as u16 {
                // In two parts; some samples in between are missing now and then.
                for first in [0, 150 + u32::from(carrier % 7 == 3)] {
                    let last = if first == 0 { 150 } else { SAMPLES as u32 };
                    let samples = (first..last).map(|i| pair(sweep, carrier, i, &mut noise));
                    let samples = Counted(samples, (last - first) as usize);
                    profiler
                        .push(sweep, carrier, first, samples)
                        .map_err(SweepSelfTestError::Samples)?;
                }
            }
            let profile = profiler
                .finish(sweep)
                .map_err(SweepSelfTestError::Samples)?;
            if profile.values.len() != BINS {
                return Err(SweepSelfTestError::Profile);
            }
            checksum.add_bytes(&[profile.sweep as u8, profile.usable as u8]);
            checksum.add_samples(profile.values);
        }
        Ok(checksum.0)
    }
}

impl Default for SweepSelfTest {
    fn default() -> Self {
        Self::new()
    }
}

/// Iterator with a length stated by its creator.
struct Counted<I>(I, usize);

impl<I: Iterator> Iterator for Counted<I> {
    type Item = I::Item;

    fn next(&mut self) -> Option<I::Item> {
        self.1 = self.1.saturating_sub(1);
        self.0.next()
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.1, Some(self.1))
    }
}

impl<I: Iterator> ExactSizeIterator for Counted<I> {}

/// Reference and echo of two scatterers with the phase of unlocked synthesisers and noise of a few counts.
fn pair(sweep: u32, carrier: u16, i: u32, noise: &mut Lcg) -> [Complex<i16>; 2] {
    let n = i64::from(carrier);
    let synthesisers = Turns(0x9e37_79b9_7f4a_7c15).times(n * n + i64::from(sweep));
    let tone = Turns(1 << 61).times(i.into());
    let drift = Turns(0x0000_2345_6789_abcd).times(i.into());
    let sent = synthesisers.plus(tone).plus(drift).phasor();
    let near = Turns(0xf300_0000_0000_0000).times(n).phasor();
    let far = Turns(0xaa00_0000_1000_0000).times(n).phasor();
    let echo = sent * (near * 0.25 + far * 0.125);
    let mut counts = |z: Complex32| {
        let mut part = |x: f32| (x * 16384.0 + noise.next() * 8.0) as i16;
        let re = part(z.re);
        Complex::new(re, part(z.im))
    };
    [counts(sent), counts(echo)]
}

impl core::fmt::Display for SweepSelfTestError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Setup(error) => write!(f, "sweep self-test: {error}"),
            Self::Samples(error) => write!(f, "sweep self-test: {error}"),
            Self::Profile => f.write_str("sweep self-test: expected profile is missing"),
        }
    }
}

impl core::error::Error for SweepSelfTestError {}
