//! Radio experiment: capture plan, radio, injected faults and files, in one TOML file.
//!
//! The file has the keys of [`crate::plan`] and four more sections. [`reference()`] prints every key; [`examples`] has
//! files to start from. Errors give file, line and column, as those of scenarios do.
//!
//! [`Experiment::with_radio`] opens the radio for the duration of a closure, since the simulated radio borrows its
//! scenario.

mod any;
mod chirps;
pub mod examples;
mod keys;
mod live;

use std::io;
use std::path::{Path, PathBuf};

use subaperture_describe::DescriptionError;
use subaperture_simulate::scenario::Scenario;

use crate::antennas::Reference;
use crate::error::RadioError;
use crate::fault::{Faults, Faulty};
use crate::plan::Plan;
use crate::replay::Replay;
use crate::sigmf::{Recording, SigmfError};
use crate::simulated::{Analogue, SimulatedRadio, Wiring};
use crate::transceiver::Transceiver;

pub use any::AnyExperiment;
pub use chirps::{ChirpExperiment, reference as chirp_reference};
pub use keys::reference;
pub use live::{BodyMotion, Live};

/// Capture plan, radio and live imaging settings, as described in one TOML file.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Plan of the stepped-frequency capture.
    pub plan: Plan,
    /// Radio that the capture runs on.
    pub device: Device,
    /// Faults injected for tests; `None` for none.
    pub faults: Option<Faults>,
    /// Path of the recording, if given.
    pub recording: Option<PathBuf>,
    /// Path of the calibration file, if given.
    pub calibration: Option<PathBuf>,
    /// Live imaging settings, if given.
    pub live: Option<Live>,
}

/// Radio backend and its options.
#[derive(Clone, Debug, PartialEq)]
pub enum Device {
    /// Simulated radio.
    Simulated(Box<Simulated>),
    /// USRP with the UHD driver.
    Uhd(Usrp),
    /// Replay of a recording.
    Replay(PathBuf),
}

/// Simulated radio.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// Path of its scenario.
    pub scenario: PathBuf,
    /// Whether it runs in real time; otherwise as fast as the machine allows.
    pub real_time: bool,
    /// Cables between the ports, and leakage.
    pub wiring: Wiring,
    /// Impairments of the analogue part: random LO phase, LO offset, settling, DC offset, IQ imbalance.
    pub analogue: Analogue,
}

/// Options of a USRP opened through UHD.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Usrp {
    /// Serial number; `None` selects the only device connected.
    pub serial: Option<String>,
    /// Transmit subdevice specification, in UHD's notation.
    pub transmit_subdevice: String,
    /// Receive subdevice specification, in UHD's notation.
    pub receive_subdevices: String,
    /// Whether samples have 12 bits on the wire instead of 16.
    pub twelve_bits: bool,
}

/// Error of an experiment, or of opening its radio.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Underlying I/O error.
        source: io::Error,
    },
    /// The text of the experiment or of its scenario is invalid.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// Error of the recording to be replayed.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// Error of the radio.
    #[error(transparent)]
    Radio(#[from] RadioError),
}

fn unread(path: &Path) -> impl FnOnce(io::Error) -> ExperimentError {
    let path = path.to_owned();
    move |source| ExperimentError::Read { path, source }
}

impl Experiment {
    /// Open the radio, run `act` with it, and close it. Opening a USRP takes seconds. A simulated scene and its pulses
    /// are refused if they exceed `memory_bytes`.
    ///
    /// # Errors
    /// If the radio cannot be opened. The result of `act` is returned as it is.
    pub fn with_radio<T>(
        &self,
        memory_bytes: u64,
        act: impl FnOnce(&mut dyn Transceiver) -> T,
    ) -> Result<T, ExperimentError> {
        let checked = |scene: &_, path: &_| match self.plan.reference {
            Reference::Leakage => self.same_places(scene, path),
            _ => Ok(()),
        };
        let faults = self.faults.clone();
        self.device.with_radio(faults, memory_bytes, checked, act)
    }
}

