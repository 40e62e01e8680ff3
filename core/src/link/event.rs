//! Events of the module: the content of its log.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::Refusal;

/// Severity of an event, as in defmt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Level {
    /// Normal operation, such as the start of a run.
    Info,
    /// Input was lost or refused; the module continues.
    Warn,
    /// The program was interrupted by a fault.
    Error,
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Info => "info",
            Self::Warn => "warning",
            Self::Error => "error",
        })
    }
}

/// Event of the module, for its operator. Counts are those since the previous event of the same kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Event {
    /// The program started. Also the first event after [`super::Command::Log`].
    Started {
        /// Number of resets after faults since power-on.
        faults: u32,
    },
    /// A run started and accepts pulses.
    RunStarted {
        /// Number of the run, chosen by the host.
        run: u32,
    },
    /// A run ended and everything was sent.
    RunEnded {
        /// Number of the run, chosen by the host.
        run: u32,
        /// Number of pulses accepted.
        pulses: u32,
        /// Number of maps processed.
        maps: u32,
    },
    /// A command was refused.
    Refused(Refusal),
    /// Frames were received damaged: a wrong checksum, invalid content, or too long.
    FramesDamaged {
        /// Number of damaged frames.
        frames: u32,
    },
    /// Frames are missing in the sequence.
    FramesLost {
        /// Number of lost frames.
        frames: u32,
    },
    /// Pulses were dropped because both stores were full, or because the first pulse of their sub-CPI is missing.
    PulsesDropped {
        /// Number of dropped pulses.
        pulses: u32,
    },
    /// Samples are at a limit of the converter's range.
    SamplesAtLimit {
        /// Number of such samples.
        samples: u32,
    },
    /// Results saturated in fixed point.
    ResultsSaturated {
        /// Number of saturated results.
        results: u32,
    },
    /// A processing step took longer than the receive buffer of the line lasts.
    StepTooLong {
        /// Duration of the step in microseconds.
        taken_us: u32,
        /// Maximum duration in microseconds.
        most_us: u32,
    },
    /// Events were dropped because the line was busy.
    EventsDropped {
        /// Number of dropped events.
        events: u32,
    },
    /// Cost of a run, at its end.
    RunCost {
        /// Largest part of the stack used since the start of the program, bytes.
        stack_bytes: u32,
        /// Size of the whole stack, bytes.
        stack_size_bytes: u32,
        /// Time of processing, in thousands of ticks of the board's timer.
        kiloticks: u32,
        /// Rate of the ticks, hertz. On a board that counts processor cycles, its clock.
        ticks_hz: u32,
    },
}

impl Event {
    /// Severity of the event.
    pub fn level(&self) -> Level {
        match self {
            Self::Started { faults: 0 }
            | Self::RunStarted { .. }
            | Self::RunEnded { .. }
            | Self::RunCost { .. } => Level::Info,
            Self::Started { .. } => Level::Error,
            Self::Refused(_)
            | Self::FramesDamaged { .. }
            | Self::FramesLost { .. }
            | Self::PulsesDropped { .. }
            | Self::SamplesAtLimit { .. }
            | Self::ResultsSaturated { .. }
            | Self::StepTooLong { .. }
            | Self::EventsDropped { .. } => Level::Warn,
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Started { faults } => {
                write!(f, "program started, {faults} resets after faults")
            }
            Self::RunStarted { run } => write!(f, "run {run} started"),
            Self::RunEnded { run, pulses, maps } => {
                write!(f, "run {run} ended: {pulses} pulses accepted, {maps} maps")
            }
            Self::Refused(refusal) => write!(f, "command refused: {refusal}"),
            Self::FramesDamaged { frames } => write!(f, "{frames} damaged frames received"),
            Self::FramesLost { frames } => write!(f, "{frames} frames lost"),
            Self::PulsesDropped { pulses } => {
                write!(
                    f,
                    "{pulses} pulses dropped: stores full, or first pulse of a sub-CPI missing"
                )
            }
            Self::SamplesAtLimit { samples } => {
                write!(f, "{samples} samples at the converter's limit")
            }
            Self::ResultsSaturated { results } => {
                write!(f, "{results} results saturated in fixed point")
            }
            Self::StepTooLong { taken_us, most_us } => {
                write!(f, "step of {taken_us} us: expected at most {most_us} us")
            }
            Self::EventsDropped { events } => {
                write!(f, "{events} events dropped: line busy")
            }
            Self::RunCost {
                stack_bytes,
                stack_size_bytes,
                kiloticks,
                ticks_hz,
            } => write!(
                f,
                "{stack_bytes} of {stack_size_bytes} bytes of stack used, {kiloticks} thousand ticks at {ticks_hz} Hz"
            ),
        }
    }
}
