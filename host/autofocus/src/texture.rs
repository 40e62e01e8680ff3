//! Maximum-likelihood phases from clutter, texture and points, with smoothness chosen by cross-validation.
//!
//! Phases are modelled as curves (`curve.rs`) with an increasing number of coefficients. For each number the likelihood of the tiles
//! (`likelihood.rs`) is maximised from the best of several starts: the previous curve, a quadratic searched over a wide range, and
//! estimates of other methods (`starts.rs`, bright points). Cross-validation selects the number of coefficients: curves are
//! estimated on either half of the range cells and validated on the other. The best number is then used for an
//! estimate on all cells.
//!
//! A curve is accepted if the likelihood of the validated rows gains over no correction by two standard errors of the mean, or by four of Wilcoxon's
//! signed-rank sum. Where few rows have bright points, these have most of the gain and of its variance, and only the ranks show small errors.

use num_complex::Complex64;

use subaperture_fft::forward;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::phase::cis;

use super::curve::Curves;
use super::lbfgs::least;
use super::likelihood::{Texture, TileRow};
use super::split::Half;
use super::starts::by_gradient;
use super::tiles::without_trend;

/// Numbers of intervals of the first curves.
const FIRST_INTERVALS: usize = 1;

/// Largest number of steps for each curve, and smallest relative decrease of the value per step.
const STEPS: usize = 40;
const STILL: f64 = 1e-7;

/// Accepted loss of a curve with fewer coefficients against the best one, standard errors.
const STANDARD_ERRORS: f64 = 1.0;

/// Required gain over no correction, and over a quadratic, the commonest error, standard errors.
const SURE_ERRORS: f64 = 2.0;

/// Required gain over no correction by the ranks of the rows, standard errors. It is twice [`SURE_ERRORS`], because rows with side lobes of the same points
/// are not independent.
const RANK_ERRORS: f64 = 4.0;

/// Smallest magnitude of the mean phasor of phase differences at which two estimates agree.
const COHERENT: f64 = 0.6;

/// Change of phases in the first step, radians rms.
const FIRST_STEP_RAD: f64 = 0.1;

/// Number of intervals up to which every start is optimised; beyond, only the best.
const FOLLOWED: usize = 2;
const COARSE_INTERVALS: usize = 8;

/// Least number of curves of a chain, and number of curves in a row that are worse than the best on held-out data that ends it.
const MIN_LINKS: usize = 7;
const WORSE_LINKS: usize = 2;

/// First and last step of the search for the quadratic phase, radians at the aperture's ends; the rms error is a third of that.
const QUADRATIC_STEP_RAD: f64 = 1.0;
const QUADRATIC_FINEST_RAD: f64 = 0.01;

