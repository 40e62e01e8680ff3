//! Width and squint of the beam from the azimuth Doppler spectrum of a strip.
//!
//! After the reference path phase is restored, sample `k` of pulse `n` is a sum of echoes whose phase advances from pulse to pulse by
//! `nu = 2 f d sin(theta) / c` turns, where `d` is the pulse spacing and `theta` the angle forward of broadside. In a strip map every point is seen at all
//! angles of the beam. The power spectrum over `nu`, aliased at one turn, is therefore the two-way power pattern plus a noise floor.
//!
//! The circular moments `R_m = sum P(nu) exp(2 pi j m nu)` equal the autocorrelation at a lag of `m` pulses (Wiener and Khinchin). They are summed over the
//! frequencies near the centre. A Gaussian pattern of variance `s^2` about `nu_0` and power `A` over a flat floor gives
//!
//! ```text
//! R_1 = A rho exp(2 pi j nu_0),   |R_2| = A rho^4,   rho = exp(-2 pi^2 s^2)
//! ```
//!
//! The result does not depend on the floor or on aliasing. Hence `rho^3 = |R_2| / |R_1|`. The full half-power width of one antenna's pattern is `4 sqrt(ln 2) s` for a Gaussian
//! pattern and two equal antennas; at its edges the two-way power is a quarter of the peak. For a narrow beam of a uniformly illuminated aperture the moments of `sinc^4` give 0.97 of its width.
//!
//! **Detection.** The spectrum shows a beam if the fitted model, floor included, falls by at least [`CLEAR_DB`] from its peak to half a turn away. The spectrum of a spotlight
//! collection aliases many times and is flat.
//!
//! **Doppler centroid.** One frequency determines the centroid modulo one turn. Over frequency the phase of `R_1` has the slope `2 pi nu_0 / f` of the unambiguous centroid (wavelength diversity, Bamler and
//! Runge 1991). This slope resolves the ambiguity if its standard deviation is less than [`DECIDED`] turns. Otherwise the squint nearest to the expected one is selected among those that illuminate the grid.
//!
//! **Neglected.** Angles at which the ends of the strip truncate the scene have less weight: with only a few scatterers near the ends of the track the spectrum does not match
//! the pattern. Speckle adds variance: the standard deviation over independent segments and frequencies is a few per cent for some thousand
//! samples.

use num_complex::{Complex32, Complex64};

use super::track::Track;
use super::{Beam, BeamSource};
use crate::FormError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_signal::phase::{phasor, widen};

/// Minimum number of pulses for an estimate.
const MIN_PULSES: usize = 64;
/// Relative half-width of the frequency band used for the moments; `nu` varies by the same fraction across it.
const BAND: f64 = 0.025;
/// Approximate samples read at a time: 1 MiB.
const BLOCK_SAMPLES: usize = 1 << 17;
/// Minimum fall of the spectrum of a detected beam, dB.
const CLEAR_DB: f64 = 5.0;
/// Ratio of the full half-power width of one antenna to the standard deviation of the two-way power pattern, `4 sqrt(ln 2)`.
const WIDTH: f64 = 3.330_218_444_630_791;
/// Largest standard deviation of the unambiguous centroid, turns, that resolves the Doppler ambiguity.
const DECIDED: f64 = 0.15;
/// Assumed number of correlated frequency samples per independent one, for scenes that fill a part of the unambiguous range.
const ALIKE: f64 = 4.0;
/// Grid points sampled along each axis.
const SIDE: usize = 5;

/// Estimated beam and its quality.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Estimated width and squint of the beam.
    pub beam: Beam,
    /// Spacing of the ambiguous squint angles near broadside, radians. The Doppler centroid is known modulo the pulse repetition frequency.
    pub ambiguity_rad: f64,
    /// Whether the wavelength diversity of the samples resolves the Doppler ambiguity.
    pub decided: bool,
    /// Fall of the fitted spectrum from its peak to half the pulse repetition frequency away, dB.
    pub fall_db: f64,
}

