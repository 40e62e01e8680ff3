//! TOML description of a stepped-frequency capture plan.

use std::io;
use std::path::Path;
use std::sync::LazyLock;

use glam::DVec3;
use subaperture_describe::declare::{Declared, Located, section};
use subaperture_describe::error::Fault;
use subaperture_describe::schema::Schema;
use subaperture_describe::values::Values;
use subaperture_describe::{Description, DescriptionError};

use super::Plan;
use crate::antennas::{Antennas, Reference};
use crate::transceiver::{Configuration, Source};

/// Description of a plan.
#[section]
pub(crate) struct PlanKeys {
    /// Name of the capture, for titles and records.
    #[key(default = "capture")]
    name: String,
    /// Carriers, dwell time, order and repetition of the sweeps.
    #[section]
    plan: Plan,
    #[section]
    antennas: Option<AntennaKeys>,
    #[section]
    radio: RadioKeys,
}

/// Antenna positions on the body: x forward, y left, z up. Required with a leakage reference.
#[section]
struct AntennaKeys {
    /// Transmit antenna.
    #[key(required = "0, 0, 0 m")]
    transmitter_m: DVec3,
    /// Antenna of receiver 0; unused with a loopback reference.
    #[key(example = "20, 0, 0 cm")]
    receiver_0_m: Located<Option<DVec3>>,
    /// Antenna of receiver 1.
    #[key(required = "30.7, 0, 0 cm")]
    receiver_1_m: DVec3,
}

/// Radio settings.
#[section]
pub(crate) struct RadioKeys {
    /// Master clock rate.
    #[key(default = "16 MHz", positive)]
    master_clock_hz: f64,
    /// Complex sample rate of transmitter and receivers.
    #[key(default = "1 MHz", positive)]
    sample_rate_hz: f64,
    /// Analog bandwidth.
    #[key(default = "1 MHz", positive)]
    bandwidth_hz: f64,
    /// Transmit gain.
    #[key(default = "60 dB", not_negative)]
    transmit_gain_db: f64,
    /// Gain of receiver 0, the reference.
    #[key(default = "40 dB", not_negative)]
    reference_gain_db: f64,
    /// Gain of receiver 1, the echo.
    #[key(default = "40 dB", not_negative)]
    receive_gain_db: f64,
    /// Transmit port.
    #[key(default = "TX/RX")]
    transmit_antenna: String,
    /// Port of receiver 0.
    #[key(default = "RX2")]
    reference_antenna: String,
    /// Port of receiver 1.
    #[key(default = "RX2")]
    receive_antenna: String,
    /// Source of the reference clock.
    #[key(default = "internal")]
    clock: Source,
    /// Source of the pulse per second, which defines device time.
    #[key(default = "internal")]
    pps: Source,
}

static SCHEMA: LazyLock<Schema> =
    LazyLock::new(|| Schema::of::<PlanKeys>("A capture plan is a TOML file."));

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
        let read = |top: Values| PlanKeys::read(&top).plan(&top).map_err(|fault| vec![fault]);
        let built = description.resolve(&SCHEMA).and_then(read);
        built.map_err(|faults| description.explain(faults))
    }
}

impl PlanKeys {
    /// Build the plan. `top` are the values at their positions.
    pub(crate) fn plan(self, top: &Values) -> Result<Plan, Fault> {
        let (plan, values) = (self.plan, top.section("plan"));
        if plan.stop_hz <= plan.start_hz {
            return Err(values.fault(
                "stop",
                "expected a stop frequency above the start: exchange them, and set order = \"down\"",
            ));
        }
        if plan.avoid.iter().any(|(from_hz, to_hz)| to_hz <= from_hz) {
            return Err(values.fault(
                "avoid",
                "expected the lower and upper edges of a band, where the upper edge is above the lower",
            ));
        }
        let antennas = self.antennas.map(|antennas| antennas.build(plan.reference));
        Ok(Plan {
            name: self.name,
            antennas: antennas.transpose()?,
            radio: self.radio.configuration(),
            ..plan
        })
    }
}

impl AntennaKeys {
    fn build(self, reference: Reference) -> Result<Antennas, Fault> {
        if self.receiver_0_m.is_none() && reference == Reference::Leakage {
            return Err(self.receiver_0_m.fault(
                "a leakage reference uses both receivers: give the position of receiver 0's antenna",
            ));
        }
        Ok(Antennas {
            transmitter_m: self.transmitter_m,
            receivers_m: [self.receiver_0_m.unwrap_or_default(), self.receiver_1_m],
        })
    }
}

impl RadioKeys {
    pub(crate) fn configuration(self) -> Configuration {
        Configuration {
            master_clock_hz: self.master_clock_hz,
            sample_rate_hz: self.sample_rate_hz,
            bandwidth_hz: self.bandwidth_hz,
            transmit_gain_db: self.transmit_gain_db,
            receive_gain_db: [self.reference_gain_db, self.receive_gain_db],
            transmit_antenna: self.transmit_antenna,
            receive_antennas: [self.reference_antenna, self.receive_antenna],
            clock: self.clock,
            pps: self.pps,
        }
    }
}
