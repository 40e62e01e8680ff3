//! What a module is told before a run, one setting after another.
//!
//! ```text
//! Abort ──> Configure ──> Weights(0..) ──> Patch(0..) ──> Ready
//! ```
//!
//! Each is a question: a command that is sent until the module's status says that it was heard.

use subaperture_core::link::write_f32s;
use subaperture_core::link::{Command, Configuration, Refusal, State as ModuleState, Status};
use subaperture_core::stream::{Patch, Setup};

use crate::link::ending::LinkError;

/// Weights in a message: few, so that it is short beside line noise.
const WEIGHTS_A_FRAME: usize = 32;

/// Bytes of these.
pub(super) const WEIGHT_BYTES: usize = 4 * WEIGHTS_A_FRAME;

/// Times that a module which has been told everything is asked whether it is ready.
const READY_ATTEMPTS: u32 = 5;

/// What a module is told of a job.
pub(in crate::link) struct Told<'j> {
    pub(in crate::link) setup: Setup,
    pub(in crate::link) fast_weights: &'j [f32],
    pub(in crate::link) patches: &'j [Patch],
}

impl Told<'_> {
    /// A job of nothing.
    pub(in crate::link) fn nothing() -> Self {
        let setup = Setup {
            num_pulses: 1,
            num_frequencies: 1,
            range_length: 2,
            doppler_length: 1,
            start_hz: 0.0,
            step_hz: 0.0,
        };
        Self {
            setup,
            fast_weights: &[],
            patches: &[],
        }
    }
}

/// One step of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Setting {
    /// Whatever it is doing ends.
    Abort,
    /// A new configuration of this number begins.
    Configure,
    /// The weights of this message.
    Weights(usize),
    /// This patch.
    Patch(usize),
    /// Whether it has all of it.
    Ready,
}

impl Setting {
    /// The step after this one.
    pub(super) fn next(self, told: &Told<'_>) -> Option<Self> {
        let weights = |n: usize| n * WEIGHTS_A_FRAME < told.fast_weights.len();
        let patch = |n: usize| n < told.patches.len();
        match self {
            Self::Abort => Some(Self::Configure),
            Self::Configure if weights(0) => Some(Self::Weights(0)),
            Self::Weights(n) if weights(n + 1) => Some(Self::Weights(n + 1)),
            Self::Configure | Self::Weights(_) if patch(0) => Some(Self::Patch(0)),
            Self::Patch(n) if patch(n + 1) => Some(Self::Patch(n + 1)),
            Self::Configure | Self::Weights(_) | Self::Patch(_) => Some(Self::Ready),
            Self::Ready => None,
        }
    }

    /// What is sent for it; `id` is the configuration's number.
    pub(super) fn command<'c>(
        self,
        id: u32,
        told: &Told<'_>,
        bytes: &'c mut [u8; WEIGHT_BYTES],
    ) -> Command<'c> {
        match self {
            Self::Abort => Command::Abort,
            Self::Configure => Command::Configure(Configuration {
                id,
                setup: told.setup,
            }),
            Self::Weights(n) => {
                let first = n * WEIGHTS_A_FRAME;
                let end = told.fast_weights.len().min(first + WEIGHTS_A_FRAME);
                Command::Weights {
                    first: first as u16,
                    weights: write_f32s(&told.fast_weights[first..end], bytes).unwrap_or(&[]),
                }
            }
            Self::Patch(n) => Command::Patch {
                index: n as u16,
                count: told.patches.len() as u16,
                patch: told.patches[n],
            },
            Self::Ready => Command::Status,
        }
    }

    /// Whether this status says that configuration `id` has got it.
    pub(super) fn is_answered_by(self, status: &Status, id: u32) -> Result<bool, LinkError> {
        match self {
            Self::Abort => Ok(!is_busy(status)),
            Self::Configure => Ok(status.configuration == id),
            _ if status.configuration != id => Err(LinkError::Restarted),
            Self::Ready => Ok(status.state == ModuleState::Ready),
            Self::Weights(_) | Self::Patch(_) => Ok(true),
        }
    }

    /// Times that it is asked, given how often questions are.
    pub(super) fn attempts(self, most: u32) -> u32 {
        match self {
            Self::Ready => READY_ATTEMPTS,
            _ => most,
        }
    }

    /// What an error at this step means.
    pub(super) fn meaning(self, error: LinkError) -> LinkError {
        match (self, error) {
            // It answers, but never that it is ready.
            (Self::Ready, LinkError::Silent) => LinkError::Refused(Refusal::NotConfigured),
            (_, error) => error,
        }
    }
}

/// Whether an answer may have been taken for another's, so that something is missing there and
/// configuring again helps.
pub(super) fn is_mixed_up(error: &LinkError) -> bool {
    matches!(
        error,
        LinkError::Restarted
            | LinkError::Refused(
                Refusal::Weights | Refusal::PatchIndex | Refusal::NotConfigured | Refusal::Running
            )
    )
}

/// Whether a run is going on.
fn is_busy(status: &Status) -> bool {
    matches!(status.state, ModuleState::Running | ModuleState::Finishing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_weight_and_patch_is_told_once_and_in_order() {
        let weights = vec![0.5; 2 * WEIGHTS_A_FRAME + 1];
        let patches = [Patch::EMPTY; 2];
        let told = Told {
            fast_weights: &weights,
            patches: &patches,
            ..Told::nothing()
        };
        let steps: Vec<Setting> =
            std::iter::successors(Some(Setting::Abort), |step| step.next(&told)).collect();
        let expected = [
            Setting::Abort,
            Setting::Configure,
            Setting::Weights(0),
            Setting::Weights(1),
            Setting::Weights(2),
            Setting::Patch(0),
            Setting::Patch(1),
            Setting::Ready,
        ];
        assert_eq!(steps, expected);
        let mut bytes = [0; WEIGHT_BYTES];
        let Command::Weights { first, weights } = Setting::Weights(2).command(1, &told, &mut bytes)
        else {
            panic!("weights are told by a message of weights");
        };
        assert_eq!(
            (usize::from(first), weights.len()),
            (2 * WEIGHTS_A_FRAME, 4)
        );
    }
}
