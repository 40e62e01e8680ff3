//! Candidates for sub-CPI, patches and kernel with their estimated cost and error.

use subaperture_core::accumulate::ChipKernel;
use subaperture_core::stream::{Capacity, Patch, Setup};

use super::module_plan::{ModuleCapacity, ModulePlan, ModuleProduct};
use super::ram::{RamBudget, image_bytes, least_capacity};
use super::reach::Reach;
use crate::image::kernels::{Kernels, bands};
use crate::maps::Arithmetic;
use subaperture_focus::patch::{PatchSize, Rectangle, rectangles};
use subaperture_focus::path_model::{Measure, Probe, lengths, patch_sizes};
use subaperture_focus::sub_cpi::{self, SubCpi};
use subaperture_focus::sweep;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Band, Collection};
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

/// Maximum range transform length of a module.
pub(super) const LONGEST_RANGE: usize = 4096;

/// Maximum pulses per sub-CPI, counted once per channel, rows of a map and patches that a module can be built for.
const MAX_PULSES: usize = 4096;
const MAX_ROWS: usize = 4096;
const MAX_PATCHES: usize = 4096;

/// Maximum number of sub-CPIs that estimates evaluate.
const PROBED_SUB_CPIS: usize = 8;

/// Candidate with its estimates.
pub(super) struct Candidate {
    length: usize,
    patch: PatchSize,
    taps: usize,
    /// Samples of all maps if maps are sent; number of maps if detections are; instructions of all maps for an image.
    cost: f64,
    /// Bytes of all buffers.
    pub(super) ram_bytes: u64,
}

impl Candidate {
    /// Cost: samples of maps or instructions first; memory decides between equal ones.
    pub(super) fn cost(&self) -> f64 {
        self.cost + 1e-7 * self.ram_bytes as f64
    }
}

/// Taps of the module's own kernel.
const CHIP_TAPS: usize = ChipKernel::TAPS;

/// Relative RMS error of the module's own kernel in both axes together, -76.8 dB: `subaperture_core::accumulate::ChipKernel`.
const CHIP_KERNEL_ERROR: f64 = 1.45e-4;

/// Widest band of a map, in cycles per bin, that the module's own kernel is made for.
const CHIP_BAND: f64 = 0.25;

/// Instructions of a Keystone unit (pulse, frequency, Doppler bin), and of a butterfly of the range transform, roughly those of
/// a Cortex-M7 in float32.
const UNIT_COST: f64 = 20.0;
const BUTTERFLY_COST: f64 = 10.0;

/// Inputs of the search.
pub(super) struct Search<'a> {
    pub(super) collection: &'a Collection,
    pub(super) grid: &'a ImageGrid,
    pub(super) band: &'a Band,
    pub(super) arithmetic: Arithmetic,
    pub(super) error_db: f64,
    pub(super) product: ModuleProduct,
    pub(super) num_channels: u16,
}

