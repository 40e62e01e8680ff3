//! Error of the linear path model ([`super::sub_cpi`]) over a patch of pixels, evaluated on the recorded track.
//!
//! The residual path `e_m(p)`, metres, rotates the term of pulse `m` by `2 pi f e / c`. The RMS of that phase over pulses is the
//! image's relative RMS error. It is evaluated at the corners, midpoints of the sides and centre of a patch, where it is largest; near
//! antennas, at more points; and with intra-pulse motion, at three samples per pulse, at their own times.

use std::f64::consts::TAU;
use std::ops::Range;

use rayon::prelude::*;

use super::patch::{PatchSize, Rectangle};
use super::sub_cpi::{self, SubCpi};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Band, Collection};

/// Smallest patch side considered, pixels, unless the grid is smaller.
const SMALLEST_PATCH: usize = 8;

/// Candidate sub-CPI lengths, in steps of a quarter, adjusted so that all sub-CPIs are full. A single
/// pulse has no path error, so any bound that the kernel keeps can be met, unless its samples are taken at different
/// positions.
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

/// Candidate patch sizes, from a quarter of the grid's longer side down. A quarter leaves enough patches
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

/// Error measure of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Mean over the patch, as for scatterers throughout the scene.
    Mean,
    /// Maximum over the patch.
    Worst,
}

/// Evaluation of the path model error on samples of the grid and the aperture.
pub struct Probe<'a> {
    /// Recording with the track.
    pub collection: &'a Collection,
    /// Pixel grid of the image.
    pub grid: &'a ImageGrid,
    /// Frequency band of all pulses.
    pub band: &'a Band,
    /// First pulses after a gap; no sub-CPI extends across them.
    pub breaks: &'a [usize],
    /// Sample interval in units of the pulse interval for intra-pulse motion; `None` for antennas at rest during a pulse.
    pub pulses_a_sample: Option<f64>,
    /// Error measure of a patch.
    pub measure: Measure,
}

/// Error and Doppler extent for a sub-CPI length and a patch size.
pub struct Probed {
    /// RMS phase error, radians, of the worst patch and sub-CPI.
    pub model_error: f64,
    /// Doppler extent of a patch, cycles per pulse.
    pub doppler_span: f64,
}

/// Nodes and weights of Gauss's rule on [0, 1]; exact for the square of a quadratic.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Fractions of a patch's sides at which it is sampled.
const PLACES: [f64; 3] = [0.0, 0.5, 1.0];
const CLOSE_PLACES: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];
/// Ratio of patch radius to antenna distance above which a patch counts as near.
const NEAR: f64 = 0.2;

/// Largest number of sub-CPIs sampled.
const PROBED_SUB_CPIS: usize = 8;

impl Probe<'_> {
    /// Evaluate a few sub-CPIs of `length` pulses, including first and last.
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

    /// Append the sub-CPI, or its halves if its phase error exceeds `allowed` radians, recursively. Return the
    /// largest error of the appended sub-CPIs.
    pub fn halve_until(
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

    /// Largest error of patches at the grid's centre and corners, for one sub-CPI.
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

    /// RMS phase, radians, averaged over the band, of a mean square path error, square metres.
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

    /// Mean square over pulses of the path model error, square metres, at the worst sampled pixel of a patch or averaged over them,
    /// and the largest path rate there, metres per pulse.
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
        // Sample offsets from the middle sample, and their weights.
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
                // The nodes lie inside the corners, where the rate is 1 / 0.775 of theirs.
                (mean, widest / 0.775)
            }
        }
    }
}
