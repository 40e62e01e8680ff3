//! Choosing sub-CPI length, patch size and kernel from a bound on the error.
//!
//! The precise mode has two errors. One is the kernel's ([`KaiserBessel::error`], in range and in
//! Doppler). The other is the path model's: what [`crate::sub_cpi`]'s straight line leaves,
//! `e_m(p)` metres, a phase error of `2 pi f_c e / c`. A pixel's value is the exact sum with each term
//! turned by that phase; since terms from scatterers elsewhere have phases of their own, the image's
//! relative RMS error is the RMS of the phase error over pulses. It is evaluated here with
//! the track as recorded, so jitter and curvature count as they are, at the corners, the sides' middles and the centre of
//! a patch, and where samples are taken one after another at three of them a pulse, at their own moments. There it is largest; near antennas it may be elsewhere, so a patch that is not small against its distance from them is
//! looked at more closely. Sizes are chosen on a few sub-CPIs from start to end and patches in the grid's middle and
//! corners; then every sub-CPI is measured on every patch, and one that errs by more is halved until it does not. The worst pixel,
//! patch and sub-CPI decide, and the bound is met with [`MARGIN_DB`] to spare.

use super::doppler::PULSE_BYTES;
use super::times;
use crate::patch::{self, PatchSize};
use crate::path_model::{Measure, Probe, lengths, patch_sizes};
use crate::read_ahead::BLOCKS_HELD;
use crate::sub_cpi::{self, SubCpi, bins_per_cycle, shared_band};
use crate::{FormError, MARGIN_DB, TimeModel, rounding};
use subaperture_kernels::map::row_length;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Band, Collection};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::scaled_dft::Shape;

/// What is wanted of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Pulses a sub-CPI, if given.
    pub sub_cpi: Option<usize>,
    /// Side of a patch in metres, if given.
    pub patch_m: Option<f64>,
    /// Bytes that the tables, one thread's map and the pulses of a sub-CPI may take.
    pub memory_bytes: u64,
}

/// A way to form the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The band shared by all pulses.
    pub band: Band,
    /// The sub-CPIs, in order; every pulse is in one.
    pub sub_cpis: Vec<SubCpi>,
    /// Pulses in the longest sub-CPI.
    pub sub_cpi_length: usize,
    /// Pixels a patch.
    pub patch: PatchSize,
    /// Taps of the kernel in each direction.
    pub taps: usize,
    /// From sample to sample, in pulses, where samples are taken one after another in motion.
    pub pulses_a_sample: Option<f64>,
    /// Predicted relative RMS error of the image, dB.
    pub predicted_db: f64,
}

/// Relative RMS error of the transforms and phases in float32, and of the kernels' weights by polynomials: 1e-6 each, or less.
const ARITHMETIC: f64 = 3e-6;

/// Samples or pulses fewer than these may all lie where the kernel is worst.
const FEW: usize = 16;

/// Relative RMS error of reading maps with `taps` taps in range and in Doppler.
fn kernel_error(taps: usize, num_samples: usize, num_pulses: usize) -> f64 {
    let kernel = KaiserBessel::new(taps);
    // Both grids are twice as fine as the whole band needs.
    let of = |count: usize| match count {
        // One alone lies in the middle.
        1 => kernel.largest_error(0.0),
        2..FEW => kernel.largest_error(0.25),
        _ => kernel.error(0.25),
    };
    libm::hypot(of(num_samples), of(num_pulses))
}

impl Plan {
    /// Plans for `grid`.
    ///
    /// If no allowed choice meets the bound, the most accurate one is returned: compare
    /// `predicted_db` with the request.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the pulses do not share one band, or a given length is zero.
    pub fn new(
        collection: &Collection,
        grid: &ImageGrid,
        request: &Request,
    ) -> Result<Self, FormError> {
        Self::by(&TimeModel::DEFAULT, collection, grid, request)
    }

