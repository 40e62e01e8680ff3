//! Range profiler: bursts of both channels in, one profile per sweep out, in fixed buffers.

use core::fmt;

use num_complex::{Complex, Complex32};

use super::setup::{Quantity, Setup, SetupError};
use super::tone::Mixer;
use crate::{Turns, fft};

/// Minimum fraction of a burst that must be received.
const MIN_COMPLETE: f32 = 0.5;
/// Maximum deviation of a reference from a steady tone.
const MAX_UNSTEADINESS: f32 = 0.3;

/// Reason why samples were rejected. The profiler is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BurstError {
    /// No run is active: call [`Profiler::start`] first.
    NotStarted,
    /// The sweep number is behind.
    Repeated,
    /// The carrier index is not below the number of carriers.
    Carrier,
    /// No samples, or samples beyond the end of the burst.
    Length,
}

/// Range profile of one sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepProfile<'p> {
    /// Sweep number.
    pub sweep: u32,
    /// Number of carriers used.
    pub usable: u16,
    /// Number of samples received per channel in all bursts.
    pub taken: u32,
    /// Range profile, `R` values. Empty if fewer than two thirds of the carriers are usable.
    pub values: &'p [Complex32],
}

/// Carrier of the current sweep.
#[derive(Clone, Copy, Debug)]
struct Step {
    is_there: bool,
    value: Complex32,
    unsteadiness: f32,
}

impl Step {
    /// Initial value of a buffer.
    const EMPTY: Self = Self {
        is_there: false,
        value: Complex32::ZERO,
        unsteadiness: 0.0,
    };
}

/// State of the profiler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No run active.
    Stopped,
    /// Collecting the bursts of a sweep.
    Collecting,
    /// The profile of the sweep is available.
    Done,
}

/// Range profiler for up to `CARRIERS` carriers per sweep, tones of up to `PERIOD` samples per period, and profiles of up to
/// `BINS` bins.
///
/// Intended as a static. **Memory**: [`Profiler::BYTES`], `24 P + 20 N + 8 R` plus some 600 bytes.
#[derive(Clone, Debug)]
pub struct Profiler<const PERIOD: usize, const CARRIERS: usize, const BINS: usize> {
    setup: Setup,
    mixer: Mixer<PERIOD>,
    weights: [f32; CARRIERS],
    steps: [Step; CARRIERS],
    row: [Complex32; BINS],
    stage: Stage,
    sweep: u32,
    /// Whether a burst is in progress, its carrier, and the index of its next sample.
    is_open: bool,
    carrier: u16,
    next: u32,
    taken: u32,
    /// Number of usable carriers in the available profile.
    usable: u16,
    /// Number of rejected bursts of the run.
    left_out: u32,
}

