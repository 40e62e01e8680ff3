//! Execution of commands from the host, and reasons to refuse them.

use subaperture_core::Pulse;
use subaperture_core::link::{self, Command, Event, Refusal, State, f32s};
use subaperture_core::stream::{Patch, PulseError, Setup};

use super::module::Module;
use super::transfer::Transfer;
use crate::engine::WireEngine;
use crate::products::{CHANNELS, Products};

impl<E: WireEngine> Module<'_, E> {
    pub(super) fn execute(&mut self, sequence: u32, command: &Command<'_>) {
        let answered = !matches!(
            command,
            Command::Hello
                | Command::Pulse { .. }
                | Command::Channel { .. }
                | Command::Burst { .. }
                | Command::Sweep { .. }
                | Command::Accumulated { .. }
                | Command::SendChip { .. }
                | Command::Log { .. }
                | Command::Geometry { .. }
        );
        let refusal = match *command {
            Command::Hello => {
                self.due.identity = true;
                Ok(())
            }
            Command::Configure(configuration) => self.configure(&configuration),
            Command::Weights { first, weights } => self.set_weights(first.into(), weights),
            Command::Patch {
                index,
                count,
                patch,
            } => self.set_patch(index, count, &patch),
            Command::Start { run, first } => self.start(run, first),
            Command::Pulse {
                pulse,
                encoding,
                samples,
            } => self.push(&pulse, encoding, samples),
            Command::Stop => {
                if self.state == State::Running {
                    // Pulses that wait for samples of the front end come first.
                    if self.makes_maps() && self.source.is_empty() {
                        self.processor.finish();
                    }
                    self.state = State::Finishing;
                }
                Ok(())
            }
            Command::Status => Ok(()),
            Command::Abort => {
                self.abort();
                Ok(())
            }
            Command::Chip(grid) => {
                let (sub_cpis, channels) = (self.sub_cpis(), self.channels());
                self.add_product(|products| products.set_chip(&grid, sub_cpis, channels))
            }
            Command::Detect(cfar) => self.add_product(|products| products.set_cfar(&cfar)),
            Command::Motion(configuration) => self.configure_increments(&configuration),
            Command::Antennas {
                transmitters,
                places,
            } => self.set_antennas(transmitters, places),
            Command::Channel {
                pulse,
                channel,
                reference_path_m,
                encoding,
                samples,
            } => self.push_channel((pulse, channel), reference_path_m, encoding, samples),
            Command::Profiles(configuration) => self.configure_profiles(&configuration),
            Command::Burst {
                sweep,
                carrier,
                first,
                samples,
            } => self.push_burst((sweep, carrier, first), samples),
            Command::Sweep { sweep } => self.ask_for_profile(sweep),
            Command::Accumulated { first } => {
                self.due.accumulated = Some(first);
                Ok(())
            }
            Command::SendChip { patch } => self.send_chip(patch),
            Command::Log { least } => {
                self.events.request(least);
                Ok(())
            }
            Command::StartFrontEnd { run, first } => self.start_front_end(run, first),
            Command::Geometry { pulse } => self.push_geometry(&pulse),
            Command::Power => self.add_product(|products| products.set_power()),
            Command::Dpca(dpca) => {
                let setup = self.processor.setup().copied();
                self.add_product(|products| products.set_dpca(&dpca, setup.as_ref()))
            }
        };
        match refusal {
            Ok(()) => self.due.status |= answered,
            Err(refusal) => self.refuse(sequence, refusal),
        }
    }

    /// Report the refusal of the command in frame `sequence`; 0 for a pulse of the front end.
    pub(super) fn refuse(&mut self, sequence: u32, refusal: Refusal) {
        self.events.record(Event::Refused(refusal));
        self.due.refusal = Some((sequence, refusal));
    }

    pub(super) fn is_busy(&self) -> bool {
        matches!(self.state, State::Running | State::Finishing)
    }

    fn configure(&mut self, configuration: &link::Configuration) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        let setup = &configuration.setup;
        let most = match configuration.send_maps {
            true => 1,
            false => CHANNELS as u16,
        };
        if setup.num_channels > most {
            return Err(Refusal::Channels {
                wanted: setup.num_channels,
                most,
            });
        }
        self.processor.configure(setup).map_err(Refusal::Setup)?;
        self.increments.clear();
        self.profiles.clear();
        self.configuration = configuration.id;
        self.weights = 0;
        self.patches = 0;
        self.total_pulses = configuration.total_pulses;
        self.send_maps = configuration.send_maps;
        self.chips_requested = 0;
        self.transfer = Transfer::Nothing;
        self.products.clear();
        self.state = State::Idle;
        Ok(())
    }

    /// Number of sub-CPIs of all runs; 0 if unknown.
    fn sub_cpis(&self) -> u32 {
        let setup = self.processor.setup();
        let pulses = setup.map_or(1, Setup::numbers_per_sub_cpi);
        self.total_pulses.div_ceil(pulses.max(1))
    }

    /// Number of channels of the configuration.
    pub(super) fn channels(&self) -> u16 {
        self.processor.setup().map_or(1, |setup| setup.num_channels)
    }

    /// Whether the current configuration produces maps.
    pub(super) fn makes_maps(&self) -> bool {
        self.processor.setup().is_some()
            && !self.increments.is_configured()
            && !self.profiles.is_configured()
    }

    fn set_weights(&mut self, first: usize, weights: &[u8]) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        if self.profiles.is_configured() {
            return self.set_profile_weights(first, weights);
        }
        if !self.makes_maps() {
            return Err(Refusal::NotConfigured);
        }
        // Accept weights in order only, so that all were received when the last one was.
        if first > self.weights || !weights.len().is_multiple_of(4) {
            return Err(Refusal::Weights);
        }
        let weights = f32s(weights);
        let end = first.saturating_add(weights.len());
        self.processor
            .set_weights(first, weights)
            .map_err(Refusal::Setup)?;
        self.weights = self.weights.max(end);
        self.update_state();
        Ok(())
    }

    fn set_patch(&mut self, index: u16, count: u16, patch: &Patch) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        if !self.makes_maps() {
            return Err(Refusal::NotConfigured);
        }
        let have = self.processor.patches().len();
        let other_list = index > 0 && count != self.patches;
        if index >= count || usize::from(index) > have || other_list {
            return Err(Refusal::PatchIndex);
        }
        self.processor
            .set_patch(index.into(), patch)
            .map_err(Refusal::Setup)?;
        self.patches = count;
        self.update_state();
        Ok(())
    }

    fn add_product(
        &mut self,
        add: impl FnOnce(&mut Products<'_>) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        match self.state {
            State::Running | State::Finishing => Err(Refusal::Running),
            _ if !self.makes_maps() => Err(Refusal::NotConfigured),
            _ => add(&mut self.products),
        }
    }

    /// Set the state to ready once all announced weights and patches were received.
    fn update_state(&mut self) {
        let frequencies = self.processor.setup().map_or(0, |s| s.num_frequencies);
        let all_weights = self.weights == usize::from(frequencies);
        let all_patches =
            self.patches > 0 && self.processor.patches().len() == usize::from(self.patches);
        self.state = if all_weights && all_patches {
            State::Ready
        } else {
            State::Idle
        };
    }

    pub(super) fn start(&mut self, run: u32, first: u32) -> Result<(), Refusal> {
        if self.run == Some(run) && self.state != State::Ready && self.state != State::Idle {
            return Ok(());
        }
        match self.state {
            State::Idle => return Err(Refusal::NotConfigured),
            State::Running | State::Finishing => return Err(Refusal::Running),
            State::Ready | State::Done => {}
        }
        if self.increments.is_configured() {
            self.start_increments(run, first);
            return Ok(());
        }
        if self.profiles.is_configured() {
            self.start_profiles(run, first);
            return Ok(());
        }
        let chips = self.products.chips().len();
        if chips > 0 && chips != self.processor.patches().len() {
            return Err(Refusal::PatchIndex);
        }
        self.products.check_patches(self.processor.patches())?;
        self.processor.start(first).map_err(Refusal::Setup)?;
        self.run = Some(run);
        self.maps = 0;
        self.transfer = Transfer::Nothing;
        self.products.begin_run();
        self.aborting = false;
        self.pulse_refused = false;
        self.reported_credit = self.processor.accept_through();
        self.state = State::Running;
        Ok(())
    }

    fn abort(&mut self) {
        if self.is_busy() && self.increments.is_configured() {
            self.abort_increments();
        } else if self.is_busy() && self.profiles.is_configured() {
            self.stop_profiles();
        } else if self.is_busy() && self.products.is_partial() {
            self.source.stop();
            self.aborting = true;
            self.state = State::Finishing;
        } else if self.is_busy() {
            self.end_run();
        }
    }

    /// Send a chip, or the chip in transfer again.
    fn send_chip(&mut self, patch: u16) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        if usize::from(patch) >= self.products.chips().len() {
            return Err(Refusal::PatchIndex);
        }
        self.chip = patch;
        self.chips_requested = self.chips_requested.wrapping_add(1);
        self.transfer = Transfer::ChipStart;
        Ok(())
    }

    fn push(
        &mut self,
        pulse: &Pulse,
        encoding: link::Encoding,
        samples: &[u8],
    ) -> Result<(), Refusal> {
        if self.state != State::Running {
            // Late pulses of a finished run are ignored.
            return Ok(());
        }
        if !self.makes_maps() {
            return self.refuse_pulses(Refusal::NotConfigured);
        }
        let pushed = E::push(&mut self.processor, pulse, encoding, samples);
        match self.refusal_of(pushed, encoding, samples.len()) {
            Some(refusal) => self.refuse_pulses(refusal),
            None => Ok(()),
        }
    }

    /// Refusal to report for a pulse of `length` bytes, if any. The processor counts the other errors.
    pub(super) fn refusal_of(
        &self,
        pushed: Option<Result<(), PulseError>>,
        encoding: link::Encoding,
        length: usize,
    ) -> Option<Refusal> {
        match pushed {
            None => Some(Refusal::Encoding),
            Some(Err(PulseError::Length)) => {
                let frequencies = self.processor.setup().map_or(0, |s| s.num_frequencies);
                let expected = usize::from(frequencies) * encoding.sample_bytes();
                Some(Refusal::PulseLength {
                    expected: expected as u32,
                    got: length as u32,
                })
            }
            Some(_) => None,
        }
    }

    /// Send only the first refusal of a run, so that answers do not fill the line.
    pub(super) fn refuse_pulses(&mut self, refusal: Refusal) -> Result<(), Refusal> {
        match core::mem::replace(&mut self.pulse_refused, true) {
            true => Ok(()),
            false => Err(refusal),
        }
    }
}
