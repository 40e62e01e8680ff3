//! Measured error of an image on a sample of its pixels, against the exact sum.
//!
//! Two measures: relative to the power of the sampled pixels, and relative to the mean power of all
//! pixels. In a sparse scene a few pixels carry most of the power. A sample without them makes the first measure
//! large although the image is accurate; the second is then the meaningful one.

use std::collections::BTreeSet;
use std::fmt;

use anyhow::anyhow;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};
use serde::Serialize;
use subaperture::focus::exact::Exact;
use subaperture::focus::{FormError, Remedy, Task};
use subaperture::image::{ImageSource, power};

use crate::{advice, messages};

/// Seed of the sample of pixels; fixed, so that checks are reproducible.
const SEED: u64 = 1;

/// Memory per checked pixel, bytes: point, sum, index, and its entry in the sampling set.
const PIXEL_BYTES: u64 = 100;

/// Check that fits the memory budget.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    num_pixels: usize,
    /// Memory left for pulses, bytes.
    left_bytes: u64,
}

/// Measured error of an image.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Check {
    /// Number of pixels compared.
    pub(super) num_pixels: usize,
    /// Root of the summed squared error over the summed squared exact values, dB; `None` where those
    /// are zero.
    pub(super) relative_rms_db: Option<f64>,
    /// Root of the mean squared error over the image's mean square, dB; `None` where that is zero.
    pub(super) relative_to_image_db: Option<f64>,
    /// Seed of the sample of pixels.
    pub(super) seed: u64,
}

impl Plan {
    /// Plan to form `count` pixels of the task's grid (at most all) by the exact sum, in memory shared with the recording and the
    /// `image_bytes` of the image.
    ///
    /// # Errors
    /// [`FormError::Memory`].
    pub(super) fn new(task: &Task, image_bytes: u64, count: usize) -> Result<Self, FormError> {
        let num_pixels = (count as u64).min(task.grid.num_pixels());
        let needed_bytes = u128::from(task.history.held_bytes())
            + u128::from(image_bytes)
            + u128::from(num_pixels) * u128::from(PIXEL_BYTES);
        match u128::from(task.memory_bytes).checked_sub(needed_bytes) {
            Some(left_bytes) => Ok(Self {
                num_pixels: num_pixels as usize,
                left_bytes: left_bytes as u64,
            }),
            None => Err(FormError::Memory {
                purpose: advice::CHECK,
                needed_bytes,
                budget_bytes: task.memory_bytes,
                remedies: &[Remedy::MoreMemory],
            }),
        }
    }

    /// Plan a check of an image that is read in parts; the largest part counts as memory of the image.
    pub(super) fn of_parts(
        task: &Task,
        image: &dyn ImageSource,
        count: usize,
    ) -> Result<Self, FormError> {
        let pixels = image
            .places()
            .map(|[rows, columns]| rows.len() * columns.len());
        let part_bytes = 16 * pixels.max().unwrap_or(0) as u64;
        Self::new(task, part_bytes, count)
    }

    /// Form the sample by the exact sum, compare the `image` with it, and warn if the error is above `bound_db`.
    pub(super) fn against_exact(
        &self,
        task: &Task,
        image: &dyn ImageSource,
        bound_db: Option<f64>,
    ) -> anyhow::Result<Check> {
        let columns = task.grid.columns.count;
        let total = task.grid.num_pixels() as usize;
        let chosen = choose(total, self.num_pixels);
        let exact = Exact::at_pixels(
            task.history,
            task.weights,
            task.grid,
            &chosen,
            self.left_bytes,
            task.monitor,
        )?;
        let (mut error, mut image_power) = (0.0, 0.0);
        for place in image.places() {
            let part = image.window(&place).map_err(|error| anyhow!(error))?;
            image_power += part.pixels.iter().map(|&z| power(z)).sum::<f64>();
            let [rows, across] = place;
            for row in rows.clone() {
                let first = chosen.partition_point(|&i| i < row * columns + across.start);
                let end = chosen.partition_point(|&i| i < row * columns + across.end);
                for (&i, value) in chosen[first..end].iter().zip(&exact[first..end]) {
                    let (row, column) = (row - rows.start, i % columns - across.start);
                    let pixel = part.pixels[row * part.columns + column];
                    error += (f64::from(pixel.re) - value.re).powi(2)
                        + (f64::from(pixel.im) - value.im).powi(2);
                }
            }
        }
        let exact_power: f64 = exact.iter().map(|value| value.norm_sqr()).sum();
        let share = chosen.len() as f64 / total as f64;
        let relative_db = |power: f64| (power > 0.0).then(|| 10.0 * (error / power).log10());
        let check = Check {
            num_pixels: chosen.len(),
            relative_rms_db: relative_db(exact_power),
            relative_to_image_db: relative_db(image_power * share),
            seed: SEED,
        };
        if let Some(bound_db) = bound_db {
            check.judge(bound_db);
        }
        Ok(check)
    }
}

impl Check {
    /// Warn if the error relative to the image's mean power is above `bound_db`.
    fn judge(&self, bound_db: f64) {
        if let Some(error_db) = self.relative_to_image_db
            && error_db > bound_db
        {
            messages::bound_missed(format!(
                "error measured on {} pixels is {error_db:.1} dB, above the bound --error-db {bound_db}",
                self.num_pixels
            ));
        }
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decibels = |value: Option<f64>| match value {
            None => "undefined".to_owned(),
            Some(value) => format!("{value:.1} dB"),
        };
        write!(
            f,
            "error against the exact sum on {} pixels: {} of their power, {} of an average pixel's",
            self.num_pixels,
            decibels(self.relative_rms_db),
            decibels(self.relative_to_image_db)
        )
    }
}

/// `count` distinct numbers below `total`, ascending.
fn choose(total: usize, count: usize) -> Vec<usize> {
    if count >= total {
        return (0..total).collect();
    }
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let below = Uniform::new(0, total).expect("an image has pixels");
    let mut chosen = BTreeSet::new();
    while chosen.len() < count {
        chosen.insert(below.sample(&mut random));
    }
    chosen.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::choose;

    #[test]
    fn pixels_are_different_and_in_range() {
        let chosen = choose(1000, 400);
        assert_eq!(chosen.len(), 400);
        assert!(chosen.windows(2).all(|w| w[0] < w[1]) && chosen[399] < 1000);
        assert_eq!(choose(3, 9), [0, 1, 2]);
    }
}
