//! Multi-target tracker: association, initiation and deletion.

use super::assignment::{Pair, assign};
use super::error::TrackerError;
use super::filter::{Prediction, State};
use super::fold::Measurement;
use super::gate::quantile;
use super::scan::Scan;
use super::settings::Settings;
use super::track::{Status, Track};

/// Tracker of all targets of a sequence of scans.
#[derive(Clone, Debug)]
pub struct Tracker {
    settings: Settings,
    /// Largest Mahalanobis distance squared.
    gate: f64,
    /// Time of the last scan, seconds.
    last_s: f64,
    next_id: u64,
    not_initiated: u64,
    tracks: Vec<Track>,
}

impl Tracker {
    /// Tracker without tracks.
    ///
    /// # Errors
    /// [`TrackerError::Setting`] or [`TrackerError::Plane`] if a setting is out of its range.
    pub fn new(settings: Settings) -> Result<Self, TrackerError> {
        settings.check()?;
        Ok(Self {
            settings,
            gate: quantile(1.0 - settings.gate_probability),
            last_s: f64::NEG_INFINITY,
            next_id: 1,
            not_initiated: 0,
            tracks: Vec::new(),
        })
    }

    /// Settings of the tracker.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Tracks by ascending number: tentative, confirmed, and deleted after confirmation.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Number of detections that started no track, since the largest number of tracks or tentative tracks was reached.
    pub fn not_initiated(&self) -> u64 {
        self.not_initiated
    }

    /// Add a scan: predict, associate and update all tracks, then start tracks from detections that belong to no track.
    ///
    /// # Errors
    /// If the time is not after the last scan, a value is not finite, a covariance is not positive definite, or there are too many
    /// detections. The tracks are unchanged.
    pub fn scan(&mut self, scan: &Scan) -> Result<(), TrackerError> {
        scan.check(self.last_s, self.settings.max_detections)?;
        let interval_s = scan.time_s - self.last_s;
        self.last_s = scan.time_s;
        let free = self.update(scan, interval_s);
        for detection in free {
            self.start(scan, detection);
        }
        Ok(())
    }

    /// Update all live tracks, and return the detections without a track.
    fn update(&mut self, scan: &Scan, interval_s: f64) -> Vec<usize> {
        let settings = &self.settings;
        let live: Vec<&mut Track> = self.tracks.iter_mut().filter(|t| t.is_live()).collect();
        let density = settings.acceleration_density_m2_s3;
        let states: Vec<State> = live
            .iter()
            .map(|track| track.state().predicted(interval_s, density))
            .collect();
        let predictions: Vec<Option<Prediction>> = states
            .iter()
            .map(|&state| Prediction::new(state, &settings.plane, scan.sensor_m))
            .collect();
        let pairs = pairs(settings, self.gate, &predictions, scan);
        let assigned = assign(live.len(), scan.detections.len(), &pairs);
        let mut free = vec![true; scan.detections.len()];
        let mut removed = Vec::new();
        for (row, track) in live.into_iter().enumerate() {
            let hit = assigned[row]
                .zip(predictions[row])
                .and_then(|(index, prediction)| {
                    let detection = &scan.detections[index];
                    let innovation = prediction.innovation(&settings.plane, scan, detection)?;
                    let state = prediction.updated(&innovation);
                    Some((state, settings.hit(innovation.cost()), index))
                });
            let (state, change, detection) = match hit {
                Some((state, change, index)) => {
                    free[index] = false;
                    (state, change, Some(index))
                }
                None => (states[row], settings.miss(), None),
            };
            if !track.advance(settings, state, change, (scan.time_s, detection)) {
                removed.push(track.id);
            }
        }
        self.tracks
            .retain(|track| removed.binary_search(&track.id).is_err());
        (0..free.len()).filter(|&index| free[index]).collect()
    }

    /// Start a track from a detection, if the numbers of tracks allow it.
    fn start(&mut self, scan: &Scan, index: usize) {
        let settings = &self.settings;
        let detection = &scan.detections[index];
        let measured = Measurement::new(&settings.plane, scan, detection, 0.0);
        let start = |measured| {
            let deviation_m_s = settings.tangential_deviation_m_s;
            State::start(&settings.plane, scan.sensor_m, &measured, deviation_m_s)
        };
        let Some(state) = measured.and_then(start) else {
            return;
        };
        let tentative = self.tracks.iter();
        let tentative = tentative.filter(|track| track.status == Status::Tentative);
        let full = self.tracks.len() >= settings.max_tracks;
        let deletion_s = |track: &Track| match track.status {
            Status::Deleted { time_s } => time_s,
            _ => f64::INFINITY,
        };
        let deleted = (0..self.tracks.len())
            .filter(|&i| !self.tracks[i].is_live())
            .min_by(|&a, &b| deletion_s(&self.tracks[a]).total_cmp(&deletion_s(&self.tracks[b])));
        if tentative.count() >= settings.max_tentative || full && deleted.is_none() {
            self.not_initiated += 1;
            return;
        }
        if let (true, Some(deleted)) = (full, deleted) {
            self.tracks.remove(deleted);
        }
        let track = Track::start(self.next_id, settings, state, (scan.time_s, index));
        self.tracks.push(track);
        self.next_id += 1;
    }
}

/// Pairs of tracks and detections within the gate, with costs `d^2 + ln det S - G`.
fn pairs(
    settings: &Settings,
    gate: f64,
    predictions: &[Option<Prediction>],
    scan: &Scan,
) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (row, prediction) in predictions.iter().enumerate() {
        let Some(prediction) = prediction else {
            continue;
        };
        for (column, detection) in scan.detections.iter().enumerate() {
            if let Some(found) = prediction.innovation(&settings.plane, scan, detection)
                && found.distance <= gate
            {
                let gain = settings.hit(found.cost());
                pairs.push(Pair {
                    row,
                    column,
                    cost: 2.0 * (settings.miss() - gain),
                });
            }
        }
    }
    pairs
}
