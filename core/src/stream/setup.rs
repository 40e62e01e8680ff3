//! Settings of a run and their validation.

use core::fmt;

use super::Patch;
use crate::fft;

/// Settings of a run. Sizes must not exceed the [`Capacity`] of the buffers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Pulses per sub-CPI, `M >= 1`.
    pub num_pulses: u16,
    /// Channels per pulse, `C >= 1`. Each channel of pulse `m` is pushed as a pulse of its own, numbered `m C + c`, with the
    /// antennas of that channel. A store holds `M C` of them.
    pub num_channels: u16,
    /// Frequencies per pulse, `F >= 1`.
    pub num_frequencies: u16,
    /// Length of the range transform, `R`: a power of two from 2 to 4096, at least `F`. The range bin spacing is
    /// `c / (R step_hz)` of two-way path.
    pub range_length: u16,
    /// Doppler bins per cycle, `D >= M`. The Doppler bin spacing is `1 / D` cycles per pulse at `f_ref`.
    pub doppler_length: u16,
    /// Frequency of sample 0 in hertz.
    pub start_hz: f64,
    /// Frequency step between samples in hertz.
    pub step_hz: f64,
}

/// Maximum sizes that the buffers of a processor hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Capacity {
    /// Maximum pulses per sub-CPI, counted once per channel.
    pub pulses: u16,
    /// Maximum frequencies per pulse, and maximum range bins of a patch.
    pub frequencies: u16,
    /// Maximum length of the range transform.
    pub range_bins: u16,
    /// Maximum Doppler bins of a patch. The map buffer has this many rows of `frequencies` samples.
    pub doppler_bins: u16,
    /// Maximum number of patches.
    pub patches: u16,
}

/// Reason why a setup or a patch was rejected. The processor is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SetupError {
    /// A size is zero or exceeds the capacity.
    Size {
        /// Quantity whose size is invalid.
        what: Quantity,
        /// Requested size.
        wanted: u32,
        /// Maximum size.
        most: u32,
    },
    /// The range transform length is not a power of two from 2 to 4096, or is less than the number of frequencies.
    RangeLength(u16),
    /// Fewer Doppler bins per cycle than pulses per sub-CPI.
    DopplerLength(u16),
    /// Start frequency or frequency step is not positive and finite.
    Band,
    /// A window weight or a coordinate of a patch centre is not finite.
    NotFinite,
}

/// Quantity named by [`SetupError::Size`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Quantity {
    /// Pulses per sub-CPI.
    Pulses,
    /// Frequencies per pulse.
    Frequencies,
    /// Weights of the fast-time window, one per frequency.
    Weights,
    /// Length of the range transform.
    RangeLength,
    /// Range bins of a patch.
    RangeGate,
    /// Doppler bins of a patch.
    DopplerBand,
    /// Samples of the map buffer that a patch needs.
    Map,
    /// Number of patches.
    Patches,
    /// Channels per pulse, which share the store of a sub-CPI.
    Channels,
}

impl Setup {
    /// Reference frequency in hertz: the frequency of sample `F / 2`.
    pub fn centre_hz(&self) -> f64 {
        self.start_hz + f64::from(self.num_frequencies / 2) * self.step_hz
    }

    /// Pulse numbers per sub-CPI, `M C`.
    pub fn numbers_per_sub_cpi(&self) -> u32 {
        u32::from(self.num_pulses) * u32::from(self.num_channels)
    }

    /// Samples per row of the map buffer while `patch` is processed: `max(F, 2 range_reach + 1)`.
    pub const fn row_stride(&self, patch: &Patch) -> usize {
        let (frequencies, bins) = (self.num_frequencies as usize, patch.num_range_bins());
        if frequencies > bins {
            frequencies
        } else {
            bins
        }
    }

    /// Check the sizes against `capacity` and the frequencies for plausibility.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn check(&self, capacity: &Capacity) -> Result<(), SetupError> {
        within(Quantity::Pulses, self.num_pulses, capacity.pulses)?;
        let most = capacity.pulses / self.num_pulses.max(1);
        within(Quantity::Channels, self.num_channels, most)?;
        within(
            Quantity::Frequencies,
            self.num_frequencies,
            capacity.frequencies,
        )?;
        within(
            Quantity::RangeLength,
            self.range_length,
            capacity.range_bins,
        )?;
        if !fft::supports(self.range_length.into()) || self.range_length < self.num_frequencies {
            return Err(SetupError::RangeLength(self.range_length));
        }
        if self.doppler_length < self.num_pulses {
            return Err(SetupError::DopplerLength(self.doppler_length));
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if !(positive(self.start_hz) && positive(self.step_hz)) {
            return Err(SetupError::Band);
        }
        Ok(())
    }

    /// Check a patch against this setup and `capacity`.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn check_patch(&self, patch: &Patch, capacity: &Capacity) -> Result<(), SetupError> {
        let too_large = |what, wanted: usize, most: usize| SetupError::Size {
            what,
            wanted: wanted as u32,
            most: most as u32,
        };
        let range_length = self.range_length.min(capacity.frequencies).into();
        if patch.num_range_bins() > range_length {
            let wanted = patch.num_range_bins();
            return Err(too_large(Quantity::RangeGate, wanted, range_length));
        }
        // More bins than one Doppler cycle would repeat those within it.
        let doppler_length = self.doppler_length.min(capacity.doppler_bins).into();
        if patch.num_doppler_bins() > doppler_length {
            let wanted = patch.num_doppler_bins();
            return Err(too_large(Quantity::DopplerBand, wanted, doppler_length));
        }
        let wanted = patch.num_doppler_bins() * self.row_stride(patch);
        let most = usize::from(capacity.doppler_bins) * usize::from(capacity.frequencies);
        if wanted > most {
            return Err(too_large(Quantity::Map, wanted, most));
        }
        if !patch.centre_m.iter().all(|x| x.is_finite()) {
            return Err(SetupError::NotFinite);
        }
        Ok(())
    }
}

fn within(what: Quantity, wanted: u16, most: u16) -> Result<(), SetupError> {
    if wanted == 0 || wanted > most {
        return Err(SetupError::Size {
            what,
            wanted: wanted.into(),
            most: most.into(),
        });
    }
    Ok(())
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { what, wanted, most } => {
                let what = match what {
                    Quantity::Pulses => "pulses per sub-CPI",
                    Quantity::Frequencies => "frequencies per pulse",
                    Quantity::Weights => "window weights",
                    Quantity::RangeLength => "points of the range transform",
                    Quantity::RangeGate => "range bins of a patch",
                    Quantity::DopplerBand => "Doppler bins of a patch",
                    Quantity::Map => "samples of a patch's map buffer",
                    Quantity::Patches => "patches",
                    Quantity::Channels => "channels with this many pulses per sub-CPI",
                };
                write!(f, "{what}: expected 1 to {most}, found {wanted}")
            }
            Self::RangeLength(length) => write!(
                f,
                "range transform length: expected a power of two from 2 to 4096 that is at least the \
                 frequencies per pulse, found {length}"
            ),
            Self::DopplerLength(length) => write!(
                f,
                "Doppler bins per cycle: expected at least the pulses per sub-CPI, found {length}"
            ),
            Self::Band => {
                f.write_str("start frequency and frequency step must be positive and finite")
            }
            Self::NotFinite => f.write_str("a window weight or patch centre is not finite"),
        }
    }
}

impl core::error::Error for SetupError {}
