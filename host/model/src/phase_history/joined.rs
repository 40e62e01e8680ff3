//! Several recordings joined into one aperture.
//!
//! **Order.** Slow-time windows, sub-CPIs and straight tracks depend on the order of pulses. It is therefore
//! determined by the aperture, not by the order of files:
//!
//! - by time, if all recordings have times on one clock: relative to their starts ([`PhaseHistory::start_ns`]) if all
//!   state it, otherwise unchanged. Pulses of recordings that overlap in time are interleaved, and pulses of a
//!   recording that are not in order of time are sorted. Times then count from the earliest recording's start;
//! - otherwise recording by recording, by the angle of their antennas around the points that they refer to
//!   (`super::order`), in the direction in which most antennas move, starting at the widest gap. Pulses of each
//!   recording keep their order. Times are then pulse indices.
//!
//! Recordings that are equal in both respects are ordered by their positions, so the order of files changes no bit of
//! an image.
//!
//! **Duplicates.** A pulse that occurs in two recordings (same antennas and band, and same time if known) would count
//! twice and is refused.

use std::cmp::Ordering;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::order::travelled_angles;
use super::{
    Beam, Channel, Collection, Defect, InputFile, NoBeam, PhaseConvention, PhaseHistory, Pulse,
    ReadError,
};
use crate::antenna::MountedAntennas;

/// Several recordings joined into one aperture.
pub struct Joined {
    /// Joined collection. `None` for a single part.
    whole: Option<Whole>,
    parts: Vec<Box<dyn PhaseHistory>>,
}

/// Collection and pulse order of several joined parts.
struct Whole {
    collection: Collection,
    /// True antenna positions, if all parts have them.
    true_antennas: Option<Vec<[DVec3; 2]>>,
    /// Blocks of pulses that are consecutive in a part, in the order of the whole.
    runs: Vec<Run>,
}

/// Consecutive pulses of one part, up to the start of the next block.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Index of its first pulse in the whole.
    start: usize,
    part: usize,
    /// Index of its first pulse in the part.
    first: usize,
}

/// Phase history of one of the joined recordings.
type Part = Box<dyn PhaseHistory>;

/// Pulse: index of its part, and its index in the part.
type Place = [u32; 2];

/// Temporary memory of [`Joined::join`], bytes per pulse.
const SCRATCH_BYTES: usize = 2 * size_of::<Place>() + 2 * size_of::<u64>();

impl Joined {
    /// Wrap a single history; the order of its pulses is kept.
    pub fn alone(history: Box<dyn PhaseHistory>) -> Self {
        Self {
            whole: None,
            parts: vec![history],
        }
    }

    /// Maximum memory of [`Self::join`] per pulse in bytes.
    pub(super) const MAX_BYTES_A_PULSE: u64 =
        (size_of::<Pulse>() + SCRATCH_BYTES + size_of::<[DVec3; 2]>()) as u64;

    /// Whether the pulses of `history` are in time order; true without pulse times.
    pub(super) fn is_in_order(history: &dyn PhaseHistory) -> bool {
        let collection = history.collection();
        let in_order = (collection.pulses).is_sorted_by(|a, b| a.time_s <= b.time_s);
        !collection.timed || in_order
    }

    /// Join `parts` in the order of their pulses. They must have the same number of samples per pulse and the same
    /// scene frame.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if there are no parts, they differ, or two contain the same pulse.
    pub fn join(mut parts: Vec<Box<dyn PhaseHistory>>) -> Result<Self, ReadError> {
        check_alike(&parts)?;
        if !is_to_be_joined(&parts) {
            return Ok(Self { whole: None, parts });
        }
        parts.sort_by(|a, b| by_positions(pulses(a), pulses(b)));
        let clock = clock(&parts);
        check_no_twins(&parts, clock.as_deref())?;
        let order = match &clock {
            Some(offsets) => by_time(&parts, offsets),
            None => by_angle(&parts),
        };
        let whole = Whole::new(&parts, &order, clock.as_deref());
        Ok(Self {
            whole: Some(whole),
            parts,
        })
    }

