//! Self-test of a radio with the settings of a capture plan.
//!
//! | check | measurement | limit |
//! |---|---|---|
//! | driver errors | errors that ended the test | 0 |
//! | transmitter, receivers: lock | sensor readings without lock, one after each retune | 0 |
//! | reference clock: lock | its sensor, with an external clock | 1 |
//! | overruns, underruns, late commands, lost packets, lost samples | counts over all bursts; the longest part streams back-to-back bursts of 0.1 s | 0 |
//! | clipping | samples at full scale, transmitter on | 0 |
//! | retune time | from the first tune command until every later burst of the dwell is steady within the plan's `steady` | start of the last burst that a capture takes at a carrier |
//! | loop-back delay | slope over the carriers of the phase of receiver 1 relative to receiver 0 | the expected delay, a quarter of a range cell to both sides |
//! | loop-back delay: deviation | standard deviation of that slope | a quarter of a range cell |
//! | phase repeatability | RMS deviation of that phase over retunes to the same carrier | the plan's `steady` |
//! | noise floor | power without the mean, zeros transmitted | noise that alone makes the phase deviate by `steady` |
//!
//! The absolute phase of the loop is random after each retune, since transmitter and receivers have a synthesiser each.
//! The delay over carriers and the repeatability are therefore those of the quotient of both receivers
//! ([`crate::tone`]). With a splitter from the transmitter to both receivers, the delay is the difference of the two
//! cables. With antennas, echoes and leakage add to the deviation.
//!
//! With `B` the swept bandwidth, a quarter of a range cell is a delay of `1 / (4 B)`. With `n` the noise power per
//! sample, `|x|^2` the power of the tone and `N` samples per block or burst: a block of the reference deviates by about
//! `2 sqrt(n / (N |x|^2))`, the phase of receiver 1 in a burst by `sqrt(n / (2 N |x|^2))`.
//!
//! Cost: some 100 retunes, 8 bursts each at most, and the time of streaming.

mod delay;
mod measure;

use serde::Serialize;
use subaperture_io::selftest::{Check, Report};

use crate::capture::prepare;
use crate::error::RadioError;
use crate::plan::Plan;
use crate::tone::Tone;
use crate::transceiver::{Configuration, Ranges, Transceiver};
use crate::{Reference, SIMULATED_SERIAL};

use measure::{Bench, Measured};

pub use measure::Retune;

/// Schema of the report.
const SCHEMA: &str = "subaperture-radio-selftest";

/// Options of a self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Duration of streaming, seconds.
    pub stream_s: f64,
    /// Expected delay of receiver 1 minus that of receiver 0, seconds; `None` if unknown.
    pub delay_s: Option<f64>,
}

/// Tested radio and the settings of the test.
#[derive(Clone, Debug, Serialize)]
pub struct Tested {
    /// Whether the radio is simulated: its serial number begins with `SIM`.
    pub simulated: bool,
    /// Product name of the device.
    pub product: String,
    /// Serial number of the device.
    pub serial: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Temperature after the test, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Plan of the test.
    pub plan: PlanSettings,
    /// Settings in effect; `None` if the radio refused those of the plan.
    pub settings: Option<Configuration>,
    /// Retune times of the tested carriers.
    pub retunes: Vec<Retune>,
}

/// Settings of the plan that the limits depend on.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "as in the plan")]
pub struct PlanSettings {
    pub name: String,
    pub start_hz: f64,
    pub stop_hz: f64,
    pub steps: usize,
    pub dwell_s: f64,
    pub tone_hz: f64,
    pub amplitude: f64,
    pub lead_s: f64,
    pub steady: f64,
    pub bursts: u32,
    pub reference: Reference,
}

/// Test a radio with the settings of `plan`. Errors of the radio end the measurements and are a failed check of the
/// report. `date` is the UTC time in ISO 8601.
pub fn run(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    options: &Options,
    date: String,
) -> Report<Tested> {
    let about = radio.about().clone();
    let mut measured = Measured::default();
    if let Err(error) = test(radio, plan, options, &mut measured) {
        measured.error = Some(error.to_string());
    }
    let checks = checks(plan, &about.ranges, options, &measured);
    let tested = Tested {
        simulated: about.serial.starts_with(SIMULATED_SERIAL),
        product: about.product,
        serial: about.serial,
        driver: about.driver,
        temperature_c: measured.temperature_c,
        plan: PlanSettings {
            name: plan.name.clone(),
            start_hz: plan.start_hz,
            stop_hz: plan.stop_hz,
            steps: plan.steps,
            dwell_s: plan.dwell_s,
            tone_hz: plan.tone_hz,
            amplitude: plan.amplitude,
            lead_s: plan.lead_s,
            steady: plan.steady,
            bursts: plan.bursts,
            reference: plan.reference,
        },
        settings: measured.settings,
        retunes: measured.retunes,
    };
    Report::new(SCHEMA, date, tested, checks)
}

