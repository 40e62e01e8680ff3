//! Unknown geometry, phases and tracks found by the sharpness of the image.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `autofocus`.
//!
//! # Parameters
//!
//! A search knows its parameters only by their intervals, and the image only by a figure of merit, larger is better:
//! the caller says how values become a merit, usually through [`merit`]. It goes
//!
//! 1. over a grid: every combination of the parameters' values, or one parameter after another
//!    ([`Order::InTurn`]), the others kept at the best so far, from the middles of the intervals on, until nothing
//!    changes. In turn costs the sum of the counts in place of their product. It finds the same where the peak
//!    shows with the other parameters at the middles of their intervals, and its ridges are not oblique to the axes;
//! 2. around the best: all neighbours at half the step, moving while one is better, then half of that, and so on;
//! 3. to the vertex of a parabola through the best and its two last neighbours on each axis.
//!
//! How sharply the merit peaks is told by its *width*: how far apart the points are, on both sides of the
//! best, where the merit has fallen half way to its median over the interval, the other parameters at their
//! best. It says nothing of how far the peak is from the truth. That is told by the *error*, from what the search finds
//! without one part of the aperture and without another (`certainty.rs`), and by the [`Verdict`]: whether there is
//! a finding at all.
//!
//! Sharpness has many maxima: a grid whose step is above the width can miss the highest one. The widths tell
//! afterwards whether the step was fine enough.
//!
//! Some parameters move the image more than they defocus it. [`determine`] therefore compares the same pulses and the
//! same points, with pixels that follow them (`anchor.rs`): without, a clock's offset was found to 0.6 s and was
//! 2.4 s wrong.
//!
//! Focus does not tell everything. A shift that stays focused (of ranges seen from a short aperture, of clocks while the
//! platform goes evenly) needs a point of known place: [`Sight::Points`]. Measured on a public recording of a radar pushed
//! along a rail (`tests/recordings/described.rs`): sharpness finds the clocks' offset to 0.06 s and leaves the range bias open, the power at
//! one surveyed reflector finds both, and the reflector then lies within 3 cm of its survey.
//!
//! Every evaluation is made once. The result depends on nothing but the merit: it is deterministic if that is.
//!
//! # Phases and tracks
//!
//! What changes from pulse to pulse is no matter of a few parameters. [`sharpen()`] finds it by a [`Method`] and images of any
//! former, and never makes an image worse:
//!
//! | method | finds | for |
//! |---|---|---|
//! | [`PhaseGradient`] | a phase a pulse | scenes with some bright points, any error that is alike for all of them |
//! | [`ModifiedPhaseGradient`] | displacements of the antennas, two components a pulse | near scenes, points under different directions |
//! | [`Sharpness`] | either, as curves of more and more numbers | scenes without points that stand alone; tracks seen from afar |
//! | [`MapDrift`] | a polynomial of few terms | smooth errors, scenes without points |
//!
//! What comes out is a [`Correction`], and [`Corrected`] is the recording with it.
#![forbid(unsafe_code)]

mod anchor;
mod centring;
mod certainty;
mod correction;
mod curve;
mod dense;
mod determine;
mod echoes;
mod estimator;
mod joint;
mod lbfgs;
mod map_drift;
mod measure;
mod modified_pga;
mod patches;
mod pga;
mod rigid;
mod sharpen;
mod sharpness;

use std::collections::BTreeMap;

use subaperture_model::monitor::Monitor;

pub use correction::{Corrected, Correction, Misfit};
pub use determine::{Expected, Model, Problem, determine, rehearse};
pub use echoes::Points;
pub use estimator::{Estimator, UnknownEstimator};
pub use map_drift::MapDrift;
pub use measure::{Measure, PARTS, Sight, UnknownMeasure, merit, merits};
pub use modified_pga::ModifiedPhaseGradient;
pub use pga::PhaseGradient;
pub use sharpen::{
    Figures, Look, Method, Round, SharpenError, Sharpened, Stopping, Subject, sharpen,
};

pub use sharpness::{Goal, LEAST_ACROSS, Sharpness, Unknown, UnknownGoal, UnknownName};

/// The interval of a parameter: `count` values from `start` on, `step` apart.
pub use subaperture_model::geometry::Axis;

/// In which order a grid is searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Every combination.
    #[default]
    Product,
    /// One parameter after another.
    InTurn,
}

