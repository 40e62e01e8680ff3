//! Command waiting for an answer.

use std::time::Instant;

/// Number of attempts of a request. If half of all answers are lost, all of these are lost once in `10^15`.
pub(super) const ATTEMPTS: u32 = 50;

/// Command waiting for an answer.
pub(super) struct Question {
    pub(super) sequence: u32,
    pub(super) asked: Instant,
    /// Number of attempts without an answer.
    pub(super) unanswered: u32,
}

impl Question {
    /// Create without a pending request.
    pub(super) fn new(now: Instant) -> Self {
        Self {
            sequence: 0,
            asked: now,
            unanswered: 0,
        }
    }
}
