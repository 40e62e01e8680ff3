//! Cell-averaging CFAR (CA-CFAR) detector for range-Doppler maps.
//!
//! **Equation.** A cell of power `p` is compared with `N` training cells of powers `x_n` in a rectangular ring around
//! it, outside the guard cells:
//!
//! ```text
//! detected if  p > (Pfa^(-1/N) - 1) sum x_n  =  alpha mean(x_n),   alpha = N (Pfa^(-1/N) - 1)
//!
//!    training  . . . . . . . . .      range ->
//!              . . . . . . . . .
//!              . . g g g g g . .      guard g: not trained on
//!              . . g g p g g . .
//!              . . g g g g g . .
//!              . . . . . . . . .
//!              . . . . . . . . .
//! ```
//!
//! The detector uses power, not amplitude. The power of complex Gaussian noise is exponentially distributed and a
//! sum of `N` such powers has a gamma distribution, so `P(p > k sum) = E exp(-k sum / mean) = (1 + k)^-N`, which
//! equals `Pfa` for the `k` above. Amplitudes are Rayleigh distributed and no such factor exists for them. Where
//! the formula is printed with amplitudes (Chim 2018, (7.8)), power is meant.
//!
//! At the edges of a map the available training cells are used, with the factor for their number. Cells that are NaN,
//! infinite or negative are ignored.
//!
//! A cell above the threshold that no neighbour of eight exceeds becomes a [`Detection`]. Its position is
//! interpolated separately in each axis by a parabola through the logarithms of three powers (exact for a Gaussian
//! response). Its power is that of the parabola's vertex.
//!
//! **Neglected**: neighbouring cells of an oversampled map are correlated. The effective number of training cells is
//! then less than `N` and the false-alarm rate exceeds `Pfa` (by how much: not measured). Noncoherent integration of
//! several maps reduces the variance, so the rate falls below `Pfa` (below a tenth for four maps at 0.01). Targets within
//! each other's training cells raise each other's threshold (masking): use more guard cells than the response is wide,
//! and fewer training cells than the target spacing. A detection in an edge cell may be the side of a scatterer outside
//! the map; it is not interpolated across the edge.
//!
//! **Input**: powers `[doppler][range]`, or a [`PatchMap`]. **Output**: positions in bins from the centre bin
//! (`n / 2`, rounded down, of `n` bins), strongest first. **Cost**: 32 bytes of borrowed [`Column`] per range bin.
//! Sums slide, so a cell costs five powers and at most twelve float64 additions at any ring size, and one `expm1`
//! whenever `N` changes. **Accuracy** (`tests/stream/cfar.rs`): over 14 million noise cells, edges included, the
//! false-alarm rate equals `Pfa` within the statistical error of the count (2.7 % at `Pfa = 1e-4`). Sums carry
//! float64 rounding, `2^-53` of the strongest cell that passed through. Maximum error for a single point scatterer without
//! noise, for either axis and both together:
//!
//! | | position, bins | power, dB |
//! |---|---|---|
//! | `R = 2F`, `D = 2M`, no windows | 0.021 | 0.57 |
//! | same, Hamming windows | 0.0034 | 0.036 |
//! | `R = F`, `D = M`, no windows | 0.167 | 5.5 |
//! | same, Hamming windows | 0.017 | 0.80 |
//!
//! **Errors**: invalid settings and mismatched lengths, see [`CfarError`].
//!
//! ```
//! use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
//! // Noise of power 1 in 9 x 16 cells, and a target of power 100 in Doppler bin +2, range bin -3.
//! let mut power = [1.0f32; 9 * 16];
//! power[(4 + 2) * 16 + (8 - 3)] = 100.0;
//! let cfar = Cfar {
//!     range: TrainingWindow { guard: 1, training: 3 },
//!     doppler: TrainingWindow { guard: 1, training: 1 },
//!     false_alarm_probability: 1e-6,
//! };
//! let mut columns = [Column::default(); 16];
//! let mut detections = heapless::Vec::<Detection, 4>::new();
//! let tally = cfar.detect(&power, 16, &mut columns, &mut detections)?;
//! assert_eq!((tally.tested, tally.above, tally.dropped), (9 * 16, 1, 0));
//! let target = detections[0];
//! assert_eq!((target.doppler_bin, target.range_bin, target.noise), (2.0, -3.0, 1.0));
//! assert!((target.power - 100.0).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use core::fmt;
use core::ops::Range;

