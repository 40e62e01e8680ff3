//! Plan of a module, and check against its capacity.

use subaperture_core::stream::{Capacity, Patch, Setup};

use super::{LinkBudget, RamBudget};
use crate::maps::Arithmetic;
use subaperture_focus::patch::PatchSize;

/// Capacity of a module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ModuleCapacity {
    /// Total memory for all buffers, whose sizes are free.
    Ram {
        /// Memory in bytes.
        bytes: u64,
    },
    /// Buffers with fixed sizes.
    Built(Capacity),
}

/// Product that a module is planned for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ModuleProduct {
    /// Maps of all patches and sub-CPIs, from which the host forms the image.
    Maps,
    /// Targets detected on the maps.
    Detections,
    /// An image that the module accumulates from its maps.
    Image,
}

impl ModuleProduct {
    /// Name of the product: `maps`, `detections` or `image`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Maps => "maps",
            Self::Detections => "detections",
            Self::Image => "image",
        }
    }
}

/// Work plan of a module.
#[derive(Clone, Debug, PartialEq)]
pub struct ModulePlan {
    /// Settings of the stream processor.
    pub setup: Setup,
    /// Patches, row by row of the grid.
    pub patches: Vec<Patch>,
    /// Arithmetic of the module.
    pub arithmetic: Arithmetic,
    /// Size of a patch in pixels.
    pub patch_pixels: PatchSize,
    /// Number of interpolation taps that the range gates have room for.
    pub taps: usize,
    /// Number of sub-CPIs in the collection.
    pub num_sub_cpis: usize,
    /// Predicted relative RMS error of the image in dB.
    pub predicted_db: f64,
    /// Indices of the first pulses after gaps in the track. Sub-CPIs extend across gaps, which may have shortened all of
    /// them.
    pub gaps: Vec<usize>,
    /// Memory of the buffers for maps.
    pub ram: RamBudget,
    /// Product that the plan is made for.
    pub product: ModuleProduct,
    /// Additional memory for an accumulated image in bytes; 0 for maps.
    pub image_bytes: u64,
    /// Number of pulses of the collection.
    pub num_pulses: usize,
    /// Number of pixels of the grid.
    pub num_pixels: u64,
    pub(super) capacity: Capacity,
}

impl ModulePlan {
    /// Sizes of the smallest sufficient buffers.
    pub fn capacity(&self) -> Capacity {
        self.capacity
    }

    /// Number of maps: one per patch and sub-CPI.
    pub fn num_maps(&self) -> u64 {
        self.num_sub_cpis as u64 * self.patches.len() as u64
    }

    /// Memory of all buffers in bytes.
    pub fn total_bytes(&self) -> u64 {
        self.ram.total_bytes + self.image_bytes
    }

    /// Whether the plan fits the capacity.
    pub fn fits(&self, room: &ModuleCapacity) -> bool {
        match room {
            ModuleCapacity::Ram { bytes } => self.total_bytes() <= *bytes,
            ModuleCapacity::Built(capacity) => {
                let patches = self.patches.iter();
                self.setup.check(capacity).is_ok()
                    && self.patches.len() <= usize::from(capacity.patches)
                    && patches
                        .clone()
                        .all(|patch| self.setup.check_patch(patch, capacity).is_ok())
            }
        }
    }

    /// Load of the plan on a link of `baud` bits per second.
    pub fn link(&self, baud: u32) -> LinkBudget {
        LinkBudget::new(self, baud)
    }
}
