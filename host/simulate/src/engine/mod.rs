//! The sum over scatterers: what one pair of antennas records of one pulse.
//!
//! Sample `k`, at frequency `f_k = start_hz + k step_hz` and time `t_k = start_s + k step_s` after
//! the pulse's own, of scatterers `s` of amplitude `a_s` at delay `tau_s(t)`:
//!
//! ```text
//! z[k] = sum_s a_s g_s exp(-j 2 pi f_k d_s(t_k)) exp(+j pi residual_hz_s d_s(t_k)^2),
//! d_s(t) = tau_s(t) - reference_s
//! ```
//!
//! with `g_s` the antennas' amplitude towards the scatterer and, if asked, the spreading. The sum over
//! everything in the scene is all this module does; noise, windows and files are others' work.
//!
//! [`Method::Fast`] is held to -90 dB of [`Method::Sum`] by `tests/simulate/engine.rs`; measured are -124 dB
//! with the radar standing still and -109 dB with true motion. One core, 512 samples, plain x86-64, a point and
//! pulse (`benches/simulate.rs`): 1500 ns the sum, 17 ns fast, 12 ns recycled, 67 ns with true motion. Where
//! the antennas' ways bend too much for runs of 16 samples, or a scatterer sits on an antenna in true
//! motion, the fast sum is the plain one. A pulse is computed by one thread, in a fixed order.

mod arc;
mod chunk;
mod delay;
mod fast;
mod illumination;
mod lattice;
mod nufft;
mod run;
mod sum;

use num_complex::Complex64;

use self::chunk::Chunk;
use self::lattice::Lattice;
use crate::scene::Scene;
use subaperture_model::radar::{Antenna, Motion};
use subaperture_model::track::Trajectory;

/// How sums are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Method {
    /// The plain sum in float64: slow, and the measure of the other.
    Sum,
    /// A non-uniform FFT a pulse, with tables reused from pulse to pulse where the track allows.
    #[default]
    Fast,
}

/// The samples of a pulse: their frequencies and times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// From sample to sample, hertz.
    pub step_hz: f64,
    /// Number of samples.
    pub count: usize,
    /// Time of sample 0 after the pulse's, seconds.
    pub start_s: f64,
    /// From sample to sample, seconds.
    pub step_s: f64,
    /// Chirp rate whose residual video phase stays in the samples; 0 for none.
    pub residual_hz_s: f64,
}

/// One pulse of one pair of antennas.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// What carries the antennas.
    pub body: &'a dyn Trajectory,
    /// The one that transmits.
    pub transmitter: &'a Antenna,
    /// The one that receives.
    pub receiver: &'a Antenna,
    /// Time of the pulse, seconds.
    pub time_s: f64,
    /// Its samples.
    pub sweep: Sweep,
    /// Delay that counts as zero, seconds.
    pub reference_s: f64,
    /// What moves meanwhile.
    pub motion: Motion,
    /// Range at which spreading is 1, that of the reference point in the middle pulse, metres; `None` for no
    /// spreading.
    pub spreading_from_m: Option<f64>,
}

/// A scene made ready for sums over it.
///
/// Memory: for [`Method::Fast`] 32 bytes a point beside the scene's 40.
#[derive(Debug)]
pub struct Engine<'a> {
    scene: &'a Scene,
    method: Method,
    points: Vec<Chunk>,
    lattice: Option<Lattice>,
}

/// Working memory of one thread. What it was used for before never matters.
#[derive(Debug, Default)]
pub struct Scratch {
    work: run::Work,
}

impl<'a> Engine<'a> {
    /// Prepares `scene`.
    pub fn new(scene: &'a Scene, method: Method) -> Self {
        let points = match method {
            Method::Sum => Vec::new(),
            Method::Fast => fast::chunks(scene.points.iter().copied()),
        };
        Self {
            scene,
            method,
            points,
            lattice: None,
        }
    }

    /// Prepares `scene` for the pulses `views` of one pair of antennas, in their order. On a straight, even track
    /// over a lattice of points, what the radar sees is kept in tables of at most `memory_bytes` and
    /// reused; else, and for other pulses, this is [`Self::new`].
    pub fn for_track(scene: &'a Scene, method: Method, views: &[View], memory_bytes: u64) -> Self {
        let mut engine = Self::new(scene, method);
        if method == Method::Fast {
            engine.lattice = Lattice::new(scene, views, memory_bytes);
        }
        engine
    }

    /// Bytes held beside the scene.
    pub fn held_bytes(&self) -> u64 {
        let tables = self.lattice.as_ref().map_or(0, Lattice::held_bytes);
        size_of_val(self.points.as_slice()) as u64 + tables
    }

    /// Whether tables for a track are in use.
    pub fn recycles(&self) -> bool {
        self.lattice.is_some()
    }

    /// Sets `out` to the samples of the pulse that `view` describes.
    ///
    /// # Panics
    /// If `out` does not hold `view.sweep.count` samples.
    pub fn pulse(&self, view: &View, scratch: &mut Scratch, out: &mut [Complex64]) {
        assert_eq!(out.len(), view.sweep.count, "out must hold the sweep");
        match self.method {
            Method::Sum => sum::pulse(self.scene, view, out),
            Method::Fast => fast::pulse(
                self.scene,
                &self.points,
                self.lattice.as_ref(),
                view,
                &mut scratch.work,
                out,
            ),
        }
    }
}
