//! Trials of all methods over many recordings.

use subaperture_model::phase_history::Channels;

use super::draw::TestTarget;
use super::method::Method;
use super::outcomes::{Outcome, Predicted, Setup, outcomes};
use crate::error::GmtiError;
use crate::space_time::Motion;

/// Target that was tested.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    pub(super) speed_m_s: f64,
    /// Probability that clutter alone exceeds the statistic; 1 outside of the image or maps.
    pub(super) probability: f64,
    pub(super) predicted: Option<Predicted>,
}

/// Trials of a method.
#[derive(Clone, Debug)]
pub(super) struct Trials {
    pub(super) method: Method,
    pub(super) targets: Vec<Trial>,
    /// Probabilities of motions without a target.
    pub(super) clutter: Vec<f64>,
}

/// Trials of all methods.
#[derive(Clone, Debug, Default)]
pub struct Evaluation {
    pub(super) trials: Vec<Trials>,
}

impl Evaluation {
    /// Test the targets of a recording.
    pub(super) fn add_targets(
        &mut self,
        channels: &Channels,
        setup: &Setup,
        targets: &[TestTarget],
    ) -> Result<(), GmtiError> {
        for (method, outcomes) in outcomes(channels, setup, &motions(targets))? {
            let trials = outcomes.iter().zip(targets);
            let trial = |(outcome, target): (&Option<Outcome>, &TestTarget)| Trial {
                speed_m_s: target.radial_velocity_m_s.abs(),
                probability: outcome.map_or(1.0, |outcome| outcome.probability),
                predicted: match outcome {
                    Some(outcome) => outcome.predicted,
                    None => method.has_theory().then(Predicted::default),
                },
            };
            self.of(method).targets.extend(trials.map(trial));
        }
        Ok(())
    }

    /// Test the motions of targets that the recording does not contain.
    pub(super) fn add_clutter(
        &mut self,
        channels: &Channels,
        setup: &Setup,
        absent: &[TestTarget],
    ) -> Result<(), GmtiError> {
        for (method, outcomes) in outcomes(channels, setup, &motions(absent))? {
            let inside = outcomes.iter().flatten();
            let probabilities = inside.map(|outcome| outcome.probability);
            self.of(method).clutter.extend(probabilities);
        }
        Ok(())
    }

    fn of(&mut self, method: Method) -> &mut Trials {
        let known = self
            .trials
            .iter()
            .position(|trials| trials.method == method);
        let index = known.unwrap_or_else(|| {
            self.trials.push(Trials {
                method,
                targets: Vec::new(),
                clutter: Vec::new(),
            });
            self.trials.len() - 1
        });
        &mut self.trials[index]
    }
}

fn motions(targets: &[TestTarget]) -> Vec<Motion> {
    targets.iter().map(|target| target.motion).collect()
}
