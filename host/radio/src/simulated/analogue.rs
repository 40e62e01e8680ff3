//! Analogue impairments of an AD9361 beyond those of the simulator's receivers; each is disabled at zero.

use num_complex::Complex64;
use subaperture_signal::phase::cis;

/// Analogue impairments of the simulated radio.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Analogue {
    /// Whether each retune gives a synthesiser a random phase.
    pub random_phase: bool,
    /// Largest LO offset of each synthesiser, hertz; random for each retune. The offsets of the two sides add.
    pub frequency_offset_hz: f64,
    /// Settling transient after a retune; `None` for none.
    pub settling: Option<Settling>,
    /// DC offset of each receiver, relative to full scale.
    pub dc_offset: [Complex64; 2],
    /// IQ imbalance of each receiver.
    pub imbalance: [Imbalance; 2],
    /// Whether gains are rounded to steps: 0.25 dB for the transmitter, 1 dB for the receivers.
    pub gain_steps: bool,
}

/// Settling transient, which decays as `exp(-t / time_constant_s)` after each retune of a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Time constant, seconds.
    pub time_constant_s: f64,
    /// Phase deviation at the retune, radians.
    pub phase_rad: f64,
    /// Relative amplitude loss at the retune, 0 to 1.
    pub amplitude: f64,
}

/// IQ imbalance. The image is `(gain - 1 + j phase) / 2` of the signal, with `gain` the ratio of Q to I.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Imbalance {
    /// Excess gain of Q over I, as a fraction.
    pub gain: f64,
    /// Quadrature error, radians.
    pub phase_rad: f64,
}

/// Remainder below which a transient counts as over; less than the precision of float64.
const OVER: f64 = 1e-17;

impl Settling {
    /// Remaining fraction of the transient, `since_s` after the retune.
    fn left(&self, since_s: f64) -> f64 {
        libm::exp(-since_s / self.time_constant_s)
    }
}

impl Analogue {
    /// All impairments, at the level of an AD9361 not calibrated for this carrier: LO offset of 200 Hz per side, a
    /// transient of 1.5 ms that outlasts the 2 ms of a retune, DC at -40 dB, images at -35 dB.
    pub fn b210() -> Self {
        Self {
            random_phase: true,
            frequency_offset_hz: 200.0,
            settling: Some(Settling {
                time_constant_s: 1.5e-3,
                phase_rad: 6.0,
                amplitude: 0.3,
            }),
            dc_offset: [Complex64::new(0.01, -0.004), Complex64::new(-0.006, 0.008)],
            imbalance: [
                Imbalance {
                    gain: 0.02,
                    phase_rad: 0.03,
                },
                Imbalance {
                    gain: -0.03,
                    phase_rad: 0.015,
                },
            ],
            gain_steps: true,
        }
    }

    /// Whether the transients of both sides are over, `since_s` after their retunes.
    pub(super) fn has_settled(&self, since_s: [f64; 2]) -> bool {
        self.settling.is_none_or(|settling| {
            since_s
                .into_iter()
                .all(|since_s| settling.left(since_s) < OVER)
        })
    }

    /// Apply the phase and amplitude transients of both sides, `since_s` after their retunes.
    pub(super) fn settle(&self, since_s: [f64; 2], rate_hz: f64, samples: &mut [Complex64]) {
        let Some(settling) = self.settling else {
            return;
        };
        for (since_s, sign) in since_s.into_iter().zip([1.0, -1.0]) {
            let mut left = settling.left(since_s);
            let step = libm::exp(-1.0 / (rate_hz * settling.time_constant_s));
            for z in samples.iter_mut() {
                if left < OVER {
                    break;
                }
                *z *= cis(sign * settling.phase_rad * left) * (1.0 - settling.amplitude * left);
                left *= step;
            }
        }
    }

    /// Apply the DC offset and IQ imbalance of a receiver.
    pub(super) fn demodulate(&self, channel: usize, full_scale: f64, samples: &mut [Complex64]) {
        let (Imbalance { gain, phase_rad }, dc) = (
            self.imbalance[channel],
            self.dc_offset[channel] * full_scale,
        );
        let (sin, cos) = libm::sincos(phase_rad);
        for z in samples {
            let q = (1.0 + gain) * (z.im * cos + z.re * sin);
            *z = Complex64::new(z.re, q) + dc;
        }
    }
}
