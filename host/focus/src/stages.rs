//! How long stages of forming take, measured as they run.
//!
//! What each will take a former says beforehand ([`crate::cost::StageCost`]); it and its parts tell a monitor when a thread begins with some
//! of a stage and when it has done it ([`during`]), by the same names. Threads that are within a stage, counted at each of these
//! moments, give its time of all threads and on the clock: two looks at a clock for a patch or some pulses.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

pub use subaperture_model::monitor::during;

use subaperture_model::monitor::Monitor;

/// Reading pulses: a stage of every former, which none foretells.
pub const READING: &str = "reading";

/// The exact sum at sampled pixels, by which an image is judged: the same.
pub const SAMPLES: &str = "sampled pixels";

/// What a stage took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// Its name.
    pub stage: &'static str,
    /// The time of all threads.
    pub threads: Duration,
    /// The time in which any thread was at it.
    pub clock: Duration,
}

/// What stages took so far.
#[derive(Debug, Default)]
pub struct Times(Mutex<Vec<Running>>);

#[derive(Debug)]
struct Running {
    taken: Taken,
    /// Threads that are at it since the last look.
    now: u32,
    looked: Instant,
}

impl Times {
    /// What stages took, in the order in which they began.
    pub fn taken(&self) -> Vec<Taken> {
        let running = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        running.iter().map(|stage| stage.taken).collect()
    }

    fn look(&self, stage: &'static str, threads: impl FnOnce(u32) -> u32) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        let place = all.iter().position(|one| one.taken.stage == stage);
        let place = place.unwrap_or_else(|| {
            all.push(Running {
                taken: Taken {
                    stage,
                    threads: Duration::ZERO,
                    clock: Duration::ZERO,
                },
                now: 0,
                looked: now,
            });
            all.len() - 1
        });
        let one = &mut all[place];
        let passed = now - one.looked;
        one.taken.threads += passed * one.now;
        if one.now > 0 {
            one.taken.clock += passed;
        }
        (one.now, one.looked) = (threads(one.now), now);
    }
}

/// A monitor that measures stages, and else does what another does.
pub struct Timed<'a> {
    /// The other.
    pub monitor: &'a dyn Monitor,
    /// Where times are kept.
    pub times: &'a Times,
}

impl Monitor for Timed<'_> {
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

    use super::*;
    use subaperture_model::monitor::Silent;

    #[test]
    fn time_is_that_of_threads_and_of_the_clock() {
        let times = Times::default();
        let timed = Timed {
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
