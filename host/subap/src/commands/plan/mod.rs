//! `subap plan`: plan an image, or predict the needs of a module or a radar.

mod calibrate;
mod focus;
mod module;
mod radar;
mod radar_pictures;
mod signal_chain;
pub(super) mod speed;

use crate::args::{Plan, PlanTarget};
use crate::config::Session;

pub(crate) use module::gaps;

/// Print the requested plan.
pub(crate) fn run(session: &Session, typed: &Plan) -> anyhow::Result<()> {
    match &typed.target {
        PlanTarget::Calibrate(typed) => calibrate::run(session, typed),
        PlanTarget::Focus(typed) => focus::run(session, typed),
        PlanTarget::Module(typed) => module::run(session, typed),
        PlanTarget::Radar(typed) => radar::run(session, typed),
    }
}
