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

mod scenes;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use num_complex::Complex32;
use serde::Serialize;
use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
use subaperture_core::link::{Arithmetic, AssembledMap, Encoding, Event, Increment, Level, Motion};
use subaperture_core::motion::{Antennas, Odometer, Progress};
use subaperture_core::sweep::Profiler;
use subaperture_io::selftest::{Check, Report};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{InMemory, PhaseHistory, ReadError};

use crate::accumulated::by_host_core;
use crate::link::{
    AccumulatedImage, ChannelDetection, Counts, DetectionSink, Detector, HostCore, ImageRequest,
    ImageSum, LinkError, MapSink, ModuleAddress, MotionRun, Outcome, Profile, ProfileRun, Session,
    SessionObserver, SinkError, TransferEnd, Verified,
};

/// Schema of the report.
const SCHEMA: &str = "subaperture-module-selftest";
/// Requests of the status for the round-trip time.
const ROUND_TRIPS: usize = 9;
/// Capacity of the firmware's list of detections.
const DETECTIONS: usize = 32;

/// Detector with a threshold low enough for detections in every map.
const CFAR: Cfar = Cfar {
    range: TrainingWindow {
        guard: 1,
        training: 3,
    },
    doppler: TrainingWindow {
        guard: 1,
        training: 2,
    },
    false_alarm_probability: 0.1,
};

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

/// Product of the module compared with that of this computer.
struct Compared {
    name: &'static str,
    /// Number of products, and of those that differ or are missing.
    expected: usize,
    wrong: usize,
    /// Error that ended the transfer, or loss on the line that was not repaired.
    error: Option<String>,
}

impl Compared {
    fn check(&self) -> Check {
        // An error fails the check even if all products arrived.
        let wrong = self.wrong.max(usize::from(self.error.is_some()));
        let check = Check::faults(self.name, wrong as u64, "bit-identical to this computer")
            .noted(&format!("{} compared", self.expected));
        match &self.error {
            Some(error) => check.noted(error),
            None => check,
        }
        .advised("check power supply, clock and memory of the board, and that its firmware has the version of this program")
    }
}

/// Test the module of a session, and return the report. `date` is the UTC time in ISO 8601.
///
/// # Errors
/// [`LinkError::Cancelled`], and [`LinkError::Read`] if a built-in recording cannot be made. Every other error is a
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

/// Pass on a cancellation, and keep other errors for the report.
fn kept(ending: Result<(), LinkError>) -> Result<Option<String>, LinkError> {
    match ending {
        Ok(()) => Ok(None),
        Err(LinkError::Cancelled) => Err(LinkError::Cancelled),
        Err(error) => Ok(Some(error.to_string())),
    }
}

fn ending(outcome: &mut Outcome) -> Result<(), LinkError> {
    match std::mem::replace(&mut outcome.ending, TransferEnd::Complete) {
        TransferEnd::Failed(error) => Err(error),
        TransferEnd::Complete | TransferEnd::Incomplete => Ok(()),
    }
}

type Tried = Result<(Compared, Outcome), LinkError>;

/// Core on this computer, on the recording of the maps.
fn core(recording: &InMemory, encoding: Encoding) -> Result<HostCore<'_>, LinkError> {
    let core = HostCore::new(scenes::job(recording, encoding)?);
    Ok(core.expect("settings of the built-in recording"))
}

/// Sink of maps that were compared before.
struct Discard;

impl MapSink for Discard {
    fn accept(&mut self, _: &AssembledMap<'_>) -> Result<(), SinkError> {
        Ok(())
    }
}

fn maps(
    session: &mut Session<'_>,
    recording: &InMemory,
    encoding: Encoding,
    watch: &mut dyn SessionObserver,
) -> Tried {
    let mut verified = Verified::new(Discard, core(recording, encoding)?);
    let mut job = scenes::job(recording, encoding)?;
    let mut outcome = session.transfer(&mut job, &mut verified, watch);
    let error = kept(ending(&mut outcome))?;
    let expected = job.num_sub_cpis() as usize * job.patches.len();
    let (same, _) = verified.counts();
    let compared = Compared {
        name: "maps",
        expected,
        wrong: expected - same as usize,
        error,
    };
    Ok((compared, outcome))
}

