//! Choosing sub-CPI length, patch size and kernel from a bound on the error.
//!
//! The precise mode has two errors. One is the kernel's ([`KaiserBessel::error`], in range and in
//! Doppler). The other is the path model's: what [`super::sub_cpi`]'s straight line leaves,
//! `e_m(p)` metres, a phase error of `2 pi f_c e / c`. A pixel's value is the exact sum with each term
//! turned by that phase; since terms from scatterers elsewhere have phases of their own, the image's
//! relative RMS error is the RMS of the phase error over pulses and pixels. It is evaluated here with
//! the track as recorded, so jitter and curvature count as they are, at the nine nodes of Gauss's rule
//! on patches in the grid's middle and corners. Sizes are chosen on a few sub-CPIs from start to end;
//! then every sub-CPI is measured, and one that a rough stretch of the track spoils is halved until it
//! is not. Where samples are taken one after another, the error is taken at three of them a pulse, at their own
//! moments. The worst patch and sub-CPI decide, and the bound is met with [`MARGIN_DB`] to spare.
//!
//! The bound is relative to the RMS of an image of the scene's bright scatterers. Their errors reach as
//! far as their side lobes do, so on a grid that leaves them out the same errors are larger relative to
//! what is there.

use std::f64::consts::TAU;
use std::ops::Range;

use super::patch::{PatchSize, Rectangle};
use super::sub_cpi::{self, SubCpi};
use crate::SPEED_OF_LIGHT_M_S;
use crate::focus::{FormError, MARGIN_DB};
use crate::geometry::ImageGrid;
use crate::phase_history::{Band, Collection};
use crate::signal::fast_length::fast_length;
use crate::signal::kaiser_bessel::KaiserBessel;
use crate::signal::scaled_dft::ScaledDft;

/// What is wanted of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Pulses a sub-CPI, if given.
    pub sub_cpi: Option<usize>,
    /// Side of a patch in metres, if given.
    pub patch_m: Option<f64>,
    /// Bytes that the tables and one thread's map may take.
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

