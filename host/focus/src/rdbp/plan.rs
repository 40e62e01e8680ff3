//! Choosing sub-CPI length, patch size and kernel from a bound on the error.
//!
//! The precise mode has two errors. One is the kernel's ([`KaiserBessel::error`], in range and in
//! Doppler). The other is the path model's: what [`super::sub_cpi`]'s straight line leaves,
//! `e_m(p)` metres, a phase error of `2 pi f_c e / c`. A pixel's value is the exact sum with each term
//! turned by that phase; since terms from scatterers elsewhere have phases of their own, the image's
//! relative RMS error is the RMS of the phase error over pulses. It is evaluated here with
//! the track as recorded, so jitter and curvature count as they are, at the corners, the sides' middles and the centre of
//! a patch, and where samples are taken one after another at three of them a pulse, at their own moments. There it is largest; near antennas it may be elsewhere, so a patch that is not small against its distance from them is
//! looked at more closely. Sizes are chosen on a few sub-CPIs from start to end and patches in the grid's middle and
//! corners; then every sub-CPI is measured on every patch, and one that errs by more is halved until it does not. The worst pixel,
//! patch and sub-CPI decide, and the bound is met with [`MARGIN_DB`] to spare.

use std::f64::consts::TAU;
use std::ops::Range;

use super::patch::{self, PatchSize, Rectangle};
use super::sub_cpi::{self, SubCpi};
use crate::{FormError, MARGIN_DB, rounding};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Band, Collection};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::scaled_dft::ScaledDft;

use rayon::prelude::*;

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

