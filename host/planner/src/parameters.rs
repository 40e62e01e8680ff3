//! Collection defined by numbers: a straight, level, broadside pass with a fixed range gate.
//!
//! The radar flies along x at constant speed and looks along +y to the scene centre at the origin, from
//! slant range `R` at grazing angle `g`: at closest approach it is at `(0, -R cos g, R sin g)`. The
//! defaults are those of Schone 2020, Table 4.1. Samples are referred to the fixed range `R` from the moving
//! radar, as in the thesis.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use serde::Serialize;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::{Collection, Pulse, Sweep};
use subaperture_model::quantity::{hertz, metres};

/// Largest number of pulses (1.7 GB of geometry).
const MAX_PULSES: usize = 1 << 24;

/// Parameters of a pass. Default: Table 4.1 with 256 frequencies and a scene of 80 x 80 m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parameters {
    /// Carrier (band centre), hertz.
    pub carrier_hz: f64,
    /// Bandwidth, hertz.
    pub bandwidth_hz: f64,
    /// Frequency samples per pulse.
    pub num_frequencies: usize,
    /// Slant range at closest approach, metres.
    pub range_m: f64,
    /// Grazing angle, radians, 0 to below pi / 2.
    pub grazing_rad: f64,
    /// Speed, metres per second.
    pub velocity_m_s: f64,
    /// Pulse repetition frequency, hertz.
    pub prf_hz: f64,
    /// Number of pulses.
    pub num_pulses: usize,
    /// Width of the scene along x and depth along y, metres.
    pub scene_m: [f64; 2],
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            carrier_hz: 10e9,
            bandwidth_hz: 200e6,
            num_frequencies: 256,
            range_m: 5000.0,
            grazing_rad: 0.0,
            velocity_m_s: 125.0,
            prf_hz: 1000.0,
            num_pulses: 1040,
            scene_m: [80.0, 80.0],
        }
    }
}

/// Invalid value of a parameter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ParameterError(String);

impl Parameters {
    /// Number of pulses over an aperture of `aperture_m`.
    pub fn pulses_over(&self, aperture_m: f64) -> usize {
        // The cast saturates; too large a count is refused later.
        (aperture_m * self.prf_hz / self.velocity_m_s).round() as usize
    }

    /// Aperture over which a broadside beam of full width `beamwidth_rad` illuminates the scene
    /// centre, `2 R tan(beam / 2)`, metres.
    pub fn aperture_of_beam_m(&self, beamwidth_rad: f64) -> f64 {
        2.0 * self.range_m * (beamwidth_rad / 2.0).tan()
    }

