//! Single-core timing model used to select the fastest plan that meets the error bound.
//!
//! [`TimeModel::DEFAULT`] is a constant, so that every machine makes the same plan. It was measured on a core with 512-bit registers at
//! 3.5 GHz (`cargo bench --bench kernels`). A model of another machine can be selected and becomes part of the plan and the record: a plan carried out
//! elsewhere keeps its choices.

use std::borrow::Cow;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

/// Execution times of elementary steps on one core, nanoseconds.
///
/// The entries belong to the kernels of this version, so only the text ([`Self::to_text`]) shows them. An entry that a text lacks has the value of
/// [`Self::DEFAULT`]: a plan or a model stored by an earlier version stays valid when a kernel gets an entry of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TimeModel {
    /// Name of the machine or model.
    pub(crate) name: Cow<'static, str>,
    /// Fourier transform, per bin and doubling of the length, ns.
    pub(crate) transform_ns: f64,
    /// Chirp-z transform in slow time including its copies, per bin and doubling of the length, ns.
    pub(crate) map_transform_ns: f64,
    /// Interval of a range profile, per spline coefficient, ns.
    pub(crate) piece_ns: f64,
    /// Backprojection in tiles, per pulse and tile, ns.
    pub(crate) tile_pulse_ns: f64,
    /// Backprojection in tiles, per pulse and pixel group, ns.
    pub(crate) tile_group_ns: f64,
    /// Backprojection in tiles, per spline coefficient of a group with adjacent bins, ns.
    pub(crate) narrow_plane_ns: f64,
    /// Backprojection in tiles, per spline coefficient of a group with nearby bins, ns.
    pub(crate) wide_plane_ns: f64,
    /// Backprojection in tiles, per spline coefficient of a group with distant bins, ns.
    pub(crate) scattered_plane_ns: f64,
    /// Backprojection with an exact path, per pixel and pulse, ns.
    pub(crate) point_ns: f64,
    /// Backprojection with an exact path and intra-pulse motion, per pixel and pulse, ns.
    pub(crate) blurred_point_ns: f64,
    /// Patch history: phase rotation of one sample, ns.
    pub(crate) turn_ns: f64,
    /// Patch history: one filter tap over pulses, ns.
    pub(crate) pulse_tap_ns: f64,
    /// Patch history: one filter tap over samples, ns.
    pub(crate) sample_tap_ns: f64,
    /// Patch history: fixed time per pulse, ns.
    pub(crate) history_pulse_ns: f64,
    /// Patch history: planning of one patch, ns.
    pub(crate) patch_ns: f64,
    /// Leaf of the factorisation: fixed time per pulse, ns.
    pub(crate) leaf_pulse_ns: f64,
    /// Leaf of the factorisation: per pixel group and pulse, ns.
    pub(crate) leaf_group_ns: f64,
    /// Leaf of the factorisation: per interval of the profile, ns.
    pub(crate) leaf_piece_ns: f64,
    /// Range-Doppler map: phase compensation of one sample, ns.
    pub(crate) compensation_ns: f64,
    /// Range-Doppler map: Doppler transform as a matrix product, per pulse, Doppler bin and frequency, ns.
    pub(crate) doppler_tap_ns: f64,
    /// Range-Doppler map: interpolation, fixed time per pixel, ns.
    pub(crate) map_pixel_ns: f64,
    /// Range-Doppler map: interpolation, per tap, ns.
    pub(crate) map_tap_ns: f64,
    /// Range-Doppler map by gridding: path model, per pulse, ns.
    pub(crate) map_fit_ns: f64,
    /// Range-Doppler map by gridding: gridding of one sample in slow time, ns.
    pub(crate) map_sample_ns: f64,
    /// Range-Doppler map by gridding: resampling of one sample in frequency, per tap, ns.
    pub(crate) map_sample_tap_ns: f64,
    /// Range-Doppler map by gridding: transforms, per element and doubling of the length, ns.
    pub(crate) column_transform_ns: f64,
    /// Range-Doppler map by gridding: interpolation in range, per Doppler bin and line of pixels, ns.
    pub(crate) map_line_bin_ns: f64,
    /// Range-Doppler map by gridding: interpolation in Doppler, per pixel, ns.
    pub(crate) map_station_ns: f64,
    /// Exact sum, per pixel, pulse and frequency, ns.
    pub(crate) sum_ns: f64,
    /// Exact sum with intra-pulse motion, per pixel, pulse and frequency, ns.
    pub(crate) swept_sum_ns: f64,
    /// Gridding or interpolation on a raster, per tap, ns.
    pub(crate) raster_tap_ns: f64,
    /// Phasor in float64 with its phase, ns.
    pub(crate) phasor_ns: f64,
}

