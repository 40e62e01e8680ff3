//! Settings of the range profiler and their validation.

use core::fmt;

use crate::fft;

/// Maximum samples per burst: sums over a sixteenth of a burst at the smallest period then fit 31 bits.
const MAX_SAMPLES: u32 = 1 << 21;

/// Settings of a range-profile run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Carriers per sweep, `N >= 2`.
    pub carriers: u16,
    /// Samples per period of the tone, `P >= 3`.
    pub period: u16,
    /// Samples per burst and channel, at least one period and at most 2^21.
    pub samples: u32,
    /// Bins of a profile, `R`: a power of two, at least `N` and at most 4096.
    pub bins: u16,
    /// Frequency of the first carrier including its tone, in hertz.
    pub start_hz: f64,
    /// Frequency step between carriers in hertz.
    pub step_hz: f64,
}

/// Quantity named by [`SetupError::Size`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Quantity {
    /// Carriers per sweep.
    Carriers,
    /// Samples per period of the tone.
    Period,
    /// Samples per burst.
    Samples,
    /// Bins of a profile.
    Bins,
    /// Window weights, one per carrier.
    Weights,
}

/// Reason why a setup was rejected. The profiler is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SetupError {
    /// A size is outside its limits or the capacity.
    Size {
        /// Quantity whose size is invalid.
        what: Quantity,
        /// Requested size.
        wanted: u32,
        /// Minimum size.
        least: u32,
        /// Maximum size.
        most: u32,
    },
    /// The number of bins, given here, is not a power of two.
    NoPowerOfTwo(u16),
    /// Start frequency or frequency step is not positive and finite.
    Band,
    /// A weight is not finite.
    NotFinite,
}

impl Setup {
    /// Initial value of a buffer.
    pub(super) const EMPTY: Self = Self {
        carriers: 0,
        period: 0,
        samples: 0,
        bins: 0,
        start_hz: 0.0,
        step_hz: 0.0,
    };

    /// Validate against the capacity for periods, carriers and bins.
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
                MAX_SAMPLES,
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
        // Phase advance of the first carrier per bin, in turns.
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
                    Quantity::Carriers => "carriers per sweep",
                    Quantity::Period => "samples per period of the tone",
                    Quantity::Samples => "samples per burst",
                    Quantity::Bins => "bins of a profile",
                    Quantity::Weights => "weights",
                };
                write!(f, "{what}: expected {least} to {most}, found {wanted}")
            }
            Self::NoPowerOfTwo(bins) => {
                write!(f, "bins of a profile: expected a power of two, found {bins}")
            }
            Self::Band => f.write_str(
                "start frequency and step must be positive and finite, and the start frequency below a million times step times bins",
            ),
            Self::NotFinite => f.write_str("a window weight is not finite"),
        }
    }
}

impl core::error::Error for SetupError {}
