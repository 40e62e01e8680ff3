//! A recording's targets, pulse by pulse.

use num_complex::{Complex32, Complex64};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Band, ChannelHistory, Channels, PhaseHistory, ReadError};
use subaperture_motion::{Array, Sighting, Tracker};
use subaperture_signal::window::Window;

use crate::arrangement::{Arrangement, ArrangementError};
use crate::cfar::{Cfar, Detector, Search};
use crate::echo::{Echo, echoes};
use crate::fault::Fault;
use crate::follow::{Event, Follow, Follower};
use crate::profile::{Echoes, Profiler};

/// How targets are found.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Over frequency: what is below its side lobes beside the strongest target is not looked for.
    pub window: Window,
    /// Detection.
    pub cfar: Cfar,
    /// Association.
    pub follow: Follow,
    /// Ranges that are searched, metres; all that are told apart if `None`.
    pub ranges_m: Option<(f64, f64)>,
    /// Targets of a pulse at the most, the strongest: the time that motion takes grows with the cube of all there are.
    pub most_targets: usize,
    /// Echoes that are nearer to noise in any channel are not told of, dB.
    pub least_snr_db: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            window: Window::Taylor { side_lobe_db: 50.0 },
            cfar: Cfar::default(),
            follow: Follow::default(),
            ranges_m: None,
            most_targets: 16,
            least_snr_db: 10.0,
        }
    }
}

/// What was seen.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The antennas of the channels that were used.
    pub arrangement: Arrangement,
    /// These in the plane, transmitter by transmitter, receiver by receiver as sightings have them.
    pub array: Array,
    /// Names of the channels in that order.
    pub channels: Vec<String>,
    /// Of every pulse.
    pub pulses: Vec<Vec<Sighting>>,
    /// All echoes of every pulse, whether of a target or not.
    pub echoes: Vec<Vec<Echo>>,
    /// When each was, seconds from the collection's start.
    pub times_s: Vec<f64>,
    /// Range resolution, metres.
    pub cell_m: f64,
    /// What became of targets.
    pub events: Vec<Event>,
    /// What is wrong.
    pub faults: Vec<Fault>,
}

/// Why a recording's targets are not found, or no track of them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TargetsError {
    /// Reading failed.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Channels are not those of an array.
    #[error(transparent)]
    Arrangement(#[from] ArrangementError),
    /// Settings that cannot be.
    #[error("{0}")]
    Settings(&'static str),
    /// Frequencies differ.
    #[error(
        "channels and pulses have different frequencies: phases are compared at the middle of one band"
    )]
    Band,
    /// Too few samples for a range profile.
    #[error("{0} samples a pulse make no range profile: 8 at the least")]
    Samples(usize),
    /// There are no targets.
    #[error(
        "nothing is seen in {pulses} pulses that lasts: the strongest of all range cells is at {most_db:+.1} dB of the threshold of detection"
    )]
    Nothing {
        /// Pulses searched.
        pulses: usize,
        /// The most that a cell reached, dB over its threshold.
        most_db: f64,
    },
    /// All channels hold zeros.
    #[error("all channels are dead: they hold nothing but zeros")]
    AllDead,
    /// One target.
    #[error(
        "{most} target is seen at a time at the most, over {pulses} pulses, at {:.2} m to {:.2} m: its ranges can be trusted, a track takes two targets \
         in different directions",
        ranges_m.0, ranges_m.1
    )]
    TooFew {
        /// Most targets in a pulse.
        most: usize,
        /// Pulses in which something is seen.
        pulses: usize,
        /// Nearest and farthest.
        ranges_m: (f64, f64),
    },
    /// Those that work are no array.
    #[error("{left} of {} channels have echoes (dead: {}): an angle of arrival takes two receivers of one transmitter, half a wavelength apart or less", left + dead.len(), dead.join(", "))]
    Left {
        /// Channels with echoes.
        left: usize,
        /// The names of those without.
        dead: Vec<String>,
    },
    /// The antennas tell no motion.
    #[error(transparent)]
    Array(subaperture_motion::MotionError),
    /// No motion explains what is seen.
    #[error("pulse {pulse}: {source}")]
    Motion {
        /// In the recording.
        pulse: usize,
        /// Why.
        source: subaperture_motion::MotionError,
    },
    /// The monitor said so.
    #[error("cancelled")]
    Cancelled,
}

