//! How long a transfer will take: its first sub-CPIs, timed.
//!
//! The module does the first two sub-CPIs of the job, and their maps are dropped. With `t_0` and `t_1` when the last map
//! of each has come, the `N` of the job take
//!
//! ```text
//! t_0 + (N - 1) (t_1 - t_0)
//! ```
//!
//! The first waits for the configuration too, and for a line that was idle; what is lost later and fetched again comes on top.

use std::time::{Duration, Instant};

use subaperture_core::link::AssembledMap;

use super::ending::{Ending, LinkError, SinkError};
use super::intake::MapSink;
use super::job::{Job, PulseSource};
use super::session::{Session, Watch};
use subaperture_focus::forecast::Forecast;
use subaperture_model::phase_history::{PhaseHistory, Stretch};

/// Sub-CPIs that are done for it.
const SUB_CPIS: usize = 2;

/// Drops maps, and keeps when the last of each sub-CPI came.
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

/// Has the module of `session` do the first sub-CPIs of `job`, which is of `history`. `None` if maps of theirs were lost: then the line is too bad to
/// say.
///
/// # Errors
/// [`LinkError`].
pub fn rehearse(
    session: &mut Session<'_>,
    job: &Job<'_>,
    history: &dyn PhaseHistory,
    watch: &mut dyn Watch,
) -> Result<Option<Forecast>, LinkError> {
    let all = history.collection().pulses.len();
    let pulses = all.min(SUB_CPIS * usize::from(job.setup.num_pulses));
    let first = Stretch::new(history, 0..pulses);
    // Weights are no matter of time.
    let weights = vec![1.0; pulses];
    let mut part = Job {
        setup: job.setup,
        fast_weights: job.fast_weights.clone(),
        patches: job.patches.clone(),
        pulses: PulseSource::new(&first, &weights, job.pulses.encoding())?,
    };
    let mut clock = Clock {
        start: Instant::now(),
        came: [None; SUB_CPIS],
    };
    match session.transfer(&mut part, &mut clock, watch).ending {
        Ending::Complete => {}
        Ending::Incomplete => return Ok(None),
        Ending::Failed(error) => return Err(error),
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