/// Valid range of each time, ns; sums of times stay finite for any image.
pub const TIMES_NS: RangeInclusive<f64> = 1e-6..=1e12;

/// Schema name in the text of a model.
pub const SCHEMA: &str = "subaperture-time-model-3";

/// Reason that a timing model cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeModelError {
    /// The text does not contain a valid timing model.
    #[error("not a valid time model: {0}")]
    Text(String),
    /// The model has the schema of a different program version.
    #[error("expected a time model with the schema {SCHEMA}, found '{found}': measure it again")]
    Schema {
        /// Schema name in the text.
        found: String,
    },
    /// A time is not finite or outside the valid range.
    #[error("{entry} of the time model '{model}' is not a valid time: expected 1e-6 to 1e12 ns")]
    Time {
        /// Name of the model.
        model: String,
        /// Name of the invalid entry.
        entry: String,
    },
}

impl TimeModel {
    /// Timing model used by default.
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
        map_fit_ns: 400.0,
        map_sample_ns: 4.0,
        map_sample_tap_ns: 0.2,
        column_transform_ns: 0.14,
        map_line_bin_ns: 2.2,
        map_station_ns: 3.7,
        sum_ns: 0.15,
        swept_sum_ns: 30.0,
        raster_tap_ns: 1.0,
        phasor_ns: 14.0,
    };

    /// Name of the machine or model.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Refuse times that are not finite or outside [`TIMES_NS`].
    ///
    /// # Errors
    /// [`TimeModelError`].
    pub fn check(&self) -> Result<(), TimeModelError> {
        let json = serde_json::to_value(self).expect("a model is of numbers and text");
        let numbers = json.as_object().into_iter().flatten();
        // A non-finite number is serialised as null.
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

    /// Write the model as JSON text.
    pub fn to_text(&self) -> String {
        let mut json = serde_json::json!(self);
        json["schema"] = SCHEMA.into();
        format!("{json:#}\n")
    }

    /// Read a model from JSON text.
    ///
    /// # Errors
    /// [`TimeModelError`].
    pub fn from_text(text: &str) -> Result<Self, TimeModelError> {
        let value = serde_json::from_str(text);
        Self::from_value(value.map_err(|error| TimeModelError::Text(error.to_string()))?)
    }

    /// Read a model from a JSON value, for callers that bound the memory of parsing.
    ///
    /// # Errors
    /// Errors of [`Self::from_text`].
    pub fn from_value(mut json: serde_json::Value) -> Result<Self, TimeModelError> {
        let wrong = |error: serde_json::Error| TimeModelError::Text(error.to_string());
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

    /// Time of a Fourier transform, ns.
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
    fn invalid_times_are_refused() {
        let model = TimeModel::DEFAULT;
        model.check().unwrap();
        for value in [f64::NAN, f64::INFINITY, 0.0, -0.0, -3.0, 1e-7, 1e13] {
            let wrong = TimeModel {
                leaf_group_ns: value,
                ..TimeModel::DEFAULT
            };
            let error = wrong.check().unwrap_err();
            let expected = "leaf_group_ns of the time model 'default' is not a valid time";
            assert!(error.to_string().contains(expected), "{error}");
        }
    }

    #[test]
    fn text_form_of_time_model_round_trips() {
        let model = TimeModel {
            name: "a small board".into(),
            point_ns: 0.1 + 0.2,
            ..TimeModel::DEFAULT
        };
        let text = model.to_text();
        assert_eq!(TimeModel::from_text(&text).as_ref(), Ok(&model));
        // An entry of a later version is missing.
        let lines = text.lines().filter(|line| !line.contains("piece_ns"));
        let shorter = lines.collect::<Vec<_>>().join("\n");
        assert_eq!(TimeModel::from_text(&shorter), Ok(model));
        for (from, to, expected) in [
            ("model-3", "model-7", "model-7"),
            ("point_ns", "pint_ns", "pint_ns"),
            ("0.30000000000000004", "-1.0", "point_ns"),
            ("0.30000000000000004", "null", "null"),
            ("{", "[", "not a valid time model"),
        ] {
            let error = TimeModel::from_text(&text.replace(from, to)).unwrap_err();
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
