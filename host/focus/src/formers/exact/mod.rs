//! Reference former: the matched filter as a direct sum over all pulses and frequencies.
//!
//! ```text
//! I(p) = sum_n sum_k w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c)
//! ```
//!
//! (Schone 2020, section 1.2), normalised as in [`super`], in float64, with the positions and frequencies of each pulse,
//! and of each sample for intra-pulse motion. There is no approximation: no interpolation, no
//! expansion of range. The sum over `k` is a polynomial in `exp(j 2 pi step path / c)`, evaluated by Horner's rule; its rounding error
//! grows as `num_samples * 1e-16`, far below float32 samples.
//!
//! With intra-pulse motion each sample has its own path and the sum is not a polynomial: it takes one or two square
//! roots, a sine and a cosine per sample.
//!
//! Cost: one complex multiply-add (8 operations) per pixel, pulse and frequency; with intra-pulse motion about 9
//! times as much, and 20 times the time (`cost`). Memory: 16 bytes per pixel in addition to the image, and a block of pulses.
//!
//! Accuracy: images of other formers are compared with this sum when they are formed ([`crate::accuracy`]). It shares kernels and geometry
//! with them, so tests compare all of them with a plain float64 sum without library code (`tests/src/plain_sum.rs`) and with closed
//! forms. The prediction covers the rounding of pixels to float32, and of paths in float64, which matters beyond a million kilometres at 10 GHz.

mod cost;

use std::collections::BTreeMap;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::Entry;
use crate::budget::Budget;
use crate::coverage::Coverage;
use crate::former_choices::FormerChoices;
use crate::patch::PatchSize;
use crate::read_ahead::{BLOCKS_HELD, blocks_of, read_ahead};
use crate::{
    Decision, ErrorGoal, FormError, Forming, GridPoints, ImageFormer, ImageSpec, Remedy, Tile,
    Work, rounding,
};
use subaperture_kernels::horner;
use subaperture_kernels::lanes::Instructions;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::{
    BlockIllumination, PhaseHistory, Pulse, PulseRange, Weights,
};
use subaperture_signal::phase::{narrow, phasor, widen};

/// Former that evaluates the exact sum.
#[derive(Clone, Copy, Debug, Default)]
pub struct Exact;

/// Number of pixels summed together.
pub(crate) const LANES: usize = horner::TOGETHER;

/// Position and float64 sum of a pixel.
const PIXEL_BYTES: u64 = 24 + 16;

pub(super) const ENTRY: Entry = Entry {
    name: "exact",
    summary: "exact sum over pulses and frequencies in float64: slow reference",
    options: &[],
    of: |_| Ok(Box::new(Exact)),
};

impl ImageFormer for Exact {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!({})
    }

    fn bound_db(&self) -> Option<f64> {
        None
    }

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn follows_relief(&self) -> bool {
        true
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        _: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        Ok(Decision {
            choices: FormerChoices::default(),
            settings: serde_json::json!({}),
            planned_db: rounding::total_db(&[
                rounding::LARGEST_FLOAT32,
                rounding::path_phase_rad(spec.collection, spec.grid),
            ]),
            grain: PatchSize::PIXEL,
            cost: cost::cost(spec, PIXEL_BYTES),
        })
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        _: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        Ok(Box::new(Opened { spec }))
    }
}

struct Opened<'a> {
    spec: ImageSpec<'a>,
}

impl Forming for Opened<'_> {
    fn pixel_bytes(&self) -> u64 {
        PIXEL_BYTES
    }

    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let count: usize = tiles.iter().map(|tile| tile.pixels.len()).sum();
        let mut budget = Budget::new(work.memory_bytes);
        budget.take(
            "float64 sums",
            count as u128 * u128::from(PIXEL_BYTES),
            &[Remedy::FewerPixels, Remedy::MoreMemory],
        )?;
        let points: Vec<DVec3> = tiles
            .iter()
            .flat_map(|tile| tile.points(self.spec.grid))
            .collect();
        let weights = self.spec.weights;
        let sums = sum_at(work.history, weights, &points, budget, work.monitor)?;
        let pixels = tiles.iter_mut().flat_map(|tile| &mut tile.pixels);
        pixels
            .zip(sums)
            .for_each(|(pixel, sum)| *pixel = narrow(sum));
        Ok(())
    }
}

