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
//! **Input**: powers `[doppler][range]`, or a [`PatchMap`](crate::stream::PatchMap). **Output**: positions in bins from the centre bin
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
mod cells;
mod columns;
mod search;
mod settings;

pub use columns::Column;
pub use search::CfarSearch;
pub use settings::{CellCounts, Cfar, CfarError, Detection, TrainingWindow};
