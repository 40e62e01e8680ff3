//! Accumulation of maps: coherent into image pixels, noncoherent into power.
//!
//! [`add_map`] adds whole maps ([`crate::Map`]) to pixels, `add_patch_map` (feature `stream`) those of patches.

mod centre;
#[cfg(feature = "stream")]
mod chip;
mod coherent;
#[cfg(feature = "stream")]
mod kernel;
mod power;

pub use centre::{Centre, PixelGrid};
#[cfg(feature = "stream")]
pub use chip::{ChipKernel, add_patch_map};
pub use coherent::add_map;
#[cfg(feature = "stream")]
pub use kernel::Kernel;
pub use power::add_power;
