//! Settings of the cancellation, slow-time weights, and errors.

use core::f64::consts::PI;
use core::fmt;

use num_complex::Complex32;

use crate::Turns;
use crate::stream::{Patch, PatchMap, Setup};

/// Number of channels that are cancelled.
const CHANNELS: u16 = 2;

/// Settings of the clutter cancellation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dpca {
    /// Lag of channel 1 in pulses: the time between the passages of channels 0 and 1 through an along-track position. Not 0, and at most half of the pulses of a
    /// sub-CPI in either direction; negative if channel 1 is ahead.
    pub lag_pulses: f64,
}

/// Reason why the cancellation was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum DpcaError {
    /// The setup does not have two channels.
    Channels {
        /// Number of channels of the setup.
        found: u16,
    },
    /// The lag is 0: both channels have the same phase centre.
    NoLag,
    /// The lag is infinite or NaN.
    NotFinite,
    /// Less than half of the pulses of a sub-CPI would be common to both channels.
    LagTooLong {
        /// Magnitude of the lag in pulses, rounded up.
        found: u32,
        /// Maximum lag in pulses.
        most: u16,
    },
    /// The kept map of a patch exceeds the buffer.
    Map {
        /// Required number of values ([`Dpca::kept_len`]).
        wanted: u32,
        /// Number of values that the buffer holds.
        most: u32,
    },
}

impl Dpca {
    /// Check the settings for runs of `setup`.
    ///
    /// # Errors
    /// [`DpcaError`] with the expected and the found value.
    pub fn check(&self, setup: &Setup) -> Result<(), DpcaError> {
        if setup.num_channels != CHANNELS {
            return Err(DpcaError::Channels {
                found: setup.num_channels,
            });
        }
        if !self.lag_pulses.is_finite() {
            return Err(DpcaError::NotFinite);
        }
        if self.lag_pulses == 0.0 {
            return Err(DpcaError::NoLag);
        }
        let (lag, most) = (libm::fabs(self.lag_pulses), setup.num_pulses / 2);
        if lag > f64::from(most) {
            return Err(DpcaError::LagTooLong {
                found: libm::ceil(lag) as u32,
                most,
            });
        }
        Ok(())
    }

    /// Number of values of the kept map of a patch with the ratios of its range bins: `(2Q + 2)(2G + 1)`.
    pub const fn kept_len(patch: &Patch) -> usize {
        patch.map_len() + patch.num_range_bins()
    }

    /// Check that a buffer of `most` values holds the kept map of a patch.
    ///
    /// # Errors
    /// [`DpcaError::Map`].
    pub fn check_patch(patch: &Patch, most: usize) -> Result<(), DpcaError> {
        let wanted = Self::kept_len(patch);
        if wanted > most {
            return Err(DpcaError::Map {
                wanted: wanted as u32,
                most: most as u32,
            });
        }
        Ok(())
    }

    /// Slow-time weight of pulse number `pulse` of a sub-CPI of `num_pulses` pulses in `channel` 0 or 1: a Hann window over the
    /// `M - |L|` pulses of track common to both channels, at the along-track position of the pulse. The mean over the sub-CPI is 1. 0
    /// outside the common section.
    pub fn weight(&self, channel: u16, pulse: u16, num_pulses: u16) -> f32 {
        let pulses = f64::from(num_pulses);
        let section = pulses - libm::fabs(self.lag_pulses);
        // The section is half a lag before the middle of channel 0 and half a lag after that of channel 1.
        let half_lag = if channel == 0 { 0.5 } else { -0.5 } * self.lag_pulses;
        let place = (f64::from(pulse) - (pulses - 1.0) / 2.0 + half_lag) / section;
        if !(section > 0.0 && libm::fabs(place) < 0.5) {
            return 0.0;
        }
        let cosine = libm::cos(PI * place);
        (2.0 * pulses / section * cosine * cosine) as f32
    }

    /// Keep row `row` of the map of channel 0 in `kept`, rotated by the phase of stationary scatterers in channel 1. Row 0 is the
    /// lowest Doppler bin. Returns false after the last row.
    pub fn keep_row(
        &self,
        setup: &Setup,
        map: &PatchMap<'_>,
        row: usize,
        kept: &mut [Complex32],
    ) -> bool {
        let patch = &map.header.patch;
        let bins = patch.num_range_bins();
        if row >= patch.num_doppler_bins() {
            return false;
        }
        let doppler_bin = row as i32 - i32::from(patch.doppler_reach);
        let phasor = self.phase(setup, doppler_bin).phasor();
        let places = kept.get_mut(row * bins..).unwrap_or(&mut []);
        for (range_bin, place) in
            (-i32::from(patch.range_reach)..).zip(places.iter_mut().take(bins))
        {
            *place = map.at(doppler_bin, range_bin) * phasor;
        }
        true
    }

    /// Phase of channel 1 relative to channel 0 for stationary scatterers in a Doppler bin: `-d L / D` turns.
    pub(super) fn phase(&self, setup: &Setup, doppler_bin: i32) -> Turns {
        let bins = f64::from(setup.doppler_length.max(1));
        Turns::from_f64(-self.lag_pulses / bins).times(doppler_bin.into())
    }
}

impl fmt::Display for DpcaError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channels { found } => write!(
                f,
                "channels of the clutter cancellation: expected {CHANNELS}, found {found}"
            ),
            Self::NoLag => f.write_str(
                "lag of the second channel: expected a number of pulses other than 0, found 0: phase centres need a \
                 separation along the track",
            ),
            Self::NotFinite => f.write_str(
                "lag of the second channel: expected a finite number of pulses, found infinity or NaN",
            ),
            Self::LagTooLong { found, most } => write!(
                f,
                "lag of the second channel: expected at most {most} pulses, half of a sub-CPI, found {found}"
            ),
            Self::Map { wanted, most } => write!(
                f,
                "map kept for the clutter cancellation: expected at most {most} values, found {wanted}"
            ),
        }
    }
}

impl core::error::Error for DpcaError {}