/// Pulses that are looked at to learn which channels work.
const LOOKED_AT: usize = 32;
/// A channel so far below the strongest has no echoes but what leaks into it from others.
const DEAD_DB: f64 = 40.0;
/// SNR of half of the echoes below which a channel holds noise alone, if they are above the other in another channel.
const SILENT: f64 = 4.0;
const SEEN: f64 = 100.0;
/// Samples at the largest value of a channel, as a fraction, from which on it is saturated: of a steady tone 0.2 % are within [`RAIL`] of it.
const SATURATED: f64 = 0.01;
const RAIL: f64 = 2e-6;
/// A channel that loses more of the echoes that others have is told of.
const WEAK: f64 = 0.1;
/// Peaks of a pulse that are looked at beside as many as there may be targets.
const BESIDE: usize = 16;
/// Bytes of a block of pulses.
const BLOCK_BYTES: usize = 4 << 20;

/// Finds the targets of a recording, in blocks of pulses.
///
/// # Errors
/// [`TargetsError`].
pub fn see(
    channels: Channels,
    settings: &Settings,
    monitor: &dyn Monitor,
) -> Result<Seen, TargetsError> {
    let num_pulses = channels.num_pulses();
    if num_pulses == 0 {
        return Err(ArrangementError::NoPulses.into());
    }
    let profiler = profiler(&channels, settings)?;
    let everyone = Looker::new(&profiler, settings, channels.len())?;
    let looked = everyone.look(&channels, monitor)?;
    let mut faults = looked.saturated(&channels);
    if looked.most_power() == 0.0 {
        return Err(TargetsError::AllDead);
    }
    let (alive, dead) = looked.parted(channels);
    let left = (!dead.is_empty()).then(|| TargetsError::Left {
        left: alive.len(),
        dead: dead.iter().map(|(name, _)| name.clone()).collect(),
    });
    faults.extend(
        dead.into_iter()
            .map(|(channel, below_db)| Fault::Dead { channel, below_db }),
    );
    let channels = Channels::new(alive).map_err(ReadError::from)?;
    let arrangement = Arrangement::of(&channels);
    let middle_hz = profiler.middle_hz();
    let is_array = |own: &Arrangement| Tracker::new(own.array(middle_hz), 2).is_ok();
    let arrangement = match (arrangement, left) {
        (Ok(own), Some(left)) if !is_array(&own) => return Err(left),
        (Err(_), Some(left)) => return Err(left),
        (arrangement, _) => arrangement?,
    };
    Tracker::new(arrangement.array(middle_hz), 2).map_err(TargetsError::Array)?;
    let looker = Looker::new(&profiler, settings, channels.len())?;
    let mut seen = looker.follow(&channels, arrangement, monitor)?;
    faults.append(&mut seen.faults);
    seen.faults = faults;
    Ok(seen)
}

fn profiler(channels: &Channels, settings: &Settings) -> Result<Profiler, TargetsError> {
    let first = channels.channel(0).collection();
    let band = first.band().ok_or(TargetsError::Band)?;
    let alike = |history: &dyn PhaseHistory| {
        history.collection().band().is_some_and(|other| {
            let ends = |band: &Band| [band.start_hz, band.frequency_hz(band.count)];
            other.count == band.count
                && ends(&other)
                    .iter()
                    .zip(ends(&band))
                    .all(|(a, b)| (a - b).abs() <= 1e-9 * b)
        })
    };
    if !channels.iter().all(|(_, history)| alike(history)) {
        return Err(TargetsError::Band);
    }
    if band.count < 8 {
        return Err(TargetsError::Samples(band.count));
    }
    if let Some((near_m, far_m)) = settings.ranges_m
        && !(near_m >= 0.0 && far_m > near_m && far_m.is_finite())
    {
        return Err(TargetsError::Settings(
            "ranges begin at 0 m or farther, and end farther still",
        ));
    }
    if !settings.least_snr_db.is_finite() || settings.most_targets < 2 {
        return Err(TargetsError::Settings(
            "the least SNR is a number, and targets are two at the least",
        ));
    }
    Ok(Profiler::new(
        band,
        settings.window.weights(band.count),
        first.pulses[0].reference_path_m,
        settings.ranges_m,
    ))
}

/// Finds targets in pulses of so many channels.
struct Looker<'s> {
    profiler: &'s Profiler,
    settings: &'s Settings,
    detector: Detector,
    /// Highest side lobe of the window, as a ratio of powers, and a little.
    lobe: f64,
}

impl<'s> Looker<'s> {
    fn new(
        profiler: &'s Profiler,
        settings: &'s Settings,
        channels: usize,
    ) -> Result<Self, TargetsError> {
        let detector = Detector::new(settings.cfar, channels, profiler.stride(), &profiler.window);
        Ok(Self {
            profiler,
            settings,
            detector: detector.map_err(TargetsError::Settings)?,
            lobe: 2.0 * highest_lobe(profiler),
        })
    }

