//! Tracks of the example scenario 'fusion' from each sensor and their fusions, with errors against the truth and stated covariances.

use std::path::Path;

use glam::{DMat2, DQuat, DVec2, DVec3};

use super::forming::{experiment, hold};
use crate::{Context, ItemError};
use subaperture::track_fusion::{About, FusedTrack, Mounting, Navigation};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channel, Channels, InMemory, PhaseHistory};
use subaperture_model::radar::{Antenna, Radar};
use subaperture_model::track::{Fix, SampledTrack, Trajectory};
use subaperture_motion::targets::{Recovered, Settings, recover};
use subaperture_navigation::{Kind, Log, Options};
use subaperture_simulate::Experiment;
use subaperture_simulate::scenario::examples;

/// Names of the tracks, in the order of [`Run::tracks`].
pub(super) const NAMES: [&str; 5] = [
    "GNSS",
    "GNSS + INS",
    "MPGA",
    "MPGA + GNSS",
    "MPGA + GNSS + INS",
];
pub(super) const GNSS: usize = 0;
pub(super) const INS: usize = 1;
pub(super) const MPGA: usize = 2;
/// Fusions with the receiver alone, and with inertial sensors too.
pub(super) const FUSED: [usize; 2] = [3, 4];

/// Files of both logs, in the order of the scenario.
const LOGS: [&str; 2] = ["gnss.log", "ins.log"];

pub(super) fn failed(error: impl std::fmt::Display) -> ItemError {
    ItemError::Measure(error.to_string())
}

/// Experiment with a seed.
pub(super) fn walk(seed: u64) -> Result<Experiment, ItemError> {
    let text = examples::text("fusion").unwrap_or_default();
    let mut walk = experiment("fusion", text)?;
    walk.seed = seed;
    Ok(walk)
}

/// Track by one method.
pub(super) struct Estimate {
    pub(super) fixes: Vec<Fix>,
    /// Error in x and y at each pulse, metres.
    pub(super) errors_m: Vec<DVec2>,
    /// Stated covariance of x and y at each pulse, square metres; `None` without a statement.
    pub(super) covariances_m2: Vec<Option<DMat2>>,
}

/// One simulated collection with its tracks.
pub(super) struct Run {
    pub(super) times_s: Vec<f64>,
    /// True positions of the middle of the antennas at each pulse, metres.
    pub(super) truth_m: Vec<DVec2>,
    /// Whether each pulse is in the outage of GNSS.
    pub(super) lost: Vec<bool>,
    pub(super) tracks: Vec<Estimate>,
    pub(super) recorded: Vec<(Channel, InMemory)>,
    pub(super) found: Recovered,
    /// Poses of the true track at the pulses.
    pub(super) true_fixes: Vec<Fix>,
}

/// Middle of transmitters and receivers in body axes, metres.
fn middle_m(radar: &Radar) -> DVec3 {
    let mean = |all: &[Antenna]| {
        let sum: DVec3 = all.iter().map(|antenna| antenna.offset_m).sum();
        sum / all.len().max(1) as f64
    };
    0.5 * (mean(&radar.transmitters) + mean(&radar.receivers))
}

/// Channels of a recording in memory.
pub(super) fn channels(recorded: &[(Channel, InMemory)]) -> Result<Channels<'static>, ItemError> {
    let boxed = recorded.iter().map(|(about, history)| {
        let history: Box<dyn PhaseHistory> = Box::new(history.clone());
        (about.clone(), history)
    });
    Channels::new(boxed.collect()).map_err(failed)
}

/// Record all channels of an experiment.
pub(super) fn recorded(
    context: &Context,
    walk: &Experiment,
) -> Result<Vec<(Channel, InMemory)>, ItemError> {
    let record = |pair| Ok((walk.about(pair), hold(context, &walk.record(pair)?)?));
    walk.pairs().into_iter().map(record).collect()
}