    /// Peak memory of [`Self::join`] in bytes, for the result and for sorting.
    pub fn joining_bytes(parts: &[Box<dyn PhaseHistory>]) -> u64 {
        if !is_to_be_joined(parts) {
            return 0;
        }
        let each = |part: &Part| {
            let truth = part.true_antennas().map_or(0, |_| size_of::<[DVec3; 2]>());
            pulses(part).len() as u64 * (size_of::<Pulse>() + SCRATCH_BYTES + truth) as u64
        };
        parts.iter().map(each).sum()
    }
}

fn pulses(part: &Part) -> &[Pulse] {
    &part.collection().pulses
}

/// Whether joining changes anything, for several parts or a single unsorted one.
fn is_to_be_joined(parts: &[Part]) -> bool {
    match parts {
        [part] => !Joined::is_in_order(&**part),
        _ => true,
    }
}

/// Name of a part in a message: its collection's name, or its file if `other` has the same name.
fn label(part: &Part, other: &Part) -> String {
    let name = &part.collection().name;
    match part.path() {
        Some(path) if *name == other.collection().name => path.display().to_string(),
        _ => name.clone(),
    }
}

/// Refuse parts with different numbers of samples or scene frames.
fn check_alike(parts: &[Part]) -> Result<(), ReadError> {
    let Some((first, rest)) = parts.split_first() else {
        return Err(ReadError::Mismatch("no input given".to_owned()));
    };
    let collection = first.collection();
    for part in rest {
        let next = part.collection();
        if next.num_samples != collection.num_samples {
            return Err(ReadError::Mismatch(format!(
                "{} has {} samples per pulse, but {} has {}: give files of one radar mode",
                label(first, part),
                collection.num_samples,
                label(part, first),
                next.num_samples
            )));
        }
        if !next.frame.agrees_with(&collection.frame) {
            return Err(ReadError::Mismatch(format!(
                "{} and {} have different scene frames: focus them one at a time",
                label(first, part),
                label(part, first)
            )));
        }
    }
    Ok(())
}

/// Antennas and frequencies of a pulse.
pub(super) fn numbers(pulse: &Pulse) -> [f64; 8] {
    let [t, r] = [pulse.transmitter_m, pulse.receiver_m];
    let (start_hz, step_hz) = (pulse.start_hz, pulse.step_hz);
    [t.x, t.y, t.z, r.x, r.y, r.z, start_hz, step_hz]
}

/// Compare recordings by the antenna positions and frequencies of their pulses.
fn by_positions(a: &[Pulse], b: &[Pulse]) -> Ordering {
    let first_unlike = a.iter().zip(b).find_map(|(a, b)| {
        let pairs = numbers(a).into_iter().zip(numbers(b));
        let mut orders = pairs.map(|(a, b)| a.total_cmp(&b));
        orders.find(|order| order.is_ne())
    });
    first_unlike.unwrap_or_else(|| a.len().cmp(&b.len()))
}

/// Offset of each part's times to a common clock, seconds; `None` without a common clock.
fn clock(parts: &[Part]) -> Option<Vec<f64>> {
    if !parts.iter().all(|part| part.collection().timed) {
        return None;
    }
    let starts: Vec<Option<i64>> = parts.iter().map(|part| part.start_ns()).collect();
    if starts.iter().all(Option::is_none) {
        return Some(vec![0.0; parts.len()]);
    }
    let starts: Vec<i64> = starts.into_iter().collect::<Option<_>>()?;
    let earliest = starts.iter().copied().min()?;
    let offset_s = |start: i64| start.abs_diff(earliest) as f64 * 1e-9;
    Some(starts.into_iter().map(offset_s).collect())
}

