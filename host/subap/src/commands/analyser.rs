//! `subap capture` with a vector network analyser.

use std::f64::consts::PI;
use std::io;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use anyhow::anyhow;
use serde_json::json;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::io::atomic::free_bytes;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::monitor::Monitor;
use subaperture::planner::stepped::{SteppedSweep, SweepPlan};
use subaperture::radio::vna::{Ended, Mode, Summary, VnaExperiment, capture};

use super::plan::speed;
use crate::args::Capture;
use crate::config::Session;
use crate::failure::{InterruptedWithSteps, Usage};
use crate::{interrupt, messages, text};

/// Time between two checks for Ctrl-C while the operator moves the antennas.
const NOTICE: Duration = Duration::from_millis(50);

/// Capture with an analyser.
pub(super) fn run(
    session: &Session,
    typed: &Capture,
    experiment: &VnaExperiment,
) -> anyhow::Result<()> {
    let of_radios = [
        ("--replay", typed.replay.is_some()),
        ("--module", typed.module.is_some()),
        ("--live", typed.live),
        ("--page", typed.watching.is_asked()),
    ];
    Usage::refuse(
        &of_radios,
        "device.kind = \"vna\"",
        "the recording is formed by subap focus",
    )?;
    let Some(out) = typed.out.as_ref().or(experiment.recording.as_ref()) else {
        let fault =
            "no output for the recording: give --out DIR, or files.recording of the experiment";
        return Err(Usage(fault.to_owned()).into());
    };
    if typed.rehearsal.dry_run {
        return rehearse(session, experiment, out);
    }
    let _keeping = interrupt::Keeping::begin();
    let progress = session.progress("capturing");
    let mut stops = Stops {
        lines: None,
        sweeps: experiment.sweeps,
        ended: false,
    };
    let mut seen = |count: u64| match experiment.sweeps {
        0 => progress.set_label(format!("sweep {count}")),
        sweeps => progress.progress(count as f64 / sweeps as f64),
    };
    let summary = capture(
        experiment,
        out,
        &mut |stop| stops.next(stop),
        &mut seen,
        interrupt::flag(),
    )?;
    progress.finish();
    report(session, experiment, &summary, out)?;
    end(experiment, summary, out, stops.ended)
}

/// Stops of the antennas, each confirmed by the Enter key.
struct Stops {
    lines: Option<Receiver<()>>,
    sweeps: u64,
    /// Whether standard input has ended.
    ended: bool,
}

impl Stops {
    /// Wait for the Enter key; `false` after Ctrl-C or the end of standard input.
    fn next(&mut self, stop: u64) -> bool {
        let of = match self.sweeps {
            0 => String::new(),
            sweeps => format!(" of {sweeps}"),
        };
        messages::note(&format!(
            "stop {}{of}: move the antennas, then press Enter",
            stop + 1
        ));
        let lines = self.lines.get_or_insert_with(|| {
            let (sender, lines) = channel();
            // Without this thread, the channel is closed as at the end of standard input.
            let _ = thread::Builder::new().spawn(move || {
                for line in io::stdin().lines() {
                    if line.is_err() || sender.send(()).is_err() {
                        break;
                    }
                }
            });
            lines
        });
        while !interrupt::pressed() {
            match lines.recv_timeout(NOTICE) {
                Ok(()) => return true,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    self.ended = true;
                    return false;
                }
            }
        }
        false
    }
}

/// Print the least time and the disk space.
fn rehearse(session: &Session, experiment: &VnaExperiment, out: &Path) -> anyhow::Result<()> {
    let analyser = &experiment.analyser;
    let sweep_s = analyser.sweep_s();
    let interval_s = match experiment.scan.mode {
        Mode::Interval(interval_s) => interval_s.max(sweep_s),
        _ => sweep_s,
    };
    let last_hz = analyser.frequency_hz(analyser.points - 1);
    let sweep = SteppedSweep {
        centre_hz: (analyser.start_hz + last_hz) / 2.0,
        highest_hz: last_hz,
        carriers: analyser.points,
        sweep_s,
        interval_s,
    };
    let speed = SweepPlan::new(sweep, PI, None);
    let half_c = SPEED_OF_LIGHT_M_S / 2.0;
    let unambiguous_m = half_c / analyser.step_hz;
    let resolution_m = unambiguous_m / analyser.points as f64;
    // A frequency and two numbers of at most 24 characters, and 4 for each other parameter.
    let ports = analyser.parameter[0].max(analyser.parameter[1]);
    let bytes = (analyser.points * (12 + 48 + 4 * ports * ports)) as f64;
    let sweeps = (experiment.sweeps > 0).then_some(experiment.sweeps as f64);
    let free = free_bytes(out);
    if session.json() {
        return text::say_json(
            "forecast",
            json!({
                "work": format!("{} sweeps of {} frequencies", experiment.sweeps, analyser.points),
                "resolution_m": resolution_m,
                "unambiguous_m": unambiguous_m,
                "sweep_s": interval_s,
                "time_s": sweeps.map(|sweeps| sweeps * interval_s),
                "bytes_a_sweep": bytes,
                "speed": speed,
                "disk": [{
                    "path": out.display().to_string(),
                    "bytes": sweeps.map(|sweeps| sweeps * bytes),
                    "free_bytes": free,
                }],
            }),
        );
    }
    let sized = |bytes: f64| text::bytes(bytes.round() as u128);
    let mut facts = vec![
        ("frequencies", frequencies(experiment)),
        ("resolution", format!("{resolution_m:.3} m")),
        ("unambiguous", format!("{unambiguous_m:.2} m")),
        (
            "sweep",
            format!(
                "at least {}, {} points / IF bandwidth",
                text::seconds(sweep_s),
                analyser.points
            ),
        ),
        ("disk", format!("at most {} per sweep", sized(bytes))),
    ];
    // The first of them is the sweep above.
    facts.extend(speed::facts(&speed, true).into_iter().skip(1));
    if let Some(sweeps) = sweeps {
        let all = format!(
            "{sweeps} sweeps: at least {} and the time to move, {} of disk space",
            text::seconds(sweeps * interval_s),
            sized(sweeps * bytes)
        );
        facts.push(("work", all));
    }
    if let Some(free) = free {
        facts.push(("free", text::bytes(free.into())));
    }
    Ok(text::say(text::facts(&facts).join("\n"))?)
}

