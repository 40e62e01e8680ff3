//! Registry entry of a former.

use serde::de::DeserializeOwned;

use super::options::{self, FormerOption};
use crate::former::ImageFormer;

/// Registry entry of a former.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Name used in records and on the command line.
    pub name: &'static str,
    /// One-line description.
    pub summary: &'static str,
    /// Options of the former.
    pub options: &'static [FormerOption],
    /// Constructor from settings, a JSON object; missing settings take their defaults.
    pub of: fn(&serde_json::Value) -> Result<Box<dyn ImageFormer>, serde_json::Error>,
}

impl Entry {
    /// Entry of the former `T`, made from its settings by serde.
    pub(super) const fn new<T: ImageFormer + DeserializeOwned + 'static>(
        name: &'static str,
        summary: &'static str,
        options: &'static [FormerOption],
    ) -> Self {
        Self {
            name,
            summary,
            options,
            of: |settings| Ok(Box::new(T::deserialize(settings)?)),
        }
    }

    /// Make the former with an error bound, dB, and default settings; a former without a bound ignores it.
    pub fn within(&self, error_db: f64) -> Box<dyn ImageFormer> {
        let settings = match self.option(options::ERROR_DB.name) {
            Some(_) => serde_json::json!({ "error_db": error_db }),
            None => serde_json::json!({}),
        };
        (self.of)(&settings).expect("omitted settings have defaults")
    }
}
