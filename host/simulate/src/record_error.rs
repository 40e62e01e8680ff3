//! Why an experiment cannot be recorded.

use super::experiment::Experiment;
use subaperture_model::phase_history::ChannelError;
use subaperture_receive::ReceiveError;

/// An experiment cannot be recorded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A part of it does not make sense.
    #[error("{name}: {what}")]
    Unsuited {
        /// Name of the experiment.
        name: String,
        /// What is wrong, and what to do.
        what: String,
    },
    /// The echoes do not make phase history.
    #[error(transparent)]
    Receive(#[from] ReceiveError),
    /// The pairs of antennas do not share pulses.
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
