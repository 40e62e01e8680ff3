//! Precise mode of range-Doppler backprojection, by patches and sub-CPIs.
//!
//! For a patch with centre `q` and a sub-CPI of `M` pulses, with `r_m(q) = path_m(q) -
//! reference_path_m`, `u_m = m - (M - 1) / 2` and `f_c` the frequency of sample `K/2`:
//!
//! ```text
//! y[k][m]   = w_fast[k] w_slow[m] z[m][k] exp(+j 2 pi f_k r_m(q) / c)           compensate to q
//! Y[k][d]   = sum_m y[k][m] exp(+j 2 pi (f_k / f_c) u_m nu_d)                    Keystone and Doppler
//! map[d][l] = sum_k Y[k][d] exp(+j 2 pi (k - K/2) l / L)                         range
//! I(p)     += exp(+j 2 pi f_c a(p) / c) map at (nu = b(p) f_c / c, l = a(p) L step / c)
//! ```
//!
//! where `a(p) + b(p) u_m` is the path to `p` relative to `q` ([`crate::sub_cpi`]). For an exactly
//! linear path, the sum over sub-CPIs would be exact: Keystone leaves no range
//! migration and no edge of the sub-CPI is resampled.
//!
//! `nu_d` and `l` are spaced at half of the Nyquist step (`f_c / 2M f_max`, `L >= 2K`) and interpolated with a
//! Kaiser-Bessel kernel whose roll-off is divided out of the weights before the transforms. Doppler
//! bins cover only the band of the patch. Range is periodic with `c / step`, as in the exact sum.
//!
//! **Intra-pulse motion** ([`subaperture_model::phase_history::Sweep`]). Sample `k` is taken `kappa (k - K/2)` pulses after
//! its pulse, so its slow time is `u_m + kappa (k - K/2)`. Compensation uses the path at that time, and the
//! Doppler transform has a separate centre at each frequency. The only approximation is the linear path
//! within that time, as from pulse to pulse. A sub-CPI lasts longer by one sweep.
//!
//! Neglected: the curvature of the path across the patch (planned, [`super::plan`]) and the periodic images of the kernel.
//!
//! Cost per patch and sub-CPI: `M K` complex multiplications for compensation, `M D K` real multiply-adds and as
//! many for their sines ([`subaperture_kernels::doppler`]), `D` transforms of `2 K`, and about `W^2 + 40` operations per pixel. Memory:
//! tables of `2 M K` float32, a map of `D * 2 K` complex float32 per thread, a block of pulses, the image.

use std::collections::BTreeMap;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::mapper::{Mapper, Shapes};
use super::options::NAME;
use super::plan::{MAX_SPAN, Plan};
use super::{cost, times};
use crate::budget::{Budget, on_threads};
use crate::cost::Cost;
use crate::former_choices::misfit;
use crate::patch::{self, PatchSize, Patches, Rectangle};
use crate::read_ahead::{BLOCKS_HELD, read_ahead};
use crate::sub_cpi::{SubCpi, bins_per_cycle, pulses_a_sample, shared_band};
use crate::{FormError, Forming, ImageSpec, Reason, Remedy, Tile, Work};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Band, Collection};
use subaperture_signal::scaled_dft::Shape;

/// Largest number of buffered pulses; gives threads enough work between reads.
const BLOCK_PULSES: usize = 4096;

/// Remedies where maps and their tables do not fit in memory.
const SMALLER: &[Remedy] = &[Remedy::Smaller(&["patch", "sub_cpi"]), Remedy::MoreMemory];

/// Parameters fixed by a plan.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    /// Number of pulses of each sub-CPI, in order.
    sub_cpis: Vec<usize>,
    patch_rows: usize,
    patch_columns: usize,
    taps: usize,
    /// Largest Doppler over any patch, cycles per pulse, for each sub-CPI length.
    spans: BTreeMap<usize, f64>,
}

