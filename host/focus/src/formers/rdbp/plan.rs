//! Choice of sub-CPI length, patch size and kernel for an error bound.
//!
//! The precise mode has two errors. One is the kernel error ([`KaiserBessel::error`], in range and in
//! Doppler). The other is the path model error: the residual of [`crate::sub_cpi`]'s linear model,
//! `e_m(p)` metres, causes a phase error of `2 pi f_c e / c`. A pixel's value is the exact sum with each term
//! rotated by that phase. Terms from scatterers elsewhere have phases of their own, so the image's
//! relative RMS error is the RMS of the phase error over pulses. It is evaluated here with
//! the recorded track, including jitter and curvature, at the corners, the midpoints of the sides and the centre of
//! a patch, where it is largest, and for intra-pulse motion at three samples per pulse at their own times. Near antennas the maximum may lie elsewhere,
//! so a patch that is not small compared with its distance from them is sampled more densely. Sizes are chosen on a few sub-CPIs from start to end and patches in the grid's centre and
//! corners. Then every sub-CPI is measured on every patch and halved until its error is small enough. The worst pixel,
//! patch and sub-CPI determine the error, and the bound is met with [`MARGIN_DB`] to spare.

use super::doppler::PULSE_BYTES;
use super::times;
use crate::patch::{self, PatchSize};
use crate::path_model::{Measure, Probe, lengths, patch_sizes};
use crate::read_ahead::BLOCKS_HELD;
use crate::sub_cpi::{self, SubCpi, bins_per_cycle, shared_band};
use crate::{FormError, MARGIN_DB, Reason, Remedy, TimeModel, rounding};
use subaperture_kernels::map::row_length;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Band, Collection};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::scaled_dft::Shape;

/// Request for a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Pulses per sub-CPI; `None` to plan it.
    pub sub_cpi: Option<usize>,
    /// Side of a patch, metres; `None` to plan it.
    pub patch_m: Option<f64>,
    /// Memory limit for the tables, one thread's map and the pulses of a sub-CPI, bytes.
    pub memory_bytes: u64,
}

/// Plan of the precise mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Frequency band shared by all pulses.
    pub band: Band,
    /// Sub-CPIs in order; together they contain every pulse once.
    pub sub_cpis: Vec<SubCpi>,
    /// Pulses in the longest sub-CPI.
    pub sub_cpi_length: usize,
    /// Patch size, pixels.
    pub patch: PatchSize,
    /// Taps of the kernel in each direction.
    pub taps: usize,
    /// Sample interval in units of the pulse interval for intra-pulse motion; `None` without such motion.
    pub pulses_a_sample: Option<f64>,
    /// Predicted relative RMS error of the image, dB.
    pub predicted_db: f64,
}

/// Relative RMS error of transforms and phases in float32, and of polynomial kernel weights: at most 1e-6 each.
const ARITHMETIC: f64 = 3e-6;

/// With fewer samples or pulses, all may lie where the kernel error is largest.
const FEW: usize = 16;

/// Relative RMS error of map interpolation with `taps` taps in range and in Doppler.
fn kernel_error(taps: usize, num_samples: usize, num_pulses: usize) -> f64 {
    let kernel = KaiserBessel::new(taps);
    // Both grids are twice as fine as the full band requires.
    let of = |count: usize| match count {
        // A single sample lies at the centre.
        1 => kernel.largest_error(0.0),
        2..FEW => kernel.largest_error(0.25),
        _ => kernel.error(0.25),
    };
    libm::hypot(of(num_samples), of(num_pulses))
}

impl Plan {
    /// Make a plan for `grid`.
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

    /// Make a plan with a given timing model.
    ///
    /// # Errors
    /// Errors of [`Self::new`].
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
                "expected sub-CPIs of at least one pulse and patches with a side above 0 m"
                    .to_owned(),
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
        // A length given by the user is evaluated but not changed.
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
        } = Cut::new(&probe, &best, smaller, allowed)?;
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

