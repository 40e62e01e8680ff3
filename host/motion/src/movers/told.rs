//! Which targets move: stretch by stretch, and by all of them together.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::change::{Change, USUAL, group, motion};
use crate::check::{self, MotionError};
use crate::model::{Array, Sighting};
use crate::series::Series;

/// Squared error that one in a hundred million that stand still exceeds.
const NEVER: f64 = 40.0;
/// Pulses of a stretch, at the least.
pub(crate) const LEAST_STRETCH: usize = 8;
/// Standard deviations of a sum of errors that are too many for chance.
const STEADY: f64 = 6.0;

/// Why it is not told which targets move.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Doubt {
    /// There are not three.
    #[error(
        "{targets} targets are seen from pulse {first} to {last}: of less than three it cannot be told which move"
    )]
    Few {
        /// Seen in all these pulses.
        targets: usize,
        /// The first pulse.
        first: usize,
        /// And the last.
        last: usize,
    },
    /// No three of them agree.
    #[error(
        "no three of {targets} targets agree with one motion of the radar from pulse {first} to {last}: all but two of them move, or all do. Their ranges, directions and radial speeds can be trusted, the radar's motion cannot"
    )]
    Disagree {
        /// Seen in all these pulses.
        targets: usize,
        /// The first pulse.
        first: usize,
        /// And the last.
        last: usize,
    },
    /// Two groups are as large.
    #[error(
        "from pulse {first} to {last} targets {some:?} agree with one motion of the radar and {others:?} with another: which of them move is not told"
    )]
    Divided {
        /// One group.
        some: Vec<usize>,
        /// The other.
        others: Vec<usize>,
        /// The first pulse.
        first: usize,
        /// And the last.
        last: usize,
    },
}

/// Which targets move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sorted {
    /// Those that agreed with the radar's motion throughout.
    pub standing: Vec<usize>,
    /// Those that did not, at one time or another.
    pub moving: Vec<usize>,
    /// Those that no stretch tells of.
    pub unknown: Vec<usize>,
    /// Stretches that do not tell.
    pub doubts: Vec<Doubt>,
}

/// What stretches tell of a target.
#[derive(Clone, Copy, Default)]
pub(crate) struct Told {
    /// Of its errors in standard deviations.
    sums: [f64; 2],
    /// The largest of its squared errors.
    largest: f64,
    stretches: usize,
    /// In how many it was off.
    off: usize,
}

impl Told {
    pub(crate) fn add(&mut self, change: &Change, motion: DVec3) {
        let errors = change.errors(motion);
        (0..2).for_each(|i| self.sums[i] += errors[i]);
        let square = change.square(motion);
        self.largest = self.largest.max(square);
        self.stretches += 1;
        self.off += usize::from(square >= USUAL);
    }

    /// Off once by what never happens, or more often than happens, or always to one side.
    pub(crate) fn moves(&self) -> bool {
        let limit = STEADY * libm::sqrt(self.stretches as f64);
        let steady = self.sums.iter().any(|sum| sum.abs() > limit);
        self.largest > NEVER || self.off > 1 + self.stretches / 50 || steady
    }
}

/// What a stretch of pulses, the first of which has this number, says of the targets that are seen in all of it, and the radar's motion and turn through it.
pub(crate) fn stretch(
    array: &Array,
    pulses: &[Vec<Sighting>],
    first: usize,
) -> (Vec<Change>, Result<DVec3, Doubt>) {
    let series = Series::all(array, pulses);
    let whole = series
        .iter()
        .filter(|series| series.looks.len() == pulses.len());
    let changes: Vec<Change> = whole.map(|series| Change::new(array, series)).collect();
    let by = agreement(&changes, [first, first + pulses.len() - 1]);
    (changes, by)
}

/// Which targets move, stretch by stretch of so many pulses, 8 at the least.
///
/// # Errors
/// [`MotionError`], and the pulse's number.
pub fn sort(
    array: &Array,
    pulses: &[Vec<Sighting>],
    stretch: usize,
) -> Result<Sorted, (usize, MotionError)> {
    check::array(array).map_err(|error| (0, error))?;
    for (n, pulse) in pulses.iter().enumerate() {
        check::sightings(array, pulse).map_err(|error| (n, error))?;
    }
    let stretch = stretch.max(LEAST_STRETCH);
    let mut sorted = Sorted::default();
    let mut told: BTreeMap<usize, Told> = BTreeMap::new();
    let mut all = Vec::new();
    for (i, some) in pulses.chunks(stretch).enumerate() {
        if some.len() < LEAST_STRETCH {
            continue;
        }
        let (changes, by) = self::stretch(array, some, i * stretch);
        match by {
            Err(doubt) => sorted.doubts.push(doubt),
            Ok(motion) => changes
                .iter()
                .for_each(|change| told.entry(change.name).or_default().add(change, motion)),
        }
        all.push(changes);
    }
    for (name, told) in told {
        match told.moves() {
            true => sorted.moving.push(name),
            false => sorted.standing.push(name),
        }
    }
    // Three that agree in some stretches may do so by chance: those that stand still agree in all.
    let fail = |changes: &&Vec<Change>| {
        let stands = |change: &&Change| sorted.standing.contains(&change.name);
        let some = changes.iter().filter(stands);
        let motion = motion(some.clone());
        let fits = |motion| some.clone().all(|change| change.square(motion) < NEVER);
        some.clone().count() >= 3 && !motion.is_some_and(fits)
    };
    let failed = all.iter().filter(fail).count();
    if sorted.standing.len() < 3 || failed > 1 + all.len() / 50 {
        sorted.standing.clear();
        sorted.moving.clear();
    }
    let seen: BTreeSet<usize> = pulses.iter().flatten().map(|s| s.target).collect();
    let is_told = |name: &usize| sorted.standing.contains(name) || sorted.moving.contains(name);
    sorted.unknown = seen.into_iter().filter(|name| !is_told(name)).collect();
    Ok(sorted)
}

/// The motion with which most agree.
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
