//! Classification of targets as standing or moving, by single segments of pulses and by all of them.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::change::{Change, STANDING_LIMIT, group, motion};
use crate::check::{self, MotionError};
use crate::model::{Array, Sighting};
use crate::series::Series;

/// Squared residual that a standing target exceeds with a probability of 1e-8.
const MOVING_LIMIT: f64 = 40.0;
/// Least number of pulses of a segment.
pub(crate) const MIN_SEGMENT: usize = 8;
/// Standard deviations of a sum of residuals that exclude chance.
const STEADY_SIGMAS: f64 = 6.0;

/// Reason why moving targets cannot be separated from standing ones.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// Fewer than three targets.
    #[error(
        "{targets} targets from pulse {first} to {last}: at least three are needed to separate moving targets from standing ones"
    )]
    Few {
        /// Number of targets in these pulses.
        targets: usize,
        /// Number of the first pulse of the segment.
        first: usize,
        /// Number of the last pulse of the segment.
        last: usize,
    },
    /// No three targets agree with one motion.
    #[error(
        "no three of {targets} targets agree with one motion of the radar from pulse {first} to {last}: at most two stand still. Ranges, directions and radial speeds are reliable, the radar's motion is not"
    )]
    Disagree {
        /// Number of targets in these pulses.
        targets: usize,
        /// Number of the first pulse of the segment.
        first: usize,
        /// Number of the last pulse of the segment.
        last: usize,
    },
    /// Two groups of equal size.
    #[error(
        "ambiguous from pulse {first} to {last}: targets {some:?} agree with one motion of the radar, as many targets {others:?} with another, and either group may stand still"
    )]
    Divided {
        /// Numbers of the targets in one group.
        some: Vec<usize>,
        /// Numbers of the targets in the other group.
        others: Vec<usize>,
        /// Number of the first pulse of the segment.
        first: usize,
        /// Number of the last pulse of the segment.
        last: usize,
    },
}

/// Classification of all targets as standing or moving.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Classification {
    /// Targets that agree with the radar's motion in all segments.
    pub standing: Vec<usize>,
    /// Targets that disagree in some segment.
    pub moving: Vec<usize>,
    /// Targets that no segment classifies.
    pub unknown: Vec<usize>,
    /// Segments without a classification.
    pub doubts: Vec<Doubt>,
}

/// Residuals of a target over segments.
#[derive(Clone, Copy, Default)]
pub(crate) struct Record {
    /// Sums of its residuals in standard deviations.
    sums: [f64; 2],
    /// Largest squared residual in one segment.
    largest: f64,
    segments: usize,
    /// Number of segments in which it is an outlier.
    off: usize,
}

impl Record {
    pub(crate) fn add(&mut self, change: &Change, motion: DVec3) {
        let errors = change.errors(motion);
        (0..2).for_each(|i| self.sums[i] += errors[i]);
        let square = change.square(motion);
        self.largest = self.largest.max(square);
        self.segments += 1;
        self.off += usize::from(square >= STANDING_LIMIT);
    }

    /// An impossible residual once, more outliers than by chance, or residuals of constant sign.
    pub(crate) fn moves(&self) -> bool {
        let limit = STEADY_SIGMAS * libm::sqrt(self.segments as f64);
        let steady = self.sums.iter().any(|sum| sum.abs() > limit);
        self.largest > MOVING_LIMIT || self.off > 1 + self.segments / 50 || steady
    }
}

/// Changes of the targets over a segment whose first pulse has this number, and the radar's motion and turn through it.
pub(crate) fn segment_changes(
    array: &Array,
    pulses: &[Vec<Sighting>],
    first: usize,
) -> (Vec<Change>, Result<DVec3, Doubt>) {
    let series = Series::all(array, pulses);
    let changes: Vec<Change> = common(&series, pulses.len())
        .iter()
        .map(|series| Change::new(array, series))
        .collect();
    let by = agreement(&changes, [first, first + pulses.len() - 1]);
    (changes, by)
}

