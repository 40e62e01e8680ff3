//! Runs that produce motion increments instead of maps.

use subaperture_core::link::{Encoding, MAX_ANTENNAS, MotionConfiguration, Refusal, State, places};
use subaperture_core::motion::{Antennas, Progress, SampleError, Setup, Step};
use subaperture_core::stream::PulseCounters;

use super::{Module, Transfer};
use crate::engine::WireEngine;
use crate::odometer::WireOdometer;

/// Odometer and state of a motion run.
#[derive(Default)]
pub(super) struct Increments<'a> {
    odometer: Option<&'a mut dyn WireOdometer>,
    /// Setup, if the current configuration is a motion configuration.
    setup: Option<Setup>,
    run: Run,
}

/// Results of the current run.
#[derive(Default)]
struct Run {
    /// Number of the pulse after the last one with a result.
    next: u32,
    /// Result of the last pulse, and whether it is still to be sent.
    last: Option<Step>,
    due: bool,
    counters: PulseCounters,
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

    fn push(
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
    fn record(&mut self, step: Step) {
        let run = &mut self.run;
        let lost = step.pulse.saturating_sub(run.next);
        run.counters.accepted = run.counters.accepted.saturating_add(1);
        run.counters.lost = run.counters.lost.saturating_add(lost);
        run.next = step.pulse.saturating_add(1);
        run.last = Some(step);
        run.due = true;
    }
}

impl<E: WireEngine> Module<'_, E> {
    pub(super) fn configure_increments(
        &mut self,
        configuration: &MotionConfiguration,
    ) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        if self.increments.odometer.is_none() {
            return Err(Refusal::Unsupported);
        }
        self.increments.setup = Some(configuration.setup);
        self.increments.run = Run::default();
        self.profiles.clear();
        self.configuration = configuration.id;
        self.transfer = Transfer::Nothing;
        self.products.clear();
        self.state = State::Idle;
        Ok(())
    }

    pub(super) fn set_antennas(&mut self, transmitters: u16, bytes: &[u8]) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        let (Some(setup), Some(odometer)) = (&self.increments.setup, &mut self.increments.odometer)
        else {
            return Err(Refusal::NotConfigured);
        };
        let mut room = [[0.0; 2]; MAX_ANTENNAS];
        let all = places(bytes);
        let count = all.len();
        if !bytes.len().is_multiple_of(16) || count > MAX_ANTENNAS {
            return Err(Refusal::Antennas);
        }
        for (place, own) in room.iter_mut().zip(all) {
            *place = own;
        }
        let both = room
            .get(..count)
            .and_then(|all| all.split_at_checked(transmitters.into()));
        let (transmitters_m, receivers_m) = both.ok_or(Refusal::Antennas)?;
        let antennas = Antennas {
            transmitters_m,
            receivers_m,
            // The odometer uses the wavelength of the band instead.
            wavelength_m: 0.0,
        };
        let configured = odometer.configure(setup, &antennas);
        // A configuration that was complete before may no longer be.
        self.state = State::Idle;
        configured.map_err(Refusal::Motion)?;
        self.state = State::Ready;
        Ok(())
    }

    pub(super) fn start_increments(&mut self, run: u32, first: u32) {
        if let Some(odometer) = &mut self.increments.odometer {
            odometer.start(first);
        }
        self.increments.run = Run {
            next: first,
            ..Run::default()
        };
        self.run = Some(run);
        self.maps = 0;
        self.transfer = Transfer::Nothing;
        self.pulse_refused = false;
        self.reported_credit = self.increments.accept_through();
        self.state = State::Running;
    }

    pub(super) fn push_channel(
        &mut self,
        place: (u32, u16),
        reference_path_m: f64,
        encoding: Encoding,
        samples: &[u8],
    ) -> Result<(), Refusal> {
        if self.state != State::Running {
            // Late pulses of a finished run are ignored.
            return Ok(());
        }
        if !self.increments.is_configured() {
            return self.refuse_pulses(Refusal::NotConfigured);
        }
        self.increments
            .push(place, reference_path_m, encoding, samples);
        Ok(())
    }

    /// Do one step, unless an increment waits to be sent.
    pub(super) fn work_on_increments(&mut self) -> bool {
        if self.increments.run.due {
            return false;
        }
        let Some(odometer) = &mut self.increments.odometer else {
            return false;
        };
        match odometer.work() {
            Progress::Busy => true,
            Progress::Step(step) => {
                self.increments.record(step);
                true
            }
            Progress::Idle => {
                if self.state == State::Finishing {
                    odometer.stop();
                    self.state = State::Done;
                    self.due.status = true;
                }
                false
            }
        }
    }

    pub(super) fn abort_increments(&mut self) {
        if let Some(odometer) = &mut self.increments.odometer {
            odometer.stop();
        }
        self.increments.run.due = false;
        self.state = State::Done;
    }
}