/// Phases of `turns` turns from rows of tiles of `cells` cross-range cells. `others` are estimates from the even half of the range cells, the
/// odd half, and all. `None` if held-out data confirm no correction.
pub(crate) fn estimate(
    rows: &[TileRow],
    turns: usize,
    cells: f64,
    others: [Vec<Vec<f64>>; 3],
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<f64>> {
    let of = |half: Half| {
        let rows = rows.iter().filter(|row| row.half == half).collect();
        Texture::new(rows, turns, cells)
    };
    let halves = [of(Half::Even), of(Half::Odd)];
    if halves.iter().any(Texture::is_empty) {
        return None;
    }
    let [even, odd, whole] = others;
    let mut chains = [
        Chain::new(&halves[0], turns, even, stop),
        Chain::new(&halves[1], turns, odd, stop),
    ];
    // Likelihood of every row with phases estimated without it. Their slope is not observable on the other half, and would move its points across
    // the borders of tiles.
    let judged = |on_even: &[f64], on_odd: &[f64]| -> Vec<f64> {
        let by_row = |half: &Texture, phases: &[f64]| {
            let mut phases = phases.to_vec();
            without_trend(&mut phases);
            half.values_by_row(&phases)
        };
        [by_row(&halves[0], on_even), by_row(&halves[1], on_odd)].concat()
    };
    let zero = vec![0.0; turns];
    // The simplest model is no correction.
    let mut after = vec![judged(&zero, &zero)];
    let mut pairs = Vec::new();
    let (mut links, mut worse) = (0, 0);
    while worse < WORSE_LINKS {
        let [even, odd] = &mut chains;
        let (Some((even, curves)), Some((odd, _))) = (even.next(), odd.next()) else {
            break;
        };
        after.push(judged(&odd, &even));
        pairs.push(((even, odd), curves));
        links += 1;
        let best = least_of(&after)?;
        worse = match links >= MIN_LINKS && is_worse(&after[links], &after[best], 2.0) {
            true => worse + 1,
            false => 0,
        };
    }
    let (Some(even), Some(odd)) = (chains[0].rough(), chains[1].rough()) else {
        return None;
    };
    for pair in even.into_iter().zip(odd) {
        after.push(judged(&pair.1, &pair.0));
        pairs.push((pair, Curves::new(turns, turns)));
    }
    let best = least_of(&after)?;
    // The curve with the fewest coefficients that surely gains over no correction and equals the best within the accepted loss. The best by its mean
    // may gain less surely than a smoother one, where few rows have most of the gain. Index 1 is the quadratic, the commonest error.
    let chosen = (1..after.len()).find(|&i| {
        let equals_best = match i {
            1 => !gains_surely(&after[1], &after[best]),
            _ => !is_worse(&after[i], &after[best], STANDARD_ERRORS),
        };
        equals_best && gains_surely(&after[0], &after[i])
    })?;
    // Estimate on all range cells, starting from the estimates of both halves.
    let all = Texture::new(rows.iter().collect(), turns, cells);
    let ((even, odd), curves) = pairs.swap_remove(chosen - 1);
    let from_even = optimised(&all, &curves, even, stop)?;
    let from_odd = optimised(&all, &curves, odd, stop)?;
    let found = match from_even.0 <= from_odd.0 {
        true => from_even.1,
        false => from_odd.1,
    };
    let points = whole.first().filter(|_| curves.count == turns);
    Some(in_place(found, points))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn least_of(values: &[Vec<f64>]) -> Option<usize> {
    (0..values.len()).min_by(|&a, &b| mean(&values[a]).total_cmp(&mean(&values[b])))
}

/// Whether rows are on average worse than others by more than `errors` standard errors of the difference.
fn is_worse(values: &[f64], best: &[f64], standard_errors: f64) -> bool {
    let worse: Vec<f64> = values.iter().zip(best).map(|(a, b)| a - b).collect();
    let by = mean(&worse);
    let variance = mean(&worse.iter().map(|w| (w - by).powi(2)).collect::<Vec<_>>());
    by > standard_errors * (variance / worse.len() as f64).sqrt()
}

/// Whether rows gain on average, and do so surely: by the mean or by the ranks.
fn gains_surely(before: &[f64], after: &[f64]) -> bool {
    let gains: Vec<f64> = before.iter().zip(after).map(|(a, b)| a - b).collect();
    is_worse(before, after, SURE_ERRORS) || mean(&gains) > 0.0 && rank_errors(&gains) > RANK_ERRORS
}

/// Wilcoxon's signed-rank sum over its standard deviation without any gain.
fn rank_errors(gains: &[f64]) -> f64 {
    let mut ordered: Vec<f64> = gains.iter().copied().filter(|gain| *gain != 0.0).collect();
    ordered.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranked = ordered.iter().zip(1..);
    let sum: f64 = ranked
        .map(|(gain, rank)| gain.signum() * f64::from(rank))
        .sum();
    let count = ordered.len() as f64;
    let variance = count * (count + 1.0) * (2.0 * count + 1.0) / 6.0;
    sum / variance.max(1.0).sqrt()
}

/// Phases as curves with an increasing number of coefficients: a quadratic, splines, and finally one coefficient per turn.
struct Chain<'a> {
    texture: &'a Texture<'a>,
    turns: usize,
    starts: Vec<Vec<f64>>,
    /// Starts from bright points.
    others: Vec<Vec<f64>>,
    at: Option<Vec<f64>>,
    /// Number of intervals of the next curve; `None` after one coefficient per turn.
    intervals: Option<usize>,
    stop: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> Chain<'a> {
    fn new(
        texture: &'a Texture<'a>,
        turns: usize,
        others: Vec<Vec<f64>>,
        stop: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        let mut starts = by_gradient(texture, turns);
        starts.extend(others.iter().cloned());
        Self {
            texture,
            turns,
            starts,
            others,
            at: None,
            intervals: Some(FIRST_INTERVALS),
            stop,
        }
    }

    /// Phases by bright points (without any, the best start), and these refined with one coefficient per turn, for errors that
    /// change from pulse to pulse and have no smooth approximation. `None` if cancelled.
    fn rough(&self) -> Option<Vec<Vec<f64>>> {
        let start = match self.others.first() {
            Some(start) => start.clone(),
            None => {
                let starts = self.starts.iter();
                let valued = starts.map(|start| (self.texture.value(start), start));
                valued.min_by(|a, b| a.0.total_cmp(&b.0))?.1.clone()
            }
        };
        let free = Curves::new(self.turns, self.turns);
        let (_, better) = optimised(self.texture, &free, start.clone(), self.stop)?;
        Some(vec![start, better])
    }
}

impl Iterator for Chain<'_> {
    type Item = (Vec<f64>, Curves);

    fn next(&mut self) -> Option<Self::Item> {
        let Some(before) = self.at.clone() else {
            let first = quadratic(self.texture, self.turns);
            self.at = Some(first.clone());
            return Some((first, Curves::quadratic(self.turns)));
        };
        let intervals = self.intervals?;
        let curves = Curves::new(intervals, self.turns);
        // A curve with one coefficient per turn is a start itself.
        let starts = self.starts.iter().filter(|_| curves.count < self.turns);
        let mut tried: Vec<(f64, Vec<f64>)> = starts
            .map(|start| fitted(&curves, start))
            .chain([before, vec![0.0; self.turns]])
            .map(|phases| (self.texture.value(&phases), phases))
            .collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let followed = match intervals <= COARSE_INTERVALS {
            true => FOLLOWED,
            false => 1,
        };
        let mut best: Option<(f64, Vec<f64>)> = None;
        for (_, phases) in tried.into_iter().take(followed) {
            let found = optimised(self.texture, &curves, phases, self.stop)?;
            if best.as_ref().is_none_or(|best| found.0 < best.0) {
                best = Some(found);
            }
        }
        let found = best?.1;
        self.intervals = (curves.count < self.turns).then_some(2 * intervals);
        self.at = Some(found.clone());
        Some((found, curves))
    }
}

