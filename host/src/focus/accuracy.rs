//! The accuracy contract: what every former says of its image's error, and that a bound asked for is
//! kept or its miss is told.
//!
//! **The error** is relative and RMS over all pixels of the grid, `sqrt(sum |I - E|^2 / sum |E|^2)`, in
//! dB: `I` the image, `E` the sum of [`super`] over the stored samples, evaluated exactly. It is relative to
//! what the grid shows: of a grid that leaves the bright scatterers out, the image is weak, and the
//! same errors are relatively larger.
//!
//! **What a former plans.** A former multiplies each of the sum's terms by `1 + d` (`d` complex, of pixel,
//! pulse and frequency). Before anything heavy it bounds the RMS of `d` for its track, band and
//! grid: the *planned* error. If that misses the bound asked, it refuses ([`Asked::check`]).
//!
//! Where antennas move from sample to sample of a pulse and the former takes all samples at one place, what that leaves
//! ([`super::sweep::residual`]) is added for it.
//!
//! **What becomes of the image.** Where terms add in phase, an image's error is at most the RMS of `d` of
//! the value itself (Cauchy and Schwarz). Where they do not, powers add: the error's is the RMS of `d`, squared,
//! of the sum of the terms' powers,
//!
//! ```text
//! T = sum_n sum_k |w_slow[n] w_fast[k] z[n][k]|^2 / (sum_n w_slow[n]  sum_k w_fast[k])^2
//! ```
//!
//! whatever the image shows there. With `M` the image's mean square and `P` pixels, `N` terms,
//!
//! ```text
//! predicted^2 = planned^2 min(M + T (1 + C / P), N T) / M
//! ```
//!
//! `T` is summed as the pulses are read, `M` taken of the image; `C / P` is for the scatter of a mean over few pixels
//! ([`SCATTER`]), and `N T` is what the terms come to all in phase. `M` is far above `T` where
//! scatterers are in view, about `T` where noise or clutter is, and far below on a dark grid, whose prediction so
//! tells the truth. A bound missed in this way is an error too, after the work.
//!
//! Accuracy: `tests/random_formers.rs` measures every former against the sum over thousands of random
//! geometries, scenes and grids.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use num_complex::Complex32;

use super::{FormError, Formed, Task, rounding, sweep};
use crate::geometry::ImageGrid;
use crate::image::power;
use crate::phase_history::{Collection, InputFile, PhaseHistory, ReadError};

/// How far the mean of few pixels' errors scatters: `C` in the module's formula. A lone pixel's power is
/// above 20 times its mean with a probability of `exp(-20)` if its terms are independent.
const SCATTER: f64 = 20.0;

/// Whether an image may be worse than asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misses {
    /// A missed bound is [`FormError::BoundMissed`].
    Refused,
    /// A missed bound is recorded.
    Allowed,
}

/// What is asked of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Bound on the error, dB, if there is one.
    pub bound_db: Option<f64>,
    /// Whether it may be missed.
    pub misses: Misses,
}

impl Asked {
    /// Goes on if an image predicted to err by `predicted_db` will do. `limit` says what limits it and what
    /// to do.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`] if it will not.
    pub fn check(
        &self,
        predicted_db: f64,
        limit: impl FnOnce() -> String,
    ) -> Result<(), FormError> {
        match self.bound_db {
            Some(bound_db)
                if self.misses == Misses::Refused && misses(predicted_db, Some(bound_db)) =>
            {
                Err(FormError::BoundMissed {
                    predicted_db,
                    bound_db,
                    limit: limit(),
                })
            }
            _ => Ok(()),
        }
    }
}

/// Whether a prediction misses a bound; one that is no number does.
pub(super) fn misses(predicted_db: f64, bound_db: Option<f64>) -> bool {
    bound_db.is_some_and(|bound_db| predicted_db.is_nan() || predicted_db > bound_db)
}

