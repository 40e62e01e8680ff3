//! Registry entry of a former.

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
    /// Make the former with an error bound, dB, and default settings; a former without a bound ignores it.
    pub fn within(&self, error_db: f64) -> Box<dyn ImageFormer> {
        let settings = match self.option(options::ERROR_DB.name) {
            Some(_) => serde_json::json!({ "error_db": error_db }),
            None => serde_json::json!({}),
        };
        (self.of)(&settings).expect("omitted settings have defaults")
    }
}

/// Make a former of type `T` from settings.
pub(super) fn of<T: ImageFormer + serde::de::DeserializeOwned + 'static>(
    settings: &serde_json::Value,
) -> Result<Box<dyn ImageFormer>, serde_json::Error> {
    Ok(Box::new(T::deserialize(settings)?))
}
