//! Levels, noise and margins along a signal chain.

use serde::Serialize;

use super::keys::{Chain, Stage, db, dbm};
use crate::radar_equation::{echo_power_w, noise_power_w};
use subaperture_model::radar::LinkBudget;
use subaperture_model::units::power_of_db;

/// Level at the output of a transmit stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TransmitLevels {
    /// Name of the stage.
    pub name: String,
    /// Level at the output, dBm.
    pub level_dbm: f64,
    /// Output level at 1 dB of compression, dBm; `None` without a limit.
    pub compression_dbm: Option<f64>,
    /// Compression point less level, dB; negative if the stage compresses.
    pub margin_db: Option<f64>,
}

/// Levels at the output of a receive stage. The first row of a chain is the port of the antenna.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReceiveLevels {
    /// Name of the stage.
    pub name: String,
    /// Gain from the antenna's port, dB.
    pub gain_db: f64,
    /// Noise figure from the antenna's port, dB.
    pub noise_figure_db: f64,
    /// Level of the transmitter's leakage, dBm.
    pub leakage_dbm: f64,
    /// Level of the target at the nearest corner of the scene, dBm.
    pub nearest_dbm: f64,
    /// Level of the target at the farthest corner of the scene, dBm.
    pub farthest_dbm: f64,
    /// Signal-to-noise ratio of a sample of the target at the scene centre, dB.
    pub snr_db: f64,
    /// Output level at 1 dB of compression, dBm; `None` without a limit.
    pub compression_dbm: Option<f64>,
    /// Compression point less the level of leakage and nearest target in phase, dB; negative if the stage compresses.
    pub margin_db: Option<f64>,
}

/// Levels at the input of the converter, and the SNR after it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConverterLevels {
    /// Level of leakage and nearest target in phase, dBm.
    pub level_dbm: f64,
    /// Level of a tone at full scale, dBm.
    pub full_scale_dbm: f64,
    /// Full scale less level, dB; negative if samples saturate.
    pub margin_db: f64,
    /// Thermal noise at the input, dBm.
    pub thermal_noise_dbm: f64,
    /// Quantisation noise referred to the input, dBm.
    pub quantisation_noise_dbm: f64,
    /// Upper limit of the dynamic range, dBm.
    pub upper_limit_dbm: f64,
    /// Stage that sets the upper limit, or `converter`.
    pub limited_by: String,
    /// Dynamic range from the larger noise to the upper limit, dB.
    pub dynamic_range_db: f64,
    /// Signal-to-noise ratio of a sample of the target at the scene centre, with both noise powers, dB.
    pub sample_snr_db: f64,
    /// SNR after pulse compression, dB.
    pub pulse_snr_db: f64,
    /// SNR in the image, dB.
    pub image_snr_db: f64,
}

/// Levels along a whole chain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChainLevels {
    /// Levels of the transmit stages.
    pub transmit: Vec<TransmitLevels>,
    /// Power at the transmit antenna, dBm.
    pub transmitted_dbm: f64,
    /// Levels of the antenna and the receive stages.
    pub receive: Vec<ReceiveLevels>,
    /// Levels at the converter.
    pub converter: ConverterLevels,
    /// Receive stage with the smallest margin, or `converter`: the first to saturate as the received level rises.
    pub first_to_saturate: String,
}

/// Name of the converter among the stages.
const CONVERTER: &str = "converter";

/// Level of two tones in phase, dBm.
fn in_phase_dbm(a_dbm: f64, b_dbm: f64) -> f64 {
    let (high, low) = (a_dbm.max(b_dbm), a_dbm.min(b_dbm));
    high + 20.0 * (1.0 + power_of_db((low - high) / 2.0)).log10()
}

/// Noise factor after one more stage behind a cascade of `gain_db` and noise factor `factor` (Friis).
fn friis(factor: f64, gain_db: f64, stage: &Stage) -> f64 {
    factor + (power_of_db(stage.noise_figure_db) - 1.0) / power_of_db(gain_db)
}

impl Chain {
    /// Power at the transmit antenna, dBm.
    pub fn transmitted_dbm(&self) -> f64 {
        self.exciter_dbm + self.transmit.iter().map(|stage| stage.gain_db).sum::<f64>()
    }

    /// Noise figure of all receive stages, dB, without quantisation noise.
    pub fn noise_figure_db(&self) -> f64 {
        let mut gain_db = 0.0;
        db(self.receive.iter().fold(1.0, |factor, stage| {
            let factor = friis(factor, gain_db, stage);
            gain_db += stage.gain_db;
            factor
        }))
    }

    /// Link budget of the radar equation.
    pub fn link(&self) -> LinkBudget {
        LinkBudget {
            power_w: power_of_db(self.transmitted_dbm() - 30.0),
            transmit_gain_dbi: self.transmit_gain_dbi,
            receive_gain_dbi: self.receive_gain_dbi,
            losses_db: self.losses_db,
            noise_figure_db: self.noise_figure_db(),
            temperature_k: self.temperature_k,
        }
    }

