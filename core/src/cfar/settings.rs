//! Settings of the detector, detections, and errors.

use core::fmt;

use crate::LengthError;

/// Half-widths of the guard and training regions along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TrainingWindow {
    /// Guard cells on each side of the cell under test.
    pub guard: u16,
    /// Training cells on each side, outside the guard cells.
    pub training: u16,
}

/// Settings of the CA-CFAR detector.
///
/// With `guard` and `training` 0 in Doppler the training cells lie in the row of the cell under test.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cfar {
    /// Guard and training cells in range.
    pub range: TrainingWindow,
    /// Guard and training cells in Doppler.
    pub doppler: TrainingWindow,
    /// Probability of false alarm per tested cell, between 0 and 1 exclusive.
    pub false_alarm_probability: f64,
}

/// Target detected in a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// Range position in bins from the patch centre.
    pub range_bin: f32,
    /// Doppler position in bins from the patch centre.
    pub doppler_bin: f32,
    /// Interpolated peak power.
    pub power: f32,
    /// Mean power of the training cells.
    pub noise: f32,
}

impl Detection {
    /// Nearest cell: Doppler bin and range bin, counted from the patch centre.
    pub fn cell(&self) -> (i32, i32) {
        let [doppler, range] =
            [self.doppler_bin, self.range_bin].map(|bin| libm::roundf(bin) as i32);
        (doppler, range)
    }
}

/// Cell counts of one CFAR run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CellCounts {
    /// Cells tested: valid power and at least one training cell.
    pub tested: u32,
    /// Tested cells above the threshold, local maxima or not.
    pub above: u32,
    /// Detections dropped because the list was full. The weakest are dropped.
    pub dropped: u32,
}

/// Reason why a map was not searched. The list of detections is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CfarError {
    /// The probability of false alarm is not between 0 and 1.
    Probability,
    /// The settings have no training cells.
    NoTraining,
    /// A slice has the wrong length.
    Length(LengthError),
}

impl Cfar {
    /// Check the settings.
    ///
    /// # Errors
    /// [`CfarError::Probability`] or [`CfarError::NoTraining`].
    pub fn check(&self) -> Result<(), CfarError> {
        let probability = self.false_alarm_probability;
        if !(probability > 0.0 && probability < 1.0) {
            return Err(CfarError::Probability);
        }
        if self.range.training == 0 && self.doppler.training == 0 {
            return Err(CfarError::NoTraining);
        }
        Ok(())
    }
}

impl TrainingWindow {
    /// Half-widths in cells: to the last guard cell, and to the last training cell.
    pub(super) fn bounds(self) -> (usize, usize) {
        let guard = usize::from(self.guard);
        (guard, guard + usize::from(self.training))
    }
}

impl fmt::Display for CfarError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Probability => {
                f.write_str("probability of false alarm must be between 0 and 1 (exclusive)")
            }
            Self::NoTraining => {
                f.write_str("no training cells: set at least one in range or Doppler")
            }
            Self::Length(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for CfarError {}