    /// Targets, strongest first, and what the search counted.
    fn find(&self, samples: &Echoes) -> (Vec<Echo>, Search) {
        let each = samples.iter().map(|samples| self.profiler.power(samples));
        let power = each
            .reduce(|mut sum, own| {
                sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
                sum
            })
            .unwrap_or_default();
        let strongest = power.iter().fold(0.0, |most: f64, p| most.max(*p));
        let mut search = self.detector.search(&power, self.lobe * strongest);
        // Those beyond the searched ranges are taken away with the others.
        search.peaks.truncate(self.settings.most_targets + BESIDE);
        let mut found = echoes(self.profiler, &self.detector, samples, &search.peaks);
        // What lies at an end may be the flank of a target beyond.
        let cell_m = 0.5 * self.profiler.cell_m();
        let mut peaks = search.peaks.iter();
        found.retain(|echo| {
            let at_m = peaks
                .next()
                .map(|peak| 0.5 * self.profiler.path_m(peak.bin));
            let is_own = at_m.is_some_and(|at_m| (echo.range_m - at_m).abs() < 0.5 * cell_m);
            is_own && 2.0 * echo.range_m <= self.profiler.most_path_m
        });
        found.truncate(self.settings.most_targets);
        (found, search)
    }

    /// Some pulses, to learn which channels work.
    fn look(&self, channels: &Channels, monitor: &dyn Monitor) -> Result<Looked, TargetsError> {
        let count = channels.num_pulses();
        let looked_at = count.min(LOOKED_AT);
        let mut looked = Looked {
            of: vec![Health::default(); channels.len()],
        };
        for i in 0..looked_at {
            if monitor.cancelled() {
                return Err(TargetsError::Cancelled);
            }
            let n = i * count / looked_at;
            let Ok(read) = read(channels, n..n + 1)? else {
                continue;
            };
            let echoes = self.pulse(channels, &read, n, 0);
            for (health, samples) in looked.of.iter_mut().zip(&read) {
                health.take(samples);
            }
            for (health, samples) in looked.of.iter_mut().zip(&echoes) {
                health.take_echoes(samples);
            }
            let (found, _) = self.find(&echoes);
            for echo in &found {
                for (health, snr) in looked.of.iter_mut().zip(&echo.snr) {
                    health.echoes.push(*snr);
                }
            }
        }
        Ok(looked)
    }

    /// Samples of pulse `n`, the `i`-th of those read.
    fn pulse(&self, channels: &Channels, read: &[Vec<Complex32>], n: usize, i: usize) -> Echoes {
        let width = self.profiler.band.count;
        let each = channels.iter().zip(read);
        each.map(|((_, history), samples)| {
            let pulse = &history.collection().pulses[n];
            self.profiler
                .uncompensated(pulse, &samples[i * width..(i + 1) * width])
        })
        .collect()
    }

