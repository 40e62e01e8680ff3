//! Which runs of sub-CPIs are still to be made.

use std::collections::VecDeque;
use std::ops::Range;

use super::streaming::Clock;
use crate::link::intake::Intake;

/// The runs of a job.
pub(super) struct Runs {
    /// Passes through what is missing, at most, and those begun.
    most_passes: u32,
    passes: u32,
    /// What this pass has still to do.
    todo: VecDeque<Range<u32>>,
    /// The sub-CPIs of the run that is being made.
    pub(super) current: Range<u32>,
    /// Maps taken before it.
    taken_before: u64,
    /// Whether it broke off, and what is missing of it comes first.
    broken: bool,
}

impl Runs {
    /// All sub-CPIs, then `retries` times those of which a map is missing. At a given rate nothing is sent
    /// twice.
    pub(super) fn new(retries: u32, paced: bool) -> Self {
        Self {
            most_passes: if paced { 1 } else { retries.saturating_add(1) },
            passes: 0,
            todo: VecDeque::new(),
            current: 0..0,
            taken_before: 0,
            broken: false,
        }
    }

    /// Goes on to the next run; none if there is nothing more to do.
    pub(super) fn next(
        &mut self,
        intake: &mut Intake<'_>,
        taken: u64,
        clock: Option<&Clock>,
    ) -> Option<Range<u32>> {
        if self.broken {
            self.broken = false;
            self.take_up_the_rest(intake, clock);
        }
        if self.todo.is_empty() && self.passes < self.most_passes {
            intake.fetch_again(self.passes > 0);
            self.passes += 1;
            self.todo = intake.missing(0..intake.wanted().num_sub_cpis());
        }
        self.current = self.todo.pop_front()?;
        self.taken_before = taken;
        Some(self.current.clone())
    }

    /// What is missing of the run that broke off; of a radar's, what is still to come.
    fn take_up_the_rest(&mut self, intake: &Intake<'_>, clock: Option<&Clock>) {
        let mut rest = self.current.clone();
        if let Some(clock) = clock {
            rest.start = intake.wanted().sub_cpi_from(clock.due()).max(rest.start);
        }
        let mut rest = intake.missing(rest);
        rest.append(&mut self.todo);
        self.todo = rest;
    }

    /// The run broke off; whether a map was taken in it.
    pub(super) fn break_off(&mut self, taken: u64) -> bool {
        self.broken = true;
        taken > self.taken_before
    }
}
