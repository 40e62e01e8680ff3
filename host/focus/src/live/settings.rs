//! How a live image is made, and why there is none.

use crate::{DEFAULT_ERROR_DB, FormError, machine};
use subaperture_model::quantity::bytes;
use subaperture_signal::window::Window;

/// How a live image is made.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Window over fast time.
    pub window: Window,
    /// Pulses that the image is of: the last so many. All so far, if `None`.
    pub last_pulses: Option<usize>,
    /// Bytes that it may hold; a pulse that is added takes up to 48 MiB besides.
    pub memory_bytes: u64,
}

impl Default for Settings {
    /// -60 dB, Taylor's window of 35 dB, all pulses, half of the machine's memory.
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
    /// With this bound on the relative RMS error, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db, ..self }
    }

    /// With this window over fast time.
    #[must_use]
    pub fn window(self, window: Window) -> Self {
        Self { window, ..self }
    }

    /// Of the last so many pulses.
    #[must_use]
    pub fn last_pulses(self, count: usize) -> Self {
        let last_pulses = Some(count);
        Self {
            last_pulses,
            ..self
        }
    }

    /// Within so many bytes.
    #[must_use]
    pub fn memory_bytes(self, memory_bytes: u64) -> Self {
        Self {
            memory_bytes,
            ..self
        }
    }
}

/// Why there is no live image, or why a pulse was not added. The image is as it was before.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// No pixels, no samples, or an aperture of no pulses.
    #[error("a live image needs pixels, samples and an aperture of at least one pulse")]
    Empty,
    /// It does not fit the memory allowed.
    #[error("a live image needs {} of the {} allowed", bytes(*needed_bytes), bytes((*allowed_bytes).into()))]
    Memory {
        /// Bytes needed.
        needed_bytes: u128,
        /// Bytes allowed.
        allowed_bytes: u64,
    },
    /// A pulse of another number of samples.
    #[error("the pulse has {given} samples, and pulses of this image have {expected}")]
    Samples {
        /// Its samples.
        given: usize,
        /// Those of every pulse.
        expected: usize,
    },
    /// A number that no radar has measured.
    #[error("the pulse is none: {what}")]
    Pulse {
        /// What is wrong with it.
        what: String,
    },
    /// A sample is NaN or infinite.
    #[error("sample {sample} of the pulse is not a finite number")]
    NotFinite {
        /// Its index, from 0.
        sample: usize,
    },
    /// The pulse was not backprojected: its error would be above the bound, it needs more memory, or the monitor
    /// asked to stop.
    #[error(transparent)]
    Form(#[from] FormError),
}