/// Refuse pulses that occur in more than one part.
fn check_no_twins(parts: &[Part], clock: Option<&[f64]>) -> Result<(), ReadError> {
    let key = |[part, index]: Place| {
        let pulse = &pulses(&parts[part as usize])[index as usize];
        let time_s = clock.map_or(0.0, |offsets| pulse.time_s + offsets[part as usize]);
        (time_s.to_bits(), numbers(pulse).map(f64::to_bits))
    };
    let hash = |place: Place| {
        let mut hasher = DefaultHasher::new();
        key(place).hash(&mut hasher);
        hasher.finish()
    };
    let mut hashes: Vec<(u64, Place)> = in_turn(parts).map(|place| (hash(place), place)).collect();
    hashes.sort_unstable();
    let twins = hashes.windows(2).filter_map(|pair| {
        let [(a_hash, a), (b_hash, b)] = [pair[0], pair[1]];
        let same = a_hash == b_hash && a[0] != b[0] && key(a) == key(b);
        same.then_some((a, b))
    });
    let Some((a, b)) = twins.clone().min() else {
        return Ok(());
    };
    let name =
        |[part, _]: Place, [other, _]: Place| label(&parts[part as usize], &parts[other as usize]);
    let when = if clock.is_some() {
        "at the same time and "
    } else {
        ""
    };
    Err(ReadError::Mismatch(format!(
        "{0} and {1} share {2} pulses: pulse {3} of {0} is pulse {4} of {1}, {when}from the same place in the \
         same band. A recording counts once, and channels or polarisations are focused one at a time",
        name(a, b),
        name(b, a),
        twins.count(),
        a[1],
        b[1]
    )))
}

/// All pulses, part by part.
fn in_turn(parts: &[Part]) -> impl Iterator<Item = Place> {
    let each = |(i, part)| (0..pulses(part).len() as u32).map(move |n| [i as u32, n]);
    parts.iter().enumerate().flat_map(each)
}

fn by_time(parts: &[Part], offsets: &[f64]) -> Vec<Place> {
    let time_s = |[part, index]: Place| {
        pulses(&parts[part as usize])[index as usize].time_s + offsets[part as usize]
    };
    let mut order: Vec<Place> = in_turn(parts).collect();
    // Stable sort: pulses with equal times keep the order of their parts.
    order.sort_by(|&a, &b| time_s(a).total_cmp(&time_s(b)));
    order
}

fn by_angle(parts: &[Part]) -> Vec<Place> {
    let runs: Vec<&[Pulse]> = parts.iter().map(pulses).collect();
    let mut order: Vec<Place> = in_turn(parts).collect();
    if let Some(angles) = travelled_angles(&runs) {
        let mut means = vec![0.0; parts.len()];
        for ([part, _], angle) in order.iter().zip(angles) {
            means[*part as usize] += angle / runs[*part as usize].len() as f64;
        }
        order.sort_by(|[a, _], [b, _]| {
            means[*a as usize]
                .total_cmp(&means[*b as usize])
                .then(a.cmp(b))
        });
    }
    order
}

impl Whole {
    fn new(parts: &[Part], order: &[Place], clock: Option<&[f64]>) -> Self {
        let mut runs: Vec<Run> = Vec::new();
        let mut joined = Vec::with_capacity(order.len());
        let knows = parts.iter().all(|part| part.true_antennas().is_some());
        let mut truth = Vec::with_capacity(if knows { order.len() } else { 0 });
        for (n, place) in order.iter().enumerate() {
            let [part, index] = place.map(|i| i as usize);
            let follows = |run: &Run| run.part == part && run.first + (n - run.start) == index;
            if !runs.last().is_some_and(follows) {
                runs.push(Run {
                    start: n,
                    part,
                    first: index,
                });
            }
            let pulse = &pulses(&parts[part])[index];
            joined.push(Pulse {
                time_s: clock.map_or(n as f64, |offsets| pulse.time_s + offsets[part]),
                ..*pulse
            });
            if knows && let Some(of_part) = parts[part].true_antennas() {
                truth.push(of_part[index]);
            }
        }
        let first = parts[order.first().map_or(0, |place| place[0] as usize)].collection();
        let name = match parts {
            [_] => first.name.clone(),
            _ => format!("{} and {} more", first.name, parts.len() - 1),
        };
        Self {
            collection: Collection {
                name,
                num_samples: first.num_samples,
                pulses: joined,
                frame: first.frame,
                extent: first.extent,
                timed: clock.is_some(),
            },
            true_antennas: knows.then_some(truth),
            runs,
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(self.collection.pulses.as_slice())
            + size_of_val(self.runs.as_slice())
            + self.true_antennas.as_deref().map_or(0, size_of_val)
    }
}

impl PhaseHistory for Joined {
    fn collection(&self) -> &Collection {
        match &self.whole {
            Some(whole) => &whole.collection,
            None => self.parts[0].collection(),
        }
    }

