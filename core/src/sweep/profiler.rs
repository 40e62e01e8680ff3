//! The whole: bursts of both channels in, a profile a sweep out, in a fixed set of buffers.

use core::fmt;

use num_complex::{Complex, Complex32};

use super::setup::{Quantity, Setup, SetupError};
use super::tone::Mixer;
use crate::{Turns, fft};

/// A burst of which less came is left out.
const LEAST_WHOLE: f32 = 0.5;
/// A reference that is off its tone by more is no reference.
const USELESS: f32 = 0.3;

/// Why samples were not taken. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BurstError {
    /// There is no run.
    NotStarted,
    /// The sweep is behind.
    Repeated,
    /// There is no such carrier.
    Carrier,
    /// There are no samples, or more than a burst has.
    Length,
}

/// A profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepProfile<'p> {
    /// Number of the sweep.
    pub sweep: u32,
    /// Carriers that it is made of.
    pub usable: u16,
    /// Samples of each channel that came, in all bursts.
    pub taken: u32,
    /// `R` values; none if there were less than two carriers of three.
    pub values: &'p [Complex32],
}

/// A carrier of the sweep in hand.
#[derive(Clone, Copy, Debug)]
struct Step {
    is_there: bool,
    value: Complex32,
    unsteady: f32,
}

impl Step {
    /// What fills empty storage.
    const EMPTY: Self = Self {
        is_there: false,
        value: Complex32::ZERO,
        unsteady: 0.0,
    };
}

/// Where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Not of a run.
    Stopped,
    /// A sweep is to come, or its bursts are coming.
    Collecting,
    /// The profile of the sweep is there.
    Done,
}

/// Takes sweeps of up to `CARRIERS` carriers, of tones of up to `PERIOD` samples a period, and makes profiles of up to `BINS` bins.
///
/// Made to be a static. **Memory** [`Profiler::BYTES`]: `24 P + 20 N + 8 R` and some 600 bytes.
#[derive(Clone, Debug)]
pub struct Profiler<const PERIOD: usize, const CARRIERS: usize, const BINS: usize> {
    setup: Setup,
    mixer: Mixer<PERIOD>,
    weights: [f32; CARRIERS],
    steps: [Step; CARRIERS],
    row: [Complex32; BINS],
    stage: Stage,
    sweep: u32,
    /// Carrier of the burst in hand, if there is one, and the number of its next sample.
    is_open: bool,
    carrier: u16,
    next: u32,
    taken: u32,
    /// Carriers of the profile that is there.
    usable: u16,
    /// Bursts of the run that were left out.
    left_out: u32,
}

impl<const PERIOD: usize, const CARRIERS: usize, const BINS: usize>
    Profiler<PERIOD, CARRIERS, BINS>
{
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Empty buffers.
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

    /// Sets what stays the same; a run that is going on is over, and weights are zero until they are set.
    ///
    /// # Errors
    /// [`SetupError`]; nothing has changed then.
    pub fn configure(&mut self, setup: &Setup) -> Result<(), SetupError> {
        setup.check(PERIOD, CARRIERS, BINS)?;
        self.setup = *setup;
        self.mixer.configure(setup.period, setup.samples);
        self.weights = [0.0; CARRIERS];
        self.stage = Stage::Stopped;
        Ok(())
    }

    /// What was configured.
    pub fn setup(&self) -> Option<&Setup> {
        (self.setup.carriers > 0).then_some(&self.setup)
    }

    /// Sets weights from carrier `first` on. A scatterer reads their sum.
    ///
    /// # Errors
    /// [`SetupError::Size`] beyond the carriers, [`SetupError::NotFinite`]; nothing has changed then.
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

    /// Begins a run with sweep `first`. False if nothing is configured.
    pub fn start(&mut self, first: u32) -> bool {
        if self.setup.carriers == 0 {
            return false;
        }
        self.begin(first);
        self.left_out = 0;
        true
    }

    /// Ends the run; what is held is dropped.
    pub fn stop(&mut self) {
        self.stage = Stage::Stopped;
    }

    /// The sweep in hand, or that which is to come, or whose profile is there.
    pub fn sweep(&self) -> u32 {
        self.sweep
    }

    /// Bursts of the run that were left out: too little came of them, or they were unsteady.
    pub fn left_out(&self) -> u32 {
        self.left_out
    }

    /// Takes samples of both channels, reference and echo, of a burst at carrier `carrier` in sweep `sweep`, from sample `first` of the burst on. A burst ends with its last sample, or where another begins;
    /// one that begins at the carrier of the one before begins with sample 0 or one that is behind. Samples of the next sweep, or of one whose profile is there, begin it anew.
    ///
    /// # Errors
    /// [`BurstError`].
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
        let goes_on = self.is_open && carrier == self.carrier && first >= self.next;
        if !goes_on {
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

    /// Ends a sweep and makes its profile; the same again if it is there. A sweep of which nothing came has one too, of no carrier.
    ///
    /// # Errors
    /// [`BurstError::NotStarted`]; [`BurstError::Repeated`] for a sweep that is behind.
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

    /// The profile that is there.
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

    /// Keeps what the burst in hand told, if it is better than what there is of its carrier.
    fn end_burst(&mut self) {
        if !core::mem::take(&mut self.is_open) {
            return;
        }
        let mixed = self.mixer.mixed();
        let good = mixed.filter(|own| own.whole >= LEAST_WHOLE && own.unsteady <= USELESS);
        let (Some(own), Some(step)) = (good, self.steps.get_mut(usize::from(self.carrier))) else {
            self.left_out = self.left_out.saturating_add(1);
            return;
        };
        if !step.is_there || own.unsteady < step.unsteady {
            *step = Step {
                is_there: true,
                value: own.value,
                unsteady: own.unsteady,
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
            // Backwards: the transform is a forward one.
            if let Some(place) = row.get_mut(bins.wrapping_sub(n) & bins.wrapping_sub(1)) {
                *place = step.value * *weight;
            }
        }
        fft::forward(row);
        let turn = Turns::from_f64(self.setup.start_hz / (self.setup.step_hz * bins as f64));
        for (l, value) in (0..).zip(row) {
            *value *= turn.times(l).phasor();
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
            Self::NotStarted => "no run is going on",
            Self::Repeated => "the sweep is behind",
            Self::Carrier => "there is no such carrier",
            Self::Length => "there are no samples, or more than a burst has",
        })
    }
}

impl core::error::Error for BurstError {}
