//! Second comparison with the exact sum, at pixels drawn by local power.
//!
//! Evenly spread pixels miss an error concentrated in few pixels: a side lobe of a scatterer just outside the grid, or a bright point on a
//! dark background. Such errors lie where the image has its power, and the image is known once it is formed. An equal number of pixels
//! is therefore drawn, each with a probability proportional to `q`, the mean power of its 3 x 3 neighbourhood and of the image together. With `m` of
//! `N` pixels spread evenly and `k` drawn, a pixel is expected `d = m / N + k q / sum(q)` times in both sets together, and
//!
//! ```text
//! E = sum_i e_i / d_i
//! ```
//!
//! over all compared pixels is an unbiased estimate of the sum of the squared errors `e` of all pixels (multiple importance
//! sampling by the balance heuristic: Veach and Guibas 1995). Its variance is that of the mean of `(sum t)^2 / sum t^2` equal terms
//! with `t_i = e_i / d_i`. [`Estimate::upper`] lies [`DEVIATIONS`] standard deviations above it.
//!
//! Sampling is systematic: every run draws the same pixels, for any number of threads. Each tile of an image keeps its own draws in its
//! record, and the compared pixels are selected from them by the tile's share of the power.

use num_complex::{Complex32, Complex64};

use super::cost::{StageCost, transform};
use super::drawn::MOST_DRAWS;
use super::sampled::{ComparedPixel, Probes, TileRecord, sampled_pixels};
use super::stages::SAMPLES;
use super::{FormError, ImageSpec, Tile};
use subaperture_model::image::ImageSource;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;

/// Number of drawn pixels compared at first.
pub(super) const DRAWS: usize = MOST_DRAWS / 4;

/// Standard deviations between the estimate and its upper limit.
const DEVIATIONS: f64 = 3.0;

/// Approximate samples read at a time: 1 MiB.
const BLOCK_SAMPLES: usize = 1 << 17;

/// Estimate of the summed squared error of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    /// Sum of squared errors over all pixels.
    pub(super) error: f64,
    /// Effective number of equal terms (same variance).
    terms: f64,
    /// Number of compared pixels.
    pub(super) count: usize,
}

impl Estimate {
    /// Upper confidence limit of the sum of squared errors.
    pub(super) fn upper(&self) -> f64 {
        match self.error > 0.0 {
            true => self.error * (1.0 + DEVIATIONS / self.terms.sqrt()),
            false => 0.0,
        }
    }
}

/// Compare `draws` pixels drawn from all tiles, at most [`MOST_DRAWS`], with the exact sum in another pass over `history`, and estimate the image
/// error from these and the evenly spread pixels. `None` if every pixel was compared already or no pixel was drawn.
///
/// # Errors
/// [`FormError::Read`]; [`FormError::Cancelled`].
pub(super) fn look_again(
    spec: &ImageSpec,
    history: &dyn PhaseHistory,
    records: &[TileRecord],
    draws: usize,
    monitor: &dyn Monitor,
) -> Result<Option<Estimate>, FormError> {
    let total = spec.grid.num_pixels() as usize;
    let spread: Vec<&ComparedPixel> = records.iter().flat_map(|record| &record.seen).collect();
    let power: f64 = records.iter().map(|record| record.drawn.power).sum();
    let chosen = choose(records, power, draws);
    if spread.len() == total || chosen.is_empty() {
        return Ok(None);
    }
    let exact = sums(spec, history, records, &chosen, monitor)?;
    let [even, by_power] = [
        spread.len() as f64 / total as f64,
        chosen.len() as f64 / power,
    ];
    let of_spread = spread.iter().map(|seen| {
        let formed = Complex32::new(seen.formed[0], seen.formed[1]);
        let exact = Complex64::new(seen.exact[0], seen.exact[1]);
        (square_error(formed, exact), seen.about)
    });
    let of_drawn = chosen
        .iter()
        .zip(exact)
        .map(|(&(_, formed, about), exact)| {
            (
                square_error(Complex32::new(formed[0], formed[1]), exact),
                about,
            )
        });
    let (mut sum, mut squares) = (0.0, 0.0);
    for (error, about) in of_spread.chain(of_drawn) {
        let term = error / (even + by_power * about);
        sum += term;
        squares += term * term;
    }
    Ok(Some(Estimate {
        error: sum,
        terms: sum * sum / squares,
        count: spread.len() + chosen.len(),
    }))
}

/// Select `draws` of the drawn pixels by each tile's share of the total power.
fn choose(records: &[TileRecord], power: f64, draws: usize) -> Vec<(usize, [f32; 2], f64)> {
    let mut chosen = Vec::with_capacity(draws);
    if !(power > 0.0 && power.is_finite()) {
        return chosen;
    }
    let step = power / draws as f64;
    let (mut before, mut next) = (0.0, 0.5 * step);
    for drawn in records.iter().map(|record| &record.drawn) {
        while next < before + drawn.power && chosen.len() < draws && !drawn.pixels.is_empty() {
            let place = (next - before) / drawn.power * drawn.pixels.len() as f64;
            chosen.push(drawn.pixels[(place as usize).min(drawn.pixels.len() - 1)]);
            next += step;
        }
        before += drawn.power;
    }
    chosen
}

