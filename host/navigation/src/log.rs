//! A whole log: its records, what they cover, and the track through them.

use std::io::BufRead;
use std::path::Path;

use glam::DVec3;

use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{Fix, TrackError};

use crate::read::{each, each_from};
use crate::{Account, GpsTime, Kind, NavigationError, Options, Place, Record};

/// Intervals of this many times the usual one are a gap.
const GAP: f64 = 1.5;

/// Pairs of records of which it is seen whether velocities fit positions.
const PAIRS: usize = 1000;

/// A log, read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// In the file's order; those of a kind ascend in time.
    pub records: Vec<Record>,
    /// What was read and what was not.
    pub account: Account,
}

/// A time without records of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The last record before.
    pub from: GpsTime,
    /// The first after.
    pub to: GpsTime,
    /// How many would have been between.
    pub missing: u64,
}

/// What a log holds of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Which.
    pub kind: Kind,
    /// How many.
    pub records: usize,
    /// How many have a place, a velocity and an attitude.
    pub with: [usize; 3],
    /// The first.
    pub from: GpsTime,
    /// The last.
    pub to: GpsTime,
    /// Seconds from one to the next, the median; 0 of one alone.
    pub interval_s: f64,
    /// Where more than half of an interval is missing; none of events.
    pub gaps: Vec<Gap>,
}

impl Log {
    /// Reads a file of any format.
    ///
    /// # Errors
    /// [`NavigationError`]: damage is none, as long as something is left; it is in the account.
    pub fn read(path: &Path, options: &Options) -> Result<Self, NavigationError> {
        let mut records = Vec::new();
        let account = each(path, options, |record| records.push(record))?;
        Ok(Self::new(records, account))
    }

