//! Channels on a track that replaces the recorded positions.

use subaperture_model::phase_history::{Channels, OnTrack, PhaseHistory, ReadError};
use subaperture_model::track::{Fix, SampledTrack};

use super::{Arrangement, TargetsError};

/// Place the antennas of all channels on a track, whose fixes are the poses of the body of [`Arrangement`]. A fix without attitude has that of the first
/// pulse. Pulses outside of the time of the track are left out.
///
/// # Errors
/// [`TargetsError::Arrangement`]; [`TargetsError::Track`] for an invalid track; [`TargetsError::Read`] if no pulse is within its time.
pub fn on_track<'a>(channels: Channels<'a>, fixes: &[Fix]) -> Result<Channels<'a>, TargetsError> {
    let arrangement = Arrangement::of(&channels)?;
    let mut fixes = fixes.to_vec();
    for fix in &mut fixes {
        fix.attitude.get_or_insert(arrangement.attitude);
    }
    let body = SampledTrack::new(&fixes)?;
    let span_s = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    let each = channels
        .into_inner()
        .into_iter()
        .zip(&arrangement.of_channels);
    let placed = each.map(|((about, history), [t, r])| -> Result<_, TargetsError> {
        let arms_m = [arrangement.transmitters_m[*t], arrangement.receivers_m[*r]];
        let history = OnTrack::new(history, &body, arms_m, span_s)?;
        Ok((about, Box::new(history) as Box<dyn PhaseHistory + 'a>))
    });
    let placed = placed.collect::<Result<Vec<_>, _>>()?;
    Ok(Channels::new(placed).map_err(ReadError::from)?)
}
