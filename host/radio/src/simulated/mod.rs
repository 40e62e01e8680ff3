//! Simulated radio: a scene, a track and a receiver of the simulator, with the impairments of an AD9361.
//!
//! The antennas are the experiment's first transmitter and its receivers. Scene and track are the experiment's; the
//! radar stands still for the duration of a burst. Clock, noise, phase noise, interference and converter are those of
//! the experiment's receiver. The waveform of a burst is periodic, and so is the received signal: its spectrum is that
//! of the waveform times the scene's response at each frequency `f`, computed by [`subaperture_simulate::engine`]. For
//! a spectral line `f_b` at carrier `f_c`, sample `t` of channel `c` is
//!
//! ```text
//! A_tx (G_c(f_c + f_b) + L_c exp(-j 2 pi (f_c + f_b) d_c)) exp(j 2 pi (f_b + df) t + j (phi_tx - phi_rx))
//! ```
//!
//! where `L_c` and `d_c` are the amplitude and delay of a coupler or of the leakage between antennas. Then follow, in
//! this order and each with its own switch: settling of the synthesisers, the receiver's noise ([`Chain::receive`]),
//! its gain, DC offset and IQ imbalance, and the converter, which has 12 bits unless the experiment has its own.
//!
//! Neglected: the start of a burst, when the echo has not arrived yet; the filter edge at half the sample rate; DC
//! offset and image of the transmitter. The synthesisers' phase noises are independent: they are read from one random
//! process of the simulator, 1000 s apart.
//!
//! Faults of the link to the host (overrun, lost packets, disconnection) are injected by the wrapper
//! [`crate::fault::Faulty`]; late commands are detected here. Timing: a retune takes 2 ms, a burst its duration, and
//! nothing else takes time. The radio runs as fast as possible, or in real time ([`SimulatedRadio::in_real_time`]).
//! Cost of a burst: the engine's sum at the waveform's frequencies, and some 30 operations per sample without noise. If
//! all periods are equal (no noise, phase noise or interference, both synthesisers settled, no LO offset), one period
//! is computed and copied; the counts are identical. Memory: that of the scene, and four bursts of 16 bytes per sample.

mod analogue;
mod echo;
mod wiring;

use std::time::{Duration, Instant};

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_model::radar::{Converter, PulseShape, Radar, Waveform};
use subaperture_model::units::amplitude_of_db;
use subaperture_signal::phase::phasor;
use subaperture_simulate::Experiment;
use subaperture_simulate::random::unit;
use subaperture_simulate::receiver::{Chain, Moment};

use crate::error::RadioError;
use crate::transceiver::{
    About, Burst, Configuration, Event, EventKind, Ranges, Received, Sample, Sensors, Side,
    Transceiver, check_burst,
};

pub use analogue::{Analogue, Imbalance, Settling};
pub use wiring::{Coupled, Path, Wiring};

use echo::Echo;

/// Time between the readings of the random process by the two synthesisers, seconds; long compared with all its
/// periods.
const APART_S: f64 = 1000.0;

/// State of a synthesiser after tuning.
#[derive(Clone, Copy, Debug)]
struct Synthesiser {
    carrier_hz: f64,
    turns: f64,
    /// LO offset without the clock's error, hertz.
    offset_hz: f64,
    /// Device time of the retune, seconds.
    at_s: f64,
}

/// Radio that computes the echoes of a simulated scene, with the impairments of [`Analogue`].
pub struct SimulatedRadio<'a> {
    about: About,
    experiment: &'a Experiment,
    echo: Echo<'a>,
    wiring: Wiring,
    analogue: Analogue,
    radar: Radar,
    chain: Chain,
    full_scale: f64,
    configuration: Option<Configuration>,
    tuned: [Option<Synthesiser>; 2],
    tunes: u64,
    bursts: usize,
    now_s: f64,
    real_time: Option<Instant>,
    events: Vec<Event>,
    work: Vec<Complex64>,
}

impl<'a> SimulatedRadio<'a> {
    /// Make the radio of an experiment with a wiring and analogue impairments. At the gains named in the wiring, 1 in
    /// the experiment's units is an input of 1 at the converter.
    ///
    /// # Errors
    /// [`RadioError::Unsupported`] if the experiment lacks an antenna of the wiring, or its receiver is invalid.
    pub fn new(
        experiment: &'a Experiment,
        wiring: Wiring,
        analogue: Analogue,
    ) -> Result<Self, RadioError> {
        let echo = Echo::new(experiment, &wiring).map_err(RadioError::Unsupported)?;
        let mut radar = experiment.radar.clone();
        // An AD9361 has 12 bits. The wiring gives the full scale unless the experiment does.
        let converter = radar.receiver.converter.get_or_insert(Converter {
            bits: 12,
            full_scale_db: wiring.full_scale_db,
        });
        let full_scale = amplitude_of_db(converter.full_scale_db);
        let chain = Chain::new(&radar, experiment.seed, echo.reference_range_m())
            .map_err(RadioError::Unsupported)?;
        Ok(Self {
            about: About {
                product: "simulated B210".to_owned(),
                serial: format!("{}00001", crate::SIMULATED_SERIAL),
                driver: crate::OWN_DRIVER.to_owned(),
                ranges: Ranges::b210(),
            },
            experiment,
            echo,
            wiring,
            analogue,
            radar,
            chain,
            full_scale,
            configuration: None,
            tuned: [None; 2],
            tunes: 0,
            bursts: 0,
            now_s: 0.0,
            real_time: None,
            events: Vec::new(),
            work: Vec::new(),
        })
    }

