//! Receiver impairments: `[radar.noise]` and related sections.

use subaperture_model::radar::{
    Clock, Converter, Interferer, LinkBudget, PhaseNoise, Receiver, ThermalNoise,
};

use crate::declare::{Located, section};
use crate::error::Fault;

/// Impairments of a receiver.
#[section]
#[derive(Clone, Debug)]
pub struct ReceiverKeys {
    /// Thermal noise of the receiver.
    #[section]
    pub noise: Option<NoiseKeys>,
    /// Phase noise of the oscillator shared by transmitter and receiver.
    #[section]
    pub phase_noise: Option<PhaseNoiseKeys>,
    /// Errors of the sample clock.
    #[section]
    pub clock: Option<ClockKeys>,
    /// Interfering transmitter.
    #[section]
    pub interference: Vec<InterferenceKeys>,
    /// Analogue-to-digital converters of I and Q.
    #[section]
    pub converter: Option<ConverterKeys>,
}

/// Thermal noise.
#[section]
#[derive(Clone, Copy, Debug)]
pub struct NoiseKeys {
    /// Noise power relative to an echo, or by the radar equation.
    #[key(default = "relative", select(Relative, Equation))]
    pub kind: NoiseModel,
    /// Noise power of a raw sample relative to the echo of 1 m^2 at the reference.
    #[key(required = "-20 dB", within(-300.0, 300.0, "-300 to 300 dB"), when(Relative))]
    pub power_db: f64,
    /// Peak transmit power.
    #[key(required = "30 dBm", positive, when(Equation))]
    pub transmitted_w: f64,
    /// Gain of the transmit antenna on boresight.
    #[key(default = "0 dBi", within(-300.0, 300.0, "-300 to 300 dB"), when(Equation))]
    pub transmit_gain_dbi: f64,
    /// Gain of the receive antenna on boresight.
    #[key(default = "0 dBi", within(-300.0, 300.0, "-300 to 300 dB"), when(Equation))]
    pub receive_gain_dbi: f64,
    /// System losses.
    #[key(default = "0 dB", within(0.0, 300.0, "0 to 300 dB"), when(Equation))]
    pub losses_db: f64,
    /// Noise figure of the receiver.
    #[key(default = "3 dB", within(0.0, 300.0, "0 to 300 dB"), when(Equation))]
    pub noise_figure_db: f64,
    /// Noise temperature of the antenna.
    #[key(default = "290 K", not_negative, when(Equation))]
    pub temperature_k: f64,
}

/// Phase noise.
#[section]
#[derive(Clone, Debug)]
pub struct PhaseNoiseKeys {
    /// Ascending offset frequencies from the carrier, and single-sideband levels; interpolated linearly on logarithmic axes, zero outside.
    #[key(
        required = ["10 Hz, -60 dBc/Hz", "1 kHz, -90 dBc/Hz", "1 MHz, -120 dBc/Hz"],
        rows(2, Frequency, PhaseNoise)
    )]
    pub levels: Located<Vec<(f64, f64)>>,
}

/// Errors of the sample clock.
#[section]
#[derive(Clone, Copy, Debug)]
pub struct ClockKeys {
    /// Fractional error of all frequencies.
    #[key(default = "0 ppm", within(-0.1, 0.1, "-10 to 10 %"))]
    pub offset: f64,
    /// RMS jitter of the start of sampling of each pulse.
    #[key(default = "0 s", not_negative)]
    pub jitter_s: f64,
}

/// Interfering transmitter.
#[section]
#[derive(Clone, Copy, Debug)]
pub struct InterferenceKeys {
    /// Carrier frequency.
    #[key(required = "10.02 GHz", positive)]
    pub frequency_hz: f64,
    /// Bandwidth of a noise-like signal; 0 for a tone.
    #[key(default = "0 Hz", not_negative)]
    pub bandwidth_hz: f64,
    /// Power of the interference in a raw sample relative to the echo of 1 m^2 at the reference.
    #[key(required = "10 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub power_db: f64,
    /// Duty cycle: fraction of the pulses with interference.
    #[key(default = 1, within(0.0, 1.0, "0 to 1"))]
    pub duty: f64,
}

/// Analogue-to-digital converters.
#[section]
#[derive(Clone, Copy, Debug)]
pub struct ConverterKeys {
    /// Number of bits, sign included.
    #[key(required = 12, whole(1, 24))]
    pub bits: u32,
    /// Largest magnitude of I or Q relative to the echo of 1 m^2 at the reference; larger values saturate.
    #[key(required = "40 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub full_scale_db: f64,
}

impl ReceiverKeys {
    pub(crate) fn build(&self) -> Result<Receiver, Fault> {
        let phase_noise = self.phase_noise.as_ref().map(PhaseNoiseKeys::build);
        Ok(Receiver {
            noise: self.noise.map(NoiseKeys::build),
            phase_noise: phase_noise.transpose()?,
            clock: self.clock.map(|clock| Clock {
                offset: clock.offset,
                jitter_s: clock.jitter_s,
            }),
            interference: (self.interference.iter())
                .map(|interference| Interferer {
                    frequency_hz: interference.frequency_hz,
                    bandwidth_hz: interference.bandwidth_hz,
                    power_db: interference.power_db,
                    duty: interference.duty,
                })
                .collect(),
            converter: self.converter.map(|converter| Converter {
                bits: converter.bits,
                full_scale_db: converter.full_scale_db,
            }),
        })
    }
}

impl NoiseKeys {
    fn build(self) -> ThermalNoise {
        match self.kind {
            NoiseModel::Relative(noise) => ThermalNoise::Relative {
                power_db: noise.power_db,
            },
            NoiseModel::Equation(link) => ThermalNoise::Equation(LinkBudget {
                power_w: link.transmitted_w,
                transmit_gain_dbi: link.transmit_gain_dbi,
                receive_gain_dbi: link.receive_gain_dbi,
                losses_db: link.losses_db,
                noise_figure_db: link.noise_figure_db,
                temperature_k: link.temperature_k,
            }),
        }
    }
}

impl PhaseNoiseKeys {
    fn build(&self) -> Result<PhaseNoise, Fault> {
        let rising = self.levels.windows(2).all(|pair| pair[0].0 < pair[1].0);
        if self.levels[0].0 <= 0.0 || !rising {
            return Err(self.levels.fault(
                "expected ascending offset frequencies above 0: sort the rows by frequency",
            ));
        }
        Ok(PhaseNoise {
            levels: self.levels.to_vec(),
        })
    }
}