impl Choices {
    /// Derive the parameters from `plan`, with Doppler extents evaluated on the whole grid.
    pub(super) fn new(
        spec: &ImageSpec,
        plan: &Plan,
        monitor: &dyn Monitor,
    ) -> Result<Self, FormError> {
        let cycles_m = plan.band.centre_hz() / SPEED_OF_LIGHT_M_S;
        let rectangles = patch::rectangles(spec.grid, plan.patch);
        let mut spans: BTreeMap<usize, f64> = BTreeMap::new();
        for sub_cpi in &plan.sub_cpis {
            if monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
            let widest = rectangles
                .par_iter()
                .map(|rectangle| widest_rate_m(spec.grid, sub_cpi, rectangle))
                .reduce(|| 0.0, f64::max);
            let span = spans.entry(sub_cpi.num_pulses()).or_insert(0.0);
            *span = span.max(widest * cycles_m);
        }
        let widest = spans.values().fold(0.0f64, |most, &span| most.max(span));
        if widest >= MAX_SPAN {
            let why = format!(
                "the path to a patch changes by {widest:.1e} wavelengths from pulse to pulse, range-Doppler maps allow {MAX_SPAN:.0e}"
            );
            let remedies = [Remedy::OtherFormer(&["bp"])];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        Ok(Self {
            sub_cpis: plan.sub_cpis.iter().map(SubCpi::num_pulses).collect(),
            patch_rows: plan.patch.rows,
            patch_columns: plan.patch.columns,
            taps: plan.taps,
            spans,
        })
    }

    /// Shapes of the Doppler transforms for a band of `collection`.
    fn shapes(&self, collection: &Collection, band: &Band) -> Result<Shapes, FormError> {
        let drift = match collection.sweeps() {
            true => pulses_a_sample(collection),
            false => 0.0,
        };
        let mut shapes = Shapes::new();
        for (&inputs, &span) in &self.spans {
            if !(0.0..MAX_SPAN).contains(&span) {
                return Err(misfit(
                    NAME,
                    "expected Doppler extents from 0 to 1e6 cycles per pulse",
                ));
            }
            let sweep_pulses = drift.abs() * band.count as f64;
            let bins_per_cycle = bins_per_cycle(band, inputs as f64 + sweep_pulses);
            // Margin of a tenth and one bin over the sampled points, and the half-width of the kernel.
            let reach = (span * 1.1 * bins_per_cycle).ceil() as usize + 1 + self.kernel_taps() / 2;
            let shape = Shape {
                inputs,
                input_centre: (inputs as f64 - 1.0) / 2.0,
                input_drift: drift,
                outputs: 2 * reach + 1,
                output_centre: reach as f64,
                spacing: 1.0 / bins_per_cycle,
            };
            shapes.insert(inputs, (shape, bins_per_cycle));
        }
        Ok(shapes)
    }

    fn patches(&self, grid: &ImageGrid) -> Patches {
        let size = PatchSize {
            rows: self.patch_rows,
            columns: self.patch_columns,
        };
        Patches::new(grid, size)
    }

    /// Supported number of kernel taps.
    fn kernel_taps(&self) -> usize {
        if self.taps == 4 { 4 } else { 6 }
    }

    /// Tile grain of whole patches, and cost of the image of `spec`.
    pub(super) fn grain_and_cost(&self, spec: &ImageSpec) -> Result<(PatchSize, Cost), FormError> {
        let shapes = self.shapes(spec.collection, &shared_band(spec.collection)?)?;
        let patches = self.patches(spec.grid);
        let longest = self.sub_cpis.iter().max().copied().unwrap_or(1);
        let held = longest * held_at_once(longest, self.sub_cpis.len());
        let taps = self.kernel_taps();
        let cost = cost::precise(spec, &self.sub_cpis, &shapes, &patches, taps, held);
        Ok((patches.size(), cost))
    }

    /// Open these parameters for forming.
    pub(super) fn open<'a>(&self, spec: ImageSpec<'a>) -> Result<Box<dyn Forming + 'a>, FormError> {
        Ok(match self.kernel_taps() {
            4 => Box::new(Opened::<4>::new(spec, self)?),
            _ => Box::new(Opened::<6>::new(spec, self)?),
        })
    }
}

/// Number of sub-CPIs of at most `longest` pulses, of `count`, buffered at once.
fn held_at_once(longest: usize, count: usize) -> usize {
    BLOCK_PULSES.div_ceil(longest).min(count)
}

/// Plan opened for forming.
struct Opened<'a, const W: usize> {
    spec: ImageSpec<'a>,
    band: Band,
    sub_cpis: Vec<SubCpi>,
    /// Pulses of the longest sub-CPI.
    longest: usize,
    patches: Patches,
    shapes: Shapes,
    /// Created once its memory is available.
    mapper: OnceLock<Mapper<'a, W>>,
}

