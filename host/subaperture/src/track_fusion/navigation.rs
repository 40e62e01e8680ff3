//! What navigation says, on a recording's clock and in its frame.

use glam::{DQuat, DVec2, DVec3};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::Channels;
use subaperture_model::track::{Fix, turned};
use subaperture_motion::targets::{Moment, Recovered};
use subaperture_navigation::fusion::{
    DefaultSigmas, Fused, Inertial, Position, inertial, positions,
};
use subaperture_navigation::{Clock, GpsTime, Kind, Log, Place, Record};

use super::Mounting;

/// Before and after the recording navigation is taken from so long, seconds.
const BESIDE_S: f64 = 2.0;
/// Measurements of a kind at the most: each is a moment of which the fusion keeps some 15 kB.
const MOST: usize = 2000;
/// What is off by less is not told from the echoes' own noise, metres.
const MIN_SIGMA_M: f64 = 1e-4;

/// The recording that logs are brought to.
#[derive(Clone, Debug)]
pub struct About {
    /// Its frame.
    pub frame: SceneFrame,
    /// When its time 0 was, of a log's clock.
    pub start: Option<GpsTime>,
    /// Its first and its last pulse, seconds.
    pub span_s: [f64; 2],
}

/// What a log or the recording brought.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Of which file and kind.
    pub name: String,
    /// Positions of a receiver, or moments of an inertial solution.
    pub inertial: bool,
    /// How many are used.
    pub used: usize,
    /// Of how many within the recording's time.
    pub of: usize,
}

/// Why logs are of no use for a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoNavigation {
    /// Its times are not those of the recording.
    #[error("{name}: the recording does not say when it began by the log's clock ({clock})")]
    Start {
        /// The log.
        name: String,
        /// Its clock.
        clock: &'static str,
    },
    /// Nothing of it is of the recording's time.
    #[error(
        "{name}: it goes from {from} s to {to} s of the recording's clock, which goes from {first} s to {last} s"
    )]
    Elsewhen {
        /// The log.
        name: String,
        /// Its first record, rounded.
        from: i64,
        /// Its last.
        to: i64,
        /// The recording's first pulse.
        first: i64,
        /// Its last.
        last: i64,
    },
    /// It has no place in the frame.
    #[error(
        "{name}: its places are on the Earth, and the recording does not say where its scene is"
    )]
    Frame {
        /// The log.
        name: String,
    },
    /// It tells no places.
    #[error("{name}: no place is in it")]
    Nowhere {
        /// The log.
        name: String,
    },
    /// Others before it say the same.
    #[error(
        "{name}: positions and inertial moments are taken from one log each, and those before have them"
    )]
    Twice {
        /// The log.
        name: String,
    },
}

/// What navigation says.
#[derive(Clone, Debug, Default)]
pub struct Navigation {
    pub(super) positions: Vec<Position>,
    pub(super) inertial: Vec<Inertial>,
    pub(super) sources: Vec<Source>,
    /// Standard deviation of what states none, from how far it is off the echoes, metres.
    pub(super) stated_m: Option<f64>,
}

/// How far positions are off a track, as the median has it: of Gaussian errors alike along both axes of the plane, the square of the distance is distributed exponentially,
/// whose median is `ln 2` of its mean. Some places that are far off change nothing; a mean of all would be theirs.
#[derive(Clone, Copy)]
pub(super) struct Off {
    /// RMS distance in the plane, metres.
    pub(super) rms_m: f64,
    /// Mean square over what is stated, of an axis in the plane.
    pub(super) square: f64,
}

impl About {
    /// What a recording says of itself: by GPS when its time 0 was, unless that was before GPS. None of one without pulses.
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
    /// Of logs, each with its name: positions of the first that has such, inertial moments of the first that has attitudes.
    ///
    /// # Errors
    /// [`NoNavigation`].
    pub fn of_logs(logs: &[(String, Log)], about: &About) -> Result<Self, NoNavigation> {
        let mut all = Self::default();
        for (name, log) in logs {
            all.add(name, log, about)?;
        }
        Ok(all)
    }

