//! Calibration of cables, channels and the empty scene, stored in a file with its date.
//!
//! A calibration needs two captures: one of the empty scene (the sky), and one with reflectors at positions measured
//! by tape or laser. Their ranges are estimated together with those of all other echoes ([`Sweep::scatterers`]), so
//! that side lobes do not displace them.
//!
//! **Loopback reference.** The sky capture contains the leakage from antenna to antenna. With the sky's response `s_n`,
//! and the reflector's echo `a exp(-j 2 pi f_n (2 R / c + d))` in the difference,
//!
//! ```text
//! calibrated z_n = (z_n - s_n) exp(+j 2 pi f_n d) / a
//! ```
//!
//! so that ranges start at the tape's zero, and amplitudes are relative to the first reflector. With several reflectors, `d` is their
//! mean, and the residuals show errors of the survey. `d` is the delay of the
//! antenna cables minus that of the loopback cable. `a` contains the channels' gains and phases. Subtracting the sky requires that its leakage has not changed.
//!
//! **Leakage reference.** The sky capture is the frequency response of the leakage in both receivers
//! ([`super::leakage::Leakage::shapes`]), with phases such that receiver 0's response has the delay given by the
//! antenna positions. Dividing the echoes by it cancels cables, gains and phases that they share with the leakage:
//! range zero of each receiver is then at its antenna's phase centre. An antenna's phase differs between the sideways
//! and forward directions; this remainder, which differs between the receivers, is in each receiver's `d` and `a`,
//! measured by the reflector:
//!
//! ```text
//! calibrated z_i,n = z_i,n exp(+j 2 pi f_n d_i) / a_i
//! ```
//!
//! Neglected: the change of gains with frequency, and the reflector's phase. A trihedral has the phase of a point at
//! its apex.
//!
//! A calibration is valid for the carriers, tone, gains, ports, reference and antenna positions with which it was
//! measured, and is refused for others.

use std::io::Write;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use subaperture_io::atomic::{WriteError, write_atomically};
use subaperture_io::input::open_file;
use subaperture_io::json::{self, Limits};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;

use super::error::{CalibrationError, ProfileError};
use super::fits::differs;
use super::gaps;
use super::leakage::{Leakage, MAX_REACH, Solver};
use super::receiver::Receiver;
use super::sweep::{Steps, Sweep};
use crate::antennas::{Antennas, Reference};
use crate::sigmf::Setup;

/// Limits on a calibration file: two receivers with at most 65536 carriers each.
const LIMITS: Limits = Limits {
    bytes: 16 << 20,
    string_bytes: 64 << 10,
    value_bytes: 0,
};

/// Calibration of a radio set-up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Date of the measurement, in the caller's format.
    pub date: String,
    /// Set-up with which it was measured.
    pub setup: Setup,
    /// Calibration of each receiver with an antenna ([`Reference::receivers`]).
    pub receivers: Vec<Receiver>,
}

