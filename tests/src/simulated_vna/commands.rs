//! Commands of the simulated analyser, by family.

use std::collections::VecDeque;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::sweep::{block, bytes, echo};
use super::{Family, Fault, Options, Reply};

/// Entries of the error queue; the last is then the overflow.
const QUEUE: usize = 10;

/// State of the trigger.
#[derive(Clone, Copy, PartialEq)]
enum Run {
    Idle,
    Armed,
    Hold,
    /// Sweeping until then; waiting for a pulse until the first instant.
    Sweeping(Instant, Instant),
}

pub(super) struct Analyser {
    options: Options,
    start_hz: f64,
    stop_hz: f64,
    points: usize,
    bandwidth_hz: f64,
    power_dbm: f64,
    is_swapped: bool,
    is_binary: bool,
    source: String,
    is_continuous: bool,
    traces: Vec<(String, String)>,
    selected: Option<String>,
    errors: VecDeque<(i32, String)>,
    run: Run,
    sweeps: usize,
    stop: usize,
    active: Option<Fault>,
}

fn text(answer: impl std::fmt::Display) -> Reply {
    Reply::Send(format!("{answer}\n").into_bytes())
}

impl Analyser {
    pub(super) fn new(options: Options) -> Self {
        Self {
            options,
            start_hz: 1e8,
            stop_hz: 2e8,
            points: 51,
            bandwidth_hz: 1e5,
            power_dbm: 0.0,
            is_swapped: false,
            is_binary: false,
            source: "INT".to_owned(),
            is_continuous: true,
            traces: vec![("CH1_S11_1".to_owned(), "S11".to_owned())],
            selected: None,
            errors: VecDeque::new(),
            run: Run::Idle,
            sweeps: 0,
            stop: 0,
            active: None,
        }
    }

    /// A connection is accepted: faults of the one before are over.
    pub(super) fn connected(&mut self) {
        self.active = None;
    }

    fn push(&mut self, code: i32, text: &str) {
        match self.errors.len() {
            0..QUEUE => self.errors.push_back((code, text.to_owned())),
            _ => self.errors[QUEUE - 1] = (-350, "Queue overflow".to_owned()),
        }
    }

    /// Execute a command, and return its answer.
    pub(super) fn take(&mut self, line: &str) -> Reply {
        let (header, argument) = line.split_once(' ').unwrap_or((line, ""));
        if let Some(reply) = self.common(header, argument) {
            return reply;
        }
        let reply = match self.options.family {
            Family::Pna => self.pna(header, argument),
            Family::Znb => self.znb(header, argument),
            Family::Ena | Family::Cmt => self.ena(header, argument),
        };
        reply.unwrap_or_else(|| {
            self.push(-113, "Undefined header");
            Reply::Silence
        })
    }

    fn common(&mut self, header: &str, argument: &str) -> Option<Reply> {
        let number = || argument.parse::<f64>().expect("a number");
        match header {
            "*IDN?" => return Some(text(&self.options.identity)),
            "*CLS" => self.errors.clear(),
            "*OPC?" => return Some(self.complete()),
            "SYST:ERR?" => return Some(self.next_error()),
            "SENS1:SWE:TYPE" | "SENS1:AVER" => {}
            "SENS1:FREQ:STAR" => self.start_hz = number(),
            "SENS1:FREQ:STOP" => self.stop_hz = number(),
            "SENS1:SWE:POIN" => self.points = number() as usize,
            "SENS1:SWE:POIN?" => return Some(text(format!("+{}", self.points))),
            "SENS1:BAND" => self.bandwidth_hz = number().min(self.options.most_bandwidth_hz),
            "SENS1:BAND?" => return Some(text(format!("{:+.11E}", self.bandwidth_hz))),
            "SOUR1:POW" => self.power_dbm = number().min(self.options.most_power_dbm),
            "SOUR1:POW?" => return Some(text(format!("{:+.11E}", self.power_dbm))),
            "SENS1:SWE:TIME?" => {
                let seconds = self.options.sweep.as_secs_f64();
                return Some(text(format!("{seconds:+.11E}")));
            }
            "FORM:DATA" => {
                let is_ena = matches!(self.options.family, Family::Ena | Family::Cmt);
                self.is_binary = argument == if is_ena { "REAL" } else { "REAL,64" };
                if !self.is_binary {
                    self.push(-224, "Illegal parameter value");
                }
            }
            "FORM:BORD" => self.is_swapped = argument == "SWAP",
            "FORM:BORD?" => return Some(text(if self.is_swapped { "SWAP" } else { "NORM" })),
            _ => return None,
        }
        Some(Reply::Silence)
    }

