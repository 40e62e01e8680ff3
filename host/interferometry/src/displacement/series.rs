//! Time series of displacement.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::candidates::{Candidate, select};
use super::error::DisplacementError;
use super::graph::Graph;
use super::noise::phase_deviations;
use super::passes::{Passes, Settings, check};
use super::screen::{Design, Joint, wrapped};
use super::unwrap::unwrap;

/// Displacement of persistent points over the passes.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplacementSeries {
    /// Screen of each pass; that of the first is zero.
    pub screens: Vec<PassScreen>,
    /// Points, by ascending row and column.
    pub points: Vec<Point>,
    /// Range at which the constants of the screens hold, metres.
    pub screen_range_m: f64,
    /// Numbers of pixels and points.
    pub counts: PointCounts,
}

/// Atmospheric screen of a pass relative to the first, and the noise about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PassScreen {
    /// Phase at [`DisplacementSeries::screen_range_m`], radians.
    pub phase_rad: f64,
    /// Standard deviation of that phase, radians.
    pub phase_deviation_rad: f64,
    /// Slope over range, radians per metre.
    pub slope_rad_per_m: f64,
    /// Standard deviation of the slope, radians per metre.
    pub slope_deviation_rad_per_m: f64,
    /// Factor of variances: mean square of the normalised residuals of the screen's points, 1 unless it exceeds 1 significantly.
    pub excess: f64,
    /// Number of points that are doubtful in this pass.
    pub doubtful: usize,
}

/// Numbers of pixels and points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PointCounts {
    /// Pixels above the floor.
    pub above_floor: usize,
    /// Number of persistent points.
    pub points: usize,
    /// Points in stable areas.
    pub stable: usize,
    /// Points that weigh at least a half in the screens.
    pub screen: usize,
    /// Points that are doubtful in the last pass.
    pub doubtful: usize,
}

/// Persistent point with its time series.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Row of the pixel.
    pub row: usize,
    /// Column of the pixel.
    pub column: usize,
    /// Position of the pixel, metres, scene frame.
    pub position_m: [f64; 3],
    /// Range from the radar, metres.
    pub range_m: f64,
    /// Mean power over the passes, that of a unit scatterer being 1.
    pub power: f64,
    /// Amplitude dispersion index: deviation over mean of the calibrated amplitudes.
    pub dispersion: f64,
    /// Phase deviation in one pass, radians.
    pub phase_deviation_rad: f64,
    /// Whether it lies in a stable area.
    pub stable: bool,
    /// Pass from which on half-wavelength slips are possible.
    pub doubtful_from: Option<usize>,
    /// Displacement in each pass relative to the first, metres, positive away from the radar.
    pub displacement_m: Vec<f64>,
    /// Standard deviation of each displacement, metres; 0 in the first pass.
    pub deviation_m: Vec<f64>,
    /// Slope of the least-squares line over all passes, metres a second.
    pub velocity_m_s: f64,
    /// Standard deviation of the velocity, metres a second.
    pub velocity_deviation_m_s: f64,
    /// Temporal coherence: magnitude of the mean phasor of the residuals of that line, 0 to 1.
    pub coherence: f64,
}