impl Calibration {
    /// Measure a calibration with a loopback reference from a sweep of the sky and a sweep with reflectors. `ranges_m`
    /// are half the paths from transmitter to reflector to receiver. The delay of the cables must be smaller than
    /// `search_m`: of all delays at which every reflector has an echo, that of the strongest echoes is used.
    ///
    /// # Errors
    /// If a sweep has too many gaps, or the reflector is not visible.
    pub fn measure(
        date: &str,
        setup: &Setup,
        sky: &Sweep,
        reflector: &Sweep,
        ranges_m: &[f64],
        search_m: f64,
    ) -> Result<Self, ProfileError> {
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * sky.step_hz);
        let reach_m = 0.75 * unambiguous_m;
        let sky = sky.filled(reach_m)?;
        let echo = reflector.filled(reach_m)?;
        let echo = Sweep {
            values: echo.iter().zip(&sky).map(|(z, s)| Some(z - s)).collect(),
            ..reflector.clone()
        };
        Ok(Self {
            date: date.to_owned(),
            setup: setup.clone(),
            receivers: vec![Receiver::of(&echo, &sky, ranges_m, search_m, reach_m)?],
        })
    }

    /// Measure a calibration with a leakage reference from the steps of the sky and of reflectors at `places_m` in body
    /// axes, metres.
    ///
    /// # Errors
    /// If the antenna positions are unknown, a sweep has too many gaps, the leakage is zero at a carrier, or the
    /// reflector is not visible.
    pub fn measure_leakage(
        date: &str,
        setup: &Setup,
        sky: &Steps,
        reflector: &Steps,
        places_m: &[DVec3],
        search_m: f64,
    ) -> Result<Self, ProfileError> {
        let Some(antennas) = setup.antennas else {
            return Err(ProfileError::Options(
                "a leakage calibration needs the antenna positions, which the recording does not contain: add [antennas] to the plan".to_owned(),
            ));
        };
        let shapes = shapes(&antennas, sky)?;
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz);
        let reach_m = MAX_REACH * unambiguous_m;
        let leakage = Leakage {
            delays_s: [0, 1].map(|i| antennas.direct_s(i)),
            shapes: Some(shapes.clone()),
        };
        let found = Solver::new(leakage, setup.step_hz, setup.steps, reach_m)?.solve(reflector)?;
        let receiver = |i: usize| {
            let legs = |place_m: &DVec3| {
                place_m.distance(antennas.transmitter_m) + place_m.distance(antennas.receivers_m[i])
            };
            let ranges_m: Vec<f64> = places_m.iter().map(|place_m| 0.5 * legs(place_m)).collect();
            let reach_m = 0.75 * unambiguous_m;
            Receiver::of(&found.sweeps[i], &shapes[i], &ranges_m, search_m, reach_m)
        };
        Ok(Self {
            date: date.to_owned(),
            setup: setup.clone(),
            receivers: vec![receiver(0)?, receiver(1)?],
        })
    }

    /// Apply a calibration with a loopback reference: subtract the empty scene, and remove the delay and gain of cables
    /// and channels.
    ///
    /// # Errors
    /// If the calibration was made with another set-up.
    pub fn apply(&self, setup: &Setup, sweep: &Sweep) -> Result<Sweep, CalibrationError> {
        self.check(setup)?;
        let [receiver] = self.receivers.as_slice() else {
            return Err(CalibrationError::Other {
                date: self.date.clone(),
                what:
                    "a leakage reference, but this sweep of one receiver has a loopback reference"
                        .to_owned(),
            });
        };
        let mut echo = sweep.clone();
        for (value, sky) in echo.values.iter_mut().zip(receiver.sky()) {
            *value = value.map(|z| z - sky);
        }
        Ok(receiver.corrected(&echo))
    }

    /// Frequency response of the leakage in both receivers; `None` for a calibration with a loopback reference.
    pub fn shapes(&self) -> Option<[Vec<Complex64>; 2]> {
        match self.receivers.as_slice() {
            [first, second] => Some([first, second].map(|receiver| receiver.sky().collect())),
            _ => None,
        }
    }

    /// Apply a calibration with a leakage reference: remove the delay and gain of receiver `i`.
    ///
    /// # Panics
    /// If the calibration has no receiver `i`.
    pub fn apply_to(&self, i: usize, sweep: &Sweep) -> Sweep {
        self.receivers[i].corrected(sweep)
    }

    /// Check that the calibration was made with this set-up.
    ///
    /// # Errors
    /// [`CalibrationError::Other`] with the first difference.
    pub fn check(&self, setup: &Setup) -> Result<(), CalibrationError> {
        match differs(&self.setup, setup) {
            None => Ok(()),
            Some(what) => Err(CalibrationError::Other {
                date: self.date.clone(),
                what,
            }),
        }
    }

    /// Write the calibration as a JSON file.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_atomically(path, 0, |file| {
            let mut text = serde_json::to_vec_pretty(self)?;
            text.push(b'\n');
            file.write_all(&text)
        })
    }

    /// Read a calibration file.
    ///
    /// # Errors
    /// If the file cannot be read or is not a valid calibration.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        let fault = |what: String| CalibrationError::File {
            path: path.display().to_string(),
            what,
        };
        let file = open_file(path).map_err(|error| fault(error.to_string()))?;
        let read: Self = json::typed(file, LIMITS)
            .map_err(|error| fault(format!("invalid calibration: {error}")))?;
        let whole = |receiver: &Receiver| {
            receiver.sky.len() == read.setup.band().count && receiver.amplitude != [0.0; 2]
        };
        let count = read.setup.reference.receivers().len();
        if read.receivers.len() != count || !read.receivers.iter().all(whole) {
            return Err(fault(
                "invalid calibration: expected, for each receiver, a sky value for every carrier and a non-zero amplitude"
                    .to_owned(),
            ));
        }
        let nothing = |sky: Complex64| sky == Complex64::ZERO;
        if read.setup.reference == Reference::Leakage
            && read.receivers.iter().any(|it| it.sky().any(nothing))
        {
            return Err(fault("invalid calibration: the leakage is zero at a carrier, and cannot be the reference".to_owned()));
        }
        Ok(read)
    }
}

/// Leakage of both receivers from the sky's steps, with phases such that receiver 0 has its geometric delay.
fn shapes(antennas: &Antennas, sky: &Steps) -> Result<[Vec<Complex64>; 2], ProfileError> {
    let [first, second] = [0, 1].map(|i| {
        let mut shape = sky.over(Reference::Leakage);
        for n in 0..shape.values.len() {
            let direct = phasor(-shape.frequency_hz(n) * antennas.direct_s(0));
            shape.values[n] = sky.mixed[n].map(|burst| match i {
                0 => direct * burst.reference,
                _ => burst.value * burst.reference * direct,
            });
        }
        shape
    });
    let filled = |shape: Sweep| {
        shape.check()?;
        // The direct wave and the differences of the cables have delays near zero.
        let reach_m = 0.25 * SPEED_OF_LIGHT_M_S / (2.0 * shape.step_hz);
        gaps::fill(&shape.values, shape.step_hz, reach_m).map_err(ProfileError::Options)
    };
    let shapes = [filled(first)?, filled(second)?];
    if shapes.iter().flatten().any(|z| *z == Complex64::ZERO) {
        return Err(ProfileError::Leakage(
            "no leakage received in the sky capture: check that both antennas are connected"
                .to_owned(),
        ));
    }
    Ok(shapes)
}
