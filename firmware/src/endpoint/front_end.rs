//! Front end and state of runs with samples from it.

use crate::front_end::{FrontEnd, GeometryQueue, MAX_AHEAD};

/// Front end, and the geometry of pulses whose samples it has not provided yet.
#[derive(Default)]
pub(super) struct Source<'a> {
    pub(super) parts: Option<(&'a mut dyn FrontEnd, &'a mut GeometryQueue)>,
    /// Whether the samples of the current run come from it.
    pub(super) active: bool,
    /// Number of the next geometry.
    pub(super) next: u32,
    /// Pulses with numbers below this may be sent.
    credit: u32,
}

impl<'a> Source<'a> {
    pub(super) fn with(front_end: &'a mut dyn FrontEnd, queue: &'a mut GeometryQueue) -> Self {
        Self {
            parts: Some((front_end, queue)),
            ..Self::default()
        }
    }

    /// Whether no pulse waits for its samples.
    pub(super) fn is_empty(&self) -> bool {
        !self.active
            || self
                .parts
                .as_ref()
                .is_none_or(|(_, queue)| queue.is_empty())
    }

    /// End the run and forget its geometry.
    pub(super) fn stop(&mut self) {
        self.active = false;
        if let Some((_, queue)) = &mut self.parts {
            queue.clear();
        }
    }

    /// Number of the next expected pulse and credit of a run: those of the processor, unless the samples come from here. The
    /// credit then grows in steps of half a queue, so that few reports are needed.
    pub(super) fn flow(&mut self, next_pulse: u32, accept_through: u32) -> (u32, u32) {
        let Some((_, queue)) = self.parts.as_ref().filter(|_| self.active) else {
            return (next_pulse, accept_through);
        };
        if queue.len() <= MAX_AHEAD / 2 {
            let room = (MAX_AHEAD - queue.len()) as u32;
            self.credit = self.next.saturating_add(room);
        }
        (self.next, self.credit.min(accept_through))
    }
}
