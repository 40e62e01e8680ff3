//! Transforms, timing model and device selected by the caller, as part of a task, request, plan or record.

pub use subaperture_fft::Transforms;

use crate::Settings;
use crate::device::Device;
use crate::time_model::TimeModel;

/// Transforms, timing model and device for forming an image.
#[derive(Clone, Copy, Debug)]
pub struct Numerics<'a> {
    /// Fourier transforms. Portable transforms make the image bit-identical on every machine; all other steps already are.
    pub transforms: Transforms,
    /// Timing model for the choice between methods. Each choice keeps the error bound for any model.
    pub model: &'a TimeModel,
    /// Device for the formers that can use one: `bp` and nested patches of `rdbp` on Cartesian grids. It is not part of a plan: a plan made with a device can be carried out without, and its
    /// bound holds for both. The images differ in rounding.
    pub device: Option<&'a dyn Device>,
}

static DEFAULT_MODEL: TimeModel = TimeModel::DEFAULT;

impl Default for Numerics<'_> {
    fn default() -> Self {
        Self {
            transforms: Transforms::Fastest,
            model: &DEFAULT_MODEL,
            device: None,
        }
    }
}

impl Numerics<'_> {
    /// Select portable transforms: bit-identical images on every machine, at lower speed.
    #[must_use]
    pub fn portable(self) -> Self {
        let transforms = Transforms::Portable;
        Self { transforms, ..self }
    }

    /// Record the selection in the settings of an image; the default timing model is recorded by its name only.
    pub(crate) fn note(&self, settings: &mut Settings) {
        let model = match *self.model == DEFAULT_MODEL {
            true => serde_json::json!(self.model.name),
            false => serde_json::json!(self.model),
        };
        settings.insert("transforms".to_owned(), serde_json::json!(self.transforms));
        settings.insert("time_model".to_owned(), model);
    }
}
