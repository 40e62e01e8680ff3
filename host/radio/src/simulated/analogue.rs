//! Faults of an AD9361 that the simulator's receivers do not have: each absent where it is zero.

use num_complex::Complex64;
use subaperture_signal::phase::cis;

/// What the analogue part does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Analogue {
    /// Whether a synthesiser has a phase of its own after each retune.
    pub random_phase: bool,
    /// Most by which a synthesiser is off its carrier, hertz, at random for each retune. One side's; they add up.
    pub frequency_offset_hz: f64,
    /// What a synthesiser does after a retune.
    pub settling: Option<Settling>,
    /// Offset of each receiver, of full scale.
    pub dc_offset: [Complex64; 2],
    /// Of I against Q.
    pub imbalance: [Imbalance; 2],
    /// Whether gains go in steps: 0.25 dB of the transmitter, 1 dB of the receivers.
    pub gain_steps: bool,
}

/// A transient that decays by `exp(-t / time_constant_s)` after each retune of a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settling {
    /// Its time, seconds.
    pub time_constant_s: f64,
    /// Phase at the retune, radians.
    pub phase_rad: f64,
    /// Part of the amplitude that is missing at the retune, 0 to 1.
    pub amplitude: f64,
}

/// Of I against Q: the image is `(gain - 1 + j phase) / 2` of the signal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Imbalance {
    /// By which part Q is larger.
    pub gain: f64,
    /// By how much they are not at right angles, radians.
    pub phase_rad: f64,
}

/// What is left of a transient when it is over: below float64's digits.
const OVER: f64 = 1e-17;

impl Settling {
    /// What is left of it, `since_s` after the retune.
    fn left(&self, since_s: f64) -> f64 {
        libm::exp(-since_s / self.time_constant_s)
    }
}

impl Analogue {
    /// All of it, as bad as an AD9361 that has not been calibrated for this carrier: 200 Hz a side, a transient of 1.5 ms that a retune's
    /// 2 ms do not hide, DC at -40 dB, images at -35 dB.
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

    /// Turns and weakens samples by the transients of both sides, `since_s` after their retunes.
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

    /// The offset of DC and the image of a receiver.
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