/// Relative RMS error of the transforms and phases in float32, and of the kernels' weights, read from tables.
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
    of(num_samples).hypot(of(num_pulses))
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
            measure: Measure::Worst,
        };
        let target = 10f64.powf((request.error_db - MARGIN_DB) / 20.0);
        let kernels = [4, 6].map(|taps| (taps, kernel_error(taps, band.count, num_pulses)));

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
        let mut smaller = patches.into_iter().skip_while(|&patch| patch != best.patch);
        let mut patch = smaller.next().unwrap_or(best.patch);
        let (sub_cpis, model_error) = loop {
            let rectangles = patch::rectangles(grid, patch);
            let mut sub_cpis = Vec::new();
            let mut model_error = 0.0f64;
            for pulses in sub_cpi::cut(num_pulses, &breaks, best.length) {
                let worst = probe.halve_until(allowed, &rectangles, pulses, &mut sub_cpis);
                model_error = model_error.max(worst);
            }
            if model_error <= allowed {
                break (sub_cpis, model_error);
            }
            // A pulse alone has something to model too, where its samples are taken at different places.
            match smaller.next() {
                Some(next) => patch = next,
                None => break (sub_cpis, model_error),
            }
        };
        let rounding = ARITHMETIC.hypot(rounding::sum(sub_cpis.len()));
        Ok(Self {
            band,
            sub_cpi_length: sub_cpis.iter().map(SubCpi::num_pulses).max().unwrap_or(0),
            sub_cpis,
            patch,
            taps: best.taps,
            pulses_a_sample: probe.pulses_a_sample,
            predicted_db: rounding::total_db(&[model_error, kernel_error, rounding]),
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
/// pulse has no path to model, so any bound that the kernel keeps can be met, unless its samples are taken at different
/// places.
pub fn lengths(num_pulses: usize) -> Vec<usize> {
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
pub fn patch_sizes(grid: &ImageGrid) -> Vec<PatchSize> {
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

/// What counts of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The mean over it, as for scatterers all over the scene.
    Mean,
    /// The worst pixel.
    Worst,
}

/// Measures the path model on samples of the grid and the aperture.
pub struct Probe<'a> {
    /// The track.
    pub collection: &'a Collection,
    /// The pixels.
    pub grid: &'a ImageGrid,
    /// Frequencies of all pulses.
    pub band: &'a Band,
    /// First pulses after a gap, across which no sub-CPI reaches.
    pub breaks: &'a [usize],
    /// From sample to sample, in pulses, if samples are taken at their own moments; else all of a pulse at one.
    pub pulses_a_sample: Option<f64>,
    /// What counts.
    pub measure: Measure,
}

/// What a sub-CPI length and a patch size leave.
pub struct Probed {
    /// RMS phase error, radians, of the worst patch and sub-CPI.
    pub model_error: f64,
    /// Doppler band of a patch, cycles a pulse.
    pub doppler_span: f64,
}

/// Nodes and weights of Gauss's rule on [0, 1]: exact for the square of a quadratic.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Fractions of a patch's sides at which it is looked at, and at which one near the antennas is.
const PLACES: [f64; 3] = [0.0, 0.5, 1.0];
const CLOSE_PLACES: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];
/// A patch that reaches further from its centre, in parts of its distance from the antennas, is near.
const NEAR: f64 = 0.2;

/// Most sub-CPIs that are looked at.
const PROBED_SUB_CPIS: usize = 8;

impl Probe<'_> {
    /// On a few sub-CPIs of `length` pulses, first and last among them.
    pub fn run(&self, length: usize, patch: PatchSize) -> Probed {
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
        rectangles: &[Rectangle],
        pulses: Range<usize>,
        sub_cpis: &mut Vec<SubCpi>,
    ) -> f64 {
        let sub_cpi = SubCpi::new(self.collection, pulses.clone());
        let worst = rectangles
            .par_iter()
            .map(|rectangle| self.residual(&sub_cpi, rectangle).0)
            .reduce(|| 0.0, f64::max);
        let error = self.phase_rad(worst);
        if error <= allowed || pulses.len() == 1 {
            sub_cpis.push(sub_cpi);
            return error;
        }
        let middle = pulses.start + pulses.len() / 2;
        let early = self.halve_until(allowed, rectangles, pulses.start..middle, sub_cpis);
        let late = self.halve_until(allowed, rectangles, middle..pulses.end, sub_cpis);
        early.max(late)
    }

    /// The worst of patches in the grid's middle and corners, for one sub-CPI.
    pub fn measure(&self, sub_cpi: &SubCpi, patch: PatchSize) -> Probed {
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
            model_error: self.phase_rad(worst),
            doppler_span: 2.0 * widest * cycles_m,
        }
    }

    /// RMS phase, radians, of a mean square path, square metres, in the mean over the band.
    fn phase_rad(&self, mean_square_m2: f64) -> f64 {
        let square = match self.measure {
            Measure::Worst => {
                let [first, last] = [0, self.band.count - 1].map(|k| self.band.frequency_hz(k));
                (first * first + first * last + last * last) / 3.0
            }
            Measure::Mean => self.band.centre_hz().powi(2),
        };
        TAU * (square * mean_square_m2).sqrt() / SPEED_OF_LIGHT_M_S
    }

    /// Mean square over pulses of the path model's error, square metres, at the worst of some pixels of a patch or in its mean,
    /// and the largest path rate there, metres a pulse.
    fn residual(&self, sub_cpi: &SubCpi, rectangle: &Rectangle) -> (f64, f64) {
        let centre = rectangle.centre_m(self.grid);
        let datum = sub_cpi.datum(centre);
        let middle = (sub_cpi.num_pulses() as f64 - 1.0) / 2.0;
        let pulses = &self.collection.pulses[sub_cpi.pulses.clone()];
        let corner = rectangle.point_m(self.grid, 0.0, 0.0);
        let radius_m = corner.distance(centre);
        let [first, last] = [&pulses[0], &pulses[pulses.len() - 1]];
        let distance_m = [first, last]
            .map(|p| {
                p.transmitter_m
                    .distance(centre)
                    .min(p.receiver_m.distance(centre))
            })
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let places: &[f64] = match radius_m > NEAR * distance_m {
            true => &CLOSE_PLACES,
            false => &PLACES,
        };
        let count = self.band.count as f64;
        // Samples after the middle one, and their weights.
        let moments = match self.pulses_a_sample {
            Some(_) => GAUSS.map(|(part, weight)| ((part - 0.5) * count, weight)),
            None => [(0.0, 1.0), (0.0, 0.0), (0.0, 0.0)],
        };
        let moments = &moments[..if self.pulses_a_sample.is_some() { 3 } else { 1 }];
        let pulses_a_sample = self.pulses_a_sample.unwrap_or(0.0);
        let to_centre_m: Vec<[f64; 3]> = pulses
            .iter()
            .map(|pulse| {
                let mut paths_m = [0.0; 3];
                for (path_m, &(after, _)) in paths_m.iter_mut().zip(moments) {
                    *path_m = pulse.path_after_m(centre, after);
                }
                paths_m
            })
            .collect();
        let mut widest = 0.0f64;
        let mut mean_square = |row: f64, column: f64| {
            let point = rectangle.point_m(self.grid, row, column);
            let (a, b) = sub_cpi.line(&datum, point);
            widest = widest.max(b.abs());
            let squares = pulses.iter().zip(&to_centre_m).enumerate();
            let sum: f64 = squares
                .map(|(m, (pulse, to_centre_m))| {
                    let of_moment = |(&(after, weight), centre_m): (&(f64, f64), &f64)| {
                        let path_m = pulse.path_after_m(point, after) - centre_m;
                        let u = m as f64 - middle + pulses_a_sample * after;
                        weight * (path_m - a - b * u).powi(2)
                    };
                    moments.iter().zip(to_centre_m).map(of_moment).sum::<f64>()
                })
                .sum();
            sum / pulses.len() as f64
        };
        match self.measure {
            Measure::Worst => {
                let both = places
                    .iter()
                    .flat_map(|&row| places.iter().map(move |&c| (row, c)));
                let worst = both
                    .map(|(row, column)| mean_square(row, column))
                    .fold(0.0, f64::max);
                (worst, widest)
            }
            Measure::Mean => {
                let nodes = GAUSS
                    .iter()
                    .flat_map(|row| GAUSS.iter().map(move |column| (row, column)));
                let mean = nodes
                    .map(|(row, column)| row.1 * column.1 * mean_square(row.0, column.0))
                    .sum();
                // The nodes stop short of the corners, where the rate is 1 / 0.775 of theirs.
                (mean, widest / 0.775)
            }
        }
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
