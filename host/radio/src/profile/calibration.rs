//! What cables, channels and the empty scene do, measured once and kept as a file with its date.
//!
//! Two captures make it: one of nothing (the sky), and one with one reflector in a place that was measured with a tape.
//!
//! **With a loop.** The sky holds the leakage from antenna to antenna. With `s_n` of the sky and the reflector's echo `a exp(-j 2 pi f_n (2 R / c + d))` in what is left,
//!
//! ```text
//! calibrated z_n = (z_n - s_n) exp(+j 2 pi f_n d) / a
//! ```
//!
//! so that ranges count from where the tape began, and amplitudes are relative to that reflector's. `d` is the delay of the antenna's cables
//! less that of the loop; `a` is read at the peak, so that channels' gains and phases are in it. The sky is taken off where its leakage stays what it was.
//!
//! **With the leakage as the reference** the sky is the leakage's own shape in both receivers ([`super::leakage::Leakage::shapes`]), of phases such that
//! receiver 0's is its delay's, by the antennas' places. Echoes over it are free of cables, gains and phases that they share with it: both receivers' zeros are those of the antennas' phase
//! centres. What antennas send sideways they send with another phase than ahead, and what differs between the receivers in it is in `d` and `a` of each, by the reflector:
//!
//! ```text
//! calibrated z_i,n = z_i,n exp(+j 2 pi f_n d_i) / a_i
//! ```
//!
//! Neglected: gains that change with frequency, and reflectors' phases: a trihedral's is that of a point at its apex.
//!
//! It holds for the carriers, the tone, the gains, the ports, the reference and the antennas' places it was made with, and is refused for others.

use std::io::Write;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use subaperture_io::atomic::{WriteError, write_atomically};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;

use super::error::{CalibrationError, ProfileError};
use super::fits::differs;
use super::gaps;
use super::leakage::{Leakage, MOST_REACH, Solver};
use super::sweep::{Steps, Sweep};
use super::transform::Peak;
use crate::antennas::{Antennas, Reference};
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
    /// Of each receiver with an antenna ([`Reference::receivers`]).
    pub receivers: Vec<Receiver>,
}

/// Of a receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Receiver {
    /// Delay to be taken off, seconds.
    pub delay_s: f64,
    /// Amplitude of the reflector, real and imaginary part.
    pub amplitude: [f64; 2],
    /// The empty scene, real and imaginary part of each carrier.
    pub sky: Vec<[f64; 2]>,
}

impl Receiver {
    /// Of a sweep without the sky's part, which has a reflector's echo after `path_m` from the transmitter to it and to the receiver; the strongest within `search_m` of half of that.
    fn of(
        sweep: &Sweep,
        sky: &[Complex64],
        path_m: f64,
        search_m: f64,
        reach_m: f64,
    ) -> Result<Self, ProfileError> {
        let range_m = 0.5 * path_m;
        let profile = sweep.profile(Window::default(), 32, reach_m)?;
        let near = |peak: &Peak| (peak.range_m - range_m).abs() <= search_m;
        let peaks = profile.peaks(0.0).into_iter().filter(near);
        let strongest = peaks.max_by(|a, b| a.magnitude.total_cmp(&b.magnitude));
        let Some(peak) = strongest.filter(|peak| peak.magnitude > 0.0) else {
            return Err(CalibrationError::NotSeen { range_m }.into());
        };
        let delay_s = 2.0 * (peak.range_m - range_m) / SPEED_OF_LIGHT_M_S;
        // What the echo is late by in all: with the phase of that taken off, carriers are in step at the peak, and their mean is its amplitude.
        let late_s = path_m / SPEED_OF_LIGHT_M_S + delay_s;
        let values = sweep.filled(reach_m)?;
        let weights = Window::default().weights(values.len());
        let in_step = values
            .iter()
            .zip(&weights)
            .enumerate()
            .map(|(n, (z, weight))| z * phasor(sweep.frequency_hz(n) * late_s) * weight);
        let amplitude = in_step.sum::<Complex64>() / weights.iter().sum::<f64>();
        Ok(Self {
            delay_s,
            amplitude: [amplitude.re, amplitude.im],
            sky: sky.iter().map(|z| [z.re, z.im]).collect(),
        })
    }

    /// The empty scene at each carrier.
    fn sky(&self) -> impl Iterator<Item = Complex64> {
        self.sky.iter().map(|z| Complex64::new(z[0], z[1]))
    }

    fn taken_off(&self, sweep: &Sweep) -> Sweep {
        let amplitude = Complex64::new(self.amplitude[0], self.amplitude[1]);
        let value = |(n, value): (usize, &Option<Complex64>)| {
            value.map(|z| z * phasor(sweep.frequency_hz(n) * self.delay_s) / amplitude)
        };
        Sweep {
            values: sweep.values.iter().enumerate().map(value).collect(),
            ..sweep.clone()
        }
    }
}

