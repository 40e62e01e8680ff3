//! TOML description of an experiment: the keys of its plan, and more.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use subaperture_describe::declare::{Declared, Located, section};
use subaperture_describe::error::Fault;
use subaperture_describe::schema::Schema;
use subaperture_describe::{DEFAULT_MEMORY_BYTES, Description, DescriptionError};

use super::live::LiveKeys;
use super::{Device, Experiment, ExperimentError, Simulated, Usrp, unread};
use crate::antennas::{Antennas, Reference};
use crate::fault::Faults;
use crate::plan::keys::PlanKeys;
use crate::simulated::{Analogue, Coupled, Wiring};

/// Description of an experiment.
#[section]
struct ExperimentKeys {
    #[keys]
    plan: PlanKeys,
    #[section]
    device: DeviceKeys,
    #[section]
    faults: Option<Faults>,
    #[section]
    files: FileKeys,
    #[section]
    live: Option<LiveKeys>,
}

/// The radio: simulated, a USRP with the UHD driver, or the replay of a recording.
#[section]
pub(super) struct DeviceKeys {
    /// Kind of radio. "vna", a vector network analyser, has keys of its own.
    #[key(required = "simulated", select(Simulated, Uhd, Replay))]
    kind: DeviceKind,
    /// Scenario file with scene, antenna positions and receiver, as for subap simulate.
    #[key(required = "scene.toml", when(Simulated))]
    scenario: PathBuf,
    /// Run in real time; otherwise as fast as this machine allows.
    #[key(default = false, when(Simulated))]
    real_time: bool,
    /// Simulate a B210's impairments: random phases, LO offset and settling after a retune, DC offset, IQ imbalance, gain steps.
    #[key(default = true, when(Simulated))]
    impairments: bool,
    /// Delay of the loopback cable from the transmitter's coupler to receiver 0, with a loopback reference.
    #[key(default = "15 ns", not_negative, when(Simulated))]
    loop_delay_s: f64,
    /// Total delay of the cables to the transmit and receive antennas.
    #[key(default = "20 ns", not_negative, when(Simulated))]
    cable_delay_s: f64,
    /// Amplitude of the direct leakage from the transmit to the receive antennas, relative to the echo of 1 m^2 at the scenario's reference
    /// point; 0 disables it.
    #[key(default = 3.0, not_negative, when(Simulated))]
    leakage: Located<f64>,
    /// Delay from antenna to antenna with a loopback reference. With a leakage reference it follows from the antenna positions.
    #[key(default = "0.5 ns", not_negative, when(Simulated))]
    leakage_delay_s: f64,
    /// Serial number, as printed by subap radio list. Not needed with a single device.
    #[key(example = "30A1B2C", when(Uhd))]
    serial: Option<String>,
    /// Transmit subdevice, in UHD's notation.
    #[key(default = "A:A", when(Uhd))]
    transmit_subdevice: String,
    /// Subdevices of receiver 0 (the reference) and receiver 1, in UHD's notation.
    #[key(default = "A:A A:B", when(Uhd))]
    receive_subdevices: String,
    /// Wire format of a sample: 16 bits, or the converter's 12 bits.
    #[key(default = "sc16", words("sc16", "sc12"), when(Uhd))]
    wire: String,
    /// Recording to replay.
    #[key(required = "walk.sigmf-meta", when(Replay))]
    recording: PathBuf,
}

/// Recording to write, and calibration of cables and channels.
#[section]
pub(super) struct FileKeys {
    /// Name of the recording; the suffixes .sigmf-data and .sigmf-meta are added.
    #[key(example = "walk")]
    pub(super) recording: Option<PathBuf>,
    /// Calibration file written by subap radio calibrate for this set-up.
    #[key(example = "calibration.json")]
    pub(super) calibration: Option<PathBuf>,
}

pub(super) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| {
    Schema::of::<ExperimentKeys>(
        "A radio experiment is a TOML file with the capture plan, the radio, and the files.",
    )
});

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

