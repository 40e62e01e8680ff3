//! Self-test of a module over its link.
//!
//! Built-in recordings pass through the module: maps, image, detections, increments and range profiles. Each product is
//! compared bit by bit with that of the same core on this computer. Round-trip time, rates and faults of the line are
//! measured with them.
//!
//! | check | measurement | limit |
//! |---|---|---|
//! | maps, image, detections, increments, range profiles | products that differ or are missing | 0 |
//! | round trip | median time from a request of the status to its arrival | time after which a request is repeated, not of an emulated module |
//! | rate to, rate from the module | bytes over the time of the test, which includes the computation | |
//! | frames to, frames from the module | damaged, lost and repeated frames | 0 |
//! | pulses | pulses lost, refused or dropped by the module | 0 |
//! | stack | largest part of the painted stack that was overwritten | three quarters |
//! | cycles per instruction | cycles of the processing of the maps over its instructions, counted once under emulation | 2 |
//! | restarts | restarts of the module and reconnections of the line | 0 |
//!
//! Stack and cycles come from the module's events ([`Event::RunCost`]): the session needs [`Settings::events`] from
//! [`Level::Info`] on. A lost event leaves them unmeasured. Times in `firmware/REPORT.md` are for one cycle per instruction.
//!
//! [`Settings::events`]: crate::link::Settings::events
//!
//! Cost: some 40 kB to the module and 30 kB from it.

mod compare;
mod scenes;

use std::time::{Duration, Instant};

use serde::Serialize;
use subaperture_core::link::{Arithmetic, Encoding, Event, Level};
use subaperture_io::selftest::{Check, Report};

use self::compare::{found, image, increments, maps, profiles};
use crate::link::{AccumulatedImage, Counts, LinkError, ModuleAddress, Session, SessionObserver};

/// Schema of the report.
const SCHEMA: &str = "subaperture-module-selftest";
/// Requests of the status for the round-trip time.
const ROUND_TRIPS: usize = 9;
/// Tested module and its measured costs.
#[derive(Clone, Debug, Serialize)]
pub struct Tested {
    /// Whether the module is emulated; `None` if unknown, behind a TCP port without events of the module.
    pub emulated: Option<bool>,
    /// Address of the tested module.
    pub address: String,
    /// Name and version of its program.
    pub firmware: String,
    /// Arithmetic of its maps: `float` or `fixed`.
    pub arithmetic: &'static str,
    /// Largest pulses, frequencies, range bins, Doppler bins and patches of its buffers.
    pub capacity: [u16; 5],
    /// Instructions of the processing of the maps.
    pub instructions: u64,
    /// Costs of the runs that the module reported.
    pub runs: Vec<RunCost>,
    /// Statistics of the link.
    pub link: serde_json::Map<String, serde_json::Value>,
}

/// Cost of a run, as the module reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct RunCost {
    /// Largest part of the stack used so far, bytes.
    pub stack_bytes: u32,
    /// Size of the stack, bytes.
    pub stack_size_bytes: u32,
    /// Time of processing, thousands of ticks.
    pub kiloticks: u32,
    /// Rate of the ticks, hertz.
    pub ticks_hz: u32,
}

/// Timer of the emulated board, hertz. It counts no cycles.
const EMULATED_HZ: u32 = 25_000_000;
/// Instructions of the processing of the maps in float and in fixed point (`tests/firmware/module_selftest.rs`).
const INSTRUCTIONS: [u64; 2] = [453_000, 1_031_000];
/// Largest number of cycles per instruction.
const CYCLES: f64 = 2.0;

/// Observer that keeps the costs of runs.
struct Watch<'w> {
    watch: &'w mut dyn SessionObserver,
    runs: Vec<RunCost>,
}

impl SessionObserver for Watch<'_> {
    fn update(&mut self, counts: &Counts) {
        self.watch.update(counts);
    }

    fn event(&mut self, event: &Event) {
        match *event {
            Event::RunCost {
                stack_bytes,
                stack_size_bytes,
                kiloticks,
                ticks_hz,
            } => self.runs.push(RunCost {
                stack_bytes,
                stack_size_bytes,
                kiloticks,
                ticks_hz,
            }),
            // Starts and ends of runs are of no interest here.
            _ if event.level() == Level::Info => {}
            _ => self.watch.event(event),
        }
    }

    fn preview(&mut self, image: &AccumulatedImage) {
        self.watch.preview(image);
    }

    fn log(&mut self, text: &str) {
        self.watch.log(text);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
    }
}

