//! Settings of a capture with a vector network analyser.

use std::path::PathBuf;

use glam::DVec3;
use subaperture_describe::declare::Choice;

/// Commands of a family of analysers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Dialect {
    /// Keysight PNA, PXI and USB analysers, and ENA E5080.
    Keysight,
    /// Keysight ENA E5061, E5063 and E5071.
    KeysightEna,
    /// Rohde & Schwarz ZNB, ZNA and ZVA.
    RohdeSchwarz,
    /// Copper Mountain, by its programs S2VNA, S4VNA and others.
    CopperMountain,
}

/// Trigger of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Trigger {
    /// Start without a trigger event.
    Immediate,
    /// Start with a pulse at the trigger input.
    External,
    /// Start with a trigger command.
    Bus,
}

/// Byte order of the numbers in blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// Address and settings of an analyser.
#[derive(Clone, Debug, PartialEq)]
pub struct Analyser {
    /// Host name or address.
    pub address: String,
    /// TCP port of the SCPI server.
    pub port: u16,
    /// Commands; `None` for those of the identification.
    pub dialect: Option<Dialect>,
    /// Receiving and transmitting port of the scattering parameter, from 1.
    pub parameter: [usize; 2],
    /// First frequency of a sweep, hertz.
    pub start_hz: f64,
    /// Step from frequency to frequency, hertz.
    pub step_hz: f64,
    /// Number of frequencies of a sweep.
    pub points: usize,
    /// Bandwidth of the intermediate frequency, hertz.
    pub if_bandwidth_hz: f64,
    /// Power of the source, dBm.
    pub power_dbm: f64,
    /// Trigger of each sweep.
    pub trigger: Trigger,
    /// Byte order of blocks.
    pub byte_order: ByteOrder,
    /// Time-out of an answer, in addition to the time of a sweep, seconds.
    pub timeout_s: f64,
    /// Number of times that a sweep is repeated after faults.
    pub retries: u32,
    /// Number of attempts to open a connection.
    pub connections: u32,
    /// Pause between these attempts, seconds.
    pub pause_s: f64,
}

impl Analyser {
    /// Frequency number `k`, from 0, hertz.
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }

    /// Shortest time of a sweep, seconds: the filter of the intermediate frequency takes its reciprocal bandwidth at each point.
    pub fn sweep_s(&self) -> f64 {
        self.points as f64 / self.if_bandwidth_hz
    }

    /// Name of the scattering parameter, such as `S21`.
    pub fn parameter_name(&self) -> String {
        let [to, from] = self.parameter;
        format!("S{to}{from}")
    }
}

/// Event that begins a sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mode {
    /// The caller, at each stop.
    Enter,
    /// A fixed time after the beginning of the sweep before, seconds.
    Interval(f64),
    /// The end of the sweep before, at rest.
    Immediate,
    /// The end of the sweep before, while the antennas move. Times are recorded.
    Free,
}

/// Motion of the antennas.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Event that begins a sweep.
    pub mode: Mode,
    /// Position at the first stop or time 0, metres.
    pub first_m: DVec3,
    /// Displacement from stop to stop, metres; in free mode the velocity, metres per second. `None` if unknown.
    pub step_m: Option<DVec3>,
    /// Track file; its time is the number of the stop, or in free mode seconds.
    pub track: Option<PathBuf>,
}

/// Capture with a vector network analyser, as described in a TOML file.
#[derive(Clone, Debug, PartialEq)]
pub struct VnaExperiment {
    /// Name of the capture.
    pub name: String,
    /// Number of sweeps; 0 until stopped.
    pub sweeps: u64,
    /// Analyser and its settings.
    pub analyser: Analyser,
    /// Stops, and positions of the antennas.
    pub scan: Scan,
    /// Folder of the recording, if given.
    pub recording: Option<PathBuf>,
}

impl VnaExperiment {
    /// Settings that all sweeps of a folder share, by key.
    pub(super) fn shared(&self) -> Vec<(&'static str, String)> {
        let (analyser, scan) = (&self.analyser, &self.scan);
        vec![
            ("plan.start", format!("{} Hz", analyser.start_hz)),
            ("plan.step", format!("{} Hz", analyser.step_hz)),
            ("plan.steps", analyser.points.to_string()),
            ("device.parameter", analyser.parameter_name()),
            (
                "device.if_bandwidth",
                format!("{} Hz", analyser.if_bandwidth_hz),
            ),
            ("device.power", format!("{} dBm", analyser.power_dbm)),
            (
                "scan.mode",
                match scan.mode {
                    Mode::Free => "free".to_owned(),
                    _ => "stop-and-go".to_owned(),
                },
            ),
            ("scan.first", format!("{} m", scan.first_m)),
            (
                "scan.step or velocity",
                match scan.step_m {
                    Some(step_m) => format!("{step_m} m or m/s"),
                    None => "unknown".to_owned(),
                },
            ),
        ]
    }
}
