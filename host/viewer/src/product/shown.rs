//! Image on the page: its overview as it is computed, and any tile of it.

use std::collections::HashSet;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, RwLock};

use serde_json::{Value, json};
use subaperture_model::image::{ImageSource, ImageSourceError, power};
use subaperture_plot::{PictureCells, automatic_levels_db};

use super::Product;
use super::axes::Axes;
use super::histogram::Histogram;
use super::overview::{Overview, coarsest, size_at};
use super::pixels::{Glance, Piece};
use super::tile::{cells, encode, glanced, phases, powers};

/// Coarsest level that is computed from pixels on request, 2048 x 2048 of them per tile. If memory keeps none of the
/// next levels, cells of the finest level kept are used instead.
const COARSEST_COMPUTED: u32 = 3;
/// Maximum rows and columns of the overview level used for automatic levels of an incomplete image.
const SCALE_SIDE: usize = 512;

/// Progress of an image.
#[derive(Debug, Default)]
pub(super) struct State {
    /// Incremented when the displayed image changes.
    pub(super) revision: u64,
    /// Number of pixels in the overview.
    pub(super) taken: usize,
    /// Maximum power of these pixels.
    peak: f64,
    /// Whether tiles are available from the overview.
    pub(super) ready: bool,
    /// Whether the image will not change any more.
    pub(super) settled: bool,
    /// Automatic levels: upper level and dynamic range, dB.
    pub(super) scale: Option<[f64; 2]>,
    /// Levels that `scale` was chosen from.
    histogram: Option<Histogram>,
    /// First fault found.
    pub(super) fault: Option<String>,
}

pub(super) struct Shown {
    pub(super) product: Product,
    pub(super) size: [usize; 2],
    /// Finest level of the overview.
    finest: u32,
    axes: Axes,
    glance: OnceLock<Glance>,
    overview: RwLock<Overview>,
    state: Mutex<State>,
}

/// Automatic levels and the histogram; `None` if no power is positive.
fn levels_of(powers: &[f64]) -> Option<([f64; 2], Option<Histogram>)> {
    Some((automatic_levels_db(powers)?, Histogram::of(powers)))
}

impl State {
    /// Count a change of the image, with new levels if there are any.
    fn revise(&mut self, levels: Option<([f64; 2], Option<Histogram>)>) {
        if let Some((scale, histogram)) = levels {
            self.scale = Some(scale);
            self.histogram = histogram;
        }
        self.revision += 1;
    }
}