/// Remove the phase slope, which only shifts the scene: the slope of the difference from the phases by bright points, which keep their
/// positions in the image, if both agree except for a slope; else the slope of the phases.
fn in_place(mut phases: Vec<f64>, points: Option<&Vec<f64>>) -> Vec<f64> {
    let Some(points) = points else {
        without_trend(&mut phases);
        return phases;
    };
    let length = fast_length(4 * phases.len());
    let mut sums = vec![Complex64::ZERO; length];
    for ((sum, phase), point) in sums.iter_mut().zip(&phases).zip(points) {
        *sum = cis(phase - point);
    }
    forward::<f64>(length).process(&mut sums);
    let largest = (0..length).max_by(|&a, &b| sums[a].norm_sqr().total_cmp(&sums[b].norm_sqr()));
    let largest = largest.unwrap_or(0);
    if sums[largest].norm() < COHERENT * phases.len() as f64 {
        without_trend(&mut phases);
        return phases;
    }
    let turn = std::f64::consts::TAU * largest as f64 / length as f64;
    let each = phases.iter_mut().enumerate();
    each.for_each(|(n, phase)| *phase -= turn * n as f64);
    phases
}

/// Quadratic phase with the largest likelihood.
fn quadratic(texture: &Texture, turns: usize) -> Vec<f64> {
    let phases = |edge_rad: f64| -> Vec<f64> {
        (0..turns)
            .map(|n| {
                let u = 2.0 * (n as f64 + 0.5) / turns as f64 - 1.0;
                edge_rad * (u * u - 1.0 / 3.0)
            })
            .collect()
    };
    // The instantaneous frequency of edge u^2 is up to edge / pi cells on either side: a quarter of all cells.
    let most = (std::f64::consts::PI * turns as f64 / 8.0).clamp(16.0, 128.0);
    let steps = (most / QUADRATIC_STEP_RAD) as i64;
    let best_of = |middle: f64, step: f64, steps: i64| {
        (-steps..=steps)
            .map(|i| middle + i as f64 * step)
            .map(|edge| (texture.value(&phases(edge)), edge))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(middle, |(_, edge)| edge)
    };
    let mut edge = best_of(0.0, QUADRATIC_STEP_RAD, steps);
    let mut step = QUADRATIC_STEP_RAD;
    while step > QUADRATIC_FINEST_RAD {
        step *= 0.25;
        edge = best_of(edge, step, 3);
    }
    phases(edge)
}

/// Minimise over curves from `phases`; returns the value and the phases.
fn optimised(
    texture: &Texture,
    curves: &Curves,
    phases: Vec<f64>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<(f64, Vec<f64>)> {
    let plus = |numbers: &[f64]| -> Vec<f64> {
        let more = curves.values(numbers);
        phases.iter().zip(more).map(|(a, b)| a + b).collect()
    };
    let start = vec![0.0; curves.count];
    let first = FIRST_STEP_RAD * (curves.count as f64).sqrt();
    let found = least(start, first, STEPS, STILL, |numbers| {
        (!stop()).then(|| {
            let (value, by_phases) = texture.gradient(&plus(numbers));
            (value, curves.gradient(&by_phases))
        })
    })?;
    let phases = plus(&found);
    Some((texture.value(&phases), phases))
}

/// Least-squares curve of these phases.
fn fitted(curves: &Curves, phases: &[f64]) -> Vec<f64> {
    if curves.count == phases.len() {
        return phases.to_vec();
    }
    let start = vec![0.0; curves.count];
    let found = least(start, 1.0, 60, 1e-9, |numbers| {
        let left: Vec<f64> = curves
            .values(numbers)
            .iter()
            .zip(phases)
            .map(|(a, b)| a - b)
            .collect();
        let value = 0.5 * left.iter().map(|x| x * x).sum::<f64>();
        Some((value, curves.gradient(&left)))
    });
    curves.values(&found.unwrap_or_default())
}