/// Measure the displacement of persistent points over repeat passes.
///
/// # Errors
/// [`DisplacementError`].
pub fn measure(
    passes: &Passes,
    settings: &Settings,
) -> Result<DisplacementSeries, DisplacementError> {
    check(passes, settings)?;
    let (candidates, above_floor) = select(passes, settings)?;
    let places: Vec<[f64; 3]> = (candidates.iter())
        .map(|c| passes.grid.position_m(c.row, c.column).to_array())
        .collect();
    let ranges: Vec<f64> = places.iter().map(|at| range(*at, passes.radar_m)).collect();
    let stable = stable(&places, settings)?;
    let mut design = design(passes, settings, &candidates, &ranges, &stable)?;

    let plane: Vec<[f64; 2]> = (candidates.iter())
        .map(|c| {
            let grid = passes.grid;
            grid.plane_m(grid.rows.at(c.row), grid.columns.at(c.column))
        })
        .collect();
    let graph = Graph::new(&plane, &design.deviations);
    let (phases, doubtful) = unwrapped(passes, &candidates, &design, &graph);
    design.leave_out(&doubtful);
    let joint = design.joint(&phases);
    let excess: Vec<f64> = (phases.iter().zip(&joint.screens))
        .map(|(phases, &screen)| design.excess(&joint, phases, screen))
        .collect();
    let found = Found {
        passes,
        design: &design,
        joint: &joint,
        excess: &excess,
    };
    let points: Vec<Point> = (candidates.iter().enumerate())
        .map(|(p, candidate)| {
            let own: Vec<f64> = phases.iter().map(|phases| phases[p]).collect();
            Point {
                position_m: places[p],
                range_m: ranges[p],
                stable: stable[p],
                doubtful_from: doubtful[p],
                ..found.point(p, candidate, &own)
            }
        })
        .collect();
    let counts = PointCounts {
        above_floor,
        points: points.len(),
        stable: points.iter().filter(|point| point.stable).count(),
        screen: joint.weights.iter().filter(|&&w| w >= 0.5).count(),
        doubtful: doubtful.iter().flatten().count(),
    };
    Ok(DisplacementSeries {
        screens: found.screens(&doubtful),
        points,
        screen_range_m: mean(&ranges),
        counts,
    })
}

/// Phases of all passes after the first relative to it, unwrapped, and the pass from which on each point is doubtful.
fn unwrapped(
    passes: &Passes,
    candidates: &[Candidate],
    design: &Design,
    graph: &Graph,
) -> (Vec<Vec<f64>>, Vec<Option<usize>>) {
    let mut doubtful = vec![None; candidates.len()];
    let mut sums = vec![0.0; candidates.len()];
    let mut phases = Vec::with_capacity(passes.images.len() - 1);
    for pass in 1..passes.images.len() {
        let difference =
            |c: &Candidate, from: usize| (c.values[pass] * c.values[from].conj()).arg();
        let steps: Vec<f64> = candidates.iter().map(|c| difference(c, pass - 1)).collect();
        let screen = design.of_wrapped(&steps, passes.wavelength_m);
        let left: Vec<f64> = (steps.iter().enumerate())
            .map(|(p, step)| wrapped(step - design.phase(screen, p)))
            .collect();
        let found = unwrap(graph, &left, &design.members);
        for (p, candidate) in candidates.iter().enumerate() {
            sums[p] += found.phases[p] + design.phase(screen, p);
            // Whole turns of the sum, and the phase itself without rounding of many sums.
            let direct = difference(candidate, 0);
            sums[p] = direct + 2.0 * PI * ((sums[p] - direct) / (2.0 * PI)).round();
            if found.doubtful[p] && doubtful[p].is_none() {
                doubtful[p] = Some(pass);
            }
        }
        phases.push(sums.clone());
    }
    (phases, doubtful)
}

fn range(at: [f64; 3], from: [f64; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|i| at[i] - from[i]);
    (x * x + y * y + z * z).sqrt()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Membership of points in stable areas.
fn stable(places: &[[f64; 3]], settings: &Settings) -> Result<Vec<bool>, DisplacementError> {
    let mut stable = vec![false; places.len()];
    for area in &settings.stable {
        let mut count = 0;
        for (stable, &[x, y, _]) in stable.iter_mut().zip(places) {
            if area.contains([x, y]) {
                *stable = true;
                count += 1;
            }
        }
        if count == 0 {
            return Err(DisplacementError::EmptyArea(*area));
        }
    }
    Ok(stable)
}

fn design(
    passes: &Passes,
    settings: &Settings,
    candidates: &[Candidate],
    ranges: &[f64],
    stable: &[bool],
) -> Result<Design, DisplacementError> {
    let levels: Vec<(f64, f64)> = candidates.iter().map(|c| (c.power, c.dispersion)).collect();
    let members = match settings.stable.is_empty() {
        true => vec![true; candidates.len()],
        false => stable.to_vec(),
    };
    let terms = settings.screen.terms();
    let middle = mean(ranges);
    let scale_m = ranges
        .iter()
        .fold(0.0f64, |most, r| most.max((r - middle).abs()));
    let own = || (ranges.iter().zip(&members)).filter_map(|(r, &member)| member.then_some(*r));
    let [low, high] = own().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], r| {
        [low.min(r), high.max(r)]
    });
    if terms == 2 {
        let found = own().count();
        if found < 3 {
            return Err(DisplacementError::TooFewStable { least: 3, found });
        }
        if high - low <= 1e-9 * high {
            return Err(DisplacementError::Ranges(low, high));
        }
    }
    let across = |r: &f64| match terms {
        2 => (r - middle) / scale_m,
        _ => 0.0,
    };
    Ok(Design {
        across: ranges.iter().map(across).collect(),
        deviations: phase_deviations(&levels, passes.images.len()),
        members,
        scale_m,
        terms,
    })
}

