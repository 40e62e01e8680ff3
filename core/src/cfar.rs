//! Detection at a constant false-alarm rate: cells above the mean power of the cells around them.
//!
//! **Equation** (cell averaging). Of a cell of power `p`, with `N` training cells of powers `x_n` in a
//! rectangular ring around it, outside the guard cells:
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
//! Powers, not amplitudes: of complex Gaussian noise the power is exponentially distributed, a sum of
//! `N` of them Gamma, and `P(p > k sum) = E exp(-k sum / mean) = (1 + k)^-N`, which is `Pfa` for the `k`
//! above. For amplitudes, which are Rayleigh, no such factor holds; where the formula is printed with
//! amplitudes (Chim 2018, (7.8)), power is what is meant.
//!
//! At a map's edges, the cells that there are count, with the factor of their number. Cells that are
//! no numbers, infinite or negative are as if they were not there.
//!
//! Cells above the threshold that none of their eight neighbours exceeds become [`Detection`]s. Their
//! place is refined, in each axis by itself, by the parabola through the logarithms of three powers
//! (exact where the response is Gaussian), and their power is the parabola's at its top.
//!
//! **Neglected**: neighbouring cells of an oversampled map are alike, so that training cells count for
//! fewer than they are and there are more false alarms than asked for (how many: not measured). Power
//! summed over several maps is closer to its mean than a single map's: there are fewer (below a tenth
//! for four maps at 0.01). Targets in each other's training cells raise each other's threshold: take
//! more guard cells than the response is wide, and fewer training cells than targets are apart. A cell
//! at a map's edge may be the flank of a scatterer beyond; it is not refined across the edge.
//!
//! **Input** powers `[doppler][range]`, or a [`PatchMap`]. **Output** places in bins from the centre
//! (that of `n` bins is `n / 2`, rounded down), strongest first. **Cost** 32 bytes of [`Column`] a range
//! bin, lent; sums slide, so that a cell costs five powers and at most twelve float64 additions whatever
//! the ring's size, and one `expm1` whenever `N` changes. **Accuracy** (`tests/stream/cfar.rs`): counted on
//! 14 million cells of noise, false alarms are as many as asked for within the count's own error (2.7 % at
//! `Pfa = 1e-4`), edges included. Sums carry the rounding of float64, `2^-53` of the strongest cell that
//! slid through. A single point without noise is found within, in either axis and for both together:
//!
//! | | place, bins | power, dB |
//! |---|---|---|
//! | `R = 2F`, `D = 2M`, no windows | 0.021 | 0.57 |
//! | Hamming's windows | 0.0034 | 0.036 |
//! | `R = F`, `D = M`, no windows | 0.167 | 5.5 |
//! | Hamming's windows | 0.017 | 0.80 |
//!
//! **Errors** settings that cannot be, and lengths that do not fit: [`CfarError`].
//!
//! ```
//! use subaperture_core::cfar::{Cfar, Column, Detection, Reach};
//! // Noise of power 1 in 9 x 16 cells, and a target of 100 in Doppler bin +2, range bin -3.
//! let mut power = [1.0f32; 9 * 16];
//! power[(4 + 2) * 16 + (8 - 3)] = 100.0;
//! let cfar = Cfar {
//!     range: Reach { guard: 1, training: 3 },
//!     doppler: Reach { guard: 1, training: 1 },
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

use heapless::Vec;

use crate::LengthError;
use crate::stream::PatchMap;

/// How far guard and training cells reach along one axis, on either side of the cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reach {
    /// Guard cells next to the cell.
    pub guard: u16,
    /// Training cells next to those.
    pub training: u16,
}

/// Settings of the detector.
///
/// With no reach in Doppler the training cells are those of the cell's own row.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cfar {
    /// Along range.
    pub range: Reach,
    /// Along Doppler.
    pub doppler: Reach,
    /// Wanted false alarms a tested cell, above 0 and below 1.
    pub false_alarm_probability: f64,
}

/// A target in a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Detection {
    /// Range bins from the patch's centre.
    pub range_bin: f32,
    /// Doppler bins from the patch's centre.
    pub doppler_bin: f32,
    /// Power at that place.
    pub power: f32,
    /// Mean power of the training cells.
    pub noise: f32,
}