    /// Levels for targets whose one-way ranges to transmitter and receiver are given, metres: at the nearest corner, the centre and the
    /// farthest corner of the scene.
    pub fn levels(
        &self,
        wavelength_m: f64,
        ranges_m: [[f64; 2]; 3],
        num_pulses: usize,
    ) -> ChainLevels {
        let link = self.link();
        let bandwidth_hz = self.converter.sample_rate_hz;
        let transmitted_dbm = self.transmitted_dbm();
        let [nearest_dbm, centre_dbm, farthest_dbm] = ranges_m.map(|[out_m, back_m]| {
            dbm(self.cross_section_m2 * echo_power_w(&link, wavelength_m, out_m, back_m))
        });
        // Noise of a cascade of noise factor F, referred to the antenna's port.
        let noise_dbm = |factor: f64| {
            let of_cascade = LinkBudget {
                noise_figure_db: db(factor),
                ..link
            };
            dbm(noise_power_w(&of_cascade, bandwidth_hz))
        };
        let mut row = ReceiveLevels {
            name: "antenna".to_owned(),
            gain_db: 0.0,
            noise_figure_db: 0.0,
            leakage_dbm: transmitted_dbm - self.isolation_db,
            nearest_dbm,
            farthest_dbm,
            snr_db: centre_dbm - noise_dbm(1.0),
            compression_dbm: None,
            margin_db: None,
        };
        let (mut factor, mut receive) = (1.0, vec![row.clone()]);
        for stage in &self.receive {
            factor = friis(factor, row.gain_db, stage);
            row.name.clone_from(&stage.name);
            row.noise_figure_db = db(factor);
            row.snr_db = centre_dbm - noise_dbm(factor);
            for level in [
                &mut row.gain_db,
                &mut row.leakage_dbm,
                &mut row.nearest_dbm,
                &mut row.farthest_dbm,
            ] {
                *level += stage.gain_db;
            }
            let level_dbm = in_phase_dbm(row.leakage_dbm, row.nearest_dbm);
            row.compression_dbm = stage.compression_dbm;
            row.margin_db = stage.compression_dbm.map(|limit_dbm| limit_dbm - level_dbm);
            receive.push(row.clone());
        }
        let signal_dbm = centre_dbm + row.gain_db;
        let level_dbm = in_phase_dbm(row.leakage_dbm, row.nearest_dbm);
        let thermal_dbm = noise_dbm(factor) + row.gain_db;
        let converter = self.converter_levels(signal_dbm, level_dbm, thermal_dbm, num_pulses);
        let margins = receive
            .iter()
            .filter_map(|row| Some((row.margin_db?, &*row.name)));
        let least = margins
            .chain([(converter.margin_db, CONVERTER)])
            .min_by(|a, b| a.0.total_cmp(&b.0));
        ChainLevels {
            transmit: self.transmit_levels(),
            transmitted_dbm,
            first_to_saturate: least.map_or(CONVERTER, |(_, name)| name).to_owned(),
            receive,
            converter,
        }
    }

    fn transmit_levels(&self) -> Vec<TransmitLevels> {
        let mut level_dbm = self.exciter_dbm;
        let rows = self.transmit.iter().map(|stage| {
            level_dbm += stage.gain_db;
            TransmitLevels {
                name: stage.name.clone(),
                level_dbm,
                compression_dbm: stage.compression_dbm,
                margin_db: stage.compression_dbm.map(|limit_dbm| limit_dbm - level_dbm),
            }
        });
        rows.collect()
    }

    /// Converter after a cascade: level of the target at the scene centre, largest level and thermal noise at its input, dBm.
    fn converter_levels(
        &self,
        signal_dbm: f64,
        level_dbm: f64,
        thermal_dbm: f64,
        num_pulses: usize,
    ) -> ConverterLevels {
        let converter = &self.converter;
        // A full-scale tone has half the square of the amplitude, a step of 2 / 2^b a twelfth of its square.
        let quantisation_dbm = converter.full_scale_dbm - db(1.5 * 4f64.powf(converter.bits));
        let mut after_db = 0.0;
        let mut limit = (converter.full_scale_dbm, CONVERTER);
        for stage in self.receive.iter().rev() {
            if let Some(compression_dbm) = stage.compression_dbm
                && compression_dbm + after_db < limit.0
            {
                limit = (compression_dbm + after_db, &stage.name);
            }
            after_db += stage.gain_db;
        }
        let noise_dbm = db(power_of_db(thermal_dbm) + power_of_db(quantisation_dbm));
        let sample_snr_db = signal_dbm - noise_dbm;
        let pulse_snr_db = sample_snr_db + db(self.pulse_s * converter.sample_rate_hz);
        ConverterLevels {
            level_dbm,
            full_scale_dbm: converter.full_scale_dbm,
            margin_db: converter.full_scale_dbm - level_dbm,
            thermal_noise_dbm: thermal_dbm,
            quantisation_noise_dbm: quantisation_dbm,
            upper_limit_dbm: limit.0,
            limited_by: limit.1.to_owned(),
            dynamic_range_db: limit.0 - thermal_dbm.max(quantisation_dbm),
            sample_snr_db,
            pulse_snr_db,
            image_snr_db: pulse_snr_db + db(num_pulses as f64),
        }
    }
}

impl ChainLevels {
    /// Warnings of stages that compress, with the attenuation that cures them.
    pub fn warnings(&self) -> Vec<String> {
        let warning = |name: &str, limit: &str, limit_dbm: f64, margin_db: f64| {
            (margin_db < 0.0).then(|| {
                format!(
                    "{name}: level of {:.1} dBm exceeds {limit} of {limit_dbm:.1} dBm; insert {:.1} dB of attenuation before it",
                    limit_dbm - margin_db,
                    -margin_db
                )
            })
        };
        let compression = "the output compression point";
        let transmit = self.transmit.iter().filter_map(|row| {
            let (limit_dbm, margin_db) = row.compression_dbm.zip(row.margin_db)?;
            warning(&row.name, compression, limit_dbm, margin_db)
        });
        let receive = self.receive.iter().filter_map(|row| {
            let (limit_dbm, margin_db) = row.compression_dbm.zip(row.margin_db)?;
            warning(&row.name, compression, limit_dbm, margin_db)
        });
        let converter = &self.converter;
        let samples = warning(
            CONVERTER,
            "full scale",
            converter.full_scale_dbm,
            converter.margin_db,
        );
        transmit.chain(receive).chain(samples).collect()
    }
}