/// Log of the experiment, written and read back.
fn log(walk: &Experiment, index: usize) -> Result<Log, ItemError> {
    let mut bytes = Vec::new();
    walk.write_log(index, "gallery", &mut bytes)
        .map_err(failed)?;
    Log::read_from(&bytes[..], Path::new(LOGS[index]), &Options::default()).map_err(failed)
}

/// Errors of fixes in the plane at the pulses.
fn errors_m(fixes: &[Fix], run: (&[f64], &[DVec2])) -> Result<Vec<DVec2>, ItemError> {
    let track = SampledTrack::new(fixes).map_err(failed)?;
    let each = run.0.iter().zip(run.1);
    let error =
        |(&time_s, truth_m): (&f64, &DVec2)| track.pose(time_s).position_m.truncate() - *truth_m;
    Ok(each.map(error).collect())
}

/// Stated variances of a log's positions at the pulses: those of the nearest record, if it is within one and a half intervals of records.
fn stated(
    log: &Log,
    kind: Kind,
    walk: &Experiment,
    index: usize,
    times_s: &[f64],
) -> Vec<Option<DMat2>> {
    let about = &walk.logs[index];
    let records: Vec<(f64, DVec3)> = log
        .of(kind)
        .filter_map(|record| Some((record.time.since(about.start), record.place_sigma_m?)))
        .collect();
    let nearest = |time_s: &f64| {
        let off = |one: &(f64, DVec3)| (one.0 - time_s).abs();
        let near = records.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let sigma = near.1.truncate();
        (off(near) <= 1.5 / about.rate_hz).then(|| DMat2::from_diagonal(sigma * sigma))
    };
    times_s.iter().map(nearest).collect()
}

/// Rotation and shift in the plane that fit points best to others, as angle and both centres.
pub(super) fn fit(points: &[DVec2], onto: &[DVec2]) -> (f64, DVec2, DVec2) {
    let mean = |all: &[DVec2]| all.iter().sum::<DVec2>() / all.len().max(1) as f64;
    let (from, to) = (mean(points), mean(onto));
    let (mut along, mut across) = (0.0, 0.0);
    for (a, b) in points.iter().zip(onto) {
        along += (*a - from).dot(*b - to);
        across += (*a - from).perp_dot(*b - to);
    }
    (across.atan2(along), from, to)
}

/// Errors after the rotation and shift that fit the track best to the truth.
pub(super) fn fitted_m(errors_m: &[DVec2], truth_m: &[DVec2]) -> Vec<DVec2> {
    let points: Vec<DVec2> = errors_m.iter().zip(truth_m).map(|(e, t)| *e + *t).collect();
    let (angle, from, to) = fit(&points, truth_m);
    let turn = DVec2::from_angle(angle);
    let moved = |(point, truth): (&DVec2, &DVec2)| turn.rotate(*point - from) + to - *truth;
    points.iter().zip(truth_m).map(moved).collect()
}

impl Run {
    /// Simulate the experiment and estimate all tracks.
    pub(super) fn new(
        context: &Context,
        monitor: &dyn Monitor,
        walk: &Experiment,
    ) -> Result<Self, ItemError> {
        let recorded = recorded(context, walk)?;
        let all = channels(&recorded)?;
        let about = About::of(&all).ok_or_else(|| failed("the recording holds no pulses"))?;
        // Pulses in memory have no date.
        let about = About {
            start: Some(walk.logs[0].start),
            ..about
        };
        let found = recover(all, &Settings::default(), monitor)?;
        let middle_m = middle_m(&walk.radar);
        let times_s = found.seen.times_s.clone();
        let true_fix = |&time_s: &f64| {
            let pose = walk.track.pose(time_s);
            Fix {
                time_s,
                position_m: pose.point_m(middle_m),
                attitude: Some(pose.attitude),
            }
        };
        let true_fixes: Vec<Fix> = times_s.iter().map(true_fix).collect();
        let truth_m: Vec<DVec2> = true_fixes
            .iter()
            .map(|fix| fix.position_m.truncate())
            .collect();
        let outages = &walk.logs[0].outages_s;
        let is_lost = |time_s: &f64| {
            outages
                .iter()
                .any(|(from, to)| (*from..=*to).contains(time_s))
        };
        let mut run = Self {
            lost: times_s.iter().map(is_lost).collect(),
            times_s,
            truth_m,
            tracks: Vec::with_capacity(NAMES.len()),
            recorded,
            found,
            true_fixes,
        };
        run.tracks.extend(run.of_logs(walk, &about)?);
        run.tracks.push(run.of_echoes()?);
        for count in [1, 2] {
            run.tracks.push(run.fused(monitor, walk, &about, count)?);
        }
        Ok(run)
    }