/// Reason that no beam could be estimated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The track or the spectrum does not fit a strip map; the message gives the reason.
    #[error("the azimuth Doppler spectrum shows no beam: {0}")]
    NoStrip(String),
    /// The azimuth spectrum is too flat to show a beam.
    #[error(
        "the azimuth Doppler spectrum shows no beam: it falls by {fall_db:.1} dB from its centre to half the repetition frequency away, expected at least {CLEAR_DB} dB"
    )]
    Flat {
        /// Fall of the fitted spectrum, dB; 0 if it is not finite.
        fall_db: f64,
    },
    /// Reading failed or the estimate was cancelled.
    #[error(transparent)]
    Form(#[from] FormError),
}

/// Range of aspect angles over a grid, as sines of the angle forward of broadside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demanded {
    /// Smallest sine over all pulses and grid points.
    pub least: f64,
    /// Largest sine over all pulses and grid points.
    pub most: f64,
    /// Full interval that the pulse spacing samples without azimuth ambiguity. A grid seen over a larger interval shows ghosts unless a beam limits
    /// the pulses used for each point.
    pub unambiguous: f64,
    /// Largest interval of sines over the grid at one pulse. Where it exceeds `unambiguous`, points of the grid are ambiguous with each other.
    pub across: f64,
    /// Distance after which a point at the middle of the grid repeats along the track, metres.
    pub repeat_m: f64,
}

/// Compute the range of aspect angles over a grid; `None` for a track that is curved or unevenly sampled.
pub fn demanded(history: &dyn PhaseHistory, grid: &ImageGrid) -> Option<Demanded> {
    let collection = history.collection();
    crate::check(collection, grid).ok()?;
    let track = Track::of(collection, &any(history)).ok()?;
    let step_m = track.even_step_m().ok()?;
    let last = track.len() - 1;
    let span = |place_m| (track.sine(0, place_m) - track.sine(last, place_m)).abs();
    let centre_hz = collection.pulses[0].frequency_hz(collection.num_samples / 2);
    let unambiguous = SPEED_OF_LIGHT_M_S / (2.0 * centre_hz * step_m);
    let at_once = |n: usize| {
        let sines = places(grid).map(|place_m| track.sine(n, place_m));
        let ends = sines.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], sine| {
            [low.min(sine), high.max(sine)]
        });
        ends[1] - ends[0]
    };
    let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
    Some(Demanded {
        across: [0, last / 2, last]
            .map(at_once)
            .into_iter()
            .fold(0.0, f64::max),
        repeat_m: unambiguous * track.nearest_m(middle_m),
        least: places(grid).map(span).fold(f64::INFINITY, f64::min),
        most: places(grid).map(span).fold(0.0, f64::max),
        unambiguous,
    })
}

fn any(history: &dyn PhaseHistory) -> Beam {
    Beam {
        target: history.target().cloned(),
        ..Beam::new(1.0, 0.0, BeamSource::Estimated)
    }
}

/// Grid points sampled for the angle range.
fn places(grid: &ImageGrid) -> impl Iterator<Item = glam::DVec3> + '_ {
    let at = |count: usize, i: usize| i * (count - 1) / (SIDE - 1);
    (0..SIDE * SIDE).map(move |i| {
        grid.position_m(
            at(grid.rows.count, i / SIDE),
            at(grid.columns.count, i % SIDE),
        )
    })
}

