//! Beam of a processed Doppler band, and the relation of Doppler frequency and angle.

use super::estimate::{EstimateError, any, estimate};
use super::track::{Spacing, Track};
use super::{Beam, BeamSource};
use crate::FormError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory};

/// Doppler frequencies of an evenly sampled straight track at the centre frequency.
pub(super) struct DopplerScale {
    /// Pulse repetition frequency, hertz.
    pub(super) prf_hz: f64,
    /// Doppler frequency of a point straight ahead, hertz: `2 v / lambda`. At the angle `theta` forward of broadside it is `sin(theta)` times that.
    pub(super) ahead_hz: f64,
}

impl DopplerScale {
    /// Derive the scale from the spacing and the times of a track's pulses.
    ///
    /// # Errors
    /// [`EstimateError::NoStrip`] for pulses without times.
    pub(super) fn of(collection: &Collection, spacing: &Spacing) -> Result<Self, EstimateError> {
        let no_strip = |why: String| Err(EstimateError::NoStrip(why));
        let (Some(first), Some(last)) = (collection.pulses.first(), collection.pulses.last())
        else {
            return no_strip("the recording has no pulses".to_owned());
        };
        if !collection.timed {
            return no_strip("the pulses have no times".to_owned());
        }
        let duration_s = last.time_s - first.time_s;
        let num_intervals = spacing.numbers.last().copied().unwrap_or(0);
        let prf_hz = num_intervals as f64 / duration_s;
        if !(prf_hz.is_finite() && prf_hz > 0.0) {
            return no_strip(format!("the pulses take {duration_s} s"));
        }
        let centre_hz = first.frequency_hz(collection.num_samples / 2);
        Ok(Self {
            prf_hz,
            ahead_hz: 2.0 * centre_hz * spacing.step_m / SPEED_OF_LIGHT_M_S * prf_hz,
        })
    }
}

/// Beam that receives the Doppler band of `width_hz` about `centre_hz` at the centre frequency. Without a centre, the band is about the middle of the
/// stated beam, or else about the centroid of the azimuth spectrum ([`estimate`]).
///
/// # Errors
/// [`EstimateError::NoStrip`] for recordings without times and with a curved or unevenly sampled track; those of [`estimate`];
/// [`FormError::Unsuited`] for a band that exceeds the Doppler frequencies of all angles.
pub(super) fn beam_of_band(
    width_hz: f64,
    centre_hz: Option<f64>,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    monitor: &dyn Monitor,
) -> Result<(Beam, Option<f64>), EstimateError> {
    let collection = history.collection();
    let track = Track::of(collection, &any(history))?;
    let spacing = track.spacing().map_err(EstimateError::NoStrip)?;
    let scale = DopplerScale::of(collection, &spacing)?;
    let mut ambiguity_rad = None;
    let (centre, source) = match centre_hz {
        Some(centre_hz) => (centre_hz / scale.ahead_hz, BeamSource::Given),
        None => match history.stated_beam().ok().flatten() {
            Some(beam) => (libm::sin(beam.squint_rad), BeamSource::Given),
            None => {
                let found = estimate(history, grid, None, monitor)?;
                ambiguity_rad = (!found.decided).then_some(found.ambiguity_rad);
                (libm::sin(found.beam.squint_rad), BeamSource::Estimated)
            }
        },
    };
    let half = 0.5 * width_hz / scale.ahead_hz;
    let edges = [centre - half, centre + half];
    if !(half > 0.0 && edges.iter().all(|edge| edge.abs() < 1.0)) {
        let [from_hz, to_hz] = edges.map(|edge| edge * scale.ahead_hz);
        let unsuited = FormError::unsuited(format!(
            "Doppler band: expected a width above 0 Hz within {:.1} to {:.1} Hz, the Doppler frequencies of all angles, found {from_hz:.1} to \
             {to_hz:.1} Hz",
            -scale.ahead_hz, scale.ahead_hz
        ));
        return Err(unsuited.into());
    }
    let [from, to] = edges.map(libm::asin);
    let beam = Beam {
        target: history.target().cloned(),
        ..Beam::new(to - from, 0.5 * (from + to), source)
    };
    Ok((beam, ambiguity_rad))
}
