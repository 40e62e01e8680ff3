//! A sweep of a recording: its steps as they were mixed, and the echo over its reference.

use num_complex::Complex64;
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;

use super::error::ProfileError;
use super::gaps;
use super::transform::Profile;
use crate::antennas::Reference;
use crate::sigmf::{Recording, Setup};
use crate::tone::{Mixed, Tone};
use crate::transceiver::Sample;
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// A reference that is off its tone by more, as [`crate::tone`] measures it, is no reference.
const USELESS: f64 = 0.3;

/// Both channels over the carriers of a sweep, each step but for the phase that its synthesisers had.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// Frequency of step 0, hertz: carrier and tone.
    pub start_hz: f64,
    /// From step to step, hertz.
    pub step_hz: f64,
    /// What a burst of each carrier came to; `None` where it was left out.
    pub mixed: Vec<Option<Mixed>>,
    /// Device times of the middles of these bursts, seconds; 0 where there is none.
    pub times_s: Vec<f64>,
}

impl Steps {
    /// No step of a sweep yet.
    pub fn empty(setup: &Setup) -> Self {
        let band = setup.band();
        Self {
            start_hz: band.start_hz,
            step_hz: band.step_hz,
            mixed: vec![None; band.count],
            times_s: vec![0.0; band.count],
        }
    }

    /// Takes a burst of carrier `step` whose middle was at `time_s`, unless it is of no use or a better one is there.
    ///
    /// # Panics
    /// If there is no such carrier.
    pub fn take(&mut self, step: usize, burst: Mixed, time_s: f64) {
        let better = self.mixed[step].is_none_or(|there| burst.unsteady < there.unsteady);
        if burst.whole >= 0.5 && burst.unsteady <= USELESS && better {
            self.mixed[step] = Some(burst);
            self.times_s[step] = time_s;
        }
    }

    /// Mixes every step of a sweep of a recording; the best of several bursts of a carrier.
    ///
    /// # Errors
    /// If there is no such sweep, or it cannot be read.
    pub fn read(recording: &mut Recording, sweep: u64) -> Result<Self, ProfileError> {
        // Sweeps follow one another in a recording.
        let first = recording.steps().partition_point(|step| step.sweep < sweep);
        let end = recording
            .steps()
            .partition_point(|step| step.sweep <= sweep);
        if first >= end {
            return Err(ProfileError::NoSweep(sweep));
        }
        let setup = recording.setup();
        let rate_hz = setup.sample_rate_hz;
        let tone = Tone::new(setup.period, rate_hz);
        let mut steps = Self::empty(setup);
        let mut channels: [Vec<Sample>; 2] = Default::default();
        for index in first..end {
            recording.read(index, &mut channels)?;
            let step = &recording.steps()[index];
            let lost: Vec<_> = step.lost.iter().map(|&(from, to)| from..to).collect();
            if let Some(burst) = tone.mix([&channels[0], &channels[1]], &lost) {
                let middle_s = step.time_s + 0.5 * step.samples as f64 / rate_hz;
                steps.take(step.step, burst, middle_s);
            }
        }
        Ok(steps)
    }

    /// The echo of channel 1 over channel 0, or by itself.
    pub fn over(&self, reference: Reference) -> Sweep {
        let value = |burst: &Mixed| match reference {
            Reference::None => burst.unreferred,
            Reference::Loopback | Reference::Leakage => burst.value,
        };
        Sweep {
            values: self
                .mixed
                .iter()
                .map(|burst| burst.as_ref().map(value))
                .collect(),
            ..self.empty_sweep()
        }
    }

    /// These carriers with no values.
    pub(super) fn empty_sweep(&self) -> Sweep {
        Sweep {
            start_hz: self.start_hz,
            step_hz: self.step_hz,
            values: vec![None; self.mixed.len()],
            times_s: self.times_s.clone(),
        }
    }
}

/// The scene's response over the carriers of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Frequency of value 0, hertz: carrier and tone.
    pub start_hz: f64,
    /// From value to value, hertz.
    pub step_hz: f64,
    /// Echo over reference; `None` where a step was left out.
    pub values: Vec<Option<Complex64>>,
    /// Device times of the middles of the steps, seconds; 0 where there is none.
    pub times_s: Vec<f64>,
}

impl Sweep {
    /// Mixes every step of a sweep of a recording: channel 1 over channel 0, or with [`Reference::None`] by itself. What is referred to a leakage is of both
    /// channels: [`super::Ranging`].
    ///
    /// # Errors
    /// If there is no such sweep, or it cannot be read.
    pub fn read(
        recording: &mut Recording,
        sweep: u64,
        reference: Reference,
    ) -> Result<Self, ProfileError> {
        Ok(Steps::read(recording, sweep)?.over(reference))
    }

    /// Carriers that are there.
    pub fn usable(&self) -> usize {
        self.values.iter().flatten().count()
    }

    /// The carriers that are there, with their times, seconds of the device's.
    pub fn moments(&self) -> impl Iterator<Item = (usize, f64)> {
        let there = |(n, value): (usize, &Option<Complex64>)| value.map(|_| (n, self.times_s[n]));
        self.values.iter().enumerate().filter_map(there)
    }

    /// Frequency of value `n`, hertz.
    pub fn frequency_hz(&self, n: usize) -> f64 {
        self.start_hz + n as f64 * self.step_hz
    }

    /// The sweep as a radar that stands still would have it: what was `path_m(t)` at the time of each carrier is taken for `path_m` of the first number.
    /// Exact for what lies where `path_m` is of; of another place the difference of both paths' changes is left.
    #[must_use]
    pub fn compensated(&self, at_m: f64, path_m: impl Fn(f64) -> f64) -> Self {
        let turned = |(n, value): (usize, &Option<Complex64>)| {
            value.map(|z| {
                let later_m = path_m(self.times_s[n]) - at_m;
                z * phasor(self.frequency_hz(n) * later_m / SPEED_OF_LIGHT_M_S)
            })
        };
        Self {
            values: self.values.iter().enumerate().map(turned).collect(),
            ..self.clone()
        }
    }

    /// Whether it can be filled: two of three carriers are there.
    ///
    /// # Errors
    /// How many are.
    pub fn check(&self) -> Result<(), ProfileError> {
        let (left, steps) = (self.usable(), self.values.len());
        match 3 * left < 2 * steps {
            true => Err(ProfileError::TooFew { left, steps }),
            false => Ok(()),
        }
    }

    /// The response with all carriers, those left out filled as [`gaps`] says for echoes up to `reach_m`.
    ///
    /// # Errors
    /// If more than a third is missing; if `reach_m` is not between 0 and the unambiguous range.
    pub fn filled(&self, reach_m: f64) -> Result<Vec<Complex64>, ProfileError> {
        self.check()?;
        gaps::fill(&self.values, self.step_hz, reach_m).map_err(ProfileError::Options)
    }

    /// The range profile, at some `fineness` places a resolution cell, of echoes up to `reach_m`.
    ///
    /// # Errors
    /// As [`Self::filled`].
    pub fn profile(
        &self,
        window: Window,
        fineness: usize,
        reach_m: f64,
    ) -> Result<Profile, ProfileError> {
        let values = self.filled(reach_m)?;
        Ok(Profile::new(
            &values,
            self.start_hz,
            self.step_hz,
            window,
            fineness,
        ))
    }
}
