//! The search of a map, in steps of bounded duration.

use core::ops::Range;

use heapless::Vec;

use super::cells::{Cells, cells_of};
use super::columns::{Column, Sum};
use super::settings::{CellCounts, Cfar, CfarError, Detection};
use crate::LengthError;
use crate::stream::PatchMap;

impl Cfar {
    /// Detect targets in `power`, `[doppler][range]` with `num_range_bins` per row, and replace `detections`.
    ///
    /// # Errors
    /// [`CfarError`] if the settings are invalid, the last row is incomplete, or the number of columns differs from
    /// `num_range_bins`.
    pub fn detect<const CAPACITY: usize>(
        &self,
        power: &[f32],
        num_range_bins: usize,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<CellCounts, CfarError> {
        let rows = power.len().checked_div(num_range_bins).unwrap_or(0);
        let whole = rows.wrapping_mul(num_range_bins);
        LengthError::check("power", whole, power.len()).map_err(CfarError::Length)?;
        let cells = Cells {
            rows,
            columns: num_range_bins,
            power: |row: usize, column: usize| {
                power
                    .get(row.wrapping_mul(num_range_bins).wrapping_add(column))
                    .copied()
            },
        };
        self.search(&cells, columns, detections)
    }

    /// Detect targets in a patch map and replace `detections`.
    ///
    /// # Errors
    /// [`CfarError`] if the settings are invalid or the number of columns differs from the range bins.
    pub fn detect_in_map<const CAPACITY: usize>(
        &self,
        map: &PatchMap<'_>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<CellCounts, CfarError> {
        self.search(&cells_of(map), columns, detections)
    }

    /// Begin a search in steps ([`CfarSearch`]), for a device that must do other work in between.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn begin(&self) -> Result<CfarSearch, CfarError> {
        self.check()?;
        Ok(CfarSearch {
            cfar: *self,
            factor: Factor::new(self.false_alarm_probability),
            next: Step::Fill { row: 0 },
            first_column: 0,
            counts: CellCounts::default(),
        })
    }

    fn search<P: Fn(usize, usize) -> Option<f32>, const CAPACITY: usize>(
        &self,
        cells: &Cells<P>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<CellCounts, CfarError> {
        let mut search = self.begin()?;
        while search.step(cells, columns, detections)? {}
        Ok(search.counts)
    }

    /// Add the cells of a row to the column sums of row -1 if its ring contains that row.
    fn fill<P: Fn(usize, usize) -> Option<f32>>(
        &self,
        cells: &Cells<P>,
        columns: &mut [Column],
        row: usize,
        range: Range<usize>,
    ) {
        let (guard, outer) = self.doppler.bounds();
        if row >= outer {
            return;
        }
        for (c, column) in part(columns, range) {
            let cell = cells.at(row, c);
            column.all.add_cell(cell);
            if row >= guard {
                column.beyond_guard.add_cell(cell);
            }
        }
    }

    /// Advance the columns by one row. Subtract before adding, so that sums over a single row carry no rounding.
    fn slide_to_row<P: Fn(usize, usize) -> Option<f32>>(
        &self,
        cells: &Cells<P>,
        columns: &mut [Column],
        row: usize,
        range: Range<usize>,
    ) {
        let (guard, outer) = self.doppler.bounds();
        for (c, column) in part(columns, range) {
            let at = |row: Option<usize>| row.and_then(|row| cells.at(row, c));
            let leaving = at(row.checked_sub(outer + 1));
            let entering = at(Some(row + outer));
            column.all.subtract_cell(leaving);
            column.all.add_cell(entering);
            if outer > guard {
                column.beyond_guard.subtract_cell(leaving);
                column.beyond_guard.subtract_cell(at(Some(row + guard)));
                column.beyond_guard.add_cell(at(row.checked_sub(guard + 1)));
                column.beyond_guard.add_cell(entering);
            }
        }
    }

    /// Ring sum for column -1.
    fn before_first_column(&self, columns: &[Column]) -> Sum {
        let (guard, outer) = self.range.bounds();
        let mut ring = Sum::default();
        for column in columns.iter().take(guard) {
            ring.add(Some(column.beyond_guard));
        }
        for column in columns.iter().take(outer).skip(guard) {
            ring.add(Some(column.all));
        }
        ring
    }

    /// Advance the ring by one column: full columns left and right of the guard, training rows above and below it.
    // A call for every cell would take 2 % of the search: searches of maps and of differences both need it inlined.
    #[inline(always)]
    fn slide_to_column(&self, columns: &[Column], column: usize, ring: &mut Sum) {
        let (guard, outer) = self.range.bounds();
        let at = |column: Option<usize>| column.and_then(|column| columns.get(column));
        let all = |column: Option<usize>| at(column).map(|column| column.all);
        let beyond_guard = |column: Option<usize>| at(column).map(|column| column.beyond_guard);
        let passed = column.checked_sub(guard + 1);
        let reached = Some(column + guard);
        ring.subtract(beyond_guard(passed));
        if outer > guard {
            ring.subtract(all(column.checked_sub(outer + 1)));
            ring.subtract(all(reached));
            ring.add(all(passed));
            ring.add(all(Some(column + outer)));
        }
        ring.add(beyond_guard(reached));
    }
}

/// A search in steps of at most [`CfarSearch::STEP_CELLS`] cells, with the result of [`Cfar::detect_in_map`].
///
/// ```
/// # use subaperture_core::cfar::{Cfar, CfarError, Column, Detection};
/// # use subaperture_core::stream::PatchMap;
/// # fn search(cfar: &Cfar, map: &PatchMap<'_>, columns: &mut [Column]) -> Result<(), CfarError> {
/// let mut detections = heapless::Vec::<Detection, 32>::new();
/// let mut search = cfar.begin()?;
/// while search.step_in_map(map, columns, &mut detections)? {
///     // Receive a pulse.
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct CfarSearch {
    cfar: Cfar,
    factor: Factor,
    next: Step,
    /// First column of the next step.
    first_column: usize,
    counts: CellCounts,
}

/// Work of a step on its columns.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// Add the cells of a row to the column sums of row -1.
    Fill { row: usize },
    /// Advance the column sums to a row.
    Slide { row: usize },
    /// Test the cells of a row, from the ring sum of the column before.
    Test { row: usize, ring: Sum },
}

