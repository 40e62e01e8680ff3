//! Radar: waveform, antennas and receiver.

mod carried;
mod pattern;
mod shape;
mod waveform;

use glam::DVec3;

use crate::phase_history::Band;

pub use carried::{Carried, is_directive};

/// Radar with its waveform, antennas and receiver.
#[derive(Clone, Debug)]
pub struct Radar {
    /// Transmitted waveform and sampling of the echo.
    pub waveform: Waveform,
    /// Number of pulses (sweeps, steps' cycles).
    pub num_pulses: usize,
    /// Time from pulse to pulse, seconds.
    pub pri_s: f64,
    /// Time of the first pulse, seconds from the collection's start.
    pub start_s: f64,
    /// Antennas that transmit; more than one take turns, pulse by pulse.
    pub transmitters: Vec<Antenna>,
    /// Antennas that receive, all of them every pulse.
    pub receivers: Vec<Antenna>,
    /// Model of intra-pulse motion.
    pub motion: Motion,
    /// Whether echoes weaken with range, `R0^2 / (R_tx R_rx)` in amplitude, with `R0^2` the product of the reference
    /// point's ranges in the middle pulse, number `P/2` of `P` from 0.
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
    /// Intra-pulse motion without the stop-and-go approximation: each sample uses the positions of the antennas and scatterers at the moments of
    /// transmission, scattering and reception.
    True,
}

/// Transmitted waveform and receive window.
///
/// Phases follow the project's sign: a delay `tau` at frequency `f` gives `exp(-j 2 pi f tau)`.
#[derive(Clone, Debug, PartialEq)]
pub enum Waveform {
    /// Phase history as the definition has it, flat over the band: no echo, no receiver window.
    Ideal {
        /// Frequency axis of the samples.
        band: Band,
    },
    /// A pulse of any shape, sampled at baseband about `centre_hz`; kept as echoes before the matched
    /// filter.
    Pulsed {
        /// Frequency that baseband's 0 Hz stands for.
        centre_hz: f64,
        /// Complex samples a second.
        sample_rate_hz: f64,
        /// Number of samples per echo.
        num_samples: usize,
        /// Delay of sample 0 after the pulse's start, seconds.
        window_start_s: f64,
        /// Baseband pulse shape.
        shape: PulseShape,
    },
    /// A linear sweep mixed with the echo (de-chirp on receive): the beat, with its residual video
    /// phase and range skew (Chim 2018, 2.2).
    ///
    /// With `d = tau - mixer_delay_s`, sample `k` at `t = k / sample_rate_hz` of an echo that is `tau`
    /// late is the echo times the conjugate of the copy it is mixed with,
    ///
    /// ```text
    /// exp(-j 2 pi (start_hz + chirp_hz_s (t - mixer_delay_s)) d) exp(+j pi chirp_hz_s d^2)
    /// ```
    ///
    /// exactly. The second factor is the residual video phase.
    Fmcw {
        /// Transmitted frequency at the moment of sample 0.
        start_hz: f64,
        /// Sweep rate, hertz a second; negative sweeps down.
        chirp_hz_s: f64,
        /// Complex samples a second.
        sample_rate_hz: f64,
        /// Number of samples per sweep.
        num_samples: usize,
        /// Delay of the copy that the echo is mixed with, seconds; 0 for a plain homodyne radar.
        mixer_delay_s: f64,
    },
    /// Carriers one after another, a complex number each (Chim 2018, 2.2.2 and 5.5).
    Stepped {
        /// The carriers.
        band: Band,
        /// Time from carrier to carrier, seconds.
        step_s: f64,
        /// Time over which a carrier's samples are averaged, seconds: the noise bandwidth is its
        /// inverse.
        dwell_s: f64,
    },
}

/// The shape of a pulse, at baseband.
#[derive(Clone, Debug, PartialEq)]
pub enum PulseShape {
    /// A linear frequency sweep from `-bandwidth_hz / 2` to `+bandwidth_hz / 2`, or down.
    Lfm {
        /// Swept bandwidth.
        bandwidth_hz: f64,
        /// Length.
        duration_s: f64,
        /// Whether frequency rises.
        rising: bool,
    },
    /// Chips of equal length and given phases, band-limited to the sampling rate.
    PhaseCode {
        /// Phase of each chip, radians.
        phases_rad: Vec<f64>,
        /// Length of a chip.
        chip_s: f64,
    },
}

