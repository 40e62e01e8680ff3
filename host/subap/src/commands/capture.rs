//! `subap capture`: record an experiment with a radio or a network analyser.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use anyhow::{Context, anyhow};
use serde_json::{Value, json};
use subaperture::io::atomic::free_bytes;
use subaperture::io::written::WrittenFile;
use subaperture::monitor::Monitor;
use subaperture::planner::stepped::{SteppedSweep, SweepPlan};
use subaperture::radio::capture::{CaptureError, EndReason, LiveStep, Summary, capture};
use subaperture::radio::experiment::{self, AnyExperiment, Device};
use subaperture::radio::plan::{Order, Plan};
use subaperture::radio::sigmf::SigmfError;
use subaperture::radio::{Ranges, Transceiver, vna};
use subaperture::signal::window::Window;

use super::capture_files::{meta, recording_files};
use super::link::line::Line;
use super::link::profiles::Profiling;
use super::plan::speed;
use super::{analyser, chirps};
use crate::args::Capture;
use crate::config::Session;
use crate::failure::{InterruptedWithSteps, Usage};
use crate::progress::Progress;
use crate::{interrupt, messages, text, watch};

/// Maximum number of steps queued for the progress bar; further steps are skipped.
const WAITING: usize = 64;

/// Capture, or print information about experiments.
pub(crate) fn run(session: &Session, typed: &Capture) -> anyhow::Result<()> {
    if typed.keys {
        let all = [
            experiment::reference(),
            experiment::chirp_reference(),
            vna::reference(),
        ];
        text::say(all.join("\n"))?;
    }
    if let Some(name) = &typed.example {
        text::say(experiment::examples::text(name).context("--example: no such name")?)?;
    }
    let Some(path) = &typed.experiment else {
        return Ok(());
    };
    let mut experiment = match AnyExperiment::read_within(path, &typed.set, session.memory_bytes)? {
        AnyExperiment::Radio(experiment) => *experiment,
        AnyExperiment::Chirps(experiment) => return chirps::run(session, typed, *experiment),
        AnyExperiment::Analyser(experiment) => {
            return analyser::run(session, typed, &experiment);
        }
    };
    if let Some(recording) = &typed.replay {
        experiment.device = Device::Replay(recording.clone());
    }
    let Some(out) = typed.out.clone().or(experiment.recording.clone()) else {
        let missing =
            "no output for the recording: give --out NAME, or files.recording of the experiment";
        return Err(Usage(missing.to_owned()).into());
    };
    if typed.rehearsal.dry_run {
        return rehearse(session, &experiment.plan, &out);
    }
    let opening = session.progress("opening the radio");
    let capture = || {
        let captured = experiment.with_radio(session.memory_bytes, |radio| {
            opening.finish();
            if typed.live || typed.watching.is_asked() {
                return watch::captured(
                    session,
                    radio,
                    &experiment,
                    &typed.watching,
                    typed.live,
                    &out,
                );
            }
            Ok(captured(session, radio, &experiment.plan, &out)?)
        });
        captured?
    };
    let (summary, profiles) = match (&typed.module, &typed.profiles) {
        (Some(place), Some(folder)) => {
            let profiling = Profiling {
                session,
                line: Line {
                    place,
                    firmware: typed.firmware.as_deref(),
                    retries: 0,
                    rate_hz: None,
                    events: None,
                },
                window: Window::default(),
                out: folder,
            };
            with_profiles(&profiling, &out, capture)?
        }
        _ => (capture()?, Ok(None)),
    };
    let (profiles, failed) = match profiles {
        Ok(profiles) => (profiles, None),
        Err(error) => (None, Some(error)),
    };
    report(session, &experiment.plan, &summary, &out, profiles)?;
    end(&experiment.plan, summary, &out)?;
    match failed {
        None => Ok(()),
        Some(error) => Err(anyhow!(
            "{error:#}; the recording is complete: subap link --send profiles sends it to the module again"
        )),
    }
}

