//! Runs that produce motion increments instead of maps.

use subaperture_core::link::{Encoding, MAX_ANTENNAS, MotionConfiguration, Refusal, State, places};
use subaperture_core::motion::{Antennas, Progress};

use super::increments::Run;
use super::module::Module;
use super::transfer::Transfer;
use crate::engine::WireEngine;

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
        self.increments.run = Run::starting_at(first);
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
            Progress::Idle if self.state == State::Finishing => {
                odometer.stop();
                self.source.stop();
                self.state = State::Done;
                self.due.status = true;
                false
            }
            Progress::Idle => self.take_channel(),
        }
    }

    pub(super) fn abort_increments(&mut self) {
        if let Some(odometer) = &mut self.increments.odometer {
            odometer.stop();
        }
        self.increments.run.due = false;
        self.source.stop();
        self.state = State::Done;
    }
}