impl<'a, const W: usize> Opened<'a, W> {
    fn new(spec: ImageSpec<'a>, choices: &Choices) -> Result<Self, FormError> {
        let collection = spec.collection;
        let band = shared_band(collection)?;
        let mut first = 0;
        let mut sub_cpis = Vec::with_capacity(choices.sub_cpis.len());
        for &count in &choices.sub_cpis {
            let fits = count > 0 && count <= collection.pulses.len() - first;
            if !fits || !choices.spans.contains_key(&count) {
                return Err(misfit(
                    NAME,
                    "expected sub-CPIs of at least one pulse that cover the pulses",
                ));
            }
            sub_cpis.push(SubCpi::new(collection, first..first + count));
            first += count;
        }
        let patches = choices.patch_rows > 0 && choices.patch_columns > 0;
        if first != collection.pulses.len() || !patches {
            return Err(misfit(
                NAME,
                "expected sub-CPIs that cover all pulses, and patches of at least one pixel",
            ));
        }
        Ok(Self {
            longest: sub_cpis.iter().map(SubCpi::num_pulses).max().unwrap_or(0),
            patches: choices.patches(spec.grid),
            shapes: choices.shapes(collection, &band)?,
            spec,
            band,
            sub_cpis,
            mapper: OnceLock::new(),
        })
    }

    /// Add all sub-CPIs to all tiles, a block of them at a time.
    fn add_blocks(
        &self,
        work: &Work,
        mapper: &Mapper<W>,
        block: usize,
        tiles: &mut [Tile],
    ) -> Result<(), FormError> {
        let num_samples = self.band.count;
        let num_blocks = self.sub_cpis.len().div_ceil(block);
        let mut blocks = self.sub_cpis.chunks(block).enumerate();
        let pulses = |of: &[SubCpi]| of[0].pulses.start..of[of.len() - 1].pulses.end;
        let all = self.sub_cpis.chunks(block).map(pulses);
        read_ahead(work.history, all, |pulses, samples| {
            let Some((index, sub_cpis)) = blocks.next() else {
                return Ok(());
            };
            let done = AtomicUsize::new(0);
            let mut patches = self.patches.split(tiles);
            let count = patches.len();
            patches.par_iter_mut().for_each_init(
                || mapper.scratch(self.longest),
                |scratch, (rectangle, segments)| {
                    for sub_cpi in sub_cpis {
                        if work.monitor.cancelled() {
                            return;
                        }
                        let first = (sub_cpi.pulses.start - pulses.start) * num_samples;
                        let rows = &samples[first..first + sub_cpi.num_pulses() * num_samples];
                        mapper.add(sub_cpi, rows, rectangle, segments, scratch, work.monitor);
                    }
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    let part = done as f64 / count as f64;
                    work.monitor
                        .progress((index as f64 + part) / num_blocks as f64);
                },
            );
            match work.monitor.cancelled() {
                true => Err(FormError::Cancelled),
                false => Ok(()),
            }
        })
    }
}

impl<const W: usize> Forming for Opened<'_, W> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let num_samples = self.band.count;
        let mut budget = Budget::new(work.memory_bytes);
        budget.take(
            "patches",
            self.patches
                .account_bytes(tiles.iter().map(|tile| tile.place))
                .into(),
            &[Remedy::Larger("patch"), Remedy::MoreMemory],
        )?;
        let tables = self
            .shapes
            .values()
            .map(|(shape, _)| times::table_bytes(self.spec.numerics.model, num_samples, shape));
        budget.take("Doppler tables", tables.map(u128::from).sum(), SMALLER)?;
        let mapper = self
            .mapper
            .get_or_init(|| Mapper::new(self.spec, &self.band, &self.shapes));
        // One map per thread, in at most half of the remaining memory; fewer threads work if memory is short.
        let threads = rayon::current_num_threads();
        let workers = budget.take_block(
            "a range-Doppler map",
            mapper.scratch_bytes(self.longest),
            threads,
            SMALLER,
        )?;
        let block = budget.take_block(
            "a sub-CPI",
            (self.longest * num_samples * 8 * BLOCKS_HELD) as u64,
            held_at_once(self.longest, self.sub_cpis.len()),
            &[Remedy::Smaller(&["sub_cpi"]), Remedy::MoreMemory],
        )?;
        on_threads(workers, || self.add_blocks(work, mapper, block, tiles))
    }
}

/// Largest path rate over a patch, metres per pulse, at 5 x 5 of its points.
fn widest_rate_m(grid: &ImageGrid, sub_cpi: &SubCpi, rectangle: &Rectangle) -> f64 {
    let datum = sub_cpi.datum(rectangle.centre_m(grid));
    let fractions = [0.0, 0.25, 0.5, 0.75, 1.0];
    let mut widest = 0.0f64;
    for row in fractions {
        for column in fractions {
            let point = rectangle.point_m(grid, row, column);
            widest = widest.max(sub_cpi.line(&datum, point).1.abs());
        }
    }
    widest
}
