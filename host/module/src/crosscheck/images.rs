//! Check of the host's `rdbp` maps by the image of one sub-CPI, interpolated from one map per patch as in the former.
//!
//! **Error.** `E` over all `N` pixels is estimated from the `B` brightest, which may contain most of it, and `S` evenly spaced others:
//!
//! ```text
//! E = sum_B |I - sum|^2 + (N - B)/S sum_S |I - sum|^2,   relative to  max(sum_N |I|^2, N T)
//! ```
//!
//! `T` is the power of the weighted samples, `sum |w z|^2 / (sum w)^2`: the mean of `|I|^2` over all resolvable positions
//! (Parseval). A plan's error is relative to an image that covers the bright scatterers of the scene, whose mean is at least
//! `T`; the pixels of a grid elsewhere may be darker.

use std::ops::Range;

use num_complex::{Complex32, Complex64};

use super::measure::ratio_db;
use super::plain;
use subaperture_focus::rdbp::RangeDopplerBackprojection;
use subaperture_focus::{FormError, ImageFormer, MARGIN_DB, Numerics, Task};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::power;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{PhaseHistory, PulseRange, Weights};

/// Maximum number of rows and columns of the image.
pub(super) const MAX_SIDE: usize = 256;

/// Numbers of brightest pixels and other pixels compared.
const BRIGHTEST: usize = 64;
const SPREAD: usize = 192;

/// Error of a sub-CPI's maps in its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// Relative RMS error in dB.
    pub error_db: f64,
    /// Error that the former's plan predicts in dB.
    pub planned_db: f64,
}

impl Image {
    /// Error bound of the plan in dB: plans reserve [`MARGIN_DB`] for scenes with their power in few pixels.
    pub fn bound_db(&self) -> f64 {
        self.planned_db + MARGIN_DB
    }

    /// Whether the error is within the bound.
    pub fn within(&self) -> bool {
        self.error_db <= self.bound_db()
    }
}

/// Middle of `grid`, with the number of pixels that are formed.
pub(super) fn middle(grid: &ImageGrid) -> ImageGrid {
    let mut part = grid.clone();
    for axis in [&mut part.rows, &mut part.columns] {
        let count = axis.count.min(MAX_SIDE);
        axis.start = axis.at((axis.count - count) / 2);
        axis.count = count;
    }
    part
}

/// Form the image of a sub-CPI by `rdbp` with a single sub-CPI and compare it with the sum.
pub(super) fn compare(
    history: &dyn PhaseHistory,
    pulses: Range<usize>,
    samples: &[Complex32],
    grid: &ImageGrid,
    weights: &Weights,
    memory_bytes: u64,
) -> Result<Image, FormError> {
    let own = Weights {
        fast: weights.fast.clone(),
        slow: weights.slow[pulses.clone()].to_vec(),
        illumination: None,
        windows: None,
    };
    let stretch = PulseRange::new(history, pulses.clone());
    let formed = RangeDopplerBackprojection::default()
        .sub_cpi(pulses.len())
        .form_planned(&Task {
            history: &stretch,
            grid,
            weights: &own,
            numerics: Numerics::default(),
            memory_bytes,
            monitor: &Silent,
        })?;
    let pixels = &formed.image.pixels;
    let mut order: Vec<usize> = (0..pixels.len()).collect();
    order.sort_by(|&a, &b| power(pixels[b]).total_cmp(&power(pixels[a])));
    let (brightest, others) = order.split_at_mut(BRIGHTEST.min(pixels.len()));
    others.sort_unstable();
    let spread: Vec<usize> = match others.len() <= SPREAD {
        true => others.to_vec(),
        false => (0..SPREAD)
            .map(|i| others[i * others.len() / SPREAD])
            .collect(),
    };
    let columns = grid.columns.count;
    let error = |at: &[usize]| -> f64 {
        let place = |&i: &usize| grid.position_m(i / columns, i % columns).to_array();
        let points_m: Vec<[f64; 3]> = at.iter().map(place).collect();
        let of = &history.collection().pulses[pulses.clone()];
        let expected = plain::image(of, samples, (&own.fast, &own.slow), &points_m);
        let pairs = at.iter().zip(expected);
        pairs
            .map(|(&i, sum)| {
                let z = pixels[i];
                (Complex64::new(z.re.into(), z.im.into()) - sum).norm_sqr()
            })
            .sum()
    };
    let of_others = others.len() as f64 / spread.len().max(1) as f64;
    let error = error(brightest) + of_others * error(&spread);
    let shown: f64 = pixels.iter().map(|&z| power(z)).sum();
    Ok(Image {
        error_db: ratio_db(error, shown.max(pixels.len() as f64 * terms(samples, &own))),
        planned_db: formed.predicted_error_db,
    })
}

/// Mean power over all resolvable positions.
fn terms(samples: &[Complex32], weights: &Weights) -> f64 {
    let rows = samples.chunks_exact(weights.fast.len()).zip(&weights.slow);
    let sum: f64 = rows
        .map(|(row, slow)| {
            let row = row.iter().zip(&weights.fast);
            slow * slow * row.map(|(&z, fast)| fast * fast * power(z)).sum::<f64>()
        })
        .sum();
    let norm = weights.fast.iter().sum::<f64>() * weights.slow.iter().sum::<f64>();
    sum / (norm * norm)
}