/// Aperture divided into sub-CPIs, each measured on every patch.
struct Cut {
    patch: PatchSize,
    sub_cpis: Vec<SubCpi>,
    model_error: f64,
}

impl Cut {
    /// Start from `best` and halve sub-CPIs until the error of each is at most `allowed`. Use the first patch size of `smaller` for which this
    /// succeeds.
    fn new(
        probe: &Probe,
        best: &Choice,
        mut smaller: impl Iterator<Item = PatchSize>,
        allowed: f64,
    ) -> Result<Self, FormError> {
        let num_pulses = probe.collection.pulses.len();
        let mut patch = smaller.next().unwrap_or(best.patch);
        loop {
            check_patches(probe.grid, patch, num_pulses.div_ceil(best.length))?;
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
                return Ok(cut);
            }
            // A single pulse also has a model error if its samples are taken at different positions.
            match smaller.next() {
                Some(next) => patch = next,
                None => return Ok(cut),
            }
        }
    }
}

/// Refuse a number of patches and sub-CPIs whose planning would take more than some minutes.
fn check_patches(grid: &ImageGrid, patch: PatchSize, sub_cpis: usize) -> Result<(), FormError> {
    let counts = [
        grid.rows.count.div_ceil(patch.rows),
        grid.columns.count.div_ceil(patch.columns),
    ];
    let patches = counts[0] as f64 * counts[1] as f64;
    if patches <= MAX_PATCHES && patches * sub_cpis as f64 <= MAX_MAPS {
        return Ok(());
    }
    let why = format!(
        "the plan needs {patches:.1e} patches of {} x {} pixels in {sub_cpis} sub-CPIs: expected at most \
         {MAX_PATCHES:.0e} patches and {MAX_MAPS:.0e} range-Doppler maps",
        patch.rows, patch.columns
    );
    let remedies = [Remedy::FewerPixels, Remedy::OtherFormer(&["bp"])];
    Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)))
}

/// Largest Doppler extent of a patch, cycles per pulse, for which a map is made. One cycle is the unambiguous extent; near antennas rates reach a few.
pub(super) const MAX_SPAN: f64 = 1e4;

/// Largest numbers of patches, and of patches times sub-CPIs, in a plan.
const MAX_PATCHES: f64 = 4e6;
const MAX_MAPS: f64 = 3e7;

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
    /// Best combination of the lengths, shortest first, and patch sizes, largest first, for an error of `target`.
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
            // A longer sub-CPI never permits a larger patch.
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
                        fits: span < MAX_SPAN
                            && bytes(probe, model, length, taps, span) <= memory_bytes,
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

    /// Rank candidates: first by fitting in memory, then by meeting the bound, then by cost, or by error if the bound is out
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

/// Approximate number of Doppler bins of a patch's map.
fn doppler_bins(probe: &Probe, length: usize, taps: usize, doppler_span: f64) -> f64 {
    let sweep_pulses = probe.pulses_a_sample.unwrap_or(0.0).abs() * probe.band.count as f64;
    let bins_per_cycle = bins_per_cycle(probe.band, length as f64 + sweep_pulses);
    (doppler_span * bins_per_cycle).ceil() + taps as f64 + 2.0
}

/// Approximate memory of the tables, one thread's buffers and the buffered pulses of sub-CPIs, bytes.
fn bytes(probe: &Probe, model: &TimeModel, length: usize, taps: usize, doppler_span: f64) -> u64 {
    let bins = doppler_bins(probe, length, taps, doppler_span);
    if bins > 1e12 {
        return u64::MAX;
    }
    let (bins, count) = (bins as usize, probe.band.count);
    // One additional row is being transformed.
    let map = (bins as u64 + 1) * row_length(fast_length(2 * count)) as u64;
    // Approximate bins around zero Doppler.
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

/// Approximate single-core time of the image, ns.
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
