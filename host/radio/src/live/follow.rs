//! Assembly of live steps into sweeps.

use super::board::LiveState;
use super::display::{Display, Finished, LiveSweep, View};
use super::level::Level;
use super::step::LiveStep;
use crate::plan::Plan;
use crate::profile::{ProfileError, Steps};
use crate::sigmf::Setup;

/// Assembler of sweeps from live steps.
pub struct SweepAssembler {
    display: Display,
    samples: f64,
    rate_hz: f64,
    empty: Steps,
    /// Index of the current sweep.
    index: Option<u64>,
    steps: Steps,
    taken: Vec<bool>,
    /// Carriers that the plan avoids.
    avoided: Vec<bool>,
    levels: [Vec<Level>; 2],
    flagged: [usize; 5],
    began_s: f64,
    latest: Option<LiveStep>,
}

impl SweepAssembler {
    /// Make a follower and its board, for a plan with the radio parameters `setup` in effect and `bytes_a_second`
    /// written to disk.
    ///
    /// # Errors
    /// If the calibration belongs to another set-up, or the reach exceeds the unambiguous range.
    pub fn new(
        plan: &Plan,
        setup: &Setup,
        bytes_a_second: f64,
        view: View,
    ) -> Result<(Self, LiveState), ProfileError> {
        let about = (plan.name.as_str(), plan.sweeps);
        let (display, board) = Display::new(about, setup, bytes_a_second, view)?;
        let avoided: Vec<bool> = (0..setup.steps).map(|n| plan.avoids(n)).collect();
        let follower = Self {
            display,
            samples: setup.samples as f64,
            rate_hz: setup.sample_rate_hz,
            index: None,
            steps: Steps::empty(setup),
            empty: Steps::empty(setup),
            taken: avoided.clone(),
            avoided,
            levels: Default::default(),
            flagged: [0; 5],
            began_s: 0.0,
            latest: None,
        };
        Ok((follower, board))
    }

    /// Maximum range, metres.
    pub fn reach_m(&self) -> f64 {
        self.display.ranging.reach_m()
    }

    /// Receivers to which [`LiveSweep::receivers`] belong.
    pub fn receivers(&self) -> &'static [usize] {
        self.display.ranging.reference().receivers()
    }

    /// Process a step, and return the sweep that it completes, after publishing it on the board.
    pub fn take(&mut self, board: &LiveState, step: &LiveStep) -> Option<LiveSweep> {
        if step.step >= self.taken.len() {
            return None;
        }
        let mut ended = None;
        if self.index.is_some_and(|index| index != step.sweep) {
            ended = self.end(board);
        }
        if self.index.is_none() {
            self.index = Some(step.sweep);
            self.began_s = step.time_s;
        }
        self.taken[step.step] = true;
        if let Some(burst) = step.mixed {
            let middle_s = step.time_s + 0.5 * self.samples / self.rate_hz;
            self.steps.take(step.step, burst, middle_s);
        }
        for (all, level) in self.levels.iter_mut().zip(step.levels) {
            // At most as many as a sweep has steps, whatever arrives.
            if all.len() < self.taken.len() {
                all.push(level);
            }
        }
        for (count, is) in self.flagged.iter_mut().zip(step.flagged) {
            *count += usize::from(is);
        }
        self.latest = Some(*step);
        if self.taken.iter().all(|taken| *taken) {
            ended = self.end(board);
        }
        ended
    }

    /// End the current sweep, if there is one; also used at the end of a capture.
    pub fn end(&mut self, board: &LiveState) -> Option<LiveSweep> {
        let index = self.index.take()?;
        let latest = self.latest?;
        let steps = std::mem::replace(&mut self.steps, self.empty.clone());
        let responses = self.display.ranging.sweeps(&steps);
        let finished = Finished {
            index,
            began_s: self.began_s,
            flagged: self.flagged,
            levels: self.levels.each_ref().map(|all| Level::together(all)),
            counts: latest.counts,
        };
        let shown = self.display.show(board, &finished, responses);
        self.taken.copy_from_slice(&self.avoided);
        self.levels.iter_mut().for_each(Vec::clear);
        self.flagged = [0; 5];
        Some(shown)
    }
}