fn image(
    session: &mut Session<'_>,
    recording: &InMemory,
    encoding: Encoding,
    watch: &mut dyn SessionObserver,
) -> Tried {
    let request = ImageRequest {
        chips: &scenes::CHIPS,
        sum: ImageSum::Coherent,
        previews: 0,
    };
    let mut job = scenes::job(recording, encoding)?;
    let (mut outcome, received) = session.accumulate(&mut job, request, watch);
    let error = kept(ending(&mut outcome))?;
    let all: Vec<u32> = (0..job.num_sub_cpis()).collect();
    let own = by_host_core(&mut core(recording, encoding)?, request, &received.sub_cpis)?;
    let chips = own.chips.iter().flatten();
    let expected: usize = chips.map(Vec::len).sum();
    let pairs = own.chips.iter().flatten().zip(&received.chips);
    let same = pairs.map(|(own, received)| {
        let received = received.iter().flatten();
        own.iter().zip(received).filter(|(a, b)| same(a, b)).count()
    });
    let mut sub_cpis = received.sub_cpis.clone();
    sub_cpis.sort_unstable();
    let wrong = expected - same.sum::<usize>() + usize::from(sub_cpis != all);
    let compared = Compared {
        name: "image",
        expected,
        wrong,
        error,
    };
    Ok((compared, outcome))
}

fn same(a: &Complex32, b: &Complex32) -> bool {
    (a.re.to_bits(), a.im.to_bits()) == (b.re.to_bits(), b.im.to_bits())
}

/// Lists of detections by sub-CPI and patch.
#[derive(Default)]
struct Lists(BTreeMap<(u32, u16), Vec<ChannelDetection>>);

impl DetectionSink for Lists {
    fn accept(
        &mut self,
        sub_cpi: u32,
        patch: u16,
        detections: &[ChannelDetection],
    ) -> Result<(), SinkError> {
        self.0.insert((sub_cpi, patch), detections.to_vec());
        Ok(())
    }
}

fn found(
    session: &mut Session<'_>,
    recording: &InMemory,
    encoding: Encoding,
    watch: &mut dyn SessionObserver,
) -> Tried {
    let detector = Detector {
        cfar: CFAR,
        dpca: None,
    };
    let mut job = scenes::job(recording, encoding)?;
    let mut lists = Lists::default();
    let mut outcome = session.detect(&mut job, &detector, &mut lists, watch);
    let error = kept(ending(&mut outcome))?;
    let mut core = core(recording, encoding)?;
    let (mut expected, mut wrong) = (0, 0);
    for sub_cpi in 0..job.num_sub_cpis() {
        for map in core.owned_maps(sub_cpi)? {
            let map = map.view();
            let mut columns = vec![Column::EMPTY; map.header.patch.num_range_bins()];
            let mut own = heapless::Vec::<Detection, DETECTIONS>::new();
            let searched = CFAR.detect_in_map(&map, &mut columns, &mut own);
            searched.expect("settings of the built-in recording");
            let own = own.iter().map(|detection| {
                let (doppler_bin, range_bin) = detection.cell();
                ChannelDetection {
                    detection: *detection,
                    values: vec![map.at(doppler_bin, range_bin)],
                }
            });
            let key = (sub_cpi, map.header.patch_index);
            let received = lists.0.get(&key).map_or(&[][..], Vec::as_slice);
            expected += own.len();
            if !own.eq(received.iter().cloned()) {
                wrong += 1;
            }
        }
    }
    let compared = Compared {
        name: "detections",
        expected,
        wrong,
        error,
    };
    Ok((compared, outcome))
}

