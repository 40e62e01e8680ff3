//! How long what formers do takes on one core: by what they choose among ways that are as good as each other.
//!
//! [`TimeModel::DEFAULT`] stands here, so that every machine makes the same plan. It was measured once, on a core with 512-bit registers at
//! 3.5 GHz (`cargo bench --bench kernels`). A model of another machine is asked for, and is part of the plan and of the record: whoever carries
//! the plan out does what it chose.

use std::borrow::Cow;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

/// Times of one core, nanoseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeModel {
    /// What it is of.
    pub name: Cow<'static, str>,
    /// Transforms: of a bin, for each doubling of the length.
    pub transform_ns: f64,
    /// The same in slow time by chirp-z, with the copies beside it.
    pub map_transform_ns: f64,
    /// A piece of a range profile, for each of its spline's coefficients.
    pub piece_ns: f64,
    /// Backprojection in tiles: of a pulse and tile,
    pub tile_pulse_ns: f64,
    /// of a group of its pixels,
    pub tile_group_ns: f64,
    /// of each of the group's coefficients, where bins lie side by side,
    pub narrow_plane_ns: f64,
    /// less so,
    pub wide_plane_ns: f64,
    /// and apart.
    pub scattered_plane_ns: f64,
    /// Backprojection of a pixel and pulse by its own path.
    pub point_ns: f64,
    /// The same where samples are taken in motion.
    pub blurred_point_ns: f64,
    /// Histories of patches: a sample turned,
    pub turn_ns: f64,
    /// a tap over pulses,
    pub pulse_tap_ns: f64,
    /// a tap over samples,
    pub sample_tap_ns: f64,
    /// a pulse,
    pub history_pulse_ns: f64,
    /// and deciding on a patch.
    pub patch_ns: f64,
    /// Leaves: of a pulse,
    pub leaf_pulse_ns: f64,
    /// of a group of pixels,
    pub leaf_group_ns: f64,
    /// and of a piece of the profile.
    pub leaf_piece_ns: f64,
    /// Range-Doppler maps: compensating a sample,
    pub compensation_ns: f64,
    /// of a pulse and Doppler bin of a frequency, as a product of matrices,
    pub doppler_tap_ns: f64,
    /// of a pixel,
    pub map_pixel_ns: f64,
    /// and of each tap that it is read with.
    pub map_tap_ns: f64,
    /// The exact sum: of a pixel, pulse and frequency,
    pub sum_ns: f64,
    /// and where samples are taken in motion.
    pub swept_sum_ns: f64,
    /// A sample spread onto a raster, or read from one, for each tap.
    pub raster_tap_ns: f64,
    /// A phasor in float64, with the phase that it is of.
    pub phasor_ns: f64,
}

/// What times may be: sums of them are numbers, whatever is formed.
pub const TIMES_NS: RangeInclusive<f64> = 1e-6..=1e12;

/// What the text of a model says of itself.
pub const SCHEMA: &str = "subaperture-time-model-3";

/// Why there is no model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeModelError {
    /// The text is none of a model.
    #[error("this is no time model: {0}")]
    Text(String),
    /// It is of another version of the program.
    #[error("the time model is of the form '{found}', and {SCHEMA} is read: measure it again")]
    Schema {
        /// What it says of itself.
        found: String,
    },
    /// A number that is no time.
    #[error(
        "{entry} of the time model '{model}' is no time: a number of nanoseconds from 1e-6 to 1e12 is wanted"
    )]
    Time {
        /// The model's name.
        model: String,
        /// Which number.
        entry: String,
    },
}