    /// Generate the collection.
    ///
    /// # Errors
    /// [`ParameterError`] if a parameter is not positive, not finite or too large.
    pub fn collection(&self) -> Result<Collection, ParameterError> {
        self.check()?;
        let step_hz = self.bandwidth_hz / self.num_frequencies as f64;
        let start_hz = self.carrier_hz - (self.num_frequencies / 2) as f64 * step_hz;
        let (sin, cos) = self.grazing_rad.sin_cos();
        let closest_m = DVec3::new(0.0, -self.range_m * cos, self.range_m * sin);
        let pulses = (0..self.num_pulses).map(|n| {
            let time_s = n as f64 / self.prf_hz;
            let middle = (self.num_pulses as f64 - 1.0) / 2.0;
            let along_m = self.velocity_m_s * (n as f64 - middle) / self.prf_hz;
            let radar_m = closest_m + DVec3::X * along_m;
            Pulse {
                time_s,
                transmitter_m: radar_m,
                receiver_m: radar_m,
                reference_m: radar_m - closest_m,
                reference_path_m: 2.0 * self.range_m,
                start_hz,
                step_hz,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        });
        let half = self.scene_m.map(|side_m| side_m / 2.0);
        Ok(Collection {
            name: "parameters".to_owned(),
            num_samples: self.num_frequencies,
            pulses: pulses.collect(),
            frame: SceneFrame::Local,
            extent: Some(Extent {
                x_m: (-half[0], half[0]),
                y_m: (-half[1], half[1]),
            }),
            timed: true,
        })
    }

    fn check(&self) -> Result<(), ParameterError> {
        let refuse = |text: String| Err(ParameterError(text));
        for (name, value) in [
            ("carrier", self.carrier_hz),
            ("bandwidth", self.bandwidth_hz),
            ("range", self.range_m),
            ("velocity", self.velocity_m_s),
            ("PRF", self.prf_hz),
            ("scene's width", self.scene_m[0]),
            ("scene's depth", self.scene_m[1]),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(format!("{name}: expected a number above 0, found {value}"));
            }
        }
        if self.bandwidth_hz >= 2.0 * self.carrier_hz {
            return refuse(format!(
                "a bandwidth of {} extends below 0 Hz at a carrier of {}; use a smaller bandwidth",
                hertz(self.bandwidth_hz),
                hertz(self.carrier_hz)
            ));
        }
        if !(0.0..FRAC_PI_2).contains(&self.grazing_rad) {
            return refuse("grazing angle: expected at least 0 and below 90 degrees".to_owned());
        }
        if !(2..=1 << 24).contains(&self.num_frequencies) {
            return refuse(format!(
                "number of frequencies: expected 2 to 16777216, found {}",
                self.num_frequencies
            ));
        }
        if !(2..=MAX_PULSES).contains(&self.num_pulses) {
            return refuse(format!(
                "number of pulses: expected 2 to {MAX_PULSES}, found {}; change the number or the aperture",
                self.num_pulses
            ));
        }
        if self.scene_m[1] >= 2.0 * self.range_m {
            return refuse(format!(
                "a scene depth of {} extends to the radar at a range of {}; use a smaller scene or a longer range",
                metres(self.scene_m[1]),
                metres(self.range_m)
            ));
        }
        Ok(())
    }

    /// Wavelength at the carrier, metres.
    pub fn wavelength_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / self.carrier_hz
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::phase_history::PhaseHistory;
    use subaperture_simulate::{Preset, Variation};

    #[test]
    fn default_parameters_are_table_4_1() {
        let ours = Parameters::default().collection().unwrap();
        let preset = Preset::Table41.simulate(&Variation::default());
        let theirs = &preset.collection().pulses;
        assert_eq!(ours.pulses.len(), theirs.len());
        for (a, b) in ours.pulses.iter().zip(theirs) {
            // Rounding of positions in kilometres.
            assert!(a.transmitter_m.distance(b.transmitter_m) < 1e-9);
            assert!((a.relative_path_m(DVec3::ONE) - b.relative_path_m(DVec3::ONE)).abs() < 1e-9);
            assert_eq!((a.start_hz, a.step_hz), (b.start_hz, b.step_hz));
        }
    }

    #[test]
    fn invalid_parameter_error_names_parameter() {
        let sound = Parameters::default();
        for (parameters, part) in [
            (
                Parameters {
                    carrier_hz: 0.0,
                    ..sound
                },
                "carrier",
            ),
            (
                Parameters {
                    prf_hz: f64::NAN,
                    ..sound
                },
                "PRF",
            ),
            (
                Parameters {
                    bandwidth_hz: 30e9,
                    ..sound
                },
                "below 0 Hz",
            ),
            (
                Parameters {
                    grazing_rad: 2.0,
                    ..sound
                },
                "grazing",
            ),
            (
                Parameters {
                    num_pulses: 1,
                    ..sound
                },
                "pulses",
            ),
            (
                Parameters {
                    num_pulses: usize::MAX,
                    ..sound
                },
                "pulses",
            ),
            (
                Parameters {
                    num_frequencies: 1,
                    ..sound
                },
                "frequencies",
            ),
            (
                Parameters {
                    scene_m: [10.0, 20e3],
                    ..sound
                },
                "scene depth",
            ),
        ] {
            let error = parameters.collection().unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