/// An antenna on the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Antenna {
    /// A name for channels and errors.
    pub name: String,
    /// Its phase centre, metres in body axes.
    pub offset_m: DVec3,
    /// Unit vector to where it looks, body axes.
    pub boresight: DVec3,
    /// Unit vector of the beam's elevation axis, body axes, orthogonal to `boresight`: azimuth is turned
    /// about it.
    pub up: DVec3,
    /// Its pattern.
    pub pattern: Pattern,
}

/// Amplitude of an antenna over direction, one way, 1 on boresight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Pattern {
    /// Alike everywhere.
    #[default]
    Isotropic,
    /// `exp(-2 ln 2 ((az / az_w)^2 + (el / el_w)^2))` in amplitude: half the power at half the widths.
    Gaussian {
        /// Full half-power width in azimuth (about `up`), radians.
        azimuth_rad: f64,
        /// Full half-power width in elevation, radians.
        elevation_rad: f64,
    },
    /// A uniformly lit rectangle: sinc in both planes, with side lobes.
    Aperture {
        /// Full half-power width in azimuth, radians.
        azimuth_rad: f64,
        /// Full half-power width in elevation, radians.
        elevation_rad: f64,
    },
}

/// Noise, interference and quantisation of a receiver. All powers relate to the echo of 1 m² at the scene's reference point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receiver {
    /// Thermal noise; none if not given.
    pub noise: Option<ThermalNoise>,
    /// Noise of the oscillator's phase.
    pub phase_noise: Option<PhaseNoise>,
    /// Error of the clock.
    pub clock: Option<Clock>,
    /// Other transmitters.
    pub interference: Vec<Interferer>,
    /// The converter to numbers.
    pub converter: Option<Converter>,
}

/// How strong thermal noise is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThermalNoise {
    /// Power of a raw sample's noise relative to the echo of 1 m² at the reference point, dB.
    Relative {
        /// Power, dB.
        power_db: f64,
    },
    /// From the radar equation (Chim 2018, 2.1.3): transmitted power, gains, wavelength, range, losses,
    /// temperature and noise figure.
    Equation(LinkBudget),
}

/// The radar equation's parts beside wavelength, range and sampling rate.
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
    /// Noise figure of the receiver, dB. Chim 2018 (5.3) has 1.604 dB.
    pub noise_figure_db: f64,
    /// Noise temperature of the antenna, kelvin.
    pub temperature_k: f64,
}

/// Noise of an oscillator's phase: a sum of power laws, `L(f) = sum_i level_i (f / 1 Hz)^slope_i`.
/// Transmission and reception share the oscillator, so an echo's noise is the difference of two
/// moments a delay apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhaseNoise {
    /// Offsets in hertz and single-sideband levels in dBc/Hz at the carrier, straight between them on
    /// logarithmic axes; nothing outside.
    pub levels: Vec<(f64, f64)>,
}

/// Errors of the radar's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// Relative error of all frequencies (carrier, sampling rate, pulse repetition).
    pub offset: f64,
    /// RMS jitter of a pulse's start of sampling, seconds.
    pub jitter_s: f64,
}

/// A foreign transmitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interferer {
    /// Its carrier, hertz.
    pub frequency_hz: f64,
    /// Bandwidth of its noise-like signal, hertz; 0 for a tone.
    pub bandwidth_hz: f64,
    /// Power of a raw sample relative to the echo of 1 m² at the reference point, dB.
    pub power_db: f64,
    /// Part of the pulses that it disturbs, 0 to 1.
    pub duty: f64,
}

/// An analog-to-digital converter, for I and for Q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converter {
    /// Bits, sign included.
    pub bits: u32,
    /// Largest magnitude of I or Q, relative to the echo of 1 m² at the reference point, dB. Larger ones
    /// saturate.
    pub full_scale_db: f64,
}

/// Reference of phases and amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// A point of the scene: phases are compensated to it with the measured track, pulse by pulse.
    Point(DVec3),
    /// A range from the radar, metres, as a receiver with one range gate has it: the same path for all
    /// pulses. Positions count from the origin of the scene for amplitudes.
    Range(f64),
}
