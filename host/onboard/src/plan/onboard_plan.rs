//! What a module is to do, and whether it has room for that.

use subaperture_core::stream::{Capacity, Patch, Setup};

use super::{LinkBudget, RamBudget};
use crate::maps::Arithmetic;
use subaperture_focus::patch::PatchSize;

/// The room there is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Room {
    /// So many bytes for all buffers, which are built to suit.
    Ram {
        /// Bytes.
        bytes: u64,
    },
    /// Buffers as built.
    Built(Capacity),
}

/// What a module is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct OnboardPlan {
    /// Its settings.
    pub setup: Setup,
    /// Its patches, row by row of the grid.
    pub patches: Vec<Patch>,
    /// Its arithmetic.
    pub arithmetic: Arithmetic,
    /// Pixels a patch.
    pub patch_pixels: PatchSize,
    /// Taps of the kernels that the gates have room for.
    pub taps: usize,
    /// Sub-CPIs of the collection.
    pub num_sub_cpis: usize,
    /// Predicted relative RMS error of the image, dB.
    pub predicted_db: f64,
    /// First pulses after a gap in the track. Sub-CPIs go on across it, which may have kept all of them
    /// short.
    pub gaps: Vec<usize>,
    /// Memory of the buffers.
    pub ram: RamBudget,
    pub(super) capacity: Capacity,
}

impl OnboardPlan {
    /// Sizes of the smallest buffers that it fits.
    pub fn capacity(&self) -> Capacity {
        self.capacity
    }

    /// Whether there is room for it.
    pub fn fits(&self, room: &Room) -> bool {
        match room {
            Room::Ram { bytes } => self.ram.total_bytes <= *bytes,
            Room::Built(capacity) => {
                let patches = self.patches.iter();
                self.setup.check(capacity).is_ok()
                    && self.patches.len() <= usize::from(capacity.patches)
                    && patches
                        .clone()
                        .all(|patch| self.setup.check_patch(patch, capacity).is_ok())
            }
        }
    }

    /// What it costs on a link of `baud` bits a second.
    pub fn link(&self, baud: u32) -> LinkBudget {
        LinkBudget::new(self, baud)
    }
}
