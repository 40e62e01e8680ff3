//! Cache of evaluated merits, and the steps of a search.

use std::collections::BTreeMap;

use subaperture_model::geometry::Axis;
use subaperture_model::monitor::Monitor;

/// Merits of parameter values: of all data first, then without each part of the data, if evaluated. Larger is better.
#[derive(Clone, Debug, PartialEq)]
pub struct Views(pub Vec<f64>);

impl From<f64> for Views {
    fn from(merit: f64) -> Self {
        Self(vec![merit])
    }
}

/// Verdict on a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The merits give no uncertainty, or the parameter has no interval.
    #[default]
    Unknown,
    /// The data determine the value within its error.
    Determined,
    /// The best value is at an end of the interval: a better one may lie beyond.
    AtEnd,
    /// The error exceeds half of the interval or reaches its end: the data do not determine the value.
    Open,
    /// Other values are as good within the accuracy of the data.
    Ambiguous,
}

/// Scan of one parameter with the others at their best values.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Values, ascending, with their merits: those of the grid, and some near the best.
    pub points: Vec<(f64, f64)>,
    /// Width of the peak at half its height above the median; `None` if it does not fall so far within the interval.
    pub width: Option<f64>,
    /// Whether the best is at an end of the interval, so that a better one may lie beyond.
    pub at_end: bool,
    /// Half-width of the 95 % confidence interval around the best value; `None` if there are merits of all data only. It is
    /// meaningful for [`Verdict::Determined`] only.
    pub error: Option<f64>,
    /// Other maxima that are as good as the best within the accuracy of the data.
    pub rivals: Vec<f64>,
    /// Whether the data determine the value.
    pub verdict: Verdict,
}

/// Reason why a search has no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TuneError<E> {
    /// The merit of a value could not be evaluated.
    #[error(transparent)]
    Failed(E),
    /// Every image was dark or not finite.
    #[error(
        "every image of the search is dark or not finite: check the grid and the intervals of the parameters"
    )]
    Nothing,
    /// The monitor cancelled the search.
    #[error("interrupted")]
    Cancelled,
}

/// Largest number of rounds over all parameters in turn.
const ROUNDS: usize = 6;

/// Largest number of moves with one step size; beyond it there is no maximum nearby.
const MOVES: usize = 16;

/// Values with their merit.
pub(crate) type Trial = (Vec<f64>, f64);

pub(crate) struct Trials<'a, F> {
    pub(crate) merit: F,
    /// Merits, with the bits of the values as key.
    pub(crate) known: BTreeMap<Vec<u64>, Views>,
    pub(crate) monitor: &'a dyn Monitor,
    pub(crate) expected: usize,
}

impl<E, V: Into<Views>, F: FnMut(&[f64]) -> Result<V, E>> Trials<'_, F> {
    /// Merit of all data.
    pub(crate) fn at(&mut self, values: &[f64]) -> Result<f64, TuneError<E>> {
        self.view(values, 0)
    }

    /// Merit of one view of the data.
    pub(crate) fn view(&mut self, values: &[f64], view: usize) -> Result<f64, TuneError<E>> {
        let views = self.views(values)?;
        Ok(views.get(view).copied().unwrap_or(f64::NEG_INFINITY))
    }

    pub(crate) fn views(&mut self, values: &[f64]) -> Result<Vec<f64>, TuneError<E>> {
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

    /// Evaluate every combination; of equal merits the first is the best.
    pub(crate) fn product(
        &mut self,
        intervals: &[Axis],
    ) -> Result<(Trial, Option<Vec<f64>>), TuneError<E>> {
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

    pub(crate) fn in_turn(
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

    /// Move to a point with no better neighbour `steps` away, by the merits of one view.
    pub(crate) fn climb(
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

    /// Move to the vertex of a parabola on each axis, if it is better.
    pub(crate) fn vertex(
        &mut self,
        intervals: &[Axis],
        steps: &[f64],
        best: Trial,
        view: usize,
    ) -> Result<Trial, TuneError<E>> {
        let mut values = best.0.clone();
        for (i, axis) in intervals.iter().enumerate() {
            let mut neighbour = |sign: f64| {
                let mut values = best.0.clone();
                values[i] = within(axis, values[i] + sign * steps[i]);
                let apart = values[i] - best.0[i];
                self.view(&values, view)
                    .map(|merit| (apart, merit - best.1))
            };
            let ((left, below), (right, above)) = (neighbour(-1.0)?, neighbour(1.0)?);
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

    /// Scan parameter `i` over its interval with the others at their best values.
    pub(crate) fn scan(
        &mut self,
        intervals: &[Axis],
        i: usize,
        best: &Trial,
    ) -> Result<Scan, TuneError<E>> {
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

pub(crate) fn within(axis: &Axis, value: f64) -> f64 {
    value.clamp(axis.start, axis.at(axis.count - 1))
}

/// Distance between the points, linearly interpolated, where the merit has fallen half way from the best to the
/// median.
pub(crate) fn width(points: &[(f64, f64)], best: f64, merit: f64) -> Option<f64> {
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
