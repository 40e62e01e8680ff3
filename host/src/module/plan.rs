//! Choosing sub-CPI, patches and kernel for a module.
//!
//! As the host's own planner ([`crate::focus::rdbp::plan`]), by the same measure of the path's model on
//! the recorded track: predicted error is the root sum square of the model's and the kernels'
//! ([`crate::focus::maps::kernels`]), and [`MARGIN_DB`] is kept. What differs:
//! - sub-CPIs are as long as one another, and do not heed gaps in the track: a module counts pulses;
//! - maps have `R`, the power of two from `2F` (4096 at most), and `D`, twice Nyquist's at the highest
//!   frequency, so that kernels have room;
//! - of all choices within the bound and the room, the one with the fewest bytes of maps is taken, since
//!   the link is the narrowest place; of equals, that with the least memory.
//!
//! Every patch's gate holds its pixels in all sub-CPIs, and the kernel's `taps / 2 + 1` bins around.
//!
//! Neglected: the fixed-point path's rounding, which this prediction does not know.

use subaperture_core::stream::{Capacity, Patch, Setup};

use super::ram::map_samples;
use super::reach::Reach;
use super::{LinkBudget, RamBudget};
use crate::SPEED_OF_LIGHT_M_S;
use crate::focus::maps::kernels::Kernels;
use crate::focus::rdbp::patch::{Rectangle, rectangles};
use crate::focus::rdbp::plan::{Probe, lengths, patch_sizes};
use crate::focus::rdbp::{PatchSize, SubCpi, shared_band, sub_cpi};
use crate::focus::{FormError, MARGIN_DB};
use crate::geometry::ImageGrid;
use crate::maps::Arithmetic;
use crate::phase_history::{Band, Collection};
use crate::signal::windowed_sinc::{TAPS, WindowedSinc};

/// Longest range transform of a module.
const LONGEST_RANGE: usize = 4096;

/// Most pulses a sub-CPI that a module's buffers can be built for.
const MOST_PULSES: usize = 4096;

/// Most sub-CPIs that estimates look at.
const PROBED_SUB_CPIS: usize = 8;

/// The room there is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Room {
    /// So many bytes for all buffers, which are built to suit.
    Ram {
        /// Bytes.
        bytes: u64,
    },
    /// Buffers as built.
    Built(Capacity),
}

/// What is wanted of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Room in the module.
    pub room: Room,
    /// Its arithmetic.
    pub arithmetic: Arithmetic,
}

/// What a module is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct ModulePlan {
    /// Its settings.
    pub setup: Setup,
    /// Its patches, row by row of the grid.
    pub patches: Vec<Patch>,
    /// Its arithmetic.
    pub arithmetic: Arithmetic,
    /// Pixels a patch.
    pub patch_pixels: PatchSize,
    /// Taps of the kernels that the gates have room for.
    pub taps: usize,
    /// Sub-CPIs of the collection.
    pub num_sub_cpis: usize,
    /// Predicted relative RMS error of the image, dB.
    pub predicted_db: f64,
    /// Memory of the buffers.
    pub ram: RamBudget,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The recording does not suit.
    #[error(transparent)]
    Unsuited(#[from] FormError),
    /// More frequencies than a module takes.
    #[error(
        "a pulse has {0} frequencies, and a module takes at most {LONGEST_RANGE}: thin or cut the band"
    )]
    Frequencies(usize),
    /// Whatever is chosen, the error is larger.
    #[error("no choice keeps the error below {error_db} dB{}: allow more with --error-db", best(*.best_db))]
    Bound {
        /// The bound asked for, dB.
        error_db: f64,
        /// The least that was found, dB; `None` where nothing at all is possible.
        best_db: Option<f64>,
    },
    /// Nothing that keeps the bound fits.
    #[error(
        "nothing that keeps {error_db} dB fits: {}; allow a larger error with --error-db, give a \
         smaller --grid, or more memory",
        least(*.least_bytes)
    )]
    Room {
        /// The bound asked for, dB.
        error_db: f64,
        /// Least memory that would do, bytes.
        least_bytes: u64,
    },
}

fn best(best_db: Option<f64>) -> String {
    best_db.map_or_else(
        || ": its patches' Doppler is wider than the pulses tell apart".to_owned(),
        |best_db| {
            format!(" ({MARGIN_DB} dB of it are kept in reserve); {best_db:.1} dB is the best")
        },
    )
}

fn least(bytes: u64) -> String {
    let kibibytes = bytes.div_ceil(1024);
    format!("the least memory that would is {bytes} bytes ({kibibytes}K)")
}

