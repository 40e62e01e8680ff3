//! Tracks: status, score and history.

use super::filter::State;
use super::settings::Settings;

/// Stage of a track.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub enum Status {
    /// The score is between both thresholds.
    Tentative,
    /// The score has exceeded the threshold of confirmation.
    Confirmed {
        /// Time of the confirming scan, seconds.
        time_s: f64,
    },
    /// The score of a confirmed track has fallen to the threshold of deletion. Deleted tentative tracks are removed.
    Deleted {
        /// Time of the deleting scan, seconds.
        time_s: f64,
    },
}

/// Estimate of a track after a scan.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Estimate {
    /// Time of the scan, seconds.
    pub time_s: f64,
    /// Mean `(x, y, vx, vy)` in the plane, metres and metres per second.
    pub mean: [f64; 4],
    /// Covariance of the mean, m^2, m * m/s and (m/s)^2.
    pub covariance: [[f64; 4]; 4],
    /// Index of the detection in its scan. `None` for a prediction.
    pub detection: Option<usize>,
}

/// Track of a target.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Track {
    /// Number of the track, from 1, unique in a tracker.
    pub id: u64,
    /// Stage of the track.
    pub status: Status,
    /// Estimates, earliest first: one for each scan since the first detection.
    pub history: Vec<Estimate>,
    /// Log-likelihood ratio of a target against false alarms.
    pub score: f64,
    /// Highest score since the first detection.
    #[serde(skip)]
    highest: f64,
    #[serde(skip)]
    state: State,
}

impl Track {
    /// Tentative track of one detection.
    pub(super) fn start(
        id: u64,
        settings: &Settings,
        state: State,
        (time_s, detection): (f64, usize),
    ) -> Self {
        let score = settings.first_score();
        let mut track = Self {
            id,
            status: Status::Tentative,
            history: Vec::new(),
            score,
            highest: score,
            state,
        };
        track.record(settings, time_s, Some(detection));
        track
    }

    /// Whether the track has been confirmed, perhaps deleted since.
    pub fn is_confirmed(&self) -> bool {
        self.status != Status::Tentative
    }

    /// Whether the track takes part in the next scan.
    pub(super) fn is_live(&self) -> bool {
        !matches!(self.status, Status::Deleted { .. })
    }

    /// State after the last scan.
    pub(super) fn state(&self) -> &State {
        &self.state
    }

    /// Add a scan's state and change of the score. `false` if a tentative track is to be removed.
    pub(super) fn advance(
        &mut self,
        settings: &Settings,
        state: State,
        change: f64,
        (time_s, detection): (f64, Option<usize>),
    ) -> bool {
        self.state = state;
        self.score += change;
        self.highest = self.highest.max(self.score);
        self.record(settings, time_s, detection);
        match self.status {
            Status::Tentative => {
                let rise = self.score - settings.first_score();
                if rise >= settings.confirming_rise() {
                    self.status = Status::Confirmed { time_s };
                }
                rise > -settings.deleting_fall()
            }
            Status::Confirmed { .. } => {
                if self.highest - self.score >= settings.deleting_fall() {
                    self.status = Status::Deleted { time_s };
                }
                true
            }
            Status::Deleted { .. } => true,
        }
    }

    fn record(&mut self, settings: &Settings, time_s: f64, detection: Option<usize>) {
        if self.history.len() >= settings.max_history {
            self.history.remove(0);
        }
        self.history.push(Estimate {
            time_s,
            mean: self.state.mean,
            covariance: self.state.covariance,
            detection,
        });
    }
}
