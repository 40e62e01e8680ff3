//! Forecast of the transfer time from its first sub-CPIs.
//!
//! The module processes the first two sub-CPIs of the job, and their maps are discarded. If the last maps of each arrive at
//! `t_0` and `t_1`, the `N` sub-CPIs of the job take
//!
//! ```text
//! t_0 + (N - 1) (t_1 - t_0)
//! ```
//!
//! The first includes the configuration and an idle line. Repetition of lost maps is not included.

use std::time::{Duration, Instant};

use subaperture_core::link::AssembledMap;

use super::ending::{LinkError, SinkError, TransferEnd};
use super::job::{Job, PulseSource};
use super::products::{ChannelDetection, DetectionSink, MapSink, Request};
use super::session::{Session, SessionObserver};
use subaperture_focus::forecast::Forecast;
use subaperture_model::phase_history::{PhaseHistory, PulseRange};

/// Number of sub-CPIs to measure.
const SUB_CPIS: usize = 2;

/// Sink that discards maps and records when the last one of each sub-CPI arrived.
struct Clock {
    start: Instant,
    came: [Option<Duration>; SUB_CPIS],
}

impl MapSink for Clock {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        if let Some(came) = self.came.get_mut(map.header.sub_cpi as usize) {
            *came = Some(self.start.elapsed());
        }
        Ok(())
    }
}

impl DetectionSink for Clock {
    fn accept(&mut self, sub_cpi: u32, _: u16, _: &[ChannelDetection]) -> Result<(), SinkError> {
        if let Some(came) = self.came.get_mut(sub_cpi as usize) {
            *came = Some(self.start.elapsed());
        }
        Ok(())
    }
}

/// Process the first sub-CPIs of `job` on the module of `session`. `None` if maps were lost: the line is then too unreliable for a
/// forecast.
///
/// # Errors
/// [`LinkError`] if the session fails.
pub fn rehearse(
    session: &mut Session<'_>,
    job: &Job<'_>,
    request: Request<'_>,
    watch: &mut dyn SessionObserver,
) -> Result<Option<Forecast>, LinkError> {
    let mut clock = Clock {
        start: Instant::now(),
        came: [None; SUB_CPIS],
    };
    // Maps come sub-CPI by sub-CPI, an image at the end only: each of its parts is a transfer.
    let parts = match request {
        Request::Maps | Request::Detections(_) => SUB_CPIS..SUB_CPIS + 1,
        Request::Image(_) => 1..SUB_CPIS + 1,
    };
    for sub_cpis in parts {
        let all = job.pulses.channels();
        let pulses = all[0].collection().pulses.len();
        let pulses = pulses.min(sub_cpis * usize::from(job.setup.num_pulses));
        let first: Vec<PulseRange> = all
            .iter()
            .map(|channel| PulseRange::new(*channel, 0..pulses))
            .collect();
        let first: Vec<&dyn PhaseHistory> = first.iter().map(|part| part as _).collect();
        // Weights do not affect the time.
        let weights = vec![1.0; pulses];
        let mut part = Job {
            setup: job.setup,
            fast_weights: job.fast_weights.clone(),
            patches: job.patches.clone(),
            pulses: PulseSource::new(&first, &weights, job.pulses.encoding())?,
        };
        let ending = match request {
            Request::Maps => session.transfer(&mut part, &mut clock, watch).ending,
            Request::Detections(detector) => {
                session
                    .detect(&mut part, &detector, &mut clock, watch)
                    .ending
            }
            Request::Image(image) => {
                let start = Instant::now();
                let (outcome, _) = session.accumulate(&mut part, image, watch);
                clock.came[sub_cpis - 1] = Some(start.elapsed());
                outcome.ending
            }
        };
        match ending {
            TransferEnd::Complete => {}
            TransferEnd::Incomplete => return Ok(None),
            TransferEnd::Failed(error) => return Err(error),
        }
    }
    let seconds = |came: Option<Duration>| came.map(|came| came.as_secs_f64());
    let [first_s, second_s] = clock.came.map(seconds);
    let Some(first_s) = first_s else {
        return Ok(None);
    };
    let measured_s = second_s.unwrap_or(first_s);
    let others = f64::from(job.num_sub_cpis().saturating_sub(1));
    Ok(Some(Forecast {
        seconds: first_s + others * (measured_s - first_s),
        measured_s,
    }))
}