impl ModulePlan {
    /// Plans for the pixels of `grid`.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn new(
        collection: &Collection,
        grid: &ImageGrid,
        request: &Request,
    ) -> Result<Self, PlanError> {
        let band = shared_band(collection)?;
        if band.count > LONGEST_RANGE {
            return Err(PlanError::Frequencies(band.count));
        }
        let target = 10f64.powf((request.error_db - MARGIN_DB) / 20.0);
        let search = Search {
            collection,
            grid,
            band: &band,
            arithmetic: request.arithmetic,
            error_db: request.error_db,
        };
        let mut candidates = search.candidates(target);
        candidates.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        // Estimates look at some patches and sub-CPIs; what is taken is worked out on all of them.
        let hopeful = candidates.iter().filter(|c| match request.room {
            Room::Ram { bytes } => 0.9 * search.least_bytes(c) <= bytes as f64,
            Room::Built(_) => true,
        });
        let mut best_db: Option<f64> = None;
        let mut sound = |candidate: &Candidate| {
            let plan = search.work_out(candidate)?;
            best_db = Some(best_db.map_or(plan.predicted_db, |best| best.min(plan.predicted_db)));
            (plan.predicted_db <= request.error_db - MARGIN_DB).then_some(plan)
        };
        for candidate in hopeful {
            if let Some(plan) = sound(candidate)
                && plan.fits(&request.room)
            {
                return Ok(plan);
            }
        }
        candidates.sort_by(|a, b| a.ram_samples.total_cmp(&b.ram_samples));
        let least_bytes = candidates
            .iter()
            .find_map(&mut sound)
            .map(|plan| plan.ram.total_bytes);
        let error_db = request.error_db;
        Err(match least_bytes {
            Some(least_bytes) => PlanError::Room {
                error_db,
                least_bytes,
            },
            None => PlanError::Bound {
                error_db,
                best_db: best_db.or_else(|| {
                    let range_band = search.range_band();
                    let most = TAPS[TAPS.len() - 1];
                    let kernel = WindowedSinc::new(most, range_band).error(range_band);
                    (kernel > Kernels::share(request.error_db)).then(|| 20.0 * kernel.log10())
                }),
            },
        })
    }

    /// Buffers that this plan fits exactly.
    pub fn capacity(&self) -> Capacity {
        let frequencies = self.setup.num_frequencies;
        let samples = self
            .patches
            .iter()
            .map(|patch| map_samples(&self.setup, patch));
        let rows = samples.max().unwrap_or(0).div_ceil(frequencies.into());
        Capacity {
            pulses: self.setup.num_pulses,
            frequencies,
            range_bins: self.setup.range_length,
            doppler_bins: u16::try_from(rows).unwrap_or(u16::MAX),
            patches: u16::try_from(self.patches.len()).unwrap_or(u16::MAX),
        }
    }

    /// Whether there is room for it.
    pub fn fits(&self, room: &Room) -> bool {
        match room {
            Room::Ram { bytes } => self.ram.total_bytes <= *bytes,
            Room::Built(capacity) => {
                let patches = self.patches.iter();
                self.setup.check(capacity).is_ok()
                    && self.patches.len() <= usize::from(capacity.patches)
                    && patches
                        .clone()
                        .all(|patch| self.setup.check_patch(patch, capacity).is_ok())
            }
        }
    }

    /// What it costs on a link of `baud` bits a second.
    pub fn link(&self, baud: u32) -> LinkBudget {
        LinkBudget::new(self, baud)
    }
}

/// A choice, and what it comes to by estimate.
struct Candidate {
    length: usize,
    patch: PatchSize,
    taps: usize,
    /// Samples of all maps of the collection.
    map_samples: f64,
    /// Samples of stores and map in work.
    ram_samples: f64,
}

impl Candidate {
    /// Bytes of maps rule; memory decides between equals.
    fn cost(&self) -> f64 {
        self.map_samples + 1e-6 * self.ram_samples
    }
}

/// What choices are made from.
struct Search<'a> {
    collection: &'a Collection,
    grid: &'a ImageGrid,
    band: &'a Band,
    arithmetic: Arithmetic,
    error_db: f64,
}

