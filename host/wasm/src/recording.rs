//! Recordings opened from the bytes of files.

use std::path::Path;

use serde::Serialize;
use subaperture::convention::INFERENCE;
use subaperture::io::open::{Options, open_bytes};
use subaperture::monitor::Monitor;
use subaperture::phase_history::{Joined, PhaseHistory};
use subaperture::resolution::survey::Survey;

use crate::focused::Focused;
use crate::memory::MEMORY_BYTES;
use crate::request::{Grid, Request};

/// Files of one aperture, added one after another.
#[derive(Default)]
pub struct Files {
    parts: Vec<Box<dyn PhaseHistory>>,
    held_bytes: u64,
}

impl Files {
    /// Empty list of files.
    pub fn new() -> Self {
        Self::default()
    }

    /// Memory left for a further file and its samples, bytes.
    pub fn left_bytes(&self) -> u64 {
        MEMORY_BYTES.saturating_sub(self.held_bytes)
    }

    /// Open a file by its content; `name` is for messages.
    ///
    /// # Errors
    /// Text for the user, as that of [`open_bytes`].
    pub fn add(&mut self, name: &str, bytes: Vec<u8>) -> Result<(), String> {
        let options = Options {
            memory_bytes: self.left_bytes(),
            inference: Some(INFERENCE),
            ..Options::default()
        };
        let part =
            open_bytes(Path::new(name), bytes, &options).map_err(|error| error.to_string())?;
        self.held_bytes += part.held_bytes();
        self.parts.push(part);
        Ok(())
    }

    /// Join the files into one aperture, in any order of files.
    ///
    /// # Errors
    /// Text for the user: no files, files that do not fit together, or too little memory.
    pub fn open(self) -> Result<Recording, String> {
        let joining_bytes = Joined::joining_bytes(&self.parts);
        if joining_bytes > self.left_bytes() {
            return Err(format!(
                "the recording: expected at most {MEMORY_BYTES} bytes of memory, found {} bytes: choose fewer files",
                self.held_bytes + joining_bytes
            ));
        }
        let history = Joined::join(self.parts).map_err(|error| error.to_string())?;
        Ok(Recording { history })
    }
}

/// Recording opened from its files.
pub struct Recording {
    pub(crate) history: Joined,
}

/// Facts of a recording for the page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the collection.
    pub name: String,
    /// Number of pulses of all files.
    pub pulses: usize,
    /// Frequency samples per pulse.
    pub samples: usize,
    /// Middle of the lowest and the highest frequency, hertz.
    pub carrier_hz: f64,
    /// Bandwidth of the first pulse, hertz.
    pub bandwidth_hz: f64,
    /// Default grid; `None` with the reason in [`Self::warnings`].
    pub grid: Option<Grid>,
    /// Warnings for the user, one sentence each.
    pub warnings: Vec<String>,
}

impl Recording {
    /// Facts of the recording.
    ///
    /// # Errors
    /// The recording contains no pulses.
    pub fn summary(&self) -> Result<Summary, String> {
        let survey = Survey::of(self.history.collection());
        let survey = survey.ok_or("the recording: expected pulses, found none")?;
        let mut warnings = self.history.warnings();
        let grid = match survey.default_grid() {
            Ok(default) => {
                let (grid, cropped) = Grid::default_of(&default.grid);
                warnings.extend(default.cropped.filter(|_| !cropped));
                if cropped {
                    warnings.push(format!(
                        "grid: cropped about the scene centre to {} x {} m",
                        grid.size_m[0], grid.size_m[1]
                    ));
                }
                Some(grid)
            }
            Err(error) => {
                warnings.push(error.to_string());
                None
            }
        };
        Ok(Summary {
            pulses: survey.num_pulses,
            samples: survey.num_samples,
            carrier_hz: survey.lowest_hz.midpoint(survey.highest_hz),
            bandwidth_hz: survey.bandwidth_hz,
            grid,
            warnings,
            name: survey.name,
        })
    }

    /// Form an image.
    ///
    /// # Errors
    /// Text for the user: a fault of the request, or of the former.
    pub fn focus(&self, request: &Request, monitor: &dyn Monitor) -> Result<Focused, String> {
        Focused::form(&self.history, request, monitor)
    }
}
