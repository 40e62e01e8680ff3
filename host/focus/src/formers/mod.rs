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

use super::beam::InBeam;
pub use super::error::UnknownFormer;
use super::plan::{Fingerprint, PlanError};
use super::{ImageFormer, Opened, Plan};
pub use options::{FormerOption, OptionError, OptionType, OptionValues, OptionWord};
use subaperture_model::phase_history::{Collection, Weights};

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

/// Make the former of a name with given settings, wrapped in a beam ([`InBeam`]) if the settings contain one.
///
/// # Errors
/// [`UnknownFormer`].
pub fn former(
    name: &str,
    settings: &serde_json::Value,
) -> Result<Box<dyn ImageFormer>, UnknownFormer> {
    if let Some((own, of_beam)) = InBeam::split(settings) {
        let inner = former(name, &own)?;
        let name = inner.name();
        return InBeam::of(inner, &of_beam)
            .map_err(|source| UnknownFormer::Settings { name, source })?
            .map(|former| Box::new(former) as Box<dyn ImageFormer>)
            .map_err(|error| UnknownFormer::Beam(error.to_string()));
    }
    let entry = FORMERS.iter().find(|entry| entry.name == name);
    let entry = entry.ok_or_else(|| UnknownFormer::Name {
        name: name.to_owned(),
        known: FORMERS.map(|entry| entry.name).to_vec(),
    })?;
    (entry.of)(settings).map_err(|source| UnknownFormer::Settings {
        name: entry.name,
        source,
    })
}

impl Plan {
    /// Weights of the plan for a collection.
    ///
    /// # Errors
    /// [`PlanError::Window`]; [`PlanError::Former`]; [`PlanError::Form`] if the beam does not suit the collection.
    pub fn weights(&self, collection: &Collection) -> Result<Weights, PlanError> {
        let [fast, slow] = self.windows()?;
        let former = former(&self.former, &self.settings)?;
        Ok(former.weights(collection, &self.grid, fast, slow)?)
    }

    /// Open the plan for tiles of its recording, with the weights of [`Self::weights`].
    ///
    /// # Errors
    /// [`PlanError`] if the plan does not match the recording or the former refuses it.
    pub fn open<'a>(
        &'a self,
        collection: &'a Collection,
        weights: &'a Weights,
    ) -> Result<Opened<'a>, PlanError> {
        let found = Fingerprint::of(collection);
        if found != self.recording {
            return Err(PlanError::Recording {
                planned: self.recording.clone(),
                found,
            });
        }
        let former = former(&self.former, &self.settings)?;
        Ok(Opened::new(&*former, self, self.spec(collection, weights))?)
    }
}
