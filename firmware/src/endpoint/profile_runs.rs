//! Runs that produce range profiles instead of maps.

use subaperture_core::link::{
    Refusal, Report, State, SweepConfiguration, TransferChecksum, write_complex32s,
};
use subaperture_core::stream::PulseCounters;
use subaperture_core::sweep::SetupError;

use super::module::Module;
use super::reports::send;
use super::transfer::Transfer;
use crate::engine::WireEngine;

impl<E: WireEngine> Module<'_, E> {
    pub(super) fn configure_profiles(
        &mut self,
        configuration: &SweepConfiguration,
    ) -> Result<(), Refusal> {
        if self.is_busy() {
            return Err(Refusal::Running);
        }
        let Some(profiler) = &mut self.profiles.profiler else {
            return Err(Refusal::Unsupported);
        };
        profiler
            .configure(&configuration.setup)
            .map_err(Refusal::Sweep)?;
        self.profiles.setup = Some(configuration.setup);
        self.profiles.weights = 0;
        self.profiles.requested = None;
        self.increments.clear();
        self.configuration = configuration.id;
        self.transfer = Transfer::Nothing;
        self.products.clear();
        self.state = State::Idle;
        Ok(())
    }

    pub(super) fn set_profile_weights(
        &mut self,
        first: usize,
        weights: &[u8],
    ) -> Result<(), Refusal> {
        let own = &mut self.profiles;
        let (Some(setup), Some(profiler)) = (&own.setup, &mut own.profiler) else {
            return Err(Refusal::NotConfigured);
        };
        // Accept weights in order only, so that all were received when the last one was.
        if first > own.weights || !weights.len().is_multiple_of(4) {
            return Err(Refusal::Weights);
        }
        profiler
            .set_weights(first, weights)
            .map_err(|error| match error {
                SetupError::Size { .. } => Refusal::Weights,
                error => Refusal::Sweep(error),
            })?;
        own.weights = own.weights.max(first.saturating_add(weights.len() / 4));
        self.state = match own.weights == usize::from(setup.carriers) {
            true => State::Ready,
            false => State::Idle,
        };
        Ok(())
    }

    pub(super) fn start_profiles(&mut self, run: u32, first: u32) {
        if let Some(profiler) = &mut self.profiles.profiler {
            profiler.start(first);
        }
        self.profiles.requested = None;
        self.profiles.counters = PulseCounters::default();
        self.run = Some(run);
        self.maps = 0;
        self.transfer = Transfer::Nothing;
        self.pulse_refused = false;
        self.reported_credit = u32::MAX;
        self.state = State::Running;
    }

    pub(super) fn push_burst(
        &mut self,
        (sweep, carrier, first): (u32, u16, u32),
        samples: &[u8],
    ) -> Result<(), Refusal> {
        if self.state != State::Running {
            // Late bursts of a finished run are ignored.
            return Ok(());
        }
        if !self.profiles.is_configured() {
            return self.refuse_pulses(Refusal::NotConfigured);
        }
        if let Some(profiler) = &mut self.profiles.profiler {
            // The transfer in progress and the pending request concern a finished profile. An answer now would end a sweep that the host is repeating.
            self.transfer = Transfer::Nothing;
            self.profiles.requested = None;
            let taken = profiler.push(sweep, carrier, first, samples);
            self.profiles.count(taken);
        }
        Ok(())
    }

    pub(super) fn ask_for_profile(&mut self, sweep: u32) -> Result<(), Refusal> {
        if !self.profiles.is_configured() {
            return Err(Refusal::NotConfigured);
        }
        if self.state != State::Running {
            return Err(Refusal::NotRunning);
        }
        self.profiles.requested = Some(sweep);
        Ok(())
    }

    /// Compute the requested profile, unless one is being sent.
    pub(super) fn work_on_profiles(&mut self) -> bool {
        if !matches!(self.transfer, Transfer::Nothing) {
            return false;
        }
        if let (Some(sweep), Some(profiler)) =
            (self.profiles.requested.take(), &mut self.profiles.profiler)
        {
            if profiler.finish(sweep).is_ok() {
                self.transfer = Transfer::ProfileStart;
            } else {
                // The sweep is behind: a status informs the host of the current one.
                self.due.status = true;
            }
            return true;
        }
        if self.state == State::Finishing {
            self.stop_profiles();
            self.due.status = true;
        }
        false
    }

    pub(super) fn stop_profiles(&mut self) {
        if let Some(profiler) = &mut self.profiles.profiler {
            profiler.stop();
        }
        self.profiles.requested = None;
        self.transfer = Transfer::Nothing;
        self.state = State::Done;
    }

    pub(super) fn next_of_profile(&mut self, transfer: Transfer) -> Transfer {
        let Some(header) = self.profiles.header(self.row.len()) else {
            return Transfer::Nothing;
        };
        let (profile, rows) = (self.maps, header.num_rows());
        let next_row = |row: u16, checksum| match row < rows {
            true => Transfer::ProfileRow { row, checksum },
            false => Transfer::ProfileEnd { checksum },
        };
        match transfer {
            Transfer::ProfileRow { row, mut checksum } => {
                let width = usize::from(header.row_bins);
                let all = self.profiles.profiler.as_ref();
                let values = all.and_then(|own| own.profile()).and_then(|own| {
                    let start = usize::from(row).checked_mul(width)?;
                    own.values.get(start..start.checked_add(width)?)
                });
                if let Some(samples) = values.and_then(|own| write_complex32s(own, self.row)) {
                    checksum.add_row(samples);
                    let report = Report::ProfileRow {
                        profile,
                        row,
                        samples,
                    };
                    self.pending = send(&mut self.encoder, self.frame, &report);
                }
                next_row(row.saturating_add(1), checksum)
            }
            Transfer::ProfileEnd { checksum } => {
                let report = Report::ProfileEnd {
                    profile,
                    rows,
                    crc: checksum.value(),
                };
                self.pending = send(&mut self.encoder, self.frame, &report);
                self.maps = self.maps.saturating_add(1);
                Transfer::Nothing
            }
            _ => {
                let report = Report::ProfileStart { profile, header };
                self.pending = send(&mut self.encoder, self.frame, &report);
                next_row(0, TransferChecksum::new(&header))
            }
        }
    }
}
