//! Navigation data in a recording's time and frame.

use glam::{DQuat, DVec2, DVec3};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::Channels;
use subaperture_model::track::{Fix, turned};
use subaperture_motion::targets::{Moment, Recovered};
use subaperture_navigation::fusion::{
    DefaultSigmas, Fused, Inertial, Position, inertial, positions, velocity_walk,
};
use subaperture_navigation::{Clock, GpsTime, Kind, Log, Place, Record};

use super::Mounting;

/// Time before and after the recording from which navigation is used, seconds.
const MARGIN_S: f64 = 2.0;
/// Maximum number of measurements of a type: each adds an epoch of about 15 kB to the fusion.
const MAX_MEASUREMENTS: usize = 2000;
/// Time after which errors of an inertial solution's positions count as independent, seconds: that between a receiver's usual corrections.
const CORRECTED_S: f64 = 1.0;
/// Minimum standard deviation, metres; smaller errors cannot be distinguished from the echoes' noise.
const MIN_SIGMA_M: f64 = 1e-4;

/// Frame and time of the recording to which logs are converted.
#[derive(Clone, Debug)]
pub struct About {
    /// Scene frame of the recording.
    pub frame: SceneFrame,
    /// Time 0 of the recording on the clock of the logs.
    pub start: Option<GpsTime>,
    /// Times of the first and last pulse, seconds.
    pub span_s: [f64; 2],
}

/// Contribution of a log or of the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// File and type of the records.
    pub name: String,
    /// Whether it is an inertial solution; positions of a receiver otherwise.
    pub inertial: bool,
    /// Number of measurements used.
    pub used: usize,
    /// Number of measurements within the recording's time.
    pub of: usize,
}

/// Reason why a log cannot be used for a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UnusableLog {
    /// The relation of its clock to the recording's is unknown.
    #[error("{name}: the recording does not state its start time on the log's clock ({clock})")]
    Start {
        /// Name of the log.
        name: String,
        /// Clock of the log.
        clock: &'static str,
    },
    /// It contains no record within the recording's time.
    #[error(
        "{name}: expected records between {first} s and {last} s of the recording's clock, found {from} s to {to} s"
    )]
    OtherTime {
        /// Name of the log.
        name: String,
        /// Time of its first record, rounded, seconds.
        from: i64,
        /// Time of its last record, seconds.
        to: i64,
        /// Time of the recording's first pulse, seconds.
        first: i64,
        /// Time of the recording's last pulse, seconds.
        last: i64,
    },
    /// Its positions cannot be converted to the scene frame.
    #[error(
        "{name}: contains geographic positions, but the recording does not state the position of its scene on the Earth"
    )]
    Frame {
        /// Name of the log.
        name: String,
    },
    /// It contains no positions.
    #[error("{name}: expected positions, found none")]
    NoPositions {
        /// Name of the log.
        name: String,
    },
    /// An earlier log already contains the same type of records.
    #[error(
        "{name}: expected one log with positions and one with inertial samples; an earlier log contains them already"
    )]
    Duplicate {
        /// Name of the log.
        name: String,
    },
}

/// Navigation data of a recording.
#[derive(Clone, Debug, Default)]
pub struct Navigation {
    pub(super) positions: Vec<Position>,
    pub(super) inertial: Vec<Inertial>,
    /// Positions of the inertial solution at intervals of [`CORRECTED_S`], with their stated deviations.
    corrected: Vec<Position>,
    /// Random walk of the velocity error of the inertial solution, m/s a root second; `None` if the log does not state it.
    pub(super) velocity_walk: Option<f64>,
    pub(super) sources: Vec<Source>,
    /// Standard deviation of sources without stated errors, estimated from their deviation from the echoes, metres.
    pub(super) stated_m: Option<f64>,
}

/// Deviation of positions from a track, estimated from the median: for Gaussian errors of equal variance along both axes of the plane, squared
/// distances are exponentially distributed,
/// and their median is `ln 2` times the mean. Unlike the mean, the median is insensitive to outliers.
#[derive(Clone, Copy)]
pub(super) struct Off {
    /// RMS distance in the plane, metres.
    pub(super) rms_m: f64,
    /// Mean square relative to the stated variance, per axis of the plane.
    pub(super) square: f64,
}

