//! Sweep of a recording: mixed steps, and their echo divided by the reference.

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

/// Deviation of the reference from a steady tone ([`crate::tone`]) above which a step is skipped.
const USELESS: f64 = 0.3;

/// Mixed values of both channels over the carriers of a sweep, up to the unknown synthesiser phase of each step.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// Frequency of step 0, hertz: carrier plus tone.
    pub start_hz: f64,
    /// Frequency step, hertz.
    pub step_hz: f64,
    /// Mixed burst of each carrier; `None` if skipped.
    pub mixed: Vec<Option<Mixed>>,
    /// Device times of the middles of the bursts, seconds; 0 if skipped.
    pub times_s: Vec<f64>,
}

impl Steps {
    /// Sweep without any steps yet.
    pub fn empty(setup: &Setup) -> Self {
        let band = setup.band();
        Self {
            start_hz: band.start_hz,
            step_hz: band.step_hz,
            mixed: vec![None; band.count],
            times_s: vec![0.0; band.count],
        }
    }

    /// Add a burst of carrier `step` whose middle is at `time_s`. It is ignored if it is unusable or a steadier one is
    /// present.
    ///
    /// # Panics
    /// If `step` is out of range.
    pub fn take(&mut self, step: usize, burst: Mixed, time_s: f64) {
        let better = self.mixed[step].is_none_or(|there| burst.unsteady < there.unsteady);
        if burst.whole >= 0.5 && burst.unsteady <= USELESS && better {
            self.mixed[step] = Some(burst);
            self.times_s[step] = time_s;
        }
    }

    /// Mix every step of a sweep of a recording, keeping the steadiest of several bursts at a carrier.
    ///
    /// # Errors
    /// If the sweep does not exist or cannot be read.
    pub fn read(recording: &mut Recording, sweep: u64) -> Result<Self, ProfileError> {
        // Sweeps are contiguous in a recording.
        let first = recording.steps().partition_point(|step| step.sweep < sweep);
        let end = recording
            .steps()
            .partition_point(|step| step.sweep <= sweep);
        if first >= end {
            return Err(ProfileError::NoSweep(sweep));
        }
        let setup = recording.setup();
        if setup.is_chirp() {
            return Err(ProfileError::Options(
                "recording of chirps: expected one of stepped carriers".to_owned(),
            ));
        }
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

    /// Channel 1 divided by channel 0; with [`Reference::None`], channel 1 alone.
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

    /// Sweep with these carriers and no values.
    pub(super) fn empty_sweep(&self) -> Sweep {
        Sweep {
            start_hz: self.start_hz,
            step_hz: self.step_hz,
            values: vec![None; self.mixed.len()],
            times_s: self.times_s.clone(),
        }
    }
}

/// Frequency response of the scene over the carriers of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Frequency of value 0, hertz: carrier plus tone.
    pub start_hz: f64,
    /// Frequency step, hertz.
    pub step_hz: f64,
    /// Echo divided by reference; `None` if the step was skipped.
    pub values: Vec<Option<Complex64>>,
    /// Device times of the middles of the steps, seconds; 0 if skipped.
    pub times_s: Vec<f64>,
}

impl Sweep {
    /// Read a sweep of a recording: channel 1 divided by channel 0, or alone with [`Reference::None`]. A leakage
    /// reference needs both channels; see [`super::Ranging`], which also reads chirps.
    ///
    /// # Errors
    /// If the sweep does not exist or cannot be read.
    pub fn read(
        recording: &mut Recording,
        sweep: u64,
        reference: Reference,
    ) -> Result<Self, ProfileError> {
        Ok(Steps::read(recording, sweep)?.over(reference))
    }

    /// Number of usable carriers.
    pub fn usable(&self) -> usize {
        self.values.iter().flatten().count()
    }

    /// Indices of the usable carriers with their device times, seconds.
    pub fn moments(&self) -> impl Iterator<Item = (usize, f64)> {
        let there = |(n, value): (usize, &Option<Complex64>)| value.map(|_| (n, self.times_s[n]));
        self.values.iter().enumerate().filter_map(there)
    }

    /// Frequency of value `n`, hertz.
    pub fn frequency_hz(&self, n: usize) -> f64 {
        self.start_hz + n as f64 * self.step_hz
    }

    /// Motion-compensated sweep: replaces the path `path_m(t)` at the time of each carrier by the constant path `at_m`,
    /// metres. Exact for the point to which `path_m` belongs; for other points the difference of the two path changes
    /// remains.
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

    /// Check that at least two thirds of the carriers are present, so that gaps can be interpolated.
    ///
    /// # Errors
    /// [`ProfileError::TooFew`] with the number of usable carriers.
    pub fn check(&self) -> Result<(), ProfileError> {
        let (left, steps) = (self.usable(), self.values.len());
        match 3 * left < 2 * steps {
            true => Err(ProfileError::TooFew { left, steps }),
            false => Ok(()),
        }
    }

    /// Response at all carriers, with missing ones interpolated as in [`gaps`] for echoes up to `reach_m`.
    ///
    /// # Errors
    /// If more than a third of the carriers is missing, or `reach_m` is not between 0 and the unambiguous range.
    pub fn filled(&self, reach_m: f64) -> Result<Vec<Complex64>, ProfileError> {
        self.check()?;
        gaps::fill(&self.values, self.step_hz, reach_m).map_err(ProfileError::Options)
    }

    /// Range profile with `fineness` samples per resolution cell, for echoes up to `reach_m`.
    ///
    /// # Errors
    /// Those of [`Self::filled`].
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
