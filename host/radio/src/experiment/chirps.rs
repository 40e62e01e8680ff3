//! Capture of chirps: plan, radio, injected faults and files, in one TOML file.

use std::path::PathBuf;
use std::sync::LazyLock;

use subaperture_describe::declare::section;
use subaperture_describe::schema::Schema;
use subaperture_describe::{Description, DescriptionError};

use super::keys::{DeviceKeys, FileKeys};
use super::{Device, ExperimentError};
use crate::antennas::Reference;
use crate::chirp::Plan;
use crate::fault::Faults;
use crate::plan::keys::RadioKeys;
use crate::transceiver::Transceiver;

/// Description of a capture of chirps.
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
    #[section]
    device: DeviceKeys,
    #[section]
    faults: Option<Faults>,
    #[section]
    files: FileKeys,
}

pub(super) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| {
    Schema::of::<ChirpKeys>(
        "A capture of chirps is a TOML file with the section chirp in place of plan.",
    )
});

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

/// Capture of chirps with a radio, as described in one TOML file.
#[derive(Clone, Debug, PartialEq)]
pub struct ChirpExperiment {
    /// Plan of the pulses.
    pub plan: Plan,
    /// Radio that the capture runs on.
    pub device: Device,
    /// Faults injected for tests; `None` for none.
    pub faults: Option<Faults>,
    /// Path of the recording, if given.
    pub recording: Option<PathBuf>,
    /// Path of the calibration file, if given.
    pub calibration: Option<PathBuf>,
}

impl ChirpExperiment {
    /// Make a capture from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        let explain = |faults| description.explain(faults);
        let keys: ChirpKeys = description.resolve_as(&SCHEMA).map_err(explain)?;
        let folder = description.folder();
        let device = keys.device.build(folder, Reference::Loopback, None);
        Ok(Self {
            plan: Plan {
                name: keys.name,
                radio: keys.radio.configuration(),
                ..keys.chirp
            },
            device: device.map_err(|fault| explain(vec![fault]))?,
            faults: keys.faults,
            recording: keys.files.recording.map(|path| folder.join(path)),
            calibration: keys.files.calibration.map(|path| folder.join(path)),
        })
    }

    /// Open the radio, run `act` with it, and close it. A simulated scene and its pulses are refused if they exceed
    /// `memory_bytes`.
    ///
    /// # Errors
    /// If the radio cannot be opened. The result of `act` is returned unchanged.
    pub fn with_radio<T>(
        &self,
        memory_bytes: u64,
        act: impl FnOnce(&mut dyn Transceiver) -> T,
    ) -> Result<T, ExperimentError> {
        let faults = self.faults.clone();
        (self.device).with_radio(faults, memory_bytes, |_, _| Ok(()), act)
    }
}