impl About {
    /// Description of a recording; its time 0 is GPS time unless that is before GPS began. `None` without pulses.
    pub fn of(channels: &Channels) -> Option<Self> {
        let first = channels.channel(0);
        let pulses = &first.collection().pulses;
        Some(Self {
            frame: first.collection().frame,
            start: first.start_ns().and_then(GpsTime::of_unix_ns),
            span_s: [pulses.first()?.time_s, pulses.last()?.time_s],
        })
    }
}

impl Navigation {
    /// Data of named logs: positions from the first log that contains positions, inertial samples from the first that contains attitudes.
    ///
    /// # Errors
    /// [`UnusableLog`].
    pub fn of_logs(logs: &[(String, Log)], about: &About) -> Result<Self, UnusableLog> {
        let mut all = Self::default();
        for (name, log) in logs {
            all.add(name, log, about)?;
        }
        Ok(all)
    }

    fn add(&mut self, name: &str, log: &Log, about: &About) -> Result<(), UnusableLog> {
        let start = start(name, log, about)?;
        let before = self.sources.len();
        // Local axes of a log are assumed to be the scene's, as for tracks.
        let local = |record: &Record| matches!(record.place, Some(Place::Local(_)));
        let frame = match log.records.iter().any(local) {
            true => SceneFrame::Local,
            false => about.frame,
        };
        let (mut placed, mut duplicate, mut other_time) = (false, false, None);
        for one in log.coverage() {
            let [places, _, attitudes] = one.with;
            if places == 0 || matches!(one.kind, Kind::Markpos | Kind::Marktime) {
                continue;
            }
            // NMEA headings are not part of an inertial solution.
            let is_inertial = attitudes > 0 && one.kind != Kind::Nmea;
            let taken = match is_inertial {
                true => !self.inertial.is_empty(),
                false => !self.positions.is_empty(),
            };
            if taken {
                duplicate = true;
                continue;
            }
            let named = format!("{name}, {}", one.kind.name());
            let unstated = DefaultSigmas::default();
            let [first_s, last_s] = [one.from, one.to].map(|time| time.since(start));
            let (of, used) = if is_inertial {
                let all = inertial(log, one.kind, &frame, start, &unstated);
                placed |= !all.is_empty();
                let (of, some) = decimated(all, about, |one| one.time_s);
                self.inertial = some;
                let places = positions(log, one.kind, &frame, start, &unstated);
                self.corrected = independent(decimated(places, about, |one| one.time_s).1);
                self.velocity_walk = velocity_walk(log, one.kind);
                (of, self.inertial.len())
            } else {
                let all = positions(log, one.kind, &frame, start, &unstated);
                placed |= !all.is_empty();
                let (of, some) = decimated(all, about, |one| one.time_s);
                self.positions = some;
                (of, self.positions.len())
            };
            match used {
                0 => other_time = Some([first_s, last_s]),
                _ => self.sources.push(Source {
                    name: named,
                    inertial: is_inertial,
                    used,
                    of,
                }),
            }
        }
        if self.sources.len() > before {
            return Ok(());
        }
        let name = name.to_owned();
        Err(match other_time {
            Some(_) if !placed => UnusableLog::Frame { name },
            Some([from_s, to_s]) => {
                let [first, last] = about.span_s.map(|s| s.round() as i64);
                let [from, to] = [from_s, to_s].map(|s| s.round() as i64);
                UnusableLog::OtherTime {
                    name,
                    from,
                    to,
                    first,
                    last,
                }
            }
            None if duplicate => UnusableLog::Duplicate { name },
            None => UnusableLog::NoPositions { name },
        })
    }

