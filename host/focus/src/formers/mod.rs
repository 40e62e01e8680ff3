//! The image formers, a folder each, and the one list by which everything else finds them.

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
pub use options::{Given, Opt, OptionError, Takes, Word};

/// A former as the list has it.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Its name in records and on the command line.
    pub name: &'static str,
    /// What it is, in a line.
    pub summary: &'static str,
    /// What it can be told.
    pub options: &'static [Opt],
    /// It, by its settings: a JSON object, in which what is left out is as by default.
    pub of: fn(&serde_json::Value) -> Result<Box<dyn ImageFormer>, serde_json::Error>,
}

impl Entry {
    /// The former within a bound on its error, dB, all else by default; without one if it has none.
    pub fn within(&self, error_db: f64) -> Box<dyn ImageFormer> {
        let settings = match self.option(options::ERROR_DB.name) {
            Some(_) => serde_json::json!({ "error_db": error_db }),
            None => serde_json::json!({}),
        };
        (self.of)(&settings).expect("what is left out of settings is as by default")
    }
}

/// All of them, the oracle first.
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

/// The one that is taken unless another is asked for.
pub const DEFAULT: Entry = auto::ENTRY;

/// A former that there is not.
#[derive(Debug, thiserror::Error)]
pub enum UnknownFormer {
    /// Not by this name.
    #[error("there is no former '{name}': choose one of {}", FORMERS.map(|entry| entry.name).join(", "))]
    Name {
        /// The name asked for.
        name: String,
    },
    /// Not with such settings.
    #[error("the settings of {name}: {source}")]
    Settings {
        /// Its name.
        name: &'static str,
        /// What is wrong with them.
        source: serde_json::Error,
    },
}

/// The former of this name with these settings.
///
/// # Errors
/// [`UnknownFormer`].
pub fn former(
    name: &str,
    settings: &serde_json::Value,
) -> Result<Box<dyn ImageFormer>, UnknownFormer> {
    let entry = FORMERS.iter().find(|entry| entry.name == name);
    let entry = entry.ok_or_else(|| UnknownFormer::Name {
        name: name.to_owned(),
    })?;
    (entry.of)(settings).map_err(|source| UnknownFormer::Settings {
        name: entry.name,
        source,
    })
}

/// `T` by its settings.
fn of<T: ImageFormer + serde::de::DeserializeOwned + 'static>(
    settings: &serde_json::Value,
) -> Result<Box<dyn ImageFormer>, serde_json::Error> {
    Ok(Box::new(T::deserialize(settings)?))
}