impl Calibration {
    /// With a loop: of a sweep of the sky and one with a reflector at `range_m`, half of the way from the transmitter to it and to the receiver; the strongest within
    /// `search_m` of there, and what cables add must be less.
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
        let echo = reflector.filled(reach_m)?;
        let echo = Sweep {
            values: echo.iter().zip(&sky).map(|(z, s)| Some(z - s)).collect(),
            ..reflector.clone()
        };
        Ok(Self {
            date: date.to_owned(),
            setup: setup.clone(),
            receivers: vec![Receiver::of(&echo, &sky, 2.0 * range_m, search_m, reach_m)?],
        })
    }

    /// With the leakage as the reference: of the steps of the sky and of a reflector at `place_m` in the body's axes.
    ///
    /// # Errors
    /// If the antennas' places are not known, a sweep has too many gaps, the leakage is nothing somewhere, or no reflector is seen.
    pub fn measure_leakage(
        date: &str,
        setup: &Setup,
        sky: &Steps,
        reflector: &Steps,
        place_m: DVec3,
        search_m: f64,
    ) -> Result<Self, ProfileError> {
        let Some(antennas) = setup.antennas else {
            return Err(ProfileError::Options(
                "a calibration of the leakage wants the antennas' places, and the recording does not say them: add [antennas] to the plan".to_owned(),
            ));
        };
        let shapes = shapes(&antennas, sky)?;
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz);
        let reach_m = MOST_REACH * unambiguous_m;
        let leakage = Leakage {
            delays_s: [0, 1].map(|i| antennas.direct_s(i)),
            shapes: Some(shapes.clone()),
        };
        let found = Solver::new(leakage, setup.step_hz, setup.steps, reach_m)?.solve(reflector)?;
        let receiver = |i: usize| {
            let path_m = place_m.distance(antennas.transmitter_m)
                + place_m.distance(antennas.receivers_m[i]);
            let reach_m = 0.75 * unambiguous_m;
            Receiver::of(&found.sweeps[i], &shapes[i], path_m, search_m, reach_m)
        };
        Ok(Self {
            date: date.to_owned(),
            setup: setup.clone(),
            receivers: vec![receiver(0)?, receiver(1)?],
        })
    }

    /// With a loop: a sweep without cables, channels and the empty scene.
    ///
    /// # Errors
    /// If it was made with another set-up.
    pub fn apply(&self, setup: &Setup, sweep: &Sweep) -> Result<Sweep, CalibrationError> {
        self.check(setup)?;
        let [receiver] = self.receivers.as_slice() else {
            return Err(CalibrationError::Other {
                date: self.date.clone(),
                what: "the leakage as the reference, and this is one receiver's sweep by a loop"
                    .to_owned(),
            });
        };
        let mut echo = sweep.clone();
        for (value, sky) in echo.values.iter_mut().zip(receiver.sky()) {
            *value = value.map(|z| z - sky);
        }
        Ok(receiver.taken_off(&echo))
    }

    /// The leakage's shape in both receivers, if it is of that.
    pub fn shapes(&self) -> Option<[Vec<Complex64>; 2]> {
        match self.receivers.as_slice() {
            [first, second] => Some([first, second].map(|receiver| receiver.sky().collect())),
            _ => None,
        }
    }

    /// With the leakage as the reference: what receiver `i` sees, without what is its own.
    ///
    /// # Panics
    /// If it is of no such receiver.
    pub fn apply_to(&self, i: usize, sweep: &Sweep) -> Sweep {
        self.receivers[i].taken_off(sweep)
    }

    /// Whether it was made with this set-up.
    ///
    /// # Errors
    /// What differs.
    pub fn check(&self, setup: &Setup) -> Result<(), CalibrationError> {
        match differs(&self.setup, setup) {
            None => Ok(()),
            Some(what) => Err(CalibrationError::Other {
                date: self.date.clone(),
                what,
            }),
        }
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
        let whole = |receiver: &Receiver| {
            receiver.sky.len() == read.setup.steps && receiver.amplitude != [0.0; 2]
        };
        let count = read.setup.reference.receivers().len();
        if read.receivers.len() != count || !read.receivers.iter().all(whole) {
            return Err(fault(
                "a calibration has of each receiver a value of the sky for each carrier, and an amplitude"
                    .to_owned(),
            ));
        }
        let nothing = |sky: Complex64| sky == Complex64::ZERO;
        if read.setup.reference == Reference::Leakage
            && read.receivers.iter().any(|it| it.sky().any(nothing))
        {
            return Err(fault("a leakage of nothing is no reference".to_owned()));
        }
        Ok(read)
    }
}

/// Of the sky's steps, the leakage of both receivers with the phases that receiver 0's delay has.
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
        // The direct way, and what cables differ by, are near 0.
        let reach_m = 0.25 * SPEED_OF_LIGHT_M_S / (2.0 * shape.step_hz);
        gaps::fill(&shape.values, shape.step_hz, reach_m).map_err(ProfileError::Options)
    };
    let shapes = [filled(first)?, filled(second)?];
    if shapes.iter().flatten().any(|z| *z == Complex64::ZERO) {
        return Err(ProfileError::Leakage(
            "no leakage is heard in the sky's capture: are both antennas connected?".to_owned(),
        ));
    }
    Ok(shapes)
}