/// Smallest patch side considered, pixels, unless the grid is smaller.
const SMALLEST_PATCH: usize = 8;

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
        let band = super::shared_band(collection)?;
        if request.sub_cpi == Some(0)
            || request
                .patch_m
                .is_some_and(|side| side.is_nan() || side <= 0.0)
        {
            return Err(FormError::Unsuited(
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
        };
        let target = 10f64.powf((request.error_db - MARGIN_DB) / 20.0);
        // In range and in Doppler alike: both grids are twice as fine as the whole band needs.
        let kernels = [4, 6].map(|taps| (taps, KaiserBessel::new(taps).error(0.25) * 2f64.sqrt()));

        let mut best: Option<Choice> = None;
        let mut first_patch = 0;
        for &length in &lengths {
            // A longer sub-CPI never allows a larger patch.
            for (i, &patch) in patches.iter().enumerate().skip(first_patch) {
                let Probed {
                    model_error,
                    doppler_span,
                } = probe.run(length, patch);
                for (taps, kernel_error) in kernels {
                    let error = model_error.hypot(kernel_error);
                    let fits = probe.bytes(length, taps, doppler_span) <= request.memory_bytes;
                    let meets = error <= target;
                    let cost = probe.cost(length, patch, taps, doppler_span);
                    let choice = Choice {
                        length,
                        patch,
                        taps,
                        kernel_error,
                        error,
                        cost,
                        fits,
                        meets,
                    };
                    if best.is_none_or(|b| choice.better_than(&b)) {
                        best = Some(choice);
                    }
                }
                if model_error <= target {
                    first_patch = i;
                    break;
                }
            }
        }
        let best = best.expect("there is at least one length and one patch");
        let kernel_error = best.kernel_error;
        // A given length is the user's word; it is measured, not changed.
        let allowed = match request.sub_cpi {
            Some(_) => f64::INFINITY,
            None => (target * target - kernel_error * kernel_error)
                .max(0.0)
                .sqrt(),
        };
        let mut sub_cpis = Vec::new();
        let mut model_error = 0.0f64;
        for pulses in sub_cpi::cut(num_pulses, &breaks, best.length) {
            let worst = probe.halve_until(allowed, best.patch, pulses, &mut sub_cpis);
            model_error = model_error.max(worst);
        }
        Ok(Self {
            band,
            sub_cpi_length: sub_cpis.iter().map(SubCpi::num_pulses).max().unwrap_or(0),
            sub_cpis,
            patch: best.patch,
            taps: best.taps,
            pulses_a_sample: probe.pulses_a_sample,
            predicted_db: 20.0 * model_error.hypot(kernel_error).log10(),
        })
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

/// Sub-CPI lengths to try: a quarter longer each time, evened out so that all sub-CPIs are full. One
/// pulse has no path to model, so any bound that the kernel keeps can be met.
pub(crate) fn lengths(num_pulses: usize) -> Vec<usize> {
    let mut lengths = Vec::new();
    let mut length = 1;
    while length < num_pulses {
        let parts = num_pulses.div_ceil(length);
        lengths.push(num_pulses.div_ceil(parts));
        length += length.div_ceil(4);
    }
    lengths.push(num_pulses);
    lengths.dedup();
    lengths
}

/// Patch sizes to try, from a quarter of the grid's longer side down. A quarter leaves patches enough
/// to share among threads, whose number must not change the image.
pub(crate) fn patch_sizes(grid: &ImageGrid) -> Vec<PatchSize> {
    let whole = PatchSize {
        rows: grid.rows.count,
        columns: grid.columns.count,
    };
    let side_m = whole.side_m(grid);
    let mut sizes = Vec::new();
    let mut parts = 4.0;
    loop {
        let size = PatchSize::from_metres(grid, side_m / parts);
        sizes.push(size);
        if size.rows.max(size.columns) <= SMALLEST_PATCH {
            break;
        }
        parts *= 1.4;
    }
    sizes.dedup();
    sizes
}

/// Measures the path model on samples of the grid and the aperture.
pub(crate) struct Probe<'a> {
    /// The track.
    pub(crate) collection: &'a Collection,
    /// The pixels.
    pub(crate) grid: &'a ImageGrid,
    /// Frequencies of all pulses.
    pub(crate) band: &'a Band,
    /// First pulses after a gap, across which no sub-CPI reaches.
    pub(crate) breaks: &'a [usize],
    /// From sample to sample, in pulses, if samples are taken at their own moments; else all of a pulse at one.
    pub(crate) pulses_a_sample: Option<f64>,
}

pub(crate) struct Probed {
    /// RMS phase error, radians, of the worst patch and sub-CPI.
    pub(crate) model_error: f64,
    /// Doppler band of a patch, cycles a pulse.
    pub(crate) doppler_span: f64,
}

/// Nodes and weights of Gauss's rule on [0, 1]: exact for the square of a quadratic.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Most sub-CPIs that are looked at.
const PROBED_SUB_CPIS: usize = 8;

impl Probe<'_> {
    /// On a few sub-CPIs of `length` pulses, first and last among them.
    pub(crate) fn run(&self, length: usize, patch: PatchSize) -> Probed {
        let sub_cpis = sub_cpi::cut(self.collection.pulses.len(), self.breaks, length);
        let step = sub_cpis.len().div_ceil(PROBED_SUB_CPIS).max(1);
        let first_and_last = sub_cpis.iter().step_by(step).chain(sub_cpis.last());
        let mut probed = Probed {
            model_error: 0.0,
            doppler_span: 0.0,
        };
        for pulses in first_and_last {
            let one = self.measure(&SubCpi::new(self.collection, pulses.clone()), patch);
            probed.model_error = probed.model_error.max(one.model_error);
            probed.doppler_span = probed.doppler_span.max(one.doppler_span);
        }
        probed
    }

    /// Appends the sub-CPI, or its halves if its phase error is above `allowed` radians, and so on. The
    /// worst error of what was appended.
    fn halve_until(
        &self,
        allowed: f64,
        patch: PatchSize,
        pulses: Range<usize>,
        sub_cpis: &mut Vec<SubCpi>,
    ) -> f64 {
        let sub_cpi = SubCpi::new(self.collection, pulses.clone());
        let error = self.measure(&sub_cpi, patch).model_error;
        if error <= allowed || pulses.len() == 1 {
            sub_cpis.push(sub_cpi);
            return error;
        }
        let middle = pulses.start + pulses.len() / 2;
        let early = self.halve_until(allowed, patch, pulses.start..middle, sub_cpis);
        let late = self.halve_until(allowed, patch, middle..pulses.end, sub_cpis);
        early.max(late)
    }

    /// The worst of patches in the grid's middle and corners, for one sub-CPI.
    pub(crate) fn measure(&self, sub_cpi: &SubCpi, patch: PatchSize) -> Probed {
        let last_row = self.grid.rows.count - patch.rows;
        let last_column = self.grid.columns.count - patch.columns;
        let mut places = vec![(last_row / 2, last_column / 2)];
        places.extend([
            (0, 0),
            (0, last_column),
            (last_row, 0),
            (last_row, last_column),
        ]);
        places.dedup();
        let (mut worst, mut widest) = (0.0f64, 0.0f64);
        for (row, column) in places {
            let rectangle = Rectangle {
                row,
                column,
                size: patch,
            };
            let (mean_square_m2, rate_m) = self.residual(sub_cpi, &rectangle);
            worst = worst.max(mean_square_m2);
            widest = widest.max(rate_m);
        }
        let cycles_m = self.band.centre_hz() / SPEED_OF_LIGHT_M_S;
        Probed {
            model_error: TAU * cycles_m * worst.sqrt(),
            // The nodes stop short of the corners, where the rate is 1 / 0.775 of theirs.
            doppler_span: 2.0 * widest * cycles_m / 0.775,
        }
    }

    /// Mean square of the path model's error over a patch, square metres, and the largest path rate at
    /// the nodes, metres a pulse.
    fn residual(&self, sub_cpi: &SubCpi, rectangle: &Rectangle) -> (f64, f64) {
        let centre = rectangle.centre_m(self.grid);
        let datum = sub_cpi.datum(centre);
        let middle = (sub_cpi.num_pulses() as f64 - 1.0) / 2.0;
        let count = self.band.count as f64;
        // Samples after the middle one, and their weights.
        let moments = match self.pulses_a_sample {
            Some(_) => GAUSS.map(|(part, weight)| ((part - 0.5) * count, weight)),
            None => [(0.0, 1.0), (0.0, 0.0), (0.0, 0.0)],
        };
        let moments = &moments[..if self.pulses_a_sample.is_some() { 3 } else { 1 }];
        let pulses_a_sample = self.pulses_a_sample.unwrap_or(0.0);
        let (mut mean_square, mut rate) = (0.0, 0.0f64);
        for (row, row_weight) in GAUSS {
            for (column, column_weight) in GAUSS {
                let point = rectangle.point_m(self.grid, row, column);
                let (a, b) = sub_cpi.line(&datum, point);
                rate = rate.max(b.abs());
                let pulses = &self.collection.pulses[sub_cpi.pulses.clone()];
                let square: f64 = pulses
                    .iter()
                    .enumerate()
                    .map(|(m, pulse)| {
                        let of_moment = |&(after, weight): &(f64, f64)| {
                            let path_m = pulse.path_after_m(point, after)
                                - pulse.path_after_m(centre, after);
                            let u = m as f64 - middle + pulses_a_sample * after;
                            weight * (path_m - a - b * u).powi(2)
                        };
                        moments.iter().map(of_moment).sum::<f64>()
                    })
                    .sum();
                mean_square += row_weight * column_weight * square / sub_cpi.num_pulses() as f64;
            }
        }
        (mean_square, rate)
    }

    /// Doppler bins of a patch's map, about.
    fn doppler_bins(&self, length: usize, taps: usize, doppler_span: f64) -> f64 {
        let sweep_pulses = self.pulses_a_sample.unwrap_or(0.0).abs() * self.band.count as f64;
        let bins_per_cycle = super::bins_per_cycle(self.band, length as f64 + sweep_pulses);
        (doppler_span * bins_per_cycle).ceil() + taps as f64 + 2.0
    }

    /// Bytes of the tables and one thread's buffers, about.
    fn bytes(&self, length: usize, taps: usize, doppler_span: f64) -> u64 {
        let bins = self.doppler_bins(length, taps, doppler_span);
        if bins > 1e12 {
            return u64::MAX;
        }
        let (bins, count) = (bins as usize, self.band.count);
        let map = bins as u64 * (fast_length(2 * count) + taps) as u64;
        ScaledDft::table_bytes(count, length, bins) + 8 * (map + (length * count) as u64)
    }

    /// Rough cost of the image in nanoseconds of one core: compensation, Doppler, range, pixels.
    fn cost(&self, length: usize, patch: PatchSize, taps: usize, doppler_span: f64) -> f64 {
        let (m, k) = (length as f64, self.band.count as f64);
        let bins = self.doppler_bins(length, taps, doppler_span);
        let transform = |n: f64| 0.7 * n * n.max(2.0).log2();
        let map = 4.0 * m * k + k * 2.0 * transform(m + bins) + bins * transform(2.0 * k);
        let pixels = (patch.rows * patch.columns) as f64 * (40.0 + 0.7 * (taps * taps) as f64);
        let patches = self.grid.rows.count.div_ceil(patch.rows)
            * self.grid.columns.count.div_ceil(patch.columns);
        let sub_cpis = self.collection.pulses.len().div_ceil(length);
        (patches * sub_cpis) as f64 * (map + pixels)
    }
}
