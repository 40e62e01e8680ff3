//! An image that is shown: its overview as it comes, and any tile of it.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, RwLock};

use serde_json::{Value, json};
use subaperture_model::image::{Parts, PartsError, power};

use super::Product;
use super::overview::{Overview, coarsest, size_at};
use super::pixels::Glance;
use super::tile::{cells, encode, glanced, phases, powers};

/// Least and most dB between black and white, and how far below the median black lies, as `subaperture_plot` has them.
const SPANS_DB: [f64; 2] = [40.0, 60.0];
const BELOW_MEDIAN_DB: f64 = 6.0;
/// The coarsest level whose cells are computed of pixels when they are asked for, 2048 x 2048 of them for a tile: where memory keeps none of the next levels, cells of the
/// finest that is kept stand for theirs.
const COARSEST_COMPUTED: u32 = 3;
/// Rows and columns of what the scale is of.
const SCALE_SIDE: usize = 512;

/// How far it is.
#[derive(Debug, Default)]
pub(super) struct State {
    /// Changes with what is shown.
    pub(super) revision: u64,
    /// Pixels that the overview has.
    pub(super) taken: usize,
    /// Whether tiles are of the overview.
    pub(super) ready: bool,
    /// Whether nothing will change any more.
    pub(super) settled: bool,
    /// Levels of white and of black below it, dB.
    pub(super) scale: Option<[f64; 2]>,
    /// What went wrong.
    pub(super) fault: Option<String>,
}

pub(super) struct Shown {
    pub(super) product: Product,
    pub(super) size: [usize; 2],
    glance: OnceLock<Glance>,
    overview: RwLock<Overview>,
    state: Mutex<State>,
}

impl Shown {
    pub(super) fn new(product: Product, overview_bytes: u64) -> Self {
        let (rows, columns) = product.pixels.size();
        let size = [rows, columns];
        Self {
            product,
            size,
            glance: OnceLock::new(),
            overview: RwLock::new(Overview::new(size, overview_bytes)),
            state: Mutex::default(),
        }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What went wrong is told, and what there is stays.
    pub(super) fn fail(&self, fault: String) {
        let mut state = self.state();
        state.fault.get_or_insert(fault);
        state.settled = true;
        state.revision += 1;
    }

    /// The first look.
    pub(super) fn look(&self) -> Result<(), PartsError> {
        let glance = self.product.pixels.glance()?;
        let powers: Vec<f64> = glance.image.pixels.iter().map(|&z| power(z)).collect();
        let _ = self.glance.set(glance);
        let mut state = self.state();
        state.scale = scale(&powers);
        state.revision += 1;
        Ok(())
    }

    /// Takes what has come since `has` was filled; `false` if it was asked to stop.
    pub(super) fn take(
        &self,
        has: &mut [bool],
        stop: &dyn Fn() -> bool,
    ) -> Result<bool, PartsError> {
        let places = self.product.pixels.new_places(has);
        if places.is_empty() {
            return Ok(true);
        }
        for place in &places {
            if stop() {
                return Ok(false);
            }
            let part = self.product.pixels.window(place)?;
            let mut overview = self
                .overview
                .write()
                .unwrap_or_else(PoisonError::into_inner);
            overview.add(place, &part);
            drop(overview);
            self.state().taken += place[0].len() * place[1].len();
        }
        let mut overview = self
            .overview
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        overview.fold();
        let small = overview.small(SCALE_SIDE);
        drop(overview);
        let mut state = self.state();
        state.ready = true;
        state.scale = scale(&small).or(state.scale);
        state.revision += 1;
        Ok(true)
    }

    /// A tile; `None` if there is no such.
    pub(super) fn tile(&self, level: u32, at: [usize; 2]) -> Result<Option<Vec<u8>>, PartsError> {
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

    /// The phases of a tile of level 0; `None` if there is no such.
    pub(super) fn phases(&self, at: [usize; 2]) -> Result<Option<Vec<u8>>, PartsError> {
        match cells(self.size, 0, at) {
            Some(place) => phases(&self.product.pixels, &place).map(Some),
            None => Ok(None),
        }
    }

    /// As the page gets it.
    pub(super) fn about(&self) -> Value {
        let product = &self.product;
        let grid = product.any_grid();
        let known = product.grid.is_some();
        let [right, up] = match (grid.polar, product.rows_down) {
            // Angles grow to the left.
            (true, _) => [-1, 1],
            (false, true) => [1, -1],
            (false, false) => [1, 1],
        };
        // Metres a pixel, of a polar grid at its middle.
        let middle = grid.rows.start + grid.rows.step * grid.rows.count as f64 / 2.0;
        let across = grid.columns.step * if grid.polar { middle.abs() } else { 1.0 };
        let overview = self.overview.read().unwrap_or_else(PoisonError::into_inner);
        let (peak, finest) = (overview.peak(), overview.finest());
        drop(overview);
        let state = self.state();
        json!({
            "name": product.name,
            "rows": self.size[0],
            "columns": self.size[1],
            "levels": coarsest(self.size),
            "finest_kept": finest,
            "top_rows": size_at(self.size, coarsest(self.size)),
            "right": right,
            "up": up,
            "steps_m": known.then_some([grid.rows.step, across]),
            "polar": grid.polar,
            "rows_axis": [grid.rows.start, grid.rows.step],
            "columns_axis": [grid.columns.start, grid.columns.step],
            "on_earth": product.frame != subaperture_model::geometry::SceneFrame::Local,
            "aperture": product.aperture.is_some(),
            "revision": state.revision,
            "fraction": state.taken as f64 / (self.size[0] * self.size[1]) as f64,
            "ready": state.ready,
            "settled": state.settled,
            "scale": state.scale,
            "peak_db": (peak > 0.0).then(|| 10.0 * peak.log10()),
            "fault": state.fault,
        })
    }
}

/// Top and span, whole dB: the brightest, and 6 dB below the median, within 40 to 60 dB.
fn scale(powers: &[f64]) -> Option<[f64; 2]> {
    let seen = powers.iter().copied();
    let mut seen: Vec<f64> = seen.filter(|p| p.is_finite() && *p > 0.0).collect();
    let peak = seen.iter().copied().fold(0.0, f64::max);
    if seen.is_empty() {
        return None;
    }
    let middle = (seen.len() - 1) / 2;
    let (_, median, _) = seen.select_nth_unstable_by(middle, f64::total_cmp);
    let top = (10.0 * peak.log10()).ceil();
    let bottom = (10.0 * median.log10() - BELOW_MEDIAN_DB).floor();
    Some([top, (top - bottom).clamp(SPANS_DB[0], SPANS_DB[1])])
}
