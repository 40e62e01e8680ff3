//! Errors of opening a GPU.

/// Reason that no GPU was opened.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter of the kind asked for.
    NotFound {
        /// Names of all adapters.
        found: Vec<String>,
    },
    /// The adapter cannot be used.
    Refused {
        /// Name of the adapter.
        name: String,
        /// Message of the driver.
        why: String,
    },
}

impl std::fmt::Display for GpuError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotFound { found } if found.is_empty() => {
                f.write_str("no Vulkan or Metal driver was found; install the driver of your GPU")
            }
            Self::NotFound { found } => write!(
                f,
                "expected a GPU, found only drivers on the processor: {}",
                found.join(", ")
            ),
            Self::Refused { name, why } => write!(f, "{name}: {why}"),
        }
    }
}

impl std::error::Error for GpuError {}