/// How a search goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Over the grid.
    pub order: Order,
    /// How often the step is halved around the best.
    pub refinements: usize,
}

/// Merits of values of the parameters: of all data first, then without each of its parts, if those are known. Larger
/// is better.
#[derive(Clone, Debug, PartialEq)]
pub struct Views(pub Vec<f64>);

impl From<f64> for Views {
    fn from(merit: f64) -> Self {
        Self(vec![merit])
    }
}

/// What is to be thought of a parameter that was searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The merits tell nothing of their own uncertainty, or it had no interval.
    #[default]
    Unknown,
    /// It is the best within its error.
    Determined,
    /// The best is at an end of the interval: a better one may lie beyond.
    AtEnd,
    /// The error takes half of the interval or reaches its end: the data do not tell it.
    Open,
    /// Other values are as good within what the data tell.
    Ambiguous,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The best value of each parameter.
    pub best: Vec<f64>,
    /// The merit there.
    pub merit: f64,
    /// Of each parameter what is known of it.
    pub scans: Vec<Scan>,
    /// Merit of every combination, the last parameter fastest, if all were tried.
    pub grid: Option<Vec<f64>>,
    /// What the search finds without each part of the data, if that is known.
    pub without_parts: Vec<Vec<f64>>,
    /// Evaluations made.
    pub evaluations: usize,
}

/// One parameter with the others at their best.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Values and merits, values ascending: the grid's, and some close to the best.
    pub points: Vec<(f64, f64)>,
    /// Width of the peak half way to the median; `None` if it does not fall so far within the interval.
    pub width: Option<f64>,
    /// Whether the best is at an end of the interval, so that a better one may lie beyond.
    pub at_end: bool,
    /// Half of the interval of 95 % confidence around the best; `None` if the merits are of all data only. It
    /// means something with [`Verdict::Determined`] only.
    pub error: Option<f64>,
    /// Other maxima that are as good as the best within what the data tell.
    pub rivals: Vec<f64>,
    /// Whether this is a finding.
    pub verdict: Verdict,
}

/// Why a search ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum TuneError<E> {
    /// A value could not be tried.
    #[error(transparent)]
    Failed(E),
    /// Every image was dark, or not finite.
    #[error("no values of the parameters gave an image: check the grid and the intervals")]
    Nothing,
    /// The monitor asked to stop.
    #[error("interrupted")]
    Cancelled,
}

/// Rounds over all parameters in turn, at most.
const ROUNDS: usize = 6;

/// Moves at one step, at most: beyond, the merit has no maximum near.
const MOVES: usize = 16;

/// Searches `intervals` for the values of the largest `merit`. Values that are not finite count as the least.
///
/// # Errors
/// [`TuneError`].
///
/// # Panics
/// If there are no intervals, or one is empty.
pub fn search<E, V: Into<Views>>(
    intervals: &[Axis],
    search: Search,
    monitor: &dyn Monitor,
    merit: impl FnMut(&[f64]) -> Result<V, E>,
) -> Result<Tuned, TuneError<E>> {
    search_from(intervals, search, None, monitor, merit)
}

/// As [`search`], but in turn from `start` on in place of the intervals' middles.
fn search_from<E, V: Into<Views>>(
    intervals: &[Axis],
    search: Search,
    start: Option<&[f64]>,
    monitor: &dyn Monitor,
    merit: impl FnMut(&[f64]) -> Result<V, E>,
) -> Result<Tuned, TuneError<E>> {
    assert!(
        !intervals.is_empty() && intervals.iter().all(|axis| axis.count > 0),
        "nothing to search"
    );
    let mut trials = Trials {
        merit,
        known: BTreeMap::new(),
        monitor,
        expected: expected(intervals, search),
    };
    let (mut best, grid) = match search.order {
        Order::Product => trials.product(intervals)?,
        Order::InTurn => (trials.in_turn(intervals, start)?, None),
    };
    if best.1 == f64::NEG_INFINITY {
        return Err(TuneError::Nothing);
    }
    let mut steps: Vec<f64> = intervals.iter().map(|axis| axis.step).collect();
    for _ in 0..search.refinements {
        steps.iter_mut().for_each(|step| *step /= 2.0);
        best = trials.climb(intervals, &steps, best, 0)?;
    }
    if search.refinements > 0 {
        best = trials.vertex(intervals, &steps, best, 0)?;
    }
    let mut scans = (0..intervals.len())
        .map(|i| trials.scan(intervals, i, &best))
        .collect::<Result<Vec<_>, _>>()?;
    let without_parts = certainty::repeat(&mut trials, intervals, search.refinements)?;
    for (i, scan) in scans.iter_mut().enumerate() {
        let mut along = Vec::with_capacity(scan.points.len());
        for point in &scan.points {
            let mut values = best.0.clone();
            values[i] = point.0;
            along.push(trials.views(&values)?);
        }
        let found: Vec<f64> = without_parts.iter().map(|values| values[i]).collect();
        let best_views = trials.views(&best.0)?;
        let axis = &intervals[i];
        certainty::judge(
            axis,
            scan,
            best.0[i],
            &best_views,
            &along,
            &found,
            0.5 * steps[i],
        );
    }
    Ok(Tuned {
        best: best.0,
        merit: best.1,
        scans,
        grid,
        without_parts,
        evaluations: trials.known.len(),
    })
}