impl Shown {
    pub(super) fn new(product: Product, overview_bytes: u64) -> Self {
        let (rows, columns) = product.pixels.size();
        let size = [rows, columns];
        let overview = Overview::new(size, overview_bytes);
        Self {
            axes: Axes::of(&product),
            product,
            size,
            finest: overview.finest(),
            glance: OnceLock::new(),
            overview: RwLock::new(overview),
            state: Mutex::default(),
        }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Record a fault and stop reading. What was read remains visible.
    pub(super) fn fail(&self, fault: String) {
        let mut state = self.state();
        state.fault.get_or_insert(fault);
        state.settled = true;
        state.revision += 1;
    }

    /// Read the preview.
    pub(super) fn look(&self) -> Result<(), ImageSourceError> {
        let glance = self.product.pixels.glance()?;
        let powers: Vec<f64> = glance.image.pixels.iter().map(|&z| power(z)).collect();
        let _ = self.glance.set(glance);
        // The state is not locked while levels are sorted.
        let levels = levels_of(&powers);
        self.state().revise(levels);
        Ok(())
    }

    /// Read the pieces added since `has` was filled. Returns `false` if stopped. An image that is complete has the levels of its picture, drawn
    /// with `picture_bytes`.
    pub(super) fn take(
        &self,
        has: &mut HashSet<Piece>,
        picture_bytes: Option<u64>,
        stop: &dyn Fn() -> bool,
    ) -> Result<bool, ImageSourceError> {
        let pixels = &self.product.pixels;
        let pieces = pixels.new_pieces(has)?;
        if pieces.is_empty() {
            return Ok(true);
        }
        let complete = pieces.len() == pixels.num_pieces();
        let mut cells = picture_bytes
            .filter(|_| complete)
            .map(|bytes| PictureCells::new(&self.product.any_grid(), bytes));
        let places = pieces.iter().flat_map(|&piece| pixels.places_of(piece));
        for place in places {
            if stop() {
                return Ok(false);
            }
            let part = pixels.window(&place)?;
            if let Some(cells) = &mut cells {
                cells.add(&place, &part);
            }
            let mut overview = self
                .overview
                .write()
                .unwrap_or_else(PoisonError::into_inner);
            overview.add(&place, &part);
            let peak = overview.peak();
            drop(overview);
            let mut state = self.state();
            state.taken += place[0].len() * place[1].len();
            state.peak = peak;
        }
        has.extend(&pieces);
        let mut overview = self
            .overview
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        overview.fold();
        let powers = match cells {
            Some(cells) => cells.finish(),
            None => overview.small(SCALE_SIDE),
        };
        drop(overview);
        let levels = levels_of(&powers);
        let mut state = self.state();
        state.ready = true;
        state.revise(levels);
        Ok(true)
    }

    /// Encoded tile; `None` if it does not exist.
    pub(super) fn tile(
        &self,
        level: u32,
        at: [usize; 2],
    ) -> Result<Option<Vec<u8>>, ImageSourceError> {
        if level > coarsest(self.size) {
            return Ok(None);
        }
        let Some(place) = cells(self.size, level, at) else {
            return Ok(None);
        };
        let overview = self.overview.read().unwrap_or_else(PoisonError::into_inner);
        let ready = self.state().ready;
        let cells = if level < overview.finest() && level <= COARSEST_COMPUTED {
            drop(overview);
            powers(&self.product.pixels, level, &place)?
        } else if ready {
            overview.powers(level, &place)
        } else {
            drop(overview);
            match self.glance.get() {
                Some(glance) => glanced(glance, level, &place),
                None => Vec::new(),
            }
        };
        Ok(Some(encode(&place, &cells)))
    }

    /// Encoded phases of a level-0 tile; `None` if it does not exist.
    pub(super) fn phases(&self, at: [usize; 2]) -> Result<Option<Vec<u8>>, ImageSourceError> {
        match cells(self.size, 0, at) {
            Some(place) => phases(&self.product.pixels, &place).map(Some),
            None => Ok(None),
        }
    }

    /// State of the image, as JSON.
    pub(super) fn about(&self) -> Value {
        let product = &self.product;
        let grid = product.any_grid();
        let known = product.grid.is_some();
        let [right, up] = match (grid.polar, product.rows_down) {
            // Angles increase to the left.
            (true, _) => [-1, 1],
            (false, true) => [1, -1],
            (false, false) => [1, 1],
        };
        // Metres per pixel; at mid-range for a polar grid.
        let middle = grid.rows.start + grid.rows.step * grid.rows.count as f64 / 2.0;
        let across = grid.columns.step * if grid.polar { middle.abs() } else { 1.0 };
        let state = self.state();
        json!({
            "name": product.name,
            "rows": self.size[0],
            "columns": self.size[1],
            "levels": coarsest(self.size),
            "finest_kept": self.finest,
            "top_rows": size_at(self.size, coarsest(self.size)),
            "right": right,
            "up": up,
            "steps_m": known.then_some([grid.rows.step, across]),
            "polar": grid.polar,
            "rows_axis": [grid.rows.start, grid.rows.step],
            "columns_axis": [grid.columns.start, grid.columns.step],
            "axes": self.axes.to_json(),
            "on_earth": product.frame != subaperture_model::geometry::SceneFrame::Local,
            "aperture": product.aperture.is_some(),
            "revision": state.revision,
            "fraction": state.taken as f64 / (self.size[0] * self.size[1]) as f64,
            "ready": state.ready,
            "settled": state.settled,
            "scale": state.scale,
            "histogram": state.histogram.as_ref().map(Histogram::to_json),
            "peak_db": (state.peak > 0.0).then(|| 10.0 * state.peak.log10()),
            "fault": state.fault,
        })
    }
}