    /// Run in real time.
    #[must_use]
    pub fn in_real_time(mut self) -> Self {
        self.real_time = Some(Instant::now());
        self
    }

    /// Fractional frequency error of the device's clock, from the experiment.
    fn clock_offset(&self) -> f64 {
        self.radar.receiver.clock.map_or(0.0, |clock| clock.offset)
    }

    /// Advance the device's clock to a time, and sleep until then in real time.
    fn wait_until(&mut self, time_s: f64) {
        self.now_s = self.now_s.max(time_s);
        if let Some(began) = self.real_time {
            let due = began + Duration::try_from_secs_f64(self.now_s).unwrap_or_default();
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
    }

    /// Amplitude gains of transmitter and receiver relative to the wiring's reference gains.
    fn gain(&self, configuration: &Configuration, channel: usize) -> [f64; 2] {
        [
            amplitude_of_db(configuration.transmit_gain_db - self.wiring.transmit_gain_db),
            amplitude_of_db(configuration.receive_gain_db[channel] - self.wiring.receive_gain_db),
        ]
    }

    /// Whether all periods of a burst are equal, `since_s` after the retunes and with an LO offset of `apart_hz`.
    fn repeats(&self, apart_hz: f64, since_s: [f64; 2]) -> bool {
        let receiver = &self.radar.receiver;
        apart_hz == 0.0
            && self.analogue.has_settled(since_s)
            && receiver.noise.is_none()
            && receiver.phase_noise.is_none()
            && receiver.interference.is_empty()
    }

    /// Waveform description of a burst for the receiver chain.
    fn waveform(&self, carrier_hz: f64, rate_hz: f64, num_samples: usize) -> Waveform {
        Waveform::Pulsed {
            centre_hz: carrier_hz,
            sample_rate_hz: rate_hz,
            num_samples,
            window_start_s: 0.0,
            shape: PulseShape::PhaseCode {
                phases_rad: vec![0.0],
                chip_s: 1.0 / rate_hz,
            },
        }
    }
}

impl Transceiver for SimulatedRadio<'_> {
    fn about(&self) -> &About {
        &self.about
    }

