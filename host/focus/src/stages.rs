//! Measured times of the stages of image formation.
//!
//! A former forecasts the time of each stage ([`crate::cost::StageCost`]). Its code notifies the monitor, under the same stage names, when a thread starts and
//! ends a portion of a stage ([`during`]). Counting the active threads at these events
//! gives the thread time and the elapsed time per stage, at two clock readings per patch or block of pulses.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

pub use subaperture_model::monitor::during;

use subaperture_model::monitor::Monitor;
use subaperture_model::stopwatch::Stopwatch;

/// Stage that reads pulses; every former has it and no former forecasts it.
pub const READING: &str = "reading";

/// Stage that computes the exact sum at compared pixels; no former forecasts it.
pub const SAMPLES: &str = "sampled pixels";

/// Measured time of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: &'static str,
    /// Time summed over all threads.
    pub threads: Duration,
    /// Elapsed time with at least one thread active.
    pub clock: Duration,
}

/// Accumulated times of stages.
#[derive(Debug, Default)]
pub struct StageTimes(Mutex<Vec<Running>>);

#[derive(Debug)]
struct Running {
    taken: StageTime,
    /// Number of threads currently in the stage.
    now: u32,
    looked: Stopwatch,
}

impl StageTimes {
    /// Times of all stages, in order of their first start.
    pub fn taken(&self) -> Vec<StageTime> {
        let running = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        running.iter().map(|stage| stage.taken).collect()
    }

    fn look(&self, stage: &'static str, threads: impl FnOnce(u32) -> u32) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = all.iter().position(|one| one.taken.stage == stage);
        let place = place.unwrap_or_else(|| {
            all.push(Running {
                taken: StageTime {
                    stage,
                    threads: Duration::ZERO,
                    clock: Duration::ZERO,
                },
                now: 0,
                looked: Stopwatch::start(),
            });
            all.len() - 1
        });
        let one = &mut all[place];
        let passed = one.looked.elapsed();
        one.taken.threads += passed * one.now;
        if one.now > 0 {
            one.taken.clock += passed;
        }
        (one.now, one.looked) = (threads(one.now), Stopwatch::start());
    }
}

/// Monitor that measures stages and forwards all calls to another monitor.
pub struct StageTimer<'a> {
    /// Monitor that receives all calls.
    pub monitor: &'a dyn Monitor,
    /// Accumulator of the stage times.
    pub times: &'a StageTimes,
}

impl Monitor for StageTimer<'_> {
    fn progress(&self, fraction: f64) {
        self.monitor.progress(fraction);
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled()
    }

    fn begins(&self, stage: &'static str) {
        self.times.look(stage, |threads| threads + 1);
    }

    fn ends(&self, stage: &'static str) {
        self.times.look(stage, |threads| threads.saturating_sub(1));
    }
}

#[cfg(test)]
mod tests {
    use std::thread::{self, sleep};
    use std::time::Instant;

    use super::*;
    use subaperture_model::monitor::Silent;

    #[test]
    fn stage_times_cover_threads_and_clock() {
        let times = StageTimes::default();
        let timed = StageTimer {
            monitor: &Silent,
            times: &times,
        };
        let nap = Duration::from_millis(50);
        let begun = Instant::now();
        thread::scope(|scope| {
            for _ in 0..3 {
                scope.spawn(|| {
                    let _held = during(&timed, "naps");
                    sleep(nap);
                });
            }
        });
        let elapsed = begun.elapsed();
        drop(during(&timed, "nothing"));
        let [naps, nothing] = times.taken()[..] else {
            panic!("two stages")
        };
        assert_eq!([naps.stage, nothing.stage], ["naps", "nothing"]);
        assert!(naps.threads >= 3 * nap && naps.threads <= 3 * elapsed);
        assert!(naps.clock >= nap && naps.clock <= elapsed);
        assert!(nothing.threads <= nothing.clock && nothing.clock < elapsed);
    }
}