fn test(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    options: &Options,
    measured: &mut Measured,
) -> Result<(), RadioError> {
    let set = prepare(radio, plan)?.set;
    let rate_hz = set.sample_rate_hz;
    measured.settings = Some(set);
    Bench::new(radio, plan, rate_hz, measured).all(options.stream_s)
}

/// Reason for a missing value after an error.
const ENDED: &str = "the test ended before, see driver errors";

impl Measured {
    /// Reason for a missing value.
    fn missing(&self) -> &'static str {
        match self.error {
            Some(_) => ENDED,
            None => "too few bursts without lost samples",
        }
    }
}

fn checks(plan: &Plan, ranges: &Ranges, options: &Options, measured: &Measured) -> Vec<Check> {
    let mut checks = vec![
        Check::faults("driver errors", measured.error.iter().count() as u64, "")
            .noted(measured.error.as_deref().unwrap_or_default()),
    ];
    checks.extend(locks(measured));
    checks.extend(transport(measured));
    checks.push(retune_time(plan, ranges, measured));
    checks.extend(delays(plan, options, measured));
    checks.push(repeatability(plan, measured));
    checks.extend(noise(plan, measured));
    checks
}

fn locks(measured: &Measured) -> Vec<Check> {
    let readings = measured.readings;
    let lock = |name: &str, unlocked: u64| match readings {
        0 => Check::not_measured(name, "", ENDED),
        _ => Check::faults(name, unlocked, "every retune must lock")
            .noted(&format!("readings without lock, of {readings}"))
            .advised("let the device warm up; check carrier, reference clock and power supply"),
    };
    let reference = "reference clock: lock";
    let [transmit, receive] = measured.unlocked;
    vec![
        lock("transmitter: lock", transmit),
        lock("receivers: lock", receive),
        match measured.reference_locked {
            Some(locked) => {
                let value = if locked { 1.0 } else { 0.0 };
                Check::measured(reference, (value, ""), (Some(1.0), None), "1 is locked")
                    .advised("connect 10 MHz at the level that the device needs")
            }
            None => Check::not_measured(reference, "", "the device runs on its internal clock"),
        },
    ]
}

/// Counts of transport faults and of clipped samples over all bursts.
fn transport(measured: &Measured) -> Vec<Check> {
    let over = format!(
        "over {} bursts, {:.1} s of samples",
        measured.bursts, measured.sampled_s
    );
    let count = |name: &str, count: u64, advice: &str| match measured.bursts {
        0 => Check::not_measured(name, "", ENDED),
        _ => Check::faults(name, count, "profiles leave out carriers with faults")
            .noted(&over)
            .advised(advice),
    };
    let [overruns, underruns, late, packets, _] = measured.events;
    let slow = "use a USB 3 port and cable without a hub, lower the sample rate, end other programs, or raise the process's priority";
    vec![
        count("overruns", overruns, slow),
        count("underruns", underruns, slow),
        count("late commands", late, "increase plan.lead"),
        count("lost packets", packets, slow),
        count("lost samples", measured.lost, slow),
        count(
            "clipping",
            measured.clipped.iter().sum(),
            "lower the transmit or receive gain, or add attenuation",
        )
        .noted(&format!(
            "receiver 0: {}, receiver 1: {}",
            measured.clipped[0], measured.clipped[1]
        )),
    ]
}

