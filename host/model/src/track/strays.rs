//! Detection of stray positions: jumps there and back, and zeros that stand for an unknown position.
//!
//! **Speed.** Steps `d_n` from position to position take `dt_n` seconds (one without times; the median if less than
//! [`SHORTEST`] of it, as for antennas that receive simultaneously). A step is a jump if it is longer than a floor
//! and its speed exceeds [`FASTER`] times the upper quartile of all speeds. The quartile follows the track's usual
//! speed: uneven pulses, stop-and-go motion, a swinging hand and alternating antennas raise it, so that their steps
//! are not jumps.
//!
//! **There and back.** Positions between two jumps are strays if the track continues where it was: the distance from
//! the position before to that after is less than [`BACK`] of either jump. A jump without return is a new segment of
//! a joined track. At most [`MOST`] of all positions in a row are strays.
//!
//! **Ends.** A single first or last position is a stray if the jump to it would require more than [`MAX_M_S2`].
//!
//! **Zeros.** Runs of positions that are exactly zero are strays if they are less than half of all positions and the
//! steps to and from them are [`FASTER`] times the median of the steps between other positions that differ.
//!
//! **Antennas.** The offset of a stray may be that of another antenna that is used occasionally. [`ALIKE`] or more
//! offsets of equal length within a fifth and at most [`ARRAY_M`] are not strays.

use std::ops::Range;

use glam::DVec3;

/// Minimum speed of a jump relative to the upper quartile of all speeds.
const FASTER: f64 = 20.0;

/// Largest ratio of the net displacement across a pair of jumps to the length of either jump.
const BACK: f64 = 0.25;

/// Maximum fraction of positions that may be strays, in a row and in total.
const MOST: f64 = 1.0 / 8.0;

/// Minimum number of positions for the detection.
const FEWEST: usize = 8;

/// Minimum time of a step relative to the median; positions with less between them are simultaneous.
const SHORTEST: f64 = 1e-3;

/// Maximum acceleration of a radar carrier: 100 times that of gravity, m/s^2.
const MAX_M_S2: f64 = 1000.0;

/// Minimum number of equal offsets that are an antenna's.
const ALIKE: usize = 3;

/// Maximum offset between alternating antennas, metres.
const ARRAY_M: f64 = 100.0;

/// Positions that are strays, as ascending ranges.
///
/// `floor_m` is the length up to which no step is a jump. Times may be equal or descend where pulses of several
/// antennas or channels follow one another. Positions that are not finite are not strays. Empty if more than an
/// eighth of all positions (for zeros: half) would be strays, since it is then unclear which ones are.
pub fn strays(times_s: Option<&[f64]>, positions_m: &[DVec3], floor_m: f64) -> Vec<Range<usize>> {
    let count = positions_m.len();
    let sound = positions_m.iter().all(|place| place.is_finite());
    if count < FEWEST || !sound {
        return Vec::new();
    }
    let Some(steps) = Steps::of(times_s, positions_m, floor_m) else {
        return Vec::new();
    };
    let zeros = steps.zeros(positions_m);
    let mut runs = steps.there_and_back(positions_m);
    runs.extend(steps.ends(count));
    if runs.len() >= ALIKE && alike(&runs, positions_m) {
        runs.clear();
    }
    let many: usize = runs.iter().map(Range::len).sum();
    if many as f64 > MOST * count as f64 {
        runs.clear();
    }
    runs.extend(zeros);
    joined(runs)
}

/// Ranges in ascending order, with overlapping or adjacent ones merged.
pub(crate) fn joined(mut runs: Vec<Range<usize>>) -> Vec<Range<usize>> {
    runs.sort_by_key(|run| run.start);
    let mut all: Vec<Range<usize>> = Vec::new();
    for run in runs {
        match all.last_mut() {
            Some(last) if run.start <= last.end => last.end = last.end.max(run.end),
            _ => all.push(run),
        }
    }
    all
}

/// Whether the offsets from the track have equal lengths, as for another antenna.
fn alike(runs: &[Range<usize>], positions_m: &[DVec3]) -> bool {
    let offset = |run: &Range<usize>| {
        let beside = run.start.checked_sub(1).unwrap_or(run.end);
        positions_m[run.start].distance(positions_m[beside])
    };
    let lengths: Vec<f64> = runs.iter().map(offset).collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    mean <= ARRAY_M
        && lengths
            .iter()
            .all(|length| (length - mean).abs() <= 0.2 * mean)
}

/// Steps from position to position.
struct Steps {
    lengths_m: Vec<f64>,
    times_s: Vec<f64>,
    timed: bool,
    floor_m: f64,
    /// Indices of steps that are jumps, ascending.
    jumps: Vec<usize>,
}