/// Forms an image by `form`, which returns it with its planned error, under the contract.
///
/// # Errors
/// Those of `form`; [`FormError::NotFinite`]; [`FormError::BoundMissed`].
pub(super) fn keep(
    task: &Task,
    asked: Asked,
    follows_sweeps: bool,
    form: impl FnOnce(&Task) -> Result<Formed, FormError>,
) -> Result<Formed, FormError> {
    task.check()?;
    let swept = match follows_sweeps {
        true => 0.0,
        false => sweep::residual(task.history.collection(), task.grid),
    };
    asked.check(20.0 * swept.log10(), || {
        "the antennas move from sample to sample of a pulse, and this former takes all samples of one at one place: \
         use --algorithm rdbp or bp"
            .to_owned()
    })?;
    let metered = Metered::new(task);
    let mut formed = form(&Task {
        history: &metered,
        ..*task
    })?;
    check_finite(&formed, task.grid)?;
    let planned_db = match swept > 0.0 {
        true => rounding::total_db(&[10f64.powf(formed.predicted_error_db / 20.0), swept]),
        false => formed.predicted_error_db,
    };
    let terms = metered.power();
    let pixels = formed.image.pixels.len() as f64;
    let mean = formed.image.pixels.iter().map(|&z| power(z)).sum::<f64>() / pixels;
    let num_terms = task.history.collection().pulses.len() as f64
        * task.history.collection().num_samples as f64;
    let at_most = (mean + terms * (1.0 + SCATTER / pixels)).min(num_terms * terms);
    // Nothing recorded: nothing to err by.
    let darkness_db = match terms > 0.0 {
        true => 10.0 * (at_most / mean).max(1.0).log10(),
        false => 0.0,
    };
    formed.expect(asked.bound_db, planned_db + darkness_db);
    formed
        .settings
        .insert("planned_error_db".to_owned(), planned_db.into());
    asked.check(formed.predicted_error_db, || {
        format!(
            "the former's own error is {planned_db:.1} dB, but the grid is dark, its mean square {:.1} dB from \
             what a pixel would hold of the recording's scattered power: include bright scatterers in --grid, \
             or plan {darkness_db:.0} dB more with --error-db {:.0}",
            10.0 * (mean / terms).log10(),
            (asked.bound_db.unwrap_or(0.0) - darkness_db).floor()
        )
    })?;
    Ok(formed)
}

/// Refuses an image with a pixel that is NaN or infinite.
pub(super) fn check_finite(formed: &Formed, grid: &ImageGrid) -> Result<(), FormError> {
    let finite = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
    match formed.image.pixels.iter().position(|z| !finite(z)) {
        None => Ok(()),
        Some(i) => {
            let (row, column) = (i / formed.image.columns, i % formed.image.columns);
            Err(FormError::NotFinite {
                row,
                column,
                position_m: grid.position_m(row, column).to_array(),
            })
        }
    }
}

/// A history whose samples' weighted power is summed as they are read.
struct Metered<'a> {
    task: &'a Task<'a>,
    /// Power of each pulse as the bits of a float64: the sum over them is the same in whatever order they
    /// are read.
    powers: Vec<AtomicU64>,
}

impl<'a> Metered<'a> {
    fn new(task: &'a Task<'a>) -> Self {
        let pulses = task.history.collection().pulses.len();
        Self {
            task,
            powers: (0..pulses).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// `T` of the pulses read.
    fn power(&self) -> f64 {
        let slow = &self.task.weights.slow;
        let each = self.powers.iter().zip(slow);
        let sum: f64 = each
            .map(|(bits, w)| w * w * f64::from_bits(bits.load(Ordering::Relaxed)))
            .sum();
        sum * self.task.weights.normalisation().powi(2)
    }
}

impl PhaseHistory for Metered<'_> {
    fn collection(&self) -> &Collection {
        self.task.history.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.task.history.read(pulses.clone(), samples)?;
        let rows = samples.chunks_exact(self.collection().num_samples);
        for (n, row) in pulses.zip(rows) {
            let terms = row.iter().zip(&self.task.weights.fast);
            let sum: f64 = terms.map(|(&z, w)| w * w * power(z)).sum();
            self.powers[n].store(sum.to_bits(), Ordering::Relaxed);
        }
        Ok(())
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.task.history.true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        self.task.history.held_bytes() + size_of_val(self.powers.as_slice()) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.task.history.inputs()
    }
}
