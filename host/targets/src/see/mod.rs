//! A recording's targets, pulse by pulse.

mod health;
mod looker;
mod lost;

use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Band, Channels, PhaseHistory, ReadError};
use subaperture_motion::{Array, Sighting, Tracker};
use subaperture_signal::window::Window;

use crate::arrangement::{Arrangement, ArrangementError};
use crate::cfar::Cfar;
use crate::echo::Echo;
use crate::fault::Fault;
use crate::follow::{Event, Follow};
use crate::profile::Profiler;

pub(crate) use looker::Looker;

/// Pulses that motion looks at again.
pub(crate) const WINDOW: usize = 10;

/// How targets are found.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Over frequency: what is below its side lobes beside the strongest target is not looked for.
    pub window: Window,
    /// Detection.
    pub cfar: Cfar,
    /// Association.
    pub follow: Follow,
    /// Ranges that are searched, metres; all that are told apart if `None`.
    pub ranges_m: Option<(f64, f64)>,
    /// Targets of a pulse at the most, the strongest: the time that motion takes grows with the cube of all there are.
    pub most_targets: usize,
    /// Echoes that are nearer to noise in any channel are not told of, dB.
    pub least_snr_db: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            window: Window::Taylor { side_lobe_db: 50.0 },
            cfar: Cfar::default(),
            follow: Follow::default(),
            ranges_m: None,
            most_targets: 16,
            least_snr_db: 10.0,
        }
    }
}

/// What was seen.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The antennas of the channels that were used.
    pub arrangement: Arrangement,
    /// These in the plane, transmitter by transmitter, receiver by receiver as sightings have them.
    pub array: Array,
    /// Names of the channels in that order.
    pub channels: Vec<String>,
    /// Of every pulse.
    pub pulses: Vec<Vec<Sighting>>,
    /// All echoes of every pulse, whether of a target or not.
    pub echoes: Vec<Vec<Echo>>,
    /// When each was, seconds from the collection's start.
    pub times_s: Vec<f64>,
    /// Range resolution, metres.
    pub cell_m: f64,
    /// What became of targets.
    pub events: Vec<Event>,
    /// What is wrong.
    pub faults: Vec<Fault>,
}

/// Why a recording's targets are not found, or no track of them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TargetsError {
    /// Reading failed.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Channels are not those of an array.
    #[error(transparent)]
    Arrangement(#[from] ArrangementError),
    /// Settings that cannot be.
    #[error("{0}")]
    Settings(&'static str),
    /// Frequencies differ.
    #[error(
        "channels and pulses have different frequencies: phases are compared at the middle of one band"
    )]
    Band,
    /// Too few samples for a range profile.
    #[error("{0} samples a pulse make no range profile: 8 at the least")]
    Samples(usize),
    /// There are no targets.
    #[error(
        "nothing is seen in {pulses} pulses that lasts: the strongest of all range cells is at {most_db:+.1} dB of the threshold of detection"
    )]
    Nothing {
        /// Pulses searched.
        pulses: usize,
        /// The most that a cell reached, dB over its threshold.
        most_db: f64,
    },
    /// All channels hold zeros.
    #[error("all channels are dead: they hold nothing but zeros")]
    AllDead,
    /// One target.
    #[error(
        "{most} target is seen at a time at the most, over {pulses} pulses, at {:.2} m to {:.2} m: its ranges can be trusted, a track takes two targets \
         in different directions",
        ranges_m.0, ranges_m.1
    )]
    TooFew {
        /// Most targets in a pulse.
        most: usize,
        /// Pulses in which something is seen.
        pulses: usize,
        /// Nearest and farthest.
        ranges_m: (f64, f64),
    },
    /// Those that work are no array.
    #[error("{left} of {} channels have echoes (dead: {}): an angle of arrival takes two receivers of one transmitter, half a wavelength apart or less", left + dead.len(), dead.join(", "))]
    Left {
        /// Channels with echoes.
        left: usize,
        /// The names of those without.
        dead: Vec<String>,
    },
    /// The antennas tell no motion.
    #[error(transparent)]
    Array(subaperture_motion::MotionError),
    /// No motion explains what is seen.
    #[error("pulse {pulse}: {source}")]
    Motion {
        /// In the recording.
        pulse: usize,
        /// Why.
        source: subaperture_motion::MotionError,
    },
    /// The monitor said so.
    #[error("cancelled")]
    Cancelled,
}

/// Finds the targets of a recording, in blocks of pulses.
///
/// # Errors
/// [`TargetsError`].
pub fn see(
    channels: Channels,
    settings: &Settings,
    monitor: &dyn Monitor,
) -> Result<Seen, TargetsError> {
    let num_pulses = channels.num_pulses();
    if num_pulses == 0 {
        return Err(ArrangementError::NoPulses.into());
    }
    let profiler = profiler_of(&channels, settings)?;
    let everyone = Looker::new(profiler.clone(), settings, channels.len())?;
    let looked = everyone.look(&channels, monitor)?;
    let mut faults = looked.saturated(&channels);
    if looked.most_power() == 0.0 {
        return Err(TargetsError::AllDead);
    }
    let (alive, dead) = looked.parted(channels);
    let left = (!dead.is_empty()).then(|| TargetsError::Left {
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
    let looker = Looker::new(profiler, settings, channels.len())?;
    let mut seen = looker.follow(&channels, arrangement, monitor)?;
    faults.append(&mut seen.faults);
    seen.faults = faults;
    Ok(seen)
}

fn profiler_of(channels: &Channels, settings: &Settings) -> Result<Profiler, TargetsError> {
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

/// That of a band, whose first pulse is referred to this path.
///
/// # Errors
/// Too few samples; settings that cannot be.
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
            "ranges begin at 0 m or farther, and end farther still",
        ));
    }
    if !settings.least_snr_db.is_finite() || settings.most_targets < 2 {
        return Err(TargetsError::Settings(
            "the least SNR is a number, and targets are two at the least",
        ));
    }
    Ok(Profiler::new(
        band,
        settings.window.weights(band.count),
        reference_path_m,
        settings.ranges_m,
    ))
}
