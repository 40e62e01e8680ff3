//! Targets of a recording, pulse by pulse.

mod detector;
mod health;
mod lost;

use crate::{Array, Sighting, Tracker};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Band, Channels, PhaseHistory, ReadError};
use subaperture_model::track::TrackError;
use subaperture_signal::window::Window;

use crate::targets::arrangement::{Arrangement, ArrangementError};
use crate::targets::cfar::Cfar;
use crate::targets::echo::{Echo, Subtraction};
use crate::targets::fault::Fault;
use crate::targets::follow::{Event, TrackerSettings};
use crate::targets::profile::Profiler;

pub(crate) use detector::TargetDetector;

/// Lag of the fixed-lag smoother, pulses.
pub(crate) const WINDOW: usize = 10;

/// Settings of detection, association and echo selection.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Window over frequency, Taylor with side lobes of -50 dB by default. Peaks below its side lobes of the strongest target are not searched for.
    pub window: Window,
    /// Settings of the CFAR detector.
    pub cfar: Cfar,
    /// Settings of the association from pulse to pulse.
    pub follow: TrackerSettings,
    /// Nearest and farthest range searched, metres; the whole unambiguous interval if `None`.
    pub ranges_m: Option<(f64, f64)>,
    /// Largest number of targets a pulse, the strongest first; 16 by default. The time of the least squares grows with the cube of all targets.
    pub most_targets: usize,
    /// Echoes below this SNR in any channel are not used, dB; 10 by default.
    pub least_snr_db: f64,
    /// Subtraction of other targets before one is estimated; the path of each channel by default.
    pub subtraction: Subtraction,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            window: Window::Taylor { side_lobe_db: 50.0 },
            cfar: Cfar::default(),
            follow: TrackerSettings::default(),
            ranges_m: None,
            most_targets: 16,
            least_snr_db: 10.0,
            subtraction: Subtraction::default(),
        }
    }
}

/// Targets of a recording, and its array.
#[derive(Clone, Debug)]
pub struct Detections {
    /// Antennas of the channels that are used.
    pub arrangement: Arrangement,
    /// The array in the plane of motion; channels transmitter by transmitter, receiver by receiver, as in sightings.
    pub array: Array,
    /// Names of the channels, in the array's order.
    pub channels: Vec<String>,
    /// Sightings of every pulse.
    pub pulses: Vec<Vec<Sighting>>,
    /// All echoes of every pulse, whether of a target or not.
    pub echoes: Vec<Vec<Echo>>,
    /// Times of the pulses, seconds from the collection's start.
    pub times_s: Vec<f64>,
    /// Range resolution `c / (2 B)`, metres.
    pub cell_m: f64,
    /// Births, deaths and crossings of targets.
    pub events: Vec<Event>,
    /// Faults of channels and pulses.
    pub faults: Vec<Fault>,
}

/// Reason why a recording has no targets or no track.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TargetsError {
    /// The recording could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The channels do not form an array.
    #[error(transparent)]
    Arrangement(#[from] ArrangementError),
    /// A track that replaces the recorded positions is invalid.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// A setting is invalid.
    #[error("{0}")]
    Settings(&'static str),
    /// Channels or pulses differ in frequency.
    #[error("channels or pulses differ in frequency: a track needs one band for all")]
    Band,
    /// Too few samples for a range profile.
    #[error("expected 8 samples a pulse or more for a range profile, got {0}")]
    Samples(usize),
    /// No target was detected for long enough.
    #[error(
        "no target lasts long enough in {pulses} pulses: the strongest range cell is at {most_db:+.1} dB relative to the detection threshold"
    )]
    NoLastingTarget {
        /// Number of pulses searched.
        pulses: usize,
        /// Highest level of a cell over its threshold, dB.
        most_db: f64,
    },
    /// All channels contain only zeros.
    #[error("all channels are dead: they contain only zeros")]
    AllDead,
    /// Never two targets at a time.
    #[error(
        "expected at least two targets in different directions at a time, found at most {most} target in {pulses} pulses at ranges of {:.2} m to {:.2} m; the ranges are \
         reliable",
        ranges_m.0, ranges_m.1
    )]
    TooFew {
        /// Largest number of targets in a pulse.
        most: usize,
        /// Pulses with a target.
        pulses: usize,
        /// Nearest and farthest range, metres.
        ranges_m: (f64, f64),
    },
    /// The channels with echoes do not form an array.
    #[error("{left} of {} channels have echoes (dead: {}): direction of arrival needs two receivers of one transmitter, at most half a wavelength apart", left + dead.len(), dead.join(", "))]
    TooFewChannels {
        /// Number of channels with echoes.
        left: usize,
        /// Names of those without.
        dead: Vec<String>,
    },
    /// The array does not determine directions of arrival.
    #[error(transparent)]
    Array(crate::MotionError),
    /// No motion explains the sightings.
    #[error("pulse {pulse}: {source}")]
    Motion {
        /// Number of the pulse in the recording.
        pulse: usize,
        /// Reason why the pulse has no pose.
        source: crate::MotionError,
    },
    /// The residuals contradict the track.
    #[error(
        "the track diverges: its residuals are {ratio:.1} times the noise{}. Phases may be off by whole turns, targets may be mistaken for others or move, or the radar may move out of the plane of its antennas",
        if *converged { "" } else { ", and the least squares do not converge" }
    )]
    Diverged {
        /// RMS of the residuals over that of the noise.
        ratio: f64,
        /// Whether the least squares converged.
        converged: bool,
    },
    /// Most pulses have no pose.
    #[error(
        "expected at least two targets in half of the pulses, found them in {poses} of {pulses}: the track cannot be checked over the gaps"
    )]
    Sparse {
        /// Pulses with a pose.
        poses: usize,
        /// Pulses of the recording.
        pulses: usize,
    },
    /// Standing and moving targets cannot be separated.
    #[error("no track: {0}")]
    Movers(crate::movers::Doubt),
    /// The monitor cancelled the work.
    #[error("cancelled")]
    Cancelled,
}

