//! Folds of range cells for cross-validation: each fold is held out once, and a correction estimated on the others is judged on it.
//!
//! Phases are estimated from many range cells, and two folds ([`Split`]) suffice. A track is estimated from scatterers, which may be few:
//! four folds leave three quarters of them to each estimate. Range is cut between scatterers, at minima of power, into
//! segments. Segments with scatterers go to the fold with the fewest scatterers so far, so that each fold has some.
//!
//! Two range cells on either side of a cut are guard cells: they are not used for validation and, next to the held-out fold, not for estimation, as a
//! range main lobe across the cut would be used for both.

use std::collections::BTreeMap;

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::phase_history::Collection;

use super::split::{Half, Split, bin_of, peaks};

/// Number of folds for tracks.
const SCATTERER_FOLDS: usize = 4;

/// Shortest segment, range cells, and largest number of segments per fold.
const MIN_SEGMENT: usize = 4;
const SEGMENTS_A_FOLD: usize = 6;

/// Guard cells on either side of a cut, the extent of a range main lobe.
const GUARD: i64 = 2;

/// Least peak power of a scatterer relative to the brightest: -25 dB, as the methods take them.
pub(crate) const SCATTERER: f64 = 3.2e-3;

/// Role of a range cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    fold: usize,
    /// Whether it is used for validation.
    judges: bool,
    /// Fold within the guard, if any.
    near: Option<usize>,
}

/// Fold of each range cell.
#[derive(Clone, Debug)]
pub(crate) struct Folds {
    cells: BTreeMap<i64, Cell>,
    pub(crate) count: usize,
}

impl Folds {
    /// Largest number of folds.
    pub(crate) const MOST: usize = SCATTERER_FOLDS;

    /// Folds from the two halves of a split.
    pub(crate) fn halves(split: &Split) -> Self {
        let cell = |(bin, half, on_border): (i64, Half, bool)| {
            let cell = Cell {
                fold: match half {
                    Half::Even => 0,
                    Half::Odd => 1,
                },
                judges: !on_border,
                near: None,
            };
            (bin, cell)
        };
        Self {
            cells: split.cells().map(cell).collect(),
            count: 2,
        }
    }

    /// Folds of the scatterers in `image`; `None` if they lie in fewer than two segments of range.
    pub(crate) fn of_scatterers(
        collection: &Collection,
        grid: &ImageGrid,
        image: &Image,
    ) -> Option<Self> {
        let bins = peaks(collection, grid, image);
        let cuts = cuts(&bins);
        let floor = SCATTERER * bins.iter().fold(0.0, |most: f64, bin| most.max(bin.1));
        let segments: Vec<&[(i64, f64)]> = cuts.windows(2).map(|w| &bins[w[0]..w[1]]).collect();
        // Local maxima, and their power.
        let scatterers = |segment: &[(i64, f64)]| -> (usize, f64) {
            let at = |i: usize| segment.get(i).map_or(0.0, |bin| bin.1);
            let maxima = (0..segment.len())
                .filter(|&i| at(i) >= floor && at(i) >= at(i.wrapping_sub(1)) && at(i) > at(i + 1));
            let peak = segment.iter().fold(0.0, |most: f64, bin| most.max(bin.1));
            (maxima.count(), peak)
        };
        let mut order: Vec<(usize, f64, usize)> = segments
            .iter()
            .enumerate()
            .map(|(i, segment)| {
                let (count, peak) = scatterers(segment);
                (count, peak, i)
            })
            .collect();
        let bright = order.iter().filter(|segment| segment.0 > 0).count();
        if bright < 2 {
            return None;
        }
        let count = bright.min(SCATTERER_FOLDS);
        order.sort_by(|a, b| (b.0, b.1).partial_cmp(&(a.0, a.1)).expect("finite"));
        let mut held = vec![(0, 0.0); count];
        let mut fold_of = vec![0; segments.len()];
        for (scatterers, peak, i) in order {
            let least = (0..count).min_by(|&a, &b| held[a].partial_cmp(&held[b]).expect("finite"));
            let fold = least.unwrap_or(0);
            fold_of[i] = fold;
            held[fold].0 += scatterers;
            held[fold].1 += peak;
        }
        let mut cells = BTreeMap::new();
        for (segment, &fold) in segments.iter().zip(&fold_of) {
            for &(bin, _) in *segment {
                let cell = Cell {
                    fold,
                    judges: true,
                    near: None,
                };
                cells.insert(bin, cell);
            }
        }
        let folds: BTreeMap<i64, usize> =
            cells.iter().map(|(&bin, cell)| (bin, cell.fold)).collect();
        for (bin, cell) in &mut cells {
            let other = |(_, &fold): (&i64, &usize)| (fold != cell.fold).then_some(fold);
            cell.near = folds.range(bin - GUARD..=bin + GUARD).find_map(other);
            cell.judges = cell.near.is_none();
        }
        Some(Self { cells, count })
    }

