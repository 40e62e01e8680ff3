//! Coherent change detection (CCD): pixels whose coherence is lower than that of the unchanged scene explains.
//!
//! A pixel is changed if its sample coherence lies below the threshold `t` with
//!
//! ```text
//! P(d < t | D, L) = false-alarm probability
//! ```
//!
//! for the coherence `D` of the unchanged scene and the effective number of looks `L` of the window. Where `D` is not given, the median of the sample coherence
//! over the tested pixels is inverted by the same distribution, so that changes of a small part of the scene hardly affect it.
//!
//! Pixels whose window has a low power in both images (shadow, calm water, noise) are incoherent without change: they are masked. Where one image is bright,
//! the pixel is tested: an object that came or left is a change.

use subaperture_model::image::Image;
use subaperture_quality::PixelMap;

use crate::{
    Autocorrelation, CoherenceDistribution, Interferogram, InterferometryError,
    coherence_of_median, interferogram,
};

/// Settings of change detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rows and columns of the window, odd.
    pub window: [usize; 2],
    /// False-alarm probability per pixel, between 0 and 1.
    pub false_alarm_probability: f64,
    /// Coherence of the unchanged scene; `None` estimates it.
    pub coherence: Option<f64>,
    /// Effective number of independent looks of the window; `None` estimates it from the images.
    pub looks: Option<f64>,
    /// Mean power of the stronger image, relative to the median over the scene, below which a pixel is masked, dB.
    pub floor_db: f64,
}

impl Default for Settings {
    /// 7 x 7 pixels, a false-alarm probability of 1e-3, a floor of -10 dB; coherence and looks are estimated.
    fn default() -> Self {
        Self {
            window: [7, 7],
            false_alarm_probability: 1e-3,
            coherence: None,
            looks: None,
            floor_db: -10.0,
        }
    }
}

/// Numbers of pixels by the result of their test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct PixelCounts {
    /// Pixels with a coherence below the threshold.
    pub changed: usize,
    /// Pixels with a coherence at or above the threshold.
    pub unchanged: usize,
    /// Pixels of low power, not tested.
    pub masked: usize,
    /// Pixels without a full window, not tested.
    pub undefined: usize,
}

impl PixelCounts {
    /// Fraction of the tested pixels that changed.
    pub fn fraction_changed(&self) -> f64 {
        self.changed as f64 / (self.changed + self.unchanged).max(1) as f64
    }
}

/// Change map of two images.
#[derive(Clone, Debug)]
pub struct ChangeMap {
    /// 1 for changed pixels, 0 for unchanged ones, NaN for those not tested.
    pub map: PixelMap,
    /// Numbers of pixels by result.
    pub counts: PixelCounts,
    /// Interferogram with the coherence that was tested.
    pub interferogram: Interferogram,
    /// Effective number of independent looks of the window.
    pub looks: f64,
    /// Coherence of the unchanged scene, given or estimated.
    pub coherence: f64,
    /// Threshold of the sample coherence.
    pub threshold: f64,
}

impl ChangeMap {
    /// Probability of detecting a change that lowers the coherence to this value.
    ///
    /// # Errors
    /// [`InterferometryError::Coherence`].
    pub fn detection_probability(&self, changed: f64) -> Result<f64, InterferometryError> {
        Ok(CoherenceDistribution::new(changed, self.looks)?.probability_below(self.threshold))
    }
}

/// Detect changes between two registered complex images of one size. Memory is 32 bytes per pixel.
///
/// # Errors
/// [`InterferometryError`] for images of different sizes, settings out of range, or images without a testable pixel.
pub fn detect_changes(
    image: &Image,
    reference: &Image,
    settings: &Settings,
) -> Result<ChangeMap, InterferometryError> {
    let window = settings.window;
    let interferogram = interferogram(image, reference, window)?;
    let looks = match settings.looks {
        Some(looks) => looks,
        None => {
            let [own, other] =
                [image, reference].map(|image| Autocorrelation::estimate(image, window));
            own?.mean(&other?).looks(window)
        }
    };
    let empty = InterferometryError::Empty(image.pixels.len());
    let powers = &interferogram.power.values;
    let typical = median(powers.iter().copied()).ok_or(empty.clone())?;
    let floor = f64::from(typical) * libm::pow(10.0, settings.floor_db / 10.0);
    let is_masked = |power: f32| f64::from(power) < floor;
    let magnitude = interferogram.magnitude();
    let coherence = match settings.coherence {
        Some(coherence) => coherence,
        None => {
            let tested = magnitude.values.iter().zip(powers);
            let tested = tested.filter(|(_, power)| !is_masked(**power));
            let middle = median(tested.map(|(d, _)| *d)).ok_or(empty)?;
            coherence_of_median(middle.into(), looks)?
        }
    };
    let distribution = CoherenceDistribution::new(coherence, looks)?;
    let threshold = distribution.threshold(settings.false_alarm_probability)?;
    let mut counts = PixelCounts::default();
    let test = |(&d, &power): (&f32, &f32)| {
        let (count, value) = match f64::from(d) {
            d if d.is_nan() => (&mut counts.undefined, f32::NAN),
            _ if is_masked(power) => (&mut counts.masked, f32::NAN),
            d if d < threshold => (&mut counts.changed, 1.0),
            _ => (&mut counts.unchanged, 0.0),
        };
        *count += 1;
        value
    };
    let values = magnitude.values.iter().zip(powers).map(test).collect();
    Ok(ChangeMap {
        map: PixelMap {
            values,
            ..magnitude
        },
        counts,
        interferogram,
        looks,
        coherence,
        threshold,
    })
}

/// Median of the finite values; `None` without a finite value.
fn median(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut values: Vec<f32> = values.filter(|value| value.is_finite()).collect();
    let middle = values.len() / 2;
    match values.is_empty() {
        true => None,
        false => Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1),
    }
}