    /// Track carried by the recording, as positions. Its shape deviates from the echo track: the deviation gives the standard deviation, and its
    /// correlation time the spacing of independent positions.
    pub fn of_recording(found: &Recovered) -> Self {
        let moments = &found.moments;
        let off = |moment: &Moment| (moment.recorded_m - moment.position_m).truncate();
        let errors: Vec<DVec2> = moments.iter().map(off).collect();
        let count = errors.len().max(1) as f64;
        let mean_square = errors.iter().map(|e| e.length_squared()).sum::<f64>() / (2.0 * count);
        let correlation_length = correlation_length(&errors, mean_square);
        let mut own: Vec<f64> = moments.iter().map(Moment::spread_m).collect();
        own.sort_by(f64::total_cmp);
        let own_m = own.get(own.len() / 2).copied().unwrap_or(0.0);
        // Aligning the echo track to these positions estimated three parameters, rotation and shift.
        let independent = 2.0 * count / correlation_length as f64;
        let lost = (independent / (independent - 3.0).max(1.0)).sqrt();
        let sigma_m = (mean_square.sqrt() * lost).max(own_m).max(MIN_SIGMA_M);
        let every = correlation_length.max(moments.len().div_ceil(MAX_MEASUREMENTS));
        let positions: Vec<Position> = moments
            .iter()
            .step_by(every)
            .map(|moment| Position {
                time_s: moment.time_s,
                position_m: moment.recorded_m,
                sigma_m: DVec3::splat(sigma_m),
                velocity_m_s: None,
            })
            .collect();
        let source = Source {
            name: "the recording's own positions".to_owned(),
            inertial: false,
            used: positions.len(),
            of: moments.len(),
        };
        Self {
            positions,
            sources: vec![source],
            stated_m: Some(sigma_m),
            ..Self::default()
        }
    }

    /// Track from navigation alone: from positions, or else from the inertial solution.
    ///
    /// `attitude` is that of the body at the recording's first pulse. It is propagated by the inertial headings, for any mounting of the sensor;
    /// without them it stays constant.
    pub fn alone(&self, about: &About, attitude: DQuat, mounting: &Mounting) -> Vec<Fix> {
        let sensor = |one: &Inertial| {
            let [yaw, _] = one.heading_rad?;
            let [roll, pitch] = one.roll_pitch_rad;
            Some((one.time_s, turned(roll, pitch, yaw)))
        };
        let sensors: Vec<(f64, DQuat)> = self.inertial.iter().filter_map(sensor).collect();
        let of_sensor = nearest(&sensors, about.span_s[0]).map(|first| first.inverse() * attitude);
        let fix = |(time_s, place_m): (f64, DVec3)| {
            let sensor = nearest(&sensors, time_s).zip(of_sensor);
            let attitude = sensor.map_or(attitude, |(sensor, body)| sensor * body);
            Fix {
                time_s,
                position_m: place_m - attitude * mounting.arm_m,
                attitude: Some(attitude),
            }
        };
        if !self.positions.is_empty() {
            let all = self
                .positions
                .iter()
                .map(|one| (one.time_s, one.position_m));
            return all.map(fix).collect();
        }
        let inertial = |one: &Inertial| one.position_m.map(|[place_m, _]| (one.time_s, place_m));
        self.inertial.iter().filter_map(inertial).map(fix).collect()
    }

    /// Positions that the fusion takes for absolute: those of a receiver, else those of the inertial solution, which a receiver corrects.
    pub(super) fn absolute(&self) -> &[Position] {
        match self.positions.is_empty() {
            true => &self.corrected,
            false => &self.positions,
        }
    }

    /// Copy with standard deviations multiplied by a factor.
    pub(super) fn widened(&self, times: f64) -> Self {
        let mut wide = self.clone();
        for one in wide.positions.iter_mut().chain(&mut wide.corrected) {
            one.sigma_m *= times;
            one.velocity_m_s = one.velocity_m_s.map(|[v, sigma]| [v, sigma * times]);
        }
        for one in &mut wide.inertial {
            one.position_m = one.position_m.map(|[p, sigma]| [p, sigma * times]);
            one.velocity_m_s = one.velocity_m_s.map(|[v, sigma]| [v, sigma * times]);
            one.heading_rad = one.heading_rad.map(|[h, sigma]| [h, sigma * times]);
        }
        wide
    }

    /// Deviation of the positions from a track; `None` without positions.
    pub(super) fn off(&self, track: &Fused, arm_m: DVec3) -> Option<Off> {
        let (mut squares_m2, mut squares) = (Vec::new(), Vec::new());
        let mut samples = track.samples.iter().peekable();
        for one in self.absolute() {
            // Find the first sample at or after the measurement; samples are a pulse or a measurement apart.
            while samples
                .next_if(|next| next.time_s < one.time_s - 1e-9)
                .is_some()
            {}
            let Some(sample) = samples.peek() else { break };
            let away_s = one.time_s - sample.time_s;
            let at_m = sample.position_m + sample.attitude * arm_m + sample.velocity_m_s * away_s;
            let error = one.position_m - at_m;
            squares_m2.push(error.truncate().length_squared());
            squares.push(0.5 * (error / one.sigma_m).truncate().length_squared());
        }
        Some(Off {
            rms_m: mean_by_median(squares_m2)?.sqrt(),
            square: mean_by_median(squares)?,
        })
    }

