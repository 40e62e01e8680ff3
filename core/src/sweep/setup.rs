//! What a profiler is told before it begins, and why some of it cannot be.

use core::fmt;

use crate::fft;

/// Most samples of a burst: counts of the least period, added up over a sixteenth of it, have 31 bits.
const MOST_SAMPLES: u32 = 1 << 21;

/// What stays the same for a run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Carriers a sweep, `N`, at least 2.
    pub carriers: u16,
    /// Samples a period of the tone, `P`, at least 3.
    pub period: u16,
    /// Samples of each channel a burst, at least a period and at most 2^21.
    pub samples: u32,
    /// Bins of a profile, `R`: a power of two, at least `N` and at most 4096.
    pub bins: u16,
    /// First carrier and its tone, hertz.
    pub start_hz: f64,
    /// From carrier to carrier, hertz.
    pub step_hz: f64,
}

/// What there is too much or too little of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Quantity {
    /// Carriers a sweep.
    Carriers,
    /// Samples a period of the tone.
    Period,
    /// Samples a burst.
    Samples,
    /// Bins of a profile.
    Bins,
    /// Weights.
    Weights,
}

/// Why a setup was refused. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SetupError {
    /// Out of what there is room for, or what makes sense.
    Size {
        /// Of what.
        what: Quantity,
        /// What was wanted.
        wanted: u32,
        /// The least.
        least: u32,
        /// The most.
        most: u32,
    },
    /// Bins that are no power of two.
    NoPowerOfTwo(u16),
    /// Frequencies must be positive and finite.
    Band,
    /// A weight is no finite number.
    NotFinite,
}

impl Setup {
    /// What fills empty storage.
    pub(super) const EMPTY: Self = Self {
        carriers: 0,
        period: 0,
        samples: 0,
        bins: 0,
        start_hz: 0.0,
        step_hz: 0.0,
    };

    /// Checks it against the room for periods, carriers and bins.
    pub(super) fn check(
        &self,
        period: usize,
        carriers: usize,
        bins: usize,
    ) -> Result<(), SetupError> {
        let room = |count: usize| count.min(usize::from(u16::MAX)) as u32;
        let own = u32::from(self.carriers);
        let sizes = [
            (Quantity::Carriers, own, 2, room(carriers)),
            (Quantity::Period, self.period.into(), 3, room(period)),
            (
                Quantity::Samples,
                self.samples,
                self.period.into(),
                MOST_SAMPLES,
            ),
            (
                Quantity::Bins,
                self.bins.into(),
                own,
                room(bins.min(fft::MAX_LENGTH)),
            ),
        ];
        for (what, wanted, least, most) in sizes {
            if !(least..=most).contains(&wanted) {
                return Err(SetupError::Size {
                    what,
                    wanted,
                    least,
                    most,
                });
            }
        }
        if !fft::supports(self.bins.into()) {
            return Err(SetupError::NoPowerOfTwo(self.bins));
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        // The carriers' phases are turns a bin.
        let turns = self.start_hz / (self.step_hz * f64::from(self.bins));
        match positive(self.start_hz) && positive(self.step_hz) && turns < 1e6 {
            true => Ok(()),
            false => Err(SetupError::Band),
        }
    }
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size {
                what,
                wanted,
                least,
                most,
            } => {
                let what = match what {
                    Quantity::Carriers => "carriers a sweep",
                    Quantity::Period => "samples a period of the tone",
                    Quantity::Samples => "samples a burst",
                    Quantity::Bins => "bins of a profile",
                    Quantity::Weights => "weights",
                };
                write!(f, "{wanted} {what}: there may be {least} to {most}")
            }
            Self::NoPowerOfTwo(bins) => {
                write!(f, "a profile of {bins} bins: a power of two is needed")
            }
            Self::Band => f.write_str(
                "the first frequency and the step must be positive and finite, and the former at most a million times a profile's bins of the latter",
            ),
            Self::NotFinite => f.write_str("a weight is no finite number"),
        }
    }
}

impl core::error::Error for SetupError {}
