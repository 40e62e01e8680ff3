//! Accuracy of a search, by the delete-a-group jackknife over the aperture.
//!
//! The curvature of a merit at its maximum measures the width of the peak, not its distance from the truth: noise,
//! speckle and track errors displace the peak, and the position of a flat maximum is undefined. The search is therefore repeated on
//! all but one of `G` parts of the aperture. The spread of the results is the delete-a-group jackknife
//! estimate of the standard error (Efron and Tibshirani, An Introduction to the Bootstrap, chapter 11),
//!
//! ```text
//! s^2 = (G - 1) / G sum_g (v_g - mean v)^2
//! ```
//!
//! multiplied here by Student's 97.5 % point for `G - 1` degrees of freedom. Each repetition starts from the highest
//! point tried and climbs in all parameters at once, so that the spread includes coupled parameters and a second
//! maximum preferred by a part of the data.
//!
//! Another maximum of the scan is a rival if, of all data or without any one part, it rises to [`RIVAL`] of the best's
//! height above the scan's median. (The jackknife of that difference is less useful: it responds to the changed window
//! more than to noise.)
//!
//! Not covered: errors common to all parts, such as a wrong carrier frequency or a bent rail.

use subaperture_model::geometry::Axis;

use crate::trials::{Scan, Trials, TuneError, Verdict};

/// Student's 97.5 % points for 1, 2, ... degrees of freedom.
const STUDENT: [f64; 15] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145, 2.131,
];

/// Smallest height of a rival above the median, relative to that of the best.
const RIVAL: f64 = 0.7;

/// Half-width of the 95 % confidence interval from the repetitions.
fn half_interval(found: &[f64]) -> Option<f64> {
    let count = found.len();
    let student = *STUDENT.get(count.checked_sub(2)?).unwrap_or(&2.0);
    let mean = found.iter().sum::<f64>() / count as f64;
    let spread: f64 = found.iter().map(|v| (v - mean).powi(2)).sum();
    Some(student * ((count - 1) as f64 / count as f64 * spread).sqrt())
}

/// Best values of every repetition, one row each; empty if the merits are of all data only.
pub(super) fn repeat<E, V, F>(
    trials: &mut Trials<F>,
    intervals: &[Axis],
    refinements: usize,
) -> Result<Vec<Vec<f64>>, TuneError<E>>
where
    V: Into<super::Views>,
    F: FnMut(&[f64]) -> Result<V, E>,
{
    let parts = trials
        .known
        .values()
        .map(|views| views.0.len())
        .max()
        .unwrap_or(1);
    let mut found = Vec::new();
    for view in 1..parts {
        let mut best = (Vec::new(), f64::NEG_INFINITY);
        for (bits, views) in &trials.known {
            let merit = views.0.get(view).copied().unwrap_or(f64::NEG_INFINITY);
            if best.0.is_empty() || merit > best.1 {
                best = (bits.iter().map(|&b| f64::from_bits(b)).collect(), merit);
            }
        }
        let mut steps: Vec<f64> = intervals.iter().map(|axis| axis.step).collect();
        for _ in 0..refinements.min(4) {
            steps.iter_mut().for_each(|step| *step /= 2.0);
            best = trials.climb(intervals, &steps, best, view)?;
        }
        if refinements > 0 {
            best = trials.vertex(intervals, &steps, best, view)?;
        }
        found.push(best.0);
    }
    Ok(found)
}

/// Set error, rivals and verdict of a parameter from its scan, the merits of all views along it and at the best, and the
/// results of the repetitions. `least` is the resolution of the search.
pub(super) fn judge(
    axis: &Axis,
    scan: &mut Scan,
    best: f64,
    best_views: &[f64],
    views: &[Vec<f64>],
    found: &[f64],
    least: f64,
) {
    let Some(error) = half_interval(found) else {
        return;
    };
    let error = error.max(least);
    scan.error = Some(error);
    let length = axis.at(axis.count - 1) - axis.start;
    let medians: Vec<f64> = (0..best_views.len())
        .map(|view| {
            let merits = views.iter().map(|views| views[view]);
            let mut merits: Vec<f64> = merits.filter(|merit| merit.is_finite()).collect();
            merits.sort_by(f64::total_cmp);
            merits.get(merits.len() / 2).copied().unwrap_or(f64::NAN)
        })
        .collect();
    scan.rivals = scan
        .points
        .iter()
        .enumerate()
        .filter(|&(j, point)| {
            let lower = |other: Option<&(f64, f64)>| other.is_none_or(|other| other.1 < point.1);
            let before = j.checked_sub(1).and_then(|j| scan.points.get(j));
            (point.0 - best).abs() > error && lower(before) && lower(scan.points.get(j + 1))
        })
        .filter(|&(j, point)| {
            point.1.is_finite()
                && best_views
                    .iter()
                    .zip(&views[j])
                    .zip(&medians)
                    .any(|((best, rival), median)| rival - median > RIVAL * (best - median))
        })
        .map(|(_, point)| point.0)
        .collect();
    let outside = found
        .iter()
        .any(|v| *v <= axis.start || *v >= axis.start + length);
    scan.verdict = if axis.count < 3 {
        Verdict::Unknown
    } else if scan.at_end {
        Verdict::AtEnd
    } else if 2.0 * error > 0.5 * length || outside {
        Verdict::Open
    } else if !scan.rivals.is_empty() {
        Verdict::Ambiguous
    } else {
        Verdict::Determined
    };
}
