//! Image formers, one folder each, and the registry that lists them.

pub mod auto;
pub mod bp;
pub mod exact;
pub mod ffbp;
pub mod omega_k;
pub mod options;
pub mod pfa;
pub mod rda;
pub mod rdbp;

use super::ImageFormer;
use super::beam::InBeam;
pub use options::{FormerOption, OptionError, OptionType, OptionValues, OptionWord};

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
        (self.of)(&settings).expect("what is left out of settings is as by default")
    }
}

/// All formers; the reference former comes first.
pub static FORMERS: [Entry; 8] = [
    exact::ENTRY,
    auto::ENTRY,
    bp::ENTRY,
    rdbp::ENTRY,
    ffbp::ENTRY,
    pfa::ENTRY,
    omega_k::ENTRY,
    rda::ENTRY,
];

/// Former used by default.
pub const DEFAULT: Entry = auto::ENTRY;

/// Invalid former name, beam or settings.
#[derive(Debug, thiserror::Error)]
pub enum UnknownFormer {
    /// No former has this name.
    #[error("no former '{name}': expected one of {}", FORMERS.map(|entry| entry.name).join(", "))]
    Name {
        /// Requested name.
        name: String,
    },
    /// The beam is invalid.
    #[error("{0}")]
    Beam(String),
    /// The settings are invalid.
    #[error("settings of {name}: {source}")]
    Settings {
        /// Name of the former.
        name: &'static str,
        /// Parse error of the settings.
        source: serde_json::Error,
    },
}

/// Make the former of a name with given settings, wrapped in a beam ([`InBeam`]) if the settings contain one.
///
/// # Errors
/// [`UnknownFormer`].
pub fn former(
    name: &str,
    settings: &serde_json::Value,
) -> Result<Box<dyn ImageFormer>, UnknownFormer> {
    if let Some((own, beam)) = InBeam::split(settings) {
        let inner = former(name, &own)?;
        let beam = beam.map_err(|source| UnknownFormer::Settings {
            name: inner.name(),
            source,
        })?;
        return InBeam::new(inner, beam)
            .map(|former| Box::new(former) as Box<dyn ImageFormer>)
            .map_err(|error| UnknownFormer::Beam(error.to_string()));
    }
    let entry = FORMERS.iter().find(|entry| entry.name == name);
    let entry = entry.ok_or_else(|| UnknownFormer::Name {
        name: name.to_owned(),
    })?;
    (entry.of)(settings).map_err(|source| UnknownFormer::Settings {
        name: entry.name,
        source,
    })
}

/// Make a former of type `T` from settings.
fn of<T: ImageFormer + serde::de::DeserializeOwned + 'static>(
    settings: &serde_json::Value,
) -> Result<Box<dyn ImageFormer>, serde_json::Error> {
    Ok(Box::new(T::deserialize(settings)?))
}