    /// Mean angle from the inertial x axis to the radar's x axis.
    pub(super) fn squint_rad(&self, found: &Recovered) -> Option<f64> {
        let moments = &found.moments;
        let mut mean = DVec2::ZERO;
        for one in &self.inertial {
            let Some([heading, _]) = one.heading_rad else {
                continue;
            };
            let after = moments.partition_point(|moment| moment.time_s < one.time_s);
            if let Some(moment) = moments.get(after).filter(|_| after > 0) {
                let x = moment.attitude * DVec3::X;
                mean += DVec2::from_angle(libm::atan2(x.y, x.x) - heading);
            }
        }
        (mean.length() > 0.0).then(|| libm::atan2(mean.y, mean.x))
    }
}

/// Attitude nearest to a time; `all` ascends in time.
fn nearest(all: &[(f64, DQuat)], time_s: f64) -> Option<DQuat> {
    let after = all.partition_point(|one| one.0 < time_s);
    let around = [after.checked_sub(1), Some(after)].into_iter().flatten();
    let near = around.filter_map(|n| all.get(n));
    let away = |one: &(f64, DQuat)| (one.0 - time_s).abs();
    let nearest = near.min_by(|a, b| away(a).total_cmp(&away(b)));
    nearest.map(|&(_, attitude)| attitude)
}

/// Time 0 of the recording on the clock of a log.
fn start(name: &str, log: &Log, about: &About) -> Result<GpsTime, UnusableLog> {
    let clock = match log.account.clock {
        // The log's own clock is assumed to be the recording's.
        Clock::Own => {
            return Ok(about
                .start
                .filter(|start| start.week == 0)
                .unwrap_or(GpsTime {
                    week: 0,
                    seconds: 0.0,
                }));
        }
        Clock::Gps => "GPS weeks and seconds",
        Clock::SecondsOfWeek => "seconds of a GPS week",
        Clock::SecondsOfDay => "seconds of a day of UTC",
    };
    let start = match (log.account.clock, about.start) {
        (Clock::Gps, Some(start)) if start.week > 0 => Some(start),
        (Clock::SecondsOfWeek, Some(start)) => Some(GpsTime { week: 0, ..start }),
        (Clock::SecondsOfDay, Some(start)) if start.week == 0 => Some(start),
        _ => None,
    };
    start.ok_or_else(|| UnusableLog::Start {
        name: name.to_owned(),
        clock,
    })
}

/// Measurements within the recording's time, decimated if they are too many, and their number before decimation.
fn decimated<T>(all: Vec<T>, about: &About, time_s: impl Fn(&T) -> f64) -> (usize, Vec<T>) {
    let [from_s, to_s] = [about.span_s[0] - MARGIN_S, about.span_s[1] + MARGIN_S];
    let mut some: Vec<T> = all
        .into_iter()
        .filter(|one| (from_s..=to_s).contains(&time_s(one)))
        .collect();
    let of = some.len();
    if of > MAX_MEASUREMENTS {
        some = some
            .into_iter()
            .step_by(of.div_ceil(MAX_MEASUREMENTS))
            .collect();
    }
    (of, some)
}

/// Positions at least [`CORRECTED_S`] apart.
fn independent(mut all: Vec<Position>) -> Vec<Position> {
    let mut last_s = f64::NEG_INFINITY;
    all.retain(|one| {
        let kept = one.time_s - last_s >= CORRECTED_S * (1.0 - 1e-9);
        if kept {
            last_s = one.time_s;
        }
        kept
    });
    all
}

/// Mean of exponentially distributed values, estimated from the median; `None` without values.
fn mean_by_median(mut squares: Vec<f64>) -> Option<f64> {
    squares.sort_by(f64::total_cmp);
    let upper = squares.len() / 2;
    let lower = squares.len().checked_sub(1)? / 2;
    Some(0.5 * (squares[lower] + squares[upper]) / std::f64::consts::LN_2)
}