/// Line about the profiles of a module, and their files.
type Profiles = (String, Vec<WrittenFile>);

/// Capture while a module computes the profiles of the recorded sweeps. An error of the module does not end the capture.
fn with_profiles(
    profiling: &Profiling,
    out: &Path,
    capture: impl FnOnce() -> anyhow::Result<Summary>,
) -> anyhow::Result<(Summary, anyhow::Result<Option<Profiles>>)> {
    profiling.prepare()?;
    let ended = AtomicBool::new(false);
    thread::scope(|scope| {
        let follow = || profiling.follow(&meta(out), &ended);
        let module = thread::Builder::new().spawn_scoped(scope, follow)?;
        let over = watch::Over(&ended);
        let summary = capture();
        drop(over);
        let profiles = module
            .join()
            .map_err(|_| anyhow!("the thread of the module panicked"))?;
        Ok((summary?, profiles.map(Some)))
    })
}

/// Run the capture. Ctrl-C stops it cleanly.
fn captured(
    session: &Session,
    radio: &mut dyn Transceiver,
    plan: &Plan,
    out: &Path,
) -> Result<Summary, CaptureError> {
    let _keeping = interrupt::Keeping::begin();
    let progress = session.progress("capturing");
    let (live, shown) = sync_channel(WAITING);
    thread::scope(|scope| {
        let progress = &progress;
        // Without a thread there is no progress bar; the capture is not affected.
        let _ = thread::Builder::new().spawn_scoped(scope, move || show(plan, progress, shown));
        let queues = watch::queues(session, plan);
        let summary = capture(radio, plan, out, queues, Some(&live), interrupt::flag());
        // The progress thread ends when its queue is dropped.
        drop(live);
        summary
    })
}

/// Show the progress; for an endless capture the number of sweeps.
fn show(plan: &Plan, progress: &Progress, shown: Receiver<LiveStep>) {
    let steps = plan.carriers_taken() as f64;
    let (mut sweep, mut taken) = (None, 0u32);
    for step in shown {
        if sweep != Some(step.sweep) {
            (sweep, taken) = (Some(step.sweep), 0);
            if plan.sweeps == 0 {
                progress.set_label(format!("sweep {}", step.sweep + 1));
            }
        }
        taken += 1;
        if plan.sweeps > 0 {
            let done = step.sweep as f64 * steps + f64::from(taken);
            progress.progress(done / (plan.sweeps as f64 * steps));
        }
    }
}

/// Print the minimum time and disk space of the plan.
fn rehearse(session: &Session, plan: &Plan, out: &Path) -> anyhow::Result<()> {
    let ranges = Ranges::b210();
    plan.check(&ranges)?;
    let sweep_s = plan.sweep_s(&ranges).max(plan.pri_s);
    let rate = plan.bytes_a_second(&ranges);
    let sweeps = (plan.sweeps > 0).then_some(plan.sweeps as f64);
    let free = free_bytes(out);
    let last_hz = plan.carrier_hz(plan.steps - 1);
    let sweep = SteppedSweep {
        centre_hz: (plan.start_hz + last_hz) / 2.0,
        highest_hz: last_hz,
        carriers: plan.carriers_taken(),
        sweep_s: plan.sweep_s(&ranges),
        interval_s: sweep_s,
    };
    let speed = SweepPlan::new(sweep, PI, None);
    if session.json() {
        return text::say_json(
            "forecast",
            json!({
                "work": format!("{} sweeps of {} steps", plan.sweeps, plan.carriers_taken()),
                "resolution_m": plan.resolution_m(),
                "unambiguous_m": plan.unambiguous_m(),
                "sweep_s": sweep_s,
                "time_s": sweeps.map(|sweeps| sweeps * sweep_s),
                "bytes_a_second": rate,
                "speed": speed,
                "disk": [{
                    "path": out.display().to_string(),
                    "bytes": sweeps.map(|sweeps| sweeps * sweep_s * rate),
                    "free_bytes": free,
                }],
            }),
        );
    }
    let sized = |bytes: f64| text::bytes(bytes.round() as u128);
    let mut facts = vec![
        ("carriers", carriers(plan)),
        ("resolution", format!("{:.3} m", plan.resolution_m())),
        ("unambiguous", format!("{:.2} m", plan.unambiguous_m())),
        ("sweep", format!("at least {}", text::seconds(sweep_s))),
        ("disk", format!("at most {} per second", sized(rate))),
    ];
    // The first of them is the sweep above.
    let displaces = plan.order != Order::Shuffled;
    facts.extend(speed::facts(&speed, displaces).into_iter().skip(1));
    if let Some(sweeps) = sweeps {
        let all = format!(
            "{sweeps} sweeps: at least {} of capture time, {} of disk space",
            text::seconds(sweeps * sweep_s),
            sized(sweeps * sweep_s * rate)
        );
        facts.push(("work", all));
    }
    if let Some(free) = free {
        let lasts = free as f64 / rate;
        let free = text::bytes(free.into());
        facts.push(("free", format!("{free}, for {}", text::seconds(lasts))));
    }
    Ok(text::say(text::facts(&facts).join("\n"))?)
}

