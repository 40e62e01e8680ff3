//! TOML description of a chirp plan.

use std::io;
use std::path::Path;
use std::sync::LazyLock;

use subaperture_describe::declare::section;
use subaperture_describe::schema::Schema;
use subaperture_describe::{Description, DescriptionError};

use super::Plan;
use crate::plan::keys::RadioKeys;

/// Description of a plan.
#[section]
struct ChirpKeys {
    /// Name of the capture, for titles and records.
    #[key(default = "capture")]
    name: String,
    /// Waveform and timing of the pulses.
    #[section]
    chirp: Plan,
    #[section]
    radio: RadioKeys,
}

static SCHEMA: LazyLock<Schema> =
    LazyLock::new(|| Schema::of::<ChirpKeys>("The plan of a chirp radar is a TOML file."));

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

impl Plan {
    /// Read a plan from a TOML file.
    ///
    /// # Errors
    /// The outer error if the file cannot be read, the inner one if its text is invalid.
    pub fn read(path: &Path) -> io::Result<Result<Self, DescriptionError>> {
        Description::read(path).map(|description| Self::describe(&description))
    }

    /// Make a plan from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        let keys: Result<ChirpKeys, _> = description.resolve_as(&SCHEMA);
        let keys = keys.map_err(|faults| description.explain(faults))?;
        Ok(Self {
            name: keys.name,
            radio: keys.radio.configuration(),
            ..keys.chirp
        })
    }
}