    fn follow(
        &self,
        channels: &Channels,
        arrangement: Arrangement,
        monitor: &dyn Monitor,
    ) -> Result<Seen, TargetsError> {
        let cell_m = 0.5 * self.profiler.cell_m();
        let order = arrangement.order();
        let mut follower =
            Follower::new(self.settings.follow, cell_m).map_err(TargetsError::Settings)?;
        let num_pulses = channels.num_pulses();
        let mut pulses = Vec::with_capacity(num_pulses);
        let mut all_echoes = Vec::with_capacity(num_pulses);
        let mut events = Vec::new();
        let mut unreadable = Unreadable::default();
        let mut lost = Lost::new(channels.len());
        let mut most = 0f64;
        let least_snr = libm::exp10(0.1 * self.settings.least_snr_db);
        let pulse_bytes = channels.len() * self.profiler.band.count * size_of::<Complex32>();
        let block = (BLOCK_BYTES / pulse_bytes).clamp(1, 256);
        let mut take = |n: usize, echoes: Option<&Echoes>| {
            let (mut found, search) = echoes.map_or_else(Default::default, |e| self.find(e));
            most = most.max(search.most);
            found.retain(|echo| lost.take(echo, least_snr));
            for echo in &mut found {
                echo.phases_rad = order.iter().map(|&c| echo.phases_rad[c]).collect();
            }
            pulses.extend(follower.push(&found));
            all_echoes.push(found);
            events.append(&mut follower.events());
            monitor.progress((n + 1) as f64 / num_pulses as f64);
        };
        for first in (0..num_pulses).step_by(block) {
            let run = first..(first + block).min(num_pulses);
            if monitor.cancelled() {
                return Err(TargetsError::Cancelled);
            }
            match read(channels, run.clone())? {
                Ok(samples) => {
                    for (i, n) in run.enumerate() {
                        take(n, Some(&self.pulse(channels, &samples, n, i)));
                    }
                }
                // One by one, to tell which.
                Err(_) => {
                    for n in run {
                        match read(channels, n..n + 1)? {
                            Ok(samples) => take(n, Some(&self.pulse(channels, &samples, n, 0))),
                            Err(what) => {
                                unreadable.take(n, what);
                                take(n, None);
                            }
                        }
                    }
                }
            }
        }
        pulses.extend(follower.finish());
        events.append(&mut follower.events());
        if pulses.iter().all(Vec::is_empty) {
            return Err(TargetsError::Nothing {
                pulses: num_pulses - unreadable.count,
                most_db: 10.0 * libm::log10(most),
            });
        }
        let array = arrangement.array(self.profiler.middle_hz());
        let times_s: Vec<f64> = (channels.channel(0).collection().pulses.iter())
            .map(|pulse| pulse.time_s)
            .collect();
        let mut faults = Vec::new();
        faults.extend(unreadable.fault());
        faults.extend(lost.faults(channels));
        let half_m = 0.5 * array.wavelength_m;
        if let Some((rate_m, _, pulse)) = follower.fastest() {
            faults.extend((2.0 * rate_m > half_m).then_some(Fault::Fast {
                path_m: 2.0 * rate_m,
                half_m,
                pulse,
            }));
            faults.extend(turns(channels, rate_m, array.rad_m()));
        }
        let names: Vec<String> = channels.about().map(|about| about.name.clone()).collect();
        Ok(Seen {
            arrangement,
            array,
            channels: order.iter().map(|&c| names[c].clone()).collect(),
            pulses,
            echoes: all_echoes,
            times_s,
            cell_m,
            events,
            faults,
        })
    }
}

/// Samples of a run of pulses, channel by channel; or what of them is no number.
type Samples = Result<Vec<Vec<Complex32>>, String>;

fn read(channels: &Channels, run: std::ops::Range<usize>) -> Result<Samples, ReadError> {
    let mut all = Vec::with_capacity(channels.len());
    for (about, history) in channels.iter() {
        let width = history.collection().num_samples;
        let mut samples = vec![Complex32::ZERO; run.len() * width];
        match history.read(run.clone(), &mut samples) {
            Err(error @ ReadError::NotFinite { .. }) => return Ok(Err(error.to_string())),
            other => other?,
        }
        let is_number = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        if let Some(i) = samples.iter().position(|z| !is_number(z)) {
            let (pulse, sample) = (run.start + i / width, i % width);
            return Ok(Err(format!(
                "channel '{}': sample {sample} of pulse {pulse} is no finite number",
                about.name
            )));
        }
        all.push(samples);
    }
    Ok(Ok(all))
}

/// How a channel does.
#[derive(Clone, Default)]
struct Health {
    power: f64,
    samples: usize,
    /// As recorded, and without compensation: the largest part so far, and how many are as large.
    rails: [(f64, usize); 2],
    /// SNR of the echoes found.
    echoes: Vec<f64>,
}

impl Health {
    /// The median of its echoes'.
    fn snr(&self) -> Option<f64> {
        let mut all = self.echoes.clone();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    fn take(&mut self, samples: &[Complex32]) {
        let each = |z: &Complex32| f64::from(z.norm_sqr());
        self.power += samples.iter().map(each).sum::<f64>();
        self.samples += samples.len();
        for z in samples {
            self.rail(0, z.re.into());
            self.rail(0, z.im.into());
        }
    }

    fn take_echoes(&mut self, samples: &[Complex64]) {
        for z in samples {
            self.rail(1, z.re);
            self.rail(1, z.im);
        }
    }

    fn rail(&mut self, which: usize, part: f64) {
        let (largest, count) = &mut self.rails[which];
        let size = part.abs();
        if size > *largest * (1.0 + RAIL) {
            (*largest, *count) = (size, 1);
        } else if size >= *largest * (1.0 - RAIL) && size > 0.0 {
            *count += 1;
        }
    }

    /// Samples of which a part is at the largest value, as a fraction, at the most.
    fn at_rails(&self) -> f64 {
        let most = self.rails.iter().map(|(_, count)| *count).max();
        most.unwrap_or(0) as f64 / self.samples.max(1) as f64
    }
}

/// What some pulses told of the channels.
struct Looked {
    of: Vec<Health>,
}

impl Looked {
    fn most_power(&self) -> f64 {
        self.of.iter().fold(0.0, |most, own| most.max(own.power))
    }