impl Device {
    /// Open the radio, run `act` with it, and close it; `checked` may refuse a simulated scene.
    fn with_radio<T>(
        &self,
        faults: Option<Faults>,
        memory_bytes: u64,
        checked: impl Fn(&subaperture_simulate::Experiment, &Path) -> Result<(), RadioError>,
        act: impl FnOnce(&mut dyn Transceiver) -> T,
    ) -> Result<T, ExperimentError> {
        match self {
            Self::Simulated(simulated) => {
                let path = &simulated.scenario;
                let scenario = Scenario::read_within(path, memory_bytes).map_err(unread(path))?;
                let scene = scenario.experiment_within(memory_bytes)?;
                checked(&scene, path)?;
                let (wiring, analogue) = (simulated.wiring.clone(), simulated.analogue.clone());
                let mut radio = SimulatedRadio::new(&scene, wiring, analogue)?;
                if simulated.real_time {
                    radio = radio.in_real_time();
                }
                Ok(with(radio, faults, act))
            }
            Self::Replay(path) => {
                let recording = Recording::open_within(path, memory_bytes)?;
                Ok(with(Replay::new(recording), faults, act))
            }
            Self::Uhd(usrp) => with_usrp(usrp, faults, act),
        }
    }
}

/// Largest distance between an antenna's position in the plan and in the scenario, metres; equal to a two-way phase of
/// a thousandth of a turn at 300 MHz.
const APART_M: f64 = 5e-4;

impl Experiment {
    /// Refuse a scenario whose antenna positions differ from the plan's: the delays of its leakage would differ from
    /// those subtracted.
    fn same_places(
        &self,
        scene: &subaperture_simulate::Experiment,
        path: &Path,
    ) -> Result<(), RadioError> {
        let radar = &scene.radar;
        let (Some(antennas), Some(transmitter), [first, second, ..]) = (
            self.plan.antennas,
            radar.transmitters.first(),
            &radar.receivers[..],
        ) else {
            return Err(RadioError::Unsupported(format!(
                "{}: a leakage reference needs a transmitter and two receivers: add them to the scenario's radar",
                path.display()
            )));
        };
        let [a, b] = antennas.receivers_m;
        let pairs = [
            (antennas.transmitter_m, transmitter.offset_m),
            (a, first.offset_m),
            (b, second.offset_m),
        ];
        if pairs
            .iter()
            .any(|(plan, there)| plan.distance(*there) > APART_M)
        {
            return Err(RadioError::Unsupported(format!(
                "{}: antenna positions differ from [antennas] of the experiment: give the same positions in both files",
                path.display()
            )));
        }
        Ok(())
    }
}

fn with<T>(
    mut radio: impl Transceiver,
    faults: Option<Faults>,
    act: impl FnOnce(&mut dyn Transceiver) -> T,
) -> T {
    match faults {
        Some(faults) => act(&mut Faulty::new(radio, faults)),
        None => act(&mut radio),
    }
}

#[cfg(feature = "uhd")]
fn with_usrp<T>(
    usrp: &Usrp,
    faults: Option<Faults>,
    act: impl FnOnce(&mut dyn Transceiver) -> T,
) -> Result<T, ExperimentError> {
    use crate::uhd::{Options, UhdRadio, Wire};
    let radio = UhdRadio::open(&Options {
        serial: usrp.serial.clone(),
        transmit_subdevice: usrp.transmit_subdevice.clone(),
        receive_subdevices: usrp.receive_subdevices.clone(),
        wire: match usrp.twelve_bits {
            true => Wire::Sc12,
            false => Wire::Sc16,
        },
    })?;
    Ok(with(radio, faults, act))
}

#[cfg(not(feature = "uhd"))]
fn with_usrp<T>(
    _usrp: &Usrp,
    _faults: Option<Faults>,
    _act: impl FnOnce(&mut dyn Transceiver) -> T,
) -> Result<T, ExperimentError> {
    Err(RadioError::Driver(crate::error::NO_UHD.to_owned()).into())
}

#[cfg(test)]
mod tests;