fn increments(
    session: &mut Session<'_>,
    watch: &mut dyn SessionObserver,
) -> Result<Compared, LinkError> {
    let recordings = scenes::channels()?;
    let channels: Vec<&dyn PhaseHistory> = recordings.iter().map(|own| own as _).collect();
    let run = MotionRun {
        setup: scenes::MOTION,
        transmitters_m: &scenes::TRANSMITTER_M,
        receivers_m: &scenes::RECEIVERS_M,
        channels: &channels,
        from_front_end: false,
    };
    let received = session.increments(&run, watch);
    let error = kept(received.ending)?;
    let own = own_increments(&channels)?;
    let same = own.iter().zip(&received.increments).filter(|(a, b)| a == b);
    Ok(Compared {
        name: "increments",
        expected: own.len(),
        wrong: own.len() - same.count(),
        error,
    })
}

/// Increments by the core on this computer.
fn own_increments(channels: &[&dyn PhaseHistory]) -> Result<Vec<Increment>, ReadError> {
    const TEXT: &str = "settings of the built-in recording";
    let setup = scenes::MOTION;
    let centre_hz = setup.start_hz + 0.5 * f64::from(setup.num_frequencies - 1) * setup.step_hz;
    let antennas = Antennas {
        transmitters_m: &scenes::TRANSMITTER_M,
        receivers_m: &scenes::RECEIVERS_M,
        wavelength_m: SPEED_OF_LIGHT_M_S / centre_hz,
    };
    let mut odometer = Box::new(Odometer::<8, 4, 64, 256>::new());
    odometer.configure(&setup, &antennas).expect(TEXT);
    odometer.start(0);
    let mut increments = Vec::new();
    for pulse in 0..channels[0].collection().pulses.len() {
        for (channel, history) in channels.iter().enumerate() {
            let mut samples = vec![Complex32::ZERO; setup.num_frequencies.into()];
            history.read(pulse..pulse + 1, &mut samples)?;
            let pushed = odometer.push(pulse as u32, channel, 0.0, samples.into_iter());
            pushed.expect(TEXT);
        }
        increments.extend(std::iter::from_fn(|| {
            loop {
                match odometer.work() {
                    Progress::Busy => {}
                    Progress::Idle => return None,
                    Progress::Step(step) => {
                        return Some(Increment {
                            pulse: step.pulse,
                            since: step.since,
                            targets: step.targets,
                            echoes: step.echoes,
                            motion: step.moved.map(|moved| Motion {
                                moved_m: moved.increment.moved_m,
                                turn_rad: moved.increment.turn_rad,
                                residual_m: moved.residual_m as f32,
                                targets: moved.targets as u16,
                                doubtful: moved.doubtful as u16,
                            }),
                        });
                    }
                }
            }
        }));
    }
    Ok(increments)
}

fn profiles(
    session: &mut Session<'_>,
    watch: &mut dyn SessionObserver,
) -> Result<Compared, LinkError> {
    let weights = scenes::carrier_weights();
    let mut run = ProfileRun {
        setup: scenes::SWEEP,
        weights: &weights,
        source: &mut scenes::Bursts,
    };
    let mut received: Vec<Profile> = Vec::new();
    let outcome = session.profiles(&mut run, &mut |profile| received.push(profile), watch);
    let missing = received.iter().map(|profile| profile.missing).sum::<u32>();
    let lost = (missing > 0).then(|| format!("{missing} samples were lost on the line"));
    let error = kept(outcome.ending)?.or(lost);
    const TEXT: &str = "settings of the built-in recording";
    let mut profiler = Box::new(Profiler::<8, 64, 128>::new());
    profiler.configure(&scenes::SWEEP).expect(TEXT);
    let set = profiler.set_weights(0, weights.iter().copied());
    set.expect(TEXT);
    profiler.start(0);
    for carrier in 0..scenes::SWEEP.carriers {
        let samples = scenes::Bursts::at(carrier).samples;
        let pushed = profiler.push(0, carrier, 0, samples.into_iter());
        pushed.expect(TEXT);
    }
    let own = profiler.finish(0).expect(TEXT).values;
    let expected = own.len();
    let received = received.first().map_or(&[][..], |profile| &profile.values);
    let same = own.iter().zip(received).filter(|(a, b)| same(a, b)).count();
    Ok(Compared {
        name: "range profiles",
        expected,
        wrong: expected - same,
        error,
    })
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
