//! Live view of a capture of chirps: each burst is a sweep.

use super::board::LiveState;
use super::display::{Display, Finished, LiveSweep, View};
use super::level::Level;
use super::step::Counts;
use crate::profile::{ProfileError, Sweep};
use crate::sigmf::Setup;

/// Burst of a capture of chirps, with the counters of the capture.
#[derive(Clone, Debug)]
pub struct LiveBurst {
    /// Index of the burst.
    pub index: u64,
    /// Device time of the first sample, seconds.
    pub time_s: f64,
    /// Frequency response of the burst.
    pub response: Sweep,
    /// Levels of reference and echo.
    pub levels: [Level; 2],
    /// Flags: late, lost samples, unsteady, clipped, unlocked. Those of a stepped capture that chirps do not have are false.
    pub flagged: [bool; 5],
    /// Counters since the start of the capture, this burst included; `steps` are bursts.
    pub counts: Counts,
}

/// Display of the bursts of a capture of chirps.
pub struct BurstView {
    display: Display,
}

impl BurstView {
    /// Make a view and its board, for `bursts` bursts (0 runs until stopped) with the parameters `setup` in effect.
    ///
    /// # Errors
    /// If the calibration belongs to another set-up, or the reach exceeds the unambiguous range.
    pub fn new(setup: &Setup, bursts: u64, view: View) -> Result<(Self, LiveState), ProfileError> {
        // Two channels of 4 bytes a sample, less the pauses between bursts.
        let bytes_a_second = 8.0 * setup.sample_rate_hz;
        let about = (setup.name.as_str(), bursts);
        let (display, board) = Display::new(about, setup, bytes_a_second, view)?;
        Ok((Self { display }, board))
    }

    /// Publish a burst on the board, calibrated if a calibration is given.
    pub fn take(&mut self, board: &LiveState, burst: LiveBurst) -> LiveSweep {
        let finished = Finished {
            index: burst.index,
            began_s: burst.time_s,
            flagged: burst.flagged.map(usize::from),
            levels: burst.levels,
            counts: burst.counts,
        };
        let response = self.display.ranging.calibrated(burst.response);
        let responses = response.map(|sweep| vec![sweep]);
        self.display.show(board, &finished, responses)
    }
}
