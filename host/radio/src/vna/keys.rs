//! TOML description of a capture with a vector network analyser.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::DVec3;
use subaperture_describe::declare::{Declared, Located, section};
use subaperture_describe::error::Fault;
use subaperture_describe::schema::Schema;
use subaperture_describe::{Description, DescriptionError};
use subaperture_io::touchstone::parameter_of_name;

use super::settings::{Analyser, ByteOrder, Dialect, Mode, Scan, Trigger, VnaExperiment};

/// Largest number of ports.
const MAX_PORTS: usize = 4;

/// Description of a capture.
#[section]
struct VnaKeys {
    /// Name of the capture, for titles and records.
    #[key(default = "capture")]
    name: String,
    #[section]
    plan: SweepKeys,
    #[section]
    device: AnalyserKeys,
    #[section]
    scan: ScanKeys,
    #[section]
    files: FolderKeys,
}

/// Frequencies and number of sweeps.
#[section]
struct SweepKeys {
    /// First frequency.
    #[key(required = "1 GHz", positive)]
    start_hz: f64,
    /// Frequency step. The unambiguous range is c / (2 step).
    #[key(required = "5 MHz", positive)]
    step_hz: f64,
    /// Number of frequencies. Range resolution is c / (2 step steps).
    #[key(required = 201, whole(2, 100_001))]
    steps: usize,
    /// Number of sweeps, which in stop-and-go modes are stops; 0 runs until stopped.
    #[key(default = 1, whole(0, 100_000))]
    sweeps: u64,
}

/// Vector network analyser, controlled by SCPI over TCP. Its state is kept: select the calibration at the analyser before.
#[section]
struct AnalyserKeys {
    /// Kind of device.
    #[key(required = "vna", words("vna"))]
    kind: String,
    /// Host name or address of the analyser, or of the computer that runs its program.
    #[key(required = "192.168.1.20")]
    address: String,
    /// TCP port.
    #[key(default = 5025, whole(1, 65535))]
    port: u32,
    /// Family of commands. Default: that of the analyser's identification.
    #[key(example = "keysight")]
    dialect: Option<Dialect>,
    /// Scattering parameter, from the transmitting port to the receiving port: s21 is from port 1 to port 2.
    #[key(default = "s21")]
    parameter: Located<String>,
    /// Bandwidth of the intermediate frequency (IF). The analyser must have this value.
    #[key(default = "1 kHz", positive)]
    if_bandwidth_hz: f64,
    /// Source power. The analyser must have this value.
    #[key(default = "-10 dBm", positive)]
    power_w: f64,
    /// Trigger of each sweep: at once, a pulse at the trigger input, or a trigger command over the connection.
    #[key(default = "immediate")]
    trigger: Trigger,
    /// Byte order of transferred numbers.
    #[key(default = "little")]
    byte_order: ByteOrder,
    /// Time-out of an answer; for a sweep, in addition to its time. It includes the wait for an external trigger.
    #[key(default = "10 s", within(1e-3, 86400.0, "1 ms to 1 day"))]
    timeout_s: f64,
    /// Number of times that a sweep is repeated after faults.
    #[key(default = 3, whole(0, 1000))]
    retries: u32,
    /// Number of attempts to open a connection.
    #[key(default = 5, whole(1, 1000))]
    connections: u32,
    /// Pause between these attempts.
    #[key(default = "2 s", within(0.0, 3600.0, "0 to 1 hour"))]
    pause_s: f64,
}