impl Steps {
    /// `None` if all positions are equal.
    fn of(times_s: Option<&[f64]>, positions_m: &[DVec3], floor_m: f64) -> Option<Self> {
        let pairs = positions_m.windows(2);
        let lengths_m: Vec<f64> = pairs.map(|pair| pair[0].distance(pair[1])).collect();
        if lengths_m.iter().all(|&length| length <= floor_m) {
            return None;
        }
        let mut each_s: Vec<f64> = match times_s {
            Some(times) => times
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .collect(),
            None => vec![1.0; lengths_m.len()],
        };
        let mut sorted: Vec<f64> = each_s.iter().copied().filter(|&step| step > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let median_s = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        for step_s in &mut each_s {
            if *step_s < SHORTEST * median_s {
                *step_s = median_s;
            }
        }
        let speed = |n: usize| lengths_m[n] / each_s[n];
        let mut speeds: Vec<f64> = (0..lengths_m.len()).map(speed).collect();
        speeds.sort_by(f64::total_cmp);
        let usual = speeds[speeds.len() * 3 / 4];
        let jump = |&n: &usize| lengths_m[n] > floor_m && speed(n) > FASTER * usual;
        let jumps = (0..lengths_m.len()).filter(jump).collect();
        Some(Self {
            jumps,
            lengths_m,
            times_s: each_s,
            timed: times_s.is_some(),
            floor_m,
        })
    }

    fn is_jump(&self, step: usize) -> bool {
        self.jumps.binary_search(&step).is_ok()
    }

    fn there_and_back(&self, positions_m: &[DVec3]) -> Vec<Range<usize>> {
        let most = ((MOST * positions_m.len() as f64) as usize).max(1);
        let mut runs = Vec::new();
        let mut done = 0;
        for (k, &there) in self.jumps.iter().enumerate() {
            if there < done {
                continue;
            }
            let back = self.jumps[k + 1..]
                .iter()
                .take_while(|&&back| back - there <= most);
            let back = back.copied().find(|&back| {
                let way_m = positions_m[there].distance(positions_m[back + 1]);
                way_m <= BACK * self.lengths_m[there].min(self.lengths_m[back])
            });
            if let Some(back) = back {
                runs.push(there + 1..back + 1);
                done = back + 1;
            }
        }
        runs
    }

    /// Strays at the first or last position.
    fn ends(&self, count: usize) -> Vec<Range<usize>> {
        let last = count - 2;
        let stray = |step: usize, next: usize| {
            let needed_m_s2 = self.lengths_m[step] / (self.times_s[step] * self.times_s[step]);
            self.is_jump(step) && !self.is_jump(next) && (!self.timed || needed_m_s2 > MAX_M_S2)
        };
        let mut runs = Vec::new();
        if stray(0, 1) {
            runs.push(0..1);
        }
        if stray(last, last - 1) {
            runs.push(count - 1..count);
        }
        runs
    }

    /// Runs of positions that are exactly zero.
    fn zeros(&self, positions_m: &[DVec3]) -> Vec<Range<usize>> {
        let count = positions_m.len();
        let zero = |n: usize| positions_m[n] == DVec3::ZERO;
        let mut runs: Vec<Range<usize>> = Vec::new();
        for n in (0..count).filter(|&n| zero(n)) {
            match runs.last_mut() {
                Some(run) if run.end == n => run.end = n + 1,
                _ => runs.push(n..n + 1),
            }
        }
        let many: usize = runs.iter().map(Range::len).sum();
        if 2 * many >= count {
            return Vec::new();
        }
        // Many zeros raise the usual speed, so steps are compared instead: the median of those between known
        // positions that differ.
        let other = |n: &usize| !zero(*n) && !zero(*n + 1) && self.lengths_m[*n] > 0.0;
        let others = (0..count - 1).filter(other).map(|n| self.lengths_m[n]);
        let mut others: Vec<f64> = others.collect();
        others.sort_by(f64::total_cmp);
        let usual_m = others.get(others.len() / 2).copied().unwrap_or(0.0);
        let jump = |step: usize| self.lengths_m[step] > self.floor_m.max(FASTER * usual_m);
        runs.retain(|run| {
            let before = run.start.checked_sub(1);
            let after = (run.end < count).then_some(run.end - 1);
            let mut ends = before.into_iter().chain(after);
            ends.all(jump)
        });
        runs
    }
}

#[cfg(test)]
// A run of strays is a range.
#[allow(clippy::single_range_in_vec_init)]
mod tests {
    use super::*;

    /// Straight track with a little noise, from metres per step and number of steps.
    fn line(step_m: f64, count: usize) -> Vec<DVec3> {
        let at = |n: usize| {
            let noise = ((n * 7919) % 101) as f64 / 101.0 - 0.5;
            DVec3::new(step_m * n as f64, 1000.0 + 0.01 * step_m * noise, 500.0)
        };
        (0..count).map(at).collect()
    }

    fn times(step_s: f64, count: usize) -> Vec<f64> {
        (0..count).map(|n| step_s * n as f64).collect()
    }