fn carriers(plan: &Plan) -> String {
    let all = format!(
        "{} from {}, {} apart",
        plan.steps,
        text::hertz(plan.start_hz),
        text::hertz(plan.step_hz())
    );
    match plan.steps - plan.carriers_taken() {
        0 => all,
        avoided => format!("{all}, {avoided} of them avoided"),
    }
}

const FLAGS: [&str; 5] = [
    "late",
    "with lost samples",
    "unsteady",
    "clipped",
    "not locked",
];
const EVENTS: [&str; 5] = [
    "overflows",
    "underflows",
    "late commands",
    "lost packets",
    "unplugged",
];

/// Nonzero counts in words; `None` if all are zero.
fn counted(counts: [u64; 5], names: [&str; 5]) -> Option<String> {
    let some = counts
        .into_iter()
        .zip(names)
        .filter(|(count, _)| *count > 0);
    let words: Vec<String> = some
        .map(|(count, name)| format!("{count} {name}"))
        .collect();
    (!words.is_empty()).then(|| words.join(", "))
}

fn ended(summary: &Summary) -> &'static str {
    match summary.ended {
        EndReason::Done => "done",
        EndReason::Stopped => "stopped",
        EndReason::Radio(_) => "radio",
        EndReason::Disk(_) => "disk",
    }
}

/// Warn of flagged steps.
pub(super) fn warn(summary: &Summary) {
    if let Some(flagged) = counted(summary.flagged, FLAGS) {
        messages::warning(format!(
            "of {} steps {flagged}: they are flagged, and range profiles omit flagged steps",
            summary.steps
        ));
    }
}

/// Report the finished capture.
pub(super) fn report(
    session: &Session,
    plan: &Plan,
    summary: &Summary,
    out: &Path,
    profiles: Option<Profiles>,
) -> anyhow::Result<()> {
    warn(summary);
    let (line, files) = profiles.unzip();
    if session.json() {
        let mut record = record(plan, summary, out);
        let written = recording_files(out).into_iter();
        record["files"] = json!(written.chain(files.unwrap_or_default()).collect::<Vec<_>>());
        return text::say_json("capture", record);
    }
    if !session.prints_text() {
        return Ok(());
    }
    let queue = format!(
        "at most {} of {} bursts; the radio waited {} times for the disk",
        summary.longest_queue,
        watch::queues(session, plan).disk,
        summary.waits
    );
    let set = &summary.set;
    let mut facts = vec![
        ("recording", meta(out).display().to_string()),
        ("carriers", carriers(plan)),
        (
            "steps",
            format!("{} of {} bursts", summary.steps, summary.bursts),
        ),
        (
            "set to",
            format!(
                "{} samples/s, gains: transmit {} dB, receive {} and {} dB",
                set.sample_rate_hz,
                set.transmit_gain_db,
                set.receive_gain_db[0],
                set.receive_gain_db[1]
            ),
        ),
        ("queue", queue),
    ];
    if let Some(events) = counted(summary.events, EVENTS) {
        let lost = summary.lost_samples;
        facts.push((
            "events",
            format!("{events}; {lost} samples per channel lost"),
        ));
    }
    if summary.late_sweeps > 0 {
        let late = format!(
            "{} started later than plan.pri requires",
            summary.late_sweeps
        );
        facts.push(("sweeps", late));
    }
    facts.extend(line.map(|line| ("module", line)));
    Ok(text::say(text::facts(&facts).join("\n"))?)
}

