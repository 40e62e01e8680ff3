//! Validation of arrays and sightings, and the errors of this crate.

use crate::joint::NoEstimate;
use crate::model::{Array, Sighting};

/// Reason why a pulse or an array is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The array has fewer than two receivers or no transmitter.
    #[error(
        "direction of arrival needs at least one transmitter and two receivers: the array has {transmitters} and {receivers}"
    )]
    Antennas {
        /// Number of transmitters of the array.
        transmitters: usize,
        /// Number of receivers of the array.
        receivers: usize,
    },
    /// The wavelength or an antenna's position is invalid.
    #[error(
        "array: expected finite antenna positions and a finite wavelength above 0, got an invalid {0}"
    )]
    Array(&'static str),
    /// The nearest receivers are too far apart for an unambiguous direction of arrival.
    #[error(
        "the nearest receivers are {baseline_m:.6} m apart: direction of arrival is unambiguous up to half a wavelength, {half_m:.6} m"
    )]
    Baseline {
        /// Distance of the nearest receivers, metres.
        baseline_m: f64,
        /// Half a wavelength, metres.
        half_m: f64,
    },
    /// A sighting has an invalid value.
    #[error("target {target}: {fault}")]
    Sighting {
        /// Number of the target.
        target: usize,
        /// Expected value and the fault.
        fault: &'static str,
    },
    /// The number of headings differs from the number of pulses, or a heading is not finite.
    #[error("expected one finite heading per pulse ({pulses}), got {headings} headings")]
    Headings {
        /// Number of headings given.
        headings: usize,
        /// Number of pulses of the track.
        pulses: usize,
    },
    /// Times do not ascend.
    #[error("expected ascending finite times: a pulse at {time_s} s follows one at {last_s} s")]
    Time {
        /// Time of the pulse, seconds.
        time_s: f64,
        /// Time of the pulse before, seconds.
        last_s: f64,
    },
    /// The least squares have no solution.
    #[error(transparent)]
    NoEstimate(#[from] NoEstimate),
}

/// Check that the array determines directions of arrival.
///
/// # Errors
/// [`MotionError::Antennas`], [`MotionError::Array`], [`MotionError::Baseline`].
pub(crate) fn array(array: &Array) -> Result<(), MotionError> {
    let (Some((_, baseline)), false) = (array.shortest_baseline(), array.transmitters_m.is_empty())
    else {
        return Err(MotionError::Antennas {
            transmitters: array.transmitters_m.len(),
            receivers: array.receivers_m.len(),
        });
    };
    if !(array.wavelength_m.is_finite() && array.wavelength_m > 0.0) {
        return Err(MotionError::Array("wavelength"));
    }
    let mut antennas = array.transmitters_m.iter().chain(&array.receivers_m);
    if !antennas.all(|at_m| at_m.is_finite()) {
        return Err(MotionError::Array("antenna position"));
    }
    let (baseline_m, half_m) = (baseline.length(), 0.5 * array.wavelength_m);
    // Within a ten-thousandth: half a wavelength is often intended.
    if baseline_m > half_m * 1.0001 || baseline_m == 0.0 {
        return Err(MotionError::Baseline { baseline_m, half_m });
    }
    Ok(())
}

/// Check that the sightings of a pulse fit the array.
///
/// # Errors
/// [`MotionError::Sighting`].
pub(crate) fn sightings(array: &Array, sightings: &[Sighting]) -> Result<(), MotionError> {
    for (i, sighting) in sightings.iter().enumerate() {
        let target = sighting.target;
        let is_positive = |x: f64| x.is_finite() && x > 0.0;
        let fault = if sighting.phases_rad.len() != array.num_channels() {
            "expected one phase a channel"
        } else if !sighting.phases_rad.iter().all(|x| x.is_finite()) {
            "expected finite phases"
        } else if !is_positive(sighting.range_m) {
            "expected a finite range above 0"
        } else if !is_positive(sighting.range_sigma_m) || !is_positive(sighting.phase_sigma_rad) {
            "expected finite standard deviations above 0"
        } else if sightings[..i].iter().any(|other| other.target == target) {
            "expected one sighting of a target in a pulse, got it twice"
        } else {
            continue;
        };
        return Err(MotionError::Sighting { target, fault });
    }
    Ok(())
}