    #[test]
    fn single_strays_are_detected_at_any_position() {
        for (step_m, step_s, off_m) in
            [(2.5, 3e-4, 5000.0), (0.02, 0.01, 3.0), (0.5, 0.005, 5000.0)]
        {
            let times = times(step_s, 64);
            for at in [0, 1, 7, 40, 62, 63] {
                let mut track = line(step_m, 64);
                track[at].x += off_m;
                for times in [Some(&times[..]), None] {
                    let found = strays(times, &track, 1.0);
                    assert_eq!(found, [at..at + 1], "{step_m} {at}");
                }
                track[at] = DVec3::ZERO;
                assert_eq!(strays(Some(&times), &track, 1.0), [at..at + 1]);
            }
        }
    }

    #[test]
    fn runs_of_strays_and_zeros_are_detected() {
        let times = times(0.01, 100);
        let mut track = line(0.2, 100);
        for place in &mut track[20..26] {
            place.z += 800.0;
        }
        assert_eq!(strays(Some(&times), &track, 1.0), [20..26]);
        // Random positions: each jumps to the next.
        for (n, place) in track[20..26].iter_mut().enumerate() {
            *place = DVec3::new(1e5 * (n as f64 - 2.0), 3e4 * n as f64, -7e4);
        }
        assert_eq!(strays(Some(&times), &track, 1.0), [20..26]);
        // Many zeros, one run at the end.
        let mut track = line(0.2, 100);
        for at in [5, 30, 31, 32, 60, 61, 97, 98, 99] {
            track[at] = DVec3::ZERO;
        }
        assert_eq!(
            strays(Some(&times), &track, 1.0),
            [5..6, 30..33, 60..62, 97..100]
        );
        for place in &mut track[40..80] {
            *place = DVec3::ZERO;
        }
        let found = strays(Some(&times), &track, 1.0);
        assert_eq!(found.iter().map(Range::len).sum::<usize>(), 47, "{found:?}");
    }

    #[test]
    fn vehicle_tracks_have_no_strays() {
        let none = |times: Option<&[f64]>, track: &[DVec3], what: &str| {
            assert_eq!(strays(times, track, 1.0), [], "{what}");
        };
        // Spaceborne, airborne, rail.
        for (step_m, step_s) in [(7.6, 1e-3), (0.1, 1e-3), (0.01, 0.1)] {
            none(Some(&times(step_s, 500)), &line(step_m, 500), "straight");
            none(None, &line(step_m, 500), "straight, without times");
        }
        // Closed circle.
        let arc: Vec<DVec3> = (0..360)
            .map(|n| (f64::from(n)).to_radians().sin_cos())
            .map(|(s, c)| DVec3::new(500.0 * c, 500.0 * s, 100.0))
            .collect();
        none(None, &arc, "arc");
        // Stop and go: steps of 2 m after nine pulses at rest.
        let stop: Vec<DVec3> = (0..300)
            .map(|n| DVec3::X * 2.0 * f64::from(n / 10))
            .collect();
        none(Some(&times(0.01, 300)), &stop, "stop and go");
        let back: Vec<DVec3> = stop.iter().map(|place| *place - stop[150]).collect();
        none(
            Some(&times(0.01, 300)),
            &back,
            "stop and go through the origin",
        );
        // Hand that swings, and rests most of the time.
        let hand: Vec<DVec3> = (0..1000)
            .map(|n| match n % 200 {
                n @ 0..40 => DVec3::Y * 1.5 * (f64::from(n) / 40.0 * std::f64::consts::TAU).sin(),
                _ => DVec3::ZERO,
            })
            .collect();
        none(Some(&times(0.02, 1000)), &hand, "hand");
        // Uneven pulses: a single distant one on a forth-and-back track.
        let mut uneven = line(0.1, 100);
        let mut at_s = times(0.01, 100);
        uneven[50] = DVec3::new(25.0, 1010.0, 500.0);
        for time in &mut at_s[50..] {
            *time += 3.0;
        }
        for time in &mut at_s[51..] {
            *time += 3.0;
        }
        none(Some(&at_s), &uneven, "uneven");
        // Joined segments 2 km apart; forth and back in equal parts.
        let mut joined = line(0.5, 120);
        for place in &mut joined[40..80] {
            place.z += 2000.0;
        }
        none(Some(&times(0.01, 120)), &joined, "segments");
        // Channels one after another: times decrease.
        let channels = [line(0.5, 60), line(0.5, 60)].concat();
        let twice = [times(0.01, 60), times(0.01, 60)].concat();
        none(Some(&twice), &channels, "channels");
        // Two alternating antennas at the same time, 3 m apart; and one of sixteen.
        for every in [2, 16] {
            let mut turns = line(0.001, 160);
            for place in turns.iter_mut().step_by(every) {
                place.y += 3.0;
            }
            let same: Vec<f64> = (0..160).map(|n| f64::from(n / 2) * 0.01).collect();
            none(Some(&same), &turns, "antennas");
            none(None, &turns, "antennas without times");
        }
        // At rest, with last digits that flip.
        let mut rest = vec![DVec3::new(100.0, 200.0, 5.0); 100];
        rest[30].x += 0.5;
        none(Some(&times(1e-3, 100)), &rest, "rest");
        // Through the origin.
        let through: Vec<DVec3> = (-50..50).map(|n| DVec3::X * f64::from(n)).collect();
        none(None, &through, "origin");
    }
}
