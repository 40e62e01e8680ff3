//! TOML description of a signal chain.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use subaperture_describe::declare::{Located, section};
use subaperture_describe::error::{Fault, Location};
use subaperture_describe::schema::Schema;
use subaperture_describe::{Description, DescriptionError};

/// Stage of a chain: a matched two-port.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Name for tables and warnings.
    pub name: String,
    /// Gain, dB; negative for cables, attenuators and couplers.
    pub gain_db: f64,
    /// Noise figure at 290 K, dB.
    pub noise_figure_db: f64,
    /// Output power at 1 dB of compression, dBm; `None` if the stage has no such limit.
    pub compression_dbm: Option<f64>,
}

/// Analogue-to-digital converters of I and Q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converter {
    /// Power of a tone at full scale, dBm.
    pub full_scale_dbm: f64,
    /// Effective number of bits, sign included.
    pub bits: f64,
    /// Complex sample rate, equal to the noise bandwidth, hertz.
    pub sample_rate_hz: f64,
}

/// Signal chain of a radar, from the exciter to the converter.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Output power of the exciter, dBm.
    pub exciter_dbm: f64,
    /// Stages from the exciter to the transmit antenna.
    pub transmit: Vec<Stage>,
    /// Stages from the receive antenna to the converter; one or more.
    pub receive: Vec<Stage>,
    /// Converter after the last receive stage.
    pub converter: Converter,
    /// Gain of the transmit antenna on boresight, dBi.
    pub transmit_gain_dbi: f64,
    /// Gain of the receive antenna on boresight, dBi.
    pub receive_gain_dbi: f64,
    /// Ratio of the transmitted power to the leakage at the port of the receive antenna, dB.
    pub isolation_db: f64,
    /// Losses outside the chain, dB.
    pub losses_db: f64,
    /// Noise temperature of the receive antenna, kelvin.
    pub temperature_k: f64,
    /// Radar cross-section of the target, square metres.
    pub cross_section_m2: f64,
    /// Time that the transmitter is on in a pulse or a sweep, seconds.
    pub pulse_s: f64,
    /// Time from carrier to carrier of a stepped sweep, seconds; `None` if the samples of a pulse are simultaneous.
    pub carrier_s: Option<f64>,
}

/// Error of reading a chain.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChainError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The text is invalid.
    #[error(transparent)]
    Description(#[from] DescriptionError),
}

/// Description of a chain.
#[section]
struct ChainKeys {
    #[at]
    header: Location,
    /// Output power of the exciter, the input of the first transmit stage.
    #[key(required = "10 dBm", positive)]
    power_w: f64,
    /// Time that the transmitter is on in a pulse, or in a sweep of stepped carriers.
    #[key(required = "10 us", positive)]
    pulse_length_s: f64,
    /// Time from carrier to carrier of a stepped sweep, tuning included. Left out, the samples of a pulse are simultaneous.
    #[key(example = "6 ms", positive)]
    carrier_time_s: Option<f64>,
    /// Radar cross-section of the target.
    #[key(default = "1 m^2", positive)]
    cross_section_m2: f64,
    /// Antennas, and the leakage between them.
    #[section]
    antennas: AntennaKeys,
    /// Stages from the exciter to the transmit antenna, in this order.
    #[section]
    transmit: Vec<TransmitKeys>,
    /// Stages from the receive antenna to the converter, in this order; one or more.
    #[section]
    receive: Vec<ReceiveKeys>,
    /// Analogue-to-digital converters of I and Q.
    #[section]
    converter: ConverterKeys,
}

/// Antennas, and the leakage between them.
#[section]
struct AntennaKeys {
    /// Gain of the transmit antenna on boresight.
    #[key(default = "0 dBi", within(-100.0, 100.0, "-100 to 100 dBi"))]
    transmit_gain_dbi: f64,
    /// Gain of the receive antenna on boresight.
    #[key(default = "0 dBi", within(-100.0, 100.0, "-100 to 100 dBi"))]
    receive_gain_dbi: f64,
    /// Ratio of the transmitted power to the leakage at the port of the receive antenna.
    #[key(required = "60 dB", within(0.0, 300.0, "0 to 300 dB"))]
    isolation_db: f64,
    /// Losses outside the chain.
    #[key(default = "0 dB", within(0.0, 300.0, "0 to 300 dB"))]
    losses_db: f64,
    /// Noise temperature of the receive antenna.
    #[key(default = "290 K", not_negative)]
    temperature_k: f64,
}

/// Stage between exciter and antenna.
#[section]
struct TransmitKeys {
    /// Name for tables and warnings.
    #[key(required = "PA")]
    name: String,
    /// Gain; negative for cables, attenuators and couplers.
    #[key(required = "36 dB", within(-200.0, 200.0, "-200 to 200 dB"))]
    gain_db: f64,
    /// Output power at 1 dB of compression. Left out, the stage has no limit.
    #[key(example = "29 dBm", positive)]
    compression_w: Option<f64>,
}