/// Test the module of a session, and return the report. `date` is the UTC time in ISO 8601.
///
/// # Errors
/// [`LinkError::Cancelled`], and [`LinkError::Recording`] if a built-in recording cannot be made. Every other error is a
/// failed check.
pub fn run(
    session: &mut Session<'_>,
    address: &ModuleAddress,
    date: String,
    watch: &mut dyn SessionObserver,
) -> Result<Report<Tested>, LinkError> {
    let watch = &mut Watch {
        watch,
        runs: Vec::new(),
    };
    let identity = session.identity().clone();
    let encoding = match identity.arithmetic {
        Arithmetic::Float => Encoding::Complex32,
        Arithmetic::Fixed => Encoding::Sc16,
    };
    let recording = scenes::recording()?;
    let before = session.counts();
    let begun = Instant::now();
    let mut checks = Vec::new();
    let mut pulses = 0;
    for test in [maps, image, found] {
        let (compared, outcome) = test(session, &recording, encoding, watch)?;
        let module = &outcome.counts.module_pulses;
        pulses = module.lost + module.refused + module.dropped;
        checks.push(compared.check());
    }
    checks.push(increments(session, watch)?.check());
    checks.push(profiles(session, watch)?.check());
    let seconds = begun.elapsed().as_secs_f64();
    let timer = watch.runs.first().map(|run| run.ticks_hz == EMULATED_HZ);
    let emulated = match address {
        ModuleAddress::Emulate(_) => Some(true),
        ModuleAddress::Serial { .. } => Some(false),
        ModuleAddress::Tcp { .. } => timer,
    };
    checks.push(round_trip(session, emulated, watch)?);
    let counts = session.counts();
    let rate = |name: &str, bytes: u64| {
        let kilobytes_s = bytes as f64 / 1e3 / seconds;
        Check::measured(name, (kilobytes_s, "kB/s"), (None, None), "")
            .noted("includes the computation of the module")
    };
    let (to, from) = (counts.frames_to_module, counts.frames_from_module);
    let line = "check cable and bit rate; use a shorter cable or a lower rate";
    let frames = |name: &str, counts: [u64; 3]| {
        let [damaged, lost, repeated] = counts;
        let all = damaged + lost + repeated;
        Check::faults(name, all, "damaged, lost or repeated")
            .noted(&format!(
                "{damaged} damaged, {lost} lost, {repeated} repeated"
            ))
            .advised(line)
    };
    checks.extend([
        rate(
            "rate to the module",
            counts.bytes_to_module - before.bytes_to_module,
        ),
        rate(
            "rate from the module",
            counts.bytes_from_module - before.bytes_from_module,
        ),
        frames("frames to the module", [to.damaged, to.lost, to.repeated]),
        frames(
            "frames from the module",
            [from.damaged, from.lost, from.repeated],
        ),
        Check::faults("pulses", pulses, "lost, refused or dropped").advised(line),
        Check::faults(
            "restarts",
            counts.restarts + counts.reconnects,
            "a module runs without reset",
        )
        .advised("check the power supply; the module's events state the reason of a reset"),
    ]);
    let instructions = match identity.arithmetic {
        Arithmetic::Float => INSTRUCTIONS[0],
        Arithmetic::Fixed => INSTRUCTIONS[1],
    };
    // The first cost is that of the maps if no event was lost and no run repeated: one for each product.
    let whole = watch.runs.len() == 5 && counts.runs - before.runs == 5;
    checks.extend(costs(&watch.runs, whole, instructions));
    let capacity = identity.capacity;
    let tested = Tested {
        emulated,
        address: address.to_string(),
        firmware: identity.version,
        arithmetic: match identity.arithmetic {
            Arithmetic::Float => "float",
            Arithmetic::Fixed => "fixed",
        },
        capacity: [
            capacity.pulses,
            capacity.frequencies,
            capacity.range_bins,
            capacity.doppler_bins,
            capacity.patches,
        ],
        instructions,
        runs: watch.runs.clone(),
        link: counts.to_json(),
    };
    Ok(Report::new(SCHEMA, date, tested, checks))
}

/// Checks of stack and cycles.
fn costs(runs: &[RunCost], whole: bool, instructions: u64) -> [Check; 2] {
    let (stack, cycles) = ("stack", "cycles per instruction");
    let lost = "the module reported no cost of the run";
    let Some(last) = runs.last() else {
        return [
            Check::not_measured(stack, "bytes", lost),
            Check::not_measured(cycles, "", lost),
        ];
    };
    let used = f64::from(last.stack_bytes);
    let most = 0.75 * f64::from(last.stack_size_bytes);
    [
        Check::measured(
            stack,
            (used, "bytes"),
            (None, Some(most)),
            "three quarters of the stack",
        )
        .advised("send the report: the firmware needs less stack elsewhere"),
        match runs[0] {
            run if run.ticks_hz == EMULATED_HZ => {
                Check::not_measured(cycles, "", "an emulator counts no cycles")
            }
            _ if !whole => Check::not_measured(cycles, "", lost),
            run => {
                let ratio = 1e3 * f64::from(run.kiloticks) / instructions as f64;
                Check::measured(
                    cycles,
                    (ratio, ""),
                    (None, Some(CYCLES)),
                    "firmware/REPORT.md assumes 1",
                )
                .advised("check that the caches are on, and that the clock is 400 MHz")
            }
        },
    ]
}

fn round_trip(
    session: &mut Session<'_>,
    emulated: Option<bool>,
    watch: &mut dyn SessionObserver,
) -> Result<Check, LinkError> {
    let name = "round trip";
    let mut times: Vec<Duration> = Vec::new();
    for _ in 0..ROUND_TRIPS {
        match session.round_trip(watch) {
            Ok(time) => times.push(time),
            Err(LinkError::Cancelled) => return Err(LinkError::Cancelled),
            Err(error) => return Ok(Check::not_measured(name, "ms", &error.to_string())),
        }
    }
    times.sort_unstable();
    let milliseconds = |time: Duration| 1e3 * time.as_secs_f64();
    let value = (milliseconds(times[ROUND_TRIPS / 2]), "ms");
    Ok(match emulated {
        // An emulator's time is that of this computer.
        Some(true) => Check::measured(name, value, (None, None), ""),
        _ => {
            let most = milliseconds(session.answer());
            let limit = "time after which a request is repeated";
            Check::measured(name, value, (None, Some(most)), limit)
        }
    })
}
