//! An image's error, measured on some of its pixels against the exact sum.
//!
//! Two measures: relative to the power of those same pixels, and relative to the power of as many
//! average pixels of the image. A sparse scene keeps its power in few pixels; a sample that misses
//! them makes the first large for no fault of the image, and the second the fairer one.

use std::collections::BTreeSet;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};
use serde::Serialize;
use subaperture::focus::exact::Exact;
use subaperture::focus::{FormError, Task};
use subaperture::image::Image;

/// Seed of the pixels' choice: the same pixels every time.
const SEED: u64 = 1;

/// The outcome.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Check {
    /// Pixels compared.
    pub(super) num_pixels: usize,
    /// Root of the summed squared error over the summed squared exact values, dB.
    pub(super) relative_rms_db: f64,
    /// Root of the mean squared error over the image's mean square, dB.
    pub(super) relative_to_image_db: f64,
    /// Seed of the pixels' choice.
    pub(super) seed: u64,
}

/// Forms `count` pixels of the task's grid (all, if it has no more) by the exact sum.
pub(super) fn against_exact(task: &Task, image: &Image, count: usize) -> Result<Check, FormError> {
    let chosen = choose(image.pixels.len(), count);
    let points: Vec<_> = chosen
        .iter()
        .map(|i| task.grid.position_m(i / image.columns, i % image.columns))
        .collect();
    let exact = Exact::at_points(
        task.history,
        task.weights,
        &points,
        task.memory_bytes,
        task.monitor,
    )?;
    let (mut error, mut power) = (0.0, 0.0);
    for (&i, value) in chosen.iter().zip(&exact) {
        let pixel = image.pixels[i];
        error +=
            (f64::from(pixel.re) - value.re).powi(2) + (f64::from(pixel.im) - value.im).powi(2);
        power += value.norm_sqr();
    }
    let image_power: f64 = image.pixels.iter().map(|z| f64::from(z.norm_sqr())).sum();
    let share = chosen.len() as f64 / image.pixels.len() as f64;
    Ok(Check {
        num_pixels: chosen.len(),
        relative_rms_db: 10.0 * (error / power).log10(),
        relative_to_image_db: 10.0 * (error / (image_power * share)).log10(),
        seed: SEED,
    })
}

/// `count` different numbers below `total`, ascending.
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
