//! Progress of long work with the estimated remaining time: a bar on a terminal, otherwise occasional lines.
//!
//! The bar appears at once. Lines start after one second, at intervals that grow to one minute, so that short work prints no line
//! and overnight logs stay short.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use subaperture::monitor::Monitor;

use crate::{interrupt, messages, text};

/// Steps of a full bar.
const FULL: u64 = 1000;

/// How often the bar is drawn again.
const FRAME: Duration = Duration::from_millis(100);

/// When the first line is due.
const FIRST_LINE: Duration = Duration::from_secs(1);

/// One stretch of long work. Asks for its end when Ctrl-C was pressed; vanishes when finished or dropped.
pub(crate) struct Progress {
    stretch: Arc<Stretch>,
    teller: Option<JoinHandle<()>>,
}

/// What the worker and the teller share.
struct Stretch {
    state: Mutex<State>,
    ended: Condvar,
    /// The bits of the largest fraction reported: not negative, so that they are in the order of the numbers.
    fraction: AtomicU64,
    /// Hidden where there is no terminal.
    bar: ProgressBar,
}

struct State {
    what: String,
    begun: Instant,
    next_line: Duration,
    ended: bool,
}

impl Progress {
    /// Progress of what is called `what`.
    pub(crate) fn new(what: &str, quiet: bool) -> Self {
        // Hidden by indicatif too if standard error is not a terminal.
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(FULL), target)
            .with_style(style(false))
            .with_message(what.to_owned());
        bar.tick();
        messages::show_bar(Some(bar.downgrade()));
        let stretch = Arc::new(Stretch {
            state: Mutex::new(State {
                what: what.to_owned(),
                begun: Instant::now(),
                next_line: FIRST_LINE,
                ended: false,
            }),
            ended: Condvar::new(),
            fraction: AtomicU64::new(0),
            bar,
        });
        let told = Arc::clone(&stretch);
        // Without a thread there is no line now and then; the work is the same.
        let teller = thread::Builder::new().spawn(move || told.tell_until_the_end());
        Self {
            stretch,
            teller: teller.ok(),
        }
    }

    /// What is called on the bar from now on.
    pub(crate) fn tell(&self, what: String) {
        self.stretch.bar.set_message(what.clone());
        self.stretch.lock().what = what;
    }

    /// The next stretch, from nothing, called `what`.
    pub(crate) fn begin(&self, what: String) {
        let mut state = self.stretch.lock();
        // A bar's first name may stand for nothing but the time until the first stretch.
        messages::timing(&state.what, state.begun.elapsed());
        state.begun = Instant::now();
        state.next_line = FIRST_LINE;
        self.stretch.fraction.store(0, Ordering::Relaxed);
        self.stretch.bar.set_position(0);
        self.stretch.bar.reset_eta();
        drop(state);
        self.tell(what);
    }

    /// Takes the bar off the screen.
    pub(crate) fn finish(&self) {
        let mut state = self.stretch.lock();
        if state.ended {
            return;
        }
        state.ended = true;
        messages::timing(&state.what, state.begun.elapsed());
        drop(state);
        self.stretch.ended.notify_all();
        self.stretch.bar.finish_and_clear();
        messages::show_bar(None);
    }
}

impl Stretch {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the bar alive, or tells a line when it is due.
    fn tell_until_the_end(&self) {
        let mut state = self.lock();
        while !state.ended {
            let passed = state.begun.elapsed();
            if passed >= state.next_line {
                state.next_line = next_line(passed);
                let fraction = self.fraction();
                let known = (fraction > 0.0).then_some(fraction);
                let line = line(&state.what, fraction, passed);
                messages::progress(&line, &state.what, known, passed);
            }
            let waited = self.ended.wait_timeout(state, FRAME);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            if !state.ended {
                self.bar.tick();
            }
        }
    }

    fn fraction(&self) -> f64 {
        f64::from_bits(self.fraction.load(Ordering::Relaxed))
    }
}

/// When the line after that of now is due: 1, 5, 10, 20, 40, 80, 140, 200 seconds.
fn next_line(passed: Duration) -> Duration {
    passed + passed.clamp(Duration::from_secs(4), Duration::from_secs(60))
}

/// `focusing: 34 %, 21.0 s left`; without a fraction only how long it has taken.
fn line(what: &str, fraction: f64, passed: Duration) -> String {
    if fraction <= 0.0 {
        return format!("{what}: {} so far", text::duration(passed));
    }
    let left = passed.mul_f64(((1.0 - fraction) / fraction).min(1e6));
    format!(
        "{what}: {:.0} %, {} left",
        (100.0 * fraction).floor(),
        text::duration(left)
    )
}

/// That of the bar, while its fraction is known or not.
fn style(known: bool) -> ProgressStyle {
    let template = match known {
        true => "{msg:>16} {wide_bar} {percent:>3} %  {eta} left",
        false => "{msg:>16} {spinner} {elapsed}",
    };
    ProgressStyle::with_template(template).expect("the template is well-formed")
}

impl Monitor for Progress {
    fn progress(&self, fraction: f64) {
        // Threads report out of order; the bar only grows.
        let fraction = match fraction.is_nan() {
            true => return,
            false => fraction.clamp(0.0, 1.0),
        };
        let before = self
            .stretch
            .fraction
            .fetch_max(fraction.to_bits(), Ordering::Relaxed);
        let before = f64::from_bits(before);
        if fraction > before {
            if before == 0.0 {
                self.stretch.bar.set_style(style(true));
            }
            self.stretch
                .bar
                .set_position((fraction * FULL as f64) as u64);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::pressed()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
        if let Some(teller) = self.teller.take() {
            let _ = teller.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_grow_rare() {
        let mut due = FIRST_LINE;
        let times: Vec<u64> = std::iter::from_fn(|| {
            let now = due;
            due = next_line(now);
            Some(now.as_secs())
        })
        .take(8)
        .collect();
        assert_eq!(times, [1, 5, 10, 20, 40, 80, 140, 200]);
    }

    #[test]
    fn progress_line_states_the_remaining_time() {
        let seconds = Duration::from_secs;
        assert_eq!(
            line("focusing", 0.25, seconds(10)),
            "focusing: 25 %, 30.0 s left"
        );
        assert_eq!(
            line("focusing", 0.0, seconds(10)),
            "focusing: 10.0 s so far"
        );
        // Next to nothing done: no overflow.
        line("focusing", 1e-300, seconds(1000));
    }

    #[test]
    fn progress_only_grows() {
        let progress = Progress::new("at work", true);
        for fraction in [0.5, 0.2, f64::NAN, -1.0] {
            progress.progress(fraction);
        }
        assert_eq!(progress.stretch.fraction(), 0.5);
        progress.progress(7.0);
        assert_eq!(progress.stretch.fraction(), 1.0);
        progress.begin("at other work".to_owned());
        assert_eq!(progress.stretch.fraction(), 0.0);
    }
}