    /// [`Log::read`] of a stream; `path` is for errors.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn read_from(
        stream: impl BufRead,
        path: &Path,
        options: &Options,
    ) -> Result<Self, NavigationError> {
        let mut records = Vec::new();
        let account = each_from(stream, path, options, |record| records.push(record))?;
        Ok(Self::new(records, account))
    }

    fn new(records: Vec<Record>, account: Account) -> Self {
        let mut log = Self { records, account };
        for kind in Kind::ALL {
            if let Some(what) = log.misfit(kind) {
                log.account.note(&what);
            }
        }
        log
    }

    /// Records of a kind.
    pub fn of(&self, kind: Kind) -> impl Iterator<Item = &Record> {
        self.records
            .iter()
            .filter(move |record| record.kind == kind)
    }

    /// Kinds that there are, the one with the most of positions and attitudes first.
    pub fn coverage(&self) -> Vec<Coverage> {
        let mut all: Vec<Coverage> = Kind::ALL
            .into_iter()
            .filter_map(|kind| self.coverage_of(kind))
            .collect();
        all.sort_by_key(|coverage| {
            let [places, _, attitudes] = coverage.with;
            std::cmp::Reverse((places.min(attitudes), places))
        });
        all
    }

    fn coverage_of(&self, kind: Kind) -> Option<Coverage> {
        let first = self.of(kind).next()?;
        let last = self.of(kind).last()?;
        let pairs = || self.of(kind).zip(self.of(kind).skip(1));
        let mut intervals: Vec<f64> = pairs().map(|(a, b)| b.time.since(a.time)).collect();
        intervals.sort_by(f64::total_cmp);
        let interval_s = intervals.get(intervals.len() / 2).copied().unwrap_or(0.0);
        let event = matches!(kind, Kind::Markpos | Kind::Marktime);
        let gap = |(a, b): (&Record, &Record)| {
            let intervals = b.time.since(a.time) / interval_s;
            (!event && intervals > GAP).then(|| Gap {
                from: a.time,
                to: b.time,
                missing: (intervals.round() as u64).saturating_sub(1),
            })
        };
        let how_many = |has: fn(&Record) -> bool| self.of(kind).filter(|r| has(r)).count();
        Some(Coverage {
            kind,
            records: self.of(kind).count(),
            with: [
                how_many(|r| r.place.is_some()),
                how_many(|r| r.velocity_m_s.is_some()),
                how_many(|r| r.attitude.is_some()),
            ],
            from: first.time,
            to: last.time,
            interval_s,
            gaps: pairs().filter_map(gap).collect(),
        })
    }

    /// Axes along east, north and up at the first place on the Earth; the log's own where its places are in such.
    pub fn frame(&self) -> Option<SceneFrame> {
        let place = self.records.iter().find_map(|record| record.place)?;
        Some(match place {
            Place::Local(_) => SceneFrame::Local,
            Place::Earth(place) => {
                let [east, north, _] = place.east_north_up();
                SceneFrame::Earth {
                    origin_ecf_m: place.to_ecf_m(),
                    x_axis_ecf: east,
                    y_axis_ecf: north,
                }
            }
        })
    }

    /// The records of one kind as fixes, times counted from `start`.
    ///
    /// Attitudes are kept where all have one.
    ///
    /// # Errors
    /// [`TrackError`] if there is no record of this kind with a place, or its places are on the Earth and the frame is a local one, or the other
    /// way around.
    pub fn fixes(
        &self,
        kind: Kind,
        frame: &SceneFrame,
        start: GpsTime,
    ) -> Result<Vec<Fix>, TrackError> {
        let placed = || self.of(kind).filter(|record| record.place.is_some());
        let mut fixes: Vec<Fix> = placed().filter_map(|r| r.fix(frame, start)).collect();
        if fixes.is_empty() {
            return Err(TrackError(match (placed().next(), frame) {
                (None, _) => format!(
                    "the log has no {} record with a place among {}",
                    kind.name(),
                    self.records.len()
                ),
                (Some(_), SceneFrame::Local) => {
                    "the log has places on the Earth, but the scene's frame is a local one; give the scene's origin by latitude, \
                     longitude and height"
                        .to_owned()
                }
                (Some(_), SceneFrame::Earth { .. }) => {
                    "the log has places in axes of its own, but the scene's frame is on the Earth".to_owned()
                }
            }));
        }
        if fixes.iter().any(|fix| fix.attitude.is_none()) {
            for fix in &mut fixes {
                fix.attitude = None;
            }
        }
        Ok(fixes)
    }

    /// Whether velocities of a kind are other than its positions move, in words.
    fn misfit(&self, kind: Kind) -> Option<String> {
        let frame = self.frame()?;
        let moving = |record: &&Record| record.place.is_some() && record.velocity_m_s.is_some();
        let count = self.of(kind).filter(moving).count();
        let step = (count / PAIRS).max(1);
        let pairs = self
            .of(kind)
            .filter(moving)
            .zip(self.of(kind).filter(moving).skip(1));
        let mut apart = Vec::new();
        let mut speeds = Vec::new();
        for (a, b) in pairs.step_by(step) {
            let seconds = b.time.since(a.time);
            if !(1e-4..=2.0).contains(&seconds) {
                continue;
            }
            let moved = b.place?.in_frame(&frame)? - a.place?.in_frame(&frame)?;
            let mean = (a.velocity_m_s? + b.velocity_m_s?) / 2.0;
            let expected = a.to_scene(&frame)? * mean;
            // NMEA has no velocity upwards.
            let level = DVec3::new(1.0, 1.0, 0.0);
            apart.push(((moved / seconds - expected) * level).length());
            speeds.push(expected.length());
        }
        apart.sort_by(f64::total_cmp);
        speeds.sort_by(f64::total_cmp);
        let (apart, speed) = (*apart.get(apart.len() / 2)?, *speeds.get(speeds.len() / 2)?);
        (apart > 0.2 + 0.3 * speed).then(|| {
            format!(
                "velocities of {} do not fit its positions: they are {apart:.2} m/s from how those move, at {speed:.2} m/s \
                 (medians)",
                kind.name()
            )
        })
    }
}
