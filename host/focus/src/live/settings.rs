//! Settings and errors of a live image.

use crate::{DEFAULT_ERROR_DB, FormError, machine};
use subaperture_model::quantity::bytes;
use subaperture_signal::window::Window;

/// Settings of a live image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Window over fast time.
    pub window: Window,
    /// Number of last pulses in the image; `None` for all pulses.
    pub last_pulses: Option<usize>,
    /// Memory limit, bytes; adding a pulse takes up to 48 MiB more.
    pub memory_bytes: u64,
}

impl Default for Settings {
    /// Defaults: -60 dB, Taylor window of 35 dB, all pulses, half of the machine's memory.
    fn default() -> Self {
        Self {
            error_db: DEFAULT_ERROR_DB,
            window: Window::default(),
            last_pulses: None,
            memory_bytes: machine::default_bytes(),
        }
    }
}

impl Settings {
    /// Set the bound on the relative RMS error, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db, ..self }
    }

    /// Set the window over fast time.
    #[must_use]
    pub fn window(self, window: Window) -> Self {
        Self { window, ..self }
    }

    /// Limit the image to the given number of last pulses.
    #[must_use]
    pub fn last_pulses(self, count: usize) -> Self {
        let last_pulses = Some(count);
        Self {
            last_pulses,
            ..self
        }
    }

    /// Set the memory limit, bytes.
    #[must_use]
    pub fn memory_bytes(self, memory_bytes: u64) -> Self {
        Self {
            memory_bytes,
            ..self
        }
    }
}

/// Reason that a live image cannot be made, or that a pulse was not added. The image is then unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// The grid has no pixels, pulses have no samples, or the aperture has no pulses.
    #[error(
        "expected at least one pixel, one sample per pulse and one pulse in the aperture of a live image"
    )]
    Empty,
    /// The memory limit is too small.
    #[error("a live image needs {} of the {} allowed", bytes(*needed_bytes), bytes((*allowed_bytes).into()))]
    Memory {
        /// Memory needed by the image, bytes.
        needed_bytes: u128,
        /// Memory limit of the settings, bytes.
        allowed_bytes: u64,
    },
    /// The pulse has a different number of samples.
    #[error("expected {expected} samples in a pulse of this image, got {given}")]
    Samples {
        /// Samples of the given pulse.
        given: usize,
        /// Samples of every pulse of the image.
        expected: usize,
    },
    /// The pulse has an invalid parameter.
    #[error("invalid pulse: {fault}")]
    Pulse {
        /// Description of the invalid parameter.
        fault: String,
    },
    /// A sample is NaN or infinite.
    #[error("sample {sample} of the pulse is not a finite number")]
    NotFinite {
        /// Index of the sample, from 0.
        sample: usize,
    },
    /// Backprojection of the pulse failed: its error would exceed the bound, it needs more memory, or the monitor
    /// cancelled it.
    #[error(transparent)]
    Form(#[from] FormError),
}
