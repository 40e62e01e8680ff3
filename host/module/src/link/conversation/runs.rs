//! Scheduling of the runs of sub-CPIs.

use std::collections::VecDeque;
use std::ops::Range;

use super::streaming::Clock;
use crate::link::intake::Intake;

/// Runs of a job.
pub(super) struct Runs {
    /// Maximum number of passes over missing maps, and number started.
    most_passes: u32,
    passes: u32,
    /// Maximum number of sub-CPIs per run.
    most: u32,
    /// Ranges left in this pass.
    todo: VecDeque<Range<u32>>,
    /// Sub-CPIs of the current run.
    pub(super) current: Range<u32>,
    /// Maps received before it.
    taken_before: u64,
    /// Whether the run was interrupted; its missing sub-CPIs come first.
    broken: bool,
}

impl Runs {
    /// Plan one pass over all sub-CPIs and up to `retries` passes over those with missing maps, in runs of at most `most` sub-CPIs. If
    /// pulses occur `once`, one pass in one run.
    pub(super) fn new(retries: u32, once: bool, most: u32) -> Self {
        Self {
            most_passes: if once { 1 } else { retries.saturating_add(1) },
            most: if once { u32::MAX } else { most.max(1) },
            passes: 0,
            todo: VecDeque::new(),
            current: 0..0,
            taken_before: 0,
            broken: false,
        }
    }

    /// Start the next run. `None` if nothing is left.
    pub(super) fn next(
        &mut self,
        intake: &mut Intake<'_>,
        taken: u64,
        clock: Option<&Clock>,
    ) -> Option<Range<u32>> {
        if self.broken {
            self.broken = false;
            self.resume_interrupted(intake, clock);
        }
        if self.todo.is_empty() && self.passes < self.most_passes {
            intake.fetch_again(self.passes > 0);
            self.passes += 1;
            self.todo = intake.missing(0..intake.wanted().num_sub_cpis());
        }
        let mut next = self.todo.pop_front()?;
        let end = next.end.min(next.start.saturating_add(self.most));
        if end < next.end {
            self.todo.push_front(end..next.end);
            next.end = end;
        }
        self.current = next;
        self.taken_before = taken;
        Some(self.current.clone())
    }

    /// Whether this pass has another run.
    pub(super) fn has_next(&self) -> bool {
        !self.todo.is_empty()
    }

    /// Sub-CPIs missing from the interrupted run; at a fixed rate, only those still to come.
    fn resume_interrupted(&mut self, intake: &Intake<'_>, clock: Option<&Clock>) {
        let mut rest = self.current.clone();
        if let Some(clock) = clock {
            rest.start = intake.wanted().sub_cpi_from(clock.due()).max(rest.start);
        }
        let mut rest = intake.missing(rest);
        rest.append(&mut self.todo);
        self.todo = rest;
    }

    /// Start the current pass over all sub-CPIs again: everything taken was lost.
    pub(super) fn start_over(&mut self) {
        self.broken = false;
        self.todo.clear();
        self.passes = self.passes.saturating_sub(1);
    }

    /// Leave the missing sub-CPIs: no run follows.
    pub(super) fn abandon(&mut self) {
        self.most_passes = 0;
        self.broken = false;
        self.todo.clear();
    }

    /// Interrupt the run. Returns whether a map was received in it.
    pub(super) fn interrupt(&mut self, taken: u64) -> bool {
        self.broken = true;
        taken > self.taken_before
    }
}
