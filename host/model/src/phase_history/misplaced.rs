//! Exclusion of pulses whose recorded positions no vehicle can have had.
//!
//! A single zero position (a navigation gap) would extend the aperture by thousands of kilometres and spoil default
//! grid, plans and weights. [`strays`] defines such positions. On the Earth, positions less than [`DEEPEST_M`] from
//! its centre count as well. Their pulses are left out, and [`PhaseHistory::warnings`] names them.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::{Beam, Collection, NoBeam, PhaseHistory, Pulse, ReadError};
use crate::antenna::MountedAntennas;
use crate::geometry::SceneFrame;
use crate::track::{joined, strays};

/// Minimum distance of an antenna from the centre of the Earth, metres: 6 km below the ellipsoid at the poles.
const DEEPEST_M: f64 = 6.35e6;

/// Step up to which no position jumps, metres, and the part of the range to the reference point that is one, whichever is less.
const FLOOR_M: f64 = 1.0;
const FLOOR: f64 = 0.05;

/// Maximum number of blocks of pulses named individually in a warning.
const NAMED: usize = 8;

/// Number of pulses examined together, so that the statistics of the track are local and memory is bounded.
const TOGETHER: usize = 8192;

/// Pulses of a collection with positions that no vehicle can have had, as ascending ranges.
pub fn misplaced(collection: &Collection) -> Vec<Range<usize>> {
    let count = collection.pulses.len();
    let mut found = Vec::new();
    for antenna in [
        |pulse: &Pulse| pulse.transmitter_m,
        |pulse: &Pulse| pulse.receiver_m,
    ] {
        let mut start = 0;
        loop {
            let part = start..count.min(start + TOGETHER);
            let end = part.end;
            let pulses = &collection.pulses[part];
            let runs = jumping(pulses, collection.timed, antenna);
            found.extend(
                runs.into_iter()
                    .map(|run| start + run.start..start + run.end),
            );
            if end == count {
                break;
            }
            // Overlap by half, so that no pulse is near the end twice.
            start += TOGETHER / 2;
        }
        found.extend(below_ground(collection, antenna));
    }
    joined(found)
}

fn jumping(pulses: &[Pulse], timed: bool, antenna: fn(&Pulse) -> DVec3) -> Vec<Range<usize>> {
    let mut ranges_m: Vec<f64> = pulses
        .iter()
        .map(|pulse| antenna(pulse).distance(pulse.reference_m))
        .collect();
    ranges_m.sort_by(f64::total_cmp);
    let middle_m = ranges_m.get(ranges_m.len() / 2).copied().unwrap_or(0.0);
    let times_s: Option<Vec<f64>> =
        timed.then(|| pulses.iter().map(|pulse| pulse.time_s).collect());
    let positions_m: Vec<DVec3> = pulses.iter().map(antenna).collect();
    strays(
        times_s.as_deref(),
        &positions_m,
        FLOOR_M.min(FLOOR * middle_m),
    )
}

/// Pulses deep below the ground, unless they are more than half of all: the scene is then somewhere else.
fn below_ground(collection: &Collection, antenna: fn(&Pulse) -> DVec3) -> Vec<Range<usize>> {
    let SceneFrame::Earth { .. } = collection.frame else {
        return Vec::new();
    };
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut many = 0;
    for (n, pulse) in collection.pulses.iter().enumerate() {
        if collection.frame.to_ecf_m(antenna(pulse)).length() >= DEEPEST_M {
            continue;
        }
        many += 1;
        match runs.last_mut() {
            Some(run) if run.end == n => run.end = n + 1,
            _ => runs.push(n..n + 1),
        }
    }
    if 2 * many >= collection.pulses.len() {
        runs.clear();
    }
    runs
}

/// Ranges of numbers as text: "7, 20 to 25".
pub fn named(runs: &[Range<usize>]) -> String {
    let name = |run: &Range<usize>| match run.len() {
        1 => run.start.to_string(),
        _ => format!("{} to {}", run.start, run.end - 1),
    };
    let mut names: Vec<String> = runs.iter().take(NAMED).map(name).collect();
    if runs.len() > NAMED {
        names.push(format!("and {} more", runs.len() - NAMED));
    }
    names.join(", ")
}