impl TimeModel {
    /// What is taken unless another is asked for.
    pub const DEFAULT: Self = Self {
        name: Cow::Borrowed("default"),
        transform_ns: 0.3,
        map_transform_ns: 0.7,
        piece_ns: 1.0,
        tile_pulse_ns: 110.0,
        tile_group_ns: 4.7,
        narrow_plane_ns: 1.1,
        wide_plane_ns: 1.6,
        scattered_plane_ns: 20.0,
        point_ns: 9.0,
        blurred_point_ns: 60.0,
        turn_ns: 0.5,
        pulse_tap_ns: 0.05,
        sample_tap_ns: 0.09,
        history_pulse_ns: 40.0,
        patch_ns: 12_000.0,
        leaf_pulse_ns: 150.0,
        leaf_group_ns: 9.6,
        leaf_piece_ns: 1.5,
        compensation_ns: 0.7,
        doppler_tap_ns: 0.045,
        map_pixel_ns: 8.0,
        map_tap_ns: 0.4,
        sum_ns: 0.15,
        swept_sum_ns: 30.0,
        raster_tap_ns: 1.0,
        phasor_ns: 14.0,
    };

    /// Refuses numbers that are no times: NaN, infinite, zero, less, or beyond [`TIMES_NS`].
    ///
    /// # Errors
    /// [`TimeModelError`].
    pub fn check(&self) -> Result<(), TimeModelError> {
        let json = serde_json::to_value(self).expect("a model is of numbers and text");
        let numbers = json.as_object().into_iter().flatten();
        // What is not finite is no number there.
        let is_time =
            |value: &serde_json::Value| value.as_f64().is_some_and(|ns| TIMES_NS.contains(&ns));
        match numbers
            .filter(|(key, _)| *key != "name")
            .find(|(_, value)| !is_time(value))
        {
            None => Ok(()),
            Some((entry, _)) => Err(TimeModelError::Time {
                model: self.name.clone().into_owned(),
                entry: entry.clone(),
            }),
        }
    }

    /// As text (JSON).
    pub fn to_text(&self) -> String {
        let mut json = serde_json::json!(self);
        json["schema"] = SCHEMA.into();
        format!("{json:#}\n")
    }

    /// From text.
    ///
    /// # Errors
    /// [`TimeModelError`].
    pub fn from_text(text: &str) -> Result<Self, TimeModelError> {
        let wrong = |error: serde_json::Error| TimeModelError::Text(error.to_string());
        let mut json: serde_json::Value = serde_json::from_str(text).map_err(wrong)?;
        let schema = json.as_object_mut().and_then(|json| json.remove("schema"));
        let schema = schema.as_ref().and_then(serde_json::Value::as_str);
        if schema != Some(SCHEMA) {
            return Err(TimeModelError::Schema {
                found: schema.unwrap_or_default().to_owned(),
            });
        }
        let model: Self = serde_json::from_value(json).map_err(wrong)?;
        model.check()?;
        Ok(model)
    }

    /// Nanoseconds of a transform.
    pub(crate) fn transform(&self, length: f64) -> f64 {
        self.transform_ns * length * libm::log2(length.max(2.0))
    }
}

impl Default for TimeModel {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_no_times_are_refused() {
        let model = TimeModel::DEFAULT;
        model.check().unwrap();
        for value in [f64::NAN, f64::INFINITY, 0.0, -0.0, -3.0, 1e-7, 1e13] {
            let wrong = TimeModel {
                leaf_group_ns: value,
                ..TimeModel::DEFAULT
            };
            let error = wrong.check().unwrap_err();
            let told = "leaf_group_ns of the time model 'default' is no time";
            assert!(error.to_string().contains(told), "{error}");
        }
    }

    #[test]
    fn a_model_is_text() {
        let model = TimeModel {
            name: "a small board".into(),
            point_ns: 0.1 + 0.2,
            ..TimeModel::DEFAULT
        };
        let text = model.to_text();
        assert_eq!(TimeModel::from_text(&text), Ok(model));
        for (from, to, told) in [
            ("model-3", "model-7", "model-7"),
            ("point_ns", "pint_ns", "pint_ns"),
            ("0.30000000000000004", "-1.0", "point_ns"),
            ("0.30000000000000004", "null", "null"),
            ("{", "[", "no time model"),
        ] {
            let error = TimeModel::from_text(&text.replace(from, to)).unwrap_err();
            assert!(error.to_string().contains(told), "{error}");
        }
    }
}
