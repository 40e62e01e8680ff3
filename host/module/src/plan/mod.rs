//! Planning for an embedded module: a small computer on the platform that forms maps of patches
//! ([`subaperture_core::stream`]) and sends them to the host.
//!
//! [`ModulePlan`] selects sub-CPI length, patches and kernel. [`RamBudget`] lists the memory of every buffer,
//! [`LinkBudget`] the load on the link.

mod choosing;
mod link;
mod module_plan;
mod ram;
mod reach;
mod search;

pub use choosing::{PlanError, Requirements};
pub use link::{LinkBudget, ProductLoad};
pub use module_plan::{ModuleCapacity, ModulePlan, ModuleProduct};
pub(crate) use ram::least_capacity;
pub use ram::{Buffer, RamBudget, image_bytes};