    /// Whether a correction that `held_out` judges may be estimated on a range cell.
    pub(crate) fn estimates(&self, held_out: usize, bin: i64) -> bool {
        let cell = self.cells.get(&bin);
        cell.is_some_and(|cell| cell.fold != held_out && cell.near != Some(held_out))
    }

    fn judges(&self, held_out: usize, bin: i64) -> bool {
        let cell = self.cells.get(&bin);
        cell.is_some_and(|cell| cell.fold == held_out && cell.judges)
    }

    /// Copy of `image` that keeps the pixels used to estimate without `held_out` and zeroes all others.
    pub(crate) fn estimating(
        &self,
        held_out: usize,
        collection: &Collection,
        grid: &ImageGrid,
        image: &Image,
    ) -> Image {
        kept_bins(image, collection, grid, |bin| self.estimates(held_out, bin))
    }

    /// Copy of `image` that keeps the pixels used by `held_out` and zeroes all others.
    pub(crate) fn judging(
        &self,
        held_out: usize,
        collection: &Collection,
        grid: &ImageGrid,
        image: &Image,
    ) -> Image {
        kept_bins(image, collection, grid, |bin| self.judges(held_out, bin))
    }

    /// Segments of neighbouring range cells used by `held_out`, as the pixels of each.
    pub(crate) fn segments(
        &self,
        held_out: usize,
        collection: &Collection,
        grid: &ImageGrid,
        image: &Image,
    ) -> Vec<Vec<usize>> {
        let mut pixels = BTreeMap::<i64, Vec<usize>>::new();
        for index in 0..image.pixels.len() {
            let bin = bin_of(collection, place(grid, image, index));
            if self.judges(held_out, bin) {
                pixels.entry(bin).or_default().push(index);
            }
        }
        let mut segments: Vec<Vec<usize>> = Vec::new();
        let mut last = None;
        for (bin, pixels) in pixels {
            match segments.last_mut() {
                Some(segment) if last == Some(bin - 1) => segment.extend(pixels),
                _ => segments.push(pixels),
            }
            last = Some(bin);
        }
        segments
    }
}

/// Boundaries of the segments: each cut is at the minimum of power within a segment's length of the shortest segment.
fn cuts(bins: &[(i64, f64)]) -> Vec<usize> {
    let shortest = (bins.len() / (2 * SEGMENTS_A_FOLD * SCATTERER_FOLDS)).max(MIN_SEGMENT);
    let mut cuts = vec![0];
    let mut start = 0;
    while start + 2 * shortest < bins.len() {
        let candidates = start + shortest..=(start + 2 * shortest).min(bins.len() - shortest);
        let across = |cut: usize| bins[cut - 1].1 + bins[cut].1;
        let Some(cut) = candidates.min_by(|&a, &b| across(a).total_cmp(&across(b))) else {
            break;
        };
        cuts.push(cut);
        start = cut;
    }
    cuts.push(bins.len());
    cuts
}

fn place(grid: &ImageGrid, image: &Image, index: usize) -> DVec3 {
    grid.position_m(index / image.columns, index % image.columns)
}

/// Copy of `image` that keeps the pixels of some range cells and zeroes all others.
fn kept_bins(
    image: &Image,
    collection: &Collection,
    grid: &ImageGrid,
    keeps: impl Fn(i64) -> bool,
) -> Image {
    let mut kept = image.clone();
    for (index, pixel) in kept.pixels.iter_mut().enumerate() {
        if !keeps(bin_of(collection, place(grid, image, index))) {
            *pixel = Complex32::ZERO;
        }
    }
    kept
}