    fn pna(&mut self, header: &str, argument: &str) -> Option<Reply> {
        match (header, argument) {
            ("CALC1:PAR:CAT:EXT?", "") => {
                let names: Vec<String> = (self.traces.iter())
                    .map(|(name, parameter)| format!("{name},{parameter}"))
                    .collect();
                return Some(text(format!("\"{}\"", names.join(","))));
            }
            ("CALC1:PAR:DEL", name) => {
                let name = name.trim_matches('\'');
                self.traces.retain(|(known, _)| known != name);
            }
            ("CALC1:PAR:DEF:EXT", definition) => self.define(definition, false),
            ("CALC1:PAR:SEL", name) => self.select(name),
            ("SENS1:SWE:MODE", "HOLD") => self.run = Run::Idle,
            ("SENS1:SWE:MODE", "SING") => match &*self.source {
                "IMM" => self.begin(Duration::ZERO),
                "EXT" => self.begin(self.options.pulse),
                _ => self.run = Run::Armed,
            },
            ("TRIG:SOUR", "IMM" | "EXT" | "MAN") => self.set_source(argument),
            ("INIT1:IMM", "") => self.trigger("MAN"),
            ("CALC1:DATA?", "SDATA") => return Some(self.values()),
            ("SENS1:X?", "") => return Some(self.frequencies()),
            _ => return None,
        }
        Some(Reply::Silence)
    }

    fn znb(&mut self, header: &str, argument: &str) -> Option<Reply> {
        match (header, argument) {
            ("CALC1:PAR:SDEF", definition) => self.define(definition, true),
            ("CALC1:PAR:SEL", name) => self.select(name),
            ("INIT1:CONT", "OFF") => self.is_continuous = false,
            ("TRIG1:SOUR", "IMM" | "EXT" | "MAN") => self.set_source(argument),
            ("INIT1:IMM", "") if !self.is_continuous => match &*self.source {
                "IMM" => self.begin(Duration::ZERO),
                "EXT" => self.begin(self.options.pulse),
                _ => self.run = Run::Armed,
            },
            ("*TRG", "") => self.trigger("MAN"),
            ("CALC1:DATA?", "SDAT") => return Some(self.values()),
            ("CALC1:DATA:STIM?", "") => return Some(self.frequencies()),
            _ => return None,
        }
        Some(Reply::Silence)
    }

    fn ena(&mut self, header: &str, argument: &str) -> Option<Reply> {
        match (header, argument) {
            ("CALC1:PAR1:DEF", parameter) => {
                self.traces = vec![("1".to_owned(), parameter.to_owned())];
            }
            ("CALC1:PAR1:SEL", "") => self.selected = Some("1".to_owned()),
            ("INIT1:CONT", "ON" | "OFF") => {
                self.is_continuous = argument == "ON";
                self.run = if self.is_continuous {
                    Run::Armed
                } else {
                    Run::Idle
                };
            }
            ("TRIG:SOUR", "INT" | "EXT" | "BUS" | "MAN") => self.set_source(argument),
            ("INIT1:IMM", "") if self.source == "EXT" => self.begin(self.options.pulse),
            ("TRIG:SING", "") => {
                self.trigger("BUS");
            }
            ("STAT:OPER:COND?", "") => {
                let now = Instant::now();
                return Some(text(match self.run {
                    Run::Hold => 32,
                    Run::Sweeping(begin, _) if now < begin => 32,
                    Run::Sweeping(_, end) if now < end => 16,
                    _ => 0,
                }));
            }
            ("CALC1:DATA:SDAT?", "") => return Some(self.values()),
            ("SENS1:FREQ:DATA?", "") => return Some(self.frequencies()),
            _ => return None,
        }
        Some(Reply::Silence)
    }

    fn define(&mut self, definition: &str, replaces: bool) {
        let (name, parameter) = definition.split_once(',').expect("name and parameter");
        let plain = |text: &str| text.trim_matches('\'').to_owned();
        let (name, parameter) = (plain(name), plain(parameter));
        let is_known = self.traces.iter().any(|(known, _)| *known == name);
        if is_known && !replaces {
            return self.push(105, "Measurement exists already");
        }
        self.traces.retain(|(known, _)| *known != name);
        self.traces.push((name, parameter));
    }

    fn select(&mut self, name: &str) {
        let name = name.trim_matches('\'');
        match self.traces.iter().any(|(known, _)| known == name) {
            true => self.selected = Some(name.to_owned()),
            false => self.push(104, "Measurement does not exist"),
        }
    }

    fn set_source(&mut self, source: &str) {
        source.clone_into(&mut self.source);
        self.run = Run::Idle;
    }

