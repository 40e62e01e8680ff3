//! Odometer: samples of all channels in, one motion increment per pulse out, in fixed buffers.

use core::fmt;

use num_complex::Complex32;

use super::echo::{Candidate, Measurement, Moments, ROUNDS, Residual};
use super::follow::Tracker;
use super::profile::{Detector, Peak, compress};
use super::setup::Axis;
use super::{Antennas, Echo, MotionError, MotionEstimate, Pairwise, Setup, SetupError};
use crate::{SPEED_OF_LIGHT_M_S, Turns, Window};

/// Result of one pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Pulse number.
    pub pulse: u32,
    /// Number of the earlier pulse that the motion is relative to. Equal to `pulse` for the first pulse of a run.
    pub since: u32,
    /// Estimated motion. `None` for the first pulse, and if fewer than two targets in different directions are common to both
    /// pulses; the next motion is then relative to this pulse. Also `None` if an echo's values are not finite; the next motion
    /// is then relative to `since`.
    pub moved: Option<MotionEstimate>,
    /// Number of tracked targets in this pulse, without unresolved close ones.
    pub targets: u16,
    /// Number of echoes in this pulse, tracked or not.
    pub echoes: u16,
}

/// Result of one call of [`Odometer::work`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// No pulse is complete; nothing was done.
    Idle,
    /// One step was done; more are needed.
    Busy,
    /// The pulse is complete.
    Step(Step),
}

/// Reason why samples were rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SampleError {
    /// No run is active: call [`Odometer::start`] first.
    NotStarted,
    /// The previous pulse is still being processed.
    Busy,
    /// The pulse number is behind, or this channel of the pulse was received before.
    Repeated,
    /// The channel index is not below the number of channels.
    Channel,
    /// The number of samples differs from the frequencies of the setup.
    Length,
    /// A sample or the reference path is not finite. The pulse is discarded.
    NotFinite,
}

/// Settings and derived values of a run.
#[derive(Clone, Debug)]
struct Ready<const TARGETS: usize, const CHANNELS: usize> {
    setup: Setup,
    axis: Axis,
    detector: Detector,
    moments: Moments,
    channels: usize,
    pairwise: Pairwise<TARGETS, CHANNELS>,
}

impl<const TARGETS: usize, const CHANNELS: usize> Ready<TARGETS, CHANNELS> {
    /// All bytes zero, so that a static takes no flash memory.
    const EMPTY: Self = Self {
        setup: Setup::EMPTY,
        axis: Axis::EMPTY,
        detector: Detector::EMPTY,
        moments: Moments::EMPTY,
        channels: 0,
        pairwise: Pairwise::EMPTY,
    };
}

/// Next processing step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No run active.
    Stopped,
    /// Collecting samples.
    Collect,
    Profile(usize),
    Search,
    Refine {
        round: u8,
        target: usize,
    },
    Estimate,
}

/// Odometer for up to `CHANNELS` channels of up to `FREQUENCIES` samples, up to `TARGETS` targets and range profiles of up
/// to `BINS` bins.
///
/// Intended as a static. **Memory**: [`Odometer::BYTES`], `8 C F + 4 F + 12 R` plus some hundred bytes per target.
#[derive(Clone, Debug)]
pub struct Odometer<
    const TARGETS: usize,
    const CHANNELS: usize,
    const FREQUENCIES: usize,
    const BINS: usize,
> {
    is_ready: bool,
    ready: Ready<TARGETS, CHANNELS>,
    samples: [[Complex32; FREQUENCIES]; CHANNELS],
    weights: [f32; FREQUENCIES],
    /// Range profile, and later phasors.
    row: [Complex32; BINS],
    power: [f32; BINS],
    candidates: [Candidate<CHANNELS>; TARGETS],
    num_candidates: usize,
    tracker: Tracker<TARGETS, CHANNELS>,
    stage: Stage,
    /// Current pulse and the channels received of it.
    pulse: u32,
    received: [bool; CHANNELS],
    /// Previous pulse, and the pulse that the next motion is relative to.
    before: Option<u32>,
    since: Option<u32>,
    /// Number of pulses with missing channels.
    incomplete: u32,
}