/// Compute the exact sums at given pixels.
fn sums(
    spec: &ImageSpec,
    history: &dyn PhaseHistory,
    records: &[TileRecord],
    chosen: &[(usize, [f32; 2], f64)],
    monitor: &dyn Monitor,
) -> Result<Vec<Complex64>, FormError> {
    let pixels = chosen.iter().map(|&(pixel, ..)| pixel).collect();
    let probes = Probes::at(*spec, pixels, records.iter().any(|record| record.narrow));
    add_all(&probes, spec, history, monitor)?;
    probes.values().ok_or(FormError::PulsesLeftOut)
}

/// Real operations of a term of the sum: a complex product and a complex sum, and the same where antennas move during the pulse.
const TERM: f64 = 8.0;
const SWEPT_TERM: f64 = 73.0;

/// Cost of comparing an image of `spec` with the exact sum: at the pixels spread evenly, with the range profiles of all pulses, and at
/// as many drawn pixels. An image whose pixels are all compared needs neither profiles nor drawn pixels.
///
/// The second comparison is counted although some images settle without it. Neglected: the comparison of every pixel of a small image that would
/// exceed its bound, at most 0.1 s.
pub(super) fn cost(spec: &ImageSpec) -> StageCost {
    let (pulses, width) = (
        spec.collection.pulses.len() as f64,
        spec.collection.num_samples as f64,
    );
    let model = spec.numerics.model;
    let (term, term_ns) = match spec.collection.sweeps() {
        true => (SWEPT_TERM, model.swept_sum_ns),
        false => (TERM, model.sum_ns),
    };
    let spread = sampled_pixels(spec.grid).len();
    let (compared, profiles) = match spread < spec.grid.num_pixels() as usize {
        true => (spread + DRAWS, pulses),
        false => (spread, 0.0),
    };
    let terms = compared as f64 * pulses * width;
    let doublings = width * libm::log2(width.max(2.0));
    StageCost::new(
        SAMPLES,
        term * terms + profiles * transform(width),
        term_ns * terms + profiles * doublings * model.transform_ns,
    )
}

/// Largest number of terms (pixels x pulses x frequencies) for which every pixel is compared: about 0.1 s.
const MAX_TERMS: f64 = 1e8;

/// Cost factor per term of samples with intra-pulse motion.
const SWEEP_TERMS: f64 = 20.0;

/// Compare every pixel of a small image with the exact sum in another pass over `history`; `None` if the work
/// exceeds the limit.
///
/// # Errors
/// [`FormError::Read`]; [`FormError::Cancelled`]; [`FormError::Sink`] if the image cannot be read.
pub(super) fn look_at_all(
    spec: &ImageSpec,
    history: &dyn PhaseHistory,
    image: &dyn ImageSource,
    monitor: &dyn Monitor,
) -> Result<Option<TileRecord>, FormError> {
    let collection = spec.collection;
    let samples = collection.pulses.len() as f64 * collection.num_samples as f64;
    let each = if collection.sweeps() {
        SWEEP_TERMS
    } else {
        1.0
    };
    if each * samples * spec.grid.num_pixels() as f64 > MAX_TERMS {
        return Ok(None);
    }
    let place = Tile::place_of(spec.grid);
    let pixels = image
        .window(&place.place())
        .map_err(FormError::Sink)?
        .pixels;
    let tile = Tile { place, pixels };
    let probes = Probes::at(*spec, (0..tile.pixels.len()).collect(), false);
    add_all(&probes, spec, history, monitor)?;
    Ok(probes.record(&tile))
}

/// Add all pulses of `history` to the probes.
///
/// # Errors
/// [`FormError::Read`]; [`FormError::Cancelled`].
pub(super) fn add_all(
    probes: &Probes,
    spec: &ImageSpec,
    history: &dyn PhaseHistory,
    monitor: &dyn Monitor,
) -> Result<(), FormError> {
    let (num_pulses, width) = (spec.collection.pulses.len(), spec.collection.num_samples);
    let block = (BLOCK_SAMPLES / width.max(1)).clamp(1, num_pulses.max(1));
    let mut held = Vec::new();
    for first in (0..num_pulses).step_by(block) {
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        let pulses = first..(first + block).min(num_pulses);
        match history.samples_in_memory(pulses.clone()) {
            Some(samples) => probes.add(pulses, samples, monitor),
            None => {
                held.resize(pulses.len() * width, Complex32::ZERO);
                history.read(pulses.clone(), &mut held)?;
                probes.add(pulses, &held, monitor);
            }
        }
    }
    Ok(())
}

/// Squared error of one pixel.
pub(super) fn square_error(formed: Complex32, exact: Complex64) -> f64 {
    (Complex64::new(formed.re.into(), formed.im.into()) - exact).norm_sqr()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawn::SampledPixels;
    use crate::drawn::tests::tile;

    #[test]
    fn tiles_share_draws_by_power() {
        let record = |level: f32| TileRecord {
            power: 0.0,
            seen: Vec::new(),
            terms: 0.0,
            recorded: Default::default(),
            narrow: false,
            drawn: SampledPixels::of(&tile(8, 8, |_, _| level), 50),
            pending: false,
        };
        let records = [record(1.0), record(0.0), record(3.0)];
        let power = records.iter().map(|record| record.drawn.power).sum();
        let chosen = choose(&records, power, DRAWS);
        assert_eq!(chosen.len(), DRAWS);
        let weak = chosen.iter().filter(|chosen| chosen.2 < 3.0).count();
        assert_eq!(weak, DRAWS / 4);
    }
}
