//! Errors of the recorded antenna positions.

use super::PhaseHistory;

/// Distances between recorded and true antenna positions, over all pulses and both antennas.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct TrackError {
    /// Root of the mean square, metres.
    pub rms_m: f64,
    /// Largest distance between recorded and true position, metres.
    pub max_m: f64,
}

impl TrackError {
    /// Compare recorded with true positions of `history`; `None` without true positions or pulses.
    pub fn of(history: &dyn PhaseHistory) -> Option<Self> {
        let pulses = &history.collection().pulses;
        let truth = history.true_antennas()?;
        let (mut sum, mut max) = (0.0, 0.0f64);
        for (pulse, [transmitter_m, receiver_m]) in pulses.iter().zip(truth) {
            for error_m in [
                pulse.transmitter_m.distance(*transmitter_m),
                pulse.receiver_m.distance(*receiver_m),
            ] {
                sum += error_m * error_m;
                max = max.max(error_m);
            }
        }
        let count = 2 * pulses.len().min(truth.len());
        (count > 0).then(|| Self {
            rms_m: (sum / count as f64).sqrt(),
            max_m: max,
        })
    }
}