/// Stage between antenna and converter.
#[section]
struct ReceiveKeys {
    /// Name for tables and warnings.
    #[key(required = "LNA")]
    name: String,
    /// Gain; negative for cables, attenuators and couplers.
    #[key(required = "35.5 dB", within(-200.0, 200.0, "-200 to 200 dB"))]
    gain_db: Located<f64>,
    /// Noise figure at 290 K. Left out, a stage without gain has its loss.
    #[key(example = "1.6 dB", within(0.0, 200.0, "0 to 200 dB"))]
    noise_figure_db: Option<f64>,
    /// Output power at 1 dB of compression. Left out, the stage has no limit.
    #[key(example = "15 dBm", positive)]
    compression_w: Option<f64>,
}

/// Analogue-to-digital converters of I and Q.
#[section]
struct ConverterKeys {
    /// Power of a tone at full scale, at the output of the last receive stage.
    #[key(required = "4 dBm", positive)]
    full_scale_w: f64,
    /// Effective number of bits, sign included.
    #[key(required = 10.5, within(1.0, 32.0, "1 to 32"))]
    bits: f64,
    /// Complex sample rate, which is the noise bandwidth.
    #[key(required = "20 MHz", positive)]
    sample_rate_hz: f64,
}

static SCHEMA: LazyLock<Schema> = LazyLock::new(|| {
    Schema::of::<ChainKeys>(
        "A signal chain is a TOML file with the transmit and receive stages, the antennas and the converter of a radar.",
    )
});

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

/// Ratio of two powers, dB.
pub(super) fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Level of a power, dBm.
pub(super) fn dbm(power_w: f64) -> f64 {
    db(power_w) + 30.0
}

impl Chain {
    /// Read a chain from a TOML file, which may take `memory_bytes` when it is parsed.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise all faults of its text.
    pub fn read_within(path: &Path, memory_bytes: u64) -> Result<Self, ChainError> {
        let description = Description::read_within(path, memory_bytes);
        let description = description.map_err(|source| ChainError::Read {
            path: path.to_owned(),
            source,
        })?;
        Ok(Self::describe(&description)?)
    }

    /// Make a chain from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        let keys = description.resolve_as::<ChainKeys>(&SCHEMA);
        let chain = keys.and_then(ChainKeys::build);
        chain.map_err(|faults| description.explain(faults))
    }
}

impl ChainKeys {
    fn build(self) -> Result<Chain, Vec<Fault>> {
        if self.receive.is_empty() {
            let missing = "expected one receive stage or more, found no [[receive]]: add the first stage after the antenna";
            return Err(vec![Fault::new(&self.header, missing)]);
        }
        let (mut receive, mut faults) = (Vec::new(), Vec::new());
        for stage in self.receive {
            match stage.build() {
                Ok(stage) => receive.push(stage),
                Err(fault) => faults.push(fault),
            }
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let antennas = self.antennas;
        Ok(Chain {
            exciter_dbm: dbm(self.power_w),
            transmit: (self.transmit.into_iter())
                .map(|stage| Stage {
                    name: stage.name,
                    gain_db: stage.gain_db,
                    // Transmitted noise does not enter the levels.
                    noise_figure_db: 0.0,
                    compression_dbm: stage.compression_w.map(dbm),
                })
                .collect(),
            receive,
            converter: Converter {
                full_scale_dbm: dbm(self.converter.full_scale_w),
                bits: self.converter.bits,
                sample_rate_hz: self.converter.sample_rate_hz,
            },
            transmit_gain_dbi: antennas.transmit_gain_dbi,
            receive_gain_dbi: antennas.receive_gain_dbi,
            isolation_db: antennas.isolation_db,
            losses_db: antennas.losses_db,
            temperature_k: antennas.temperature_k,
            cross_section_m2: self.cross_section_m2,
            pulse_s: self.pulse_length_s,
            carrier_s: self.carrier_time_s,
        })
    }
}

impl ReceiveKeys {
    fn build(self) -> Result<Stage, Fault> {
        let passive_db = (*self.gain_db <= 0.0).then_some(-*self.gain_db);
        let noise_figure_db = self.noise_figure_db.or(passive_db).ok_or_else(|| {
            self.gain_db.fault(format!(
                "{}: expected a noise figure, found a gain of {} dB without one: add noise_figure",
                self.name, *self.gain_db
            ))
        })?;
        Ok(Stage {
            name: self.name,
            gain_db: *self.gain_db,
            noise_figure_db,
            compression_dbm: self.compression_w.map(dbm),
        })
    }
}
