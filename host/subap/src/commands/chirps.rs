//! `subap capture` of chirps.

use std::path::Path;

use serde_json::json;
use subaperture::io::atomic::free_bytes;
use subaperture::monitor::Monitor;
use subaperture::radio::capture::CaptureError;
use subaperture::radio::chirp::{ChirpSummary, Plan, capture};
use subaperture::radio::experiment::{ChirpExperiment, Device};
use subaperture::radio::live::LiveBurst;
use subaperture::radio::{Ranges, Transceiver};

use super::capture_files::{meta, recording_files};
use crate::args::Capture;
use crate::config::Session;
use crate::failure::{InterruptedWithSteps, Usage};
use crate::{interrupt, messages, text, watch};

/// Bytes of a sample of both channels.
const SAMPLE_BYTES: usize = 8;

/// Capture bursts of chirps.
pub(super) fn run(
    session: &Session,
    typed: &Capture,
    mut experiment: ChirpExperiment,
) -> anyhow::Result<()> {
    Usage::refuse(
        &[("--module", typed.module.is_some())],
        "chirps",
        "subap profile shows the recording",
    )?;
    if let Some(recording) = &typed.replay {
        experiment.device = Device::Replay(recording.clone());
    }
    let Some(out) = typed.out.as_ref().or(experiment.recording.as_ref()) else {
        let fault =
            "no output for the recording: give --out NAME, or files.recording of the experiment";
        return Err(Usage(fault.to_owned()).into());
    };
    let plan = &experiment.plan;
    if typed.rehearsal.dry_run {
        return rehearse(session, plan, out);
    }
    let opening = session.progress("opening the radio");
    let captured = experiment.with_radio(session.memory_bytes, |radio| {
        opening.finish();
        if typed.live || typed.watching.is_asked() {
            return watch::bursts(
                session,
                radio,
                &experiment,
                &typed.watching,
                typed.live,
                out,
            );
        }
        Ok(captured(session, radio, plan, out)?)
    })?;
    let summary = captured?;
    report(session, plan, &summary, out)?;
    if summary.stopped && plan.bursts > 0 {
        return Err(InterruptedWithSteps {
            steps: summary.bursts,
            unit: "bursts",
            path: meta(out).display().to_string(),
        }
        .into());
    }
    Ok(())
}

/// Run the capture with a progress bar. Ctrl-C stops it cleanly.
fn captured(
    session: &Session,
    radio: &mut dyn Transceiver,
    plan: &Plan,
    out: &Path,
) -> Result<ChirpSummary, CaptureError> {
    let _keeping = interrupt::Keeping::begin();
    let progress = session.progress("capturing");
    let mut seen = |burst: LiveBurst| match plan.bursts {
        0 => progress.set_label(format!("burst {}", burst.index + 1)),
        bursts => progress.progress((burst.index + 1) as f64 / bursts as f64),
    };
    capture(radio, plan, Some(out), &mut seen, interrupt::flag())
}

/// Print the minimum time and disk space of the plan.
fn rehearse(session: &Session, plan: &Plan, out: &Path) -> anyhow::Result<()> {
    plan.check(&Ranges::b210())?;
    let burst_s = plan.lead_s + plan.samples() as f64 / plan.radio.sample_rate_hz;
    let burst_bytes = (plan.samples() * SAMPLE_BYTES) as f64;
    let bursts = (plan.bursts > 0).then_some(plan.bursts as f64);
    let unambiguous_m = plan.period() as f64 * plan.spacing_m();
    let free = free_bytes(out);
    if session.json() {
        return text::say_json(
            "forecast",
            json!({
                "work": format!("{} bursts of {} chirps", plan.bursts, plan.pulses),
                "resolution_m": plan.resolution_m(),
                "unambiguous_m": unambiguous_m,
                "burst_s": burst_s,
                "time_s": bursts.map(|bursts| bursts * burst_s),
                "disk": [{
                    "path": out.display().to_string(),
                    "bytes": bursts.map(|bursts| bursts * burst_bytes),
                    "free_bytes": free,
                }],
            }),
        );
    }
    let sized = |bytes: f64| text::bytes(bytes.round() as u128);
    let mut facts = vec![
        ("chirps", chirps(plan)),
        ("resolution", format!("{:.3} m", plan.resolution_m())),
        ("unambiguous", format!("{unambiguous_m:.2} m")),
        (
            "burst",
            format!(
                "at least {}, {}",
                text::seconds(burst_s),
                sized(burst_bytes)
            ),
        ),
    ];
    if let Some(bursts) = bursts {
        let all = format!(
            "{bursts} bursts: at least {} of capture time, {} of disk space",
            text::seconds(bursts * burst_s),
            sized(bursts * burst_bytes)
        );
        facts.push(("work", all));
    }
    if let Some(free) = free {
        facts.push(("free", text::bytes(free.into())));
    }
    Ok(text::say(text::facts(&facts).join("\n"))?)
}

fn chirps(plan: &Plan) -> String {
    format!(
        "{} per burst at {}, {} in {}, every {}",
        plan.pulses,
        text::hertz(plan.carrier_hz),
        text::hertz(plan.bandwidth_hz),
        text::seconds(plan.duration_s),
        text::seconds(plan.interval_s)
    )
}

fn report(
    session: &Session,
    plan: &Plan,
    summary: &ChirpSummary,
    out: &Path,
) -> anyhow::Result<()> {
    let [late, lost, clipped] = summary.flagged;
    if summary.flagged != [0; 3] {
        messages::warning(format!(
            "of {} bursts {late} late, {lost} with lost samples, {clipped} clipped: they are flagged, and range profiles omit pulses with lost samples",
            summary.bursts
        ));
    }
    if session.json() {
        return text::say_json(
            "chirp-capture",
            json!({
                "ended": if summary.stopped { "stopped" } else { "done" },
                "bursts": summary.bursts,
                "pulses": summary.pulses[0],
                "skipped_pulses": summary.pulses[1],
                "flagged": { "late": late, "lost_samples": lost, "clipped": clipped },
                "files": recording_files(out),
            }),
        );
    }
    if !session.prints_text() {
        return Ok(());
    }
    let facts = [
        ("recording", meta(out).display().to_string()),
        ("chirps", chirps(plan)),
        (
            "bursts",
            format!("{}, {} pulses complete", summary.bursts, summary.pulses[0]),
        ),
    ];
    Ok(text::say(text::facts(&facts).join("\n"))?)
}