    /// Trigger command of a source.
    fn trigger(&mut self, source: &str) {
        let is_ready = self.run == Run::Armed
            || (self.is_continuous && source == "BUS" && self.run != Run::Hold);
        match is_ready && self.source == source {
            true => self.begin(Duration::ZERO),
            false => self.push(-211, "Trigger ignored"),
        }
    }

    fn begin(&mut self, wait: Duration) {
        let begin = Instant::now() + wait;
        self.run = Run::Sweeping(begin, begin + self.options.sweep);
        self.stop = (self.options.scene.stop)();
        let due = |(number, _): &(usize, Fault)| *number == self.sweeps;
        self.active = match self.options.faults.iter().position(due) {
            Some(i) => Some(self.options.faults.remove(i).1),
            None => None,
        };
        self.sweeps += 1;
        match &self.active {
            Some(Fault::Hold) => self.run = Run::Hold,
            Some(Fault::Errors(errors)) => {
                for (code, text) in errors.clone() {
                    self.push(code, &text);
                }
            }
            _ => {}
        }
    }

    fn complete(&mut self) -> Reply {
        let is_ena = matches!(self.options.family, Family::Ena | Family::Cmt);
        match (self.run, &self.active) {
            (Run::Hold, _) | (_, Some(Fault::NeverComplete)) => return Reply::Silence,
            (Run::Sweeping(..), Some(Fault::Refuse(pause))) => return Reply::Refuse(*pause),
            (Run::Sweeping(..), Some(Fault::Completion(answer))) => return text(answer),
            // An ENA waits for sweeps by its trigger command only.
            (Run::Sweeping(..), _) if is_ena && self.source == "EXT" => {}
            (Run::Sweeping(_, end), _) => {
                sleep(end.saturating_duration_since(Instant::now()));
            }
            _ => {}
        }
        text("+1")
    }

    fn next_error(&mut self) -> Reply {
        if let Some(Fault::Queue(answer)) = &self.active {
            return text(answer);
        }
        match self.errors.pop_front() {
            Some((code, message)) => text(format!("{code},\"{message}\"")),
            None => text("+0,\"No error\""),
        }
    }

    fn frequency_hz(&self, k: usize) -> f64 {
        let step_hz = (self.stop_hz - self.start_hz) / (self.points - 1) as f64;
        let off_hz = match self.active {
            Some(Fault::OtherFrequencies) => step_hz,
            _ => self.options.off_hz,
        };
        self.start_hz + off_hz + k as f64 * step_hz
    }

    fn least_first(&self) -> bool {
        self.is_swapped != (self.active == Some(Fault::OtherByteOrder))
    }

    fn frequencies(&self) -> Reply {
        assert!(self.is_binary);
        let hz: Vec<f64> = (0..self.points).map(|k| self.frequency_hz(k)).collect();
        let data = bytes(&hz, self.least_first());
        Reply::Send(block(&data, data.len() as i64))
    }

    /// Values of the selected trace.
    fn values(&mut self) -> Reply {
        let of = |(name, parameter): &(String, String)| {
            (Some(name) == self.selected.as_ref()).then(|| parameter.clone())
        };
        let Some(parameter) = self.traces.iter().find_map(of) else {
            self.push(103, "No measurement selected");
            return Reply::Silence;
        };
        let ports: Vec<usize> = (parameter.bytes().skip(1))
            .map(|digit| usize::from(digit - b'1'))
            .collect();
        let antennas_m = (self.options.scene.antennas_m)(self.stop);
        let pair_m = [antennas_m[ports[1]], antennas_m[ports[0]]];
        let points = match self.active {
            Some(Fault::Points(more)) => (self.points as i64 + more) as usize,
            _ => self.points,
        };
        let mut numbers: Vec<f64> = (0..points)
            .flat_map(|k| echo(&self.options.scene.targets, pair_m, self.frequency_hz(k)))
            .collect();
        if let Some(Fault::Value(value)) = self.active {
            let middle = numbers.len() / 2;
            numbers[middle] = value;
        }
        let data = bytes(&numbers, self.least_first());
        let length = data.len() as i64;
        let whole = block(&data, length);
        match self.active.clone() {
            Some(Fault::CloseBefore) => Reply::SendAndClose(Vec::new()),
            Some(Fault::CloseWithin) => Reply::SendAndClose(whole[..whole.len() / 2].to_vec()),
            Some(Fault::CloseAfter) => Reply::SendAndClose(whole),
            Some(Fault::Late(delay)) => {
                sleep(delay);
                Reply::Send(whole)
            }
            Some(Fault::Truncated) => Reply::Send(whole[..whole.len() / 2].to_vec()),
            Some(Fault::WrongLength(off)) => Reply::Send(block(&data, length + off)),
            Some(Fault::Instead(bytes)) => Reply::Send(bytes),
            _ => Reply::Send(whole),
        }
    }
}