impl Search<'_> {
    fn range_length(&self) -> usize {
        (2 * self.band.count).next_power_of_two().min(LONGEST_RANGE)
    }

    fn range_band(&self) -> f64 {
        (self.band.count / 2) as f64 / self.range_length() as f64
    }

    /// Every choice that, by estimate, keeps the error below `target`.
    fn candidates(&self, target: f64) -> Vec<Candidate> {
        let range_band = self.range_band();
        // Doppler bins are twice as fine as the whole band needs.
        let kernels = TAPS.map(|taps| {
            let error = |band: f64| WindowedSinc::new(taps, band).error(band);
            (taps, error(range_band).hypot(error(0.25)))
        });
        // That which whoever forms the image will take.
        let share = Kernels::share(self.error_db);
        let kernel = kernels.into_iter().find(|&(_, error)| error <= share);
        let Some((taps, kernel_error)) = kernel else {
            return Vec::new();
        };
        let probe = Probe {
            collection: self.collection,
            grid: self.grid,
            band: self.band,
            breaks: &[],
        };
        let num_pulses = self.collection.pulses.len();
        let patches = patch_sizes(self.grid);
        let mut candidates = Vec::new();
        let mut first_patch = 0;
        for length in lengths(num_pulses) {
            if length > MOST_PULSES {
                break;
            }
            // Errors grow with the patch: what a size keeps, smaller ones keep too. A longer sub-CPI never
            // allows a larger patch.
            let mut errors: Option<f64> = None;
            for (i, &patch) in patches.iter().enumerate().skip(first_patch) {
                let error = match errors {
                    Some(error) => error,
                    None => probe.run(length, patch).model_error,
                };
                if error.hypot(kernel_error) > target {
                    continue;
                }
                if errors.is_none() {
                    errors = Some(error);
                    first_patch = i;
                }
                candidates.extend(self.candidate(length, patch, taps));
            }
            if errors.is_none() {
                // The smallest patch is too large already for longer sub-CPIs.
                break;
            }
        }
        candidates
    }

    /// What a choice comes to on patches in the grid's middle and corners.
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
        let count = patches * self.collection.pulses.len().div_ceil(length);
        Some(Candidate {
            length,
            patch,
            taps,
            map_samples: count as f64 * gate.map_len() as f64,
            ram_samples: (2 * length * self.band.count + map_samples(&setup, &gate)) as f64,
        })
    }

    /// Bytes that a choice takes at the least, by estimate.
    fn least_bytes(&self, candidate: &Candidate) -> f64 {
        match self.arithmetic {
            Arithmetic::Float => 8.0 * candidate.ram_samples,
            Arithmetic::Fixed => 4.0 * candidate.ram_samples,
        }
    }

    /// At most about `most` sub-CPIs of `length`, first and last among them.
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
            num_frequencies: u16::try_from(self.band.count).ok()?,
            range_length: u16::try_from(self.range_length()).ok()?,
            // At most MOST_PULSES are asked for: this fits.
            doppler_length: reach.doppler_length(cycles_m, twice_nyquist as u16, taps)?,
            start_hz: self.band.start_hz,
            step_hz: self.band.step_hz,
        })
    }

    /// The choice on all patches and sub-CPIs; `None` if it turns out impossible.
    fn work_out(&self, candidate: &Candidate) -> Option<ModulePlan> {
        let &Candidate {
            length,
            patch,
            taps,
            ..
        } = candidate;
        let places = rectangles(self.grid, patch);
        if places.len() > usize::from(u16::MAX) {
            return None;
        }
        let sub_cpis = self.sub_cpis(length, usize::MAX);
        let reaches = Reach::of_each(self.grid, &places, &sub_cpis);
        let widest = reaches.iter().fold(Reach::default(), |a, &b| a.max(b));
        let setup = self.setup(length, taps, widest)?;
        // Those that the image will be formed with: the maps' own bands may take fewer taps.
        let kernels = Kernels::for_bound(&setup, self.error_db);
        let taps = kernels.range.taps();
        let patches: Vec<Patch> = places
            .iter()
            .zip(reaches)
            .map(|(place, reach)| {
                let centre_m = place.centre_m(self.grid).to_array();
                reach.patch(&setup, centre_m, taps)
            })
            .collect::<Option<_>>()?;
        let largest = *patches.iter().max_by_key(|p| map_samples(&setup, p))?;
        let probe = Probe {
            collection: self.collection,
            grid: self.grid,
            band: self.band,
            breaks: &[],
        };
        let model_error = sub_cpis
            .iter()
            .map(|sub_cpi| probe.measure(sub_cpi, patch).model_error)
            .fold(0.0, f64::max);
        let plan = ModulePlan {
            ram: RamBudget::new(&setup, &largest, patches.len(), self.arithmetic),
            setup,
            patches,
            arithmetic: self.arithmetic,
            patch_pixels: patch,
            taps,
            num_sub_cpis: sub_cpis.len(),
            predicted_db: 20.0 * model_error.hypot(kernels.error).log10(),
        };
        // A gate wider than the band of one cycle is no plan.
        plan.fits(&Room::Built(plan.capacity())).then_some(plan)
    }
}
