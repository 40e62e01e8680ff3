//! Capture of chirp bursts: recording and frequency response of each burst.
//!
//! One thread does everything: between bursts the radio waits for the disk and for the consumer of the responses. Bursts
//! are timed, so that no sample is lost while it waits. Memory: one burst of both channels.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Plan;
use crate::antennas::Reference;
use crate::capture::CaptureError;
use crate::error::RadioError;
use crate::live::{Counts, Level, LiveBurst};
use crate::profile::ChirpResponse;
use crate::sigmf::{Flag, Setup, Step, Writer};
use crate::transceiver::{Burst, Configuration, Sample, Side, Transceiver};

/// Summary of a chirp capture.
#[derive(Clone, Debug)]
pub struct ChirpSummary {
    /// Number of bursts captured.
    pub bursts: u64,
    /// Pulses used, and pulses skipped because of lost samples. The first pulse of a burst is not used.
    pub pulses: [u64; 2],
    /// Bursts flagged late, with lost samples, clipped.
    pub flagged: [u64; 3],
    /// Whether a stop was requested.
    pub stopped: bool,
    /// Settings in effect on the radio.
    pub set: Configuration,
}

/// Settings in effect on a radio that [`prepare`] has configured.
#[derive(Clone, Debug)]
pub struct Ready {
    set: Configuration,
    /// Parameters of the recording.
    pub setup: Setup,
}

/// Check a plan against a radio and apply the plan's settings.
///
/// # Errors
/// If the plan does not fit the radio, or a setting cannot be applied.
pub fn prepare(radio: &mut dyn Transceiver, plan: &Plan) -> Result<Ready, RadioError> {
    plan.check(&radio.about().ranges)?;
    let set = radio.configure(&plan.radio)?;
    let setup = setup(radio, plan, &set);
    Ok(Ready { set, setup })
}

/// Send the bursts of a plan, record them to `path` if given, and call `emit` with each burst, until the plan is complete
/// or `stop` is set.
///
/// # Errors
/// If the plan does not fit the radio, or the radio or the disk fails. The recording up to then is complete.
pub fn capture(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    path: Option<&Path>,
    emit: &mut dyn FnMut(LiveBurst),
    stop: &AtomicBool,
) -> Result<ChirpSummary, CaptureError> {
    let ready = prepare(radio, plan)?;
    capture_ready(radio, plan, ready, path, emit, stop)
}

/// Capture like [`capture`], with a radio already set by [`prepare`]; for callers that need the settings in effect
/// first.
///
/// # Errors
/// If the radio or the disk fails. The recording up to then is complete.
pub fn capture_ready(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    Ready { set, setup }: Ready,
    path: Option<&Path>,
    emit: &mut dyn FnMut(LiveBurst),
    stop: &AtomicBool,
) -> Result<ChirpSummary, CaptureError> {
    let writer = path
        .map(|path| Writer::create(path, setup.clone()))
        .transpose()?;
    let mut engine = Engine {
        plan,
        setup,
        writer,
        summary: ChirpSummary {
            bursts: 0,
            pulses: [0; 2],
            flagged: [0; 3],
            stopped: false,
            set,
        },
    };
    let ended = engine.bursts(radio, emit, stop);
    // Close the recording even after an error.
    let finished = engine.writer.map_or(Ok(()), Writer::finish);
    ended?;
    finished?;
    Ok(engine.summary)
}

struct Engine<'a> {
    plan: &'a Plan,
    setup: Setup,
    writer: Option<Writer>,
    summary: ChirpSummary,
}

impl Engine<'_> {
    fn bursts(
        &mut self,
        radio: &mut dyn Transceiver,
        emit: &mut dyn FnMut(LiveBurst),
        stop: &AtomicBool,
    ) -> Result<(), CaptureError> {
        let (plan, summary) = (self.plan, &mut self.summary);
        let waveform = plan.waveform();
        let mut counts = Counts::default();
        let mut channels = [
            vec![Sample::ZERO; plan.samples()],
            vec![Sample::ZERO; plan.samples()],
        ];
        radio.tune(Side::Transmit, plan.carrier_hz, None)?;
        let carrier_hz = radio.tune(Side::Receive, plan.carrier_hz, None)?;
        while plan.bursts == 0 || summary.bursts < plan.bursts {
            if stop.load(Ordering::Relaxed) {
                summary.stopped = true;
                break;
            }
            let burst = Burst {
                waveform: &waveform,
                at_s: radio.now_s()? + plan.lead_s,
            };
            let [reference, echo] = &mut channels;
            let received = radio.burst(&burst, [reference, echo])?;
            let both = [&channels[0][..], &channels[1][..]];
            let step = Step {
                sweep: summary.bursts,
                ..Step::received(&self.setup, &received, plan.samples(), carrier_hz)
            };
            let counted = [Flag::Late, Flag::Lost, Flag::Clipped];
            let [late, lost, clipped] = counted.map(|flag| step.flags.contains(&flag));
            for (count, is) in summary.flagged.iter_mut().zip([late, lost, clipped]) {
                *count += u64::from(is);
            }
            let flagged = [late, lost, false, clipped, false];
            for (count, is) in counts.flagged.iter_mut().zip(flagged) {
                *count += u64::from(is);
            }
            counts.steps += 1;
            counts.bursts += 1;
            counts.lost_samples += received
                .lost
                .iter()
                .map(ExactSizeIterator::len)
                .sum::<usize>() as u64;
            let level = |c: usize| Level::of(both[c], &received.lost, received.clipped[c]);
            let (time_s, levels) = (step.time_s, [level(0), level(1)]);
            let mut response = ChirpResponse::new(&self.setup);
            response.add(&step, both);
            if let Some(writer) = &mut self.writer {
                writer.append(step, both)?;
            }
            for (all, new) in summary.pulses.iter_mut().zip(response.pulses()) {
                *all += new;
            }
            emit(LiveBurst {
                index: summary.bursts,
                time_s,
                response: response.sweep(),
                levels,
                flagged,
                counts,
            });
            summary.bursts += 1;
        }
        Ok(())
    }
}

/// Recording parameters, as described in [`super`].
fn setup(radio: &dyn Transceiver, plan: &Plan, set: &Configuration) -> Setup {
    let about = radio.about();
    Setup {
        name: plan.name.clone(),
        hardware: format!("{} {}", about.product, about.serial),
        sample_rate_hz: set.sample_rate_hz,
        period: plan.period(),
        samples: plan.samples(),
        start_hz: plan.carrier_hz,
        step_hz: plan.bandwidth_hz,
        steps: 1,
        transmit_gain_db: set.transmit_gain_db,
        receive_gain_db: set.receive_gain_db,
        receive_antennas: set.receive_antennas.clone(),
        reference: Reference::Loopback,
        antennas: None,
        reach_m: Some(plan.reach_m),
    }
}
