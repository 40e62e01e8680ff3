//! Memory and operations of image formers, and memory by the thesis's count.
//!
//! [`FormerCost`] is the former's own count for its plan ([`subaperture_focus::cost`]); the former's module has the formula.
//!
//! [`ThesisMemory`] follows Schone 2020, 5.2: complex float64 (16 bytes), range padded tenfold.
//!
//! ```text
//! profile 16 (10 K)      map 16 (10 K) D      image 16 P      range and Doppler 2 8 P      line of sight 3 16 P
//! ```
//!
//! for `P` pixels, pulses of `K` frequencies and maps of `D` Doppler bins. The last is the thesis's "nearly 20 GB" for 400 million pixels:
//! 19.2 GB at 16 bytes per component. With real components a vector takes 9.6 GB; 20 GB would then hold it and the
//! pixels' positions.

use serde::Serialize;

use subaperture_focus::cost::{Buffer, Copies};
use subaperture_focus::{BoundPolicy, ErrorGoal, FormError, ImageFormer, ImageSpec};
use subaperture_model::monitor::Silent;

/// Range upsampling of the thesis.
const THESIS_RANGE_PADDING: usize = 10;

/// Memory by the thesis's count, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ThesisMemory {
    /// Upsampled range profile: the memory of backprojection apart from the image.
    pub profile_bytes: u128,
    /// Range-Doppler map of a sub-CPI.
    pub map_bytes: u128,
    /// Complex image on a grid.
    pub image_bytes: u128,
    /// Range and Doppler of all pixels.
    pub range_and_doppler_bytes: u128,
    /// Line of sight of all pixels.
    pub line_of_sight_bytes: u128,
}

impl ThesisMemory {
    /// Count for `frequencies` per pulse, maps padded to `doppler_length`, and `pixels`.
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

/// Problem size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Frequencies per pulse.
    pub frequencies: usize,
    /// Number of pulses.
    pub pulses: usize,
    /// Number of pixels.
    pub pixels: u64,
}

/// Cost of one image former with its settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FormerCost {
    /// Name of the algorithm.
    pub algorithm: String,
    /// Planned relative RMS error of the image, dB.
    pub planned_db: f64,
    /// Buffers of one thread, bytes; the image first.
    pub memory: Vec<Buffer>,
    /// Sum of the buffers, bytes.
    pub total_bytes: u64,
    /// Real arithmetic operations for the image.
    pub operations: f64,
    /// Real arithmetic operations per pixel and pulse.
    pub per_pixel_and_pulse: f64,
}

impl FormerCost {
    /// Cost of `former` for the image of `spec`, whatever its error.
    ///
    /// # Errors
    /// [`FormError`] if the former cannot form the image.
    pub fn of(former: &dyn ImageFormer, spec: &ImageSpec, name: String) -> Result<Self, FormError> {
        let any = ErrorGoal {
            bound_db: None,
            bound_policy: BoundPolicy::Allowed,
        };
        let decision = former.decide(spec, &any, &Silent)?;
        let (pixels, pulses) = (spec.grid.num_pixels(), spec.collection.pulses.len());
        let cost = decision.cost;
        let image = Buffer {
            name: "image".into(),
            each: Copies::Pixels,
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
    fn thesis_memory_agrees_with_section_5_2() {
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