pub(super) fn record(plan: &Plan, summary: &Summary, out: &Path) -> Value {
    let named = |counts: [u64; 5], names: [&str; 5]| -> Value {
        let all = names.into_iter().zip(counts);
        all.map(|(name, count)| (name.replace(' ', "_"), json!(count)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let set = &summary.set;
    json!({
        "ended": ended(summary),
        "carriers": { "start_hz": plan.start_hz, "step_hz": plan.step_hz(), "count": plan.steps, "taken": plan.carriers_taken() },
        "steps": summary.steps,
        "bursts": summary.bursts,
        "flagged": named(summary.flagged, FLAGS),
        "events": named(summary.events, EVENTS),
        "lost_samples": summary.lost_samples,
        "waits": summary.waits,
        "longest_queue": summary.longest_queue,
        "late_sweeps": summary.late_sweeps,
        "set": {
            "master_clock_hz": set.master_clock_hz,
            "sample_rate_hz": set.sample_rate_hz,
            "bandwidth_hz": set.bandwidth_hz,
            "transmit_gain_db": set.transmit_gain_db,
            "receive_gain_db": set.receive_gain_db,
        },
        "files": recording_files(out),
    })
}

/// Whether the disk or its user's quota is full. For other errors, freeing space does not help.
fn is_full(error: &SigmfError) -> bool {
    use std::io::ErrorKind::{QuotaExceeded, StorageFull};
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(error) = cause {
        if let Some(error) = error.downcast_ref::<std::io::Error>()
            && matches!(error.kind(), StorageFull | QuotaExceeded)
        {
            return true;
        }
        cause = error.source();
    }
    false
}

/// Return the error that ended a capture early, with the location of the data captured so far.
pub(super) fn end(plan: &Plan, summary: Summary, out: &Path) -> anyhow::Result<()> {
    let (steps, path) = (summary.steps, meta(out).display().to_string());
    let left = format!("the {steps} steps captured so far are in {path}");
    match summary.ended {
        EndReason::Done => Ok(()),
        // The normal end of an endless capture.
        EndReason::Stopped if plan.sweeps == 0 => Ok(()),
        EndReason::Stopped => Err(InterruptedWithSteps {
            steps,
            unit: "steps",
            path,
        }
        .into()),
        EndReason::Radio(error) => Err(anyhow!("{error}; {left}")),
        EndReason::Disk(error) if is_full(&error) => Err(anyhow!(
            "{error}; {left}: free disk space and capture again"
        )),
        EndReason::Disk(error) => Err(anyhow!(
            "{error}; {left}: check the disk, or capture to another one"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_full_disk_needs_room() {
        // As Linux numbers them: EIO, EACCES, ENOSPC, EDQUOT.
        for (number, full) in [(5, false), (13, false), (28, true), (122, true)] {
            let error = SigmfError::Io {
                path: "a.sigmf-data".into(),
                source: std::io::Error::from_raw_os_error(number),
            };
            assert_eq!(is_full(&error), full, "{error}");
        }
    }
}
