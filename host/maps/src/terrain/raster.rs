//! Window of an elevation raster in memory.

use std::ops::Range;
use std::path::Path;

use crate::terrain::lattice::Lattice;
use crate::terrain::{Region, TerrainError};

/// Margin of the window around a region, posts.
const AROUND: f64 = 2.0;

/// Size and position of a raster on disk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub(crate) lattice: Lattice,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
}

impl Extent {
    /// Rows and columns that a region needs; `None` where they do not overlap.
    pub(crate) fn window(&self, region: &Region) -> Option<[Range<usize>; 2]> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in region.places() {
            let Some(at) = self.lattice.at(place.latitude_deg, place.longitude_deg) else {
                continue;
            };
            for i in 0..2 {
                low[i] = low[i].min(at[i]);
                high[i] = high[i].max(at[i]);
            }
        }
        let range = |i: usize, count: usize| {
            let first = (low[i] - AROUND).floor().max(0.0);
            let end = (high[i] + AROUND).ceil().min(count as f64);
            (first < end).then_some(first as usize..end as usize)
        };
        // In a global raster the first column is adjacent to the last.
        let at_an_end = low[1] < AROUND || high[1] + AROUND > self.columns as f64;
        let columns = match at_an_end && self.lattice.goes_around(self.columns) {
            true => 0..self.columns,
            false => range(1, self.columns)?,
        };
        Some([range(0, self.rows)?, columns])
    }
}

/// Memory of a window, bytes.
///
/// # Errors
/// [`TerrainError::Memory`] if window and `extra_bytes` exceed `allowed_bytes`.
pub(crate) fn check_memory(
    path: &Path,
    [rows, columns]: &[Range<usize>; 2],
    extra_bytes: u64,
    allowed_bytes: u64,
) -> Result<u64, TerrainError> {
    let bytes = 4 * rows.len() as u64 * columns.len() as u64;
    let needed = bytes.saturating_add(extra_bytes);
    match needed <= allowed_bytes {
        true => Ok(bytes),
        false => Err(TerrainError::Memory {
            path: path.to_owned(),
            needed_mib: needed.div_ceil(1 << 20),
            allowed_mib: allowed_bytes >> 20,
        }),
    }
}

/// Part of an elevation model that a region needs.
pub(crate) struct Model {
    pub(crate) raster: Raster,
    /// Warnings, one sentence each.
    pub(crate) warnings: Vec<String>,
    /// Geoid to which heights refer, if the file names one.
    pub(crate) above_sea: Option<&'static str>,
}

impl Model {
    /// A model without warnings and without a named geoid.
    pub(crate) fn plain(raster: Raster) -> Self {
        Self {
            raster,
            warnings: Vec::new(),
            above_sea: None,
        }
    }
}

/// Heights of a window, metres; NaN where there is no data.
#[derive(Clone, Debug)]
pub(crate) struct Raster {
    lattice: Lattice,
    first: [usize; 2],
    rows: usize,
    columns: usize,
    heights: Vec<f32>,
}

impl Raster {
    pub(crate) fn new(
        lattice: Lattice,
        [rows, columns]: &[Range<usize>; 2],
        heights: Vec<f32>,
    ) -> Self {
        debug_assert_eq!(heights.len(), rows.len() * columns.len());
        Self {
            lattice,
            first: [rows.start, columns.start],
            rows: rows.len(),
            columns: columns.len(),
            heights,
        }
    }

    /// Bilinear height; `None` beyond the outermost posts, or where a post that is used has no data.
    pub(crate) fn at(&self, latitude_deg: f64, longitude_deg: f64) -> Option<f64> {
        let [row, column] = self.lattice.at(latitude_deg, longitude_deg)?;
        let (row, column) = (row - self.first[0] as f64, column - self.first[1] as f64);
        let last = [self.rows - 1, self.columns - 1].map(|n| n as f64);
        // Tolerance for rounding at the edge, posts.
        const EDGE: f64 = 1e-6;
        let within =
            row >= -EDGE && column >= -EDGE && row <= last[0] + EDGE && column <= last[1] + EDGE;
        if !within {
            return None;
        }
        // Within the tolerance of a post, that post alone is used.
        let on_post = |x: f64| match (x - x.round()).abs() < EDGE {
            true => x.round(),
            false => x,
        };
        let (row, column) = (row.clamp(0.0, last[0]), column.clamp(0.0, last[1]));
        bilinear([row, column].map(on_post), |i, j| {
            let height = self.heights[i * self.columns + j];
            (!height.is_nan()).then_some(f64::from(height))
        })
    }

    /// Bilinear height between this raster's outermost posts and the next posts beyond, which `post` gives by latitude and longitude; `None` farther out.
    pub(crate) fn at_edge(
        &self,
        latitude_deg: f64,
        longitude_deg: f64,
        post: impl Fn(f64, f64) -> Option<f64>,
    ) -> Option<f64> {
        let [row, column] = self.lattice.at(latitude_deg, longitude_deg)?;
        let first = self.first.map(|n| n as f64 - 1.0);
        let count = [self.rows, self.columns].map(|n| n as f64 + 1.0);
        let (row, column) = (row - first[0], column - first[1]);
        if !(row >= 0.0 && column >= 0.0 && row < count[0] && column < count[1]) {
            return None;
        }
        bilinear([row, column], |i, j| {
            let [latitude, longitude] = self
                .lattice
                .place([first[0] + i as f64, first[1] + j as f64]);
            post(latitude, longitude)
        })
    }

    /// Memory of the heights, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(self.heights.as_slice()) as u64
    }

    /// Approximate post spacing, metres.
    pub(crate) fn step_m(&self, latitude_deg: f64) -> f64 {
        self.lattice.step_m(latitude_deg)
    }
}

/// Bilinear interpolation of four posts; posts of weight 0 are not read. `None` where a post has no data.
fn bilinear([row, column]: [f64; 2], post: impl Fn(usize, usize) -> Option<f64>) -> Option<f64> {
    let (i, j) = (row as usize, column as usize);
    let (v, u) = (row - i as f64, column - j as f64);
    let mut sum = 0.0;
    for (di, w) in [(0, 1.0 - v), (1, v)] {
        for (dj, weight) in [(0, w * (1.0 - u)), (1, w * u)] {
            if weight > 0.0 {
                sum += weight * post(i + di, j + dj)?;
            }
        }
    }
    Some(sum)
}