/// Stops of the antennas. Positions may be added to the recording's description later.
#[section]
struct ScanKeys {
    /// Begin of a sweep: with the Enter key at each stop; a time after that of the sweep before; or at the end of the sweep before, at rest (immediate)
    /// or while the antennas move (free), where times are recorded.
    #[key(default = "enter", select(Enter, Interval, Immediate, Free))]
    mode: ModeKeys,
    /// Time from the beginning of a sweep to that of the next.
    #[key(required = "5 s", positive, when(Interval))]
    interval_s: f64,
    /// Position of the antennas at the first stop, or at time 0.
    #[key(default = "0, 0, 0 m")]
    first_m: DVec3,
    /// Displacement from stop to stop.
    #[key(example = "25, 0, 0 mm", when(Enter, Interval, Immediate))]
    step_m: Option<DVec3>,
    /// Velocity of the antennas.
    #[key(example = "50, 0, 0 mm/s", when(Free))]
    velocity_m_s: Option<DVec3>,
    /// Positions as a CSV file with time_s, x_m, y_m, z_m. Time is the number of the stop, from 0; in mode free seconds from the beginning of the capture.
    #[key(example = "stops.csv")]
    positions: Located<Option<PathBuf>>,
}

/// Folder to write.
#[section]
struct FolderKeys {
    /// Folder of the recording.
    #[key(example = "scan")]
    recording: Option<PathBuf>,
}

pub(crate) static SCHEMA: LazyLock<Schema> = LazyLock::new(|| {
    Schema::of::<VnaKeys>(
        "An experiment with a vector network analyser, [device] kind = \"vna\", has these keys instead.",
    )
});

/// Reference text of all keys, with type, default and description.
pub fn reference() -> String {
    SCHEMA.reference()
}

impl VnaExperiment {
    /// Make an experiment from a parsed description.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        let built = description.resolve(&SCHEMA).and_then(|top| {
            let built = VnaKeys::read(&top).build(description.folder());
            built.map_err(|fault| vec![fault])
        });
        built.map_err(|faults| description.explain(faults))
    }
}

impl VnaKeys {
    fn build(self, folder: &Path) -> Result<VnaExperiment, Fault> {
        let (plan, device) = (self.plan, self.device);
        debug_assert_eq!(device.kind, "vna");
        let parameter = parameter_of_name(&device.parameter)
            .filter(|ports| ports.iter().all(|&port| port <= MAX_PORTS))
            .ok_or_else(|| {
                device.parameter.fault(format!(
                    "expected a scattering parameter of at most {MAX_PORTS} ports such as \"s21\", found \"{}\"",
                    *device.parameter
                ))
            })?;
        // Analysers have a resolution of at most 0.01 dB; rounding removes that of the conversion to watts.
        let power_dbm = (10.0 * libm::log10(device.power_w / 1e-3) * 1e4).round() / 1e4;
        Ok(VnaExperiment {
            name: self.name,
            sweeps: plan.sweeps,
            analyser: Analyser {
                address: device.address,
                port: device.port as u16,
                dialect: device.dialect,
                parameter,
                start_hz: plan.start_hz,
                step_hz: plan.step_hz,
                points: plan.steps,
                if_bandwidth_hz: device.if_bandwidth_hz,
                power_dbm,
                trigger: device.trigger,
                byte_order: device.byte_order,
                timeout_s: device.timeout_s,
                retries: device.retries,
                connections: device.connections,
                pause_s: device.pause_s,
            },
            scan: self.scan.build(folder)?,
            recording: self.files.recording.map(|path| folder.join(path)),
        })
    }
}

impl ScanKeys {
    fn build(self, folder: &Path) -> Result<Scan, Fault> {
        let step_m = self.step_m.or(self.velocity_m_s);
        if step_m.is_some() && self.positions.is_some() {
            return Err(self
                .positions
                .fault("expected either positions or a step or velocity, found both: remove one"));
        }
        Ok(Scan {
            mode: match self.mode {
                ModeKeys::Enter => Mode::Enter,
                ModeKeys::Interval(keys) => Mode::Interval(keys.interval_s),
                ModeKeys::Immediate => Mode::Immediate,
                ModeKeys::Free => Mode::Free,
            },
            first_m: self.first_m,
            step_m,
            track: (*self.positions).as_ref().map(|path| folder.join(path)),
        })
    }
}
