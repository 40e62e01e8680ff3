//! The whole: samples of all channels in, an increment a pulse out, in a fixed set of buffers.

use core::fmt;

use num_complex::Complex32;

use super::echo::{Found, Look, Moments, ROUNDS, Seen};
use super::follow::Follower;
use super::profile::{Detector, Peak, compress};
use super::setup::Axis;
use super::{Antennas, Echo, MotionError, Moved, Pairwise, Setup, SetupError};
use crate::{SPEED_OF_LIGHT_M_S, Turns, Window};

/// What a pulse told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Its number.
    pub pulse: u32,
    /// That of the pulse from which the motion is told, or would be; of a run's first its own.
    pub since: u32,
    /// The motion. None of the first pulse, and where two targets in different directions were not seen in both; the next is told from this pulse on all the same. None too where an echo's numbers
    /// are none; the next is then told from where this would have been.
    pub moved: Option<Moved>,
    /// Targets seen in this pulse, near ones left out.
    pub targets: u16,
    /// Echoes in this pulse, of targets or not.
    pub echoes: u16,
}

/// What a piece of work did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// There was nothing to do.
    Idle,
    /// There is more to do.
    Busy,
    /// The pulse is done.
    Step(Step),
}

/// Why samples were not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SampleError {
    /// There is no run.
    NotStarted,
    /// The pulse before is still being worked on.
    Busy,
    /// The pulse is behind, or the channel of this pulse came before.
    Repeated,
    /// There is no such channel.
    Channel,
    /// Not one sample a frequency.
    Length,
    /// A sample or the reference path is no finite number. What came of the pulse is forgotten.
    NotFinite,
}

/// What stays the same for a run.
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
    /// Nothing but zeros, so that a static takes no flash.
    const EMPTY: Self = Self {
        setup: Setup::EMPTY,
        axis: Axis::EMPTY,
        detector: Detector::EMPTY,
        moments: Moments::EMPTY,
        channels: 0,
        pairwise: Pairwise::EMPTY,
    };
}

/// What is to be done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Not of a run.
    Stopped,
    /// Samples are coming.
    Collect,
    Profile(usize),
    Search,
    Refine {
        round: u8,
        target: usize,
    },
    Tell,
}

/// Takes pulses of up to `CHANNELS` channels of up to `FREQUENCIES` samples, finds up to `TARGETS` targets in profiles of up to `BINS` bins, and tells how the radar moved.
///
/// Made to be a static. **Memory** [`Odometer::BYTES`]: `8 C F + 4 F + 12 R`, and some hundred bytes a target.
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
    /// A profile, and phasors.
    row: [Complex32; BINS],
    power: [f32; BINS],
    found: [Found<CHANNELS>; TARGETS],
    num_found: usize,
    follower: Follower<TARGETS, CHANNELS>,
    stage: Stage,
    /// The pulse in hand, which of its channels came, and whether it is the first.
    pulse: u32,
    came: [bool; CHANNELS],
    /// The pulse before, and that from which the next motion is told.
    before: Option<u32>,
    since: Option<u32>,
    /// Pulses that did not come whole.
    incomplete: u32,
}