use heapless::Vec;

use crate::LengthError;
use crate::stream::PatchMap;

/// Half-widths of the guard and training regions along one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TrainingWindow {
    /// Guard cells on each side of the cell under test.
    pub guard: u16,
    /// Training cells on each side, outside the guard cells.
    pub training: u16,
}

/// Settings of the CA-CFAR detector.
///
/// With `guard` and `training` 0 in Doppler the training cells lie in the row of the cell under test.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cfar {
    /// Guard and training cells in range.
    pub range: TrainingWindow,
    /// Guard and training cells in Doppler.
    pub doppler: TrainingWindow,
    /// Probability of false alarm per tested cell, between 0 and 1 exclusive.
    pub false_alarm_probability: f64,
}

/// Target detected in a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// Range position in bins from the patch centre.
    pub range_bin: f32,
    /// Doppler position in bins from the patch centre.
    pub doppler_bin: f32,
    /// Interpolated peak power.
    pub power: f32,
    /// Mean power of the training cells.
    pub noise: f32,
}

/// Cell counts of one CFAR run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CellCounts {
    /// Cells tested: valid power and at least one training cell.
    pub tested: u32,
    /// Tested cells above the threshold, local maxima or not.
    pub above: u32,
    /// Detections dropped because the list was full. The weakest are dropped.
    pub dropped: u32,
}

/// Reason why a map was not searched. The list of detections is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CfarError {
    /// The probability of false alarm is not between 0 and 1.
    Probability,
    /// The settings have no training cells.
    NoTraining,
    /// A slice has the wrong length.
    Length(LengthError),
}

/// Sliding sums over one column of the ring. The caller lends one per range bin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Column {
    /// Sum over all rows of the ring.
    all: Sum,
    /// Sum over the training rows only, above and below the guard rows.
    beyond_guard: Sum,
}

impl Column {
    /// Zero sums; initial value of a static buffer.
    pub const EMPTY: Self = Self {
        all: Sum::EMPTY,
        beyond_guard: Sum::EMPTY,
    };
}

/// Sum and number of the valid cells.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    power: f64,
    cells: u32,
}

impl Sum {
    const EMPTY: Self = Self {
        power: 0.0,
        cells: 0,
    };

    fn add_cell(&mut self, power: Option<f32>) {
        if let Some(power) = power {
            self.power += f64::from(power);
            self.cells = self.cells.wrapping_add(1);
        }
    }

    fn subtract_cell(&mut self, power: Option<f32>) {
        if let Some(power) = power {
            self.power -= f64::from(power);
            self.cells = self.cells.wrapping_sub(1);
        }
    }

    fn add(&mut self, other: Option<Self>) {
        if let Some(other) = other {
            self.power += other.power;
            self.cells = self.cells.wrapping_add(other.cells);
        }
    }

    fn subtract(&mut self, other: Option<Self>) {
        if let Some(other) = other {
            self.power -= other.power;
            self.cells = self.cells.wrapping_sub(other.cells);
        }
    }
}

