//! Radar: waveform, antennas and receiver.

mod mounted_antennas;
mod shape;
mod waveform;

use glam::DVec3;
use num_complex::Complex64;

use crate::phase_history::Band;

pub use crate::antenna::{Antenna, MountedAntennas, Pattern, PatternTable, is_directive};

/// Radar with its waveform, antennas and receiver.
#[derive(Clone, Debug)]
pub struct Radar {
    /// Transmitted waveform and sampling of the echo.
    pub waveform: Waveform,
    /// Number of pulses (sweeps, or cycles of carriers).
    pub num_pulses: usize,
    /// Time from pulse to pulse, seconds.
    pub pri_s: f64,
    /// Time of the first pulse, seconds from the collection's start.
    pub start_s: f64,
    /// Transmitting antennas. Several alternate from pulse to pulse.
    pub transmitters: Vec<Antenna>,
    /// Receiving antennas, all of which receive every pulse.
    pub receivers: Vec<Antenna>,
    /// Model of intra-pulse motion.
    pub motion: Motion,
    /// Whether echoes have spreading loss, `R0^2 / (R_tx R_rx)` in amplitude, with `R0^2` the product of the
    /// reference point's ranges in the middle pulse, number `P/2` of `P` from 0.
    pub spreading: bool,
    /// Noise, interference and quantisation of the receiver.
    pub receiver: Receiver,
}

/// Model of intra-pulse motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// Stop-and-go approximation: the radar is at rest until the echo has arrived.
    #[default]
    StopAndGo,
    /// Intra-pulse motion without the stop-and-go approximation: each sample uses the positions of antennas and
    /// scatterers at the times of transmission, scattering and reception.
    True,
}

/// Transmitted waveform and receive window.
///
/// Phases follow the project's sign: a delay `tau` at frequency `f` gives `exp(-j 2 pi f tau)`.
#[derive(Clone, Debug, PartialEq)]
pub enum Waveform {
    /// Phase history by definition, flat over the band: no echo, no receive window.
    Ideal {
        /// Frequency axis of the samples.
        band: Band,
    },
    /// Pulse of any shape, sampled at baseband about `centre_hz`; stored as echoes before the matched filter.
    Pulsed {
        /// Frequency that 0 Hz at baseband corresponds to.
        centre_hz: f64,
        /// Sampling rate of complex samples.
        sample_rate_hz: f64,
        /// Number of samples per echo.
        num_samples: usize,
        /// Delay of sample 0 after the pulse's start, seconds.
        window_start_s: f64,
        /// Baseband pulse shape.
        shape: PulseShape,
    },
    /// Linear sweep mixed with the echo (deramp on receive): the beat signal, with its residual video phase and range
    /// skew (Chim 2018, 2.2).
    ///
    /// With `d = tau - mixer_delay_s`, sample `k` at `t = k / sample_rate_hz` of an echo with delay `tau` is the echo
    /// times the conjugate of the copy that it is mixed with,
    ///
    /// ```text
    /// exp(-j 2 pi (start_hz + chirp_hz_s (t - mixer_delay_s)) d) exp(+j pi chirp_hz_s d^2)
    /// ```
    ///
    /// exactly. The second factor is the residual video phase.
    Fmcw {
        /// Transmitted frequency at the time of sample 0.
        start_hz: f64,
        /// Sweep rate, hertz per second; negative for a falling sweep.
        chirp_hz_s: f64,
        /// Sampling rate of complex samples.
        sample_rate_hz: f64,
        /// Number of samples per sweep.
        num_samples: usize,
        /// Delay of the copy that the echo is mixed with, seconds; 0 for a homodyne radar.
        mixer_delay_s: f64,
    },
    /// Carriers one after another, with one complex sample each (Chim 2018, 2.2.2 and 5.5).
    Stepped {
        /// Carrier frequencies.
        band: Band,
        /// Time from carrier to carrier, seconds.
        step_s: f64,
        /// Averaging time per carrier, seconds; the noise bandwidth is its inverse.
        dwell_s: f64,
    },
}

