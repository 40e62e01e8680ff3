//! Log in memory: records, coverage, and tracks.

use std::io::BufRead;
use std::path::Path;

use glam::DVec3;

use subaperture_model::geometry::SceneFrame;
use subaperture_model::track::{Fix, TrackError, strays};

use crate::read::{each, each_from};
use crate::{GpsTime, Kind, NavigationError, Options, Place, ReadReport, Record};

/// Intervals of this multiple of the usual one are a gap.
const GAP: f64 = 1.5;

/// Largest count of missing records: whole numbers of float64 end there.
const MAX_MISSING: f64 = 9e15;

/// Largest position step that is not a jump, metres.
const FLOOR_M: f64 = 1.0;

/// Largest number of record pairs on which velocities are compared with positions.
const PAIRS: usize = 1000;

/// Log in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Records in the file's order; those of a kind ascend in time.
    pub records: Vec<Record>,
    /// Account of the file.
    pub account: ReadReport,
}

/// Gap in the records of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Time of the last record before the gap.
    pub from: GpsTime,
    /// Time of the first record after the gap.
    pub to: GpsTime,
    /// Number of missing records at the usual interval.
    pub missing: u64,
}

/// Coverage of a log by one kind of record.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Kind of the records.
    pub kind: Kind,
    /// Number of records of this kind.
    pub records: usize,
    /// Numbers of records with a position, a velocity and an attitude.
    pub with: [usize; 3],
    /// Time of the first record.
    pub from: GpsTime,
    /// Time of the last record.
    pub to: GpsTime,
    /// Median interval, seconds; 0 for one record.
    pub interval_s: f64,
    /// Gaps of more than one and a half intervals; none for events.
    pub gaps: Vec<Gap>,
}

impl Log {
    /// Read a file of any format.
    ///
    /// # Errors
    /// [`NavigationError`]. Damage is no error while a record is left: see the account.
    pub fn read(path: &Path, options: &Options) -> Result<Self, NavigationError> {
        let mut records = Vec::new();
        let account = each(path, options, |record| records.push(record))?;
        Ok(Self::new(records, account))
    }

    /// [`Log::read`] for a stream; `path` is for error messages.
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

    fn new(records: Vec<Record>, account: ReadReport) -> Self {
        let mut log = Self { records, account };
        for kind in Kind::ALL {
            if let Some(text) = log.describe_strays(kind) {
                log.account.doubt(&text);
            }
            if let Some(text) = log.misfit(kind) {
                log.account.doubt(&text);
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

    /// Kinds of the log, most positions and attitudes first.
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
                missing: (intervals.round().min(MAX_MISSING) as u64).saturating_sub(1),
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

    /// Frame along east, north and up at the first position on the Earth; the log's local axes where positions are local.
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

    /// Records of one kind as fixes, with times counted from `start`.
    ///
    /// Attitudes are kept if all records have one. Positions that no vehicle can have ([`strays`]) are left out.
    ///
    /// # Errors
    /// [`TrackError`] if there is no record of this kind with a position, or only one of positions and frame is on the Earth.
    pub fn fixes(
        &self,
        kind: Kind,
        frame: &SceneFrame,
        start: GpsTime,
    ) -> Result<Vec<Fix>, TrackError> {
        let placed = || self.of(kind).filter(|record| record.place.is_some());
        let strays = self.strays(kind);
        let sound = (0..self.records.len()).filter(|n| strays.binary_search(n).is_err());
        let mut fixes: Vec<Fix> = sound
            .map(|n| &self.records[n])
            .filter(|record| record.kind == kind)
            .filter_map(|record| record.fix(frame, start))
            .collect();
        if fixes.is_empty() {
            return Err(TrackError(match (placed().next(), frame) {
                (None, _) => format!(
                    "expected {} records with a position, found none among {} records",
                    kind.name(),
                    self.records.len()
                ),
                (Some(_), SceneFrame::Local) => {
                    "the log has positions on the Earth, but the scene's frame is local: give the scene's origin by latitude, \
                     longitude and height"
                        .to_owned()
                }
                (Some(_), SceneFrame::Earth { .. }) => {
                    "the log has positions in local axes, but the scene's frame is on the Earth: use a log with latitude, longitude and height".to_owned()
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

    /// Indices of the records of a kind at a position that no vehicle can have, ascending.
    fn strays(&self, kind: Kind) -> Vec<usize> {
        let Some(frame) = self.frame() else {
            return Vec::new();
        };
        let placed = |n: &usize| {
            let record = &self.records[*n];
            let place = record.place.filter(|_| record.kind == kind)?;
            Some((*n, record.time, place.in_frame(&frame)?))
        };
        let all: Vec<(usize, GpsTime, DVec3)> =
            (0..self.records.len()).filter_map(|n| placed(&n)).collect();
        let first = all.first().map_or(
            GpsTime {
                week: 0,
                seconds: 0.0,
            },
            |one| one.1,
        );
        let times_s: Vec<f64> = all.iter().map(|(_, time, _)| time.since(first)).collect();
        let positions_m: Vec<DVec3> = all.iter().map(|(.., place)| *place).collect();
        let runs = strays(Some(&times_s), &positions_m, FLOOR_M);
        runs.into_iter().flatten().map(|n| all[n].0).collect()
    }

    /// Description of these records.
    fn describe_strays(&self, kind: Kind) -> Option<String> {
        let strays = self.strays(kind);
        let first = strays.first()?;
        Some(format!(
            "{} of {} positions of {} are impossible for a vehicle, the first at {}: they are left out of the track",
            strays.len(),
            self.of(kind)
                .filter(|record| record.place.is_some())
                .count(),
            kind.name(),
            self.records[*first].time,
        ))
    }

    /// Description of velocities of a kind that contradict its positions, if they do.
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
            // NMEA has no vertical velocity.
            let level = DVec3::new(1.0, 1.0, 0.0);
            apart.push(((moved / seconds - expected) * level).length());
            speeds.push(expected.length());
        }
        apart.sort_by(f64::total_cmp);
        speeds.sort_by(f64::total_cmp);
        let (apart, speed) = (*apart.get(apart.len() / 2)?, *speeds.get(speeds.len() / 2)?);
        (apart > 0.2 + 0.3 * speed).then(|| {
            format!(
                "velocities of {} do not fit its positions: they differ from the change of position by {apart:.2} m/s at a speed of {speed:.2} m/s \
                 (medians)",
                kind.name()
            )
        })
    }
}
