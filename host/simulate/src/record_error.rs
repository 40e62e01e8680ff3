//! Error of recording an experiment.

use super::experiment::Experiment;
use subaperture_io::receive::ReceiveError;
use subaperture_model::phase_history::ChannelError;

/// Reason why an experiment cannot be recorded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// Part of the experiment is invalid.
    #[error("{name}: {what}")]
    Unsuited {
        /// Name of the experiment.
        name: String,
        /// Fault, and what to change.
        what: String,
    },
    /// The echoes cannot be converted into phase history.
    #[error(transparent)]
    Receive(#[from] ReceiveError),
    /// The channels of the antenna pairs do not share pulses.
    #[error(transparent)]
    Channels(#[from] ChannelError),
}

impl RecordError {
    pub(super) fn new(experiment: &Experiment, what: String) -> Self {
        Self::Unsuited {
            name: experiment.name.clone(),
            what,
        }
    }
}