    /// The same by a time model of its own.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn by(
        model: &TimeModel,
        collection: &Collection,
        grid: &ImageGrid,
        request: &Request,
    ) -> Result<Self, FormError> {
        let band = shared_band(collection)?;
        if request.sub_cpi == Some(0)
            || request
                .patch_m
                .is_some_and(|side| side.is_nan() || side <= 0.0)
        {
            return Err(FormError::unsuited(
                "a sub-CPI needs at least one pulse and a patch a positive side".to_owned(),
            ));
        }
        let num_pulses = collection.pulses.len();
        let breaks = sub_cpi::breaks(collection);
        let lengths = match request.sub_cpi {
            Some(length) => vec![length.min(num_pulses)],
            None => lengths(num_pulses),
        };
        let patches = match request.patch_m {
            Some(side_m) => vec![PatchSize::from_metres(grid, side_m)],
            None => patch_sizes(grid),
        };
        let probe = Probe {
            collection,
            grid,
            band: &band,
            breaks: &breaks,
            pulses_a_sample: collection
                .sweeps()
                .then(|| sub_cpi::pulses_a_sample(collection)),
            measure: Measure::Worst,
        };
        let target = libm::pow(10.0, (request.error_db - MARGIN_DB) / 20.0);
        let best = Choice::best(
            &probe,
            model,
            &lengths,
            &patches,
            target,
            request.memory_bytes,
        );
        // A given length is the user's word; it is measured, not changed.
        let allowed = match request.sub_cpi {
            Some(_) => f64::INFINITY,
            None => (target * target - best.kernel_error * best.kernel_error)
                .max(0.0)
                .sqrt(),
        };
        let smaller = patches.into_iter().skip_while(|&patch| patch != best.patch);
        let Cut {
            patch,
            sub_cpis,
            model_error,
        } = Cut::new(&probe, &best, smaller, allowed);
        let rounding = libm::hypot(ARITHMETIC, rounding::sum(sub_cpis.len()));
        Ok(Self {
            band,
            sub_cpi_length: sub_cpis.iter().map(SubCpi::num_pulses).max().unwrap_or(0),
            sub_cpis,
            patch,
            taps: best.taps,
            pulses_a_sample: probe.pulses_a_sample,
            predicted_db: rounding::total_db(&[model_error, best.kernel_error, rounding]),
        })
    }
}

/// The aperture in sub-CPIs, every one measured on every patch.
struct Cut {
    patch: PatchSize,
    sub_cpis: Vec<SubCpi>,
    model_error: f64,
}

impl Cut {
    /// By `best`, sub-CPIs halved until each errs by what is `allowed`, and the patch the first of `smaller` on which that is
    /// so.
    fn new(
        probe: &Probe,
        best: &Choice,
        mut smaller: impl Iterator<Item = PatchSize>,
        allowed: f64,
    ) -> Self {
        let num_pulses = probe.collection.pulses.len();
        let mut patch = smaller.next().unwrap_or(best.patch);
        loop {
            let rectangles = patch::rectangles(probe.grid, patch);
            let mut sub_cpis = Vec::new();
            let mut model_error = 0.0f64;
            for pulses in sub_cpi::cut(num_pulses, probe.breaks, best.length) {
                let worst = probe.halve_until(allowed, &rectangles, pulses, &mut sub_cpis);
                model_error = model_error.max(worst);
            }
            let cut = Self {
                patch,
                sub_cpis,
                model_error,
            };
            if model_error <= allowed {
                return cut;
            }
            // A pulse alone has something to model too, where its samples are taken at different places.
            match smaller.next() {
                Some(next) => patch = next,
                None => return cut,
            }
        }
    }
}

#[derive(Clone, Copy)]
struct Choice {
    length: usize,
    patch: PatchSize,
    taps: usize,
    kernel_error: f64,
    error: f64,
    cost: f64,
    fits: bool,
    meets: bool,
}