    fn waits(&self) -> bool {
        self.real_time.is_none()
    }

    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        asked.check(&self.about.ranges)?;
        let mut set = asked.clone();
        if self.analogue.gain_steps {
            set.transmit_gain_db = (4.0 * set.transmit_gain_db).round() / 4.0;
            set.receive_gain_db = set.receive_gain_db.map(f64::round);
        }
        // The link budget of the chain depends on the sampled bandwidth.
        self.radar.waveform = self.waveform(
            self.experiment.radar.waveform.centre_hz(),
            set.sample_rate_hz,
            1,
        );
        let range_m = self.echo.reference_range_m();
        self.chain = Chain::new(&self.radar, self.experiment.seed, range_m)
            .map_err(RadioError::Unsupported)?;
        self.configuration = Some(set.clone());
        self.tuned = [None; 2];
        Ok(set)
    }

    fn now_s(&mut self) -> Result<f64, RadioError> {
        if let Some(began) = self.real_time {
            self.now_s = self.now_s.max(began.elapsed().as_secs_f64());
        }
        Ok(self.now_s)
    }

    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        self.about
            .ranges
            .carrier_hz
            .check("carrier", carrier_hz, "Hz")?;
        if at_s.is_some() {
            let what = "scheduled retune: the synthesisers are set over a separate bus without timestamps. Tune now, then schedule the burst";
            return Err(RadioError::Unsupported(what.to_owned()));
        }
        self.now_s()?;
        let at_s = self.now_s;
        let mut random = ChaCha8Rng::seed_from_u64(self.experiment.seed ^ 0x5379_6e74);
        random.set_stream(self.tunes);
        let mut unit = || unit(&mut random);
        let turns = if self.analogue.random_phase {
            unit()
        } else {
            0.0
        };
        let offset_hz = (2.0 * unit() - 1.0) * self.analogue.frequency_offset_hz;
        self.tunes += 1;
        self.tuned[usize::from(side == Side::Receive)] = Some(Synthesiser {
            carrier_hz,
            turns,
            offset_hz,
            at_s,
        });
        self.wait_until(at_s + self.about.ranges.retune_s);
        Ok(carrier_hz)
    }

    fn burst(
        &mut self,
        burst: &Burst,
        mut receive: [&mut [Sample]; 2],
    ) -> Result<Received, RadioError> {
        check_burst(burst, &receive)?;
        let Some(configuration) = self.configuration.clone() else {
            return Err(RadioError::NotReady("configure the radio first"));
        };
        let [Some(transmit), Some(tuned)] = self.tuned else {
            return Err(RadioError::NotReady("tune both sides first"));
        };
        let now_s = self.now_s()?;
        let count = receive[0].len();
        if burst.at_s < now_s {
            receive
                .iter_mut()
                .for_each(|channel| channel.fill(Sample::ZERO));
            self.events.push(Event {
                kind: EventKind::LateCommand,
                time_s: Some(burst.at_s),
                count: 1,
            });
            return Ok(Received {
                first_s: burst.at_s,
                late: true,
                lost: std::iter::once(0..count).collect(),
                clipped: [0; 2],
            });
        }
        let rate_hz = configuration.sample_rate_hz;
        self.wait_until(burst.at_s + count as f64 / rate_hz);
        let fast = 1.0 + self.clock_offset();
        let true_s = burst.at_s / fast;
        // Frequency of the transmit synthesiser relative to the receive synthesiser.
        let carrier_hz = (transmit.carrier_hz + transmit.offset_hz) * fast;
        let apart_hz = carrier_hz - (tuned.carrier_hz + tuned.offset_hz) * fast;
        let since_s = [transmit.at_s, tuned.at_s].map(|at_s| burst.at_s - at_s);
        let waveform = self.waveform(carrier_hz, rate_hz, count);
        let made = match self.repeats(apart_hz, since_s) {
            true => count.min(burst.waveform.len()),
            false => count,
        };
        let mut samples = std::mem::take(&mut self.work);
        let mut clipped = [0; 2];
        for (channel, out) in receive.iter_mut().enumerate() {
            let [sent, received] = self.gain(&configuration, channel);
            let period =
                self.echo
                    .period(channel, burst.waveform, carrier_hz, rate_hz * fast, true_s);
            samples.clear();
            let mut rotation = phasor(transmit.turns - tuned.turns + apart_hz * true_s) * sent;
            let step = phasor(apart_hz / (rate_hz * fast));
            for (_, z) in (0..made).zip(period.iter().cycle()) {
                samples.push(z * rotation);
                rotation *= step;
            }
            self.analogue.settle(since_s, rate_hz, &mut samples);
            let moment = Moment {
                waveform: &waveform,
                pulse: self.bursts,
                receiver: channel,
                time_s: true_s,
                delay_s: APART_S,
            };
            self.chain.receive(&moment, &mut samples);
            samples.iter_mut().for_each(|z| *z *= received);
            self.analogue
                .demodulate(channel, self.full_scale, &mut samples);
            // The incomplete last period, and the complete ones.
            let (last, others) = samples.split_at_mut(count % made);
            let at_last = self.chain.convert(last);
            let whole = (count / made) as u32;
            clipped[channel] = whole * (at_last + self.chain.convert(others)) + at_last;
            let scale = 32768.0 / self.full_scale;
            // `as` saturates.
            let counts = |x: f64| (x * scale).round() as i16;
            for (s, z) in out.iter_mut().zip(&samples) {
                *s = Sample::new(counts(z.re), counts(z.im));
            }
            repeat(out, made);
        }
        self.work = samples;
        self.bursts += 1;
        Ok(Received {
            first_s: burst.at_s,
            late: false,
            lost: Vec::new(),
            clipped,
        })
    }

    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        // 0.1 % less, since times are rounded.
        let least_s = 0.999 * self.about.ranges.retune_s;
        let locked =
            |tuned: Option<Synthesiser>| tuned.is_some_and(|it| self.now_s - it.at_s >= least_s);
        Ok(Sensors {
            transmit_locked: locked(self.tuned[0]),
            receive_locked: locked(self.tuned[1]),
            reference_locked: None,
            temperature_c: None,
        })
    }

    fn events(&mut self, events: &mut Vec<Event>) {
        events.append(&mut self.events);
    }
}

/// Repeat the first `period` samples up to the end of the slice.
fn repeat(samples: &mut [Sample], period: usize) {
    let mut done = period;
    while done < samples.len() {
        // Doubles the number of copied periods each time; the last one may be incomplete.
        let (from, to) = samples.split_at_mut(done);
        let more = done.min(to.len());
        to[..more].copy_from_slice(&from[..more]);
        done += more;
    }
}
