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

mod delay;
mod sum;

use num_complex::Complex64;

use crate::simulate::body::Trajectory;
use crate::simulate::radar::{Antenna, Motion};
use crate::simulate::scene::Scene;

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
    /// Range at which spreading is 1, metres; `None` for no spreading.
    pub spreading_from_m: Option<f64>,
}

/// A scene made ready for sums over it.
#[derive(Debug)]
pub struct Engine {
    scene: Scene,
    method: Method,
}

/// Working memory of one thread. What it was used for before never matters.
#[derive(Debug, Default)]
pub struct Scratch {}

impl Engine {
    /// Prepares `scene`.
    pub fn new(scene: &Scene, method: Method) -> Engine {
        Engine {
            scene: scene.clone(),
            method,
        }
    }

    /// Sets `out` to the samples of the pulse that `view` describes.
    ///
    /// # Panics
    /// If `out` does not hold `view.sweep.count` samples.
    pub fn pulse(&self, view: &View, scratch: &mut Scratch, out: &mut [Complex64]) {
        assert_eq!(out.len(), view.sweep.count, "out must hold the sweep");
        let _ = scratch;
        match self.method {
            Method::Sum | Method::Fast => sum::pulse(&self.scene, view, out),
        }
    }
}