impl<const TARGETS: usize, const CHANNELS: usize, const FREQUENCIES: usize, const BINS: usize>
    Odometer<TARGETS, CHANNELS, FREQUENCIES, BINS>
{
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Empty buffers.
    pub const fn new() -> Self {
        Self {
            is_ready: false,
            ready: Ready::EMPTY,
            samples: [[Complex32::ZERO; FREQUENCIES]; CHANNELS],
            weights: [0.0; FREQUENCIES],
            row: [Complex32::ZERO; BINS],
            power: [0.0; BINS],
            found: [Found::at(0.0); TARGETS],
            num_found: 0,
            follower: Follower::new(),
            stage: Stage::Stopped,
            pulse: 0,
            came: [false; CHANNELS],
            before: None,
            since: None,
            incomplete: 0,
        }
    }

    /// Sets what stays the same; a run that is going on is over.
    ///
    /// Channels are transmitter by transmitter, receiver by receiver. The antennas' wavelength is that of the middle of the band, whatever is given.
    ///
    /// # Errors
    /// [`SetupError`]; nothing has changed then.
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

    /// What was configured.
    pub fn setup(&self) -> Option<&Setup> {
        self.is_ready.then_some(&self.ready.setup)
    }

    /// Channels of a pulse; 0 if nothing is configured.
    pub fn channels(&self) -> usize {
        self.ready.channels
    }

    /// Begins a run with pulse `first`. False if nothing is configured.
    pub fn start(&mut self, first: u32) -> bool {
        if !self.is_ready {
            return false;
        }
        self.ready.pairwise.forget();
        self.follower = Follower::new();
        self.stage = Stage::Collect;
        self.pulse = first;
        self.came = [false; CHANNELS];
        self.before = None;
        self.since = None;
        self.incomplete = 0;
        true
    }

    /// Ends the run; what is held is dropped.
    pub fn stop(&mut self) {
        self.stage = Stage::Stopped;
    }

    /// The pulse in hand, or that which is to come.
    pub fn pulse(&self) -> u32 {
        self.pulse
    }

    /// Whether samples are taken.
    pub fn is_collecting(&self) -> bool {
        self.stage == Stage::Collect
    }

    /// Pulses of the run of which some channels came, but not all.
    pub fn incomplete(&self) -> u32 {
        self.incomplete
    }

    /// Takes the samples of a channel of a pulse, compensated to a path. With the last channel the pulse is complete. Channels of a later pulse end the wait for those of an
    /// earlier.
    ///
    /// # Errors
    /// [`SampleError`]; the state is as it was, [`SampleError::NotFinite`] excepted.
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
        let came = self.came.get(channel).copied().unwrap_or(false);
        if pulse < self.pulse || (pulse == self.pulse && came) {
            return Err(SampleError::Repeated);
        }
        if pulse > self.pulse {
            let begun = self.came.contains(&true);
            self.incomplete = self.incomplete.saturating_add(begun.into());
            self.pulse = pulse;
            self.came = [false; CHANNELS];
        }
        // As they would be had nothing been compensated.
        let turns = |hz: f64| Turns::from_f64(-hz * (reference_path_m / SPEED_OF_LIGHT_M_S));
        let mut phase = turns(ready.setup.start_hz);
        let step = turns(ready.setup.step_hz);
        let mut finite = reference_path_m.is_finite();
        if let Some(row) = self.samples.get_mut(channel) {
            for (place, sample) in row.iter_mut().zip(samples) {
                finite &= sample.re.is_finite() && sample.im.is_finite();
                *place = sample * phase.phasor();
                phase = phase.plus(step);
            }
        }
        if !finite {
            self.incomplete = self.incomplete.saturating_add(1);
            self.came = [false; CHANNELS];
            self.pulse = pulse.saturating_add(1);
            return Err(SampleError::NotFinite);
        }
        if let Some(came) = self.came.get_mut(channel) {
            *came = true;
        }
        if self.came.iter().take(ready.channels).all(|came| *came) {
            self.stage = Stage::Profile(0);
        }
        Ok(())
    }

    /// Does a piece of work: a channel's profile, the search, a target's turn, or the motion.
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
                self.num_found = ready.detector.search(axis, power, &mut peaks);
                for (found, peak) in self.found.iter_mut().zip(&peaks) {
                    *found = Found::at(peak.cells);
                }
                match self.num_found {
                    0 => Stage::Tell,
                    _ => Stage::Refine {
                        round: 0,
                        target: 0,
                    },
                }
            }
            Stage::Refine { round, target } => {
                let mut look = Look {
                    axis,
                    samples,
                    weights,
                    phasors: row.get_mut(..frequencies).unwrap_or(&mut []),
                };
                if let Some(found) = self.found.get_mut(target) {
                    look.refine(found);
                }
                match (round, target + 1) {
                    (_, target) if target < self.num_found => Stage::Refine { round, target },
                    (round, _) if round + 1 < ROUNDS => Stage::Refine {
                        round: round + 1,
                        target: 0,
                    },
                    _ => Stage::Tell,
                }
            }
            Stage::Tell => return Progress::Step(self.tell()),
        };
        Progress::Busy
    }

    /// What the pulse's targets say.
    fn tell(&mut self) -> Step {
        let (pulse, since) = (self.pulse, self.since.unwrap_or(self.pulse));
        let before = self.before.unwrap_or(pulse);
        let (seen, echoes) = self.seen();
        let seen = seen.get(..echoes).unwrap_or(&[]);
        let mut told = [Echo {
            target: 0,
            range_m: 0.0,
            phases_rad: [0.0; CHANNELS],
            phase_sigma_rad: 0.0,
        }; TARGETS];
        let ready = &mut self.ready;
        let all = (pulse.wrapping_sub(before), ready.channels);
        let targets = (self.follower).push(&ready.setup.follow, seen, all, &mut told);
        let told = told.get_mut(..targets).unwrap_or(&mut []);
        for echo in told.iter_mut() {
            echo.range_m *= ready.axis.cell_m;
        }
        let told = ready.pairwise.push_after(told, pulse.wrapping_sub(since));
        // Too little is no motion from here to the next pulse; whatever else is wrong, the pulse is as if it had not been.
        let (moved, from) = match told {
            Ok(moved) => (moved, Some(pulse)),
            Err(MotionError::TooLittle) => (None, Some(pulse)),
            Err(_) => (None, self.since),
        };
        (self.before, self.since) = (Some(pulse), from);
        self.pulse = pulse.saturating_add(1);
        self.came = [false; CHANNELS];
        self.stage = Stage::Collect;
        Step {
            pulse,
            since,
            moved,
            targets: targets as u16,
            echoes: echoes as u16,
        }
    }

    /// What was found within the ranges, strongest first, and how many.
    fn seen(&mut self) -> ([Seen<CHANNELS>; TARGETS], usize) {
        let (mut seen, mut count) = ([Seen::EMPTY; TARGETS], 0);
        let ready = &self.ready;
        let axis = &ready.axis;
        let (Some(weights), Some(phasors), Some(samples)) = (
            self.weights.get(..axis.frequencies),
            self.row.get_mut(..axis.frequencies),
            self.samples.get_mut(..ready.channels),
        ) else {
            return (seen, 0);
        };
        let mut look = Look {
            axis,
            samples,
            weights,
            phasors,
        };
        let noise: [f32; CHANNELS] = look.noise(self.num_found);
        let [near, far] = axis.ranges_cells;
        let least = libm::exp10(0.1 * ready.setup.least_snr_db) as f32;
        let cells = axis.frequencies as f64;
        for found in self.found.iter().take(self.num_found) {
            let mut own = look.measured(found, &noise, &ready.moments);
            // What lies at an end may be the flank of a target beyond.
            let is_own = libm::fabs(own.cells - found.peak_cells) < 0.5;
            // A peak is counted on from the nearest bin told: an echo that lies between that and the nearest range is found a whole profile beyond, and one a little before it at the near end.
            let turned = match own.cells {
                u if u < near => cells,
                u if u >= near + cells => -cells,
                _ => 0.0,
            };
            if turned != 0.0 {
                own.cells += turned;
                own.turn_round(axis.frequencies);
            }
            if is_own
                && own.cells <= far
                && own.least_snr >= least
                && let Some(place) = seen.get_mut(count)
            {
                *place = own;
                count += 1;
            }
        }
        (seen, count)
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
            Self::NotStarted => "no run is going on",
            Self::Busy => "the pulse before is still being worked on",
            Self::Repeated => "the pulse is behind, or this channel of it came before",
            Self::Channel => "there is no such channel",
            Self::Length => "one sample a frequency is needed",
            Self::NotFinite => "a sample or the reference path is no finite number",
        })
    }
}

impl core::error::Error for SampleError {}
