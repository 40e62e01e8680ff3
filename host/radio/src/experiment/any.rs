//! Experiments of every kind.

use std::path::Path;

use subaperture_describe::{Description, DescriptionError};

use super::chirps::{self, ChirpExperiment};
use super::keys::{set, set_and_describe};
use super::{Experiment, ExperimentError, unread};
use crate::vna::{self, VnaExperiment};

/// Experiment with a radio, of stepped carriers or of chirps, or with a vector network analyser.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyExperiment {
    /// Stepped-frequency capture with a radio.
    Radio(Box<Experiment>),
    /// Capture of chirps with a radio.
    Chirps(Box<ChirpExperiment>),
    /// Capture with a vector network analyser.
    Analyser(Box<VnaExperiment>),
}

impl AnyExperiment {
    /// Read an experiment file within `memory_bytes`, and override keys with `settings`.
    ///
    /// # Errors
    /// If the file cannot be read; otherwise all faults of its text.
    pub fn read_within(
        path: &Path,
        settings: &[(String, String)],
        memory_bytes: u64,
    ) -> Result<Self, ExperimentError> {
        let description = Description::read_within(path, memory_bytes).map_err(unread(path))?;
        Ok(Self::describe(description, settings)?)
    }

    /// Make an experiment of the kind that the last of `settings`, or else the text, states.
    ///
    /// # Errors
    /// All faults of the text, with their lines.
    pub fn describe(
        mut description: Description,
        settings: &[(String, String)],
    ) -> Result<Self, DescriptionError> {
        let kinds = settings.iter().rev();
        let mut kinds = kinds.filter(|(key, _)| key == "device.kind");
        let kind = match kinds.next() {
            Some((_, kind)) => Some(kind.trim_matches('"').to_owned()),
            None => description.string_at("device", "kind"),
        };
        Ok(match kind.as_deref() {
            Some("vna") => {
                set(&mut description, &vna::SCHEMA, settings)?;
                Self::Analyser(Box::new(VnaExperiment::describe(&description)?))
            }
            _ if description.has_section("chirp").is_some() => {
                set(&mut description, &chirps::SCHEMA, settings)?;
                Self::Chirps(Box::new(ChirpExperiment::describe(&description)?))
            }
            _ => Self::Radio(Box::new(set_and_describe(description, settings)?)),
        })
    }
}