    fn read(&self, wanted: Range<usize>, mut samples: &mut [Complex32]) -> Result<(), ReadError> {
        let Some(whole) = &self.whole else {
            return self.parts[0].read(wanted, samples);
        };
        let num_pulses = whole.collection.pulses.len();
        assert!(
            wanted.end <= num_pulses,
            "pulses {wanted:?} are beyond the last one"
        );
        let width = whole.collection.num_samples;
        let mut at = wanted.start;
        // Block that contains the first pulse.
        let mut run = whole.runs.partition_point(|run| run.start <= at) - 1;
        while at < wanted.end {
            let Run { start, part, first } = whole.runs[run];
            let next = whole.runs.get(run + 1).map_or(num_pulses, |run| run.start);
            let end = next.min(wanted.end);
            let (head, tail) = samples.split_at_mut((end - at) * width);
            self.parts[part].read(first + (at - start)..first + (end - start), head)?;
            (samples, at, run) = (tail, end, run + 1);
        }
        assert!(
            samples.is_empty(),
            "more samples than pulses {wanted:?} have"
        );
        Ok(())
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        match &self.whole {
            Some(whole) => whole.true_antennas.as_deref(),
            None => self.parts[0].true_antennas(),
        }
    }

    fn start_ns(&self) -> Option<i64> {
        let starts = self.parts.iter().map(|part| part.start_ns());
        starts.collect::<Option<Vec<_>>>()?.into_iter().min()
    }

    fn channels(&self) -> Vec<Channel> {
        let mut all = Vec::new();
        for channel in self.parts.iter().flat_map(|part| part.channels()) {
            if !all.contains(&channel) {
                all.push(channel);
            }
        }
        all
    }

    /// Antennas of all parts, if they agree.
    fn antennas(&self) -> Option<MountedAntennas> {
        let parts = self.parts.iter().map(|part| part.antennas());
        let parts: Vec<MountedAntennas> = parts.collect::<Option<_>>()?;
        let Some(whole) = &self.whole else {
            return parts.into_iter().next();
        };
        let antennas = parts.first()?.antennas.clone();
        if parts.iter().any(|part| part.antennas != antennas) {
            return None;
        }
        let ends = whole.runs.iter().skip(1).map(|run| run.start);
        let ends = ends.chain([whole.collection.pulses.len()]);
        let mut attitudes = Vec::with_capacity(whole.collection.pulses.len());
        for (run, end) in whole.runs.iter().zip(ends) {
            let own = run.first..run.first + (end - run.start);
            attitudes.extend_from_slice(parts[run.part].attitudes.get(own)?);
        }
        Some(MountedAntennas {
            antennas,
            attitudes,
        })
    }

    /// Beam of all parts, if they agree.
    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        let mut stated = self.parts.iter().map(|part| part.stated_beam());
        let first = stated.next().unwrap_or(Ok(None))?;
        for other in stated {
            if other? != first {
                return Err(NoBeam::Several);
            }
        }
        Ok(first)
    }

    fn phase_conventions(&self) -> Vec<PhaseConvention> {
        let mut all = Vec::new();
        for convention in (self.parts.iter()).flat_map(|part| part.phase_conventions()) {
            if !all.contains(&convention) {
                all.push(convention);
            }
        }
        all
    }

    fn warnings(&self) -> Vec<String> {
        let parts = self.parts.iter();
        parts.flat_map(|part| part.warnings()).collect()
    }

    fn defects(&self) -> Vec<Defect> {
        let parts = self.parts.iter();
        parts.flat_map(|part| part.defects()).collect()
    }

