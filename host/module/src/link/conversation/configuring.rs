//! Configuration of a module before a run, one setting after another.
//!
//! ```text
//! Abort ──> Configure ──> Weights(0..) ──> Patch(0..) ──> Chip(0..), Power | Dpca, Detect ──> Ready
//! ```
//!
//! Each setting is a request: its command is repeated until the module's status confirms it.

use subaperture_core::link::{
    Command, Configuration, Refusal, State as ModuleState, Status, write_f32s,
};
use subaperture_core::stream::{Patch, Setup};

use crate::link::ending::LinkError;
use crate::link::products::{Detector, ImageSum, Request};

/// Number of weights per message: few, since short frames are less likely to be hit by line noise.
const WEIGHTS_A_FRAME: usize = 32;

/// Size of the weights of a message in bytes.
pub(super) const WEIGHT_BYTES: usize = 4 * WEIGHTS_A_FRAME;

/// Number of times a fully configured module is asked whether it is ready.
const READY_ATTEMPTS: u32 = 5;

/// Configuration data of a job.
pub(in crate::link) struct JobSettings<'j> {
    pub(in crate::link) setup: Setup,
    pub(in crate::link) fast_weights: &'j [f32],
    pub(in crate::link) patches: &'j [Patch],
    /// Number of pulses of all runs.
    pub(in crate::link) total_pulses: u32,
    pub(in crate::link) request: Request<'j>,
    /// Whether the samples come from the front end of the module.
    pub(in crate::link) from_front_end: bool,
}

impl JobSettings<'_> {
    /// Configuration of an empty job.
    pub(in crate::link) fn empty() -> Self {
        let setup = Setup {
            num_pulses: 1,
            num_channels: 1,
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
            total_pulses: 0,
            request: Request::Maps,
            from_front_end: false,
        }
    }
}

/// Step of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Setting {
    /// End any current activity.
    Abort,
    /// Start a new configuration with this number.
    Configure,
    /// Send the weights of this message.
    Weights(usize),
    /// Send this patch.
    Patch(usize),
    /// Send the chip of this patch.
    Chip(usize),
    /// Request the power of the sub-CPIs in place of their coherent sum.
    Power,
    /// Send the settings of the clutter cancellation.
    Dpca,
    /// Send the settings of the detector.
    Detect,
    /// Confirm that everything was received.
    Ready,
}

impl Setting {
    /// Step after this one.
    pub(super) fn next(self, job_settings: &JobSettings<'_>) -> Option<Self> {
        let weights = |n: usize| n * WEIGHTS_A_FRAME < job_settings.fast_weights.len();
        let patch = |n: usize| n < job_settings.patches.len();
        let image = match job_settings.request {
            Request::Image(image) => Some(image),
            _ => None,
        };
        let chip = |n: usize| image.is_some_and(|image| n < image.chips.len());
        let power = image.is_some_and(|image| image.sum == ImageSum::Power);
        let detector = match job_settings.request {
            Request::Detections(detector) => Some(detector),
            _ => None,
        };
        let cancels = detector.is_some_and(|detector| detector.dpca.is_some());
        match self {
            Self::Abort => Some(Self::Configure),
            Self::Configure if weights(0) => Some(Self::Weights(0)),
            Self::Weights(n) if weights(n + 1) => Some(Self::Weights(n + 1)),
            Self::Configure | Self::Weights(_) if patch(0) => Some(Self::Patch(0)),
            Self::Patch(n) if patch(n + 1) => Some(Self::Patch(n + 1)),
            Self::Patch(_) if chip(0) => Some(Self::Chip(0)),
            Self::Chip(n) if chip(n + 1) => Some(Self::Chip(n + 1)),
            Self::Chip(_) if power => Some(Self::Power),
            Self::Patch(_) if cancels => Some(Self::Dpca),
            Self::Patch(_) | Self::Dpca if detector.is_some() => Some(Self::Detect),
            Self::Ready => None,
            Self::Configure
            | Self::Weights(_)
            | Self::Patch(_)
            | Self::Chip(_)
            | Self::Power
            | Self::Dpca
            | Self::Detect => Some(Self::Ready),
        }
    }

