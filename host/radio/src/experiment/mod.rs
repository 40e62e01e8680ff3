//! An experiment with a radio: its plan, which radio, what is wrong with it on purpose, and files, in one text.
//!
//! The text is TOML, with the keys of [`crate::plan`] and four sections more; [`reference()`] prints every key, [`examples`] has texts to start
//! from. Errors point at file, line and column, as those of scenarios do.
//!
//! [`Experiment::with_radio`] opens the radio for as long as something is done with it: the simulated one stands on its scenario, which nobody
//! else has to hold.

pub mod examples;
mod keys;
mod live;

use std::io;
use std::path::{Path, PathBuf};

use subaperture_describe::{Description, DescriptionError};
use subaperture_simulate::scenario::Scenario;

use crate::antennas::Reference;
use crate::error::RadioError;
use crate::fault::{Faults, Faulty};
use crate::plan::Plan;
use crate::replay::Replay;
use crate::sigmf::{Recording, SigmfError};
use crate::simulated::{Analogue, SimulatedRadio, Wiring};
use crate::transceiver::Transceiver;

pub use live::{Live, Way};

/// What is to be done, with what, and where it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// The capture.
    pub plan: Plan,
    /// The radio.
    pub device: Device,
    /// What goes wrong on the way, on purpose.
    pub faults: Option<Faults>,
    /// Name of the recording, if the text says one.
    pub recording: Option<PathBuf>,
    /// The calibration's file, if the text says one.
    pub calibration: Option<PathBuf>,
    /// What is imaged meanwhile, if the text says so.
    pub live: Option<Live>,
}

/// Which radio.
#[derive(Clone, Debug, PartialEq)]
pub enum Device {
    /// One that is none.
    Simulated(Box<Simulated>),
    /// A USRP by UHD.
    Uhd(Usrp),
    /// A recording in its place.
    Replay(PathBuf),
}

/// A simulated radio.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// File of its scenario.
    pub scenario: PathBuf,
    /// Whether it is held back to true time.
    pub real_time: bool,
    /// What it is connected to.
    pub wiring: Wiring,
    /// What is wrong with it.
    pub analogue: Analogue,
}

/// A USRP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Usrp {
    /// Its serial number; none where there is but one.
    pub serial: Option<String>,
    /// Subdevice of the transmitter, as UHD writes it.
    pub transmit_subdevice: String,
    /// Subdevices of the receivers.
    pub receive_subdevices: String,
    /// Whether samples have 12 bits on the wire, in place of 16.
    pub twelve_bits: bool,
}

/// Why there is no experiment, or no radio for it.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// A text cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// Its file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A text of the experiment or of its scenario is wrong.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The recording to be replayed.
    #[error(transparent)]
    Recording(#[from] SigmfError),
    /// The radio.
    #[error(transparent)]
    Radio(#[from] RadioError),
}

/// Every key with its kind, default and explanation, as text.
pub fn reference() -> String {
    keys::SCHEMA.reference()
}

fn unread(path: &Path) -> impl FnOnce(io::Error) -> ExperimentError {
    let path = path.to_owned();
    move |source| ExperimentError::Read { path, source }
}

impl Experiment {
    /// Reads an experiment, with settings (key and value, as `plan.steps` and `50`) laid over its text.
    ///
    /// # Errors
    /// If the file cannot be read; then everything that is wrong with its text.
    pub fn read(path: &Path, settings: &[(String, String)]) -> Result<Self, ExperimentError> {
        let mut description = Description::read(path).map_err(unread(path))?;
        for (key, value) in settings {
            description.set(&keys::SCHEMA, "--set", key, value)?;
        }
        Ok(Self::describe(&description)?)
    }

    /// The experiment of a description.
    ///
    /// # Errors
    /// Everything that is wrong with it, with its lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        keys::build(description).map_err(|faults| description.explain(faults))
    }

    /// Opens the radio, lets `act` work with it, and closes it. Opening a USRP takes seconds. A simulated scene and its pulses fit `memory_bytes`, or
    /// are refused.
    ///
    /// # Errors
    /// If there is no radio; what `act` comes to is its own.
    pub fn with_radio<T>(
        &self,
        memory_bytes: u64,
        act: impl FnOnce(&mut dyn Transceiver) -> T,
    ) -> Result<T, ExperimentError> {
        let faults = self.faults.clone();
        match &self.device {
            Device::Simulated(simulated) => {
                let path = &simulated.scenario;
                let scenario = Scenario::read(path).map_err(unread(path))?;
                let scene = scenario.experiment_within(memory_bytes)?;
                if self.plan.reference == Reference::Leakage {
                    self.same_places(&scene, path)?;
                }
                let (wiring, analogue) = (simulated.wiring.clone(), simulated.analogue.clone());
                let mut radio = SimulatedRadio::new(&scene, wiring, analogue)?;
                if simulated.real_time {
                    radio = radio.in_real_time();
                }
                Ok(with(radio, faults, act))
            }
            Device::Replay(path) => Ok(with(Replay::new(Recording::open(path)?), faults, act)),
            Device::Uhd(usrp) => with_usrp(usrp, faults, act),
        }
    }
}

/// Most that antennas of a plan and of its scenario may be apart, metres: a thousandth of a turn at 300 MHz, there and back.
const APART_M: f64 = 5e-4;

impl Experiment {
    /// Refuses a scenario whose antennas are not where the plan says: their leakage would be of other delays than is taken off.
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
                "{}: the leakage as the reference wants a transmitter and two receivers; give the scenario's radar these",
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
                "{}: its antennas are not where [antennas] of the experiment says; write the same places into both",
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
