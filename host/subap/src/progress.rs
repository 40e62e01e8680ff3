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

/// Number of steps of a full bar.
const FULL: u64 = 1000;

/// Time between two updates of the bar.
const FRAME: Duration = Duration::from_millis(100);

/// Time of the first line.
const FIRST_LINE: Duration = Duration::from_secs(1);

/// Progress of one stage of long work. It requests cancellation after Ctrl-C; the bar disappears when finished or dropped.
pub(crate) struct Progress {
    stage: Arc<Stage>,
    display: Option<JoinHandle<()>>,
}

/// State shared by the worker and the display thread.
struct Stage {
    state: Mutex<State>,
    ended: Condvar,
    /// Bit pattern of the largest fraction reported. Nonnegative floats have the same order as their bit patterns.
    fraction: AtomicU64,
    /// Bar; hidden without a terminal.
    bar: ProgressBar,
}

struct State {
    label: String,
    begun: Instant,
    next_line: Duration,
    ended: bool,
}

impl Progress {
    /// Start the progress of a stage with this label.
    pub(crate) fn new(label: &str, quiet: bool) -> Self {
        // indicatif also hides the bar if standard error is not a terminal.
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let bar = ProgressBar::with_draw_target(Some(FULL), target)
            .with_style(style(false))
            .with_message(label.to_owned());
        bar.tick();
        messages::show_bar(Some(bar.downgrade()));
        let stage = Arc::new(Stage {
            state: Mutex::new(State {
                label: label.to_owned(),
                begun: Instant::now(),
                next_line: FIRST_LINE,
                ended: false,
            }),
            ended: Condvar::new(),
            fraction: AtomicU64::new(0),
            bar,
        });
        let shared = Arc::clone(&stage);
        // Without this thread no lines are printed; the work is the same.
        let display = thread::Builder::new().spawn(move || shared.display_until_end());
        Self {
            stage,
            display: display.ok(),
        }
    }

    /// Change the label of the bar.
    pub(crate) fn set_label(&self, label: String) {
        self.stage.bar.set_message(label.clone());
        self.stage.lock().label = label;
    }

    /// Start the next stage at zero with this label.
    pub(crate) fn begin(&self, label: String) {
        let mut state = self.stage.lock();
        // The first label of a bar may only cover the time until the first stage.
        messages::timing(&state.label, state.begun.elapsed());
        state.begun = Instant::now();
        state.next_line = FIRST_LINE;
        self.stage.fraction.store(0, Ordering::Relaxed);
        self.stage.bar.set_position(0);
        self.stage.bar.reset_eta();
        drop(state);
        self.set_label(label);
    }

    /// Remove the bar from the screen.
    pub(crate) fn finish(&self) {
        let mut state = self.stage.lock();
        if state.ended {
            return;
        }
        state.ended = true;
        messages::timing(&state.label, state.begun.elapsed());
        drop(state);
        self.stage.ended.notify_all();
        self.stage.bar.finish_and_clear();
        messages::show_bar(None);
    }
}

impl Stage {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Redraw the bar, or print a line when it is due, until the end.
    fn display_until_end(&self) {
        let mut state = self.lock();
        while !state.ended {
            let passed = state.begun.elapsed();
            if passed >= state.next_line {
                state.next_line = next_line(passed);
                let fraction = self.fraction();
                let known = (fraction > 0.0).then_some(fraction);
                let line = line(&state.label, fraction, passed);
                messages::progress(&line, &state.label, known, passed);
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

/// Time of the line after the current one: 1, 5, 10, 20, 40, 80, 140, 200 seconds.
fn next_line(passed: Duration) -> Duration {
    passed + passed.clamp(Duration::from_secs(4), Duration::from_secs(60))
}

/// Format as `focusing: 34 %, 21.0 s left`; without a fraction, the elapsed time.
fn line(label: &str, fraction: f64, passed: Duration) -> String {
    if fraction <= 0.0 {
        return format!("{label}: {} so far", text::duration(passed));
    }
    let left = passed.mul_f64(((1.0 - fraction) / fraction).min(1e6));
    format!(
        "{label}: {:.0} %, {} left",
        (100.0 * fraction).floor(),
        text::duration(left)
    )
}

/// Style of the bar, with or without a known fraction.
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
            .stage
            .fraction
            .fetch_max(fraction.to_bits(), Ordering::Relaxed);
        let before = f64::from_bits(before);
        if fraction > before {
            if before == 0.0 {
                self.stage.bar.set_style(style(true));
            }
            self.stage.bar.set_position((fraction * FULL as f64) as u64);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::pressed()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
        if let Some(display) = self.display.take() {
            let _ = display.join();
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
        // A tiny fraction does not overflow.
        line("focusing", 1e-300, seconds(1000));
    }

    #[test]
    fn progress_only_grows() {
        let progress = Progress::new("at work", true);
        for fraction in [0.5, 0.2, f64::NAN, -1.0] {
            progress.progress(fraction);
        }
        assert_eq!(progress.stage.fraction(), 0.5);
        progress.progress(7.0);
        assert_eq!(progress.stage.fraction(), 1.0);
        progress.begin("at other work".to_owned());
        assert_eq!(progress.stage.fraction(), 0.0);
    }
}
