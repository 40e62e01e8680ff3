//! A stepped-carrier radar's bursts, by plain sums over scatterers in float64: what its two receivers count.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::{Complex, Complex64};
use subaperture::module::link::{SweepBurst, SweepSource};
use subaperture::phase_history::ReadError;
use subaperture_core::Window;
use subaperture_core::sweep::{Profiler, Setup};

use crate::random::Random;

const LIGHT_M_S: f64 = 299_792_458.0;

/// Samples a period of the tone.
pub const PERIOD: usize = 8;
/// Room of the profilers here.
pub const CARRIERS: usize = 64;
/// Bins of the profilers here.
pub const BINS: usize = 256;

/// A profiler with this room.
pub type SceneProfiler = Profiler<PERIOD, CARRIERS, BINS>;

/// Scatterers, and what is wrong with the radio.
#[derive(Clone, Debug)]
pub struct SweepScene {
    /// What the profiler is told.
    pub setup: Setup,
    /// Ranges in metres and amplitudes, of the reference's.
    pub scatterers: Vec<(f64, f64)>,
    /// RMS of a sample's noise, counts.
    pub noise: f64,
    /// Carriers without a burst.
    pub left_out: Vec<u16>,
    /// Carriers whose burst has lost these samples.
    pub lost: Vec<(u16, Range<usize>)>,
    /// Carriers whose first burst is that of a synthesiser that settles; another follows.
    pub unsteady: Vec<u16>,
    /// Sweeps.
    pub sweeps: u32,
}

impl SweepScene {
    /// The walls and the reflector of Chim 2018, 5.6, seen by `carriers` from 1.1 GHz on, 4 MHz apart, each a tone above.
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

    /// Weights of the carriers, whose sum is 1.
    ///
    /// # Panics
    /// Never: the window is one that there is.
    pub fn weights(&self) -> Vec<f32> {
        let mut weights = vec![0.0; self.setup.carriers.into()];
        let window = Window::Taylor { side_lobe_db: 45.0 };
        window.fill(&mut weights).expect("side lobes of 45 dB");
        weights
    }

    /// Echo over reference at a carrier.
    pub fn response(&self, carrier: u16) -> Complex64 {
        let hz = self.setup.start_hz + f64::from(carrier) * self.setup.step_hz;
        let each = self.scatterers.iter().map(|(range_m, amplitude)| {
            Complex64::from_polar(*amplitude, -TAU * (hz * 2.0 * range_m / LIGHT_M_S).fract())
        });
        each.sum()
    }

    /// All bursts of a sweep: both channels turn as the synthesisers do, at 40 kHz of offset over 1 MHz of samples a hundredth of what would leave a block; an offset of DC; noise.
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

    /// What the core, run here, makes of a sweep: its values, how many carriers and samples they are of.
    ///
    /// # Panics
    /// If it does not take it.
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

/// The samples of a burst that are not lost, run by run.
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