impl Choice {
    /// The best of some lengths, the shortest first, and patches, the largest first, for an error of `target`.
    fn best(
        probe: &Probe,
        model: &TimeModel,
        lengths: &[usize],
        patches: &[PatchSize],
        target: f64,
        memory_bytes: u64,
    ) -> Self {
        let num_pulses = probe.collection.pulses.len();
        let kernels = [4, 6].map(|taps| (taps, kernel_error(taps, probe.band.count, num_pulses)));
        let mut best: Option<Self> = None;
        let mut first_patch = 0;
        for &length in lengths {
            // A longer sub-CPI never allows a larger patch.
            for (i, &patch) in patches.iter().enumerate().skip(first_patch) {
                let probed = probe.run(length, patch);
                for (taps, kernel_error) in kernels {
                    let span = probed.doppler_span;
                    let error = libm::hypot(probed.model_error, kernel_error);
                    let choice = Self {
                        length,
                        patch,
                        taps,
                        kernel_error,
                        error,
                        cost: time_ns(probe, model, length, patch, taps, span),
                        fits: bytes(probe, model, length, taps, span) <= memory_bytes,
                        meets: error <= target,
                    };
                    if best.is_none_or(|b| choice.better_than(&b)) {
                        best = Some(choice);
                    }
                }
                if probed.model_error <= target {
                    first_patch = i;
                    break;
                }
            }
        }
        best.expect("there is at least one length and one patch")
    }

    /// Fitting in memory comes first, then meeting the bound; then cost, or error where the bound is out
    /// of reach.
    fn better_than(&self, other: &Self) -> bool {
        if self.fits != other.fits {
            return self.fits;
        }
        match (self.meets, other.meets) {
            (true, true) => self.cost < other.cost,
            (false, false) => self.error < other.error,
            (meets, _) => meets,
        }
    }
}

/// Doppler bins of a patch's map, about.
fn doppler_bins(probe: &Probe, length: usize, taps: usize, doppler_span: f64) -> f64 {
    let sweep_pulses = probe.pulses_a_sample.unwrap_or(0.0).abs() * probe.band.count as f64;
    let bins_per_cycle = bins_per_cycle(probe.band, length as f64 + sweep_pulses);
    (doppler_span * bins_per_cycle).ceil() + taps as f64 + 2.0
}

/// Bytes of the tables, one thread's buffers and the pulses of the sub-CPIs that are read for them, about.
fn bytes(probe: &Probe, model: &TimeModel, length: usize, taps: usize, doppler_span: f64) -> u64 {
    let bins = doppler_bins(probe, length, taps, doppler_span);
    if bins > 1e12 {
        return u64::MAX;
    }
    let (bins, count) = (bins as usize, probe.band.count);
    // A row more is in transform.
    let map = (bins as u64 + 1) * row_length(fast_length(2 * count)) as u64;
    // The bins about zero that there will be, a few more or less.
    let shape = Shape {
        inputs: length,
        input_centre: (length as f64 - 1.0) / 2.0,
        input_drift: 0.0,
        outputs: bins | 1,
        output_centre: (bins / 2) as f64,
        spacing: 1.0,
    };
    let pulses = length * (8 * BLOCKS_HELD * count + PULSE_BYTES);
    times::table_bytes(model, count, &shape) + 8 * map + pulses as u64
}

/// Rough time of the image in nanoseconds of one core.
fn time_ns(
    probe: &Probe,
    model: &TimeModel,
    length: usize,
    patch: PatchSize,
    taps: usize,
    doppler_span: f64,
) -> f64 {
    let bins = doppler_bins(probe, length, taps, doppler_span);
    let map = times::map_ns(model, length as f64, probe.band.count as f64, bins);
    let pixels = (patch.rows * patch.columns) as f64 * times::pixel_ns(model, taps as f64);
    let patches = probe.grid.rows.count.div_ceil(patch.rows)
        * probe.grid.columns.count.div_ceil(patch.columns);
    let sub_cpis = probe.collection.pulses.len().div_ceil(length);
    (patches * sub_cpis) as f64 * (map + pixels)
}