impl Exact {
    /// Exact values of the image at `points` (scene frame, metres), in float64.
    ///
    /// # Errors
    /// Errors of [`ImageFormer::form`].
    pub fn at_points(
        history: &dyn PhaseHistory,
        weights: &Weights,
        points: &[DVec3],
        memory_bytes: u64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Complex64>, FormError> {
        sum_at(history, weights, points, Budget::new(memory_bytes), monitor)
    }
}

impl Exact {
    /// Exact values at pixels of a grid (ascending row-major indices). With beam weights each pixel uses the pulses that illuminate it. Pixels
    /// outside the recorded delays are 0 ([`crate::coverage`]).
    ///
    /// # Errors
    /// Errors of [`Self::at_points`].
    pub fn at_pixels(
        history: &dyn PhaseHistory,
        weights: &Weights,
        grid: &ImageGrid,
        pixels: &[usize],
        memory_bytes: u64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Complex64>, FormError> {
        let columns = grid.columns.count;
        let place = |i: &usize| grid.position_m(i / columns, i % columns);
        let points: Vec<DVec3> = pixels.iter().map(place).collect();
        let mut values = match &weights.illumination {
            None => Self::at_points(history, weights, &points, memory_bytes, monitor)?,
            Some(illumination) => {
                let block = |i: &usize| illumination.block_of(i / columns, i % columns);
                let blocks: Vec<usize> = pixels.iter().map(block).collect();
                let task = (history, memory_bytes, monitor);
                let mut values = in_blocks(task, (weights, illumination), &blocks, &points)?;
                let gain = |i: &usize| {
                    let (slow, _) = illumination.slow(block(i));
                    illumination.gain(&slow, i / columns, i % columns)
                };
                let gains: Vec<f64> = pixels.par_iter().map(gain).collect();
                values
                    .iter_mut()
                    .zip(gains)
                    .for_each(|(z, gain)| *z *= gain);
                values
            }
        };
        let spec = ImageSpec::new(history.collection(), grid, weights);
        let coverage = Coverage::new(spec, GridPoints::Positions);
        for (i, value) in pixels.iter().zip(&mut values) {
            if !coverage.covers(i / columns, i % columns) {
                *value = Complex64::ZERO;
            }
        }
        Ok(values)
    }
}

/// Exact values at points, each in one of `blocks`, from the pulses that illuminate its block.
fn in_blocks(
    (history, memory_bytes, monitor): (&dyn PhaseHistory, u64, &dyn Monitor),
    (weights, illumination): (&Weights, &BlockIllumination),
    blocks: &[usize],
    points: &[DVec3],
) -> Result<Vec<Complex64>, FormError> {
    let mut values = vec![Complex64::ZERO; points.len()];
    let mut of_block: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (at, &block) in blocks.iter().enumerate() {
        of_block.entry(block).or_default().push(at);
    }
    for (block, own) in of_block {
        let pulses = illumination.pulses(block);
        if pulses.is_empty() {
            continue;
        }
        let part = PulseRange::new(history, pulses);
        let weights = Weights {
            fast: weights.fast.clone(),
            slow: illumination.slow(block).0.into_owned(),
            illumination: None,
            windows: None,
        };
        let places: Vec<DVec3> = own.iter().map(|&at| points[at]).collect();
        let sums = Exact::at_points(&part, &weights, &places, memory_bytes, monitor)?;
        for (at, sum) in own.into_iter().zip(sums) {
            values[at] = sum;
        }
    }
    Ok(values)
}

fn sum_at(
    history: &dyn PhaseHistory,
    weights: &Weights,
    points: &[DVec3],
    mut budget: Budget,
    monitor: &dyn Monitor,
) -> Result<Vec<Complex64>, FormError> {
    let collection = history.collection();
    let num_samples = collection.num_samples;
    let num_pulses = collection.pulses.len();
    let pulse_bytes = (8 * BLOCKS_HELD * num_samples) as u64;
    let wanted = num_pulses.min(cost::BLOCK_PULSES);
    let remedies = &[Remedy::MoreMemory];
    let block = budget.take_block("a pulse", pulse_bytes, wanted, remedies)?;
    let mut sums = vec![Complex64::ZERO; points.len()];
    read_ahead(history, blocks_of(num_pulses, block), |pulses, samples| {
        let rows: Vec<_> = pulses
            .clone()
            .zip(samples.chunks_exact(num_samples))
            .collect();
        sums.par_chunks_mut(LANES)
            .zip(points.par_chunks(LANES))
            .for_each(|(sums, points)| {
                if monitor.cancelled() {
                    return;
                }
                let _summing = during(monitor, cost::SUM);
                for &(n, row) in &rows {
                    add_pulse(
                        &collection.pulses[n],
                        weights.slow[n],
                        &weights.fast,
                        row,
                        points,
                        sums,
                    );
                }
            });
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        monitor.progress(pulses.end as f64 / num_pulses as f64);
        Ok(())
    })?;
    let norm = weights.normalisation();
    sums.iter_mut().for_each(|z| *z *= norm);
    Ok(sums)
}

/// Add one pulse to at most [`LANES`] pixels.
pub(crate) fn add_pulse(
    pulse: &Pulse,
    slow: f64,
    fast: &[f64],
    row: &[Complex32],
    points: &[DVec3],
    sums: &mut [Complex64],
) {
    if !pulse.sweep.is_at_once() {
        return add_sweep(pulse, slow, fast, row, points, sums);
    }
    let [mut start, mut step] = [[Complex64::ZERO; LANES]; 2];
    for (lane, &point) in points.iter().enumerate() {
        let delay_s = pulse.relative_path_m(point) / SPEED_OF_LIGHT_M_S;
        start[lane] = phasor(pulse.start_hz * delay_s) * slow;
        step[lane] = phasor(pulse.step_hz * delay_s);
    }
    let over_frequency = horner::sums(Instructions::best(), row, fast, &step);
    for (lane, sum) in sums.iter_mut().enumerate() {
        *sum += start[lane] * over_frequency[lane];
    }
}

/// Add one pulse with intra-pulse motion.
fn add_sweep(
    pulse: &Pulse,
    slow: f64,
    fast: &[f64],
    row: &[Complex32],
    points: &[DVec3],
    sums: &mut [Complex64],
) {
    for (k, (&z, w)) in row.iter().zip(fast).enumerate() {
        let after = k as f64 - (row.len() / 2) as f64;
        let reference_m = pulse.reference_path_m + pulse.reference_drift_m(after);
        let cycles_m = pulse.frequency_hz(k) / SPEED_OF_LIGHT_M_S;
        let value = widen(z) * (w * slow);
        for (&point, sum) in points.iter().zip(sums.iter_mut()) {
            let path_m = pulse.path_after_m(point, after) - reference_m;
            *sum += value * phasor(cycles_m * path_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::monitor::Silent;
    use subaperture_model::phase_history::{Collection, InMemory, Sweep};
    use subaperture_signal::window::Window;

    /// Radar at 100 m on the x axis, pulses repeated at one position: the image along x is the transform of
    /// the fast-time window, a Dirichlet kernel, with the phase of the carrier.
    #[test]
    fn stationary_radar_gives_dirichlet_kernel() {
        let (num_samples, num_pulses, start_hz, step_hz) = (32usize, 3usize, 1e9, 2e6);
        let pulse = Pulse {
            time_s: 0.0,
            transmitter_m: DVec3::new(100.0, 0.0, 0.0),
            receiver_m: DVec3::new(100.0, 0.0, 0.0),
            reference_m: DVec3::ZERO,
            reference_path_m: 200.0,
            start_hz,
            step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        let collection = Collection {
            name: "still".to_owned(),
            num_samples,
            pulses: vec![pulse; num_pulses],
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        // A unit scatterer at the reference point: every sample is 1.
        let samples = vec![Complex32::ONE; num_samples * num_pulses];
        let history = InMemory::new(collection.clone(), samples).unwrap();
        let weights = Weights::new(&collection, Window::None, Window::None);
        let xs: Vec<f64> = (0..40).map(|i| f64::from(i) * 0.37 - 7.0).collect();
        let points: Vec<DVec3> = xs.iter().map(|&x| DVec3::new(x, 0.0, 0.0)).collect();
        let got = Exact::at_points(&history, &weights, &points, 1 << 20, &Silent).unwrap();
        for (x, z) in xs.iter().zip(got) {
            // path - reference = -2 x; sum_k exp(j 2 pi (start + k step) (-2 x) / c) / K.
            let turn = -2.0 * x / SPEED_OF_LIGHT_M_S;
            let half = std::f64::consts::PI * step_hz * turn;
            let kernel = if half == 0.0 {
                1.0
            } else {
                (half * num_samples as f64).sin() / (half.sin() * num_samples as f64)
            };
            let middle_hz = start_hz + step_hz * (num_samples as f64 - 1.0) / 2.0;
            let expected = Complex64::cis(std::f64::consts::TAU * middle_hz * turn) * kernel;
            assert!((z - expected).norm() < 1e-12, "{x}: {z} {expected}");
        }
    }
}
