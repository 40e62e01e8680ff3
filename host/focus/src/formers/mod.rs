//! Image formers, one folder each, and the registry that lists them.

mod algorithm;
pub mod auto;
pub mod bp;
mod entry;
mod error_bound;
pub mod exact;
pub mod ffbp;
mod frequency_domain;
pub mod omega_k;
pub mod options;
pub mod pfa;
pub mod rda;
pub mod rdbp;

use super::ImageFormer;
use super::beam::InBeam;
pub use options::{FormerOption, OptionError, OptionType, OptionValues, OptionWord};

use algorithm::Algorithm;
pub use entry::Entry;

/// All formers; the reference former comes first.
pub static FORMERS: [Entry; 8] = [
    exact::ENTRY,
    auto::Auto::ENTRY,
    bp::Backprojection::ENTRY,
    rdbp::RangeDopplerBackprojection::ENTRY,
    ffbp::FastFactorised::ENTRY,
    pfa::PolarFormat::ENTRY,
    omega_k::OmegaK::ENTRY,
    rda::RangeDopplerAlgorithm::ENTRY,
];

/// Former used by default.
pub const DEFAULT: Entry = auto::Auto::ENTRY;

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
