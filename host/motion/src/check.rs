//! What is refused before anything is computed, and all that can be wrong.

use crate::joint::NoEstimate;
use crate::model::{Array, Sighting};

/// Why a pulse told nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The array has not two receivers and a transmitter.
    #[error(
        "an angle of arrival takes a transmitter and two receivers, and the array has {transmitters} and {receivers}"
    )]
    Antennas {
        /// Transmitters.
        transmitters: usize,
        /// Receivers.
        receivers: usize,
    },
    /// An array that is none.
    #[error("the array's {0} is no number, or not above 0")]
    Array(&'static str),
    /// Receivers are too far apart for angles to be told.
    #[error(
        "the nearest receivers are {baseline_m:.6} m apart: angles of arrival are told without doubt up to half a wavelength, {half_m:.6} m"
    )]
    Baseline {
        /// Between them.
        baseline_m: f64,
        /// Half a wavelength.
        half_m: f64,
    },
    /// A sighting that is none.
    #[error("target {target}: {what}")]
    Sighting {
        /// The target's number.
        target: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// There is not a known heading of each pulse.
    #[error("{headings} known headings are given of {pulses} pulses, or one is no number")]
    Headings {
        /// Headings.
        headings: usize,
        /// Pulses.
        pulses: usize,
    },
    /// Time does not go on.
    #[error("a pulse at {time_s} s comes after one at {last_s} s")]
    Time {
        /// When it was.
        time_s: f64,
        /// When the one before was.
        last_s: f64,
    },
    /// The least squares.
    #[error(transparent)]
    NoEstimate(#[from] NoEstimate),
}

/// Whether angles of arrival can be told by an array.
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
        return Err(MotionError::Array("antennas' place"));
    }
    let (baseline_m, half_m) = (baseline.length(), 0.5 * array.wavelength_m);
    // To a ten-thousandth: half a wavelength is often what is meant.
    if baseline_m > half_m * 1.0001 || baseline_m == 0.0 {
        return Err(MotionError::Baseline { baseline_m, half_m });
    }
    Ok(())
}

/// Whether what is seen in a pulse is of this array.
///
/// # Errors
/// [`MotionError::Sighting`].
pub(crate) fn sightings(array: &Array, sightings: &[Sighting]) -> Result<(), MotionError> {
    for (i, sighting) in sightings.iter().enumerate() {
        let target = sighting.target;
        let is_known = |x: f64| x.is_finite() && x > 0.0;
        let what = if sighting.phases_rad.len() != array.num_channels() {
            "a phase of each channel is wanted"
        } else if !sighting.phases_rad.iter().all(|x| x.is_finite()) {
            "a phase is no number"
        } else if !is_known(sighting.range_m) {
            "its range is no distance"
        } else if !is_known(sighting.range_sigma_m) || !is_known(sighting.phase_sigma_rad) {
            "a standard deviation is above 0"
        } else if sightings[..i].iter().any(|other| other.target == target) {
            "it is seen twice in a pulse"
        } else {
            continue;
        };
        return Err(MotionError::Sighting { target, what });
    }
    Ok(())
}