    fn arm(walk: &Experiment) -> Mounting {
        Mounting {
            arm_m: walk.logs[0].lever_arm_m,
        }
    }

    /// Tracks of each log alone.
    fn of_logs(&self, walk: &Experiment, about: &About) -> Result<Vec<Estimate>, ItemError> {
        let attitude = self.true_fixes[0].attitude.unwrap_or(DQuat::IDENTITY);
        let one = |(index, kind): (usize, Kind)| {
            let log = log(walk, index)?;
            let covariances_m2 = stated(&log, kind, walk, index, &self.times_s);
            let named = [(LOGS[index].to_owned(), log)];
            let navigation = Navigation::of_logs(&named, about).map_err(failed)?;
            let fixes = navigation.alone(about, attitude, &Self::arm(walk));
            Ok(Estimate {
                errors_m: errors_m(&fixes, (&self.times_s, &self.truth_m))?,
                fixes,
                covariances_m2,
            })
        };
        [(0, Kind::Bestpos), (1, Kind::Inspvax)]
            .into_iter()
            .map(one)
            .collect()
    }

    /// Track by the echoes, on the recorded positions.
    fn of_echoes(&self) -> Result<Estimate, ItemError> {
        let moments = &self.found.moments;
        let fixes: Vec<Fix> = moments
            .iter()
            .map(|moment| Fix {
                time_s: moment.time_s,
                position_m: moment.position_m,
                attitude: Some(moment.attitude),
            })
            .collect();
        let mut covariances_m2 = vec![None; self.times_s.len()];
        for moment in moments {
            let c = &moment.covariance;
            covariances_m2[moment.pulse] =
                Some(DMat2::from_cols(c.x_axis.truncate(), c.y_axis.truncate()));
        }
        Ok(Estimate {
            errors_m: errors_m(&fixes, (&self.times_s, &self.truth_m))?,
            fixes,
            covariances_m2,
        })
    }

    /// Fusion of the echoes with the first `count` logs.
    fn fused(
        &self,
        monitor: &dyn Monitor,
        walk: &Experiment,
        about: &About,
        count: usize,
    ) -> Result<Estimate, ItemError> {
        let read = |index: usize| Ok((LOGS[index].to_owned(), log(walk, index)?));
        let logs: Vec<(String, Log)> = (0..count).map(read).collect::<Result<_, ItemError>>()?;
        let navigation = Navigation::of_logs(&logs, about).map_err(failed)?;
        let track =
            FusedTrack::new(&self.found, &navigation, &Self::arm(walk), monitor).map_err(failed)?;
        let last_s = self.times_s[self.times_s.len() - 1];
        let fixes = track.fixes([self.times_s[0], last_s]);
        let covariance = |&time_s: &f64| {
            let c = track.nearest(time_s)?.covariance;
            Some(DMat2::from_cols_array_2d(&[
                [c[0][0], c[1][0]],
                [c[0][1], c[1][1]],
            ]))
        };
        Ok(Estimate {
            errors_m: errors_m(&fixes, (&self.times_s, &self.truth_m))?,
            fixes,
            covariances_m2: self.times_s.iter().map(covariance).collect(),
        })
    }
}