/// Warning about the pulses left out.
fn warning(collection: &Collection, left_out: &[Range<usize>]) -> String {
    let count: usize = left_out.iter().map(Range::len).sum();
    let first = left_out.first().map_or(0, |run| run.start);
    let pulse = &collection.pulses[first];
    let at = |place: DVec3| format!("{:.0}, {:.0}, {:.0} m", place.x, place.y, place.z);
    format!(
        "{}: pulse{} {} of {} left out: no vehicle can be at the positions recorded for {} (transmitter at {}, receiver at {} of the scene frame \
         in pulse {first})",
        collection.name,
        if count == 1 { "" } else { "s" },
        named(left_out),
        collection.pulses.len(),
        if count == 1 { "it" } else { "them" },
        at(pulse.transmitter_m),
        at(pulse.receiver_m),
    )
}

/// Phase history without some of its pulses.
pub struct Excluding {
    history: Box<dyn PhaseHistory>,
    collection: Collection,
    /// Index in the original history of each pulse.
    kept: Vec<usize>,
    true_antennas: Option<Vec<[DVec3; 2]>>,
    warning: String,
}

impl Excluding {
    /// Leave out the [`misplaced`] pulses of `history`. Returns it unchanged without such pulses.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if no pulse remains.
    pub fn misplaced(history: Box<dyn PhaseHistory>) -> Result<Box<dyn PhaseHistory>, ReadError> {
        let left_out = misplaced(history.collection());
        Self::pulses(history, &left_out)
    }

    /// Leave out these pulses of `history`; the warning states that no vehicle can have had their positions.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if no pulse remains.
    pub(crate) fn pulses(
        history: Box<dyn PhaseHistory>,
        left_out: &[Range<usize>],
    ) -> Result<Box<dyn PhaseHistory>, ReadError> {
        if left_out.is_empty() {
            return Ok(history);
        }
        let whole = history.collection();
        let warning = warning(whole, left_out);
        let out = |n: &usize| left_out.iter().any(|run| run.contains(n));
        let kept: Vec<usize> = (0..whole.pulses.len()).filter(|n| !out(n)).collect();
        if kept.is_empty() {
            return Err(ReadError::Mismatch(format!("{warning}; no pulse remains")));
        }
        let collection = Collection {
            name: whole.name.clone(),
            pulses: kept.iter().map(|&n| whole.pulses[n]).collect(),
            ..*whole
        };
        let truth = history.true_antennas();
        let true_antennas = truth.map(|truth| kept.iter().map(|&n| truth[n]).collect());
        Ok(Box::new(Self {
            collection,
            true_antennas,
            warning,
            kept,
            history,
        }))
    }
}

impl PhaseHistory for Excluding {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(&*self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.collection.num_samples;
        assert_eq!(samples.len(), pulses.len() * width);
        let kept = &self.kept[pulses];
        let mut done = 0;
        while done < kept.len() {
            let first = kept[done];
            let rest = &kept[done..];
            let count = rest
                .iter()
                .zip(first..)
                .take_while(|(a, b)| **a == *b)
                .count();
            let part = &mut samples[done * width..(done + count) * width];
            self.history.read(first..first + count, part)?;
            done += count;
        }
        Ok(())
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        let kept = &self.kept[pulses];
        match (kept.first(), kept.last()) {
            (Some(&first), Some(&last)) if last - first + 1 == kept.len() => {
                self.history.samples_in_memory(first..last + 1)
            }
            (None, _) => self.history.samples_in_memory(0..0),
            _ => None,
        }
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.true_antennas.as_deref()
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        let mut mounted = self.history.antennas()?;
        let attitude = |&n: &usize| mounted.attitudes.get(n).copied();
        mounted.attitudes = self.kept.iter().map(attitude).collect::<Option<_>>()?;
        Some(mounted)
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }

    fn warnings(&self) -> Vec<String> {
        let mut warnings = self.history.warnings();
        warnings.push(self.warning.clone());
        warnings
    }

    fn held_bytes(&self) -> u64 {
        let truth = self.true_antennas.as_deref().map_or(0, size_of_val);
        self.history.held_bytes()
            + (size_of_val(self.collection.pulses.as_slice())
                + size_of_val(self.kept.as_slice())
                + truth) as u64
    }
}