    fn saturated(&self, channels: &Channels) -> Vec<Fault> {
        let each = self.of.iter().zip(channels.about());
        each.map(|(own, about)| (own.at_rails(), about))
            .filter(|(share, _)| *share > SATURATED)
            .map(|(share, about)| Fault::Saturated {
                channel: about.name.clone(),
                share: share.min(1.0),
            })
            .collect()
    }

    /// The channels with echoes; and the names of the others, with how far they are below the strongest if they hold anything.
    fn parted<'a>(&self, channels: Channels<'a>) -> Parted<'a> {
        let most = self.most_power();
        let best = self.of.iter().filter_map(Health::snr).fold(0.0, f64::max);
        let (mut alive, mut dead) = (Vec::new(), Vec::new());
        for (own, (about, history)) in self.of.iter().zip(channels.into_inner()) {
            let by_power_db = 10.0 * libm::log10(most / own.power);
            // Noise alone, where another has echoes.
            let silent = own.snr().filter(|snr| *snr < SILENT && best > SEEN);
            let by_echoes_db = silent.map(|snr| 10.0 * libm::log10(best / snr));
            let below_db = by_echoes_db.unwrap_or(by_power_db);
            match below_db > DEAD_DB || silent.is_some() {
                true => dead.push((about.name, (own.power > 0.0).then_some(below_db))),
                false => alive.push((about, history)),
            }
        }
        (alive, dead)
    }
}

/// Channels with echoes, and names of those without.
type Parted<'a> = (Vec<ChannelHistory<'a>>, Vec<(String, Option<f64>)>);

/// Pulses that could not be read.
#[derive(Default)]
struct Unreadable {
    count: usize,
    first: Option<(usize, String)>,
}

impl Unreadable {
    fn take(&mut self, pulse: usize, what: String) {
        self.count += 1;
        self.first.get_or_insert((pulse, what));
    }

    fn fault(self) -> Option<Fault> {
        let (first, what) = self.first?;
        Some(Fault::Unreadable {
            pulses: self.count,
            first,
            what,
        })
    }
}

/// Echoes that one channel alone has lost.
struct Lost {
    all: usize,
    of: Vec<usize>,
}

impl Lost {
    fn new(channels: usize) -> Self {
        Self {
            all: 0,
            of: vec![0; channels],
        }
    }

    /// Whether all channels have an echo.
    fn take(&mut self, echo: &Echo, least_snr: f64) -> bool {
        let low = |snr: &&f64| **snr < least_snr;
        match echo.snr.iter().filter(low).count() {
            0 => self.all += 1,
            1 => {
                let place = echo.snr.iter().position(|snr| *snr < least_snr);
                self.of[place.unwrap_or(0)] += 1;
            }
            _ => {}
        }
        !echo.snr.iter().any(|snr| *snr < least_snr)
    }

    fn faults(&self, channels: &Channels) -> Vec<Fault> {
        let each = self.of.iter().zip(channels.about());
        each.map(|(&lost, about)| (lost as f64 / (lost + self.all).max(1) as f64, about))
            .filter(|(share, _)| *share > WEAK)
            .map(|(share, about)| Fault::Weak {
                channel: about.name.clone(),
                share,
            })
            .collect()
    }
}

/// Whether pulses of a turn are so far apart in time that phases change.
fn turns(channels: &Channels, rate_m: f64, rad_m: f64) -> Option<Fault> {
    let first = channels.channel(0).collection();
    let [a, b, ..] = first.pulses[..] else {
        return None;
    };
    let times = channels
        .iter()
        .map(|(_, history)| (history.collection().pulses[0].time_s - a.time_s).abs());
    let apart_s = times.fold(0.0, f64::max);
    let phase_rad = 2.0 * rate_m * rad_m * apart_s / (b.time_s - a.time_s);
    (phase_rad > 0.1).then_some(Fault::Turns { apart_s, phase_rad })
}

/// The highest side lobe of a window, as a ratio of powers.
fn highest_lobe(profiler: &Profiler) -> f64 {
    let flat = vec![Complex64::ONE; profiler.band.count];
    let half = profiler.full_power(&flat);
    let half = &half[..half.len() / 2];
    let null = half.windows(2).position(|pair| pair[1] > pair[0]);
    let beyond = &half[null.unwrap_or(half.len())..];
    beyond.iter().fold(0.0, |most: f64, p| most.max(*p)) / half[0]
}
