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
//! Runge 1991). This slope resolves the ambiguity if its standard deviation is less than 0.15 turns. Otherwise the squint nearest to the expected one is selected among those that illuminate the grid.
//!
//! **Missing pulses.** Pulses whose samples are all zero, and those absent from an evenly spaced track, are left out: the moments are means over the pairs
//! of pulses that are there.
//!
//! **Neglected.** Angles at which the ends of the strip truncate the scene have less weight: with only a few scatterers near the ends of the track the spectrum does not match
//! the pattern. Speckle adds variance: the standard deviation over independent segments and frequencies is a few per cent for some thousand
//! samples.

use super::moments::{Moments, moments};
use super::track::{Spacing, Track};
use super::{Beam, BeamSource};
use crate::FormError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;

/// Minimum number of pulses for an estimate.
pub(super) const MIN_PULSES: usize = 64;
/// Minimum fall of the spectrum of a detected beam, dB.
const CLEAR_DB: f64 = 5.0;
/// Ratio of the full half-power width of one antenna to the standard deviation of the two-way power pattern, `4 sqrt(ln 2)`.
const WIDTH: f64 = 3.330_218_444_630_791;
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

/// Some beam, relative to the target of the history.
pub(super) fn any(history: &dyn PhaseHistory) -> Beam {
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

/// Standard deviation of the power spectrum in turns and its fall in dB, if it shows a beam.
///
/// # Errors
/// [`EstimateError::Flat`].
pub(super) fn shown(moments: &Moments) -> Result<(f64, f64), EstimateError> {
    let first = moments.first.norm();
    let rho = libm::cbrt(moments.second.norm() / first).min(1.0);
    let deviation = (-libm::log(rho) / 2.0).max(0.0).sqrt() / std::f64::consts::PI;
    // Mean levels per turn of the pattern and the noise floor.
    let power = first / rho;
    let floor = (moments.all - power).max(0.0);
    let level = |off: f64| {
        let folds = (-8..=8).map(|m| {
            let x = (off + f64::from(m)) / deviation;
            libm::exp(-0.5 * x * x)
        });
        floor + power * folds.sum::<f64>() / (deviation * std::f64::consts::TAU.sqrt())
    };
    let fall_db = 10.0 * libm::log10(level(0.0) / level(0.5));
    match fall_db >= CLEAR_DB && deviation > 0.0 {
        true => Ok((deviation, fall_db)),
        false => Err(EstimateError::Flat {
            fall_db: if fall_db.is_finite() { fall_db } else { 0.0 },
        }),
    }
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
    let Spacing { step_m, numbers } = track.spacing().map_err(EstimateError::NoStrip)?;
    if track.len() < MIN_PULSES {
        return Err(EstimateError::NoStrip(format!(
            "expected at least {MIN_PULSES} pulses, found {}",
            track.len()
        )));
    }
    let all = 0..track.len();
    let moments = moments(history, &numbers, std::slice::from_ref(&all), monitor)?;
    let (deviation, fall_db) = shown(&moments)?;
    let centre_hz = collection.pulses[0].frequency_hz(collection.num_samples / 2);
    let ambiguity = SPEED_OF_LIGHT_M_S / (2.0 * centre_hz * step_m);
    let centre = moments.centre();
    let decided = moments.decided();
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