fn retune_time(plan: &Plan, ranges: &Ranges, measured: &Measured) -> Check {
    let name = "retune time";
    let again = f64::from(plan.bursts - 1) * (plan.lead_s + plan.dwell_s);
    let most_s = 2.0 * ranges.retune_s + plan.lead_s + again;
    let limit = format!(
        "start of burst {} at a carrier, the last that a capture takes",
        plan.bursts
    );
    let settled = measured.retunes.iter().map(|retune| retune.settled_s);
    // The longest time; infinite if a carrier did not settle.
    let longest_s = settled
        .map(|settled| settled.unwrap_or(f64::INFINITY))
        .fold(0.0, f64::max);
    if measured.retunes.is_empty() {
        return Check::not_measured(name, "ms", ENDED);
    }
    let at = format!("longest of {} carriers", measured.retunes.len());
    Check::measured(name, (1e3 * longest_s, "ms"), (None, Some(1e3 * most_s)), limit)
        .noted(&at)
        .advised("check the loop-back cable at receiver 0 and its level, lengthen plan.dwell, or raise plan.bursts or plan.steady")
}

fn delays(plan: &Plan, options: &Options, measured: &Measured) -> [Check; 2] {
    let names = ["loop-back delay", "loop-back delay: deviation"];
    let Some(found) = &measured.delay else {
        return names.map(|name| Check::not_measured(name, "ns", measured.missing()));
    };
    let cell_s = 1.0 / (plan.stop_hz - plan.start_hz);
    let off_s = 0.25 * cell_s;
    let around = |delay_s: f64| (Some(1e9 * (delay_s - off_s)), Some(1e9 * (delay_s + off_s)));
    let (limits, reason) = match options.delay_s {
        Some(delay_s) => (
            around(delay_s),
            "expected delay, a quarter of a range cell to both sides",
        ),
        None => ((None, None), ""),
    };
    let note = format!(
        "receiver 1 minus receiver 0, over {} carriers, unambiguous within {:.1} ns to both sides",
        found.carriers,
        1e9 * found.unambiguous_s
    );
    [
        Check::measured(names[0], (1e9 * found.delay_s, "ns"), limits, reason)
            .noted(&note)
            .advised("measure both cables and compare them with the expected delay"),
        Check::measured(
            names[1],
            (1e9 * found.deviation_s, "ns"),
            (None, Some(1e9 * off_s)),
            "a quarter of a range cell",
        )
        .noted(&format!("phases deviate by {:.4} rad from a line", found.residual_rad))
        .advised("connect the transmitter to both receivers by a splitter: echoes of antennas deviate from one delay"),
    ]
}

fn repeatability(plan: &Plan, measured: &Measured) -> Check {
    let name = "phase repeatability";
    let spread = |of: fn(&crate::tone::Mixed) -> num_complex::Complex64| {
        delay::repeatability_rad(&measured.repeats, of)
    };
    let Some(with) = spread(|mixed| mixed.value) else {
        return Check::not_measured(name, "rad", measured.missing());
    };
    let without = spread(|mixed| mixed.unreferred).unwrap_or(f64::NAN);
    Check::measured(
        name,
        (with, "rad"),
        (None, Some(plan.steady)),
        "plan.steady",
    )
    .noted(&format!(
        "{without:.2} rad without the reference channel, whose phase is random after a retune"
    ))
    .advised(
        "tighten the connectors, raise the level of the weaker receiver, and keep the cables still",
    )
}

fn noise(plan: &Plan, measured: &Measured) -> [Check; 2] {
    let name = |channel: usize| format!("noise floor: receiver {channel}");
    let found = (measured.noise, measured.weakest_tones(), &measured.settings);
    let (Some(noise), Some(tones), Some(set)) = found else {
        return [0, 1]
            .map(|channel| Check::not_measured(name(channel), "dBFS", measured.missing()));
    };
    let samples = plan.samples() as f64;
    let block = Tone::new(plan.period(), set.sample_rate_hz).block(plan.samples()) as f64;
    let per_tone = [
        0.25 * plan.steady * plan.steady * block,
        2.0 * plan.steady * plan.steady * samples,
    ];
    let reasons = [
        "noise at which the reference deviates by plan.steady",
        "noise at which the phase of a burst deviates by plan.steady",
    ];
    [0, 1].map(|channel| {
        let most = tones[channel] * per_tone[channel];
        Check::measured(
            name(channel),
            (decibels(noise[channel]), "dBFS"),
            (None, Some(decibels(most))),
            reasons[channel],
        )
        .noted(&format!("tone at {:.1} dBFS", decibels(tones[channel])))
        .advised("check that the tone arrives (cable, attenuation, gains); lower the receive gain if the tone is strong, and look for interference")
    })
}

fn decibels(power: f64) -> f64 {
    10.0 * libm::log10(power)
}
