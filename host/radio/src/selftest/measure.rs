//! Measurements of the self-test.

use num_complex::{Complex32, Complex64};
use serde::Serialize;

use super::delay::{Delay, fit};
use crate::error::RadioError;
use crate::plan::{MAX_SAMPLES, Plan};
use crate::tone::{Mixed, Tone};
use crate::transceiver::{Burst, Configuration, Received, Sample, Side, Transceiver};

/// Carriers of the measurement of retune times.
const RETUNES: usize = 8;
/// Largest number of carriers of the measurement of the delay.
const DELAY_CARRIERS: usize = 64;
/// Carriers of the measurement of phase repeatability, and retunes to each.
const REPEATED: (usize, usize) = (4, 8);
/// Duration of a burst of streaming, seconds.
const STREAM_BURST_S: f64 = 0.1;

/// Retune time of a carrier.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Retune {
    /// Frequency of the carrier, hertz.
    pub carrier_hz: f64,
    /// Time until the tone is steady, seconds; `None` if it is not steady within the test's window or samples are
    /// lost.
    pub settled_s: Option<f64>,
}

/// Measured values; those that were not reached are empty.
#[derive(Debug, Default)]
pub(super) struct Measured {
    pub(super) error: Option<String>,
    /// Settings in effect on the radio.
    pub(super) settings: Option<Configuration>,
    /// Readings of the lock sensors, and those without lock of the transmitter and of the receivers.
    pub(super) readings: u64,
    pub(super) unlocked: [u64; 2],
    /// Whether every reading of the reference clock was locked.
    pub(super) reference_locked: Option<bool>,
    pub(super) temperature_c: Option<f64>,
    pub(super) bursts: u64,
    /// Duration of all bursts, seconds.
    pub(super) sampled_s: f64,
    /// Events by kind, in the order of [`crate::EventKind`].
    pub(super) events: [u64; 5],
    /// Lost samples per channel.
    pub(super) lost: u64,
    pub(super) clipped: [u64; 2],
    pub(super) retunes: Vec<Retune>,
    pub(super) delay: Option<Delay>,
    /// Bursts after each retune, by carrier.
    pub(super) repeats: Vec<Vec<Mixed>>,
    /// Noise power of each receiver, relative to full scale.
    pub(super) noise: Option<[f64; 2]>,
}

impl Measured {
    /// Lowest power of the tone in each receiver, relative to full scale.
    pub(super) fn weakest_tones(&self) -> Option<[f64; 2]> {
        let powers = self.repeats.iter().flatten().map(|mixed| {
            let reference = mixed.reference * mixed.reference;
            [reference, mixed.value.norm_sqr() * reference]
        });
        powers.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1])])
    }
}

/// Radio under test, with the plan and the tone.
pub(super) struct Bench<'a> {
    radio: &'a mut dyn Transceiver,
    plan: &'a Plan,
    rate_hz: f64,
    tone: Tone,
    waveform: Vec<Complex32>,
    /// Carriers that the plan takes, hertz, ascending.
    carriers_hz: Vec<f64>,
    channels: [Vec<Sample>; 2],
    measured: &'a mut Measured,
}

impl<'a> Bench<'a> {
    pub(super) fn new(
        radio: &'a mut dyn Transceiver,
        plan: &'a Plan,
        rate_hz: f64,
        measured: &'a mut Measured,
    ) -> Self {
        let tone = Tone::new(plan.period(), rate_hz);
        let taken = (0..plan.steps).filter(|&n| !plan.avoids(n));
        Self {
            radio,
            plan,
            rate_hz,
            waveform: tone.waveform(plan.amplitude),
            tone,
            carriers_hz: taken.map(|n| plan.carrier_hz(n)).collect(),
            channels: [Vec::new(), Vec::new()],
            measured,
        }
    }

    pub(super) fn all(&mut self, stream_s: f64) -> Result<(), RadioError> {
        self.retunes()?;
        self.delay()?;
        self.repeats()?;
        self.stream(stream_s)?;
        self.noise()?;
        self.measured.temperature_c = self.radio.sensors()?.temperature_c;
        Ok(())
    }

    /// At most `count` of the carriers, evenly over the plan.
    fn some(&self, count: usize) -> Vec<f64> {
        let stride = self.carriers_hz.len().div_ceil(count);
        self.carriers_hz.iter().copied().step_by(stride).collect()
    }

    /// Tune both sides, and read the sensors.
    fn tune(&mut self, carrier_hz: f64) -> Result<(), RadioError> {
        for side in [Side::Transmit, Side::Receive] {
            self.radio.tune(side, carrier_hz, None)?;
        }
        let sensors = self.radio.sensors()?;
        let measured = &mut *self.measured;
        measured.readings += 1;
        measured.unlocked[0] += u64::from(!sensors.transmit_locked);
        measured.unlocked[1] += u64::from(!sensors.receive_locked);
        if let Some(locked) = sensors.reference_locked {
            measured.reference_locked = Some(measured.reference_locked.unwrap_or(true) && locked);
        }
        Ok(())
    }

