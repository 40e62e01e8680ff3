//! Capture of chirp bursts: recording and frequency response of each burst.
//!
//! One thread does everything: between bursts the radio waits for the disk and for the consumer of the responses. Bursts
//! are timed, so that no sample is lost while it waits. Memory: one burst of both channels.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Plan;
use crate::antennas::Reference;
use crate::capture::CaptureError;
use crate::profile::{ChirpResponse, Sweep};
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

/// Send the bursts of a plan, record them to `path` if given, and call `emit` with index and frequency response of each
/// burst, until the plan is complete or `stop` is set.
///
/// # Errors
/// If the plan does not fit the radio, or the radio or the disk fails. The recording up to then is complete.
pub fn capture(
    radio: &mut dyn Transceiver,
    plan: &Plan,
    path: Option<&Path>,
    emit: &mut dyn FnMut(u64, Sweep),
    stop: &AtomicBool,
) -> Result<ChirpSummary, CaptureError> {
    plan.check(&radio.about().ranges)?;
    let set = radio.configure(&plan.radio)?;
    let setup = setup(radio, plan, &set);
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
        emit: &mut dyn FnMut(u64, Sweep),
        stop: &AtomicBool,
    ) -> Result<(), CaptureError> {
        let (plan, summary) = (self.plan, &mut self.summary);
        let waveform = plan.waveform();
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
            for (count, flag) in summary.flagged.iter_mut().zip(counted) {
                *count += u64::from(step.flags.contains(&flag));
            }
            let mut response = ChirpResponse::new(&self.setup);
            response.add(&step, both);
            if let Some(writer) = &mut self.writer {
                writer.append(step, both)?;
            }
            for (all, new) in summary.pulses.iter_mut().zip(response.pulses()) {
                *all += new;
            }
            emit(summary.bursts, response.sweep());
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
