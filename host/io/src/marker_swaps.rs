//! Motion-capture frames with swapped markers.
//!
//! A body with nearly symmetric markers is sometimes fitted in the wrong orientation: its attitude turns by more than
//! 90 degrees from one frame to the next, and back some frames later. No body that carries a radar turns by more than
//! [`MAX_TURN_RAD`] within [`SOON_S`] (900 degrees per second). Such frames are left out, like frames without the
//! body.
//!
//! Frames between two such turns are a segment. The longest segment is assumed correct. Forwards and backwards from
//! it, a segment is correct if its attitude is within 90 degrees of the nearest correct frame.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use subaperture_model::track::Fix;

/// Maximum rotation between frames less than [`SOON_S`] apart, radians.
const MAX_TURN_RAD: f64 = FRAC_PI_2;

/// Maximum time between frames that are compared, seconds.
pub(crate) const SOON_S: f64 = 0.1;

/// Frames left out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Swapped {
    /// Number of swapped frames, and of all frames.
    pub(crate) frames: usize,
    pub(crate) of: usize,
    /// Time of the first swapped frame, seconds.
    pub(crate) first_s: f64,
}

impl std::fmt::Display for Swapped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} of {} frames are left out, the first at {:.3} s: the body's attitude turns there by more than 90 degrees within {SOON_S} s, as where markers \
             are mistaken for one another",
            self.frames, self.of, self.first_s
        )
    }
}

/// Leave swapped frames out of `fixes`. An error if they are more than half.
pub(crate) fn without(fixes: Vec<Fix>) -> Result<(Vec<Fix>, Option<Swapped>), String> {
    let turned = |a: &Fix, b: &Fix| {
        a.attitude
            .zip(b.attitude)
            .is_some_and(|(a, b)| a.angle_between(b) > MAX_TURN_RAD)
    };
    let swap = |n: &usize| {
        let (a, b) = (&fixes[*n - 1], &fixes[*n]);
        b.time_s - a.time_s <= SOON_S && turned(a, b)
    };
    let mut segments: Vec<Range<usize>> = Vec::new();
    let mut start = 0;
    for end in (1..fixes.len()).filter(swap).chain([fixes.len()]) {
        segments.push(start..end);
        start = end;
    }
    if segments.len() < 2 {
        return Ok((fixes, None));
    }
    let longest = (0..segments.len())
        .max_by_key(|&n| (segments[n].len(), std::cmp::Reverse(n)))
        .unwrap_or_default();
    let mut right = vec![false; segments.len()];
    right[longest] = true;
    let mut last = segments[longest].end - 1;
    for n in longest + 1..segments.len() {
        right[n] = !turned(&fixes[last], &fixes[segments[n].start]);
        if right[n] {
            last = segments[n].end - 1;
        }
    }
    let mut first = segments[longest].start;
    for n in (0..longest).rev() {
        right[n] = !turned(&fixes[segments[n].end - 1], &fixes[first]);
        if right[n] {
            first = segments[n].start;
        }
    }
    let wrong = segments.iter().zip(&right).filter(|(_, right)| !**right);
    let wrong: Vec<&Range<usize>> = wrong.map(|(segment, _)| segment).collect();
    let swapped = Swapped {
        frames: wrong.iter().map(|segment| segment.len()).sum(),
        of: fixes.len(),
        first_s: wrong
            .first()
            .map_or(0.0, |segment| fixes[segment.start].time_s),
    };
    if 2 * swapped.frames > swapped.of {
        return Err(format!(
            "the body's attitude turns by more than 90 degrees within {SOON_S} s so often that {} of {} frames cannot be trusted, \
             the first at {} s: its markers are mistaken for one another. Place them less symmetrically, or solve the take again",
            swapped.frames, swapped.of, swapped.first_s
        ));
    }
    let kept = segments.iter().zip(&right).filter(|(_, right)| **right);
    let kept = kept.flat_map(|(segment, _)| fixes[segment.clone()].iter().copied());
    let kept = kept.collect();
    Ok((kept, (swapped.frames > 0).then_some(swapped)))
}

#[cfg(test)]
// Frames of one segment are contiguous.
#[allow(clippy::single_range_in_vec_init)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    /// 200 frames, 3 ms apart, of a slowly rotating body. Frames in `swapped` are upside down.
    fn frames(swapped: &[Range<usize>]) -> Vec<Fix> {
        let frame = |n: usize| {
            let attitude = DQuat::from_rotation_z(0.01 * n as f64);
            let flip = swapped.iter().any(|range| range.contains(&n));
            Fix {
                time_s: 0.003 * n as f64,
                position_m: DVec3::X,
                attitude: Some(if flip {
                    attitude * DQuat::from_rotation_x(3.0)
                } else {
                    attitude
                }),
            }
        };
        (0..200).map(frame).collect()
    }

    #[test]
    fn swapped_frames_are_left_out_and_counted() {
        for swapped in [
            vec![50..53],
            vec![0..4],
            vec![190..200],
            vec![20..21, 40..60, 61..62],
        ] {
            let count: usize = swapped.iter().map(Range::len).sum();
            let (kept, told) = without(frames(&swapped)).unwrap();
            let told = told.unwrap();
            assert_eq!(
                (told.frames, told.of, kept.len()),
                (count, 200, 200 - count)
            );
            assert_eq!(told.first_s, 0.003 * swapped[0].start as f64);
            let right = frames(&[]);
            assert!(kept.iter().all(|fix| right.contains(fix)), "{swapped:?}");
        }
        assert_eq!(without(frames(&[])).unwrap(), (frames(&[]), None));
    }

    #[test]
    fn constantly_flipping_attitudes_are_refused() {
        // Three attitudes in rotation, each upside down relative to the next: the longest segment is one frame.
        let wild: Vec<Fix> = (0..60)
            .map(|n| Fix {
                time_s: 0.003 * n as f64,
                position_m: DVec3::X,
                attitude: Some(DQuat::from_rotation_x(2.1 * f64::from(n))),
            })
            .collect();
        let error = without(wild).unwrap_err();
        assert!(error.contains("of 60 frames cannot be trusted"), "{error}");
    }

    #[test]
    fn rotation_during_a_gap_counts_as_motion() {
        let mut fixes = frames(&[]);
        for fix in &mut fixes[100..] {
            fix.time_s += 1.0;
            fix.attitude = fix.attitude.map(|q| q * DQuat::from_rotation_z(2.0));
        }
        assert_eq!(without(fixes.clone()).unwrap(), (fixes, None));
    }
}