    /// Take a burst of `samples` as soon as possible, and count its faults. Returns its start time too.
    fn burst(
        &mut self,
        samples: usize,
        waveform: Option<&[Complex32]>,
    ) -> Result<(Received, f64), RadioError> {
        let samples = samples.min(MAX_SAMPLES / self.tone.period() * self.tone.period());
        for channel in &mut self.channels {
            channel.resize(samples, Sample::ZERO);
        }
        let at_s = self.radio.now_s()? + self.plan.lead_s;
        let burst = Burst {
            waveform: waveform.unwrap_or(&self.waveform),
            at_s,
        };
        let [first, second] = &mut self.channels;
        let received = self.radio.burst(&burst, [first, second]);
        let mut events = Vec::new();
        self.radio.events(&mut events);
        let measured = &mut *self.measured;
        for event in events {
            measured.events[event.kind as usize] += u64::from(event.count);
        }
        let received = received?;
        measured.bursts += 1;
        measured.sampled_s += samples as f64 / self.rate_hz;
        let lost = received.lost.iter().map(|gap| gap.len() as u64);
        measured.lost += lost.sum::<u64>();
        for (sum, clipped) in measured.clipped.iter_mut().zip(received.clipped) {
            *sum += u64::from(clipped);
        }
        Ok((received, at_s))
    }

    /// Whole periods of the tone over a duration.
    fn samples(&self, duration_s: f64) -> usize {
        let period = self.tone.period();
        ((duration_s * self.rate_hz / period as f64).ceil() as usize).max(1) * period
    }

    /// Retune times: the lowest and the highest carriers alternate, so that the jumps are large.
    fn retunes(&mut self) -> Result<(), RadioError> {
        let mut carriers_hz = self.some(RETUNES);
        let upper = carriers_hz.split_off(carriers_hz.len().div_ceil(2));
        let mut order = Vec::new();
        for (index, &lower_hz) in carriers_hz.iter().enumerate() {
            order.push(lower_hz);
            order.extend(upper.get(index));
        }
        let plan = self.plan;
        let window = self.samples(f64::from(plan.bursts) * (plan.lead_s + plan.dwell_s));
        for carrier_hz in order {
            let began_s = self.radio.now_s()?;
            self.tune(carrier_hz)?;
            let (received, at_s) = self.burst(window + plan.samples(), None)?;
            let reference = &self.channels[0];
            let from = match received.lost.is_empty() {
                true => self
                    .tone
                    .steady_from(reference, plan.samples(), plan.steady),
                false => None,
            };
            self.measured.retunes.push(Retune {
                carrier_hz,
                settled_s: from.map(|from| at_s - began_s + from as f64 / self.rate_hz),
            });
        }
        Ok(())
    }

    /// Tune and take bursts until the reference is steady, as a capture does. `None` if all samples are lost.
    fn quotient(&mut self, carrier_hz: f64) -> Result<Option<Mixed>, RadioError> {
        self.tune(carrier_hz)?;
        let mut last = None;
        for _ in 0..self.plan.bursts {
            let (received, _) = self.burst(self.plan.samples(), None)?;
            last = self
                .tone
                .mix([&self.channels[0], &self.channels[1]], &received.lost);
            if last.is_none_or(|mixed| mixed.unsteady <= self.plan.steady) {
                break;
            }
        }
        Ok(last.filter(|mixed| mixed.value.norm() > 0.0))
    }

    fn delay(&mut self) -> Result<(), RadioError> {
        let mut quotients: Vec<(f64, Complex64)> = Vec::new();
        for carrier_hz in self.some(DELAY_CARRIERS) {
            if let Some(mixed) = self.quotient(carrier_hz)? {
                quotients.push((carrier_hz, mixed.value));
            }
        }
        self.measured.delay = fit(&quotients);
        Ok(())
    }

    fn repeats(&mut self) -> Result<(), RadioError> {
        let (carriers, retunes) = REPEATED;
        let carriers_hz = self.some(carriers);
        let mut repeats = vec![Vec::new(); carriers_hz.len()];
        for _ in 0..retunes {
            for (carrier_hz, bursts) in carriers_hz.iter().zip(&mut repeats) {
                bursts.extend(self.quotient(*carrier_hz)?);
            }
        }
        self.measured.repeats = repeats;
        Ok(())
    }

    /// Stream at the last carrier.
    fn stream(&mut self, duration_s: f64) -> Result<(), RadioError> {
        let end_s = self.measured.sampled_s + duration_s;
        while self.measured.sampled_s < end_s {
            self.burst(self.samples(STREAM_BURST_S.min(duration_s)), None)?;
        }
        Ok(())
    }

    /// Power without the mean while zeros are sent: the mean is the DC offset and the transmitter's carrier.
    fn noise(&mut self) -> Result<(), RadioError> {
        let zeros = vec![Complex32::ZERO; self.tone.period()];
        let clipped = self.measured.clipped;
        let (received, _) = self.burst(self.samples(STREAM_BURST_S), Some(&zeros))?;
        self.measured.clipped = clipped;
        if !received.lost.is_empty() {
            return Ok(());
        }
        let power = |samples: &Vec<Sample>| {
            let number = |s: &Sample| Complex64::new(s.re.into(), s.im.into()) / 32768.0;
            let count = samples.len() as f64;
            let mean = samples.iter().map(number).sum::<Complex64>() / count;
            let squares = samples.iter().map(|s| (number(s) - mean).norm_sqr());
            squares.sum::<f64>() / count
        };
        self.measured.noise = Some([power(&self.channels[0]), power(&self.channels[1])]);
        Ok(())
    }
}