/// Estimate width and squint of the beam from the azimuth Doppler spectrum. A given `expected_rad` selects the nearest ambiguous squint. Otherwise the squint
/// resolved by wavelength diversity is used, or else the squint nearest to broadside. Only squints that illuminate the grid are considered.
///
/// # Errors
/// [`EstimateError`].
pub fn estimate(
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    expected_rad: Option<f64>,
    monitor: &dyn Monitor,
) -> Result<Estimate, EstimateError> {
    let collection = history.collection();
    crate::check(collection, grid)?;
    let track = Track::of(collection, &any(history))?;
    let step_m = track.even_step_m().map_err(EstimateError::NoStrip)?;
    if track.len() < MIN_PULSES {
        return Err(EstimateError::NoStrip(format!(
            "expected at least {MIN_PULSES} pulses, found {}",
            track.len()
        )));
    }
    let Moments {
        all,
        first,
        second,
        turns,
    } = moments(history, monitor)?;
    let rho = libm::cbrt(second.norm() / first.norm()).min(1.0);
    let deviation = (-libm::log(rho) / 2.0).max(0.0).sqrt() / std::f64::consts::PI;
    // Mean levels per turn of the pattern and the noise floor.
    let power = first.norm() / rho;
    let floor = (all - power).max(0.0);
    let level = |off: f64| {
        let folds = (-8..=8).map(|m| {
            let x = (off + f64::from(m)) / deviation;
            libm::exp(-0.5 * x * x)
        });
        floor + power * folds.sum::<f64>() / (deviation * std::f64::consts::TAU.sqrt())
    };
    let fall_db = 10.0 * libm::log10(level(0.0) / level(0.5));
    if !(fall_db >= CLEAR_DB && deviation > 0.0) {
        return Err(EstimateError::Flat {
            fall_db: if fall_db.is_finite() { fall_db } else { 0.0 },
        });
    }
    let centre_hz = collection.pulses[0].frequency_hz(collection.num_samples / 2);
    let ambiguity = SPEED_OF_LIGHT_M_S / (2.0 * centre_hz * step_m);
    let centre = angle(first) / std::f64::consts::TAU;
    // The unambiguous centroid must agree with the aliased centroid within a few hundredths of a turn.
    let decided = turns.filter(|&[turns, deviation]| {
        let fraction = turns - centre - (turns - centre).round();
        deviation < DECIDED && fraction.abs() < 2.0 * DECIDED
    });
    let expected = match (expected_rad, decided) {
        (Some(expected_rad), _) => libm::sin(expected_rad),
        (None, Some([turns, _])) => turns * ambiguity,
        (None, None) => 0.0,
    };
    let nearest = (expected / ambiguity - centre).round();
    let beam_at = |fold: f64| {
        let middle = (centre + fold) * ambiguity;
        let half = 0.5 * WIDTH * deviation * ambiguity;
        let [from, to] =
            [middle - half, middle + half].map(|sine| libm::asin(sine.clamp(-1.0, 1.0)));
        let within = middle - half > -1.0 && middle + half < 1.0;
        within.then(|| Beam {
            target: history.target().cloned(),
            ..Beam::new(to - from, 0.5 * (from + to), BeamSource::Estimated)
        })
    };
    let mut folds: Vec<f64> = (-16..=16).map(|m| nearest + f64::from(m)).collect();
    folds.sort_by(|a, b| {
        let off = |fold: f64| ((centre + fold) * ambiguity - expected).abs();
        off(*a).total_cmp(&off(*b))
    });
    for beam in folds.into_iter().filter_map(beam_at) {
        for place_m in places(grid) {
            if !track.seeing(&beam, place_m)?.is_empty() {
                let middle = libm::sin(beam.squint_rad) / ambiguity;
                let own = |[turns, _]: [f64; 2]| (turns - middle).abs() < 0.5;
                return Ok(Estimate {
                    beam,
                    decided: decided.is_some_and(own),
                    ambiguity_rad: libm::asin(ambiguity.min(1.0)),
                    fall_db,
                });
            }
        }
    }
    Err(EstimateError::NoStrip(
        "the grid is outside the beam at every squint that the Doppler centroid allows".to_owned(),
    ))
}