fn frequencies(experiment: &VnaExperiment) -> String {
    let analyser = &experiment.analyser;
    format!(
        "{} from {}, {} apart, {} at IF bandwidth {}",
        analyser.points,
        text::hertz(analyser.start_hz),
        text::hertz(analyser.step_hz),
        analyser.parameter_name(),
        text::hertz(analyser.if_bandwidth_hz)
    )
}

/// Description of the recording, and its record.
fn files(summary: &Summary, out: &Path) -> Vec<WrittenFile> {
    let description = (summary.record.sweeps > 0)
        .then(|| WrittenFile::new(out.join("recording.toml"), FileKind::Recording));
    let record = WrittenFile::new(out.join("capture.json"), FileKind::Record);
    let files = description.into_iter().chain([record]);
    files.filter(|file| file.path.exists()).collect()
}

fn report(
    session: &Session,
    experiment: &VnaExperiment,
    summary: &Summary,
    out: &Path,
) -> anyhow::Result<()> {
    let record = &summary.record;
    let counts = json!(record.fault_counts);
    let counted: Vec<String> = (counts.as_object().into_iter().flatten())
        .map(|(kind, count)| format!("{count} {kind}"))
        .collect();
    if !counted.is_empty() && out.join("capture.json").exists() {
        messages::warning(format!(
            "faults of the analyser or its connection: {}; a sweep with a fault was repeated, and capture.json in {} has their texts",
            counted.join(", "),
            out.display()
        ));
    }
    if session.json() {
        let ended = match summary.ended {
            Ended::Done => "done",
            Ended::Stopped => "stopped",
            Ended::Failed(_) => "failed",
        };
        return text::say_json(
            "vna-capture",
            json!({
                "ended": ended,
                "sweeps": record.sweeps,
                "new_sweeps": summary.new_sweeps,
                "instrument": record.instrument,
                "fault_counts": counts,
                "files": files(summary, out),
            }),
        );
    }
    if !session.prints_text() {
        return Ok(());
    }
    if record.sweeps == 0 {
        return Ok(());
    }
    let facts = vec![
        (
            "recording",
            out.join("recording.toml").display().to_string(),
        ),
        ("analyser", record.instrument.clone()),
        ("frequencies", frequencies(experiment)),
        (
            "sweeps",
            format!("{}, {} of them new", record.sweeps, summary.new_sweeps),
        ),
    ];
    Ok(text::say(text::facts(&facts).join("\n"))?)
}

/// Return the error that ended a capture early, with the location of the sweeps.
fn end(
    experiment: &VnaExperiment,
    summary: Summary,
    out: &Path,
    input_ended: bool,
) -> anyhow::Result<()> {
    let (steps, path) = (summary.record.sweeps, out.display().to_string());
    match summary.ended {
        Ended::Done => Ok(()),
        // The normal end of an endless capture.
        Ended::Stopped if experiment.sweeps == 0 => Ok(()),
        Ended::Stopped if input_ended => Err(anyhow!(
            "expected Enter for each of {} stops, and standard input ended: the {steps} sweeps captured so far are in {path}; continue by the same command at \
             a terminal, or set scan.mode",
            experiment.sweeps
        )),
        Ended::Stopped => Err(InterruptedWithSteps {
            steps,
            unit: "sweeps",
            path,
        }
        .into()),
        Ended::Failed(error) if steps == 0 => Err(anyhow!("{error}; no sweep was captured")),
        Ended::Failed(error) => Err(anyhow!(
            "{error}; the {steps} sweeps captured so far are in {path}: remove the cause and continue by the same command"
        )),
    }
}