impl Search<'_> {
    /// Taps and error of the kernels that read maps of this setup.
    fn kernels(&self, setup: &Setup) -> Option<(usize, f64)> {
        match self.product {
            ModuleProduct::Maps | ModuleProduct::Detections => {
                let kernels = Kernels::for_bound(setup, self.error_db);
                Some((kernels.range.taps(), kernels.error))
            }
            ModuleProduct::Image => bands(setup)
                .iter()
                .all(|&band| band <= CHIP_BAND)
                .then_some((CHIP_TAPS, CHIP_KERNEL_ERROR)),
        }
    }

    /// Candidate patch sizes, largest first. Fewer patches than threads of the host serve detections best: up to the whole grid.
    fn patch_sizes(&self) -> Vec<PatchSize> {
        let whole = PatchSize {
            rows: self.grid.rows.count,
            columns: self.grid.columns.count,
        };
        let large: &[f64] = match self.product {
            ModuleProduct::Detections => &[1.0, 1.4, 2.0, 2.8],
            ModuleProduct::Maps | ModuleProduct::Image => &[],
        };
        let side_m = whole.side_m(self.grid);
        let large = large
            .iter()
            .map(|parts| PatchSize::from_metres(self.grid, side_m / parts));
        large.chain(patch_sizes(self.grid)).collect()
    }

    /// Bytes of an accumulated image in addition to the buffers for maps.
    fn image_bytes(&self, patches: usize, sub_cpis: usize) -> u64 {
        match self.product {
            ModuleProduct::Maps | ModuleProduct::Detections => 0,
            ModuleProduct::Image => {
                image_bytes(self.grid.num_pixels(), patches as u64, sub_cpis as u64)
            }
        }
    }

    fn range_length(&self) -> usize {
        (2 * self.band.count).next_power_of_two().min(LONGEST_RANGE)
    }

    /// Probe of the path model. The core uses the stop-and-go approximation: intra-pulse motion is added apart.
    fn probe(&self) -> Probe<'_> {
        Probe {
            collection: self.collection,
            grid: self.grid,
            band: self.band,
            breaks: &[],
            pulses_a_sample: None,
            measure: Measure::Mean,
        }
    }

    pub(super) fn range_band(&self) -> f64 {
        (self.band.count / 2) as f64 / self.range_length() as f64
    }

    /// Candidates whose estimated error is below `target`.
    pub(super) fn candidates(&self, target: f64) -> Vec<Candidate> {
        let range_band = self.range_band();
        // Doppler bins are twice as fine as the whole band needs.
        let kernels = TAPS.map(|taps| {
            let error = |band: f64| WindowedSinc::new(taps, band).error(band);
            (taps, error(range_band).hypot(error(0.25)))
        });
        // The share of the error that image formation will assign to the kernels.
        let share = Kernels::share(self.error_db);
        let kernel = match self.product {
            ModuleProduct::Maps | ModuleProduct::Detections => {
                kernels.into_iter().find(|&(_, error)| error <= share)
            }
            ModuleProduct::Image => {
                (CHIP_KERNEL_ERROR <= share).then_some((CHIP_TAPS, CHIP_KERNEL_ERROR))
            }
        };
        let Some((taps, kernel_error)) = kernel else {
            return Vec::new();
        };
        let probe = self.probe();
        let num_pulses = self.collection.pulses.len();
        let patches = self.patch_sizes();
        let swept = sweep::residual(self.collection, self.grid);
        let mut candidates = Vec::new();
        let mut first_patch = 0;
        for length in lengths(num_pulses) {
            if length * usize::from(self.num_channels) > MAX_PULSES {
                break;
            }
            // Errors grow with the patch: a size that keeps the bound implies it for smaller ones. A longer sub-CPI never allows a
            // larger patch.
            let mut errors: Option<f64> = None;
            for (i, &patch) in patches.iter().enumerate().skip(first_patch) {
                let error = match errors {
                    Some(error) => error,
                    None => probe.run(length, patch).model_error,
                };
                if error.hypot(kernel_error).hypot(swept) > target {
                    continue;
                }
                if errors.is_none() {
                    errors = Some(error);
                    first_patch = i;
                }
                candidates.extend(self.candidate(length, patch, taps));
            }
            if errors.is_none() {
                // The smallest patch is already too large for longer sub-CPIs.
                break;
            }
        }
        candidates
    }

    /// Estimate a candidate on patches in the middle and corners of the grid.
    fn candidate(&self, length: usize, patch: PatchSize, taps: usize) -> Option<Candidate> {
        let last_row = self.grid.rows.count - patch.rows;
        let last_column = self.grid.columns.count - patch.columns;
        let places = [
            (last_row / 2, last_column / 2),
            (0, 0),
            (0, last_column),
            (last_row, 0),
            (last_row, last_column),
        ];
        let sub_cpis = self.sub_cpis(length, PROBED_SUB_CPIS);
        let reach = places
            .iter()
            .fold(Reach::default(), |reach, &(row, column)| {
                let rectangle = Rectangle {
                    row,
                    column,
                    size: patch,
                };
                reach.max(Reach::of(self.grid, &rectangle, &sub_cpis))
            });
        let setup = self.setup(length, taps, reach)?;
        let gate = reach.patch(&setup, [0.0; 3], taps)?;
        let patches = self.grid.rows.count.div_ceil(patch.rows)
            * self.grid.columns.count.div_ceil(patch.columns);
        if patches > MAX_PATCHES {
            return None;
        }
        let count = patches * self.collection.pulses.len().div_ceil(length);
        let capacity = Capacity {
            patches: patches as u16,
            ..least_capacity(&setup, &[gate], self.arithmetic)
        };
        let cost = match self.product {
            ModuleProduct::Maps => gate.map_len() as f64,
            ModuleProduct::Detections => 1.0,
            ModuleProduct::Image => {
                let rows = gate.num_doppler_bins() as f64;
                let bins = f64::from(setup.range_length);
                let units = (length * self.band.count) as f64;
                rows * (UNIT_COST * units + BUTTERFLY_COST * bins / 2.0 * bins.log2())
            }
        };
        let buffers = RamBudget::new(&capacity, self.arithmetic).total_bytes;
        Some(Candidate {
            length,
            patch,
            taps,
            cost: count as f64 * cost,
            ram_bytes: buffers + self.image_bytes(patches, count / patches.max(1)),
        })
    }

    /// At most about `most` sub-CPIs of `length` pulses, including the first and the last.
    fn sub_cpis(&self, length: usize, most: usize) -> Vec<SubCpi> {
        let ranges = sub_cpi::cut(self.collection.pulses.len(), &[], length);
        let step = ranges.len().div_ceil(most).max(1);
        let last = ranges.len().saturating_sub(1);
        let some = ranges.iter().enumerate();
        some.filter(|&(i, _)| i % step == 0 || i == last)
            .map(|(_, pulses)| SubCpi::new(self.collection, pulses.clone()))
            .collect()
    }

    fn setup(&self, length: usize, taps: usize, reach: Reach) -> Option<Setup> {
        let highest = self.band.frequency_hz(self.band.count - 1) / self.band.centre_hz();
        let twice_nyquist = (2.0 * length as f64 * highest.max(1.0)).ceil();
        let cycles_m = self.band.centre_hz() / SPEED_OF_LIGHT_M_S;
        Some(Setup {
            num_pulses: u16::try_from(length).ok()?,
            num_channels: self.num_channels,
            num_frequencies: u16::try_from(self.band.count).ok()?,
            range_length: u16::try_from(self.range_length()).ok()?,
            // At most MAX_PULSES are requested, so this fits.
            doppler_length: reach.doppler_length(cycles_m, twice_nyquist as u16, taps)?,
            start_hz: self.band.start_hz,
            step_hz: self.band.step_hz,
        })
    }

    /// Evaluate a candidate on all patches and sub-CPIs. `None` if it turns out to be impossible.
    pub(super) fn work_out(&self, candidate: &Candidate) -> Option<ModulePlan> {
        let &Candidate {
            length,
            patch,
            taps,
            ..
        } = candidate;
        let places = rectangles(self.grid, patch);
        if places.len() > MAX_PATCHES {
            return None;
        }
        let sub_cpis = self.sub_cpis(length, usize::MAX);
        let reaches = Reach::of_each(self.grid, &places, &sub_cpis);
        let widest = reaches.iter().fold(Reach::default(), |a, &b| a.max(b));
        let setup = self.setup(length, taps, widest)?;
        // Kernels as image formation will choose them: the bands of the maps may need fewer taps.
        let (taps, kernel_error) = self.kernels(&setup)?;
        let patches: Vec<Patch> = places
            .iter()
            .zip(reaches)
            .map(|(place, reach)| {
                let centre_m = place.centre_m(self.grid).to_array();
                reach.patch(&setup, centre_m, taps)
            })
            .collect::<Option<_>>()?;
        let capacity = least_capacity(&setup, &patches, self.arithmetic);
        if usize::from(capacity.doppler_bins) > MAX_ROWS {
            return None;
        }
        let probe = self.probe();
        let model_error = sub_cpis
            .iter()
            .map(|sub_cpi| probe.measure(sub_cpi, patch).model_error)
            .fold(0.0, f64::max);
        let plan = ModulePlan {
            ram: RamBudget::new(&capacity, self.arithmetic),
            image_bytes: self.image_bytes(patches.len(), sub_cpis.len()),
            product: self.product,
            num_pulses: self.collection.pulses.len(),
            num_pixels: self.grid.num_pixels(),
            capacity,
            setup,
            patches,
            arithmetic: self.arithmetic,
            patch_pixels: patch,
            taps,
            num_sub_cpis: sub_cpis.len(),
            gaps: sub_cpi::breaks(self.collection),
            predicted_db: 20.0
                * model_error
                    .hypot(kernel_error)
                    .hypot(sweep::residual(self.collection, self.grid))
                    .log10(),
        };
        // A gate wider than one Doppler cycle is not a valid plan.
        plan.fits(&ModuleCapacity::Built(capacity)).then_some(plan)
    }
}