/// Fitted screens, for the points of the series.
struct Found<'a> {
    passes: &'a Passes<'a>,
    design: &'a Design,
    joint: &'a Joint,
    /// Factor of variances of each pass after the first.
    excess: &'a [f64],
}

impl Found<'_> {
    /// Series of a point from its unwrapped phases in the passes after the first.
    fn point(&self, p: usize, candidate: &Candidate, phases: &[f64]) -> Point {
        let per_radian = self.passes.wavelength_m / (4.0 * PI);
        let variance = self.design.variance(self.joint, p);
        let mut displacement_m = vec![0.0];
        let mut deviation_m = vec![0.0];
        for ((phase, &screen), excess) in phases.iter().zip(&self.joint.screens).zip(self.excess) {
            displacement_m.push(-per_radian * (phase - self.design.phase(screen, p)));
            deviation_m.push(per_radian * (2.0 * variance * excess).sqrt());
        }
        let times_s = self.passes.times_s;
        let (time, level) = (mean(times_s), mean(&displacement_m));
        let moments = times_s.iter().zip(&displacement_m);
        let (along, square) = moments.fold((0.0, 0.0), |(along, square), (t, d)| {
            let t = t - time;
            (along + t * (d - level), square + t * t)
        });
        let velocity_m_s = along / square;
        let residuals = times_s.iter().zip(&displacement_m).map(|(t, d)| {
            let left = d - level - velocity_m_s * (t - time);
            let (sin, cos) = libm::sincos(left / per_radian);
            Complex64::new(cos, sin)
        });
        let coherence = residuals.sum::<Complex64>().norm() / times_s.len() as f64;
        let excess = 1f64.max(mean(self.excess));
        Point {
            row: candidate.row,
            column: candidate.column,
            position_m: [0.0; 3],
            range_m: 0.0,
            power: candidate.power,
            dispersion: candidate.dispersion,
            phase_deviation_rad: self.design.deviations[p],
            stable: false,
            doubtful_from: None,
            displacement_m,
            deviation_m,
            velocity_m_s,
            velocity_deviation_m_s: per_radian * (variance * excess / square).sqrt(),
            coherence,
        }
    }

    fn screens(&self, doubtful: &[Option<usize>]) -> Vec<PassScreen> {
        let first = PassScreen {
            excess: 1.0,
            ..PassScreen::default()
        };
        let covariance = &self.joint.covariance;
        let scale_m = match self.design.terms {
            2 => self.design.scale_m,
            _ => f64::INFINITY,
        };
        let later = (1..).zip(self.joint.screens.iter().zip(self.excess));
        let later = later.map(|(pass, (&[phase_rad, slope], &excess))| PassScreen {
            phase_rad,
            phase_deviation_rad: (2.0 * excess * covariance[0][0]).sqrt(),
            slope_rad_per_m: slope / scale_m,
            slope_deviation_rad_per_m: (2.0 * excess * covariance[1][1]).sqrt() / scale_m,
            excess,
            doubtful: (doubtful.iter().flatten().filter(|&&from| from <= pass)).count(),
        });
        std::iter::once(first).chain(later).collect()
    }
}
