//! Configured analyser: sweeps with their checks.

use std::thread::sleep;
use std::time::{Duration, Instant};

use num_complex::Complex64;

use super::answer::{number, numbers, queue_entry};
use super::connection::Connection;
use super::dialect::{BUSY, TRACE};
use super::fault::{Fault, FaultKind};
use super::settings::{Analyser, ByteOrder, Dialect};

/// Entries of an error queue that are read at once.
const MOST_ENTRIES: usize = 100;
/// Longest identification that is kept, characters.
const LONGEST_IDENTITY: usize = 200;
/// Pause between questions for the end of a sweep.
const POLL: Duration = Duration::from_millis(20);
/// Largest error of a frequency, steps; as for recordings of Touchstone files.
const OFF_STEPS: f64 = 0.01;

/// Why an analyser is not ready, or a sweep failed.
pub(super) enum Failure {
    /// Faults, which another attempt may not have.
    Faults(Vec<Fault>),
    /// The analyser does not have the settings.
    Refused(String),
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::Faults(vec![fault])
    }
}

/// Sweep that has passed all checks.
pub(super) struct Sweep {
    pub(super) frequencies_hz: Vec<f64>,
    pub(super) values: Vec<Complex64>,
    /// When the analyser reported the end of the sweep.
    pub(super) ended: Instant,
}

pub(super) struct Instrument<'a> {
    connection: Connection,
    analyser: &'a Analyser,
    dialect: Dialect,
    /// Identification of the analyser (`*IDN?`).
    pub(super) identity: String,
    /// Time of a sweep as stated by the analyser, seconds.
    pub(super) sweep_s: f64,
}

impl<'a> Instrument<'a> {
    /// Connect to an analyser and set it. `earlier` receives the errors in its queue from before.
    pub(super) fn open(analyser: &'a Analyser, earlier: &mut Vec<Fault>) -> Result<Self, Failure> {
        let timeout = Duration::from_secs_f64(analyser.timeout_s);
        let mut connection = Connection::open(&analyser.address, analyser.port, timeout)?;
        let identity: String = connection.ask("*IDN?")?;
        let identity: String = (identity.chars())
            .filter(|c| !c.is_control())
            .take(LONGEST_IDENTITY)
            .collect();
        let Some(dialect) = analyser.dialect.or_else(|| Dialect::of(&identity)) else {
            return Err(Failure::Refused(format!(
                "expected a vector network analyser of Keysight, Rohde & Schwarz or Copper Mountain, found '{identity}': set device.dialect to the family \
                 whose commands it takes"
            )));
        };
        let mut instrument = Self {
            connection,
            analyser,
            dialect,
            identity,
            sweep_s: 0.0,
        };
        earlier.extend(instrument.queued_errors()?);
        instrument.configure()?;
        instrument.check()?;
        Ok(instrument)
    }

    fn configure(&mut self) -> Result<(), Failure> {
        self.connection.send("*CLS")?;
        if self.dialect == Dialect::Keysight {
            let traces = self.connection.ask("CALC1:PAR:CAT:EXT?")?;
            let mut names = traces.trim_matches('"').split(',').step_by(2);
            if names.any(|name| name == TRACE) {
                self.connection.send(&format!("CALC1:PAR:DEL '{TRACE}'"))?;
            }
        }
        for command in self.dialect.configuration(self.analyser) {
            self.connection.send(&command)?;
        }
        self.connection.ask("*OPC?")?;
        let errors = self.queued_errors()?;
        match errors.is_empty() {
            true => Ok(()),
            false => Err(Failure::Refused(format!(
                "the settings are refused: {}",
                listed(&errors)
            ))),
        }
    }

    /// Compare the settings in effect with those that were set.
    fn check(&mut self) -> Result<(), Failure> {
        let analyser = self.analyser;
        let bandwidth_hz = analyser.if_bandwidth_hz;
        for (key, question, expected, most, unit) in [
            (
                "plan.steps",
                "SENS1:SWE:POIN?",
                analyser.points as f64,
                0.0,
                "",
            ),
            (
                "device.if_bandwidth",
                "SENS1:BAND?",
                bandwidth_hz,
                0.01 * bandwidth_hz,
                " Hz",
            ),
            (
                "device.power",
                "SOUR1:POW?",
                analyser.power_dbm,
                0.01,
                " dBm",
            ),
        ] {
            let found = self.connection.number(question)?;
            if (found - expected).abs() > most {
                return Err(Failure::Refused(format!(
                    "{key}: expected {expected}{unit}, the analyser has set {found}{unit}: give a value that it supports"
                )));
            }
        }
        let order = self.connection.ask("FORM:BORD?")?;
        let expected = match analyser.byte_order {
            ByteOrder::Little => "SWAP",
            ByteOrder::Big => "NORM",
        };
        if !order.to_ascii_uppercase().starts_with(expected) {
            return Err(Failure::Refused(format!(
                "device.byte_order: expected {expected}, the analyser has set {order}: choose the other byte order"
            )));
        }
        self.sweep_s = self.connection.number("SENS1:SWE:TIME?")?.max(0.0);
        match self.frequencies() {
            Ok(_) => Ok(()),
            Err(fault) if matches!(fault.kind, FaultKind::Frequencies | FaultKind::Points) => Err(
                Failure::Refused(format!("plan.start and plan.step: {fault}")),
            ),
            Err(fault) => Err(fault.into()),
        }
    }

    /// Numbers of a block.
    fn numbers(&mut self, question: &str) -> Result<Vec<f64>, Fault> {
        // Twice as many points as expected are a fault of the points, and not of the length.
        let most_bytes = 32 * self.analyser.points + 4096;
        let data = self.connection.block(question, most_bytes)?;
        numbers(&data, self.analyser.byte_order).map_err(|fault| fault.of(question))
    }