    fn held_bytes(&self) -> u64 {
        let own = self.whole.as_ref().map_or(0, Whole::bytes);
        own as u64 + self.parts.iter().map(|part| part.held_bytes()).sum::<u64>()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        // In the order of their pulses.
        let mut order: Vec<usize> = match &self.whole {
            Some(whole) => whole.runs.iter().map(|run| run.part).collect(),
            None => vec![0],
        };
        let mut seen = vec![false; self.parts.len()];
        order.retain(|&part| !std::mem::replace(&mut seen[part], true));
        let mut all = Vec::new();
        for part in order {
            all.extend(self.parts[part].inputs()?);
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SceneFrame;
    use crate::phase_history::{InMemory, Sweep};

    /// Pulses along x, with samples that encode their index.
    fn whole(num_pulses: usize) -> (Collection, Vec<Complex32>) {
        let width = 5;
        let pulse = |n: usize| Pulse {
            time_s: n as f64 * 1e-3,
            transmitter_m: DVec3::new(n as f64, -5e3, 0.0),
            receiver_m: DVec3::new(n as f64, -5e3, 0.0),
            reference_m: DVec3::ZERO,
            reference_path_m: DVec3::new(n as f64, -5e3, 0.0).length() * 2.0,
            start_hz: 10e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        let collection = Collection {
            name: "along x".to_owned(),
            num_samples: width,
            pulses: (0..num_pulses).map(pulse).collect(),
            frame: SceneFrame::Earth {
                origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
                x_axis_ecf: DVec3::Y,
                y_axis_ecf: DVec3::Z,
            },
            extent: None,
            timed: true,
        };
        let samples = (0..num_pulses * width).map(|i| Complex32::new(i as f32, -0.5));
        (collection, samples.collect())
    }

    /// Pulses of the whole split into recordings of these lengths.
    fn parts(lengths: &[usize]) -> (Vec<Complex32>, Vec<Box<dyn PhaseHistory>>) {
        let (whole, samples) = whole(lengths.iter().sum());
        let width = whole.num_samples;
        let mut first = 0;
        let parts = lengths.iter().map(|length| {
            let pulses = first..first + length;
            first = pulses.end;
            let mut collection = whole.clone();
            collection.pulses = collection.pulses[pulses.clone()].to_vec();
            let samples = samples[pulses.start * width..pulses.end * width].to_vec();
            Box::new(InMemory::new(collection, samples).unwrap()) as Box<dyn PhaseHistory>
        });
        let parts = parts.collect();
        (samples, parts)
    }

    #[test]
    fn reading_across_joints_equals_reading_the_whole() {
        let (samples, parts) = parts(&[3, 1, 4]);
        let aperture = Joined::join(parts).unwrap();
        let width = aperture.collection().num_samples;
        assert_eq!(aperture.collection().pulses.len(), 8);
        for start in 0..8 {
            for end in start..=8 {
                let mut got = vec![Complex32::ZERO; (end - start) * width];
                aperture.read(start..end, &mut got).unwrap();
                assert_eq!(got, samples[start * width..end * width], "{start}..{end}");
            }
        }
        // Geometry of the parts and of the aperture, samples of the parts, and three blocks.
        let own = 2 * 8 * size_of::<Pulse>() as u64 + 3 * 24;
        assert_eq!(aperture.held_bytes(), own + 8 * 8 * width as u64);
    }

    #[test]
    fn single_part_is_not_copied() {
        let (samples, parts) = parts(&[3]);
        let aperture = Joined::join(parts).unwrap();
        let width = aperture.collection().num_samples;
        assert_eq!(aperture.collection().pulses.len(), 3);
        let mut got = vec![Complex32::ZERO; 3 * width];
        aperture.read(0..3, &mut got).unwrap();
        assert_eq!(got, samples);
        assert_eq!(aperture.held_bytes(), 3 * 264 + 3 * 8 * width as u64);
    }

    #[test]
    fn recordings_of_different_frames_are_refused() {
        assert!(Joined::join(Vec::new()).is_err());
        let (_, mut parts) = parts(&[2, 2]);
        let mut other = parts[1].collection().clone();
        other.frame = SceneFrame::Local;
        let samples = vec![Complex32::ZERO; 2 * other.num_samples];
        parts[1] = Box::new(InMemory::new(other, samples).unwrap());
        let error = Joined::join(parts).err().unwrap().to_string();
        assert!(error.contains("have different scene frames"), "{error}");
    }
}