impl<const TARGETS: usize, const CHANNELS: usize, const FREQUENCIES: usize, const BINS: usize>
    Odometer<TARGETS, CHANNELS, FREQUENCIES, BINS>
{
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create an odometer without configuration. All bytes are zero except the initial state.
    pub const fn new() -> Self {
        Self {
            is_ready: false,
            ready: Ready::EMPTY,
            samples: [[Complex32::ZERO; FREQUENCIES]; CHANNELS],
            weights: [0.0; FREQUENCIES],
            row: [Complex32::ZERO; BINS],
            power: [0.0; BINS],
            candidates: [Candidate::at(0.0); TARGETS],
            num_candidates: 0,
            tracker: Tracker::new(),
            stage: Stage::Stopped,
            pulse: 0,
            received: [false; CHANNELS],
            before: None,
            since: None,
            incomplete: 0,
        }
    }

    /// Set settings and antennas of the next run. Ends the current run.
    ///
    /// Channels are ordered with transmitters outermost and receivers innermost. The wavelength at the middle of the band is
    /// used instead of that of `antennas`.
    ///
    /// # Errors
    /// [`SetupError`]; the odometer is then unchanged.
    pub fn configure(&mut self, setup: &Setup, antennas: &Antennas<'_>) -> Result<(), SetupError> {
        let axis = setup.axis(FREQUENCIES, BINS)?;
        let antennas = Antennas {
            wavelength_m: axis.wavelength_m,
            ..*antennas
        };
        let channels = antennas.transmitters_m.len() * antennas.receivers_m.len();
        let pairwise =
            Pairwise::new(&antennas).map_err(|error| SetupError::of_antennas(error, CHANNELS))?;
        let window = Window::Taylor {
            side_lobe_db: setup.side_lobe_db,
        };
        let (Some(weights), Some(row), Some(power)) = (
            self.weights.get_mut(..axis.frequencies),
            self.row.get_mut(..axis.bins),
            self.power.get_mut(..axis.bins),
        ) else {
            return Err(SetupError::Window);
        };
        window.fill(weights).map_err(|_| SetupError::Window)?;
        let detector = Detector::new(setup, &axis, channels, weights, row, power);
        self.is_ready = true;
        self.ready = Ready {
            setup: *setup,
            axis,
            detector,
            moments: Moments::new(weights),
            channels,
            pairwise,
        };
        self.stage = Stage::Stopped;
        Ok(())
    }

    /// Current settings, or `None` before [`Odometer::configure`].
    pub fn setup(&self) -> Option<&Setup> {
        self.is_ready.then_some(&self.ready.setup)
    }

    /// Number of channels per pulse; 0 before [`Odometer::configure`].
    pub fn channels(&self) -> usize {
        self.ready.channels
    }

    /// Start a run with pulse number `first`. Returns false if not configured.
    pub fn start(&mut self, first: u32) -> bool {
        if !self.is_ready {
            return false;
        }
        self.ready.pairwise.forget();
        self.tracker = Tracker::new();
        self.stage = Stage::Collect;
        self.pulse = first;
        self.received = [false; CHANNELS];
        self.before = None;
        self.since = None;
        self.incomplete = 0;
        true
    }

    /// End the run and discard the current pulse.
    pub fn stop(&mut self) {
        self.stage = Stage::Stopped;
    }

    /// Number of the current or next expected pulse.
    pub fn pulse(&self) -> u32 {
        self.pulse
    }

    /// Whether samples are accepted.
    pub fn is_collecting(&self) -> bool {
        self.stage == Stage::Collect
    }

    /// Number of pulses of the run that were incomplete: some channels received, but not all.
    pub fn incomplete(&self) -> u32 {
        self.incomplete
    }

    /// Add the samples of one channel, phase-referenced to `reference_path_m`. The last channel completes the pulse. A channel
    /// of a later pulse discards an incomplete earlier one.
    ///
    /// # Errors
    /// [`SampleError`]; the state is unchanged except for [`SampleError::NotFinite`].
    pub fn push(
        &mut self,
        pulse: u32,
        channel: usize,
        reference_path_m: f64,
        samples: impl ExactSizeIterator<Item = Complex32>,
    ) -> Result<(), SampleError> {
        let ready = &self.ready;
        match self.stage {
            Stage::Stopped => return Err(SampleError::NotStarted),
            Stage::Collect => {}
            _ => return Err(SampleError::Busy),
        }
        if channel >= ready.channels {
            return Err(SampleError::Channel);
        }
        if samples.len() != ready.axis.frequencies {
            return Err(SampleError::Length);
        }
        let received = self.received.get(channel).copied().unwrap_or(false);
        if pulse < self.pulse || (pulse == self.pulse && received) {
            return Err(SampleError::Repeated);
        }
        if pulse > self.pulse {
            let begun = self.received.contains(&true);
            self.incomplete = self.incomplete.saturating_add(begun.into());
            self.pulse = pulse;
            self.received = [false; CHANNELS];
        }
        // Undo the phase reference, if there is one.
        let referenced = reference_path_m != 0.0;
        let turns = |hz: f64| Turns::from_f64(-hz * (reference_path_m / SPEED_OF_LIGHT_M_S));
        let mut phase = turns(ready.setup.start_hz);
        let step = turns(ready.setup.step_hz);
        let mut finite = reference_path_m.is_finite();
        if let Some(row) = self.samples.get_mut(channel) {
            for (place, sample) in row.iter_mut().zip(samples) {
                finite &= sample.re.is_finite() && sample.im.is_finite();
                *place = sample;
                if referenced {
                    *place *= phase.phasor();
                    phase = phase.plus(step);
                }
            }
        }
        if !finite {
            self.incomplete = self.incomplete.saturating_add(1);
            self.received = [false; CHANNELS];
            self.pulse = pulse.saturating_add(1);
            return Err(SampleError::NotFinite);
        }
        if let Some(received) = self.received.get_mut(channel) {
            *received = true;
        }
        if self
            .received
            .iter()
            .take(ready.channels)
            .all(|received| *received)
        {
            self.stage = Stage::Profile(0);
        }
        Ok(())
    }

    /// Do one step: a channel's range profile, the CFAR search, one target refinement, or the motion estimate.
    pub fn work(&mut self) -> Progress {
        let ready = &self.ready;
        let axis = &ready.axis;
        let (frequencies, bins) = (axis.frequencies, axis.bins);
        let (Some(weights), Some(row), Some(power), Some(samples)) = (
            self.weights.get(..frequencies),
            self.row.get_mut(..bins),
            self.power.get_mut(..bins),
            self.samples.get_mut(..ready.channels),
        ) else {
            return Progress::Idle;
        };
        self.stage = match self.stage {
            Stage::Stopped | Stage::Collect => return Progress::Idle,
            Stage::Profile(channel) => {
                if let Some(samples) = samples.get(channel) {
                    let weighted = samples.iter().zip(weights).map(|(z, w)| z * *w);
                    compress(axis, weighted, row);
                }
                for (sum, z) in power.iter_mut().zip(row.iter()) {
                    let before = if channel == 0 { 0.0 } else { *sum };
                    *sum = before + z.norm_sqr();
                }
                match channel + 1 {
                    next if next < ready.channels => Stage::Profile(next),
                    _ => Stage::Search,
                }
            }
            Stage::Search => {
                let mut peaks = [Peak::EMPTY; TARGETS];
                self.num_candidates = ready.detector.search(axis, power, &mut peaks);
                for (candidates, peak) in self.candidates.iter_mut().zip(&peaks) {
                    *candidates = Candidate::at(peak.cells);
                }
                match self.num_candidates {
                    0 => Stage::Estimate,
                    _ => Stage::Refine {
                        round: 0,
                        target: 0,
                    },
                }
            }
            Stage::Refine { round, target } => {
                let mut residual = Residual {
                    axis,
                    samples,
                    weights,
                    phasors: row.get_mut(..frequencies).unwrap_or(&mut []),
                };
                if let Some(candidates) = self.candidates.get_mut(target) {
                    residual.refine(candidates);
                }
                match (round, target + 1) {
                    (_, target) if target < self.num_candidates => Stage::Refine { round, target },
                    (round, _) if round + 1 < ROUNDS => Stage::Refine {
                        round: round + 1,
                        target: 0,
                    },
                    _ => Stage::Estimate,
                }
            }
            Stage::Estimate => return Progress::Step(self.estimate()),
        };
        Progress::Busy
    }

    /// Track the targets of the pulse and estimate the motion.
    fn estimate(&mut self) -> Step {
        let (pulse, since) = (self.pulse, self.since.unwrap_or(self.pulse));
        let before = self.before.unwrap_or(pulse);
        let (measurements, echoes) = self.measurements();
        let measurements = measurements.get(..echoes).unwrap_or(&[]);
        let mut echoes_of_targets = [Echo {
            target: 0,
            range_m: 0.0,
            phases_rad: [0.0; CHANNELS],
            phase_sigma_rad: 0.0,
        }; TARGETS];
        let ready = &mut self.ready;
        let all = (pulse.wrapping_sub(before), ready.channels);
        let targets = (self.tracker).push(
            &ready.setup.follow,
            measurements,
            all,
            &mut echoes_of_targets,
        );
        let echoes_of_targets = echoes_of_targets.get_mut(..targets).unwrap_or(&mut []);
        for echo in echoes_of_targets.iter_mut() {
            echo.range_m *= ready.axis.cell_m;
        }
        let echoes_of_targets = ready
            .pairwise
            .push_after(echoes_of_targets, pulse.wrapping_sub(since));
        // With too few targets the next motion is relative to this pulse. After any other error the pulse is ignored.
        let (moved, from) = match echoes_of_targets {
            Ok(moved) => (moved, Some(pulse)),
            Err(MotionError::TooLittle) => (None, Some(pulse)),
            Err(_) => (None, self.since),
        };
        (self.before, self.since) = (Some(pulse), from);
        self.pulse = pulse.saturating_add(1);
        self.received = [false; CHANNELS];
        self.stage = Stage::Collect;
        Step {
            pulse,
            since,
            moved,
            targets: targets as u16,
            echoes: echoes as u16,
        }
    }

    /// Measurements within the range limits, strongest first, and their number.
    fn measurements(&mut self) -> ([Measurement<CHANNELS>; TARGETS], usize) {
        let (mut measurements, mut count) = ([Measurement::EMPTY; TARGETS], 0);
        let ready = &self.ready;
        let axis = &ready.axis;
        let (Some(weights), Some(phasors), Some(samples)) = (
            self.weights.get(..axis.frequencies),
            self.row.get_mut(..axis.frequencies),
            self.samples.get_mut(..ready.channels),
        ) else {
            return (measurements, 0);
        };
        let mut residual = Residual {
            axis,
            samples,
            weights,
            phasors,
        };
        let noise: [f32; CHANNELS] = residual.noise(self.num_candidates);
        let [near, far] = axis.ranges_cells;
        let least = libm::exp10(0.1 * ready.setup.least_snr_db) as f32;
        let cells = axis.frequencies as f64;
        for candidates in self.candidates.iter().take(self.num_candidates) {
            let mut own = residual.measured(candidates, &noise, &ready.moments);
            // A maximum outside the peak's own cell is the side of a target beyond.
            let is_own = libm::fabs(own.cells - candidates.peak_cells) < 0.5;
            // Peaks are counted from the first bin at or beyond the nearest range. An echo between the nearest range and that bin appears one unambiguous range too far, and one just before the nearest range appears at the near end.
            let turned = match own.cells {
                u if u < near => cells,
                u if u >= near + cells => -cells,
                _ => 0.0,
            };
            if turned != 0.0 {
                own.cells += turned;
                own.shift_phases(axis.frequencies);
            }
            if is_own
                && own.cells <= far
                && own.least_snr >= least
                && let Some(place) = measurements.get_mut(count)
            {
                *place = own;
                count += 1;
            }
        }
        (measurements, count)
    }
}

impl<const TARGETS: usize, const CHANNELS: usize, const FREQUENCIES: usize, const BINS: usize>
    Default for Odometer<TARGETS, CHANNELS, FREQUENCIES, BINS>
{
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for SampleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotStarted => "no run is active: start one before pushing samples",
            Self::Busy => {
                "previous pulse is still being processed: call work() until it is complete"
            }
            Self::Repeated => {
                "pulse number is behind, or this channel of the pulse was received before"
            }
            Self::Channel => "channel index is not below the number of channels",
            Self::Length => "number of samples differs from the frequencies of the setup",
            Self::NotFinite => "a sample or the reference path is not finite",
        })
    }
}

impl core::error::Error for SampleError {}