    /// Frequencies in use, which are those that were set.
    fn frequencies(&mut self) -> Result<Vec<f64>, Fault> {
        let question = self.dialect.frequencies();
        let found_hz = self.numbers(question)?;
        let analyser = self.analyser;
        let is_near = |k: usize, hz: f64| {
            (hz - analyser.frequency_hz(k)).abs() <= OFF_STEPS * analyser.step_hz
        };
        if found_hz.len() != analyser.points {
            let message = format!(
                "{question}: expected {} frequencies, found {}",
                analyser.points,
                found_hz.len()
            );
            return Err(Fault::new(FaultKind::Points, message));
        }
        let other = found_hz
            .iter()
            .enumerate()
            .find(|(k, hz)| !is_near(*k, **hz));
        let Some((k, &hz)) = other else {
            return Ok(found_hz);
        };
        let swapped = |hz: f64| f64::from_bits(hz.to_bits().swap_bytes());
        if (found_hz.iter().enumerate()).all(|(k, &hz)| is_near(k, swapped(hz))) {
            let message = format!(
                "{question}: expected numbers in the byte order {:?}, as announced, found the other one",
                analyser.byte_order
            );
            return Err(Fault::new(FaultKind::ByteOrder, message));
        }
        let message = format!(
            "{question}: expected {} Hz for frequency {k}, from 0, found {hz} Hz",
            analyser.frequency_hz(k)
        );
        Err(Fault::new(FaultKind::Frequencies, message))
    }

    /// Entries of the error queue, which is empty afterwards.
    fn queued_errors(&mut self) -> Result<Vec<Fault>, Fault> {
        let question = "SYST:ERR?";
        let mut errors = Vec::new();
        while errors.len() < MOST_ENTRIES {
            let text = self.connection.ask(question)?;
            let (code, text) = queue_entry(&text).map_err(|fault| fault.of(question))?;
            if code == 0 {
                break;
            }
            let message = format!("the analyser reports error {code}, {text}");
            errors.push(Fault::new(FaultKind::Instrument, message));
        }
        Ok(errors)
    }

    /// Measure a sweep, with all checks.
    pub(super) fn sweep(&mut self) -> Result<Sweep, Vec<Fault>> {
        let alone = |fault: Fault| vec![fault];
        self.run().map_err(alone)?;
        let ended = Instant::now();
        let mut faults = Vec::new();
        let values = match self.values() {
            Ok(values) => values,
            Err(fault) if fault.kind.needs_reconnection() => return Err(vec![fault]),
            Err(fault) => {
                faults.push(fault);
                Vec::new()
            }
        };
        let frequencies_hz = match self.frequencies() {
            Ok(frequencies_hz) => frequencies_hz,
            Err(fault) => {
                faults.push(fault);
                Vec::new()
            }
        };
        let needs_reconnection = |fault: &Fault| fault.kind.needs_reconnection();
        if faults.iter().any(needs_reconnection) {
            return Err(faults);
        }
        match self.queued_errors() {
            Ok(errors) => faults.extend(errors),
            Err(fault) => faults.push(fault),
        }
        match faults.is_empty() {
            true => Ok(Sweep {
                frequencies_hz,
                values,
                ended,
            }),
            false => Err(faults),
        }
    }

    /// Trigger a sweep and wait for its end.
    fn run(&mut self) -> Result<(), Fault> {
        let wait = Duration::from_secs_f64(self.sweep_s.min(1e6) + self.analyser.timeout_s);
        let trigger = self.analyser.trigger;
        for command in self.dialect.start(trigger) {
            self.connection.send(command)?;
        }
        if !self.dialect.polls(trigger) {
            let question = "*OPC?";
            let answer = self.connection.ask_within(question, wait)?;
            return match number(&answer) {
                Ok(1.0) => Ok(()),
                _ => {
                    let message = format!("{question}: expected 1, found '{answer}'");
                    Err(Fault::new(FaultKind::Malformed, message))
                }
            };
        }
        let question = "STAT:OPER:COND?";
        let deadline = Instant::now() + wait;
        while self.connection.number(question)? as u32 & BUSY != 0 {
            if Instant::now() > deadline {
                let message = format!("{question}: the sweep does not end within the time-out");
                return Err(Fault::new(FaultKind::Timeout, message));
            }
            sleep(POLL);
        }
        Ok(())
    }

    /// Complex values of the trace.
    fn values(&mut self) -> Result<Vec<Complex64>, Fault> {
        let question = self.dialect.values();
        let numbers = self.numbers(question)?;
        let points = self.analyser.points;
        if numbers.len() != 2 * points {
            let message = format!(
                "{question}: expected {points} complex values, found {}",
                numbers.len() as f64 / 2.0
            );
            return Err(Fault::new(FaultKind::Points, message));
        }
        if let Some(i) = numbers.iter().position(|number| !number.is_finite()) {
            let message = format!(
                "{question}: expected finite values, found {} at frequency {}, from 0",
                numbers[i],
                i / 2
            );
            return Err(Fault::new(FaultKind::NotFinite, message));
        }
        let (pairs, _) = numbers.as_chunks::<2>();
        Ok(pairs
            .iter()
            .map(|&[re, im]| Complex64::new(re, im))
            .collect())
    }
}

/// Messages of the faults, separated by semicolons.
fn listed(faults: &[Fault]) -> String {
    let messages: Vec<&str> = faults.iter().map(|fault| &*fault.message).collect();
    messages.join("; ")
}
