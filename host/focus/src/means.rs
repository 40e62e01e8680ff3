//! The means by which images are formed, where that is the asker's to choose: part of a task, a request, a plan and a record.

pub use subaperture_fft::Transforms;

use crate::Settings;
use crate::time_model::TimeModel;

/// By what means an image is formed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means<'a> {
    /// Portable transforms make all of an image the same bits on every machine: everything else does so anyway.
    pub transforms: Transforms,
    /// By what times ways are chosen: what is chosen keeps the bound by any.
    pub model: &'a TimeModel,
}

static DEFAULT_MODEL: TimeModel = TimeModel::DEFAULT;

impl Default for Means<'_> {
    fn default() -> Self {
        Self {
            transforms: Transforms::Fastest,
            model: &DEFAULT_MODEL,
        }
    }
}

impl Means<'_> {
    /// The same bits on every machine, at the price of slower transforms.
    #[must_use]
    pub fn portable(self) -> Self {
        let transforms = Transforms::Portable;
        Self { transforms, ..self }
    }

    /// Notes them among the settings of an image; of the default model its name, which is all that there is to say.
    pub(crate) fn note(&self, settings: &mut Settings) {
        let model = match *self.model == DEFAULT_MODEL {
            true => serde_json::json!(self.model.name),
            false => serde_json::json!(self.model),
        };
        settings.insert("transforms".to_owned(), serde_json::json!(self.transforms));
        settings.insert("time_model".to_owned(), model);
    }
}
