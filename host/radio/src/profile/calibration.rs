//! What cables, channels and the empty scene do, measured once and kept as a file with its date.
//!
//! Two captures make it: one of nothing (the sky), which holds the leakage from antenna to antenna, and one with one reflector
//! at a range that was measured with a tape. With `s_n` of the sky and the reflector's echo `a exp(-j 2 pi f_n (2 R / c + d))` in what is left,
//!
//! ```text
//! calibrated z_n = (z_n - s_n) exp(+j 2 pi f_n d) / a
//! ```
//!
//! so that ranges count from where the tape began, and amplitudes are relative to that reflector's. `d` is the delay of the antenna's cables
//! less that of the loop; `a` is read at the peak, so that channels' gains and phases are in it. Neglected: gains that change with frequency, and
//! reflectors' phases: a trihedral's is that of a point at its apex.
//!
//! It holds for the carriers, the tone, the gains and the ports it was made with, and is refused for others.

use std::io::Write;
use std::path::Path;

use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use subaperture_io::atomic::{WriteError, write_atomically};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;

use super::{ProfileError, Sweep};
use crate::sigmf::Setup;

/// Longest file that is read, bytes.
const LONGEST_BYTES: u64 = 16 << 20;

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// When, as whoever made it writes dates.
    pub date: String,
    /// With what.
    pub setup: Setup,
    /// Delay to be taken off, seconds.
    pub delay_s: f64,
    /// Amplitude of the reflector, real and imaginary part.
    pub amplitude: [f64; 2],
    /// The empty scene, real and imaginary part of each carrier.
    pub sky: Vec<[f64; 2]>,
}

/// Why a calibration is of no use.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// It was made with another set-up.
    #[error("the calibration of {date} was made with {what}: calibrate anew")]
    Other {
        /// Its date.
        date: String,
        /// What differs, and how.
        what: String,
    },
    /// Nothing is seen of the reflector.
    #[error(
        "no reflector is seen near {range_m} m: is it there, and larger than what else reflects?"
    )]
    NotSeen {
        /// Where it should be.
        range_m: f64,
    },
    /// The file.
    #[error("{path}: {what}")]
    File {
        /// Its path.
        path: String,
        /// What is wrong.
        what: String,
    },
}

