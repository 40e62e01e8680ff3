//! Calibrated response of the scene in each receiver, from the steps of a sweep.

use subaperture_model::SPEED_OF_LIGHT_M_S;

use super::calibration::Calibration;
use super::chirp;
use super::error::ProfileError;
use super::leakage::{Leakage, Solver};
use super::sweep::{Steps, Sweep};
use crate::antennas::Reference;
use crate::sigmf::{Recording, Setup};

/// Default maximum range as fractions of the unambiguous range, with a loopback reference and with a leakage reference.
const REACH: (f64, f64) = (0.75, 0.45);

/// Options of range processing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Phase reference; `None` uses that of the recording's plan.
    pub reference: Option<Reference>,
    /// Maximum range of echoes, metres. Default: that of the plan; three quarters of the unambiguous range with a
    /// loopback reference, 45 % with a leakage reference.
    pub reach_m: Option<f64>,
    /// Calibration of cables, channels and empty scene; `None` for none.
    pub calibration: Option<Calibration>,
}

/// Range processing: converts steps into calibrated sweeps.
#[derive(Debug)]
pub struct Ranging {
    reference: Reference,
    reach_m: f64,
    calibration: Option<Calibration>,
    /// Phase estimation with a leakage reference.
    solver: Option<Solver>,
}

impl Ranging {
    /// Make range processing for recordings of a set-up.
    ///
    /// # Errors
    /// If there are fewer than two carriers, `reach_m` exceeds the unambiguous range, or the calibration belongs to
    /// another set-up.
    pub fn new(setup: &Setup, options: Options) -> Result<Self, ProfileError> {
        let band = setup.band();
        if band.count < 2 {
            return Err(ProfileError::Options(
                "recording at a single frequency: a range profile needs at least two".to_owned(),
            ));
        }
        let reference = options.reference.unwrap_or(setup.reference);
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * band.step_hz);
        let part = match reference {
            Reference::Leakage => REACH.1,
            Reference::Loopback | Reference::None => REACH.0,
        };
        let reach_m = options
            .reach_m
            .or(setup.reach_m)
            .unwrap_or(part * unambiguous_m);
        if !(reach_m > 0.0 && reach_m <= unambiguous_m) {
            return Err(ProfileError::Options(format!(
                "reach of {reach_m} m: expected a value above 0 and at most the unambiguous range of {unambiguous_m:.2} m"
            )));
        }
        if setup.is_chirp() && reference != Reference::Loopback {
            return Err(ProfileError::Options(
                "recording of chirps: expected a loop as the reference".to_owned(),
            ));
        }
        if let Some(calibration) = &options.calibration {
            let asked = Setup {
                reference,
                ..setup.clone()
            };
            calibration.check(&asked)?;
        }
        let solver = match reference {
            Reference::Leakage => Some(solver(setup, options.calibration.as_ref(), reach_m)?),
            Reference::Loopback | Reference::None => None,
        };
        Ok(Self {
            reference,
            reach_m,
            calibration: options.calibration,
            solver,
        })
    }

    /// Maximum range, metres.
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Phase reference in use.
    pub fn reference(&self) -> Reference {
        self.reference
    }

    /// Read a sweep of a recording, and return the response of each receiver that has an antenna
    /// ([`Reference::receivers`]).
    ///
    /// # Errors
    /// Those of [`Steps::read`] and [`Self::sweeps`].
    pub fn read(
        &mut self,
        recording: &mut Recording,
        sweep: u64,
    ) -> Result<Vec<Sweep>, ProfileError> {
        if recording.setup().is_chirp() {
            let response = chirp::response(recording, sweep)?;
            return Ok(vec![self.calibrated(response)?]);
        }
        self.sweeps(&Steps::read(recording, sweep)?)
    }

    /// Response of each receiver that has an antenna.
    ///
    /// # Errors
    /// If the calibration does not fit, or the leakage cannot serve as the reference ([`super::leakage`]).
    pub fn sweeps(&mut self, steps: &Steps) -> Result<Vec<Sweep>, ProfileError> {
        if let Some(solver) = &mut self.solver {
            let found = solver.solve(steps)?.sweeps;
            return Ok(match &self.calibration {
                Some(calibration) => {
                    let each = found.iter().enumerate();
                    each.map(|(i, sweep)| calibration.apply_to(i, sweep))
                        .collect()
                }
                None => found.into(),
            });
        }
        Ok(vec![self.calibrated(steps.over(self.reference))?])
    }

    /// Response with a loopback reference, calibrated.
    pub(crate) fn calibrated(&self, sweep: Sweep) -> Result<Sweep, ProfileError> {
        Ok(match &self.calibration {
            // The set-up was checked by `new`.
            Some(calibration) => calibration.apply(&calibration.setup, &sweep)?,
            None => sweep,
        })
    }
}

fn solver(
    setup: &Setup,
    calibration: Option<&Calibration>,
    reach_m: f64,
) -> Result<Solver, ProfileError> {
    let Some(antennas) = setup.antennas else {
        return Err(ProfileError::Options(
            "a leakage reference needs the antenna positions, which the recording does not contain: add [antennas] to the plan".to_owned(),
        ));
    };
    let leakage = Leakage {
        delays_s: [0, 1].map(|i| antennas.direct_s(i)),
        shapes: calibration.and_then(Calibration::shapes),
    };
    Solver::new(leakage, setup.step_hz, setup.steps, reach_m)
}