    /// Command of the step. `id` is the configuration number.
    pub(super) fn command<'c>(
        self,
        id: u32,
        job_settings: &JobSettings<'_>,
        bytes: &'c mut [u8; WEIGHT_BYTES],
    ) -> Command<'c> {
        match self {
            Self::Abort => Command::Abort,
            Self::Configure => Command::Configure(Configuration {
                id,
                setup: job_settings.setup,
                total_pulses: job_settings.total_pulses,
                send_maps: matches!(job_settings.request, Request::Maps),
            }),
            Self::Weights(n) => {
                let first = n * WEIGHTS_A_FRAME;
                let end = job_settings.fast_weights.len().min(first + WEIGHTS_A_FRAME);
                Command::Weights {
                    first: first as u16,
                    weights: write_f32s(&job_settings.fast_weights[first..end], bytes)
                        .unwrap_or(&[]),
                }
            }
            Self::Patch(n) => Command::Patch {
                index: n as u16,
                count: job_settings.patches.len() as u16,
                patch: job_settings.patches[n],
            },
            Self::Power => Command::Power,
            Self::Chip(_) | Self::Dpca | Self::Detect | Self::Ready => {
                match (self, job_settings.request) {
                    (Self::Chip(n), Request::Image(image)) => Command::Chip(image.chips[n]),
                    (Self::Detect, Request::Detections(detector)) => Command::Detect(detector.cfar),
                    (
                        Self::Dpca,
                        Request::Detections(Detector {
                            dpca: Some(dpca), ..
                        }),
                    ) => Command::Dpca(dpca),
                    _ => Command::Status,
                }
            }
        }
    }

    /// Whether the status confirms this step of configuration `id`.
    pub(super) fn is_answered_by(self, status: &Status, id: u32) -> Result<bool, LinkError> {
        match self {
            Self::Abort => Ok(!is_busy(status)),
            Self::Configure => Ok(status.configuration == id),
            _ if status.configuration != id => Err(LinkError::Restarted),
            Self::Ready => Ok(status.state == ModuleState::Ready),
            Self::Weights(_)
            | Self::Patch(_)
            | Self::Chip(_)
            | Self::Power
            | Self::Dpca
            | Self::Detect => Ok(true),
        }
    }

    /// Number of attempts, given that of ordinary requests.
    pub(super) fn attempts(self, most: u32) -> u32 {
        match self {
            Self::Ready => READY_ATTEMPTS,
            _ => most,
        }
    }

    /// Meaning of an error at this step.
    pub(super) fn meaning(self, error: LinkError) -> LinkError {
        match (self, error) {
            // The module answers, but never that it is ready.
            (Self::Ready, LinkError::Silent) => LinkError::Refused(Refusal::NotConfigured),
            (_, error) => error,
        }
    }
}

/// Whether an answer may have been attributed to another request, so that a setting is missing and configuring again
/// helps.
pub(super) fn is_misattributed(error: &LinkError) -> bool {
    matches!(
        error,
        LinkError::Restarted
            | LinkError::Refused(
                Refusal::Weights | Refusal::PatchIndex | Refusal::NotConfigured | Refusal::Running
            )
    )
}

/// Whether a run is active.
fn is_busy(status: &Status) -> bool {
    matches!(status.state, ModuleState::Running | ModuleState::Finishing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_weight_and_patch_is_sent_once_and_in_order() {
        let weights = vec![0.5; 2 * WEIGHTS_A_FRAME + 1];
        let patches = [Patch::EMPTY; 2];
        let job_settings = JobSettings {
            fast_weights: &weights,
            patches: &patches,
            ..JobSettings::empty()
        };
        let steps: Vec<Setting> =
            std::iter::successors(Some(Setting::Abort), |step| step.next(&job_settings)).collect();
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
        let Command::Weights { first, weights } =
            Setting::Weights(2).command(1, &job_settings, &mut bytes)
        else {
            panic!("weights must be sent in a message of weights");
        };
        assert_eq!(
            (usize::from(first), weights.len()),
            (2 * WEIGHTS_A_FRAME, 4)
        );
    }
}