impl CfarSearch {
    /// Maximum number of cells per step.
    pub const STEP_CELLS: usize = 128;

    /// Cell counts so far.
    pub fn counts(&self) -> CellCounts {
        self.counts
    }

    /// Do one step. Returns false after the last one. All steps of a search take the same map and buffers; the first one
    /// clears `columns` and `detections`.
    ///
    /// # Errors
    /// [`CfarError::Length`] if the number of columns differs from the range bins.
    pub fn step_in_map<const CAPACITY: usize>(
        &mut self,
        map: &PatchMap<'_>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<bool, CfarError> {
        self.step(&cells_of(map), columns, detections)
    }

    /// Do one step on `[Doppler bins, range bins]` cells with the powers of `power(row, column)`, as [`Self::step_in_map`] does.
    ///
    /// # Errors
    /// [`CfarError::Length`] if the number of columns differs from the range bins.
    pub fn step_in_cells<const CAPACITY: usize>(
        &mut self,
        [rows, num_range_bins]: [usize; 2],
        power: impl Fn(usize, usize) -> Option<f32>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<bool, CfarError> {
        let cells = Cells {
            rows,
            columns: num_range_bins,
            power,
        };
        self.step(&cells, columns, detections)
    }

    fn step<P: Fn(usize, usize) -> Option<f32>, const CAPACITY: usize>(
        &mut self,
        cells: &Cells<P>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<bool, CfarError> {
        LengthError::check("columns", cells.columns, columns.len()).map_err(CfarError::Length)?;
        let end = cells
            .columns
            .min(self.first_column.saturating_add(Self::STEP_CELLS));
        let range = self.first_column..end;
        match &mut self.next {
            Step::Fill { row } => {
                if (*row, self.first_column) == (0, 0) {
                    columns.fill(Column::default());
                    detections.clear();
                }
                self.cfar.fill(cells, columns, *row, range);
            }
            Step::Slide { row } => self.cfar.slide_to_row(cells, columns, *row, range),
            Step::Test { row, ring } => {
                for column in range {
                    self.cfar.slide_to_column(columns, column, ring);
                    let Some(power) = cells.at(*row, column).filter(|_| ring.cells > 0) else {
                        continue;
                    };
                    let counts = &mut self.counts;
                    counts.tested = counts.tested.saturating_add(1);
                    // Rounding can make the sum of all-zero cells slightly negative.
                    let sum = ring.power.max(0.0);
                    if f64::from(power) > self.factor.of(ring.cells) * sum {
                        counts.above = counts.above.saturating_add(1);
                        if cells.is_peak(*row, column, power) {
                            let noise = (sum / f64::from(ring.cells)) as f32;
                            let detection = cells.refine(*row, column, power, noise);
                            let dropped = keep(detections, detection).into();
                            counts.dropped = counts.dropped.saturating_add(dropped);
                        }
                    }
                }
            }
        }
        if end < cells.columns {
            self.first_column = end;
            return Ok(true);
        }
        self.first_column = 0;
        let filled = self.cfar.doppler.bounds().1.min(cells.rows);
        self.next = match self.next {
            Step::Fill { row } if row + 1 < filled => Step::Fill { row: row + 1 },
            Step::Fill { .. } => Step::Slide { row: 0 },
            Step::Slide { row } => Step::Test {
                row,
                ring: self.cfar.before_first_column(columns),
            },
            Step::Test { row, .. } => Step::Slide { row: row + 1 },
        };
        Ok(!matches!(self.next, Step::Slide { row } if row >= cells.rows))
    }
}

/// Columns of `range` with their indices.
fn part(columns: &mut [Column], range: Range<usize>) -> impl Iterator<Item = (usize, &mut Column)> {
    let first = range.start;
    let columns = columns.get_mut(range).unwrap_or_default();
    (first..).zip(columns)
}

/// Threshold factor `Pfa^(-1/N) - 1`, recomputed when `N` changes.
#[derive(Clone, Debug)]
struct Factor {
    /// `-ln Pfa`.
    exponent: f64,
    cells: u32,
    value: f64,
}

impl Factor {
    fn new(false_alarm_probability: f64) -> Self {
        Self {
            exponent: -libm::log(false_alarm_probability),
            cells: 0,
            value: f64::INFINITY,
        }
    }

    #[inline(always)]
    fn of(&mut self, cells: u32) -> f64 {
        if cells != self.cells {
            self.cells = cells;
            self.value = libm::expm1(self.exponent / f64::from(cells));
        }
        self.value
    }
}

/// Insert a detection into a list in descending power. Returns true if the weakest had to be dropped.
fn keep<const CAPACITY: usize>(
    detections: &mut Vec<Detection, CAPACITY>,
    mut detection: Detection,
) -> bool {
    for held in detections.iter_mut() {
        if detection.power > held.power {
            core::mem::swap(held, &mut detection);
        }
    }
    detections.push(detection).is_err()
}
