//! Detection over a recording: echoes of each pulse, and targets from pulse to pulse.

use num_complex::{Complex32, Complex64};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channels, Pulse, ReadError};

use super::health::{ChannelStatistics, Health};
use super::lost::{Lost, Unreadable, turns};
use super::{Detections, Settings, TargetsError};
use crate::targets::arrangement::Arrangement;
use crate::targets::cfar::{Detector, Search};
use crate::targets::echo::{Echo, echoes};
use crate::targets::fault::Fault;
use crate::targets::follow::TargetTracker;
use crate::targets::profile::{Echoes, Profiler};

/// Number of pulses from which the health of channels is judged.
const HEALTH_PULSES: usize = 32;
/// Peaks of a pulse that are examined beyond the largest number of targets.
const EXTRA_PEAKS: usize = 16;
/// Bytes of a block of pulses.
const BLOCK_BYTES: usize = 4 << 20;

/// Detector of targets in pulses of several channels.
pub(crate) struct TargetDetector {
    profiler: Profiler,
    settings: Settings,
    detector: Detector,
    /// Highest side lobe of the window, as a ratio of powers, with a margin.
    lobe: f64,
    /// Least SNR of an echo in every channel, as a ratio of powers.
    least_snr: f64,
}

impl TargetDetector {
    pub(crate) fn new(
        profiler: Profiler,
        settings: &Settings,
        channels: usize,
    ) -> Result<Self, TargetsError> {
        let detector = Detector::new(settings.cfar, channels, profiler.stride(), &profiler.window);
        Ok(Self {
            lobe: 2.0 * highest_lobe(&profiler),
            profiler,
            settings: settings.clone(),
            detector: detector.map_err(TargetsError::Settings)?,
            least_snr: libm::exp10(0.1 * settings.least_snr_db),
        })
    }

    /// Whether the echo is above noise in all channels.
    pub(crate) fn is_above_noise(&self, echo: &Echo) -> bool {
        echo.snr.iter().all(|snr| *snr >= self.least_snr)
    }

    /// Samples of a channel without the recording's compensation.
    pub(crate) fn uncompensated(&self, pulse: &Pulse, samples: &[Complex32]) -> Vec<Complex64> {
        self.profiler.uncompensated(pulse, samples)
    }

    /// Targets, strongest first, and the statistics of the search.
    pub(crate) fn find(&self, samples: &Echoes) -> (Vec<Echo>, Search) {
        let each = samples.iter().map(|samples| self.profiler.power(samples));
        let power = each
            .reduce(|mut sum, own| {
                sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
                sum
            })
            .unwrap_or_default();
        let strongest = power.iter().fold(0.0, |most: f64, p| most.max(*p));
        let mut search = self.detector.search(&power, self.lobe * strongest);
        // Targets beyond the searched ranges are subtracted with the others.
        search
            .peaks
            .truncate(self.settings.most_targets + EXTRA_PEAKS);
        let mut found = echoes(
            &self.profiler,
            &self.detector,
            samples,
            &search.peaks,
            self.settings.subtraction,
        );
        // A peak at an end may be the flank of a target beyond.
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

    /// Collect the statistics of channels from some pulses.
    pub(super) fn channel_statistics(
        &self,
        channels: &Channels,
        monitor: &dyn Monitor,
    ) -> Result<ChannelStatistics, TargetsError> {
        let count = channels.num_pulses();
        let examined = count.min(HEALTH_PULSES);
        let mut statistics = ChannelStatistics {
            of: vec![Health::default(); channels.len()],
        };
        for i in 0..examined {
            if monitor.cancelled() {
                return Err(TargetsError::Cancelled);
            }
            let n = i * count / examined;
            let Ok(read) = read(channels, n..n + 1)? else {
                continue;
            };
            let echoes = self.pulse(channels, &read, n, 0);
            for (health, samples) in statistics.of.iter_mut().zip(&read) {
                health.take(samples);
            }
            for (health, samples) in statistics.of.iter_mut().zip(&echoes) {
                health.take_echoes(samples);
            }
            let (found, _) = self.find(&echoes);
            for echo in &found {
                for (health, snr) in statistics.of.iter_mut().zip(&echo.snr) {
                    health.echoes.push(*snr);
                }
            }
        }
        Ok(statistics)
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

    /// Detect the targets of all pulses and follow them from pulse to pulse.
    pub(super) fn follow(
        &self,
        channels: &Channels,
        arrangement: Arrangement,
        monitor: &dyn Monitor,
    ) -> Result<Detections, TargetsError> {
        let cell_m = 0.5 * self.profiler.cell_m();
        let order = arrangement.order();
        let mut follower =
            TargetTracker::new(self.settings.follow, cell_m).map_err(TargetsError::Settings)?;
        let num_pulses = channels.num_pulses();
        let mut pulses = Vec::with_capacity(num_pulses);
        let mut all_echoes = Vec::with_capacity(num_pulses);
        let mut events = Vec::new();
        let mut unreadable = Unreadable::default();
        let mut lost = Lost::new(channels.len());
        let mut most = 0f64;
        let pulse_bytes = channels.len() * self.profiler.band.count * size_of::<Complex32>();
        let block = (BLOCK_BYTES / pulse_bytes).clamp(1, 256);
        let mut take = |n: usize, echoes: Option<&Echoes>| {
            let (mut found, search) = echoes.map_or_else(Default::default, |e| self.find(e));
            most = most.max(search.most);
            found.retain(|echo| lost.take(echo, self.least_snr));
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
                // Read one by one to find the unreadable pulses.
                Err(_) => {
                    for n in run {
                        match read(channels, n..n + 1)? {
                            Ok(samples) => take(n, Some(&self.pulse(channels, &samples, n, 0))),
                            Err(reason) => {
                                unreadable.take(n, reason);
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
            return Err(TargetsError::NoLastingTarget {
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
        Ok(Detections {
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

/// Samples of a run of pulses, channel by channel, or a text that names the first sample that is not finite.
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
                "channel '{}': sample {sample} of pulse {pulse} is not finite",
                about.name
            )));
        }
        all.push(samples);
    }
    Ok(Ok(all))
}

/// Highest side lobe of a window, as a ratio of powers.
fn highest_lobe(profiler: &Profiler) -> f64 {
    let flat = vec![Complex64::ONE; profiler.band.count];
    let half = profiler.full_power(&flat);
    let half = &half[..half.len() / 2];
    let null = half.windows(2).position(|pair| pair[1] > pair[0]);
    let beyond = &half[null.unwrap_or(half.len())..];
    beyond.iter().fold(0.0, |most: f64, p| most.max(*p)) / half[0]
}
