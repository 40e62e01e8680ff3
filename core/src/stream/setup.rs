//! The settings of a run, and why some cannot be.

use core::fmt;

use super::Patch;
use crate::fft;

/// What stays the same for a run. Sizes are at most those that the buffers were built for.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Pulses a sub-CPI, `M`, at least 1.
    pub num_pulses: u16,
    /// Frequencies a pulse, `F`, at least 1.
    pub num_frequencies: u16,
    /// Points of the range transform, `R`: a power of two, at least `F`, 2 to 4096. A range bin is
    /// `c / (R step_hz)` of two-way path.
    pub range_length: u16,
    /// Doppler bins a cycle, `D`, at least `M`. A Doppler bin is `1 / D` cycles a pulse at `f_ref`.
    pub doppler_length: u16,
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Step from sample to sample, hertz.
    pub step_hz: f64,
}

/// Sizes that buffers were built for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Capacity {
    /// Most pulses a sub-CPI.
    pub pulses: u16,
    /// Most frequencies a pulse, and most range bins of a patch.
    pub frequencies: u16,
    /// Longest range transform.
    pub range_bins: u16,
    /// Most Doppler bins of a patch; that many rows of `frequencies` samples the map buffer has.
    pub doppler_bins: u16,
    /// Most patches.
    pub patches: u16,
}

/// Why a setup or a patch was refused. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SetupError {
    /// A size is zero, or more than the buffers hold.
    Size {
        /// Which.
        what: Quantity,
        /// What was wanted.
        wanted: u32,
        /// The most there is room for.
        most: u32,
    },
    /// The range transform is no power of two from 2 to 4096, or shorter than a pulse.
    RangeLength(u16),
    /// Fewer Doppler bins a cycle than pulses.
    DopplerLength(u16),
    /// Frequencies must be positive and finite.
    Band,
    /// A window's weights, a patch's centre or the like is not a finite number.
    NotFinite,
}

/// What a size is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Quantity {
    /// Pulses a sub-CPI.
    Pulses,
    /// Frequencies a pulse.
    Frequencies,
    /// Weights of the fast-time window, one a frequency.
    Weights,
    /// Points of the range transform.
    RangeLength,
    /// Range bins of a patch.
    RangeGate,
    /// Doppler bins of a patch.
    DopplerBand,
    /// Samples of a patch's map.
    Map,
    /// Patches.
    Patches,
}

impl Setup {
    /// Reference frequency: that of sample `F / 2`, hertz.
    pub fn centre_hz(&self) -> f64 {
        self.start_hz + f64::from(self.num_frequencies / 2) * self.step_hz
    }

    /// Samples of a pulse's row in the map buffer while `patch` is in work.
    pub const fn row_stride(&self, patch: &Patch) -> usize {
        let (frequencies, bins) = (self.num_frequencies as usize, patch.num_range_bins());
        if frequencies > bins {
            frequencies
        } else {
            bins
        }
    }

    /// Checks the sizes against `capacity` and the values against sense.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn check(&self, capacity: &Capacity) -> Result<(), SetupError> {
        within(Quantity::Pulses, self.num_pulses, capacity.pulses)?;
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

    /// Checks a patch against this setup and `capacity`.
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
        // Bins beyond the band of one cycle a pulse would repeat those within.
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
                    Quantity::Pulses => "pulses a sub-CPI",
                    Quantity::Frequencies => "frequencies a pulse",
                    Quantity::Weights => "window weights",
                    Quantity::RangeLength => "points of the range transform",
                    Quantity::RangeGate => "range bins of a patch",
                    Quantity::DopplerBand => "Doppler bins of a patch",
                    Quantity::Map => "samples of a patch's map buffer",
                    Quantity::Patches => "patches",
                };
                write!(f, "{wanted} {what}: there is room for 1 to {most}")
            }
            Self::RangeLength(length) => write!(
                f,
                "a range transform of {length} points: a power of two from 2 to 4096 is needed, at \
                 least the frequencies of a pulse"
            ),
            Self::DopplerLength(length) => write!(
                f,
                "{length} Doppler bins a cycle: at least the pulses of a sub-CPI are needed"
            ),
            Self::Band => f.write_str("frequencies must be positive and finite"),
            Self::NotFinite => f.write_str("a value is not a finite number"),
        }
    }
}

impl core::error::Error for SetupError {}
