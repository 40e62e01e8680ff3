//! Runs with samples from the module's own front end: geometry from the host, matched with samples by pulse number. Increments
//! need no geometry; the front end numbers the channels of pulse `n` as pulses `n C + c`.

use subaperture_core::Pulse;
use subaperture_core::link::{Encoding, Refusal, State};
use subaperture_core::motion::SetupError;

use super::module::Module;
use crate::engine::WireEngine;

impl<E: WireEngine> Module<'_, E> {
    /// Start a run with samples from the front end.
    pub(super) fn start_front_end(&mut self, run: u32, first: u32) -> Result<(), Refusal> {
        let Some((front_end, _)) = &self.source.parts else {
            return Err(Refusal::Unsupported);
        };
        let most = front_end.max_samples().min(u16::MAX.into()) as u16;
        let samples = if let Some(setup) = &self.increments.setup {
            let wanted = setup.num_frequencies;
            if wanted > most {
                let error = SetupError::Frequencies { wanted, most };
                return Err(Refusal::Motion(error));
            }
            wanted
        } else if self.makes_maps() {
            let setup = self.processor.setup().ok_or(Refusal::NotConfigured)?;
            let mut capacity = *self.processor.capacity();
            capacity.frequencies = most;
            setup.check(&capacity).map_err(Refusal::Setup)?;
            setup.num_frequencies
        } else {
            return Err(Refusal::Unsupported);
        };
        // Maps number each channel of a pulse already.
        let channels = match self.increments.is_configured() {
            true => self.increments.channels(),
            false => 1,
        };
        let repeated = self.run == Some(run) && self.state != State::Ready;
        self.start(run, first)?;
        if let Some((front_end, _)) = self.source.parts.as_mut().filter(|_| !repeated) {
            front_end.begin(first.saturating_mul(channels), samples.into());
            self.source.active = true;
            self.source.next = first;
        }
        Ok(())
    }

    /// Queue the geometry of a pulse. Pulses are accepted in order only; the host repeats the others.
    pub(super) fn push_geometry(&mut self, pulse: &Pulse) -> Result<(), Refusal> {
        if self.state != State::Running {
            return Ok(());
        }
        if !self.source.active {
            return self.refuse_pulses(Refusal::NotConfigured);
        }
        if let Some((_, queue)) = &mut self.source.parts
            && pulse.number == self.source.next
            && queue.push_back(*pulse).is_ok()
        {
            self.source.next = pulse.number.saturating_add(1);
        }
        Ok(())
    }

    /// Pass a channel of a pulse from the front end to the odometer. Returns whether there was one.
    pub(super) fn take_channel(&mut self) -> bool {
        let active = self.source.active && self.state == State::Running;
        let Some((front_end, _)) = self.source.parts.as_mut().filter(|_| active) else {
            return false;
        };
        let Some((number, samples)) = front_end.pulse() else {
            return false;
        };
        let channels = self.increments.channels().max(1);
        let place = (number / channels, (number % channels) as u16);
        self.increments.push(place, 0.0, Encoding::Sc16, samples);
        front_end.release();
        true
    }

    /// Take a pulse from the front end, if its geometry is there and the processor has room. Returns whether a pulse was taken.
    pub(super) fn take_pulse(&mut self) -> bool {
        let room = self.processor.accept_through();
        let Some((front_end, queue)) = self.source.parts.as_mut().filter(|_| self.source.active)
        else {
            return false;
        };
        if queue.front().is_none_or(|pulse| pulse.number >= room) {
            return false;
        }
        let Some((number, samples)) = front_end.pulse() else {
            return false;
        };
        // The front end lost the pulses before.
        while queue.front().is_some_and(|pulse| pulse.number < number) {
            let _ = queue.pop_front();
        }
        let mut refusal = None;
        match queue.front().copied() {
            Some(pulse) if pulse.number == number && number < room => {
                let pushed = E::push(&mut self.processor, &pulse, Encoding::Sc16, samples);
                let length = samples.len();
                let _ = queue.pop_front();
                front_end.release();
                refusal = self.refusal_of(pushed, Encoding::Sc16, length);
            }
            // A pulse before the run.
            Some(pulse) if pulse.number > number => front_end.release(),
            // Its geometry or room in the processor is still to come.
            _ => {}
        }
        if let Some(Err(refusal)) = refusal.map(|refusal| self.refuse_pulses(refusal)) {
            self.refuse(0, refusal);
        }
        if self.state == State::Finishing && self.source.is_empty() {
            self.processor.finish();
        }
        true
    }
}