/// Detect targets in a recording and follow them from pulse to pulse. The recording is read once, in blocks.
///
/// # Errors
/// [`TargetsError`].
pub fn detect_targets(
    channels: Channels,
    settings: &Settings,
    monitor: &dyn Monitor,
) -> Result<Detections, TargetsError> {
    let num_pulses = channels.num_pulses();
    if num_pulses == 0 {
        return Err(ArrangementError::NoPulses.into());
    }
    let profiler = profiler_of(&channels, settings)?;
    let all_channels = TargetDetector::new(profiler.clone(), settings, channels.len())?;
    let statistics = all_channels.channel_statistics(&channels, monitor)?;
    let mut faults = statistics.saturated(&channels);
    if statistics.most_power() == 0.0 {
        return Err(TargetsError::AllDead);
    }
    let (alive, dead) = statistics.split(channels);
    let left = (!dead.is_empty()).then(|| TargetsError::TooFewChannels {
        left: alive.len(),
        dead: dead.iter().map(|(name, _)| name.clone()).collect(),
    });
    faults.extend(
        dead.into_iter()
            .map(|(channel, below_db)| Fault::Dead { channel, below_db }),
    );
    let channels = Channels::new(alive).map_err(ReadError::from)?;
    let arrangement = Arrangement::of(&channels);
    let middle_hz = profiler.middle_hz();
    let is_array = |own: &Arrangement| Tracker::new(own.array(middle_hz), 2).is_ok();
    let arrangement = match (arrangement, left) {
        (Ok(own), Some(left)) if !is_array(&own) => return Err(left),
        (Err(_), Some(left)) => return Err(left),
        (arrangement, _) => arrangement?,
    };
    Tracker::new(arrangement.array(middle_hz), 2).map_err(TargetsError::Array)?;
    let target_detector = TargetDetector::new(profiler, settings, channels.len())?;
    let mut seen = target_detector.follow(&channels, arrangement, monitor)?;
    faults.append(&mut seen.faults);
    seen.faults = faults;
    Ok(seen)
}

/// Profiler of a recording, whose channels and pulses must have one band.
///
/// # Errors
/// Different bands, too few samples, invalid settings.
pub(crate) fn profiler_of(
    channels: &Channels,
    settings: &Settings,
) -> Result<Profiler, TargetsError> {
    let first = channels.channel(0).collection();
    let band = first.band().ok_or(TargetsError::Band)?;
    let alike = |history: &dyn PhaseHistory| {
        history.collection().band().is_some_and(|other| {
            let ends = |band: &Band| [band.start_hz, band.frequency_hz(band.count)];
            other.count == band.count
                && ends(&other)
                    .iter()
                    .zip(ends(&band))
                    .all(|(a, b)| (a - b).abs() <= 1e-9 * b)
        })
    };
    if !channels.iter().all(|(_, history)| alike(history)) {
        return Err(TargetsError::Band);
    }
    profiler(band, first.pulses[0].reference_path_m, settings)
}

/// Profiler of a band whose first pulse has this reference path.
///
/// # Errors
/// Too few samples; invalid settings.
pub(crate) fn profiler(
    band: Band,
    reference_path_m: f64,
    settings: &Settings,
) -> Result<Profiler, TargetsError> {
    if band.count < 8 {
        return Err(TargetsError::Samples(band.count));
    }
    if let Some((near_m, far_m)) = settings.ranges_m
        && !(near_m >= 0.0 && far_m > near_m && far_m.is_finite())
    {
        return Err(TargetsError::Settings(
            "expected ranges from at least 0 m to a larger, finite one",
        ));
    }
    if !settings.least_snr_db.is_finite() || settings.most_targets < 2 {
        return Err(TargetsError::Settings(
            "expected a finite least SNR in dB and at least two targets",
        ));
    }
    Ok(Profiler::new(
        band,
        settings.window.weights(band.count),
        reference_path_m,
        settings.ranges_m,
    ))
}
