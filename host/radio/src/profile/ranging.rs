//! From a sweep's steps to what each receiver's antenna sees of the scene, calibrated.

use subaperture_model::SPEED_OF_LIGHT_M_S;

use super::calibration::Calibration;
use super::error::ProfileError;
use super::leakage::{Leakage, Solver};
use super::sweep::{Steps, Sweep};
use crate::antennas::Reference;
use crate::sigmf::{Recording, Setup};

/// Part of the unambiguous range that echoes are taken to reach where nothing is said, with a loop and by the leakage.
const REACH: (f64, f64) = (0.75, 0.45);

/// What ranges are made by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// What phases are referred to; what the recording's plan says if `None`.
    pub reference: Option<Reference>,
    /// The farthest echoes, metres; three quarters of the unambiguous range if `None`, 45 % of it where the reference is the leakage.
    pub reach_m: Option<f64>,
    /// What cables, channels and the empty scene do.
    pub calibration: Option<Calibration>,
}

/// Makes sweeps of steps, one after another.
#[derive(Debug)]
pub struct Ranging {
    reference: Reference,
    reach_m: f64,
    calibration: Option<Calibration>,
    /// Where the leakage is the reference.
    solver: Option<Solver>,
}

impl Ranging {
    /// For recordings of a set-up.
    ///
    /// # Errors
    /// Carriers that are too few; a reach beyond what can be told apart; a calibration of another set-up.
    pub fn new(setup: &Setup, options: Options) -> Result<Self, ProfileError> {
        if setup.steps < 2 {
            return Err(ProfileError::Options(
                "a recording at one carrier, as of chirps: range profiles are made across two carriers and more".to_owned(),
            ));
        }
        let reference = options.reference.unwrap_or(setup.reference);
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz);
        let part = match reference {
            Reference::Leakage => REACH.1,
            Reference::Loopback | Reference::None => REACH.0,
        };
        let reach_m = options.reach_m.unwrap_or(part * unambiguous_m);
        if !(reach_m > 0.0 && reach_m <= unambiguous_m) {
            return Err(ProfileError::Options(format!(
                "a reach of {reach_m} m; it is above 0 and no more than {unambiguous_m:.2} m"
            )));
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

    /// The farthest echoes, metres.
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// What phases are referred to.
    pub fn reference(&self) -> Reference {
        self.reference
    }

    /// A sweep of a recording, of each receiver that has an antenna ([`Reference::receivers`]).
    ///
    /// # Errors
    /// As [`Steps::read`] and [`Self::sweeps`].
    pub fn read(
        &mut self,
        recording: &mut Recording,
        sweep: u64,
    ) -> Result<Vec<Sweep>, ProfileError> {
        self.sweeps(&Steps::read(recording, sweep)?)
    }

    /// What each receiver that has an antenna sees.
    ///
    /// # Errors
    /// A calibration that does not fit; a leakage that is no reference ([`super::leakage`]).
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
        let sweep = steps.over(self.reference);
        let calibrated = match &self.calibration {
            // Whether it fits was seen to at the beginning.
            Some(calibration) => calibration.apply(&calibration.setup, &sweep)?,
            None => sweep,
        };
        Ok(vec![calibrated])
    }
}

fn solver(
    setup: &Setup,
    calibration: Option<&Calibration>,
    reach_m: f64,
) -> Result<Solver, ProfileError> {
    let Some(antennas) = setup.antennas else {
        return Err(ProfileError::Options(
            "the leakage as the reference wants the antennas' places, and the recording does not say them: add [antennas] to the plan".to_owned(),
        ));
    };
    let leakage = Leakage {
        delays_s: [0, 1].map(|i| antennas.direct_s(i)),
        shapes: calibration.and_then(Calibration::shapes),
    };
    Solver::new(leakage, setup.step_hz, setup.steps, reach_m)
}