impl Experiment {
    /// Read an experiment file, and override keys with `settings` (pairs such as `plan.steps` and `50`). Its text may take
    /// [`DEFAULT_MEMORY_BYTES`] when it is parsed.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise all faults of its text.
    pub fn read(path: &Path, settings: &[(String, String)]) -> Result<Self, ExperimentError> {
        Self::read_within(path, settings, DEFAULT_MEMORY_BYTES)
    }

    /// As [`Self::read`], for a text that takes at most `memory_bytes` when it is parsed.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise all faults of its text.
    pub fn read_within(
        path: &Path,
        settings: &[(String, String)],
        memory_bytes: u64,
    ) -> Result<Self, ExperimentError> {
        let description = Description::read_within(path, memory_bytes).map_err(unread(path))?;
        Ok(set_and_describe(description, settings)?)
    }

    /// Make an experiment from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        build(description).map_err(|faults| description.explain(faults))
    }
}

pub(super) fn set(
    description: &mut Description,
    schema: &Schema,
    settings: &[(String, String)],
) -> Result<(), DescriptionError> {
    let mut settings = settings.iter();
    settings.try_for_each(|(key, value)| description.set(schema, "--set", key, value))
}

pub(super) fn set_and_describe(
    mut description: Description,
    settings: &[(String, String)],
) -> Result<Experiment, DescriptionError> {
    set(&mut description, &SCHEMA, settings)?;
    Experiment::describe(&description)
}

fn build(description: &Description) -> Result<Experiment, Vec<Fault>> {
    let top = description.resolve(&SCHEMA)?;
    let keys = ExperimentKeys::read(&top);
    let folder = description.folder();
    let plan = keys.plan.plan(&top).map_err(|fault| vec![fault])?;
    let device = keys.device.build(folder, plan.reference, plan.antennas);
    let device = device.map_err(|fault| vec![fault])?;
    let live = keys.live.map(|live| live.build(folder, plan.reference));
    Ok(Experiment {
        device,
        live: live.transpose().map_err(|fault| vec![fault])?,
        plan,
        faults: keys.faults,
        recording: keys.files.recording.map(|path| folder.join(path)),
        calibration: keys.files.calibration.map(|path| folder.join(path)),
    })
}

impl DeviceKeys {
    pub(super) fn build(
        self,
        folder: &Path,
        reference: Reference,
        antennas: Option<Antennas>,
    ) -> Result<Device, Fault> {
        Ok(match self.kind {
            DeviceKind::Simulated(keys) => {
                let (cable_s, amplitude) = (keys.cable_delay_s, *keys.leakage);
                if reference == Reference::Leakage && amplitude <= 0.0 {
                    let what = "expected a leakage above 0, since the leakage is the reference";
                    return Err(keys.leakage.fault(what));
                }
                let direct = Coupled {
                    delay_s: keys.leakage_delay_s,
                    amplitude,
                };
                let wiring = match (reference, antennas) {
                    (Reference::Leakage, Some(antennas)) => Wiring::leakage(
                        [0, 1].map(|receiver| antennas.direct_s(receiver)),
                        [cable_s; 2],
                        amplitude,
                    ),
                    _ => {
                        let direct = (amplitude > 0.0).then_some(direct);
                        Wiring::loopback(keys.loop_delay_s, cable_s, direct)
                    }
                };
                Device::Simulated(Box::new(Simulated {
                    scenario: folder.join(keys.scenario),
                    real_time: keys.real_time,
                    wiring,
                    analogue: match keys.impairments {
                        true => Analogue::b210(),
                        false => Analogue::default(),
                    },
                }))
            }
            DeviceKind::Uhd(keys) => Device::Uhd(Usrp {
                serial: self.serial,
                transmit_subdevice: keys.transmit_subdevice,
                receive_subdevices: keys.receive_subdevices,
                twelve_bits: keys.wire == "sc12",
            }),
            DeviceKind::Replay(keys) => Device::Replay(folder.join(keys.recording)),
        })
    }
}