/// Targets that are seen at two pulses, one in the first quarter of the segment and one in the last, and in half of the pulses between; their series are cut to these. Of all such pairs of pulses the one with most
/// targets is taken, and of those the one farthest apart. Phases are unwrapped between the two, so that all targets are compared over the same motion of the radar even if noise hides some echoes.
fn common<'a>(series: &[Series<'a>], count: usize) -> Vec<Series<'a>> {
    let quarter = count / 4;
    let is_seen = |one: &Series, pulse: usize| {
        let found = one.looks.binary_search_by_key(&pulse, |look| look.pulse);
        found.is_ok()
    };
    let cut = |one: &Series<'a>, [a, b]: [usize; 2]| {
        let from = one.looks.partition_point(|look| look.pulse < a);
        let to = one.looks.partition_point(|look| look.pulse <= b);
        from..to
    };
    let is_common = |one: &Series<'a>, ends: [usize; 2]| {
        let seen = ends.iter().all(|&end| is_seen(one, end));
        seen && 2 * cut(one, ends).len() > ends[1] - ends[0]
    };
    let firsts = 0..=quarter;
    let pairs = firsts.flat_map(|a| (count - 1 - quarter..count).map(move |b| [a, b]));
    let targets = |ends: &[usize; 2]| series.iter().filter(|one| is_common(one, *ends)).count();
    let best = pairs.max_by_key(|ends| (targets(ends), ends[1] - ends[0]));
    let Some(ends) = best else { return Vec::new() };
    let some = series.iter().filter(|one| is_common(one, ends));
    some.map(|one| Series {
        name: one.name,
        looks: one.looks[cut(one, ends)].to_vec(),
    })
    .collect()
}

/// Classify targets by segments of `segment_length` pulses, at least 8.
///
/// # Errors
/// [`MotionError`], and the pulse's number.
pub fn classify(
    array: &Array,
    pulses: &[Vec<Sighting>],
    segment_length: usize,
) -> Result<Classification, (usize, MotionError)> {
    check::array(array).map_err(|error| (0, error))?;
    for (n, pulse) in pulses.iter().enumerate() {
        check::sightings(array, pulse).map_err(|error| (n, error))?;
    }
    let segment_length = segment_length.max(MIN_SEGMENT);
    let mut classes = Classification::default();
    let mut records: BTreeMap<usize, Record> = BTreeMap::new();
    let mut all = Vec::new();
    for (i, some) in pulses.chunks(segment_length).enumerate() {
        if some.len() < MIN_SEGMENT {
            continue;
        }
        let (changes, by) = segment_changes(array, some, i * segment_length);
        match by {
            Err(doubt) => classes.doubts.push(doubt),
            Ok(motion) => changes
                .iter()
                .for_each(|change| records.entry(change.name).or_default().add(change, motion)),
        }
        all.push(changes);
    }
    for (name, record) in records {
        match record.moves() {
            true => classes.moving.push(name),
            false => classes.standing.push(name),
        }
    }
    // Three targets may agree by chance in some segments; standing ones agree in all.
    let fail = |changes: &&Vec<Change>| {
        let stands = |change: &&Change| classes.standing.contains(&change.name);
        let some = changes.iter().filter(stands);
        let motion = motion(some.clone());
        let fits = |motion| {
            some.clone()
                .all(|change| change.square(motion) < MOVING_LIMIT)
        };
        some.clone().count() >= 3 && !motion.is_some_and(fits)
    };
    let failed = all.iter().filter(fail).count();
    if classes.standing.len() < 3 || failed > 1 + all.len() / 50 {
        classes.standing.clear();
        classes.moving.clear();
    }
    let seen: BTreeSet<usize> = pulses.iter().flatten().map(|s| s.target).collect();
    let is_known = |name: &usize| classes.standing.contains(name) || classes.moving.contains(name);
    classes.unknown = seen.into_iter().filter(|name| !is_known(name)).collect();
    Ok(classes)
}

/// Motion of the largest group.
fn agreement(changes: &[Change], [first, last]: [usize; 2]) -> Result<DVec3, Doubt> {
    let targets = changes.len();
    if targets < 3 {
        return Err(Doubt::Few {
            targets,
            first,
            last,
        });
    }
    let all: Vec<&Change> = changes.iter().collect();
    let (most, by) = group(&all).ok_or(Doubt::Disagree {
        targets,
        first,
        last,
    })?;
    let rest: Vec<usize> = (0..targets).filter(|c| !most.contains(c)).collect();
    let others: Vec<&Change> = rest.iter().map(|&c| &changes[c]).collect();
    match group(&others) {
        Some((second, _)) if second.len() >= most.len() => Err(Doubt::Divided {
            some: most.iter().map(|&c| changes[c].name).collect(),
            others: second.iter().map(|&c| others[c].name).collect(),
            first,
            last,
        }),
        _ => Ok(by),
    }
}