/// Evaluations that a search makes, about: a climb may be longer, and what was tried is not tried again.
fn expected(intervals: &[Axis], search: Search) -> usize {
    let counts = intervals.iter().map(|axis| axis.count);
    let coarse = match search.order {
        Order::Product => counts.product(),
        Order::InTurn => 2 * counts.sum::<usize>(),
    };
    let neighbours = 3usize.pow(intervals.len() as u32) - 1;
    let scans: usize = intervals.iter().map(|axis| axis.count + 4).sum();
    coarse + search.refinements * neighbours + scans
}

/// Values and their merit.
type Trial = (Vec<f64>, f64);

struct Trials<'a, F> {
    merit: F,
    /// Merits by the bits of the values.
    known: BTreeMap<Vec<u64>, Views>,
    monitor: &'a dyn Monitor,
    expected: usize,
}

impl<E, V: Into<Views>, F: FnMut(&[f64]) -> Result<V, E>> Trials<'_, F> {
    /// The merit of all data.
    fn at(&mut self, values: &[f64]) -> Result<f64, TuneError<E>> {
        self.view(values, 0)
    }

    /// That of one of the views.
    fn view(&mut self, values: &[f64], view: usize) -> Result<f64, TuneError<E>> {
        let views = self.views(values)?;
        Ok(views.get(view).copied().unwrap_or(f64::NEG_INFINITY))
    }

    fn views(&mut self, values: &[f64]) -> Result<Vec<f64>, TuneError<E>> {
        let bits: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
        if let Some(views) = self.known.get(&bits) {
            return Ok(views.0.clone());
        }
        if self.monitor.cancelled() {
            return Err(TuneError::Cancelled);
        }
        let mut views: Views = (self.merit)(values).map_err(TuneError::Failed)?.into();
        for merit in &mut views.0 {
            if !merit.is_finite() {
                *merit = f64::NEG_INFINITY;
            }
        }
        self.known.insert(bits, views.clone());
        self.monitor
            .progress(self.known.len() as f64 / self.expected.max(1) as f64);
        Ok(views.0)
    }

    /// Every combination; the first of equals is the best.
    fn product(&mut self, intervals: &[Axis]) -> Result<(Trial, Option<Vec<f64>>), TuneError<E>> {
        let count = intervals.iter().map(|axis| axis.count).product();
        let mut merits = Vec::with_capacity(count);
        let mut best = (Vec::new(), f64::NEG_INFINITY);
        for index in 0..count {
            let mut rest = index;
            let mut values = vec![0.0; intervals.len()];
            for (value, axis) in values.iter_mut().zip(intervals).rev() {
                *value = axis.at(rest % axis.count);
                rest /= axis.count;
            }
            let merit = self.at(&values)?;
            merits.push(merit);
            if best.0.is_empty() || merit > best.1 {
                best = (values, merit);
            }
        }
        Ok((best, Some(merits)))
    }

    fn in_turn(
        &mut self,
        intervals: &[Axis],
        start: Option<&[f64]>,
    ) -> Result<Trial, TuneError<E>> {
        let middle: Vec<f64> = match start {
            Some(start) => start.to_vec(),
            None => intervals
                .iter()
                .map(|axis| axis.at(axis.count / 2))
                .collect(),
        };
        let merit = self.at(&middle)?;
        let mut best = (middle, merit);
        for _ in 0..ROUNDS {
            let before = best.0.clone();
            for (i, axis) in intervals.iter().enumerate() {
                for k in 0..axis.count {
                    let mut values = best.0.clone();
                    values[i] = axis.at(k);
                    let merit = self.at(&values)?;
                    if merit > best.1 {
                        best = (values, merit);
                    }
                }
            }
            if best.0 == before {
                break;
            }
        }
        Ok(best)
    }

    /// To a point that no neighbour `steps` away is better than, by the merits of one view.
    fn climb(
        &mut self,
        intervals: &[Axis],
        steps: &[f64],
        mut best: Trial,
        view: usize,
    ) -> Result<Trial, TuneError<E>> {
        let neighbours = 3usize.pow(steps.len() as u32);
        for _ in 0..MOVES {
            let centre = best.0.clone();
            for index in 0..neighbours {
                let mut rest = index;
                let mut values = centre.clone();
                for ((value, step), axis) in values.iter_mut().zip(steps).zip(intervals) {
                    *value = within(axis, *value + (rest % 3) as f64 * step - step);
                    rest /= 3;
                }
                let merit = self.view(&values, view)?;
                if merit > best.1 {
                    best = (values, merit);
                }
            }
            if best.0 == centre {
                break;
            }
        }
        Ok(best)
    }

    /// To the vertex of a parabola on each axis, if it is better.
    fn vertex(
        &mut self,
        intervals: &[Axis],
        steps: &[f64],
        best: Trial,
        view: usize,
    ) -> Result<Trial, TuneError<E>> {
        let mut values = best.0.clone();
        for (i, axis) in intervals.iter().enumerate() {
            let mut beside = |sign: f64| {
                let mut values = best.0.clone();
                values[i] = within(axis, values[i] + sign * steps[i]);
                let apart = values[i] - best.0[i];
                self.view(&values, view)
                    .map(|merit| (apart, merit - best.1))
            };
            let ((left, below), (right, above)) = (beside(-1.0)?, beside(1.0)?);
            // Merit relative to the best over the distance from it: b x + a x^2 through both.
            if left < 0.0 && right > 0.0 {
                let a = (above / right - below / left) / (right - left);
                let b = above / right - a * right;
                if a < 0.0 && a.is_finite() && b.is_finite() {
                    values[i] = within(axis, best.0[i] + (-b / (2.0 * a)).clamp(left, right));
                }
            }
        }
        let merit = self.view(&values, view)?;
        Ok(if merit > best.1 {
            (values, merit)
        } else {
            best
        })
    }

    /// Parameter `i` over its interval, the others at their best.
    fn scan(&mut self, intervals: &[Axis], i: usize, best: &Trial) -> Result<Scan, TuneError<E>> {
        let axis = &intervals[i];
        let near = [-0.5, -0.25, 0.25, 0.5].map(|part| within(axis, best.0[i] + part * axis.step));
        let mut values: Vec<f64> = (0..axis.count).map(|k| axis.at(k)).collect();
        values.extend(near);
        values.push(best.0[i]);
        values.sort_by(f64::total_cmp);
        values.dedup();
        let mut points = Vec::with_capacity(values.len());
        for value in values {
            let mut all = best.0.clone();
            all[i] = value;
            points.push((value, self.at(&all)?));
        }
        let width = width(&points, best.0[i], best.1);
        let last = axis.at(axis.count - 1);
        let slack = 1e-9 * axis.step;
        Ok(Scan {
            points,
            width,
            at_end: axis.count > 1 && (best.0[i] - axis.start < slack || last - best.0[i] < slack),
            error: None,
            rivals: Vec::new(),
            verdict: Verdict::Unknown,
        })
    }
}