/// Correlation length in samples: 1 plus duplicate the sum of correlations up to the first one that is not positive.
fn correlation_length(errors: &[DVec2], mean_square: f64) -> usize {
    let mut sum = 1.0;
    for lag in 1..errors.len() / 2 {
        let pairs = errors.iter().zip(&errors[lag..]);
        let products: f64 = pairs.map(|(a, b)| a.dot(*b)).sum();
        let alike = products / (2.0 * mean_square * (errors.len() - lag) as f64);
        if alike.is_nan() || alike <= 0.0 {
            break;
        }
        sum += 2.0 * alike;
    }
    (sum.round() as usize).clamp(1, (errors.len() / 4).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_navigation::ReadReport;

    #[test]
    fn log_without_positions_is_refused() {
        let time = GpsTime {
            week: 2209,
            seconds: 1.0,
        };
        let log = Log {
            records: vec![Record {
                byte: 0,
                kind: Kind::Bestvel,
                time,
                place: None,
                place_sigma_m: None,
                velocity_m_s: Some(DVec3::X),
                velocity_sigma_m_s: None,
                attitude: None,
                attitude_sigma_deg: None,
            }],
            account: ReadReport::default(),
        };
        let about = About {
            frame: SceneFrame::Local,
            start: Some(time),
            span_s: [0.0, 2.0],
        };
        let name = "velocities".to_owned();
        let error = Navigation::of_logs(&[(name.clone(), log)], &about).unwrap_err();
        assert_eq!(error, UnusableLog::NoPositions { name });
    }

    /// Vehicle that drives along y and turns left by 30 degrees, with a rear-facing array; expected values by hand.
    #[test]
    fn body_attitude_follows_the_inertial_sensor() {
        let about = About {
            frame: SceneFrame::Local,
            start: None,
            span_s: [1.0, 2.0],
        };
        let moment = |time_s: f64, yaw_deg: f64| Inertial {
            time_s,
            position_m: Some([DVec3::new(0.0, 10.0 * time_s, 2.0), DVec3::ONE]),
            velocity_m_s: None,
            heading_rad: Some([yaw_deg.to_radians(), 0.1]),
            roll_pitch_rad: [0.0; 2],
        };
        let mut navigation = Navigation {
            inertial: vec![moment(0.9, 90.0), moment(1.9, 120.0)],
            ..Navigation::default()
        };
        let mounting = Mounting { arm_m: DVec3::X };
        let first = DQuat::from_rotation_z(std::f64::consts::PI);
        let check = |fixes: &[Fix]| {
            let expected = [(180f64, 9.0), (210f64, 19.0)];
            assert_eq!(fixes.len(), 2);
            for (fix, (yaw_deg, along_m)) in fixes.iter().zip(expected) {
                let x = DVec3::new(
                    libm::cos(yaw_deg.to_radians()),
                    libm::sin(yaw_deg.to_radians()),
                    0.0,
                );
                let place_m = DVec3::new(0.0, along_m, 2.0) - x;
                assert!(fix.position_m.distance(place_m) < 1e-12, "{fix:?}");
                assert!(
                    (fix.attitude.unwrap() * DVec3::X).distance(x) < 1e-12,
                    "{fix:?}"
                );
            }
        };
        check(&navigation.alone(&about, first, &mounting));
        // Positions of a receiver on the same body.
        navigation.positions = [0.9, 1.9]
            .map(|time_s| Position {
                time_s,
                position_m: DVec3::new(0.0, 10.0 * time_s, 2.0),
                sigma_m: DVec3::ONE,
                velocity_m_s: None,
            })
            .to_vec();
        check(&navigation.alone(&about, first, &mounting));
        navigation.inertial.clear();
        let fixes = navigation.alone(&about, first, &mounting);
        assert!(fixes.iter().all(|fix| fix.attitude == Some(first)));
    }

    #[test]
    fn outliers_do_not_change_the_mean() {
        // Quantiles of the exponential distribution whose mean is 2.
        let mut squares: Vec<f64> = (0..101)
            .map(|n| -2.0 * libm::log1p(-(f64::from(n) + 0.5) / 101.0))
            .collect();
        assert!((mean_by_median(squares.clone()).unwrap() - 2.0).abs() < 1e-12);
        // With five outliers in 101 values the median is that of the 53rd, -2 ln(1 - 52.5 / 101) / ln 2.
        squares[..5].fill(1e9);
        let moved = -2.0 * libm::log1p(-55.5 / 101.0) / std::f64::consts::LN_2;
        let found = mean_by_median(squares).unwrap();
        assert!((found - moved).abs() < 1e-12, "{found}, {moved}");
        assert_eq!(mean_by_median(Vec::new()), None);
    }
}