/// What was counted on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Tally {
    /// Cells that are numbers and have a training cell.
    pub tested: u32,
    /// Of these, cells above the threshold; local maxima or not.
    pub above: u32,
    /// Detections for which there was no room, the weakest of all.
    pub dropped: u32,
}

/// Why a map was not searched. The list of detections is as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CfarError {
    /// The probability is not above 0 and below 1.
    Probability,
    /// There are no training cells.
    NoTraining,
    /// A slice has the wrong length.
    Length(LengthError),
}

/// Sliding sums over one column of the ring; lent to the detector, one a range bin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Column {
    /// Over all rows of the ring.
    all: Sum,
    /// Over its training rows, those above and below the guard's.
    beyond_guard: Sum,
}

impl Column {
    /// No sums: what fills a static.
    pub const EMPTY: Self = Self {
        all: Sum::EMPTY,
        beyond_guard: Sum::EMPTY,
    };
}

/// Sum and number of the cells that count.
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

    fn take_cell(&mut self, power: Option<f32>) {
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

    fn take(&mut self, other: Option<Self>) {
        if let Some(other) = other {
            self.power -= other.power;
            self.cells = self.cells.wrapping_sub(other.cells);
        }
    }
}

impl Cfar {
    /// Whether the settings can be.
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

    /// Searches `power`, `[doppler][range]` of `num_range_bins` a row, and replaces `detections`.
    ///
    /// # Errors
    /// [`CfarError`] if the settings cannot be, if rows are not whole, or unless there is a column a
    /// range bin.
    pub fn detect<const CAPACITY: usize>(
        &self,
        power: &[f32],
        num_range_bins: usize,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<Tally, CfarError> {
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

    /// Searches the power of a map, and replaces `detections`.
    ///
    /// # Errors
    /// [`CfarError`] if the settings cannot be, or unless there is a column a range bin.
    pub fn detect_in_map<const CAPACITY: usize>(
        &self,
        map: &PatchMap<'_>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<Tally, CfarError> {
        let patch = map.header.patch;
        let bin = |index: usize, reach: u16| (index as i32).wrapping_sub(i32::from(reach));
        let cells = Cells {
            rows: patch.num_doppler_bins(),
            columns: patch.num_range_bins(),
            power: |row: usize, column: usize| {
                let value = map.at(
                    bin(row, patch.doppler_reach),
                    bin(column, patch.range_reach),
                );
                Some(value.norm_sqr())
            },
        };
        self.search(&cells, columns, detections)
    }

    fn search<P: Fn(usize, usize) -> Option<f32>, const CAPACITY: usize>(
        &self,
        cells: &Cells<P>,
        columns: &mut [Column],
        detections: &mut Vec<Detection, CAPACITY>,
    ) -> Result<Tally, CfarError> {
        self.check()?;
        LengthError::check("columns", cells.columns, columns.len()).map_err(CfarError::Length)?;
        detections.clear();
        let mut tally = Tally::default();
        let mut factor = Factor::new(self.false_alarm_probability);
        self.before_first_row(cells, columns);
        for row in 0..cells.rows {
            self.slide_to_row(cells, columns, row);
            let mut ring = self.before_first_column(columns);
            for column in 0..cells.columns {
                self.slide_to_column(columns, column, &mut ring);
                let Some(power) = cells.at(row, column).filter(|_| ring.cells > 0) else {
                    continue;
                };
                tally.tested = tally.tested.saturating_add(1);
                // Rounding may leave less than nothing of cells that are all zero.
                let sum = ring.power.max(0.0);
                if f64::from(power) > factor.of(ring.cells) * sum {
                    tally.above = tally.above.saturating_add(1);
                    if cells.is_peak(row, column, power) {
                        let noise = (sum / f64::from(ring.cells)) as f32;
                        let detection = cells.refine(row, column, power, noise);
                        tally.dropped = tally
                            .dropped
                            .saturating_add(keep(detections, detection).into());
                    }
                }
            }
        }
        Ok(tally)
    }

    /// The columns as they would be for row -1: rows from 0 on that its ring holds.
    fn before_first_row<P: Fn(usize, usize) -> Option<f32>>(
        &self,
        cells: &Cells<P>,
        columns: &mut [Column],
    ) {
        let (guard, outer) = self.doppler.bounds();
        columns.fill(Column::default());
        for row in 0..outer.min(cells.rows) {
            for (c, column) in columns.iter_mut().enumerate() {
                let cell = cells.at(row, c);
                column.all.add_cell(cell);
                if row >= guard {
                    column.beyond_guard.add_cell(cell);
                }
            }
        }
    }

    /// Moves the columns on by a row. What goes leaves before what comes enters, so that sums over a
    /// single row carry no rounding.
    fn slide_to_row<P: Fn(usize, usize) -> Option<f32>>(
        &self,
        cells: &Cells<P>,
        columns: &mut [Column],
        row: usize,
    ) {
        let (guard, outer) = self.doppler.bounds();
        for (c, column) in columns.iter_mut().enumerate() {
            let at = |row: Option<usize>| row.and_then(|row| cells.at(row, c));
            let gone = at(row.checked_sub(outer + 1));
            let come = at(Some(row + outer));
            column.all.take_cell(gone);
            column.all.add_cell(come);
            if outer > guard {
                column.beyond_guard.take_cell(gone);
                column.beyond_guard.take_cell(at(Some(row + guard)));
                column.beyond_guard.add_cell(at(row.checked_sub(guard + 1)));
                column.beyond_guard.add_cell(come);
            }
        }
    }

    /// The ring as it would be for column -1.
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

    /// Moves the ring on by a column: all of it left and right of the guard, the training rows above
    /// and below it.
    fn slide_to_column(&self, columns: &[Column], column: usize, ring: &mut Sum) {
        let (guard, outer) = self.range.bounds();
        let at = |column: Option<usize>| column.and_then(|column| columns.get(column));
        let all = |column: Option<usize>| at(column).map(|column| column.all);
        let beyond_guard = |column: Option<usize>| at(column).map(|column| column.beyond_guard);
        let passed = column.checked_sub(guard + 1);
        let reached = Some(column + guard);
        ring.take(beyond_guard(passed));
        if outer > guard {
            ring.take(all(column.checked_sub(outer + 1)));
            ring.take(all(reached));
            ring.add(all(passed));
            ring.add(all(Some(column + outer)));
        }
        ring.add(beyond_guard(reached));
    }
}

impl Reach {
    /// Cells from the middle to the last guard cell, and to the last training cell.
    fn bounds(self) -> (usize, usize) {
        let guard = usize::from(self.guard);
        (guard, guard + usize::from(self.training))
    }
}

/// The powers, wherever they come from.
struct Cells<P> {
    rows: usize,
    columns: usize,
    power: P,
}

impl<P: Fn(usize, usize) -> Option<f32>> Cells<P> {
    /// A cell's power, if there is such a cell and it counts.
    #[inline]
    fn at(&self, row: usize, column: usize) -> Option<f32> {
        if row >= self.rows || column >= self.columns {
            return None;
        }
        (self.power)(row, column).filter(|power| *power >= 0.0 && *power < f32::INFINITY)
    }

    /// Whether none of the eight neighbours is above `power`; of equal ones the first is the peak.
    fn is_peak(&self, row: usize, column: usize, power: f32) -> bool {
        let neighbour = |up: usize, right: usize| {
            // Coordinates are one too high, so that 0 is the neighbour below; it wraps out of the map.
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

    /// The detection at a peak.
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

/// Top of the parabola through the logarithms of three powers, of which the middle one is not
/// exceeded: its place, within half a bin, and its height over the middle one.
fn parabola(before: f32, peak: f32, after: f32) -> (f32, f32) {
    /// Natural logarithm of `(pi / 2)^2`: 3.9 dB, the most that a point can lose between two bins of a
    /// map of `R = F` or `D = M`. A neighbour near zero makes the parabola steep, and higher.
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

/// `Pfa^(-1/N) - 1`, computed when `N` changes.
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

/// Puts a detection into a list that falls in power; whether one, the weakest, had to be left out.
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
                f.write_str("the probability of false alarm must be above 0 and below 1")
            }
            Self::NoTraining => f.write_str(
                "there are no training cells: at least one is needed in range or Doppler",
            ),
            Self::Length(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for CfarError {}
