//! What an image former takes for a collection, and memory as the thesis counts it.
//!
//! [`FormerCost`] is what a former counts of what it decides ([`subaperture_focus::cost`]): its own folder has the formula.
//!
//! [`ThesisMemory`] counts as Schone 2020, 5.2: complex float64 (16 bytes), range padded tenfold.
//!
//! ```text
//! profile 16 (10 K)      map 16 (10 K) D      image 16 P      range and Doppler 2 8 P      line of sight 3 16 P
//! ```
//!
//! for `P` pixels, pulses of `K` frequencies and maps of `D` Doppler bins. The last is his "nearly 20 GB" for 400 million pixels:
//! 19.2 GB at 16 bytes a component. As real numbers, which they are, a vector takes 9.6 GB; so counted, 20 GB hold it and the
//! pixels' positions.

use serde::Serialize;

use subaperture_focus::cost::{Buffer, Each};
use subaperture_focus::{Aim, Asked, FormError, ImageFormer, Misses};
use subaperture_model::monitor::Silent;

/// Range upsampling of the thesis.
const THESIS_RANGE_PADDING: usize = 10;

/// Bytes as the thesis counts them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ThesisMemory {
    /// An upsampled range profile: all that backprojection holds beside the image.
    pub profile_bytes: u128,
    /// A range-Doppler map.
    pub map_bytes: u128,
    /// The image.
    pub image_bytes: u128,
    /// Range and Doppler of every pixel.
    pub range_and_doppler_bytes: u128,
    /// Line of sight to every pixel.
    pub line_of_sight_bytes: u128,
}

impl ThesisMemory {
    /// For `frequencies` a pulse, maps padded to `doppler_length`, and `pixels`.
    pub fn new(frequencies: usize, doppler_length: usize, pixels: u64) -> Self {
        let profile_bytes = 16 * THESIS_RANGE_PADDING as u128 * frequencies as u128;
        let pixels = u128::from(pixels);
        Self {
            profile_bytes,
            map_bytes: profile_bytes * doppler_length as u128,
            image_bytes: 16 * pixels,
            range_and_doppler_bytes: 2 * 8 * pixels,
            line_of_sight_bytes: 3 * 16 * pixels,
        }
    }
}

/// The work to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Frequencies a pulse.
    pub frequencies: usize,
    /// Pulses.
    pub pulses: usize,
    /// Pixels.
    pub pixels: u64,
}

/// What one former takes, as it decides by its settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FormerCost {
    /// Its name.
    pub algorithm: String,
    /// Planned relative RMS error of the image, dB.
    pub planned_db: f64,
    /// Buffers and their bytes, one thread's, the image first.
    pub memory: Vec<Buffer>,
    /// Sum of the buffers.
    pub total_bytes: u64,
    /// Real operations for the image.
    pub operations: f64,
    /// Operations for each pixel and pulse.
    pub per_pixel_and_pulse: f64,
}

impl FormerCost {
    /// Of `former` for the image of `aim`, whatever error that means.
    ///
    /// # Errors
    /// [`FormError`] if that does not suit it.
    pub fn of(former: &dyn ImageFormer, aim: &Aim, name: String) -> Result<Self, FormError> {
        let any = Asked {
            bound_db: None,
            misses: Misses::Allowed,
        };
        let decision = former.decide(aim, &any, &Silent)?;
        let (pixels, pulses) = (aim.grid.num_pixels(), aim.collection.pulses.len());
        let cost = decision.cost;
        let image = Buffer {
            name: "image".into(),
            each: Each::Pixels,
            bytes: 8 * pixels,
        };
        Ok(Self {
            algorithm: name,
            planned_db: decision.planned_db,
            total_bytes: image.bytes.saturating_add(cost.bytes(1.0)),
            operations: cost.operations,
            per_pixel_and_pulse: cost.operations / (pixels as f64 * pulses as f64),
            memory: std::iter::once(image).chain(cost.buffers).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn section_5_2_is_reproduced() {
        // 21,232 frequencies x 10 = 212,320 bins of 16 bytes: "about 3.4 MB"; by 512: 1.74 GB; by 8192: 27.83 GB;
        // 400 million pixels: 6.4 GB, 6.4 GB, "nearly 20 GB".
        let short = ThesisMemory::new(21_232, 512, 400_000_000);
        assert_eq!(short.profile_bytes, 3_397_120);
        assert_eq!(short.map_bytes, 1_739_325_440);
        assert_eq!(short.image_bytes, 6_400_000_000);
        assert_eq!(short.range_and_doppler_bytes, 6_400_000_000);
        assert_eq!(short.line_of_sight_bytes, 19_200_000_000);
        let long = ThesisMemory::new(21_232, 8192, 400_000_000);
        assert_eq!(long.map_bytes, 27_829_207_040);
    }
}
