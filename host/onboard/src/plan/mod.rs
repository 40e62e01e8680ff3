//! Planning for a module: a small computer on the platform that makes maps of patches
//! ([`subaperture_core::stream`]) and sends them to the host.
//!
//! [`OnboardPlan`] chooses sub-CPI length, patches and kernel; [`RamBudget`] says what memory that takes,
//! buffer by buffer; [`LinkBudget`] what goes over the link.

mod choosing;
mod link;
mod onboard_plan;
mod ram;
mod reach;
mod search;

pub use choosing::{PlanError, Requirements};
pub use link::LinkBudget;
pub use onboard_plan::{OnboardPlan, Room};
pub(crate) use ram::least_capacity;
pub use ram::{Buffer, RamBudget};