/// Circular moments of the azimuth spectrum (autocorrelation over pulses).
struct Moments {
    all: f64,
    first: Complex64,
    second: Complex64,
    /// Unambiguous centroid at the centre frequency, turns per pulse, from the phase slope of the first moment over frequency, and its standard deviation.
    turns: Option<[f64; 2]>,
}

fn moments(history: &dyn PhaseHistory, monitor: &dyn Monitor) -> Result<Moments, FormError> {
    let collection = history.collection();
    let (count, width) = (collection.pulses.len(), collection.num_samples);
    let pulse = &collection.pulses[0];
    let centre_hz = pulse.frequency_hz(width / 2);
    let off: Vec<f64> = (0..width)
        .map(|k| pulse.frequency_hz(k) / centre_hz - 1.0)
        .collect();
    // Moments per frequency: power, lag one, lag two.
    let mut sums = vec![(0.0, Complex64::ZERO, Complex64::ZERO); width];
    // Samples of the two preceding pulses.
    let mut before = [(); 2].map(|()| vec![Complex64::ZERO; width]);
    let block = (BLOCK_SAMPLES / width.max(1)).clamp(1, count);
    let mut rows = vec![Complex32::ZERO; block * width];
    for from in (0..count).step_by(block) {
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        let pulses = from..(from + block).min(count);
        let rows = &mut rows[..pulses.len() * width];
        history.read(pulses.clone(), rows)?;
        for (pulse, row) in collection.pulses[pulses]
            .iter()
            .zip(rows.chunks_exact(width))
        {
            let [last, last_but_one] = &mut before;
            for (k, sum) in sums.iter_mut().enumerate() {
                let turns = pulse.frequency_hz(k) * pulse.reference_path_m / SPEED_OF_LIGHT_M_S;
                let value = widen(row[k]) * phasor(-turns);
                sum.0 += value.norm_sqr();
                sum.1 += value * last[k].conj();
                sum.2 += value * last_but_one[k].conj();
                (last_but_one[k], last[k]) = (last[k], value);
            }
        }
    }
    let near = || {
        sums.iter()
            .zip(&off)
            .filter(|(_, off)| off.abs() <= BAND)
            .map(|(sum, _)| sum)
    };
    let first: Complex64 = near().map(|sum| sum.1).sum();
    let by_frequency = sums.iter().zip(&off).map(|(sum, &off)| {
        let turned = sum.1 * first.conj();
        [off, angle(turned), sum.1.norm()]
    });
    Ok(Moments {
        all: near().map(|sum| sum.0).sum(),
        first,
        second: near().map(|sum| sum.2).sum(),
        turns: slope(&by_frequency.collect::<Vec<_>>()),
    })
}

/// Slope of phase (radians) over position in turns, and its standard deviation. Each point is (position, phase, weight).
fn slope(points: &[[f64; 3]]) -> Option<[f64; 2]> {
    let weights: f64 = points.iter().map(|[.., w]| w).sum();
    let mean = |i: usize| points.iter().map(|p| p[i] * p[2]).sum::<f64>() / weights;
    let [at, phase_rad] = [mean(0), mean(1)];
    let moment = |f: &dyn Fn(f64, f64) -> f64| {
        points
            .iter()
            .map(|p| p[2] * f(p[0] - at, p[1] - phase_rad))
            .sum::<f64>()
            / weights
    };
    let spread = moment(&|x, _| x * x);
    let slope = moment(&|x, y| x * y) / spread;
    let left = moment(&|x, y| (y - slope * x).powi(2));
    let independent = points.len() as f64 / ALIKE - 2.0;
    let deviation = (left / (spread * independent)).sqrt();
    let turns = [slope, deviation].map(|rad| rad / std::f64::consts::TAU);
    (independent > 0.0 && turns.iter().all(|x| x.is_finite())).then_some(turns)
}

/// Angle of `z`, radians: the same on every platform.
fn angle(z: Complex64) -> f64 {
    libm::atan2(z.im, z.re)
}