    fn add(&mut self, name: &str, log: &Log, about: &About) -> Result<(), NoNavigation> {
        let start = start(name, log, about)?;
        let before = self.sources.len();
        // Axes of a log's own are taken for the scene's, as those of tracks are.
        let local = |record: &Record| matches!(record.place, Some(Place::Local(_)));
        let frame = match log.records.iter().any(local) {
            true => SceneFrame::Local,
            false => about.frame,
        };
        let (mut placed, mut twice, mut elsewhen) = (false, false, None);
        for one in log.coverage() {
            let [places, _, attitudes] = one.with;
            if places == 0 || matches!(one.kind, Kind::Markpos | Kind::Marktime) {
                continue;
            }
            // NMEA's headings come without what makes a solution of them.
            let is_inertial = attitudes > 0 && one.kind != Kind::Nmea;
            let taken = match is_inertial {
                true => !self.inertial.is_empty(),
                false => !self.positions.is_empty(),
            };
            if taken {
                twice = true;
                continue;
            }
            let named = format!("{name}, {}", one.kind.name());
            let unstated = DefaultSigmas::default();
            let [first_s, last_s] = [one.from, one.to].map(|time| time.since(start));
            let (of, used) = if is_inertial {
                let all = inertial(log, one.kind, &frame, start, &unstated);
                placed |= !all.is_empty();
                let (of, some) = thinned(all, about, |one| one.time_s);
                self.inertial = some;
                (of, self.inertial.len())
            } else {
                let all = positions(log, one.kind, &frame, start, &unstated);
                placed |= !all.is_empty();
                let (of, some) = thinned(all, about, |one| one.time_s);
                self.positions = some;
                (of, self.positions.len())
            };
            match used {
                0 => elsewhen = Some([first_s, last_s]),
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
        Err(match elsewhen {
            Some(_) if !placed => NoNavigation::Frame { name },
            Some([from_s, to_s]) => {
                let [first, last] = about.span_s.map(|s| s.round() as i64);
                let [from, to] = [from_s, to_s].map(|s| s.round() as i64);
                NoNavigation::Elsewhen {
                    name,
                    from,
                    to,
                    first,
                    last,
                }
            }
            None if twice => NoNavigation::Twice { name },
            None => NoNavigation::Nowhere { name },
        })
    }

    /// The track that the recording carries, as far as its shape is off that of the echoes: as positions with independent errors of that size, as far apart as errors last.
    pub fn of_recording(found: &Recovered) -> Self {
        let moments = &found.moments;
        let off = |moment: &Moment| (moment.recorded_m - moment.position_m).truncate();
        let errors: Vec<DVec2> = moments.iter().map(off).collect();
        let count = errors.len().max(1) as f64;
        let mean_square = errors.iter().map(|e| e.length_squared()).sum::<f64>() / (2.0 * count);
        let lasting = lasting(&errors, mean_square);
        let mut own: Vec<f64> = moments.iter().map(Moment::spread_m).collect();
        own.sort_by(f64::total_cmp);
        let own_m = own.get(own.len() / 2).copied().unwrap_or(0.0);
        // Turn and shift, by which the echoes were laid upon these, took three numbers of them.
        let independent = 2.0 * count / lasting as f64;
        let lost = (independent / (independent - 3.0).max(1.0)).sqrt();
        let sigma_m = (mean_square.sqrt() * lost).max(own_m).max(MIN_SIGMA_M);
        let every = lasting.max(moments.len().div_ceil(MOST));
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
            inertial: Vec::new(),
            sources: vec![source],
            stated_m: Some(sigma_m),
        }
    }

    /// The track that it tells by itself: of positions, or else of the inertial solution.
    ///
    /// `attitude` is the body's in the recording's first pulse. From there it turns as inertial moments with headings do, however their sensor is turned on it; without such it does not.
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

    /// With standard deviations so many times as large.
    pub(super) fn widened(&self, times: f64) -> Self {
        let mut wide = self.clone();
        for one in &mut wide.positions {
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

    /// How far positions are off a track; none without positions.
    pub(super) fn off(&self, track: &Fused, arm_m: DVec3) -> Option<Off> {
        let (mut squares_m2, mut squares) = (Vec::new(), Vec::new());
        let mut samples = track.samples.iter().peekable();
        for one in &self.positions {
            // The last at or before it: the next is a pulse or a measurement away.
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

    /// From the inertial x axis to the radar's, as the two headings have it on average.
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

/// The attitude nearest to a time, of some in the order of time.
fn nearest(all: &[(f64, DQuat)], time_s: f64) -> Option<DQuat> {
    let after = all.partition_point(|one| one.0 < time_s);
    let around = [after.checked_sub(1), Some(after)].into_iter().flatten();
    let near = around.filter_map(|n| all.get(n));
    let away = |one: &(f64, DQuat)| (one.0 - time_s).abs();
    let nearest = near.min_by(|a, b| away(a).total_cmp(&away(b)));
    nearest.map(|&(_, attitude)| attitude)
}

/// When the recording's time 0 was, by a log's clock.
fn start(name: &str, log: &Log, about: &About) -> Result<GpsTime, NoNavigation> {
    let clock = match log.account.clock {
        // Its own is taken for the recording's.
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
    start.ok_or_else(|| NoNavigation::Start {
        name: name.to_owned(),
        clock,
    })
}

/// Those within the recording's time, and how many they were: of too many every so many.
fn thinned<T>(all: Vec<T>, about: &About, time_s: impl Fn(&T) -> f64) -> (usize, Vec<T>) {
    let [from_s, to_s] = [about.span_s[0] - BESIDE_S, about.span_s[1] + BESIDE_S];
    let mut some: Vec<T> = all
        .into_iter()
        .filter(|one| (from_s..=to_s).contains(&time_s(one)))
        .collect();
    let of = some.len();
    if of > MOST {
        some = some.into_iter().step_by(of.div_ceil(MOST)).collect();
    }
    (of, some)
}

/// The mean of what is distributed exponentially, by its median; none of none.
fn mean_by_median(mut squares: Vec<f64>) -> Option<f64> {
    squares.sort_by(f64::total_cmp);
    let upper = squares.len() / 2;
    let lower = squares.len().checked_sub(1)? / 2;
    Some(0.5 * (squares[lower] + squares[upper]) / std::f64::consts::LN_2)
}

/// Over how many of them errors stay alike: 1 and twice the sum of their correlations, up to the first that is none.
fn lasting(errors: &[DVec2], mean_square: f64) -> usize {
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
    fn a_log_without_places_says_so() {
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
        assert_eq!(error, NoNavigation::Nowhere { name });
    }

    /// A car that drives along y and turns left by 30 degrees, with an array across it that looks back: by hand.
    #[test]
    fn a_body_turns_as_the_inertial_sensor_that_is_fixed_on_it() {
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
        // A receiver's positions beside it are of the same body.
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
    fn some_that_are_far_off_do_not_move_the_mean() {
        // Quantiles of the exponential distribution whose mean is 2.
        let mut squares: Vec<f64> = (0..101)
            .map(|n| -2.0 * libm::log1p(-(f64::from(n) + 0.5) / 101.0))
            .collect();
        assert!((mean_by_median(squares.clone()).unwrap() - 2.0).abs() < 1e-12);
        // Five in a hundred far off: the median is that of the 53rd of 101, -2 ln(1 - 52.5 / 101) / ln 2.
        squares[..5].fill(1e9);
        let moved = -2.0 * libm::log1p(-55.5 / 101.0) / std::f64::consts::LN_2;
        let found = mean_by_median(squares).unwrap();
        assert!((found - moved).abs() < 1e-12, "{found}, {moved}");
        assert_eq!(mean_by_median(Vec::new()), None);
    }
}