/// Baseband shape of a pulse.
#[derive(Clone, Debug, PartialEq)]
pub enum PulseShape {
    /// Linear frequency sweep from `-bandwidth_hz / 2` to `+bandwidth_hz / 2`, or falling.
    Lfm {
        /// Swept bandwidth.
        bandwidth_hz: f64,
        /// Duration.
        duration_s: f64,
        /// Whether the frequency rises.
        rising: bool,
    },
    /// Chips of equal duration and given phases, band-limited to the sampling rate.
    PhaseCode {
        /// Phase of each chip, radians.
        phases_rad: Vec<f64>,
        /// Duration of a chip.
        chip_s: f64,
    },
    /// Samples of the transmitted pulse, the first at its start.
    Recorded {
        /// Complex samples at baseband.
        samples: Vec<Complex64>,
        /// Sampling rate of the samples.
        rate_hz: f64,
        /// Band in use, about 0 Hz.
        bandwidth_hz: f64,
    },
}

/// Noise, interference and quantisation of a receiver. All powers relate to the echo of 1 m² at the scene's reference point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receiver {
    /// Thermal noise.
    pub noise: Option<ThermalNoise>,
    /// Phase noise of the oscillator.
    pub phase_noise: Option<PhaseNoise>,
    /// Clock errors.
    pub clock: Option<Clock>,
    /// Interfering transmitters.
    pub interference: Vec<Interferer>,
    /// Analog-to-digital converter.
    pub converter: Option<Converter>,
}

/// Level of the thermal noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThermalNoise {
    /// Noise power of a raw sample relative to the echo of 1 m² at the reference point, dB.
    Relative {
        /// Power, dB.
        power_db: f64,
    },
    /// Noise from the radar equation (Chim 2018, 2.1.3): transmitted power, gains, wavelength, range, losses,
    /// temperature and noise figure.
    Equation(LinkBudget),
}

/// Parameters of the radar equation, except wavelength, range and sampling rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkBudget {
    /// Peak transmitted power, watts.
    pub power_w: f64,
    /// Gain of the transmitting antenna on boresight, dBi.
    pub transmit_gain_dbi: f64,
    /// Gain of the receiving antenna on boresight, dBi.
    pub receive_gain_dbi: f64,
    /// Losses, dB.
    pub losses_db: f64,
    /// Noise figure of the receiver, dB; 1.604 dB in Chim 2018 (5.3).
    pub noise_figure_db: f64,
    /// Noise temperature of the antenna, kelvin.
    pub temperature_k: f64,
}

/// Phase noise of an oscillator: a sum of power laws, `L(f) = sum_i level_i (f / 1 Hz)^slope_i`. Transmission and
/// reception share the oscillator, so the phase noise of an echo is the difference between two times one delay apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhaseNoise {
    /// Offsets in hertz and single-sideband levels in dBc/Hz at the carrier, interpolated linearly on logarithmic
    /// axes; no noise outside.
    pub levels: Vec<(f64, f64)>,
}

/// Errors of the radar's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// Relative error of all frequencies (carrier, sampling rate, pulse repetition).
    pub offset: f64,
    /// RMS jitter of the sampling start of a pulse, seconds.
    pub jitter_s: f64,
}

/// Interfering transmitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interferer {
    /// Carrier frequency, hertz.
    pub frequency_hz: f64,
    /// Bandwidth of the noise-like signal, hertz; 0 for a tone.
    pub bandwidth_hz: f64,
    /// Power of a raw sample relative to the echo of 1 m² at the reference point, dB.
    pub power_db: f64,
    /// Fraction of pulses that it disturbs, 0 to 1.
    pub duty: f64,
}

/// Analog-to-digital converter for I and Q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converter {
    /// Number of bits, including the sign.
    pub bits: u32,
    /// Full scale: largest magnitude of I or Q, relative to the echo of 1 m² at the reference point, dB. Larger
    /// values saturate.
    pub full_scale_db: f64,
}

/// Reference of phases and amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// Point of the scene: phases are compensated to it with the measured track, pulse by pulse.
    Point(DVec3),
    /// Range from the radar, metres, as in a receiver with one range gate: the same path for all pulses. Amplitudes
    /// refer to the scene's origin.
    Range(f64),
}