impl<const PERIOD: usize, const CARRIERS: usize, const BINS: usize>
    Profiler<PERIOD, CARRIERS, BINS>
{
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create a profiler without configuration.
    pub const fn new() -> Self {
        Self {
            setup: Setup::EMPTY,
            mixer: Mixer::new(),
            weights: [0.0; CARRIERS],
            steps: [Step::EMPTY; CARRIERS],
            row: [Complex32::ZERO; BINS],
            stage: Stage::Stopped,
            sweep: 0,
            is_open: false,
            carrier: 0,
            next: 0,
            taken: 0,
            usable: 0,
            left_out: 0,
        }
    }

    /// Set the settings of the next run. Ends the current run and sets all weights to zero.
    ///
    /// # Errors
    /// [`SetupError`]; the profiler is then unchanged.
    pub fn configure(&mut self, setup: &Setup) -> Result<(), SetupError> {
        setup.check(PERIOD, CARRIERS, BINS)?;
        self.setup = *setup;
        self.mixer.configure(setup.period, setup.samples);
        self.weights = [0.0; CARRIERS];
        self.stage = Stage::Stopped;
        Ok(())
    }

    /// Current settings, or `None` before [`Profiler::configure`].
    pub fn setup(&self) -> Option<&Setup> {
        (self.setup.carriers > 0).then_some(&self.setup)
    }

    /// Set window weights starting at carrier `first`. The value of a unit scatterer is their sum.
    ///
    /// # Errors
    /// [`SetupError::Size`] beyond the last carrier, [`SetupError::NotFinite`]; the weights are then unchanged.
    pub fn set_weights(
        &mut self,
        first: usize,
        weights: impl ExactSizeIterator<Item = f32> + Clone,
    ) -> Result<(), SetupError> {
        let end = first.saturating_add(weights.len());
        let carriers = self.setup.carriers;
        let own = self.weights.get_mut(..carriers.into());
        let Some(own) = own.and_then(|own| own.get_mut(first..end)) else {
            return Err(SetupError::Size {
                what: Quantity::Weights,
                wanted: u32::try_from(end).unwrap_or(u32::MAX),
                least: 0,
                most: carriers.into(),
            });
        };
        if !weights.clone().all(f32::is_finite) {
            return Err(SetupError::NotFinite);
        }
        own.iter_mut().zip(weights).for_each(|(to, w)| *to = w);
        Ok(())
    }

    /// Start a run with sweep number `first`. Returns false if not configured.
    pub fn start(&mut self, first: u32) -> bool {
        if self.setup.carriers == 0 {
            return false;
        }
        self.begin(first);
        self.left_out = 0;
        true
    }

    /// End the run and discard the current sweep.
    pub fn stop(&mut self) {
        self.stage = Stage::Stopped;
    }

    /// Number of the current or next expected sweep, or of the sweep whose profile is available.
    pub fn sweep(&self) -> u32 {
        self.sweep
    }

    /// Number of rejected bursts of the run: incomplete, or with an unsteady reference.
    pub fn left_out(&self) -> u32 {
        self.left_out
    }

    /// Add samples of reference and echo channel of the burst at carrier `carrier` in sweep `sweep`, from sample `first` of the
    /// burst on. A burst ends with its last sample or when another burst begins. A burst at the same carrier as the previous one
    /// begins with a sample index that is not ahead. Samples of a later sweep, or of the sweep whose profile is available, start
    /// that sweep again.
    ///
    /// # Errors
    /// [`BurstError`] states why the samples were rejected.
    pub fn push(
        &mut self,
        sweep: u32,
        carrier: u16,
        first: u32,
        samples: impl ExactSizeIterator<Item = [Complex<i16>; 2]>,
    ) -> Result<(), BurstError> {
        if self.stage == Stage::Stopped {
            return Err(BurstError::NotStarted);
        }
        if carrier >= self.setup.carriers {
            return Err(BurstError::Carrier);
        }
        let count = u32::try_from(samples.len()).unwrap_or(u32::MAX);
        let end = first.saturating_add(count);
        if count == 0 || end > self.setup.samples {
            return Err(BurstError::Length);
        }
        if sweep < self.sweep {
            return Err(BurstError::Repeated);
        }
        if sweep > self.sweep || self.stage == Stage::Done {
            self.begin(sweep);
        }
        let continues = self.is_open && carrier == self.carrier && first >= self.next;
        if !continues {
            self.end_burst();
            self.mixer.begin();
            (self.is_open, self.carrier) = (true, carrier);
        }
        self.taken = self.taken.saturating_add(count);
        self.next = end;
        self.mixer.push(first, samples);
        if end == self.setup.samples {
            self.end_burst();
        }
        Ok(())
    }

    /// End a sweep and compute its profile. Returns the same profile if it is already available. A sweep without samples has a
    /// profile of zero carriers.
    ///
    /// # Errors
    /// [`BurstError::NotStarted`] without a run; [`BurstError::Repeated`] if the sweep number is behind.
    pub fn finish(&mut self, sweep: u32) -> Result<SweepProfile<'_>, BurstError> {
        if self.stage == Stage::Stopped {
            return Err(BurstError::NotStarted);
        }
        if sweep < self.sweep {
            return Err(BurstError::Repeated);
        }
        if sweep > self.sweep {
            self.begin(sweep);
        }
        if self.stage == Stage::Collecting {
            self.end_burst();
            self.compress();
            self.stage = Stage::Done;
        }
        self.profile().ok_or(BurstError::NotStarted)
    }

    /// Available profile, if any.
    pub fn profile(&self) -> Option<SweepProfile<'_>> {
        if self.stage != Stage::Done {
            return None;
        }
        let enough = 3 * u32::from(self.usable) >= 2 * u32::from(self.setup.carriers);
        let bins = if enough { self.setup.bins.into() } else { 0 };
        Some(SweepProfile {
            sweep: self.sweep,
            usable: self.usable,
            taken: self.taken,
            values: self.row.get(..bins)?,
        })
    }

    fn begin(&mut self, sweep: u32) {
        self.stage = Stage::Collecting;
        self.sweep = sweep;
        self.steps = [Step::EMPTY; CARRIERS];
        self.is_open = false;
        self.taken = 0;
        self.usable = 0;
    }

    /// Keep the current burst if it is better than the previous one at its carrier.
    fn end_burst(&mut self) {
        if !core::mem::take(&mut self.is_open) {
            return;
        }
        let mixed = self.mixer.mixed();
        let good = mixed
            .filter(|own| own.complete >= MIN_COMPLETE && own.unsteadiness <= MAX_UNSTEADINESS);
        let (Some(own), Some(step)) = (good, self.steps.get_mut(usize::from(self.carrier))) else {
            self.left_out = self.left_out.saturating_add(1);
            return;
        };
        if !step.is_there || own.unsteadiness < step.unsteadiness {
            *step = Step {
                is_there: true,
                value: own.value,
                unsteadiness: own.unsteadiness,
            };
        }
    }

    /// Window, inverse transform, and the first carrier's phase at each bin.
    fn compress(&mut self) {
        let bins = usize::from(self.setup.bins);
        let Some(row) = self.row.get_mut(..bins) else {
            return;
        };
        row.fill(Complex32::ZERO);
        let carriers = self.steps.iter().zip(&self.weights);
        self.usable = 0;
        for (n, (step, weight)) in carriers.take(self.setup.carriers.into()).enumerate() {
            if !step.is_there {
                continue;
            }
            self.usable += 1;
            // Reversed order, since the transform is a forward one.
            if let Some(place) = row.get_mut(bins.wrapping_sub(n) & bins.wrapping_sub(1)) {
                *place = step.value * *weight;
            }
        }
        fft::forward(row);
        let phase_step = Turns::from_f64(self.setup.start_hz / (self.setup.step_hz * bins as f64));
        for (l, value) in (0..).zip(row) {
            *value *= phase_step.times(l).phasor();
        }
    }
}

impl<const PERIOD: usize, const CARRIERS: usize, const BINS: usize> Default
    for Profiler<PERIOD, CARRIERS, BINS>
{
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for BurstError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotStarted => "no run is active: start one before pushing bursts",
            Self::Repeated => "sweep number is behind the current sweep",
            Self::Carrier => "carrier index is not below the number of carriers",
            Self::Length => {
                "burst samples: expected at least one and none beyond the end of the burst"
            }
        })
    }
}

impl core::error::Error for BurstError {}
