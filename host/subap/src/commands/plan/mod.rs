//! `subap plan`: how an image will be formed, what a module or a radar needs.

mod calibrate;
mod focus;
mod module;
mod radar;

use crate::args::{Plan, PlanTarget};
use crate::config::Session;

pub(crate) use module::gaps;

/// Prints the plan asked for.
pub(crate) fn run(session: &Session, typed: &Plan) -> anyhow::Result<()> {
    match &typed.target {
        PlanTarget::Calibrate(typed) => calibrate::run(session, typed),
        PlanTarget::Focus(typed) => focus::run(session, typed),
        PlanTarget::Module(typed) => module::run(session, typed),
        PlanTarget::Radar(typed) => radar::run(session, typed),
    }
}
