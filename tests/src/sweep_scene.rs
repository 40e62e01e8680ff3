//! Bursts of a stepped-frequency radar by plain float64 sums over scatterers: the counts of its two receivers.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::{Complex, Complex64};
use subaperture::module::link::{SweepBurst, SweepSource};
use subaperture::phase_history::ReadError;
use subaperture_core::Window;
use subaperture_core::sweep::{Profiler, Setup};

use crate::random::Random;

const LIGHT_M_S: f64 = 299_792_458.0;

/// Samples per period of the tone.
pub const PERIOD: usize = 8;
/// Capacity of the profilers here, carriers.
pub const CARRIERS: usize = 64;
/// Capacity of the profilers here, bins.
pub const BINS: usize = 256;

/// A profiler with this capacity.
pub type SceneProfiler = Profiler<PERIOD, CARRIERS, BINS>;

/// Scatterers, and faults of the radio.
#[derive(Clone, Debug)]
pub struct SweepScene {
    /// Settings of the profiler.
    pub setup: Setup,
    /// Ranges, metres, and amplitudes relative to the reference.
    pub scatterers: Vec<(f64, f64)>,
    /// RMS of a sample's noise, counts.
    pub noise: f64,
    /// Carriers without a burst.
    pub left_out: Vec<u16>,
    /// Carriers whose burst lacks these samples.
    pub lost: Vec<(u16, Range<usize>)>,
    /// Carriers whose first burst has an unsettled synthesiser; another one follows.
    pub unsteady: Vec<u16>,
    /// Number of sweeps.
    pub sweeps: u32,
}

impl SweepScene {
    /// The walls and the reflector of Chim 2018, 5.6, seen by `carriers` from 1.1 GHz on, 4 MHz apart, each with its tone.
    pub fn new(carriers: u16, samples: u32, bins: u16) -> Self {
        Self {
            setup: Setup {
                carriers,
                period: PERIOD as u16,
                samples,
                bins,
                start_hz: 1.1e9 + 125e3,
                step_hz: 4e6,
            },
            scatterers: vec![(1.0, 0.4), (6.3, 0.5), (16.0, 0.39)],
            noise: 3.0,
            left_out: Vec::new(),
            lost: Vec::new(),
            unsteady: Vec::new(),
            sweeps: 1,
        }
    }

    /// Carrier weights with sum 1.
    ///
    /// # Panics
    /// Never: the window is valid.
    pub fn weights(&self) -> Vec<f32> {
        let mut weights = vec![0.0; self.setup.carriers.into()];
        let window = Window::Taylor { side_lobe_db: 45.0 };
        window.fill(&mut weights).expect("side lobes of 45 dB");
        weights
    }

    /// Echo divided by reference at a carrier.
    pub fn response(&self, carrier: u16) -> Complex64 {
        let hz = self.setup.start_hz + f64::from(carrier) * self.setup.step_hz;
        let each = self.scatterers.iter().map(|(range_m, amplitude)| {
            Complex64::from_polar(*amplitude, -TAU * (hz * 2.0 * range_m / LIGHT_M_S).fract())
        });
        each.sum()
    }

    /// All bursts of a sweep. Both channels rotate with the synthesisers (an offset of 40 kHz at 1 MHz sample rate, within a hundredth of
    /// the limit of a block), and have DC offset and noise.
    pub fn bursts(&self, sweep: u32) -> Vec<SweepBurst> {
        let mut all = Vec::new();
        for carrier in (0..self.setup.carriers).filter(|own| !self.left_out.contains(own)) {
            if self.unsteady.contains(&carrier) {
                all.push(self.burst(sweep, carrier, true));
            }
            all.push(self.burst(sweep, carrier, false));
        }
        all
    }

    fn burst(&self, sweep: u32, carrier: u16, settles: bool) -> SweepBurst {
        let seed = (u64::from(sweep) << 32) + u64::from(carrier) * 2 + u64::from(settles);
        let mut random = Random(seed.wrapping_mul(0x5851_f42d_4c95_7f2d));
        let (phase, offset) = (random.uniform(), 4e-4 * (random.uniform() - 0.5));
        let response = self.response(carrier);
        let pair = |i: u32| {
            let i = f64::from(i);
            let settling = if settles {
                1.5 * (-i / 120.0).exp()
            } else {
                0.0
            };
            let turns = i / PERIOD as f64 + offset * i + phase + settling;
            let sent = Complex64::from_polar(12_000.0, TAU * turns.fract());
            [sent, sent * response].map(|z| {
                let [a, b] = random.gaussians().map(|x| x * self.noise);
                Complex::new(
                    (z.re + 90.0 + a).round() as i16,
                    (z.im - 40.0 + b).round() as i16,
                )
            })
        };
        let lost = self.lost.iter().filter(|(own, _)| *own == carrier);
        SweepBurst {
            carrier,
            samples: (0..self.setup.samples).map(pair).collect(),
            lost: lost.map(|(_, gap)| gap.clone()).collect(),
        }
    }

    /// Profile of a sweep by the core on this machine: values, number of carriers, number of samples.
    ///
    /// # Panics
    /// If the core refuses a burst.
    pub fn profile(&self, sweep: u32) -> (Vec<num_complex::Complex32>, u16, u32) {
        let mut profiler = Box::new(SceneProfiler::new());
        profiler.configure(&self.setup).expect("room");
        let weights = self.weights();
        profiler
            .set_weights(0, weights.iter().copied())
            .expect("weights");
        assert!(profiler.start(sweep), "it is configured");
        for burst in self.bursts(sweep) {
            for there in there(&burst) {
                let samples = burst.samples[there.clone()].iter().copied();
                profiler
                    .push(sweep, burst.carrier, there.start as u32, samples)
                    .expect("samples of the sweep");
            }
        }
        let profile = profiler.finish(sweep).expect("a run");
        (profile.values.to_vec(), profile.usable, profile.taken)
    }
}

/// Available samples of a burst as ranges.
pub fn there(burst: &SweepBurst) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut from = 0;
    for gap in &burst.lost {
        runs.push(from..gap.start);
        from = gap.end;
    }
    runs.push(from..burst.samples.len());
    runs.retain(|run| !run.is_empty());
    runs
}

impl SweepSource for SweepScene {
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError> {
        Ok(sweep < self.sweeps)
    }

    fn burst(
        &mut self,
        sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError> {
        let Some(own) = self.bursts(sweep).into_iter().nth(index) else {
            return Ok(false);
        };
        *burst = own;
        Ok(true)
    }
}
