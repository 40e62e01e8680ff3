//! Odometer and state of runs that produce motion increments.

use subaperture_core::link::Encoding;
use subaperture_core::motion::{SampleError, Setup, Step};
use subaperture_core::stream::PulseCounters;

use crate::odometer::WireOdometer;

/// Odometer and state of a motion run.
#[derive(Default)]
pub(super) struct Increments<'a> {
    pub(super) odometer: Option<&'a mut dyn WireOdometer>,
    /// Setup, if the current configuration is a motion configuration.
    pub(super) setup: Option<Setup>,
    pub(super) run: Run,
}

/// Results of the current run.
#[derive(Default)]
pub(super) struct Run {
    /// Number of the pulse after the last one with a result.
    next: u32,
    /// Result of the last pulse, and whether it is still to be sent.
    last: Option<Step>,
    pub(super) due: bool,
    counters: PulseCounters,
}

impl Run {
    /// Run whose first pulse has this number.
    pub(super) fn starting_at(first: u32) -> Self {
        Self {
            next: first,
            ..Self::default()
        }
    }
}

impl<'a> Increments<'a> {
    /// Create the state with an odometer.
    pub(super) fn with(odometer: &'a mut dyn WireOdometer) -> Self {
        Self {
            odometer: Some(odometer),
            ..Self::default()
        }
    }

    /// Whether the current configuration produces increments.
    pub(super) fn is_configured(&self) -> bool {
        self.setup.is_some()
    }

    /// Disable increments.
    pub(super) fn clear(&mut self) {
        self.setup = None;
        self.run.due = false;
    }

    /// Number of channels per pulse, 0 without an odometer.
    pub(super) fn channels(&self) -> u32 {
        self.odometer
            .as_ref()
            .map_or(0, |odometer| odometer.channels() as u32)
    }

    /// Number of the next expected pulse.
    pub(super) fn next_pulse(&self) -> u32 {
        self.odometer
            .as_ref()
            .map_or(0, |odometer| odometer.pulse())
    }

    /// Credit: pulses with numbers below this may be sent, one at a time.
    pub(super) fn accept_through(&self) -> u32 {
        self.next_pulse().saturating_add(1)
    }

    /// Counters of the run's pulses.
    pub(super) fn counters(&self) -> PulseCounters {
        let incomplete = self.odometer.as_ref().map_or(0, |own| own.incomplete());
        PulseCounters {
            incomplete,
            ..self.run.counters
        }
    }

    /// Take the result to be sent, once.
    pub(super) fn take_due(&mut self) -> Option<Step> {
        let due = core::mem::take(&mut self.run.due);
        self.run.last.filter(|_| due)
    }

    /// Pass samples of a channel to the odometer.
    pub(super) fn push(
        &mut self,
        (pulse, channel): (u32, u16),
        reference_path_m: f64,
        encoding: Encoding,
        samples: &[u8],
    ) {
        let Some(odometer) = &mut self.odometer else {
            return;
        };
        let Run {
            last,
            due,
            counters,
            ..
        } = &mut self.run;
        let counter =
            match odometer.push(pulse, channel.into(), reference_path_m, encoding, samples) {
                Ok(()) => return,
                Err(SampleError::Busy | SampleError::NotStarted) => &mut counters.dropped,
                Err(SampleError::Repeated) => {
                    // The host did not receive the increment.
                    *due |= last.is_some_and(|last| last.pulse == pulse);
                    &mut counters.repeated
                }
                Err(SampleError::Channel | SampleError::Length | SampleError::NotFinite) => {
                    &mut counters.refused
                }
            };
        *counter = counter.saturating_add(1);
    }

    /// Record the result of a pulse.
    pub(super) fn record(&mut self, step: Step) {
        let run = &mut self.run;
        let lost = step.pulse.saturating_sub(run.next);
        run.counters.accepted = run.counters.accepted.saturating_add(1);
        run.counters.lost = run.counters.lost.saturating_add(lost);
        run.next = step.pulse.saturating_add(1);
        run.last = Some(step);
        run.due = true;
    }
}
