//! Motion of a pulsed radar between transmission and reception.
//!
//! A pulse's time is that of its start. The recorded transmitter is that at the middle of the pulse, and the receiver that at the arrival of this
//! middle from the reference point. For a point at another path the receiver moves on by the velocity times the difference of the delays; half of it
//! is the error of its position along the track: 0.25 m for 7.5 km/s and a slant range 10 km beyond the reference point's.

use glam::DVec3;

use super::keys::{RecordingDescription, TrackFrame, WaveformKeys};
use subaperture_describe::error::Fault;
use subaperture_describe::radar::IntraPulse;
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Reference point and timing of the pulses.
pub(super) struct InFlight {
    /// Point to which phases are referred.
    pub(super) reference_m: DVec3,
    /// Middle of the pulse after its start, seconds.
    middle_s: f64,
}

/// Positions of transmitter and receiver, metres.
type Places = [DVec3; 2];

/// Half of the interval over which velocities are computed, seconds.
const HALF_SPAN_S: f64 = 1e-3;

impl InFlight {
    /// Motion of a pulsed radar; `None` if it is neglected, or for other waveforms.
    pub(super) fn of(top: &RecordingDescription) -> Result<Option<Self>, Fault> {
        let WaveformKeys::Pulsed(keys) = &*top.radar.kind else {
            return Ok(None);
        };
        let frame = top.platform.frame.as_deref();
        let moves = match top.radar.motion.as_deref() {
            Some(motion) => *motion == IntraPulse::True,
            None => frame == Some(&TrackFrame::Ecef),
        };
        if !moves {
            return Ok(None);
        }
        if let Some(range) = &top.scene.reference_range_m {
            return Err(range.fault(
                "the radar moves until the echo arrives, which needs a point: give 'reference' in place of 'reference_range', or [radar] motion = \"stop-and-go\"",
            ));
        }
        Ok(Some(Self {
            reference_m: top.scene.reference_m.unwrap_or(DVec3::ZERO),
            middle_s: 0.5 * keys.pulse.shape(keys.sample_rate_hz)?.duration_s(),
        }))
    }

    /// Antennas of a pulse that starts at `time_s`; `at_m` has both at a time.
    pub(super) fn antennas_m(&self, time_s: f64, at_m: impl Fn(f64) -> Places) -> Places {
        let sent_s = time_s + self.middle_s;
        let [transmitter_m, mut receiver_m] = at_m(sent_s);
        // Each step reduces the error by the ratio of velocity to the speed of light.
        for _ in 0..3 {
            let path_m =
                transmitter_m.distance(self.reference_m) + receiver_m.distance(self.reference_m);
            receiver_m = at_m(sent_s + path_m / SPEED_OF_LIGHT_M_S)[1];
        }
        [transmitter_m, receiver_m]
    }

    /// Velocities of both antennas at transmission and reception, metres per second.
    pub(super) fn velocities_m_s(&self, time_s: f64, at_m: impl Fn(f64) -> Places) -> Places {
        let [before_m, after_m] =
            [-HALF_SPAN_S, HALF_SPAN_S].map(|s| self.antennas_m(time_s + s, &at_m));
        [0, 1].map(|i| (after_m[i] - before_m[i]) / (2.0 * HALF_SPAN_S))
    }
}