impl Cfar {
    /// Check the settings.
    ///
    /// # Errors
    /// [`CfarError::Probability`] or [`CfarError::NoTraining`].
    pub fn check(&self) -> Result<(), CfarError> {
        let probability = self.false_alarm_probability;
        if !(probability > 0.0 && probability < 1.0) {
            return Err(CfarError::Probability);
        }
        if self.range.training == 0 && self.doppler.training == 0 {
            return Err(CfarError::NoTraining);
        }
        Ok(())
    }

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

impl TrainingWindow {
    /// Half-widths in cells: to the last guard cell, and to the last training cell.
    fn bounds(self) -> (usize, usize) {
        let guard = usize::from(self.guard);
        (guard, guard + usize::from(self.training))
    }
}

/// Access to cell powers from a slice or a map.
struct Cells<P> {
    rows: usize,
    columns: usize,
    power: P,
}

/// Powers of a patch map.
fn cells_of<'a>(map: &'a PatchMap<'_>) -> Cells<impl Fn(usize, usize) -> Option<f32> + 'a> {
    let patch = map.header.patch;
    let bin = |index: usize, reach: u16| (index as i32).wrapping_sub(i32::from(reach));
    Cells {
        rows: patch.num_doppler_bins(),
        columns: patch.num_range_bins(),
        power: move |row: usize, column: usize| {
            let value = map.at(
                bin(row, patch.doppler_reach),
                bin(column, patch.range_reach),
            );
            Some(value.norm_sqr())
        },
    }
}

impl<P: Fn(usize, usize) -> Option<f32>> Cells<P> {
    /// Power of a cell, or `None` if the cell is outside the map or invalid.
    #[inline]
    fn at(&self, row: usize, column: usize) -> Option<f32> {
        if row >= self.rows || column >= self.columns {
            return None;
        }
        (self.power)(row, column).filter(|power| *power >= 0.0 && *power < f32::INFINITY)
    }

    /// Whether `power` is a local maximum of the eight neighbours. Of equal neighbours the first counts as the peak.
    fn is_peak(&self, row: usize, column: usize, power: f32) -> bool {
        let neighbour = |up: usize, right: usize| {
            // Offsets are one too high, so that 0 means the neighbour before; it wraps out of the map.
            let (row, column) = (row.wrapping_add(up), column.wrapping_add(right));
            self.at(row.wrapping_sub(1), column.wrapping_sub(1))
        };
        let before = [(0, 0), (0, 1), (0, 2), (1, 0)];
        let after = [(1, 2), (2, 0), (2, 1), (2, 2)];
        !(before
            .iter()
            .filter_map(|&(d, r)| neighbour(d, r))
            .any(|p| p >= power)
            || after
                .iter()
                .filter_map(|&(d, r)| neighbour(d, r))
                .any(|p| p > power))
    }

    /// Detection at a peak, interpolated in both axes.
    fn refine(&self, row: usize, column: usize, power: f32, noise: f32) -> Detection {
        let across = |before: Option<f32>, after: Option<f32>| match (before, after) {
            (Some(before), Some(after)) => parabola(before, power, after),
            _ => (0.0, 0.0),
        };
        let (doppler, doppler_lift) = across(
            self.at(row.wrapping_sub(1), column),
            self.at(row.wrapping_add(1), column),
        );
        let (range, range_lift) = across(
            self.at(row, column.wrapping_sub(1)),
            self.at(row, column.wrapping_add(1)),
        );
        let from_centre = |index: usize, count: usize| index as f32 - (count / 2) as f32;
        Detection {
            range_bin: from_centre(column, self.columns) + range,
            doppler_bin: from_centre(row, self.rows) + doppler,
            power: (power * libm::expf(doppler_lift + range_lift)).min(f32::MAX),
            noise,
        }
    }
}

/// Vertex of the parabola through the logarithms of three powers whose middle one is the largest: offset within
/// half a bin, and log height above the middle power.
fn parabola(before: f32, peak: f32, after: f32) -> (f32, f32) {
    /// Natural logarithm of `(pi / 2)^2` = 3.9 dB, the maximum straddle loss of a map with `R = F` or `D = M`.
    /// Limits the vertex when a neighbour near zero makes the parabola steep.
    const HIGHEST_LIFT: f32 = 0.903_165_4;
    let below = |power: f32| libm::logf((power / peak).max(f32::MIN_POSITIVE)).min(0.0);
    let (before, after) = (below(before), below(after));
    let (sum, difference) = (before + after, before - after);
    if sum < 0.0 {
        let lift = -difference * difference / (8.0 * sum);
        (difference / (2.0 * sum), lift.min(HIGHEST_LIFT))
    } else {
        (0.0, 0.0)
    }
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

impl fmt::Display for CfarError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Probability => {
                f.write_str("probability of false alarm must be between 0 and 1 (exclusive)")
            }
            Self::NoTraining => {
                f.write_str("no training cells: set at least one in range or Doppler")
            }
            Self::Length(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for CfarError {}