fn within(axis: &Axis, value: f64) -> f64 {
    value.clamp(axis.start, axis.at(axis.count - 1))
}

/// Distance between the points, linearly interpolated, where the merit has fallen half way from the best to the
/// median.
fn width(points: &[(f64, f64)], best: f64, merit: f64) -> Option<f64> {
    let mut merits: Vec<f64> = points.iter().map(|point| point.1).collect();
    merits.sort_by(f64::total_cmp);
    let median = merits[merits.len() / 2];
    let level = 0.5 * (merit + median);
    if !(level.is_finite() && level < merit) {
        return None;
    }
    let top = points.iter().position(|point| point.0 == best)?;
    let crossing = |pair: [(f64, f64); 2]| {
        let [(x0, m0), (x1, m1)] = pair;
        (m0 > level && m1 <= level).then(|| match m1.is_finite() {
            true => x0 + (x1 - x0) * (m0 - level) / (m0 - m1),
            false => x1,
        })
    };
    let right = points[top..]
        .windows(2)
        .find_map(|w| crossing([w[0], w[1]]))?;
    let left = points[..=top]
        .windows(2)
        .rev()
        .find_map(|w| crossing([w[1], w[0]]))?;
    Some(right - left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;
    use subaperture_model::monitor::Silent;

    fn axis(start: f64, step: f64, count: usize) -> Axis {
        Axis { start, step, count }
    }

    /// A peak of width 0.1 and 2 at (0.333, -1.27) over ripples of a third of its height.
    fn peak(values: &[f64]) -> Result<f64, Infallible> {
        let (x, y) = ((values[0] - 0.333) / 0.1, (values[1] + 1.27) / 2.0);
        let ripple = 0.3 * (9.0 * values[0]).sin() * (7.0 * values[1]).sin();
        Ok((-x * x - y * y).exp() + ripple * (1.0 - (-x * x - y * y).exp()))
    }

    #[test]
    fn both_orders_find_the_peak() {
        let intervals = [axis(0.0, 0.08, 13), axis(-3.0, 0.4, 16)];
        for order in [Order::Product, Order::InTurn] {
            let wanted = Search {
                order,
                refinements: 6,
            };
            let found = search(&intervals, wanted, &Silent, peak).unwrap();
            // Steps are 0.00125 and 0.00625 at the end; the parabola does better than either.
            assert!((found.best[0] - 0.333).abs() < 1e-3, "{found:?}");
            assert!((found.best[1] + 1.27).abs() < 5e-3, "{found:?}");
            assert!(found.merit > 0.999);
            assert_eq!(found.grid.is_some(), order == Order::Product);
            assert!(!found.scans[0].at_end);
            // Half of a Gaussian's height over a median near 0 is 2 sqrt(ln 2) 0.1 = 0.167 wide; ripples
            // and the coarse scan move that by a fifth.
            let width = found.scans[0].width.unwrap();
            assert!((0.13..0.2).contains(&width), "{width}");
        }
    }

    #[test]
    fn in_turn_costs_the_sum_of_the_counts() {
        let intervals = [axis(0.0, 0.01, 101), axis(-3.0, 0.05, 121)];
        let wanted = Search {
            order: Order::InTurn,
            refinements: 0,
        };
        let found = search(&intervals, wanted, &Silent, peak).unwrap();
        // Some rounds of 222 and the scans; all combinations are 12221.
        assert!(found.evaluations < 5 * 222, "{}", found.evaluations);
    }

    #[test]
    fn a_parabola_s_vertex_is_found_and_a_slope_ends_at_an_end() {
        let wanted = Search {
            order: Order::Product,
            refinements: 1,
        };
        let vertex = |v: &[f64]| Ok::<_, Infallible>(-(v[0] - 0.1234).powi(2));
        let found = search(&[axis(-1.0, 0.3, 8)], wanted, &Silent, vertex).unwrap();
        // Exact but for rounding: differences of 1e-3 in units of 1e-16 over steps of 0.15.
        assert!((found.best[0] - 0.1234).abs() < 1e-12, "{found:?}");
        let slope = |v: &[f64]| Ok::<_, Infallible>(v[0]);
        let found = search(&[axis(-1.0, 0.3, 8)], wanted, &Silent, slope).unwrap();
        assert!(found.scans[0].at_end && found.scans[0].width.is_none());
        let dark = |_: &[f64]| Ok::<_, Infallible>(f64::NAN);
        let error = search(&[axis(0.0, 1.0, 3)], wanted, &Silent, dark).unwrap_err();
        assert!(matches!(error, TuneError::Nothing));
    }

    #[test]
    fn a_search_stops_when_asked() {
        struct Stop;
        impl Monitor for Stop {
            fn progress(&self, _fraction: f64) {}
            fn cancelled(&self) -> bool {
                true
            }
        }
        let wanted = Search {
            order: Order::Product,
            refinements: 0,
        };
        let error = search(&[axis(0.0, 1.0, 3)], wanted, &Stop, |_| {
            Ok::<_, Infallible>(0.0)
        });
        assert!(matches!(error, Err(TuneError::Cancelled)));
    }
}