impl Calibration {
    /// Of a sweep of the sky and one with a reflector at `range_m`, the strongest within `search_m` of there; what cables add must be less.
    ///
    /// # Errors
    /// If a sweep has too many gaps, or no reflector is seen.
    pub fn measure(
        date: &str,
        setup: &Setup,
        sky: &Sweep,
        reflector: &Sweep,
        range_m: f64,
        search_m: f64,
    ) -> Result<Self, ProfileError> {
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz);
        let reach_m = 0.75 * unambiguous_m;
        let sky = sky.filled(reach_m)?;
        let echo: Vec<Option<Complex64>> = reflector
            .filled(reach_m)?
            .iter()
            .zip(&sky)
            .map(|(z, s)| Some(z - s))
            .collect();
        let sweep = Sweep {
            values: echo,
            ..reflector.clone()
        };
        let profile = sweep.profile(Window::default(), 32, reach_m)?;
        let near = |peak: &super::Peak| (peak.range_m - range_m).abs() <= search_m;
        let peaks = profile.peaks(0.0).into_iter().filter(near);
        let strongest = peaks.max_by(|a, b| a.magnitude.total_cmp(&b.magnitude));
        let Some(peak) = strongest.filter(|peak| peak.magnitude > 0.0) else {
            return Err(CalibrationError::NotSeen { range_m }.into());
        };
        let delay_s = 2.0 * (peak.range_m - range_m) / SPEED_OF_LIGHT_M_S;
        // What the profile reads there once the delay is off, carrier by carrier: at the peak itself all echoes are in step.
        let weights = Window::default().weights(sweep.values.len());
        let mut amplitude = Complex64::ZERO;
        for (n, (z, weight)) in sweep.values.iter().flatten().zip(&weights).enumerate() {
            let path_s = 2.0 * range_m / SPEED_OF_LIGHT_M_S + delay_s;
            amplitude += z * phasor(sweep.frequency_hz(n) * path_s) * weight;
        }
        amplitude /= weights.iter().sum::<f64>();
        Ok(Self {
            date: date.to_owned(),
            setup: setup.clone(),
            delay_s,
            amplitude: [amplitude.re, amplitude.im],
            sky: sky.iter().map(|z| [z.re, z.im]).collect(),
        })
    }

    /// A sweep without cables, channels and the empty scene.
    ///
    /// # Errors
    /// If it was made with another set-up.
    pub fn apply(&self, setup: &Setup, sweep: &Sweep) -> Result<Sweep, CalibrationError> {
        self.fits(setup).map_err(|what| CalibrationError::Other {
            date: self.date.clone(),
            what,
        })?;
        let mut calibrated = sweep.clone();
        let amplitude = Complex64::new(self.amplitude[0], self.amplitude[1]);
        for (n, (value, sky)) in calibrated.values.iter_mut().zip(&self.sky).enumerate() {
            let turn = phasor(sweep.frequency_hz(n) * self.delay_s) / amplitude;
            *value = value.map(|z| (z - Complex64::new(sky[0], sky[1])) * turn);
        }
        Ok(calibrated)
    }

    fn fits(&self, setup: &Setup) -> Result<(), String> {
        let own = &self.setup;
        let numbers = [
            ("a first carrier of", own.start_hz, setup.start_hz, "Hz"),
            ("steps of", own.step_hz, setup.step_hz, "Hz"),
            ("a rate of", own.sample_rate_hz, setup.sample_rate_hz, "Hz"),
            (
                "a transmitting gain of",
                own.transmit_gain_db,
                setup.transmit_gain_db,
                "dB",
            ),
            (
                "a reference gain of",
                own.receive_gain_db[0],
                setup.receive_gain_db[0],
                "dB",
            ),
            (
                "a receiving gain of",
                own.receive_gain_db[1],
                setup.receive_gain_db[1],
                "dB",
            ),
            (
                "carriers numbering",
                own.steps as f64,
                setup.steps as f64,
                "",
            ),
            (
                "samples a period of the tone numbering",
                own.period as f64,
                setup.period as f64,
                "",
            ),
        ];
        for (what, of, asked, unit) in numbers {
            if (of - asked).abs() > 1e-9 * of.abs() {
                return Err(format!("{what} {of} {unit}, and this has {asked}"));
            }
        }
        if own.hardware != setup.hardware || own.receive_antennas != setup.receive_antennas {
            let name = |setup: &Setup| {
                format!(
                    "{} at {}",
                    setup.hardware,
                    setup.receive_antennas.join(", ")
                )
            };
            return Err(format!("{}, and this is {}", name(own), name(setup)));
        }
        Ok(())
    }

    /// Writes it as JSON.
    ///
    /// # Errors
    /// If the disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_atomically(path, 0, |file| {
            serde_json::to_writer_pretty(&mut *file, self)?;
            file.write_all(b"\n")
        })
    }

    /// Reads it.
    ///
    /// # Errors
    /// If it cannot be read, or is none.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        let fault = |what: String| CalibrationError::File {
            path: path.display().to_string(),
            what,
        };
        let length = std::fs::metadata(path)
            .map_err(|error| fault(error.to_string()))?
            .len();
        if length > LONGEST_BYTES {
            return Err(fault(format!(
                "{length} bytes are too many for a calibration"
            )));
        }
        let text = std::fs::read(path).map_err(|error| fault(error.to_string()))?;
        let read: Self = serde_json::from_slice(&text)
            .map_err(|error| fault(format!("no calibration: {error}")))?;
        if read.sky.len() != read.setup.steps || read.amplitude == [0.0; 2] {
            return Err(fault(
                "a calibration has a value of the sky for each carrier, and an amplitude"
                    .to_owned(),
            ));
        }
        Ok(read)
    }
}
